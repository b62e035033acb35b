"""Laws that a converged state must obey, whatever the solver said."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.problem import ContactPoints
from softjaw.fem.errors import CheckError
from softjaw.fem.pad.foam import Foam

FloatArray = NDArray[np.float64]
BALANCE = 1e-8  # of the normal force
PENETRATION = 1e-9  # of an element's size
TENSION = COMPLEMENTARITY = 1e-8  # of the largest pressure, of that times an element's size


@dataclass(frozen=True)
class Checks:
    """Measures of a converged state; the first four must be small, ``min_det_f`` positive.

    ``force_balance`` is relative to the force, ``tension`` to the largest pressure, ``penetration`` and
    ``complementarity`` (largest product of pressure and gap, over the mean pressure) to the element's size;
    ``overlap`` is the deepest point of the front inside the object [m]: weighted gaps hold on average, so it tells how
    well the mesh follows the object; ``acoustic`` is the smallest eigenvalue of the acoustic tensor over the shear
    modulus: not positive means that the foam has lost ellipticity and that strains may localise.
    """

    force_balance: float
    tension: float
    penetration: float
    complementarity: float
    overlap: float
    min_det_f: float
    max_strain: float
    acoustic: float


def check(
    foam: Foam, x: FloatArray, state: tuple[FloatArray, FloatArray, ContactPoints], left_over: float, force: float,
    residual: float,
) -> Checks:  # fmt: skip
    """Measures of a pad's state ``x`` at a normal force [N] on the whole pad.

    Parameters
    ----------
    foam : Foam
    x : (size,) array
        Unknowns of the pad.
    state : tuple
        Nodal pressures, mean gaps and points of the front, as ``contact_state`` gives them.
    left_over : float
        Largest force out of balance at a node, of the whole pad [N].
    force, residual : float
        The normal force [N], and the part of it that a node may be out of balance.

    Raises
    ------
    CheckError
        With the law that is broken, the figure and its bound.
    """
    pad = foam.pad
    pressure, gap, points = state
    det, strain, acoustic = foam.strains(x, DIRECTIONS)
    size = float(np.ptp(pad.nodes[pad.face_nodes[0]], axis=0)[:2].min())
    largest = max(float(pressure.max(initial=0.0)), 1e-300)
    checks = Checks(
        force_balance=abs(points.force[2] / pad.share - force) / force,
        tension=max(0.0, -float(pressure.min())) / largest,
        penetration=max(0.0, -float(gap.min())) / size,
        complementarity=float(np.abs(pressure * gap).max(initial=0.0)) / (largest * size),
        overlap=max(0.0, -float(points.gap.min())),
        min_det_f=det,
        max_strain=strain,
        acoustic=acoustic,
    )
    for kept, broken in (
        (checks.force_balance <= BALANCE, f"force balance is off by {checks.force_balance:.1e} of the force"),
        (checks.tension <= TENSION, f"the contact pulls: lowest pressure {pressure.min():.3g} Pa"),
        (checks.penetration <= PENETRATION, f"the pad penetrates the object by {-gap.min():.3g} m"),
        (checks.complementarity <= COMPLEMENTARITY, "pressure and gap are both positive at a node"),
        (det > 0.0, f"an element is inverted: det F = {det:.3g}"),
        (left_over <= max(BALANCE, residual) * force, f"a node of the foam is out of balance by {left_over:.3g} N"),
    ):
        if not kept:
            raise CheckError(f"the state at {force:.4g} N converged but is wrong: {broken}")
    return checks


def _hemisphere(n: int) -> FloatArray:
    """Unit vectors spread evenly over a hemisphere ``(n, 3)`` (Fibonacci)."""
    z = (np.arange(n) + 0.5) / n
    phi = np.arange(n) * np.pi * (3.0 - np.sqrt(5.0))
    return np.column_stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z])


DIRECTIONS = _hemisphere(24)  # in which the acoustic tensor is formed
