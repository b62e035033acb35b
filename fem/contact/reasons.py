"""Why a ladder of forces ends: what the foam has come to, told in place of the solver's last words."""

from __future__ import annotations

from softjaw.fem.contact.checks import DIRECTIONS
from softjaw.fem.errors import CheckError, ConvergenceError, NotReachedError
from softjaw.fem.pad.foam import FloatArray, Foam

BARELY_ELLIPTIC = 0.1  # eigenvalue of the acoustic tensor over the shear modulus at which foam gives way somewhere
TOO_MUCH = 0.7  # strain beyond which not the contact is what fails
MOST_FALL = 0.05  # of the travel from one force to the next: weighted and nodal gaps differ by less


def explained(error: ConvergenceError, foam: Foam, x: FloatArray, force: float) -> ConvergenceError:
    """The error, or one that names the foam's state where that is why no further state was found.

    Parameters
    ----------
    error : ConvergenceError
        What the solver said.
    foam : Foam
    x : (size,) array
        Last state in equilibrium, at the normal force ``force`` [N].
    """
    det, strain, acoustic = foam.strains(x, DIRECTIONS)
    if isinstance(error, NotReachedError) or (acoustic > BARELY_ELLIPTIC and strain < TOO_MUCH):
        return error
    if acoustic > BARELY_ELLIPTIC:
        return ConvergenceError(
            f"the pad is squeezed too far: at {force:.4g} N its largest strain is {strain:.0%}, its smallest det F "
            f"{det:.2g}; its surface creases or its elements are too distorted to go on ({error})"
        )
    return ConvergenceError(
        f"the foam loses ellipticity: at {force:.4g} N the smallest eigenvalue of its acoustic tensor is "
        f"{acoustic:.2g} of the shear modulus and the largest strain {strain:.0%}, strains localise, and no "
        f"equilibrium was found beyond ({error})"
    )


def refuse_fall(low: tuple[float, float], high: tuple[float, float]) -> None:
    """Refuse a state that a pad on a rigid object cannot have come to: more force means more travel.

    Parameters
    ----------
    low, high : (float, float)
        Force [N] and travel [m] of a state and of the next one.

    Raises
    ------
    CheckError
        If the force grew and the travel fell.
    """
    if high[0] > low[0] and high[1] < (1.0 - MOST_FALL) * low[1]:
        raise CheckError(
            f"the travel falls from {1e3 * low[1]:.4g} mm at {low[0]:.4g} N to {1e3 * high[1]:.4g} mm at "
            f"{high[0]:.4g} N: one of the two states is not what a growing force leads to; the contact is too small "
            "for the mesh, refine the pad"
        )
