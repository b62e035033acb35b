"""Splines of an outline against scipy's, which the program does without because loading them takes longer."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from softjaw.fem.objects.profile import b_splines
from softjaw.fem.objects.revolution import Revolution


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
