"""Exact volume of the grasp wrench space of two antipodal contacts.

Contact ``i`` presses with a normal force in [0, 1] and carries the tangential loads of its limit surface in
proportion: the cone ``K_i`` over that body, with its tip at 0. The grasp wrench space is the sum ``K_1 + K_2``
(L-infinity: each contact has its own limit of force) or the hull of the union (L1: the contacts share one).

Derivation. Let the normal forces be ``l_1, l_2`` and slice at the net force ``s = l_1 - l_2`` along the line of the
contacts. The cones grow with ``l``, so only the largest pair counts: ``(1, 1 - s)`` or ``(1 + s, 1)``. The four
tangential forces map one to one, with determinant ``d^2 / rho^2``, to the two net forces and the two torques across
the line; the torques about the line add up. A slice therefore has the volume

    d^2 / rho^3 (l_1^3 V_1 l_2^2 A_2 + l_1^2 A_1 l_2^3 V_2),

and the integral of ``l^2 + l^3`` over [0, 1] is 7/12. For L1 the pairs have ``l_1 + l_2 = 1``, so ``ds = 2 dl``, and
the integral of ``l^3 (1 - l)^2`` is 1/60.
"""

from __future__ import annotations


def volume_linf(V1: float, A1: float, V2: float, A2: float, d: float, rho: float = 1.0) -> float:
    """Volume of the L-infinity grasp wrench space, ``7/12 d^2 (V1 A2 + A1 V2) / rho^3``.

    Parameters
    ----------
    V1, V2 : float
        Volumes of the limit surfaces in ``(f_x, f_y, tau_z)`` per unit normal force.
    A1, A2 : float
        Areas of their shadows on the plane of the forces.
    d : float
        Distance of the contacts.
    rho : float
        Length by which all torques are divided.

    Notes
    -----
    The bodies can be ellipsoids, polytopes or exact limit surfaces. The volume does not depend on where the object's
    centre of mass lies.
    """
    return 7 / 12 * d**2 * (V1 * A2 + A1 * V2) / rho**3


def volume_l1(V1: float, A1: float, V2: float, A2: float, d: float, rho: float = 1.0) -> float:
    """Volume of the L1 grasp wrench space, ``1/30 d^2 (V1 A2 + A1 V2) / rho^3``; parameters as in `volume_linf`."""
    return 1 / 30 * d**2 * (V1 * A2 + A1 * V2) / rho**3
