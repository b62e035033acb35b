"""Epsilon quality: the weakest wrench that breaks a grasp of two antipodal soft contacts, in closed form.

Both limit surfaces are ellipsoids with parallel axes and the centre of mass lies on the line of the contacts.

Derivation. Epsilon is the least support of the grasp wrench space over unit wrenches ``u``. Let ``n_i(u)`` be the
support of contact ``i``'s limit surface for the part of ``u`` that is no force along the line, a unit vector of R^5.
Minimising over the force along the line leaves

    L-infinity:  F = (n_1 + n_2) / sqrt(1 + max(n_1, n_2)^2),     L1:  F = (n_1 + n_2) / sqrt(4 + (n_1 - n_2)^2),

or 1 if that is smaller. The squares ``(n_1^2, n_2^2)`` are two quadratic forms on a sphere, so they fill a convex set
(Brickman's theorem). Where F <= 1 its upper level sets in that plane are convex too, because ``F >= c`` says that a
concave function is not negative: F is least at an extreme point. The forms fall apart into the torque about the line,
which gives the point ``(t_1^2, t_2^2)``, and two planes (force across, torque it makes). On the unit circle of a plane
``n_i`` is a multiple of ``abs(cos(phi - phi_i))``, and between neighbouring zeros of ``n_1`` and ``n_2`` F is least at
one of them: there ``F >= c`` is the sign of a concave function of ``phi`` for L-infinity, and for L1 that of a sinusoid
with its trough outside. So only those zeros remain: a wrench that one contact cannot feel and the other bears alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence


def epsilon_linf(contact1: Sequence[float], contact2: Sequence[float], arm1: float, arm2: float) -> float:
    """Radius of the largest ball around 0 in the L-infinity grasp wrench space [-].

    Parameters
    ----------
    contact1, contact2 : (3,) sequence
        Semi-axes ``(f_x, f_y, tau_z)`` per unit normal force, the torque divided by its length.
    arm1, arm2 : float
        Positions of the contacts along their line, measured from the centre of mass and divided by the length for arms;
        of opposite sign if the centre of mass lies between them.

    Examples
    --------
    >>> round(epsilon_linf((1, 1, 0.2), (1, 1, 0.2), -0.5, 0.5), 6) == round(0.4 / 1.04**0.5, 6)
    True
    """
    t1, t2 = contact1[2], contact2[2]
    about = (t1 + t2) / math.sqrt(1 + max(t1, t2) ** 2)
    alone = [n / math.sqrt(1 + other**2 + n**2) for n, other in _borne_alone(contact1, contact2, arm1, arm2)]
    return min(1.0, about, *alone)


def epsilon_l1(contact1: Sequence[float], contact2: Sequence[float], arm1: float, arm2: float) -> float:
    """Radius of the largest ball around 0 in the L1 grasp wrench space [-]; parameters as in `epsilon_linf`."""
    t1, t2 = contact1[2], contact2[2]
    about = (t1 + t2) / math.sqrt(4 + (t1 - t2) ** 2)
    alone = [n / math.sqrt(4 * (1 + other**2) + n**2) for n, other in _borne_alone(contact1, contact2, arm1, arm2)]
    return min(1.0, about, *alone)


def _borne_alone(
    contact1: Sequence[float], contact2: Sequence[float], arm1: float, arm2: float
) -> list[tuple[float, float]]:
    """For each contact and direction: moment of its friction about the other contact, and the other's arm."""
    D = abs(arm2 - arm1)
    return [(contact1[k] * D, arm2) for k in (0, 1)] + [(contact2[k] * D, arm1) for k in (0, 1)]
