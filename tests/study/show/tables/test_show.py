"""Tables of the best grasps: flags in words, images on one line, explicit poses by their labels, forces that exist."""

from __future__ import annotations

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
from softjaw.study.show.tables.show import as_csv, as_text, best
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
    return xr.Dataset(maps, coordinates, {"planar": "pcm", "poses": bool(labels), "derived": ()})


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


def test_a_force_between_the_levels_is_answered_with_the_nearest():
    assert best(study([[1.0]]), force=400.0).title.endswith("at 5 N, the level nearest to 400 N")
    assert best(study([[1.0]]), force=5.0).title.endswith("at 5 N")


def test_the_payload_has_a_column_in_grams():
    table = best(study([[0.2], [0.1]]))
    head, unit, first = as_text(table, 200).splitlines()[1:4]
    assert "payload" in head
    assert "[g]" in unit.split()
    assert float(first.split()[4]) == 200
    assert "payload [kg]" in as_csv(table).splitlines()[0]


WIDE = ("mass", "wall", "two meshes", "two scores")


@pytest.mark.parametrize("width", [60, 80, 100, 200])
def test_a_table_fits_and_names_the_columns_that_it_leaves_out(width):
    walls = study([[4, 4], [3, 3]], flags=[0.0, float(Flag.SLIPS + Flag.COARSE + Flag.NOT_ANTIPODAL)], needs=WIDE)
    table = best(walls)
    lines = as_text(table, width).splitlines()
    assert max(map(len, lines)) <= width
    heads = f"{lines[1]} {lines[2]}".split()
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


def test_a_pose_is_shown_by_number_and_label_alone():
    lines = as_text(best(study([[2.0], [1.0]], labels=["near", "far from the rim of the box, lying"]))).splitlines()
    assert lines[2].split()[:4] == ["rank", "pose", "label", "quality"]
    assert lines[3].split()[:4] == ["1", "0", "near", "2.000"]
    assert "far from the rim of the b..." in lines[4]


def test_many_flags_go_on_below_and_many_images_are_a_range():
    text = as_text(best(study([[4, 4, 4]], flags=[float(Flag.SLIPS + Flag.COARSE + Flag.NOT_ANTIPODAL)])), 200)
    lines = text.splitlines()
    assert lines[3].split()[:3] == ["1..3", "0", "0..180"]
    assert lines[3].endswith("not antipodal,")
    assert lines[4].strip() == "slips, coarse"
