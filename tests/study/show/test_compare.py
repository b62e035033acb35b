"""Two maps side by side, and cases for planners: what is told of files whose differences are known."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import softjaw as sj
from softjaw.study.messages import OTHER_FILE, USAGE
from softjaw.study.quantities import Axis
from softjaw.study.result.store import open_result
from softjaw.study.show.compare import compare, compare_text
from softjaw.study.table import as_csv, as_json
from tests.study.formula_results import SCENE, STATIONS, grid_axes, linear, make, window, without_result
from tests.study.launching import refusal, softjaw

SOFTER = SCENE + "[friction]\nmu = 0.5\n"


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compare")
    a = make(folder / "a.hdf", axes=grid_axes(STATIONS[:4]), meshes=2, e_n__error=0.01)

    def larger(station, angle, force):
        return linear(station, angle, force) * np.where(angle < 0.1, 1.005, 1.1)

    shared = grid_axes([*STATIONS[1:4], 0.1], forces=[2.0, 4.0, 5.0])
    b = make(folder / "b.hdf", larger, shared, SOFTER, meshes=2, e_n__error=0.01, **without_result(2, "slid"))
    return a, b


def compared(one, other, **options):
    return compare(sj.open(one), sj.open(other), **options)


def column(table, name):
    return np.array([np.nan if row[name] is None else row[name] for row in table.rows], float)


def test_common_places_are_found_by_value_and_differences_judged_by_the_errors_of_both_files(pair):
    found = compared(*pair)
    assert len(found.rows) == 3 * 6 * 2
    station = found.facts["axes"]["station"]
    assert station["common"] == pytest.approx(STATIONS[1:4])
    assert [station[key].tolist() for key in ("only_a", "only_b")] == [[0.0], [0.1]]
    assert [*found.facts["states"].values()] == [35, 1, 0, 0]
    assert found.facts["axes"]["normal_force"]["only_a"].tolist() == [1.0, 8.0]
    assert found.facts["settings"] == [{"key": "friction.mu", "a": None, "b": 0.5}]
    # 0.5 % stays within 1 % + 1 %, 10 % does not; a failed case has no difference.
    change, relative = column(found, "difference"), column(found, "relative")
    beyond = [row["beyond_error"] for row in found.rows]
    (failed,) = np.flatnonzero(np.isnan(change))
    assert failed == np.ravel_multi_index((2, 1, 1), (3, 6, 2))
    flat = np.ravel(np.broadcast_to((np.arange(6) == 0)[None, :, None], (3, 6, 2)))
    expected = np.where(flat, 0.005, 0.1)
    expected[failed] = np.nan
    assert relative == pytest.approx(expected, nan_ok=True)
    assert [value for value, here in zip(beyond, flat, strict=True) if here] == [False] * 6
    assert sum(value is True for value in beyond) == 29
    assert beyond[failed] is None
    (summary,) = (row for row in found.facts["summary"] if row["quantity"] == "e_n")
    assert (summary["compared"], summary["judged"], summary["beyond_error"]) == (35, 35, 29)
    assert summary["mean_b"] / summary["mean_a"] - 1 == pytest.approx(summary["mean"])
    assert summary["largest"] == pytest.approx(0.1)


def test_rounding_is_no_difference_and_errors_of_one_file_alone_are_unknown(pair, tmp_path):
    """Errors of 0 are exceeded by 1e-4 of a value, and not by what another order of operations may change."""
    one = sj.open(pair[0])
    one["e_n_error"][:] = 0.0
    for change, beyond in ((1e-13, False), (1e-4, True)):
        other = one.copy(deep=True)
        other["e_n"] *= 1 + change
        assert {row["beyond_error"] for row in compare(one, other).rows if row["a"]} == {beyond}
    found = compared(pair[0], make(tmp_path / "c.hdf"))
    assert {row["beyond_error"] for row in found.rows} == {None}
    assert not any(c.display for c in found.columns if c.name in ("error", "beyond_error"))
    assert found.facts["settings"] == []


def test_long_values_that_begin_alike_are_shown_where_they_differ(pair):
    def walled(wall):
        return sj.open(pair[0]).assign_attrs(scene=f"object.wall_mm = [[0, 0.5], [20, 0.3], [120, {wall}], [160, 1.2]]")

    (line,) = (line for line in compare_text(compare(walled(0.3), walled(0.4))).splitlines() if "wall_mm" in line)
    assert line.split("  ")[1:] == ["...0.3], [160, 1.2]]", "...0.4], [160, 1.2]]"]


def test_the_text_fits_a_terminal_largest_first_and_programs_get_every_common_case_in_si(pair):
    found = compared(*pair)
    lines = compare_text(found, top=3).splitlines()
    assert max(map(len, lines[2:])) <= 80
    title = next(i for i, line in enumerate(lines) if line.startswith("e_n [mm]: 3 of 35"))
    rows = lines[title + 3 : title + 6]
    changes = [float(line.split()[5]) for line in rows]
    assert changes == sorted(changes, reverse=True)
    assert changes[0] == pytest.approx(1e3 * np.nanmax(column(found, "difference")), rel=1e-3)
    assert all(line.split()[-1] == "yes" for line in rows)
    assert len(compare_text(found, top=0).splitlines()) == len(lines) + 32
    found = compared(*pair, quantity="quality", model="pcm")
    data = json.loads(as_json(found))
    assert data["axes"]["station"]["only_b"] == [0.1]
    (of_e_n,) = (row for row in data["summary"] if row["quantity"] == "e_n")
    assert (of_e_n["compared"], of_e_n["judged"]) == (35, 0)  # errors are of the curved model
    rows = list(csv.reader(io.StringIO(as_csv(found))))
    assert rows[0][:5] == ["station [m]", "angle [rad]", "normal_force [N]", "a", "b"]
    assert len(rows) - 1 == len(data["cases"]) == 36
    (empty,) = (row for row in data["cases"] if row["b"] is None)
    assert empty["difference"] is None
    with open_result(pair[0]) as result:
        assert data["cases"][0]["a"] == result.read("quality/pcm")[1, 0, 1]  # read back, so the same bits


@pytest.mark.parametrize(("axes", "name"), [
    (grid_axes([1.0]), "station"), (grid_axes(forces=[3.0]), "normal_force"),
    (grid_axes([0, 1], [0], poses=True), "station"),
    (grid_axes(sweep=(Axis("mu", np.array([0.5]), "", "friction.mu"),)), "axes"),
])  # fmt: skip
def test_maps_that_share_nothing_are_refused(pair, tmp_path, axes, name):
    other = make(tmp_path / "other.hdf", lambda *x: 0.01 + 0 * sum(x), axes)
    with refusal(USAGE, match=name):
        compared(pair[0], other)


def test_poses_are_shown_by_label_sweeps_by_word_and_commands_give_the_usual_codes(tmp_path, pair):
    def posed(name, *places, turn=0.0):
        where = {"axes": grid_axes([0, 1], [0], poses=True), "labels": ("lid", "neck")}
        at, R = np.array(places).reshape(2, 1, 1, 1, 1), Rotation.from_rotvec([[0, 0, 0], [0, 0, turn]]).as_matrix()
        return make(tmp_path / name, **where, fingers__pose_origin=lambda origin: 0.0 * origin + at,
                    fingers__pose_rotation=lambda x: 0.0 * x + R.reshape(2, 1, 1, 1, 3, 3))  # fmt: skip

    poses, others = posed("a.hdf", 0.0, 0.1), posed("b.hdf", 0.0, 0.2)
    otherwise, rolled = posed("c.hdf", 0.1, 0.0), posed("d.hdf", 0.0, 0.1, turn=1.0)
    assert [row["label"] for row in compared(poses, otherwise).rows[::4]] == ["lid", "neck"]
    assert {row["label"] for row in compared(poses, rolled).rows} == {"lid"}
    unsolved = posed("e.hdf", np.nan, 0.1)  # only its number is known
    assert [row["label"] for row in compared(poses, unsolved).rows[::4]] == ["lid", "neck"]
    found = compared(poses, poses)
    assert [row["label"] for row in found.rows[::4]] == ["lid", "neck"]
    assert " neck " in compare_text(found)
    assert {row["label"] for row in compared(poses, others).rows} == {"lid"}  # the other is elsewhere

    def swept(words):
        axis = Axis("material", np.arange(len(words), dtype=float), "", "gripper.material", tuple(words))
        name = "-".join(words)
        return make(tmp_path / f"{name}.hdf", lambda *x: 0.01 + x[0] + 0 * sum(x), grid_axes(sweep=(axis,)))

    found = compared(swept(["blatz_ko", "linear"]), swept(["blatz_ko", "hyperfoam"]))
    assert {row["material"] for row in found.rows} == {0.0}
    a, b = pair
    assert "2 of 35" in softjaw(0, "compare", a, b, "--top", 2)[1]
    assert json.loads(softjaw(0, "compare", a, b, "--json", "--model", "pcm")[1])["quantity"] == "e_n"
    code, _, errors = softjaw(0, "compare", a, b, "--quantity", "beauty")
    assert (code, "beauty" in errors) == (USAGE, True)
    assert softjaw(0, "compare", a, tmp_path / "none.hdf")[0] == OTHER_FILE
    assert softjaw(0, "compare", a)[0] == softjaw(0, "export", a)[0] == USAGE
    assert softjaw(0, "export", tmp_path / "none.hdf", "--json")[0] == OTHER_FILE


def test_what_walls_bear_is_compared_once_a_candidate_with_its_own_errors(tmp_path):
    axes = grid_axes(STATIONS[:4])
    (high,) = window(axes)
    derived = {"derived": (high, replace(high, name="force_high_error")), "derived__force_high_error": 0.25}
    one, other = (
        make(tmp_path / f"{force}.hdf", axes=axes, derived__force_high=force, **derived) for force in (4.0, 5.0)
    )
    found = compared(one, other, quantity="force_high")
    known = [row for row in found.rows if np.isfinite(row["difference"])]
    assert len(known) == 4 * 6  # stations and angles, not forces
    assert {(row["difference"], row["error"], row["beyond_error"]) for row in known} == {(1.0, 0.5, True)}
    assert "normal_force  " not in compare_text(found).partition("force_high [N]: ")[2]
