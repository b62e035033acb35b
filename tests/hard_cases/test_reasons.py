"""A ladder that ends says why, and not what only the solver saw."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.fem.contact.checks import explained
from softjaw.fem.contact.problem import SpringBed
from softjaw.fem.errors import ConvergenceError, NotReachedError
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
        ((0.5, 0.4, 0.3), STUCK, ""),
        ((0.1, 1.2, 0.9), STUCK, "120%"),
        ((0.4, 1.2, -0.06), STUCK, "ellipticity.* -0.06"),
        ((0.4, 1.2, -0.06), NotReachedError("the force stays below"), ""),
    ],
)
def test_the_state_of_the_foam_is_the_reason_where_it_is(state, error, words):
    told = explained(error, foam(*state), np.zeros(1), 3.0)
    assert (told is error) == (not words)
    assert re.search(words, str(told))


def test_only_nearly_incompressible_pads_start_unsqueezed():
    gap = reference.placed(Sphere(0.02), reference.facing(0.02))
    spread = []
    for nu in (0.25, 0.499):
        pad = Pad(PadShape((0.05, 0.022, 0.015), (4, 2, 2)), material("neo_hookean", 4e4, nu), (True, True), "weighted")
        u = pad.displacement(SpringBed(pad, gap).guess(1e-3))[:, 2]
        spread.append(np.ptp(u))
    assert spread[0] > 5e-4
    assert spread[1] < 1e-12  # of strokes of 1 mm; the guess is the same everywhere
