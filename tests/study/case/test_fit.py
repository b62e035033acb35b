"""Whether a gripper fits: extremes of triangles by closed forms, states of candidates of every kind, the undecided."""

import numpy as np
import pytest
import trimesh

from softjaw.study.case.candidates import decided
from softjaw.study.case.fit import extremes
from softjaw.study.quantities import COLLIDES, MISSING, WIDE
from softjaw.study.run.plan import make_plan
from softjaw.study.scene import parse_scene
from tests.study.scenes import OVAL, pose_of, text_of, units_of

PAD = (0.05, 0.022, 0.015)
ELLIPSE = OVAL.replace("120", "80")
GRID = text_of(ELLIPSE, "stations_mm = [-5, 10]\nangles_deg = [0, 90]\n", forces="[1, 2]")
POSES = text_of(ELLIPSE, pose_of() + pose_of(approach=(0, 1, 0)), forces="[1, 2]")


def states(text, *changes):
    return [unit.state for unit in decided(units_of(parse_scene(text, overrides=changes)))]


def test_extremes_of_triangles_are_at_their_corners_and_where_they_leave_the_rectangle():
    slope = np.array([[-1.0, -1.0, -1.0], [3.0, -1.0, 3.0], [-1.0, 3.0, -1.0]])  # z = x
    assert extremes(slope, np.array([[0, 1, 2]]), (1.0, 0.5)) == pytest.approx((-0.5, 0.5))
    tip = np.array([[0.01, 0.02, -7.0], [9.0, 0.0, 0.0], [-9.0, 9.0, 0.0], [-9.0, -9.0, 0.0]])
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]])
    assert extremes(tip, fan, (0.1, 0.1))[0] == pytest.approx(-7.0)  # no grid would meet it
    assert extremes(tip, fan, (0.001, 0.001))[0] > -7.0
    assert extremes(tip + np.array([50.0, 0.0, 0.0]), fan, (0.1, 0.1)) == (np.inf, -np.inf)


@pytest.mark.parametrize("shift", [0.0, 0.025, 0.035])
def test_the_opening_round_a_ball_is_its_chord(shift):
    radius = 0.04
    ball = trimesh.creation.icosphere(5, radius)
    low, high = extremes(np.asarray(ball.vertices) + np.array([shift, 0, 0]), np.asarray(ball.faces), PAD[:2])
    off = max(shift - PAD[0] / 2, 0.0)
    assert high - low == pytest.approx(2 * np.sqrt(radius**2 - off**2), rel=1e-3)


@pytest.mark.parametrize("scene", [GRID, POSES])
def test_candidates_of_every_kind_are_too_wide_where_they_are(scene):
    per = 2 if scene == GRID else 1
    assert states(scene) == [MISSING] * 2 * per
    assert states(scene, "gripper.max_opening_mm=45") == [WIDE, MISSING] * per
    assert states(scene, "gripper.max_opening_mm=39") == [WIDE, WIDE] * per


def test_what_rounding_decides_is_solved_and_a_finger_that_is_larger_than_the_pad_runs_into_a_step():
    assert states(POSES, "gripper.max_opening_mm=40") == [WIDE, MISSING]
    assert states(POSES, "gripper.max_opening_mm=39.999999999") == [WIDE, MISSING]
    scene = parse_scene(POSES, overrides=["gripper.max_opening_mm=45", "sweep.object.semi_axis_a_mm=[21, 25]"])
    found = make_plan(scene).units
    assert [unit.state for unit in found] == [MISSING, MISSING, WIDE, MISSING]
    assert [row for unit in found if unit.state for rows in unit.rows for row in rows] == [4, 5]
    # A pad on the waist of a dumb-bell whose heads stand 20 mm above it.
    waist = [[z, 20] for z in range(30, 80, 10)]
    outline = [[0, 40], [10, 40], [20, 40], [25, 30], *waist, [75, 30], [80, 40], [90, 40], [100, 40]]
    text = text_of(f'shape = "revolution"\nprofile_mm = {outline}', stations="[50]", forces="[1]")
    finger = "gripper.finger_size_mm=[70, 22]"

    def state(thickness, *more):
        return states(text, "gripper.pad_length_mm=20", f"gripper.pad_thickness_mm={thickness}", *more)

    assert state(15) == [MISSING]
    assert state(15, finger) == [COLLIDES]
    assert state(25, finger) == [MISSING]
