"""Two maps side by side, and cases for planners: what is told of files whose differences are known."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

import softjaw
from softjaw.study.cli import main
from softjaw.study.messages import CANNOT_WRITE, OTHER_FILE, RANK, USAGE, StudyError
from softjaw.study.result.store import StoredAxis, open_result
from softjaw.study.show.tables.compare import compare, comparison_csv, comparison_json, comparison_text
from tests.study.formula_results import (
    SCENE,
    STATIONS,
    grid_axes,
    linear,
    make,
    without_result,
)

SOFTER = SCENE + "[friction]\nmu = 0.5\n"


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Maps that share three stations and two forces; the second has a larger e_n, a failed case and another mu."""
    folder = tmp_path_factory.mktemp("compare")
    a = make(folder / "a.hdf", axes=grid_axes(STATIONS[:4]), meshes=2, e_n_error__e_n_error=0.01)

    def larger(station, angle, force):
        return linear(station, angle, force) * np.where(angle < 0.1, 1.005, 1.1)

    shared = grid_axes([*STATIONS[1:4], 0.1], forces=[2.0, 4.0, 5.0])
    b = make(folder / "b.hdf", larger, shared, SOFTER, meshes=2, e_n_error__e_n_error=0.01, **without_result(2, "slid"))
    return a, b


def compared(one, other, **options):
    return compare(softjaw.open(one), softjaw.open(other), **options)


def told(words, monkeypatch):
    for name in RANK:  # only the first rank of an mpirun speaks
        monkeypatch.delenv(name, raising=False)
    return main([str(word) for word in words])


def test_common_places_are_found_by_value_and_the_others_named(pair):
    found = compared(*pair)
    assert found.asked.change.shape == (3, 6, 2)
    assert found.axes[0].common == pytest.approx(STATIONS[1:4])
    assert [only.tolist() for only in found.axes[0].only] == [[0.0], [0.1]]
    text = comparison_text(found)
    assert "common cases: 35 solved in both, 1 only in a" in text
    assert "station only in a, left out: 0 mm" in text
    assert "station only in b, left out: 100 mm" in text
    assert "normal_force only in a, left out: 1 8 N" in text


def test_differences_are_judged_by_the_errors_of_both_files(pair):
    """0.5 % stays within 1 % + 1 %, 10 % does not; a failed case has no difference."""
    d = compared(*pair).asked
    failed = np.isnan(d.change)
    assert np.argwhere(failed).tolist() == [[2, 1, 1]]
    assert d.relative[:, 0] == pytest.approx(np.full((3, 2), 0.005))
    assert d.relative[:, 1:][~failed[:, 1:]] == pytest.approx(np.full(29, 0.1))
    assert d.beyond[:, 0].ravel().tolist() == [False] * 6
    assert [v for v in d.beyond[:, 1:].ravel() if v is not None] == [True] * 29
    assert d.exceed == (29, 35)
    summary = comparison_text(compared(*pair)).splitlines()
    assert summary[-1] == "29 of 35 differences of e_n exceed the errors of both files together"
    assert [line.split()[-1] for line in summary if line.startswith("quality ")] == ["-"]


def test_errors_of_one_file_alone_are_unknown(pair, tmp_path):
    d = compared(pair[0], make(tmp_path / "c.hdf"))
    assert set(d.asked.beyond.ravel()) == {None}
    assert d.asked.stated == (True, False)
    lines = comparison_text(d).splitlines()
    assert "not known: b states no error of e_n;" in " ".join(line.strip() for line in lines)
    assert not any("exceeds" in line for line in lines)  # no column where nothing could be said
    assert not d.settings
    assert "settings: no difference" in comparison_text(d)


def test_settings_that_differ_are_listed(pair):
    assert compared(*pair).settings == (("friction.mu", None, 0.5),)
    assert any(
        line.split() == ["friction.mu", "not", "set", "0.5"] for line in comparison_text(compared(*pair)).splitlines()
    )


def test_the_text_fits_a_terminal_and_lists_the_largest_first(pair):
    lines = comparison_text(compared(*pair), top=3).splitlines()
    assert max(map(len, lines[2:])) <= 80
    title = lines.index("e_n [mm]: 3 of 35 differences, the largest first")
    assert lines[title + 1].split() == ["station", "angle", "normal_force", "a", "b", "b-a", "b-a", "errors", "exceeds"]
    rows = lines[title + 3 : title + 6]
    changes = [float(line.split()[5]) for line in rows]
    assert changes == sorted(changes, reverse=True)
    assert all(line.split()[-1] == "yes" for line in rows)
    assert len(comparison_text(compared(*pair), top=0).splitlines()) == len(lines) + 32


def test_programs_get_every_common_case_in_si(pair):
    found = compared(*pair, quantity="quality", model="pcm")
    data = json.loads(comparison_json(found))
    assert data["settings"] == [{"key": "friction.mu", "a": None, "b": 0.5}]
    assert data["axes"]["station"]["only_b"] == [0.1]
    assert data["summary"]["e_n"] == {"compared": 35, "judged": 0, "beyond_error": 0}  # errors are of the curved model
    assert json.loads(comparison_json(compared(*pair)))["summary"]["e_n"]["beyond_error"] == 29
    rows = list(csv.reader(io.StringIO(comparison_csv(found))))
    assert rows[0][:5] == ["station [m]", "angle [rad]", "normal_force [N]", "quality a", "quality b"]
    assert len(rows) - 1 == len(data["cases"]) == 36
    empty = [row for row in data["cases"] if row["b"] is None]
    assert len(empty) == 1
    assert empty[0]["difference"] is None
    with open_result(pair[0]) as result:
        assert data["cases"][0]["a"] == result.read("quality/pcm")[1, 0, 1]


@pytest.mark.parametrize(
    ("axes", "word"),
    [
        (grid_axes([1.0]), "no common station [m]"),
        (grid_axes(forces=[3.0]), "no common normal_force [N]"),
        (grid_axes([0, 1], [0], poses=True), "different axes: station [m], angle [rad], normal_force [N] in"),
        (grid_axes(sweep=(StoredAxis("mu", np.array([0.5]), "", "friction.mu"),)), "different axes"),
    ],
)
def test_maps_that_share_nothing_are_refused(pair, tmp_path, axes, word):
    other = make(tmp_path / "other.hdf", lambda *x: 0.01 + 0 * sum(x), axes)
    with pytest.raises(StudyError, match=word.replace("[", r"\[").replace("]", r"\]")) as error:
        compared(pair[0], other)
    assert error.value.code == USAGE


def test_poses_are_shown_by_label_and_sweeps_of_words_by_word(tmp_path):
    poses = make(tmp_path / "a.hdf", axes=grid_axes([0, 1], [0], poses=True), labels=("lid", "neck"))
    assert [row["label"] for row in json.loads(comparison_json(compared(poses, poses)))["cases"][::4]] == [
        "lid",
        "neck",
    ]
    assert " neck " in comparison_text(compared(poses, poses))

    def swept(words):
        axis = StoredAxis("material", np.arange(len(words), dtype=float), "", "gripper.material", tuple(words))
        name = "-".join(words)
        return make(tmp_path / f"{name}.hdf", lambda *x: 0.01 + x[0] + 0 * sum(x), grid_axes(sweep=(axis,)))

    found = compared(swept(["blatz_ko", "linear"]), swept(["blatz_ko", "hyperfoam"]))
    assert found.axes[0].common.tolist() == [0.0]


def test_commands_give_the_usual_exit_codes(pair, tmp_path, capsys, monkeypatch):
    a, b = pair
    assert told(["compare", a, b, "--top", 2], monkeypatch) == 0
    assert "2 of 35 differences, the largest first" in capsys.readouterr().out
    assert told(["compare", a, b, "--json", "--model", "pcm"], monkeypatch) == 0
    assert json.loads(capsys.readouterr().out)["quantity"] == "e_n"
    assert told(["compare", a, b, "--quantity", "beauty"], monkeypatch) == USAGE
    assert "expected one that both files have: quality, " in capsys.readouterr().err
    assert told(["compare", a, tmp_path / "none.hdf"], monkeypatch) == OTHER_FILE
    assert told(["compare", a], monkeypatch) == USAGE
    assert told(["export", a], monkeypatch) == USAGE
    assert told(["export", a, "--csv", "-o", tmp_path / "out.csv"], monkeypatch) == 0
    assert (tmp_path / "out.csv").read_text().count("\n") == 1 + 4 * 6 * 4
    assert told(["export", a, "--csv", "-o", tmp_path / "no" / "out.csv"], monkeypatch) == CANNOT_WRITE
    assert told(["export", tmp_path / "none.hdf", "--json"], monkeypatch) == OTHER_FILE
