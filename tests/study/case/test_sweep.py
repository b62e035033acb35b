"""From scenes to axes, candidates and units of work: frames, symmetry, and every row exactly once."""

from itertools import chain

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from softjaw.study.case import candidates, poses
from softjaw.study.case.build import build_object
from softjaw.study.scene import parse_scene
from tests.fem.test_traced import bent
from tests.study.scenes import OVAL, mesh_of, pose_of, scene_of, text_of

Z = np.array([0.0, 0.0, 1.0])
CYLINDER = text_of(OVAL, stations="[-10, 0, 30]", angles="[0, 30, 90, 180, 210, 360]", forces="[1, 2, 5]",
                   elements="[20, 10, 6]")  # fmt: skip


def posed(*given):
    return scene_of(OVAL, where="".join(pose_of(*pose) for pose in given))


@pytest.mark.parametrize("roll", [0, 25, -90, 180])
@pytest.mark.parametrize("angle", [0, 30, 90, -120, 360])
def test_both_pads_face_each_other_with_the_same_long_side(angle, roll):
    scene = parse_scene(CYLINDER, overrides=[f"candidates.angles_deg=[{angle}]", f"candidates.roll_deg={roll}"])
    for place in candidates.candidates(scene):
        one, other = place.poses
        theta = np.radians(angle)
        outwards = np.array([np.cos(theta), np.sin(theta), 0])
        assert one.rotation[:, 2] == pytest.approx(-outwards, abs=1e-15)
        assert other.rotation[:, 2] == pytest.approx(outwards, abs=1e-15)
        assert one.rotation[:, 0] == pytest.approx(other.rotation[:, 0], abs=0)
        for pose in place.poses:
            assert np.linalg.det(pose.rotation) == pytest.approx(1)
            assert pose.rotation.T @ pose.rotation == pytest.approx(np.eye(3), abs=1e-15)
            aimed = pose.to_object(np.array([[0, 0, poses.STANDOFF]]))[0]
            assert aimed == pytest.approx([0, 0, place.station], abs=1e-14)


def test_roll_turns_the_gripper_about_an_approach_and_an_explicit_pose_is_the_station_it_describes():
    """Rodrigues: the long side z turned by 90 degrees about the approach -x of finger 1 is (-x) x z = y."""
    flat, turned = (poses.axis_poses(0.0, 0.0, roll) for roll in (0.0, np.pi / 2))
    assert flat[0].rotation[:, 0] == pytest.approx(Z)
    for pose in turned:
        assert pose.rotation[:, 0] == pytest.approx([0, 1, 0], abs=1e-15)
    theta = np.radians(30)
    approach = (-np.cos(theta), -np.sin(theta), 0.0)
    (place,) = candidates.candidates(posed(((0, 0, 30), [3 * a for a in approach], (approach[0], approach[1], 2.0))))
    for pose, same in zip(place.poses, poses.axis_poses(0.03, theta, 0.0), strict=True):
        assert pose.rotation == pytest.approx(same.rotation, abs=1e-15)
        assert pose.origin == pytest.approx(same.origin, abs=1e-14)
    assert (place.station, place.angle, place.label) == (0.0, 0.0, "p00")


def test_stations_of_a_bent_mesh_follow_its_centre_line(tmp_path):
    """A tube along an arc of 150 mm: pads are aimed at the arc, across it, with their long side along it."""
    trimesh.Trimesh(*bent(), process=False).export(tmp_path / "bent.stl")
    pad = ("gripper.pad_length_mm=40", "gripper.pad_width_mm=20")
    scene = scene_of(mesh_of(tmp_path / "bent.stl", "m"), *pad, stations=[50, 90], angles="[0, 90]", forces="[5]")
    high = build_object(scene.object).bounds[1]
    for place in candidates.candidates(scene):
        t = np.arcsin((place.station - 0.5 * high[2]) / 0.15)
        tangent = np.array([-np.sin(t), 0, np.cos(t)])
        outwards = np.array([np.cos(t), 0, np.sin(t)] if place.angle == 0 else [0.0, 1.0, 0.0])
        middle = high[0] - (0.168 - 0.15 * np.cos(t))
        for sign, pose in zip((-1, 1), place.poses, strict=True):
            assert pose.rotation[:, 0] == pytest.approx(tangent, abs=0.03)
            assert pose.rotation[:, 2] == pytest.approx(sign * outwards, abs=0.03)
            assert pose.rotation.T @ pose.rotation == pytest.approx(np.eye(3), abs=1e-14)
            aimed = pose.to_object(np.array([[0, 0, poses.STANDOFF]]))[0]
            assert aimed == pytest.approx([middle, 0, place.station], abs=1.5 * 0.018**2 / 0.15)
        assert not place.note


def test_axes_end_with_station_angle_and_force_in_si_units_and_poses_are_numbered():
    over = "object.semi_axis_b_mm=[40, 10, 20]", "gripper.material=['linear', 'blatz_ko']", "friction.mu=[0.5]"
    axes = candidates.axes(parse_scene(CYLINDER, overrides=[f"sweep.{change}" for change in over]))
    assert [a.name for a in axes] == ["semi_axis_b", "material", "mu", "station", "angle", "normal_force"]
    assert [a.units for a in axes] == ["m", "", "", "m", "rad", "N"]
    assert axes[0].values.tolist() == [0.01, 0.02, 0.04]
    assert axes[1].values.tolist() == [0, 1]
    assert (axes[1].long_name, axes[1].options) == ("gripper.material", ("linear", "blatz_ko"))
    assert axes[3].values.tolist() == [-0.01, 0, 0.03]
    assert axes[5].values.tolist() == [1, 2, 5]
    axes = candidates.axes(posed(((0, 0, 0), (1, 0, 0), (0, 0, 1)), ((0, 0, 9), (0, 1, 0), (0, 0, 1))))
    assert [(a.name, a.values.tolist(), a.units) for a in axes[:2]] == [("station", [0, 1], ""), ("angle", [0], "rad")]


@pytest.mark.parametrize(("order", "groups"), [
    (0, [[0, 1, 2, 3, 4, 5]]), (2, [[0, 3, 5], [1, 4], [2]]), (1, [[0, 5], [1], [2], [3], [4]]),
    (4, [[0, 2, 3, 5], [1, 4]]), (12, [[0, 1, 2, 3, 4, 5]]),
])  # fmt: skip
def test_images_under_the_symmetry_of_the_object_are_served_together(order, groups):
    """Angles 0, 30, 90, 180, 210, 360 degrees: alike when they differ by a multiple of 360 / order."""
    places = candidates.candidates(parse_scene(CYLINDER))
    found = [[n for n, _ in group] for group in candidates.groups(places, order)]
    assert found == [[6 * station + n for n in group] for station in range(3) for group in groups]


@pytest.mark.parametrize("changed", ["object.semi_axis_b_mm=25", "object.name='oval'", "task.weight_direction=[1,0,0]"])
@pytest.mark.parametrize("roll", [0, 40])
def test_the_turn_takes_one_pair_of_pads_into_the_other(changed, roll):
    for unit in candidates.units(parse_scene(CYLINDER, overrides=[changed, f"candidates.roll_deg={roll}"])):
        assert unit.served[0] is unit.candidate
        for place, turn in zip(unit.served, unit.turns, strict=True):
            for pose, image in zip(unit.candidate.poses, place.poses, strict=True):
                R = Rotation.from_euler("z", turn).as_matrix()
                assert R @ pose.rotation == pytest.approx(image.rotation, abs=1e-12)
                assert R @ pose.origin == pytest.approx(image.origin, abs=1e-12)


def test_explicit_poses_are_grouped_whatever_point_was_given_and_nothing_that_is_no_image():
    given = [
        ((0, 0, 20), (1, 0, 0), (0, 0, 1)),
        ((40, 0, 20), (2, 0, 0), (0, 0, 3)),  # the same line
        ((0, -7, 20), (0, 1, 0), (0, 0, 1)),  # turned by 90 degrees
        ((0, 0, 20), (-1, 0, 0), (0, 0, 1)),  # turned by 180 degrees: the fingers have changed places
        ((0, 5, 20), (1, 0, 0), (0, 0, 1)),  # another line
        ((0, 0, 20), (1, 0, 0), (0, 1, 0)),  # rolled
        ((0, 0, 21), (1, 0, 0), (0, 0, 1)),  # higher
        ((0, 0, 20), (1, 0, 1), (0, 1, 0)),  # tilted
        ((0, 0, 20), (0, -1, 1), (1, 0, 0)),  # tilted and turned by -90 degrees
    ]
    places = candidates.candidates(posed(*given))
    found = {order: [[n for n, _ in group] for group in candidates.groups(places, order)] for order in (0, 1, 2)}
    assert found[0] == [[0, 1, 2, 3], [4], [5], [6], [7, 8]]
    assert found[1] == [[0, 1], [2], [3], [4], [5], [6], [7], [8]]
    assert found[2] == [[0, 1, 3], [2], [4], [5], [6], [7], [8]]
    # Candidates at random angles and rolls, each with a copy that only a symmetry of order 3 makes its image.
    rng = np.random.default_rng(1)
    places = []
    for angle, roll, station in rng.uniform(-3, 3, (40, 3)):
        for turn in (0, 2 * np.pi / 3):
            pair = poses.axis_poses(station, angle + turn, roll)
            places.append(candidates.Candidate(station, angle + turn, pair, ""))
    assert all(len(group) == 1 for group in candidates.groups(places, 1))
    assert all(len(group) == 1 for group in candidates.groups(places, 2))
    assert [[n for n, _ in g] for g in candidates.groups(places, 3)] == [[2 * k, 2 * k + 1] for k in range(40)]


@pytest.mark.parametrize("swept", [
    [], ["object.semi_axis_b_mm=25"], ["sweep.object.semi_axis_b_mm=[10, 20]", "sweep.friction.mu=[0.2, 0.5, 0.8]"],
])  # fmt: skip
def test_every_row_is_filled_exactly_once_and_stands_for_its_axis_values(swept):
    scene = parse_scene(CYLINDER, overrides=swept)
    axes, units = candidates.axes(scene), candidates.units(scene)
    shape = [len(a.values) for a in axes]
    assert sorted(chain.from_iterable(chain.from_iterable(u.rows for u in units))) == list(range(scene.cases))
    assert int(np.prod(shape)) == scene.cases
    assert [u.index for u in units] == list(range(len(units)))
    assert [u.rows[0][0] for u in units] == sorted(u.rows[0][0] for u in units)
    for unit in units:
        assert not unit.scene.sweep
        for place, rows in zip(unit.served, unit.rows, strict=True):
            for force, row in zip(unit.scene.load.normal_force, rows, strict=True):
                at = {a.name: a.values[i] for a, i in zip(axes, np.unravel_index(row, shape), strict=True)}
                assert (at["station"], at["angle"], at["normal_force"]) == (place.station, place.angle, force)
                assert at.get("mu", 0.8) == unit.scene.friction.mu
                assert at.get("semi_axis_b", scene.object.semi_axis_b) == unit.scene.object.semi_axis_b


def test_the_symmetry_is_asked_for_at_every_point_of_the_sweep_and_finer_meshes_cost_more():
    scene = parse_scene(CYLINDER, overrides=["sweep.object.semi_axis_b_mm=[20, 25]"])
    round_or_not = [u.scene.object.semi_axis_b for u in candidates.units(scene)]
    assert (round_or_not.count(0.02), round_or_not.count(0.025)) == (9, 3)
    scene = parse_scene(CYLINDER, overrides=["object.semi_axis_b_mm=25", "sweep.candidates.roll_deg=[0, 90]"])
    sides = [u.candidate.poses[0].rotation[2, 0] for u in candidates.units(scene)]
    assert sides == pytest.approx([1, 1, 1, 0, 0, 0], abs=1e-15)
    base = parse_scene(CYLINDER)
    assert candidates.path_cost(base) == pytest.approx(3 * (20 * 10 * 6 + 10 * 6 * 3))
    one, triquadratic = ({"accuracy.meshes": 1}, {"gripper.element": "hex27"})
    ratios = [candidates.path_cost(base.with_values(v)) / candidates.path_cost(base) for v in (one, triquadratic)]
    assert ratios == pytest.approx([1 / 1.15, 8])


@pytest.mark.parametrize(("overrides", "order"), [
    ((), 2), (("task.weight_direction=[0, 0, -1]",), 2), (("task.weight_direction=[0, 1, -1]",), 1),
    (("task.centre_of_mass_mm=[3, 0, 0]",), 1),
])  # fmt: skip
def test_a_weight_that_does_not_point_along_the_axis_takes_the_symmetry_away(overrides, order):
    assert parse_scene(CYLINDER, overrides=list(overrides)).axis_symmetry == order
