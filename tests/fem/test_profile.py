"""Splines of an outline against scipy's, which the program does without because loading them takes longer."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline, PchipInterpolator

from fem.outer_surface import Section, of_sections
from fem.profile import b_splines


@pytest.mark.parametrize("order", range(4))
def test_b_splines_and_their_derivatives(order):
    t = np.array([0, 0, 0, 0, 0.2, 0.5, 0.55, 0.9, 1, 1, 1, 1])
    x = np.concatenate([np.linspace(0, 1, 101), t])
    expected = BSpline(t, np.eye(len(t) - 4), 3)(x, nu=order)
    assert b_splines(t, x, order) == pytest.approx(expected, rel=1e-12, abs=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("order", range(3))
def test_what_sections_say_follows_the_height_as_a_monotone_cubic_level_beyond_both_ends(order):
    z, exponent = [0.0, 0.01, 0.03, 0.035, 0.07, 0.1], [2.0, 3.0, 2.5, 5.0, 5.2, 5.2]
    body = of_sections([Section(h, 0.03, exponent=n) for h, n in zip(z, exponent, strict=True)])
    x = np.concatenate([np.linspace(-0.02, 0.12, 201), z])
    beyond = PchipInterpolator([-0.1, *z, 0.2], [2.0, *exponent, 5.2])
    assert body.exponent(x, order) == pytest.approx(beyond(x, nu=order), rel=1e-11, abs=1e-9)
