"""Tables of the best grasps: flags in words, images on one line, explicit poses by their labels, forces that exist."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from softjaw.friction.frame import FrameFlag
from softjaw.study.cli import main
from softjaw.study.flags import Flag, raised
from softjaw.study.quantities import MODELS, quantities
from softjaw.study.result.layout import DONE, FAILED
from softjaw.study.result.read import axes_of
from softjaw.study.show.tables import show
from softjaw.study.show.tables.show import as_csv, as_json, best
from softjaw.study.show.tables.status import place, reasons

FORCES = np.array([1.0, 5.0])


def study(quality, flags=0.0, labels=None, status=DONE, needs=()):
    """Result with this quality ``(stations, angles)`` at both forces; with ``labels`` its candidates are poses."""
    quality = np.asarray(quality, dtype=float)
    shape = (*quality.shape, len(FORCES))
    over = ("station", "angle", "normal_force")
    every = np.broadcast_to(quality[..., None], shape)
    maps = {
        q.name: ((*over, *q.dims), np.broadcast_to(every[..., None], (*shape, 3)) if q.by_model else every,
                 {"units": q.unit})
        for q in quantities(needs) if q.group == "maps"
    }  # fmt: skip
    maps["flags"] = (over, np.broadcast_to(np.reshape(flags, (-1, 1, 1)), shape).astype(np.int64))
    maps["status"] = (over, np.full(shape, status))
    given = np.array(labels).reshape(-1, 1) if labels else np.full(quality.shape, "")
    axes = {"station": (np.arange(shape[0], dtype=float), "" if labels else "m"),
            "angle": (np.arange(shape[1]) * np.pi / 2, "rad"), "normal_force": (FORCES, "N")}  # fmt: skip
    coordinates = {name: (name, v, {"units": u, "long_name": name}) for name, (v, u) in axes.items()}
    coordinates |= {"label": (over[:2], given), "model": list(MODELS)}
    return xr.Dataset(maps, coordinates, {"planar": "pcm", "poses": bool(labels), "derived": (), "scene": ""})


def as_text(table, width=80):
    """The table below the answer."""
    return show.as_text(table, width).partition("\n\n")[2]


def stored(ds, message):
    """The same as `softjaw status` reads it."""
    return SimpleNamespace(axes=axes_of(ds), layout=SimpleNamespace(shape=ds.status.shape), status=ds.status.values,
                           messages=np.full(ds.status.shape, message), labels=ds.label.values)  # fmt: skip


@pytest.mark.parametrize("top", [1, 2, 3, 0])
def test_images_of_a_grasp_are_never_torn_apart_and_count_as_one(top):
    pairs = study([[4, 4], [3, 3], [2, 1]])
    lines = as_text(best(pairs, top=top, whole_lines=True), 200).splitlines()
    assert lines[3].split()[:4] == ["1,", "2", "0", "0,"]
    assert len(lines) == 4 + (top or 4)  # title, two lines of heads, and that no errors are known
    assert ("3, 4" in lines[-2]) == (top == 2)
    assert len(as_csv(best(pairs, top=top)).splitlines()) == 1 + (top or 6)


@pytest.mark.parametrize(
    ("bit", "word"),
    [
        (raised(FrameFlag.CYCLE), "cycle"),
        (raised(FrameFlag.ORIENTATION), "mixed"),
        (raised(FrameFlag.OVERHANG), "overhang"),
        (raised(FrameFlag.WINDING), "winding"),
        (Flag.SLIPS, "slips"),
        (Flag.COLLISION, "pads collide"),
        (Flag.COARSE, "coarse"),
        (Flag.UNSTABLE, "unstable"),
        (Flag.JUMPED, "jumped"),
    ],
)
def test_flags_are_words_with_a_legend(bit, word):
    text = as_text(best(study([[2.0], [1.0]], flags=[0.0, float(bit)])), 200)
    assert text.splitlines()[4].endswith(word)
    assert text.splitlines()[5].startswith(f"{word}: ")
    assert len(text.splitlines()) == 7


def test_explicit_poses_are_listed_by_their_labels():
    poses = stored(study([[2.0], [1.0]], labels=["near", "far"], status=FAILED), "no contact at this force")
    assert place(poses, 3) == '"far", normal_force 5 N'
    assert reasons(poses) == [
        "  failed 4 x no contact at this force",
        '      at "near", normal_force 1 N; "near", normal_force 5 N; "far", normal_force\n      1 N; and 1 more',
    ]
    assert place(stored(study([[2.0], [1.0]]), ""), 3) == "station 1000 mm, angle 0 deg, normal_force 5 N"


@pytest.mark.parametrize("force", ["-3", "0", "nan", "inf", "ten"])
@pytest.mark.usefixtures("every_rank_speaks")
def test_a_force_that_is_none_is_bad_usage(force, capsys):
    assert main(["show", "any.hdf", "--force", force]) == 2
    assert "--force" in capsys.readouterr().err


def rising(masses=None, safety=2, flags=0, **more):
    """Two stations: payload 0.1 and 0.2 kg per newton at 1 and 5 N, quality the other way round."""
    ds = study([[2.0], [1.0]], flags, needs=["mass"] if masses else (), **more)
    held = np.array([0.1, 0.2])[:, None, None] * FORCES
    ds["payload"] = (ds.payload.dims, np.repeat(held[..., None], 3, axis=-1), {"units": "kg"})
    if masses:
        ds["safety_factor"] = ds.payload / masses
        over = ds.status.dims[:-1]
        force = safety * masses / np.array([[0.1], [0.2]])
        ds = ds.assign(force_low=(over, np.where(force <= 5, force, np.nan)), force_low_error=(over, 0.01 * force))
        scene = f"[object]\nmass_g = {1e3 * masses}\n[task]\nsafety = {safety}\nweight_direction = 'worst'"
        ds = ds.assign_attrs(scene=scene, has=("mass", "task"))
    return ds


def stations(table):
    return [row[1] for row in table.rows]


def test_a_force_between_two_solved_ones_lies_on_straight_lines():
    names = [name for name, _ in best(rising()).columns]
    for force, held in ((1.0, 0.2), (2.5, 0.5), (5.0, 1.0)):
        table = best(rising(), force=force, by="payload")
        assert table.force == force
        assert [name for name, _ in table.columns] == names
        assert table.rows[0][names.index("payload")] == pytest.approx(held, rel=1e-12)
    for force in (0.9, 5.1):
        with pytest.raises(ValueError, match=f"{force:g} N was not solved.*1, 5 N"):
            best(rising(), force=force)


def test_between_forces_a_case_needs_both_and_carries_the_flags_of_both():
    ds = rising()
    ds.status.values[0, 0, 1] = FAILED
    ds.flags.values[1, 0, 0], ds.flags.values[1, 0, 1] = Flag.HOLE, Flag.COARSE
    table = best(ds, force=2.0)
    assert stations(table) == [1.0]
    assert table.rows[0][-1] == Flag.HOLE | Flag.COARSE
    ds.flags.values[1, 0, 1] = Flag.SNAPPED
    assert not best(ds, force=2.0).rows


def test_grasps_are_ranked_by_what_is_named_and_by_payload_where_there_is_a_task():
    assert stations(best(rising())) == [0.0, 1.0]
    assert stations(best(rising(), by="payload")) == [1.0, 0.0]
    assert stations(best(rising(0.3))) == [1.0, 0.0]
    assert stations(best(rising(0.3), by="quality", force=5.0)) == [1.0, 0.0]  # the other is too weak there
    assert stations(best(rising(0.1), by="quality")) == [1.0, 0.0]
    assert stations(best(rising(0.1), by="quality", force=5.0)) == [0.0, 1.0]


def test_the_smallest_force_that_holds_the_object_is_the_best_and_at_a_given_force_the_largest_payload():
    """At 5 N the second holds more, but the first needs less force to hold 150 g twice over."""
    ds = rising(0.15)
    ds.payload.values[0, 0], ds.payload.values[1, 0] = [[0.12], [0.45]], [[0.11], [0.9]]
    ds["force_low"].values[:] = [[3.2], [3.5]]
    ds["safety_factor"] = ds.payload / 0.15
    assert stations(best(ds)) == [0.0, 1.0]
    assert stations(best(ds, force=5.0)) == [1.0, 0.0]
    ds["force_low"].values[0] = np.nan
    assert stations(best(ds)) == [1.0, 0.0]


def test_without_a_mass_the_force_is_the_largest_that_most_share_and_with_one_the_lowest_that_holds():
    assert best(rising()).force == 5.0
    some = rising()
    some.status.values[0, 0, 1] = FAILED
    assert best(some).force == 1.0
    assert best(rising(0.3)).force == 5.0
    assert best(rising(0.1)).force == 1.0
    assert best(rising(3.0)).force == 5.0  # none holds it


def test_the_answer_says_how_hard_to_press_and_what_is_held():
    held = best(rising(0.3)).answer
    assert "press with 3 +- 0.03 N" in held
    assert "2 times the object's 300 g" in held
    assert "no solved force holds" in best(rising(3.0)).answer
    assert "press with 5 N per finger: it then holds 500 g" in best(rising()).answer
    assert json.loads(as_json(best(rising())))["answer"] == best(rising()).answer


def test_the_payload_has_a_column_in_grams():
    table = best(study([[0.2], [0.1]]))
    head, unit, first = as_text(table, 200).splitlines()[1:4]
    assert "payload" in head
    assert "[g]" in unit.split()
    assert float(first.split()[4]) == 200
    assert "payload [kg]" in as_csv(table).splitlines()[0]


WIDE = ("mass", "wall", "two meshes")


@pytest.mark.parametrize("width", [60, 80, 100, 200])
def test_a_table_fits_and_names_the_columns_that_it_leaves_out(width):
    walls = study([[4, 4], [3, 3]], flags=[0.0, float(Flag.SLIPS + Flag.COARSE + Flag.NOT_ANTIPODAL)], needs=WIDE)
    table = best(walls)
    lines = as_text(table, width).splitlines()
    assert max(map(len, lines)) <= width
    first = next(i for i, line in enumerate(lines) if line.strip().startswith(("rank", "station")))
    heads = f"{lines[first]} {lines[first + 1]}".split()
    hidden = " ".join(" ".join(lines).split()).partition(f"to fit {width} characters: ")[2]
    absent = hidden.partition(" (")[0].split(", ")
    for name in ("quality", "e_n", "flags", "station"):
        assert name in heads
    for name in ("fit_error", "f_x_max", "tau_z_max", "indentation"):
        assert (name in heads) != (name in absent)
    assert len(as_csv(table).splitlines()[0].split(",")) == len(table.columns)


def test_errors_stand_behind_what_they_belong_to_and_are_percent():
    known = study([[0.04]], needs=WIDE)
    names = [name for name, _ in best(known).columns]
    for name in ("e_n", "f_x_max", "f_y_max", "tau_z_max"):
        assert names[names.index(name) + 1] == f"{name}_error"
    text = as_text(best(known), 200)
    assert text.splitlines()[1].split().count("+-") == text.splitlines()[2].split().count("[%]") >= 4
    assert text.splitlines()[3].split().count("4") >= 4
    assert "errors of the mesh: not known" in as_text(best(study([[4.0]])))
    assert "not known" not in text


def test_the_largest_error_of_e_n_is_told_with_its_place_and_how_many_have_none():
    known = study([[0.5, 0.5], [0.5, 0.5]], needs=WIDE)
    errors = np.array([[[0.01, 0.002], [np.nan, np.nan]], [[0.018, np.nan], [0.5, 0.001]]])
    over, states = known.status.dims, np.full((2, 2, 2), DONE)
    states[1, 1, 0] = FAILED
    known["e_n_error"], known["status"] = (over, errors, {"units": ""}), (over, states)
    told = best(known).largest_error
    assert "1.8 % (station 1000 mm, angle 0 deg, normal_force 1 N)" in told
    assert "3 of 7 cases" in told
    assert "1 of 4 cases above 1 %" in told
    assert best(known, force=5.0).largest_error == told == json.loads(as_json(best(known)))["largest_error"]
    known["e_n_error"] = (over, np.full((2, 2, 2), np.nan), {"units": ""})
    assert "none of 7" in best(known).largest_error


def test_a_pose_is_shown_by_number_and_label_alone():
    lines = as_text(best(study([[2.0], [1.0]], labels=["near", "far from the rim of the box, lying"]))).splitlines()
    assert lines[2].split()[:4] == ["rank", "pose", "label", "quality"]
    assert lines[3].split()[:4] == ["1", "0", "near", "2.000"]
    assert "far from the rim ..." in lines[4]


def test_many_flags_go_on_below_and_many_images_are_a_range():
    text = as_text(best(study([[4, 4, 4]], flags=[float(Flag.SLIPS + Flag.COARSE + Flag.NOT_ANTIPODAL)])), 200)
    lines = text.splitlines()
    assert lines[3].split()[:3] == ["1..3", "0", "0..180"]
    assert lines[3].endswith("not antipodal")
    assert [line.strip() for line in lines[4:6]] == ["by 229 deg,", "slips, coarse"]
