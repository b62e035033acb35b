"""From where the hand comes: on an elliptic cylinder of 50 x 40 x 100 mm, whose clearances are known."""

from argparse import Namespace
from dataclasses import replace

import numpy as np
import pytest

from softjaw.study.case.poses import axis_poses
from softjaw.study.case.reach import FREE, WAY, boxes, clearance, rooms, surface_points
from softjaw.study.cli.exporting import gripper_of
from softjaw.study.export.rigid_body import scene_of
from softjaw.study.export.selection import GripperFrame, first, grasps, usable
from softjaw.study.flags import Flag
from softjaw.study.grippers import Hand, gripper_file
from tests.study.export.grasp_results import RADIUS, STATIONS, opened, write

FRANKA = gripper_file("franka_hand")[1]
TOP = 0.05  # of the cylinder, whose middle is the origin


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    poses = [axis_poses(station, np.pi / 2, 0.0) for station in STATIONS]  # across its 40 mm, upright
    R = np.array([[pose.rotation for pose in pair] for pair in poses])
    o = np.array([[[0, 0, z]] * 2 for z in STATIONS]) - RADIUS * R[..., 2]
    shape = (len(STATIONS), 1, 3, 2, 3)
    upright = {"fingers/pose_rotation": np.broadcast_to(R[:, None, None], (*shape, 3)),
               "fingers/pose_origin": np.broadcast_to(o[:, None, None], shape)}  # fmt: skip
    return write(tmp_path_factory.mktemp("reach") / "grasps.hdf", **upright)


def taken(path, hand, force=4.0):
    found = grasps(opened(path), GripperFrame(hand, ()), force=force)
    return sorted(found, key=lambda grasp: grasp.case["place"]["station"])


def test_a_hand_comes_from_above_where_its_palm_stays_over_the_object_and_opens_no_wider_than_its_stroke(path):
    """The palm of Franka's hand is 37.65 mm behind the pads' middle; the cylinder's top is 50 mm above its own."""
    found = taken(path, FRANKA)
    room = (FRANKA.depth_mm - FRANKA.palm_mm[1][2]) / 1e3
    assert room < TOP - STATIONS[0]
    assert room > TOP - STATIONS[4] + 0.005
    assert abs(found[0].rotation[2, 2]) < 0.1
    assert found[4].rotation[2, 2] == pytest.approx(-1.0)
    assert not any(grasp.hold.unfit for grasp in found)
    assert all(grasp.rotation[2, 2] < -0.99 for grasp in taken(path, Hand()))
    hand = Hand(stroke_mm=80)
    for grasp in taken(path, hand):
        assert grasp.hold.open_joints == pytest.approx({"finger_joint1": 0.040, "finger_joint2": 0.040})
        assert grasp.hold.closed_joints == pytest.approx({"finger_joint1": 0.034, "finger_joint2": 0.034})


@pytest.mark.parametrize(("hand", "why"), [
    (Hand(depth_mm=10, palm_mm=[[-100, -100, -20], [100, 100, 5]]), "every side"),
    (Hand(depth_mm=10, palm_mm=[[100, -100, 5], [-100, 100, -20]]), "every side"),  # other corners of the same box
    (Hand(stroke_mm=60), "30 mm"),  # pads of 15 mm leave half of it, and the object is 40 mm wide
    (Hand(stroke_mm=16), "no opening left"),
    (Hand(force_n=[5, 50]), "5 to 50 N"),
])  # fmt: skip
def test_what_the_gripper_cannot_take_is_left_out_with_the_reason(path, hand, why):
    kept, said = usable(taken(path, hand))
    assert not kept
    assert why in said
    assert said.startswith("5 of 5 ")


def test_the_first_of_those_that_fit_are_written_and_none_is_better_than_the_first(path):
    grasps = [replace(g, merit=merit) for g, merit in zip(taken(path, Hand()), (0.4, 0.5, 0.3, 0.2, 0.1), strict=True)]
    few = first(grasps, 3)
    assert [grasp.name for grasp in few] == [grasp.name for grasp in grasps[:3]]
    assert [grasp.merit for grasp in few] == pytest.approx([1.0, 1.0, 0.75])
    assert len(first(grasps)) == 5
    assert first([], 2) == []


def test_another_force_is_advised_only_where_one_that_was_solved_holds_the_object(path):
    for known, advised in (({"force_low": 9.0}, True), ({"force_low": np.nan}, False), ({}, False)):
        grasps = [replace(g, case={**g.case, "flags": Flag.TOO_WEAK, "maps": g.case["maps"] | known})
                  for g in taken(path, Hand())]  # fmt: skip
        kept, said = usable(grasps)
        assert (kept, "--force" in said) == ([], advised)


@pytest.mark.parametrize(("rim", "free"), [(0.044, True), (0.046, False)])
def test_fingers_that_close_below_a_rim_must_not_meet_it(rim, free):
    """Open, all stay clear of a pot's rim; closed on its wall of radius 40 mm, foam of 5 mm keeps fingers at 45 mm."""
    points = np.array([[sign * r, 0.0, z] for sign in (-1.0, 1.0) for r, z in ((0.04, 0.0), (rim, 0.045))])
    upright = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # axes of the pad: closes along x
    hand, size = Hand(depth_mm=140, closing="x"), (0.024, 0.02, 0.005)
    room = rooms(points, hand, upright.T, np.zeros(3), size, wide=0.1, touch=0.08, depth=0.14)
    assert (room["minus-x"] >= FREE) == free


def test_boxes_clear_a_sphere_and_stand_beside_the_pads_and_the_gripper_of_the_scene_comes_unless_named(path):
    ball = np.random.default_rng(1).normal(size=(20_000, 3))
    ball *= 0.03 / np.linalg.norm(ball, axis=1)[:, None]
    beside, corner = np.array([[0.05, -1, -1], [1, 1, 1]]), np.array([[0.03, 0.03, 0.03], [1, 1, 1]])
    assert clearance(ball, beside[None]) == pytest.approx(0.02, abs=1e-4)
    assert clearance(ball, corner[None]) == pytest.approx(0.03 * (np.sqrt(3) - 1), abs=1e-4)
    assert clearance(ball, np.stack([beside, corner])) == pytest.approx(0.02, abs=1e-4)
    assert clearance(ball, beside[None] - [0.03, 0, 0]) == pytest.approx(-0.01, abs=1e-4)
    points = surface_points(scene_of(opened(path), taken(path, Hand())[0].case).object)
    inside = np.abs(points[:, 2]) < TOP - 1e-6
    assert np.hypot(points[inside, 0] / 0.025, points[inside, 1] / 0.020).max() == pytest.approx(1.0, abs=1e-5)
    assert np.abs(points[:, 2]).max() == pytest.approx(TOP)
    grid = np.array([[0.025, 0.0, z] for z in np.linspace(-TOP, TOP, 50)])
    assert np.linalg.norm(points[None] - grid[:, None], axis=-1).min(axis=1).max() < 2e-3
    hold = np.array([0.02, 0.018, 0.005]), 0.06, 0.10365
    parts = boxes(FRANKA, *hold)
    foam, fingers, palm = parts[:2], parts[2:4], parts[4]
    assert foam[1] == pytest.approx(np.array([[-0.009, 0.030, 0.09365 - WAY], [0.009, 0.035, 0.11365]]))
    assert fingers[0] == pytest.approx(np.array([[-0.011, -0.061, -WAY], [0.011, -0.035, 0.11365]]))
    assert palm[:, 2] == pytest.approx([-0.0259 - WAY, 0.066])
    turned = boxes(FRANKA.closing_along("x"), *hold)
    assert turned == pytest.approx(parts[:, :, [1, 0, 2]])
    options = Namespace(gripper=None, approaches=None, form="isaac_grasp", wider=20.0, frame="object")
    assert gripper_of(options, "franka_hand").hand == FRANKA
    options.form = "graspgen"  # which closes along x: the palm goes with it
    assert np.abs(boxes(gripper_of(options, "franka_hand").hand, *hold)) == pytest.approx(np.abs(turned))
    options.form = "isaac_grasp"
    assert gripper_of(options).hand == Hand()
    options.gripper = "wsg50"
    assert gripper_of(options, "franka_hand").hand == gripper_file("wsg50")[1]
