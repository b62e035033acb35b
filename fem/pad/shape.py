"""Pad and backing plate before discretisation: a plan needs no more, and loads neither scikit-fem nor numba."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softjaw.fem.pad.halving import halved
from softjaw.friction.patch import FloatArray

PER_SIDE = {"hex8": 2, "hex27": 3}  # nodes along a side of each element


class PadShape(NamedTuple):
    """Dimensions and mesh of a pad.

    ``size``: length (x), width (y), thickness (z) [m]; ``elements`` of the whole pad along these; ``grading``: size of
    the elements at the rim (x, y) and at the back (z) over that at the centre and at the contact face; ``element``:
    "hex8" (trilinear, 2 x 2 x 2 points) or "hex27" (triquadratic, 3 x 3 x 3 points).
    """

    size: tuple[float, float, float]
    elements: tuple[int, int, int]
    grading: tuple[float, float, float] = (1.0, 1.0, 1.0)
    element: str = "hex8"

    @property
    def per_side(self) -> int:
        """Nodes along a side of an element, and quadrature points along a side of its face."""
        return PER_SIDE[self.element]

    @property
    def patch_faces(self) -> tuple[int, int]:
        """Faces of a contact patch along length and width: one for each quadrature point of the contact face."""
        return self.per_side * self.elements[0], self.per_side * self.elements[1]

    def halved(self) -> PadShape:
        """The same pad with half as many elements in every direction; see `halved`."""
        return PadShape(self.size, halved(self.elements), self.grading, self.element)

    def lines(self, axis: int, half: bool) -> FloatArray:
        """Mesh lines along an axis [m]; ``half`` keeps the positive side."""
        n, length, ratio = self.elements[axis], self.size[axis], self.grading[axis]
        if axis == 2:
            # fine at the contact face, where the pressure changes most; the bonded back may be coarser
            return -length * _graded(n, ratio)[::-1]
        # no mesh line lies in the middle from which a grading could start
        if n % 2:
            return np.linspace(-length / 2, length / 2, n + 1)
        positive = length / 2 * _graded(n // 2, ratio)
        return positive if half else np.concatenate([-positive[:0:-1], positive])


class BackingPlate(NamedTuple):
    """Plate behind a pad; lengths in m, the modulus in Pa.

    ``support``: length and width of the patch in the middle that the finger holds; 0 for a line. What reaches beyond
    the plate holds nothing: a plate that is no larger than the patch is rigid.
    """

    thickness: float
    young_modulus: float
    poisson_ratio: float
    support: tuple[float, float]


class TiltingMount(NamedTuple):
    """Rigid plate behind a pad that may tilt about the axes through its middle.

    ``stiffness``: moment per angle, the same about both axes [N m]; ``glue``: stiffness per area of the bond [Pa/m],
    high beside that of the pad.
    """

    stiffness: float
    glue: float


def _graded(n: int, ratio: float) -> FloatArray:
    """Lines ``0..1`` whose intervals grow geometrically so that the last is ``ratio`` times the first."""
    steps = ratio ** np.linspace(0.0, 1.0, n) if n > 1 else np.ones(1)
    return np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])
