"""Maxima of patches with a closed form, and the order in which the meshes approach it (mu = 1, pressure 1)."""

from itertools import pairwise

import numpy as np
import pytest

from softjaw.friction.wrench import friction_limits
from tests.friction.closed_forms import FORMS, mean_distance

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
