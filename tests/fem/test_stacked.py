"""Splines of an outline against scipy's; bodies of stacked sections equal to revolved and elliptic ones."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.outer_surface import Section, of_sections
from softjaw.fem.objects.profile import b_splines
from softjaw.fem.objects.revolution import Revolution
from softjaw.fem.objects.shapes import EllipticCylinder
from softjaw.fem.objects.splines import spline_surface
from softjaw.fem.objects.stacked import Stacked, wall_surface

PROFILE = [
    (0.0, 0.03), (0.005, 0.033), (0.03, 0.034), (0.06, 0.034), (0.09, 0.034), (0.12, 0.03), (0.15, 0.014),
    (0.18, 0.013),
]  # fmt: skip
HERE = Pose(np.eye(3), np.zeros(3))


@pytest.mark.parametrize("order", range(4))
def test_b_splines_and_their_derivatives(order):
    t = np.array([0, 0, 0, 0, 0.2, 0.5, 0.55, 0.9, 1, 1, 1, 1])
    x = np.concatenate([np.linspace(0, 1, 101), t])
    expected = BSpline(t, np.eye(len(t) - 4), 3)(x, nu=order)
    assert b_splines(t, x, order) == pytest.approx(expected, rel=1e-12, abs=1e-12 * np.abs(expected).max())


@settings(max_examples=40, deadline=None, derandomize=True)
@example(18, 134.295, 15.300, 53.740)
@example(27, 137.462, 23.936, 59.720)
@example(32, 187.008, 20.405, 15.484)
@given(st.integers(3, 40), st.floats(20, 200), st.floats(5, 60), st.floats(5, 60))
def test_every_frustum_rounded_to_a_micrometre_is_one(n, height, low, high):
    """Rounding cuts a long line into runs; where two of them have one direction, a corner was 0 / 0."""
    points = np.round(np.column_stack([np.linspace(0, height, n), np.linspace(low, high, n)]), 3) / 1000
    e = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
    z, r = (points[0] + np.linspace(0.2, 0.8, 100)[:, None] * (points[-1] - points[0])).T
    g, normal, hessian = Revolution(points).gap(np.column_stack([r, 0 * r, z]))
    assert np.abs(g).max() < 1e-5
    assert np.abs(normal - [e[0], 0, -e[1]]).max() < 0.05  # of runs that are short and rounded
    assert np.isfinite(hessian).all()


@pytest.mark.parametrize("turn", [1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2])
def test_gentle_corners_between_straight_runs_are_smooth(turn):
    """The normal turns by no more than the corner, and the curve stays within a part 1e-4 of a step of its points."""
    t = np.array([[0.01 * k, 0.03] for k in range(5)])
    u = t[-1] + 0.01 * np.arange(1, 5)[:, None] * [np.cos(turn), -np.sin(turn)]
    body = Revolution(np.concatenate([t, u]))
    x = np.column_stack([np.full(2001, 0.03), np.zeros(2001), np.linspace(0.0395, 0.0405, 2001)])
    g, normal, hessian = body.gap(x)
    assert np.abs(g - np.maximum(0, np.sin(turn) * (x[:, 2] - 0.04))).max() < min(0.03 * turn, 1e-6) + 1e-15
    assert np.arctan2(normal[:, 2], normal[:, 0]) == pytest.approx(np.clip(turn, 0, turn) / 2, abs=0.51 * turn + 1e-9)
    assert np.abs(hessian[:, [0, 0, 2], [0, 2, 2]]).max() < 1e-3 + 1100 * turn / 1e-2


def off_the_wall(body, n=400, far=0.003, heights=(0.012, 0.17)):
    rng = np.random.default_rng(2)
    theta, z = rng.uniform(0, 2 * np.pi, n), rng.uniform(*heights, n)
    x = np.column_stack([0.03 * np.cos(theta), 0.03 * np.sin(theta), z])
    for _ in range(3):
        g, normal, _ = body.gap(x)
        x = x - g[:, None] * normal
    return x + normal * rng.uniform(-far, far, n)[:, None]


def same(found, expected):
    for one, other, atol in zip(found, expected, (1e-9, 5e-6, 0.05), strict=True):
        np.testing.assert_allclose(one, other, atol=atol)


def test_circles_make_the_body_of_revolution_ellipses_the_cylinder_and_splines_converge_with_the_fourth_order():
    rigid, stacked = Revolution(np.array(PROFILE)), Stacked(of_sections([Section(*p) for p in PROFILE], beyond=False))
    x = off_the_wall(rigid)
    for body in (stacked, stacked.near(HERE, np.zeros(3), np.zeros(3))):
        same(body.gap(x), rigid.gap(x))
    np.testing.assert_allclose(stacked.bounds, rigid.bounds, atol=1e-5)
    assert stacked.outer.round
    a, b = 0.03, 0.024
    oval = Stacked(of_sections([Section(z, a, b) for z in (0.0, 0.05, 0.1, 0.15)]))
    rng = np.random.default_rng(4)
    theta = rng.uniform(0, 2 * np.pi, 300)
    x = np.column_stack([(a + 0.002) * np.cos(theta), (b + 0.002) * np.sin(theta), rng.uniform(0.02, 0.13, 300)])
    same(oval.gap(x), EllipticCylinder(a, b, 1.0).gap(x))
    assert (oval.outer.round, oval.outer.symmetric) == (False, (True, True))
    low, high = stacked.bounds[:, 2]
    points = np.array([[0.2, 0, 0.06], [0, 0, low - 0.01], [0, 0, high + 0.02], [0, 0, 0.06]])
    g, normal, _ = stacked.gap(points)
    np.testing.assert_allclose(g[:3], [0.2 - 0.034, 0.01, 0.02], atol=1e-4)
    assert g[3] == pytest.approx(-0.034, abs=1e-4)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)

    def worst(m):
        theta, s = np.linspace(0, 2 * np.pi, m + 1), np.linspace(0, 0.15, m + 1)

        def point(t, z):
            return np.stack([(0.035 + 0.002 * np.sin(60 * z)) * np.cos(t), 0.03 * np.sin(t), z + 0 * t], axis=-1)

        surface = spline_surface(theta, s, point(*np.meshgrid(theta, s, indexing="ij")))
        rng = np.random.default_rng(0)
        t, z = rng.uniform(-7, 9, 200), rng.uniform(0.02, 0.13, 200)
        return np.abs(surface.at(t, z)[:, 0] - point(t, z)).max()

    assert min(worst(24) / worst(48), worst(48) / worst(96)) > 12
    # Ends of the wall that fall on breaks of its outline but for rounding.
    outer, breaks = stacked.outer, stacked.outer.curve.breaks
    low, *_, high = breaks[(breaks > outer.wall[0]) & (breaks < outer.wall[1])]
    surface = wall_surface(outer, np.nextafter(low, 0.0), np.nextafter(high, 1.0))
    assert np.diff(surface.s).min() > 1e-9
