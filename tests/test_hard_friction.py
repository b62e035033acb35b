"""Hard cases of friction, limit surfaces and scores: each has an answer, an error or a flag."""

import math
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from scipy.spatial import ConvexHull, QhullError

from softjaw.friction.wrench import friction_limits, friction_wrench
from softjaw.scoring.contact import fibonacci_vertices, hull_volume
from tests.generators import cor_twists, lcg_patch, points_patch

X = [1.0, 0.0, 0.0]


def values(limits):
    return [limits.f_x, limits.f_y, limits.tau_z]


def test_pressures_over_twelve_decades_and_axes_next_to_an_element_keep_their_digits():
    wide = replace(lcg_patch(9, 300), pressure=10 ** np.linspace(-6, 6, 300))
    exact = math.fsum(math.hypot(*np.cross(n, X)) * f for n, f in zip(wide.normal, wide.load, strict=True))
    assert friction_limits(wide, 1.0).f_x == pytest.approx(exact, rel=1e-15)
    weak = replace(wide, pressure=np.where(np.arange(300) < 150, wide.pressure, 0.0))
    assert friction_limits(weak, 1.0).f_x > 0
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
    exact = hull_volume(vertices)

    def moody(points, qhull_options=None, **options):
        if qhull_options is None:
            raise QhullError("QH6271 topology error")
        return ConvexHull(points, qhull_options=qhull_options, **options)

    with mock.patch("softjaw.scoring.contact.ConvexHull", moody):
        np.testing.assert_allclose(hull_volume(vertices), exact, rtol=1e-4)
