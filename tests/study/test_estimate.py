"""Seconds of a plan before anything is solved: heights by closed forms, symmetry, and what more work costs."""

from __future__ import annotations

import numpy as np
import pytest

from softjaw.fem.objects.shapes import Sphere
from softjaw.study.run.estimate import CASE, ELEMENT, FACE_GRID, FIRST_FORCE_FACTOR, HARD, estimated, heights
from softjaw.study.run.plan import make_plan
from softjaw.study.scene import load_scene, parse_scene
from tests.study.launching import ROOT

# CPU seconds of all load paths as they were measured on one core, compiled code there and loaded.
MEASURED = {"smoke": 1.24, "box-poses": 3.4, "flask-mesh": 57.0, "bottle-rigid": 86.0}
SCENE = """
[object]
shape = "elliptic_cylinder"
semi_axis_a_mm = 25
semi_axis_b_mm = 20
length_mm = 120
[gripper]
elements = [8, 4, 2]
[candidates]
stations_mm = [{station}]
angles_deg = [{angle}]
[load]
normal_force_n = {forces}
[accuracy]
meshes = 1
[effects]
friction_pressure_coupling = "none"
"""


def seconds(station=0, angle=0, forces="[1]"):
    return estimated(make_plan(parse_scene(SCENE.format(station=station, angle=angle, forces=forces))).units)[0]


def test_heights_over_a_pad_are_those_of_a_ball():
    radius, side = 0.03, 0.02
    low, high = heights(*Sphere(radius).surface(), (side, side))
    x, y = (side * ((np.arange(n) + 0.5) / n - 0.5) for n in FACE_GRID)
    cap = np.sqrt(radius**2 - x[:, None] ** 2 - y**2)
    np.testing.assert_allclose(high, cap, atol=2e-4)
    np.testing.assert_allclose(low, -cap, atol=2e-4)


def test_a_grasp_costs_what_its_elements_and_forces_cost():
    one = CASE + ELEMENT * 64  # of one finger, which stands for its image
    assert seconds() == pytest.approx(FIRST_FORCE_FACTOR * (one - ELEMENT * 48), rel=1e-12)  # a quarter of it
    assert seconds(angle=30) > seconds()  # no plane of symmetry across the long side
    assert seconds(forces="[1, 2]") - seconds() == pytest.approx(seconds() / FIRST_FORCE_FACTOR, rel=1e-12)
    assert seconds(forces="[1, 500]") - seconds() == pytest.approx(HARD * seconds() / FIRST_FORCE_FACTOR, rel=1e-12)


@pytest.mark.parametrize("job", sorted(MEASURED))
def test_the_scenes_that_come_along_are_within_a_factor_of_two(job):
    found = sum(estimated(make_plan(load_scene(ROOT / "jobs" / f"{job}.toml")).units))
    assert 0.5 < found / MEASURED[job] < 2.0
