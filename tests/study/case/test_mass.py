"""The mass that a density gives: closed forms, and what has no volume."""

import math

import pytest

from softjaw.study.case.build import volume
from softjaw.study.case.candidates import with_sampled_grasps
from softjaw.study.messages import StudyError
from softjaw.study.scene import Scene


def scene(density=1000, sweep=None, **shape):
    """A scene with an object of this density [kg/m^3]."""
    tables = {"object": {**shape, "density": density}, "candidates": {"stations_mm": [10], "angles_deg": [0]}}
    return Scene.from_dict({**tables, "load": {"normal_force_n": [1]}, "sweep": sweep or {}})


def test_it_is_density_times_volume_and_what_has_no_volume_or_several_is_refused():
    ball = with_sampled_grasps(scene(shape="sphere", radius_mm=30))
    assert ball.object.mass == pytest.approx(1000 * 4 / 3 * math.pi * 0.03**3, rel=1e-4)
    assert ball.object.density is None
    tube = scene(500, shape="elliptic_cylinder", semi_axis_a_mm=30, semi_axis_b_mm=20, length_mm=100)
    assert with_sampled_grasps(tube).object.mass == pytest.approx(500 * math.pi * 0.03 * 0.02 * 0.1, rel=1e-4)
    a, r = 0.03, 0.02  # at both ends of a frustum of 100 mm
    cone = scene(shape="revolution", profile_mm=[[0, 30], [40, 26], [50, 25], [100, 20]])
    assert volume(cone.object) == pytest.approx(math.pi * 0.1 / 3 * (a * a + a * r + r * r), rel=1e-9)
    with pytest.raises(StudyError, match="mass_g"):
        with_sampled_grasps(scene(shape="plane", thickness_mm=30))
    with pytest.raises(StudyError, match="mass_g"):
        with_sampled_grasps(scene(shape="sphere", radius_mm=30, sweep={"object.radius_mm": [20, 30]}))
