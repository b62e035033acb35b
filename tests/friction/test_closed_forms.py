"""Maxima of patches with a closed form, and the order in which the meshes approach it (mu = 1, pressure 1)."""

import math
from itertools import pairwise

import numpy as np
import pytest

from softjaw.friction.wrench import friction_limits
from tests.friction.closed_forms import FORMS, mean_distance
from tests.generators import ellcyl_grid

NAMES = ("S", "F_N", "f_x", "f_y", "tau_z")


def relative_errors(form, n):
    limits = friction_limits(form.patch(n), 1.0, form.model)
    return np.array([abs(getattr(limits, name) / getattr(form, name) - 1) for name in NAMES])


@pytest.mark.parametrize("name", FORMS)
def test_every_limit_converges_to_its_closed_form(name):
    """Order 2 for smooth pressures, 1.5 where they fall like a root at the edge, 1 + 1/k for powers."""
    form = FORMS[name]
    errors = [relative_errors(form, n) for n in (16, 32, 64)]
    assert (errors[-1] < 1.5e-3).all()
    for coarse, fine in pairwise(errors):
        inexact = fine > 1e-9  # what the midpoints integrate exactly is exact on every mesh
        np.testing.assert_allclose(np.log2(coarse[inexact] / fine[inexact]), form.order, atol=0.1)
    assert inexact[4] or name in ("line", "ring")


def test_the_closed_forms_are_those_of_the_books():
    """Values that need no program: Hertz and uniform discs, square, hemisphere (f = S pi / 4), line, ring."""
    assert FORMS["Hertz disc"].tau_z == pytest.approx(2 / 3 * np.pi * 3 * np.pi / 16)
    assert mean_distance(1, 1) == pytest.approx(0.3825978582)
    assert FORMS["hemisphere"].f_x == pytest.approx(np.pi**2 / 2) == pytest.approx(FORMS["hemisphere"].S * np.pi / 4)
    assert FORMS["hemisphere"].tau_z == pytest.approx(np.pi**2 / 2)


@pytest.mark.parametrize(
    ("ratio", "f_y", "tau_z"),
    [
        (2.5, 0.373, 0.196),
        (2.0, 0.201, 0.115),
        (1 / 0.7, 0.062, 0.038),
        (1.0, 0.0154, 0.0096),
        (1 / 1.5, 0.0030, 0.0019),
        (0.5, 0.0009, 0.0006),
        (0.4, 0.0004, 0.0002),
    ],
)
def test_what_a_planar_model_claims_too_much_on_elliptic_cylinders(ratio, f_y, tau_z):
    """Figure 4c in shape, as shares of the planar value: semi-axis 1 along the normal, half width .3, length 1.

    Figures of an independent implementation. On the circle f_y is ``1 - .3 / asin(.3)``.
    """
    b = 1 / ratio
    patch = ellcyl_grid(1.0, b, math.asin(0.3 / b), 1.0, 80, 80)
    curved, flat = friction_limits(patch, 1.0), friction_limits(patch, 1.0, "pcm")
    assert flat.f_x == pytest.approx(curved.f_x, rel=1e-12)
    digit = 1e-3 if f_y > 0.05 else 1e-4
    assert 1 - curved.f_y / flat.f_y == pytest.approx(f_y, abs=0.51 * digit)
    assert 1 - curved.tau_z / flat.tau_z == pytest.approx(tau_z, abs=0.51 * digit)
