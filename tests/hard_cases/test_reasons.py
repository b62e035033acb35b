"""A ladder that ends says why, and not what only the solver saw."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.fem.contact.checks import explained, refuse_fall
from softjaw.fem.contact.problem import SpringBed
from softjaw.fem.errors import CheckError, ConvergenceError, NotReachedError
from softjaw.fem.materials import material
from softjaw.fem.objects.shapes import Sphere
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.pad.shape import PadShape
from tests.fem import reference

STUCK = ConvergenceError("stuck at 3 N")


def foam(det, strain, ellipticity):
    return SimpleNamespace(strains=lambda x, directions: (det, strain, ellipticity))


@pytest.mark.parametrize(
    ("state", "error", "words"),
    [
        ((0.5, 0.4, 0.3), STUCK, "stuck at 3 N"),
        ((0.1, 1.2, 0.9), STUCK, "the pad is compressed too far: at 3 N its largest strain is 120%"),
        ((0.4, 1.2, -0.06), STUCK, "the foam loses ellipticity: at 3 N .* is -0.06 of the shear modulus"),
        ((0.4, 1.2, -0.06), NotReachedError("the force stays below"), "the force stays below"),
    ],
)
def test_the_state_of_the_foam_is_the_reason_where_it_is(state, error, words):
    with pytest.raises(ConvergenceError, match=f"^{words}") as told:
        raise explained(error, foam(*state), np.zeros(1), 3.0)
    assert str(error) in str(told.value)


def test_a_closing_that_falls_while_the_force_grows_is_refused():
    with pytest.raises(CheckError, match=r"the closing displacement falls from 23 mm at 1 N to 12 mm at 4 N"):
        refuse_fall((1.0, 0.023), (4.0, 0.012))
    refuse_fall((4.0, 0.023), (1.0, 0.012))  # on the way back
    refuse_fall((1.0, 0.0100), (1.1, 0.0098))  # weighted and nodal gaps differ by as much


def test_only_nearly_incompressible_pads_start_unsqueezed():
    gap = reference.placed(Sphere(0.02), reference.facing(0.02))
    found = []
    for nu in (0.25, 0.499):
        pad = Pad(PadShape((0.05, 0.022, 0.015), (4, 2, 2)), material("neo_hookean", 4e4, nu), (True, True), "weighted")
        u = pad.displacement(SpringBed(pad, gap).guess(1e-3))[:, 2]
        found.append(np.ptp(u))
    assert found[0] > 5e-4
    assert found[1] < 1e-12  # of strokes of 1 mm; the guess is the same everywhere
