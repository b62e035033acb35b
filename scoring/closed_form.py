"""Volume and epsilon of two soft contacts that face each other, in closed form.

Volume. Contact ``i`` presses with a normal force in [0, 1] and carries the tangential loads of its limit surface in
proportion: the cone ``K_i`` over that body, with its tip at 0. The grasp wrench space is the sum ``K_1 + K_2``
(L-infinity: each contact has its own limit of force) or the hull of the union (L1: the contacts share one). Let the
normal forces be ``l_1, l_2`` and slice at the net force ``s = l_1 - l_2`` along the line of the contacts. The cones
grow with ``l``, so only the largest pair counts: ``(1, 1 - s)`` or ``(1 + s, 1)``. The four tangential forces map one
to one, with determinant ``d^2 / rho^2``, to the two net forces and the two torques across the line; the torques about
the line add up. A slice therefore has the volume

    d^2 / rho^3 (l_1^3 V_1 l_2^2 A_2 + l_1^2 A_1 l_2^3 V_2),

and the integral of ``l^2 + l^3`` over [0, 1] is 7/12. For L1 the pairs have ``l_1 + l_2 = 1``, so ``ds = 2 dl``, and
the integral of ``l^3 (1 - l)^2`` is 1/60.

Epsilon. Both limit surfaces are ellipsoids with parallel axes and the centre of mass lies on the line of the contacts.
Epsilon is the least support of the grasp wrench space over unit wrenches ``u``. Let ``n_i(u)`` be the support of
contact ``i``'s limit surface for the part of ``u`` that is no force along the line, a unit vector of R^5. Minimising
over the force along the line leaves

    L-infinity:  F = (n_1 + n_2) / sqrt(1 + max(n_1, n_2)^2),     L1:  F = (n_1 + n_2) / sqrt(4 + (n_1 - n_2)^2),

or 1 if that is smaller. The squares ``(n_1^2, n_2^2)`` are two quadratic forms on a sphere, so they fill a convex set
(Brickman's theorem). Where F <= 1 its upper level sets in that plane are convex too, because ``F >= c`` says that a
concave function is not negative: F is least at an extreme point. The forms fall apart into the torque about the line,
which gives the point ``(t_1^2, t_2^2)``, and two planes (force across, torque it makes). On the unit circle of a plane
``n_i`` is a multiple of ``abs(cos(phi - phi_i))``, and between neighbouring zeros of ``n_1`` and ``n_2`` F is least at
one of them: there ``F >= c`` is the sign of a concave function of ``phi`` for L-infinity, and for L1 that of a sinusoid
with its trough outside. So only those zeros remain: a wrench that one contact cannot feel and the other bears alone.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Axes = Sequence[float] | NDArray[np.float64]


def volume_linf(V1: float, A1: float, V2: float, A2: float, d: float) -> float:
    """Volume of the L-infinity grasp wrench space, ``7/12 d^2 (V1 A2 + A1 V2)``.

    ``V1, V2``: volumes of the limit surfaces in ``(f_x, f_y, tau_z)`` per unit normal force, torques divided by their
    length; ``A1, A2``: areas of their shadows on the plane of the forces; ``d``: distance of the contacts, divided by
    the length for arms.

    The bodies can be ellipsoids, polytopes or exact limit surfaces. The volume does not depend on where the object's
    centre of mass lies.
    """
    return 7 / 12 * d**2 * (V1 * A2 + A1 * V2)


def volume_l1(V1: float, A1: float, V2: float, A2: float, d: float) -> float:
    """Volume of the L1 grasp wrench space, ``1/30 d^2 (V1 A2 + A1 V2)``; parameters as in `volume_linf`."""
    return 1 / 30 * d**2 * (V1 * A2 + A1 * V2)


def epsilon_linf(contact1: Axes, contact2: Axes, arm1: float, arm2: float) -> float:
    """Radius of the largest ball around 0 in the L-infinity grasp wrench space [-].

    Contacts are semi-axes ``(f_x, f_y, tau_z)`` per unit normal force, the torque divided by its length; arms are their
    positions along their line from the centre of mass, over the length for arms, of opposite sign if it lies between.

    >>> round(epsilon_linf((1, 1, 0.2), (1, 1, 0.2), -0.5, 0.5), 6) == round(0.4 / 1.04**0.5, 6)
    True
    """
    t1, t2 = contact1[2], contact2[2]
    return _epsilon((t1 + t2) / math.sqrt(1 + max(t1, t2) ** 2), 1, contact1, contact2, arm1, arm2)


def epsilon_l1(contact1: Axes, contact2: Axes, arm1: float, arm2: float) -> float:
    """Radius of the largest ball around 0 in the L1 grasp wrench space [-]; parameters as in `epsilon_linf`."""
    t1, t2 = contact1[2], contact2[2]
    return _epsilon((t1 + t2) / math.sqrt(4 + (t1 - t2) ** 2), 4, contact1, contact2, arm1, arm2)


def _epsilon(about: float, share: int, contact1: Axes, contact2: Axes, arm1: float, arm2: float) -> float:
    """The least support: ``about`` the line; by one contact alone about the other, squares there ``share`` times."""
    D = abs(arm2 - arm1)
    alone = [(contact[k] * D, other) for contact, other in ((contact1, arm2), (contact2, arm1)) for k in (0, 1)]
    # a force along the line is met by one normal force: support 1
    return min(1.0, about, *(n / math.sqrt(share * (1 + other**2) + n**2) for n, other in alone))
