"""Laws that a converged state must obey, whatever the solver said, and why a load path ends."""

from typing import NamedTuple

import numpy as np

from softjaw.fem.contact.problem import ContactPoints
from softjaw.fem.errors import CheckError, ConvergenceError, NotReachedError
from softjaw.fem.pad.foam import Foam
from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.patch import FloatArray

BALANCE = 1e-8  # of the normal force
# of an element's size, of the largest pressure, of their product: a hundred times what the tolerance of the solve
# leaves at the smallest contacts of practice, and far below what a result can show
CONTACT_LAWS = 1e-6
ALTERNATING = 1e-4  # the same where the nodes in contact alternate for ever: still far below the error of any mesh
# The same of states that are only passed on the way with friction, where a point at an edge of the object may have no
# place between stick and slip.
PASSED = 1e-3
# In which the acoustic tensor is formed: half of all are enough, because it is even in its direction.
DIRECTIONS = fibonacci_twists(24, 1.0)
BARELY_ELLIPTIC = 0.1  # eigenvalue of the acoustic tensor over the shear modulus at which foam gives way somewhere


class Checks(NamedTuple):
    """Measures of a converged state; the first four must be small, ``min_det_f`` positive.

    ``force_balance`` is relative to the force, ``adhesion`` to the largest pressure, ``penetration`` and
    ``complementarity`` (largest product of pressure and gap, over the mean pressure) to the element's size;
    ``penetration_depth`` is the deepest point of the contact face inside the object [m]: weighted gaps hold on average,
    so it shows how well the mesh follows the object; ``ellipticity`` is the smallest eigenvalue of the acoustic tensor
    over the shear modulus: not positive means that the foam has lost ellipticity and that strains may localise.
    """

    force_balance: float
    adhesion: float
    penetration: float
    complementarity: float
    penetration_depth: float
    min_det_f: float
    max_strain: float
    ellipticity: float


def check(
    foam: Foam, x: FloatArray, state: tuple[FloatArray, FloatArray, ContactPoints], imbalance: float, force: float,
    residual: float, slack: float = 0.0,
) -> Checks:  # fmt: skip
    """Measures of a pad's state ``x (size,)`` at a normal force [N] on the whole pad.

    ``state``: nodal pressures, mean gaps and points of the contact face, as ``contact_state`` gives them;
    ``imbalance``: largest force out of balance at a node, of the whole pad [N]; ``residual``: part of the force that
    this may be; ``slack``: what every law of the contact may be off by at least, `ALTERNATING` or nothing.

    Raises `CheckError`: with the law that is broken, the figure and its bound.
    """
    pad = foam.pad
    pressure, gap, points = state
    det, strain, ellipticity = foam.strains(x, DIRECTIONS)
    # an element's side in the plane of the contact face is the length by which a gap is small or not
    size = float(np.ptp(pad.nodes[pad.face_nodes[0]], axis=0)[:2].min())
    # a state without any pressure has to fail by its force balance, not by a division by zero
    largest = max(float(pressure.max(initial=0.0)), 1e-300)
    checks = Checks(
        force_balance=abs(points.force[2] / pad.share - force) / force,
        adhesion=max(0.0, -float(pressure.min())) / largest,
        penetration=max(0.0, -float(gap.min())) / size,
        complementarity=float(np.abs(pressure * gap).max(initial=0.0)) / (largest * size),
        penetration_depth=points.depth,
        min_det_f=det,
        max_strain=strain,
        ellipticity=ellipticity,
    )
    # a caller that loosens the tolerance of the solve loosens what it is for, and no other check
    bound, balance = max(CONTACT_LAWS, slack), max(BALANCE, residual, slack)
    for holds, broken in (
        (checks.force_balance <= balance, f"the force balance is off by {checks.force_balance:.1e}"),
        (checks.adhesion <= bound, f"tension in the contact: lowest pressure {pressure.min():.3g} Pa"),
        (checks.penetration <= bound, f"the pad penetrates the object by {-gap.min():.3g} m"),
        (checks.complementarity <= bound, "pressure and gap are both positive at a node"),
        (det > 0.0, f"an element is inverted: det F = {det:.3g}"),
        (imbalance <= balance * force, f"a node is out of balance by {imbalance:.3g} N"),
    ):
        if not holds:
            raise CheckError(f"the state at {force:.4g} N converged but is wrong: {broken}")
    return checks


def explained(error: ConvergenceError, foam: Foam, x: FloatArray, force: float) -> ConvergenceError:
    """The error, or one that names the foam's state where that is why no further state was found.

    ``error``: what the solver said; ``x (size,)``: last state in equilibrium, at the normal force ``force`` [N].
    """
    det, strain, ellipticity = foam.strains(x, DIRECTIONS)
    # the reason is looked for in the last state in equilibrium: what failed beyond it has no state to look at
    # strain beyond which not the contact is what fails
    if isinstance(error, NotReachedError) or (ellipticity > BARELY_ELLIPTIC and strain < 0.7):
        return error
    # still elliptic, so it is the strain that is too much
    if ellipticity > BARELY_ELLIPTIC:
        return ConvergenceError(
            f"the pad is compressed too far: at {force:.4g} N its largest strain is {strain:.0%}, its smallest det F "
            f"{det:.2g}; its surface creases or its elements are too distorted to continue ({error})"
        )
    return ConvergenceError(
        f"the foam loses ellipticity: at {force:.4g} N its acoustic tensor's least eigenvalue is {ellipticity:.2g} of "
        f"the shear modulus, its largest strain {strain:.0%}; strains localise, no equilibrium found beyond ({error})"
    )


def refuse_fall(low: tuple[float, float], high: tuple[float, float]) -> None:
    """`CheckError` where, on a rigid object, the force [N] grows and the closing [m] falls from ``low`` to ``high``."""
    # a fallback pad may follow one with other gaps, and their closings differ a little without any fault
    # share of the closing displacement from one force to the next: weighted and nodal gaps differ by less
    if high[0] > low[0] and high[1] < (1.0 - 0.05) * low[1]:
        raise CheckError(
            f"the closing displacement falls from {1e3 * low[1]:.4g} mm at {low[0]:.4g} N to {1e3 * high[1]:.4g} mm at "
            f"{high[0]:.4g} N: one state is off the load path; the contact is too small for the mesh, refine the pad"
        )
