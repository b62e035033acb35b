"""Hard cases of friction, limit surfaces and scores: each has an answer, an error or a flag."""

import math
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from scipy.spatial import ConvexHull, QhullError

from softjaw.friction.frame import FrameFlag, contact_frame, in_frame
from softjaw.friction.motion import SLIDE_Y, cor_twists
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import friction_limits, friction_wrench
from softjaw.lsfit.body import hull_volume
from softjaw.lsfit.ellipsoid import axis_aligned_ellipsoid, full_ellipsoid
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import sample_rank
from softjaw.scoring.bodies import fibonacci_vertices, polytope_volume
from tests.generators import (
    cap_polar,
    lcg_patch,
    moved,
    points_patch,
    rect_grid,
)
from tests.oracles import least_squares_quartic, samples

X = [1.0, 0.0, 0.0]


def values(limits):
    return [limits.f_x, limits.f_y, limits.tau_z]


def all_fits(W, T):
    return [axis_aligned_ellipsoid(W), full_ellipsoid(W), least_squares_quartic(W, T), convex_quartic(W, T).surface]


def stacked(*patches):
    fields = ("centroid", "area", "normal", "pressure")
    return ContactPatch(*(np.concatenate([getattr(patch, name) for patch in patches]) for name in fields))


def test_single_tilted_element():
    for theta in (0.0, 0.5, 1.2):
        c, s = math.cos(theta), math.sin(theta)
        tilted = moved(points_patch([[0, 0]], [3.0]), [[1, 0, 0], [0, c, -s], [0, s, c]], [0, 0, 0])
        np.testing.assert_allclose(values(friction_limits(tilted, 0.5)), [1.5, 1.5 * c, 0], atol=1e-15)


def test_all_pressure_on_a_line():
    line = rect_grid(2.0, 1e-9, 200, 1)
    assert friction_limits(line, 1.0).e_n == pytest.approx(2 / 4, rel=1e-12)
    W, T = samples(line, 100)
    assert np.isfinite(W).all()
    assert sample_rank(W) == 3
    assert hull_volume(W) > 0.5
    for surface in all_fits(W, T):
        assert surface.rank == 3
        assert 0.5 < surface.volume < 5


def test_centre_of_rotation_in_an_element():
    """The element there gives nothing; ever so little beside it, its full mu p a."""
    centre = np.array([[0.3, -0.2]])
    for angle in (0.0, 0.4):
        s, c = math.sin(angle), math.cos(angle)
        patch = points_patch(centre, [2.0], [[0, s, c]])
        np.testing.assert_array_equal(friction_wrench(patch, cor_twists(centre), 0.5), np.zeros((1, 6)))
        for distance in (1e-9, 1e-12):
            W = friction_wrench(patch, cor_twists(centre - [[distance, 0]]), 0.5)[0]
            assert np.linalg.norm(W[:3]) == pytest.approx(1.0, rel=1e-12)
            np.testing.assert_allclose(W[:3], [0, c, -s], atol=1e-3)


def test_normal_along_the_velocity():
    patch = points_patch([[0.3, -0.2, 0.1]], [2.0], [[0, 1, 0]])
    np.testing.assert_array_equal(friction_wrench(patch, SLIDE_Y, 0.5), np.zeros((1, 6)))
    np.testing.assert_array_equal(friction_wrench(patch, np.zeros((2, 3)), 0.5), np.zeros((2, 6)))
    assert friction_limits(patch, 0.5).f_y == 0


def test_duplicated_elements():
    patch = lcg_patch(4, 70)
    half = replace(patch, area=patch.area / 2)
    double = stacked(half, half)
    np.testing.assert_allclose(values(friction_limits(double, 1.0)), values(friction_limits(patch, 1.0)), rtol=1e-14)
    W, T = samples(patch, 100)
    twice = np.vstack([W, W]), np.vstack([T, T])
    for one, two in zip(all_fits(W, T), all_fits(*twice), strict=True):
        np.testing.assert_allclose(two.value(W), one.value(W), rtol=1e-6)


def test_pressures_over_twelve_decades():
    patch = lcg_patch(9, 300)
    wide = replace(patch, pressure=10 ** np.linspace(-6, 6, 300))
    exact = math.fsum(math.hypot(*np.cross(n, X)) * f for n, f in zip(wide.normal, wide.load, strict=True))
    assert friction_limits(wide, 1.0).f_x == pytest.approx(exact, rel=1e-15)
    weak = replace(wide, pressure=np.where(np.arange(300) < 150, wide.pressure, 0.0))
    assert friction_limits(weak, 1.0).f_x > 0


def test_overhanging_normals():
    """A cap with the half angle 120 degrees: a third of its area looks back, and lessens F_N but no friction."""
    patch = cap_polar(1, np.radians(120), 60, 40)
    frame = contact_frame(patch, X)
    assert frame.flag & FrameFlag.OVERHANG
    assert frame.overhang_share == pytest.approx(1 / 3, rel=1e-12)
    assert frame.overhang_count == 15 * 40
    local = in_frame(patch, frame)
    limits, projected = friction_limits(local, 1.0), friction_limits(local, 1.0, "pcm_projected")
    assert limits.F_N == pytest.approx(np.pi * math.sin(np.radians(120)) ** 2, rel=1e-3)
    assert projected.f_x == pytest.approx(local.load @ np.abs(local.normal[:, 2]), rel=1e-12)
    assert projected.f_x > limits.F_N * 1.5


def test_digits_next_to_an_element():
    """The speed is formed as a difference, so no digit is lost however near the axis runs; |f| = mu p a."""
    for distance in 10.0 ** np.arange(-12, 0):
        offset = np.array([[0.6, 0.8]]) * distance
        place = np.array([[0.25, -0.5]])
        exact_offset = (place + offset) - place
        W = friction_wrench(points_patch(place, [2.0]), cor_twists(place + offset), 0.5)[0]
        direction = np.array([exact_offset[0, 1], -exact_offset[0, 0]]) / np.linalg.norm(exact_offset)
        np.testing.assert_allclose(W[:2], direction, atol=1e-14)


def test_failure_of_qhull():
    """A hull that Qhull refuses is joggled; its volume is right to 1e-4."""
    vertices = fibonacci_vertices((0.8, 0.6, 0.15), 30)
    exact = polytope_volume(vertices)

    def moody(points, qhull_options=None, **options):
        if qhull_options is None:
            raise QhullError("QH6271 topology error")
        return ConvexHull(points, qhull_options=qhull_options, **options)

    with mock.patch("softjaw.scoring.bodies.ConvexHull", moody):
        np.testing.assert_allclose(polytope_volume(vertices), exact, rtol=1e-4)
