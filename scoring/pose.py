"""Volume of the grasp wrench space of two soft contacts in any pose.

Derivation, L-infinity. The cones ``K_1, K_2`` span 4 dimensions each, so their spans meet in a plane T at least; if in
more, the space is flat. With the rest of each span in planes ``U_1, U_2`` across T, the points of ``K_1 + K_2`` over
``(u_1, u_2)`` are the sum of the two fibres, of area ``|F_1| + 2 V(F_1, F_2) + |F_2|``. The mixed area V is linear in
each, so the integral is

    J (|K_1| a_2 + a_1 |K_2| + 2 V(S_1, S_2)),

``a_i`` the area of the shadow of ``K_i`` along T, ``S_i`` the integral of its fibres, J the volume between the planes.

Derivation, L1. Let ``a_i . t`` be the normal force of contact i of the wrench t of T, and
``delta = a_1 - a_2``. Of all ways to divide a wrench among the contacts the one with the least sum of normal forces has
the first share as far as it goes along ``-delta``: at the edge of cone 1 while share 2 is anywhere in its cone, or at
the edge of cone 2, or both on the flanks of their cones, with delta between the normals ``-n_1`` and ``n_2``. With the
areas ``R_i`` below those edges and normal forces that sum to 1 at most, the three parts are

    J ((|K_1| R_2 + R_1 |K_2|) / 15 + sum |n_1 x n_2| / 20)

over these pairs of sides of ``S_1, S_2`` (integrals of ``(1 - l)^4 l`` and of ``9 l_1^2 l_2^2``). Facing contacts give
7/12 and 1/30 of `scoring.closed_form`.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softjaw.scoring.contact import Body, FloatArray, SoftContact, ball_map, vertices_of
from softjaw.scoring.fibre import Fibre, Span, fibre_of

DELTA_TURN = 1e-9  # [rad] keeps a direction off sides parallel to it, where the share of least force is not unique


class PoseVolume(NamedTuple):
    """Volumes of the grasp wrench space and how far they may be off."""

    linf: float
    l1: float
    relative_error: float


def pose_volume(
    contact1: SoftContact,
    contact2: SoftContact,
    object_length: ArrayLike,
    contact_length: float,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    relative_error: float = 1e-5,
    with_l1: bool = True,
) -> PoseVolume:
    """Volumes of the L-infinity and L1 grasp wrench spaces of two contacts in any pose [-].

    Ellipsoids are fastest, polytopes exact. Lengths and centre are as in `scoring.contact.SoftContact.wrench_map`; the
    volumes do not depend on the centre. Pieces of surface are divided until the error is at most ``relative_error``,
    or to the finest division, which leaves some 3e-4 for bodies that are neither: theirs is at least half of what
    extrapolation adds to the volume of a hull. The L1 volume, NaN unless it is asked for, takes a third of the time.
    """
    lengths = object_length, contact_length, centre_of_mass
    (C1, body1), (C2, body2) = (_evened(c.wrench_map(*lengths), c.body) for c in (contact1, contact2))
    spans = _spans(C1, body1, C2, body2)
    if spans is None:
        return PoseVolume(0.0, 0.0, 0.0)
    fibres = fibre_of(body1, spans[0]), fibre_of(body2, spans[1])
    J = abs(float(np.linalg.det(np.hstack([spans[0].T, spans[0].U, spans[1].U]))))
    a1, a2 = (np.linalg.lstsq(span.C, span.T, rcond=None)[0][0] for span in spans)
    # the direction along which a contact's share of the normal force changes
    delta = a1 - a2
    # where no division of a wrench costs less than another, any direction will do
    if math.hypot(*delta) <= 1e-9 * (math.hypot(*a1) + math.hypot(*a2)):
        delta = np.array([1.0, 0.0])
    delta = delta + DELTA_TURN * np.array([-delta[1], delta[0]])
    coarse = _volumes(fibres, delta, 0, with_l1)
    if all(fibre.exact for fibre in fibres):
        return PoseVolume(float(J * coarse[0]), float(J * coarse[1]), DELTA_TURN)
    before, share = coarse, max(fibre.error_share for fibre in fibres if not fibre.exact)
    for level in range(1, min(fibre.finest for fibre in fibres) + 1):
        fine = _volumes(fibres, delta, level, with_l1)
        # Errors go with the square of the size of the pieces.
        better = fine + (fine - coarse) / 3
        # nan represents an L1 volume that was not asked for
        off = np.maximum(np.abs(better - before), share * np.abs(better - fine))
        error = float(np.nanmax(off / np.maximum(np.abs(better), 1e-300)))
        if error <= relative_error:
            break
        coarse, before = fine, better
    # an extrapolation may undershoot a volume near 0
    linf, l1 = J * np.maximum(better, 0)
    return PoseVolume(float(linf), float(l1), max(error, 1e-13))  # rounding leaves this


def _volumes(fibres: tuple[Fibre, Fibre], delta: FloatArray, level: int, with_l1: bool) -> FloatArray:
    """Both volumes over J, ``(2,)``."""
    first, second = fibres
    (K1, A1), (K2, A2) = first.measures(level), second.measures(level)
    n1, n2 = first.sides(level, delta), second.sides(level, delta)
    V = mixed_area(np.vstack([n1, first.base(level)]), np.vstack([n2, second.base(level)]))
    linf = K1 * A2 + A1 * K2 + 2 * V
    if not with_l1:
        return np.array([linf, math.nan])
    edges = K1 * second.ridge(level, delta) + first.ridge(level, -delta) * K2
    return np.array([linf, edges / 15 + joint_pairs(n1, n2, delta) / 20])


def _evened(C: FloatArray, body: Any) -> tuple[FloatArray, Body]:
    """Wrench map and body in loads that reach to 1, or are divided by their wrench's size if there are none.

    What is thin enough to count as flat must not depend on the unit of length.
    """
    if vertices_of(body) is None and ball_map(body) is None:
        return C, body  # no other body is thickened
    reach = body.support(np.eye(3))
    scale = np.where(reach > 0, reach, 1 / np.linalg.norm(C[:, 1:], axis=0))
    return C * np.append(1.0, scale), body.scaled(1 / scale)


def _spans(C1: FloatArray, body1: Body, C2: FloatArray, body2: Body) -> tuple[Span, Span] | None:
    """The two spans, split along the plane in which they meet; None if all wrenches lie in less than 6 dimensions."""
    scaled, loads = [], []
    for C, body in ((C1, body1), (C2, body2)):
        reach = np.append(1.0, body.support(np.eye(3)))
        D = C * np.where(reach > 0, reach, 1.0)
        scaled.append(D / np.linalg.norm(D, axis=0))
        loads.append(scaled[-1][:, reach > 0])
    carried = np.linalg.svd(np.hstack(loads), compute_uv=False)
    if len(carried) < 6 or carried[5] <= 1e-13 * carried[0]:
        return None
    # null vectors of [C_1, -C_2] are the wrenches that both spans hold; columns of one size make the rank fair
    values, vectors = np.linalg.svd(np.hstack([scaled[0], -scaled[1]]))[1:]
    if values[5] <= 1e-13 * values[0]:
        return None
    T = np.linalg.qr(scaled[0] @ vectors[6:, :4].T)[0]
    # a second QR takes out what rounding left of U along T
    U1, U2 = (np.linalg.qr(np.hstack([T, np.linalg.svd(D - T @ (T.T @ D))[0][:, :2]]))[0][:, 2:] for D in scaled)
    return Span(C1, T, U1), Span(C2, T, U2)


def mixed_area(sides1: FloatArray, sides2: FloatArray) -> float:
    """Mixed area of two convex polygons, ``1/2 sum h_1(n) |n|`` over the sides n of the second.

    Sides ``(m, 2)`` are outward normals in any order, as long as their sides; each set sums to 0.
    """
    first, second = np.arctan2(sides1[:, 1], sides1[:, 0]), np.arctan2(sides2[:, 1], sides2[:, 0])
    order = np.argsort(first)
    n = sides1[order]
    # a side is its normal turned by a quarter; in order of angle sides close the polygon
    corners = np.cumsum(np.column_stack([-n[:, 1], n[:, 0]]), axis=0)
    # The corner after the last side before the angle is the farthest point in that direction.
    return 0.5 * float((corners[np.searchsorted(first[order], second) - 1] * sides2).sum())


def joint_pairs(normals1: FloatArray, normals2: FloatArray, direction: FloatArray) -> float:
    """Sum of ``|n_1 x n_2|`` over the pairs of normals ``(m, 2)`` with the direction between ``-n_1`` and ``n_2``."""
    x, y = direction / np.linalg.norm(direction)
    turn = np.array([[x, -y], [y, x]])
    a, b = -normals1 @ turn, normals2 @ turn
    # pairs on the other side of the direction are those of the mirror image
    mirror = np.array([1.0, -1.0])
    return _pairs(a, b) + _pairs(a * mirror, b * mirror)


def _pairs(a: FloatArray, b: FloatArray) -> float:
    """Sum of ``a x b`` over pairs with a below the first axis, b above it, and less than a half turn between them."""
    a, b = a[a[:, 1] < 0], b[b[:, 1] > 0]
    angle = np.arctan2(b[:, 1], b[:, 0])
    order = np.argsort(angle)
    # running sums over sorted angles spare the loop over all pairs
    total = np.vstack([np.zeros(2), np.cumsum(b[order], axis=0)])
    reached = total[np.searchsorted(angle[order], np.arctan2(a[:, 1], a[:, 0]) + np.pi)]
    return float((a[:, 0] * reached[:, 1] - a[:, 1] * reached[:, 0]).sum())
