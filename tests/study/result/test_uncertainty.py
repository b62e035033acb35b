"""Uncertainty intervals of e_n and quality: closed forms, what probes carry to other cases, the verdict on the best."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

import softjaw
from softjaw.fem.objects.gap import Pose
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.closed_form import volume_linf
from softjaw.study.case import candidates, probing
from softjaw.study.case.candidates import axis_poses
from softjaw.study.case.probing import _in_object, _scaled_lean, _volume
from softjaw.study.case.variations import by_formula, moved_poses, variations
from softjaw.study.export.cases import cases
from softjaw.study.lookup import GraspMap
from softjaw.study.result import interval
from softjaw.study.result.interval import derived
from softjaw.study.result.layout import Derived, Layout
from softjaw.study.scene import SceneError, parse_scene
from softjaw.study.show.tables.certainty import Sure, sure, verdict
from softjaw.study.show.tables.compare import compare
from softjaw.study.show.tables.show import as_text, best
from tests.study.formula_results import OBJECT, grid_axes, make

BALL = (
    OBJECT
    + """[gripper]
elements = [8, 4, 3]
[candidates]
stations_mm = [-10, 0, 20]
angles_deg = [0, 90]
[load]
normal_force_n = [1, 2, 4]
[accuracy]
meshes = 1
[effects]
friction_pressure_coupling = "none"
"""
)
ALL = ("uncertainty.mesh=true", "uncertainty.mu=0.05", "uncertainty.shear_modulus_percent=10", "uncertainty.pose_mm=1")


def scene(*overrides):
    return parse_scene(BALL, "ball.toml", overrides)


# --- closed forms ----------------------------------------------------------------------------------------------------


def facing(distance):
    """Two contacts that face each other, as `study.case.probing` reads them from a file."""
    turned = np.diag([1.0, -1.0, -1.0])
    return {
        "frame_origin": np.zeros((2, 3)), "frame_axes": np.array([np.eye(3)] * 2),
        "pose_rotation": np.array([np.eye(3), turned]), "pose_origin": np.array([[0, 0, 0], [0, 0, distance]]),
    }  # fmt: skip


@pytest.mark.parametrize("share", [0.01, 0.1, 0.3])
def test_the_quality_goes_with_the_fifth_power_of_mu_where_contacts_face_each_other(share):
    axes, d = np.array([[0.8, 0.7, 0.01], [0.8, 0.6, 0.012]]), 0.05
    volumes = [
        volume_linf(*(x for a in axes * t for x in (Ellipsoid(a).volume, Ellipsoid(a).shadow_area)), d)
        for t in (1.0, 1 + share, 1 - share)
    ]
    assert probing.facing_change_by_mu(share) == pytest.approx((volumes[1] - volumes[2]) / (2 * volumes[0]), rel=1e-12)
    nowhere = Pose(np.eye(3), np.zeros(3))
    frames = _in_object(nowhere, *facing(d).values())
    stored = [_volume(*frames, t * axes, np.ones(3), 1.0) for t in (1.0, 1 + share, 1 - share)]
    assert (stored[1] - stored[2]) / (2 * stored[0]) == pytest.approx(probing.facing_change_by_mu(share), rel=1e-6)
    assert stored[0] == pytest.approx(volumes[0], rel=1e-6)


def test_contacts_face_each_other_in_the_object_s_frame_where_their_scaled_line_does():
    """Contacts along z of a file whose object lies along x and y of it: only unequal lengths turn their line."""
    turn = Rotation.from_euler("x", 0.3).as_matrix()
    origin, axes = _in_object(Pose(turn, np.array([0.1, 0.2, 0.3])), *facing(0.05).values())
    line = turn.T @ [0, 0, 0.05]
    assert origin[1] - origin[0] == pytest.approx(line, abs=1e-15)
    assert axes[0, 2] == pytest.approx(line / 0.05, abs=1e-15)
    assert float(_scaled_lean(origin, axes, np.full(3, 0.07))) < 1e-12
    scaled = line / [0.1, 0.05, 0.1]
    lean = np.arccos(scaled @ line / np.linalg.norm(scaled) / 0.05)
    assert float(_scaled_lean(origin, axes, np.array([0.1, 0.05, 0.1]))) == pytest.approx(lean, rel=1e-9)


@pytest.mark.parametrize("power", [-1.0, 0.0, 0.7])
def test_a_stiffer_pad_is_a_smaller_force(power):
    force = np.array([1.0, 2.0, 3.0, 7.0])
    changed = interval.change_by_modulus(force, np.array([3 * force**power, np.full(4, np.nan)]), 0.05)
    assert np.allclose(changed[0], -0.05 * power, atol=1e-14)
    assert np.isnan(changed[1]).all()


def test_moved_pads_still_face_each_other():
    one, two = moved_poses(axis_poses(0.03, 0.4, 0.2), 0.002, 0.1)
    before = axis_poses(0.03, 0.4, 0.2)
    for pose, old in zip((one, two), before, strict=True):
        assert np.allclose(pose.rotation[:, 2], old.rotation[:, 2], atol=1e-14)  # the same approach
        assert pose.rotation[:, 0] @ old.rotation[:, 0] == pytest.approx(np.cos(0.1))
        assert np.allclose(pose.origin - old.origin, 0.002 * old.rotation[:, 0], atol=1e-12)
    assert np.allclose(one.rotation[:, 0], two.rotation[:, 0])
    assert np.cross(before[0].rotation[:, 0], one.rotation[:, 0]) @ one.rotation[:, 2] == pytest.approx(np.sin(0.1))


def test_a_mesh_error_falls_with_the_contact_area_and_a_probe_keeps_its_own():
    change, area = np.array([[0.02, 0.01]]), np.array([[1.0, 2.0]])
    assert np.allclose(interval.carried(change, area, np.array([[1.0, 4.0]])), [[0.04, 0.01]])
    values = np.array([[1.0, 2.0], [5.0, 6.0], [1.0, 2.0]])  # the third is an image of the first
    share = interval.at_least_own(np.full((3, 2), 0.01), np.array([[-0.3, np.nan]]), (0,), values)
    assert share.tolist() == [[0.3, 0.01], [0.01, 0.01], [0.3, 0.01]]


# --- the scene -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "known", "solves"),
    [
        ((), ("mu", "modulus"), 3),
        (("accuracy.meshes=2",), ("mesh", "mu", "modulus"), 2),
        (("effects.sheet=elastic",), ("mu",), 4),
        (("effects.friction_pressure_coupling=tangential",), ("modulus",), 4),
        (("effects.friction_pressure_coupling=auto",), ("modulus",), 4),
        (("load.normal_force_n=[2]",), ("mu",), 4),
        (("uncertainty.pose_deg=2",), ("mu", "modulus"), 5),
        (("uncertainty.pose_deg=2", "object.semi_axis_b_mm=25"), ("mu", "modulus"), 4),  # round: both turns are alike
        (("uncertainty.pose_deg=2", "object.semi_axis_b_mm=25", "candidates.roll_deg=20"), ("mu", "modulus"), 5),
        (("object.wall_mm=1", "object.open_top=true"), None, None),
    ],
)
def test_what_needs_no_further_solves_gets_none(more, known, solves):
    if known is None:
        with pytest.raises(SceneError):
            scene(*ALL, *more)  # a cylinder has no wall
        return
    asked = scene(*ALL, *more)
    assert by_formula(asked) == known
    assert len(variations(asked)) == solves
    assert {v.part for v in variations(asked)}.isdisjoint(known)


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("uncertainty.mu=0.8", "less than friction.mu"),
        ("uncertainty.wall_thickness_percent=5", "without a wall"),
        ('uncertainty.probes=[0, "0 mm, 91 deg"]', "did you mean"),
        ("uncertainty.probes=[6]", "0 to 5"),
        ("uncertainty.probes=1", ">= 2"),
    ],
)
def test_wrong_uncertainties_are_told_of(override, told):
    with pytest.raises(SceneError, match=told):
        scene(override)


def test_intervals_and_a_sweep_exclude_each_other():
    text = BALL + '[sweep]\n"object.semi_axis_b_mm" = [15, 20]\n'
    parse_scene(text, "ball.toml")
    with pytest.raises(SceneError, match="without a sweep"):
        parse_scene(text, "ball.toml", ALL[:1])


def test_files_of_scenes_without_intervals_keep_their_digest():
    assert scene().digest == scene("uncertainty.probes=7").digest != scene(ALL[0]).digest
    assert derived(scene("uncertainty.probes=7")) == []
    names = [d.name for d in derived(scene(*ALL))]
    assert names[:5] == [
        "e_n_interval",
        "e_n_interval_mesh",
        "e_n_change_mu",
        "e_n_change_modulus",
        "e_n_interval_pose",
    ]


def test_named_probes_are_those_that_are_solved():
    from softjaw.study.case.variations import probe_candidates, with_probes

    given = scene(*ALL, 'uncertainty.probes=["20 mm, 90 deg", 0]')
    units = candidates.units(given, lambda point: point.axis_symmetry)
    chosen = probe_candidates(given, units)
    assert chosen == (0, 5)
    marked = [unit for unit in with_probes(given, units, chosen) if unit.probe]
    assert [unit.candidate.label for unit in marked] == ["-10 mm, 0 deg", "20 mm, 90 deg"]
    assert [unit.cost for unit in marked] == [4 * units[0].cost, 4 * units[-1].cost]
    spread = probe_candidates(scene(*ALL, "uncertainty.probes=2"), units)
    assert len(spread) == 2
    assert probe_candidates(scene(), units) == ()


def test_values_of_probes_stand_at_their_places():
    layout = Layout(grid_axes(), 0, patches=False, probes=(2, 7), variations=("a", "b", "c"))
    keys = [c.key for c in layout.columns]
    at = keys.index("probes/e_n")
    assert layout.columns[at].shape == (3,)
    forces = layout.shape[-1]
    assert layout.places(7 * forces + 1)[at] == (1, 1)
    assert layout.places(6 * forces + 1)[at] is None
    found = {d.path: d.shape for d in layout.datasets}
    assert found["/study/probes/quality"] == (2, forces, 3)
    assert found["/study/probes/candidate"] == (2,)


def test_what_fails_at_a_probe_harms_nothing(monkeypatch):
    def path_of(_unit, variation):
        yield 1.0, 2.0
        if variation.part == "mesh":
            raise RuntimeError("no convergence")
        yield 3.0, 4.0

    monkeypatch.setattr(probing, "_path", path_of)
    own = probing.Probing(SimpleNamespace(probe=True, scene=scene("uncertainty.mesh=true", "uncertainty.pose_mm=1")))
    assert own.values(0)["probes/e_n"].tolist() == [1.0, 1.0, 1.0]
    assert np.array_equal(own.values(1)["probes/quality"], [np.nan, 4.0, 4.0], equal_nan=True)
    assert own.failures == ["probe, half as many elements per direction: no convergence"]
    assert np.isnan(own.values(2)["probes/quality"]).all()
    assert probing.Probing(SimpleNamespace(probe=False)).values(0) == {}
    # where the cases between are stored or failed, the paths go on beside them, and say what they would have said
    later = probing.Probing(SimpleNamespace(probe=True, scene=scene("uncertainty.mesh=true", "uncertainty.pose_mm=1")))
    assert np.array_equal(later.values(1)["probes/quality"], [np.nan, 4.0, 4.0], equal_nan=True)
    assert len(later.failures) == 1
    assert np.isnan(later.values(2)["probes/e_n"]).all()
    assert later.failures == []


# --- what is said ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "own", "common", "told"),
    [
        ([0.12, 0.10, 0.09], [0.002] * 3, {}, "the best grasp is better than the second beyond the errors"),
        ([0.12, 0.11, 0.09], [0.01] * 3, {}, "the first 2 grasps cannot be distinguished"),
        ([0.12, 0.10, 0.11], [0.01] * 3, {}, "the first 2 grasps cannot be distinguished"),
        ([0.12, 0.11, 0.10], [0.002, 0.002, 0.05], {}, "the first 3 grasps cannot be distinguished"),
        ([0.12, 0.11, 0.10], [0.0] * 3, {"mu": [0.06, 0.055, 0.05]}, "better than the second"),  # 50 % of each
        ([0.12, 0.11, 0.10], [0.0] * 3, {"modulus": [0.02, -0.02, 0.01]}, "the first 2 grasps"),
        ([0.12, 0.11, 0.10], [0.002, np.nan, 0.002], {}, "not known"),
        ([0.12, 0.11], [np.nan, np.nan], {}, "not all cases are solved yet"),
        ([0.12], [0.002], {}, ""),
    ],
)
def test_the_best_grasp_is_judged_by_the_errors_of_differences(value, own, common, told):
    value = np.array(value)
    found = Sure(value, np.array(own), {name: np.array(change) for name, change in common.items()})
    order = np.argsort(-value)
    text = verdict(found, order.tolist(), [(i,) for i in range(len(value))])
    assert (told in text) if told else not text


def test_images_of_the_best_grasp_are_no_rivals():
    found = Sure(np.array([0.12, 0.12, 0.10]), np.full(3, 0.001), {})
    assert "beyond the errors" in verdict(found, [0, 1, 2], [(0,), (0,), (1,)])
    assert "the first 2 grasps" in verdict(found, [0, 1, 2], [(0,), (1,), (2,)])
    assert verdict(None, [0, 1, 2], [(0,)] * 3) == ""


def test_show_compare_export_and_lookup_take_intervals_from_the_file(tmp_path):
    axes = grid_axes(angles=[0.0])
    over = tuple(axis.name for axis in axes)
    intervals = [
        Derived(f"{name}_interval", units, "interval", "", over) for name, units in (("e_n", "m"), ("quality", ""))
    ]
    parts = [Derived(f"{name}_interval_mesh", "", "part", "", over) for name in ("e_n", "quality")]
    shape = tuple(len(axis.values) for axis in axes)
    quality = np.broadcast_to(np.linspace(1.0, 2.0, shape[0])[:, None, None], shape)
    given = {"derived__quality_interval": 0.1 * quality, "derived__quality_interval_mesh": np.full(shape, 0.1),
             "derived__e_n_interval": np.full(shape, 1e-3),
             "derived__e_n_interval_mesh": np.full(shape, 0.01)}  # fmt: skip
    path = make(tmp_path / "b.hdf", axes=axes, derived=(*intervals, *parts), quality__ccm=quality, **given)
    ds = softjaw.open(path)
    table = best(ds)
    text = as_text(table, 200)
    assert compare(ds, ds).asked.error == pytest.approx(np.full(shape, 2e-3))
    assert next(cases(ds))["maps"]["e_n_interval"] == 1e-3
    names = [name for name, _ in table.columns]
    assert table.rows[0][names.index("quality_interval")] == pytest.approx(0.2)
    assert (
        "the first 2 grasps cannot be distinguished (2.000 +- 0.2 to 1.750 +- 0.1" in text
    )  # 0.25 < root(0.2^2 + 0.175^2)
    assert "half-width" in text
    assert GraspMap(path).at(station=0.01, angle=0, force=3).value("e_n_interval") == pytest.approx(1e-3)


def test_a_file_without_errors_knows_none():
    quality = (("station", "angle", "normal_force", "model"), np.ones((2, 2, 1, 1)))
    ds = xr.Dataset({"quality": quality}, {"model": ["ccm"]}, {"derived": ()})
    assert sure(ds, "quality", 0) is None


# --- against solves --------------------------------------------------------------------------------------------------


def solved(given, name):
    """A map ``(units, forces)`` of a scene, NaN where a case fails, and the units."""
    from softjaw.study.case.result import CaseFailure
    from softjaw.study.pipeline import solve_unit

    units = candidates.units(given, lambda point: point.axis_symmetry)
    found = np.full((len(name), len(units), len(given.load.normal_force)), np.nan)
    for i, unit in enumerate(units):
        for k, case in solve_unit(unit):
            if not isinstance(case, CaseFailure):
                found[:, i, k] = [np.ravel(case.values[f"maps/{key}"])[0] for key in name]
    return found, units


@pytest.mark.long
def test_the_state_depends_on_force_over_modulus_only():
    soft = "candidates.stations_mm=[0]", "load.normal_force_n=[2]"
    stiff = "candidates.stations_mm=[0]", "load.normal_force_n=[2.2]", "gripper.shear_modulus_kpa=44"
    one, other = (solved(scene(*given), ("e_n", "quality"))[0] for given in (soft, stiff))
    assert np.allclose(one, other, rtol=1e-7)


@pytest.mark.long
def test_the_change_by_the_modulus_is_that_of_further_solves():
    """Half the difference between solves with the modulus 3 % up and down; the slope is that of a parabola."""
    where = "candidates.stations_mm=[0]", "load.normal_force_n=[1.8, 2, 2.2]", "gripper.elements=[12, 6, 4]"
    names, force = ("e_n", "quality"), np.array([1.8, 2.0, 2.2])
    own, _ = solved(scene(*where), names)
    up, down = (solved(scene(*where, f"gripper.shear_modulus_kpa={40 * t}"), names)[0] for t in (1.03, 0.97))
    expected = ((up - down) / (2 * own))[..., 1]
    assert np.allclose(interval.change_by_modulus(force, own, 0.03)[..., 1], expected, rtol=2e-3, atol=0)


@pytest.mark.long
def test_nine_of_ten_mesh_errors_lie_within_the_interval_that_five_probes_give():
    from softjaw.study.case.variations import probe_candidates
    from softjaw.study.flags import LOST
    from softjaw.study.scene import load_scene

    coarse = "gripper.elements=[12, 6, 4]", "candidates.stations=18", "candidates.angles_deg=[0]"
    coarse = (*coarse, 'effects.friction_pressure_coupling="none"')
    given = load_scene("jobs/bottle-rigid.toml", [*coarse, "uncertainty.mesh=true", "accuracy.meshes=1"])
    both = load_scene("jobs/bottle-rigid.toml", [*coarse, "accuracy.meshes=2"])
    found, units = solved(both, ("e_n_error", "quality_error", "contact_area", "flags", "e_n"))
    error, area, flags = found[:2], found[2], np.nan_to_num(found[3]).astype(int)
    probes = list(probe_candidates(given, units))
    sound = (flags & LOST == 0) & np.isfinite(error).all(axis=0)
    others = sound & ~np.isin(np.arange(len(area)), probes)[:, None]
    one = next(unit for unit in candidates.units(given, lambda point: point.axis_symmetry) if unit.index == probes[2])
    again = [e_n for e_n, _ in probing._path(one, variations(given)[0])]
    # an estimate from two meshes is at least seven tenths of their difference
    assert (0.7 * np.abs(np.array(again) / found[4][probes[2]] - 1) <= error[0][probes[2]] * (1 + 1e-5)).all()
    for own in error:
        change = np.where(sound[probes], own[probes], np.nan)
        width = interval.carried(change, area[probes], area)
        assert np.mean(own[others] <= width[others]) >= 0.9
        assert np.median(width[others]) < 6 * np.median(own[others])  # and it is no empty promise
