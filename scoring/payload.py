"""How much a gripper holds: the largest force at the centre of mass that both contacts bear in every direction.

The drive of a parallel gripper keeps the sum of both normal forces. A load along the closing axis shifts force from one
finger to the other, ``F + s`` and ``F - s``, and the friction of each contact follows its normal force. With ``P_i``
the wrench of finger i's pressure at the force ``F`` and ``B_i`` its limit surface there, the grasp answers with

    W = 2 conv(A_1, A_2),    A_i = P_i + B_i          ("shared", the default),
    W = conv(0, A_1) + conv(0, A_2)                   ("up_to": each finger gives way down to nothing),
    W = A_1 + A_2                                     ("fixed": each keeps its force).

The squeeze comes first: two forces that do not face each other make a couple, and unless 0 lies in W the grasp does not
hold even itself. The forces without a torque about the centre of mass in W are a convex set ``K`` in space, and what
is held in every direction is the radius of the largest ball round 0 in it.

One direction of ``K`` is a linear programme with four rows, whose columns, points of the limit surfaces, are looked for
where its multipliers ask (column generation). The points that several directions give span a polytope inside ``K``; the
normals of its nearest facets are the next directions. Its nearest facet bounds the radius from below, the support of
``K`` from above, for any direction, so that the answer knows its error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from softjaw.scoring.contact import FloatArray, SoftContact

KINDS = ("shared", "up_to", "fixed")
BOUND_GAP = 5e-4  # of the bounds, relative, at which the search ends
ROUNDING_FORCE = 1e-7  # of the forces of the grasp, below which a force is rounding
MOST_POINTS = 400  # of the section, after which the search ends with the bounds that it has
TORQUE_OFFSET = 1e-11  # torque at which K is taken, so that no two bases of the programme are alike


@dataclass(frozen=True)
class Payload:
    """Largest force that is held.

    ``force`` is that of a load at the centre of mass, as proved, 0 where the squeeze itself is not borne, ``upper``
    what it is at most [N], ``direction (3,)`` in which the load pulls then. ``borne`` says whether friction bears the
    squeeze itself; at the limit, and without friction, it does not.
    """

    force: float
    upper: float
    direction: FloatArray
    borne: bool


def payload(
    contacts: Sequence[SoftContact],
    pressure: ArrayLike,
    centre_of_mass: ArrayLike,
    direction: ArrayLike | None = None,
    kind: str = "shared",
) -> Payload:
    """Largest force at the centre of mass that two contacts hold, along ``direction`` or the worst of all.

    Parameters
    ----------
    contacts : two SoftContact
        With polytopes as limit surfaces, at the solved forces [N, N, N m].
    pressure : (2, 6) array
        Wrench of each finger's pressure on the object, torques about the origin [N, N m].
    centre_of_mass : (3,) array
        Where the load acts [m].
    direction : (3,) array, optional
        In which it pulls, of any length.
    kind : str
        What happens to the normal forces: one of `KINDS`.
    """
    centre, P = np.asarray(centre_of_mass, float), np.asarray(pressure, float)
    length = max(float(np.linalg.norm(c.position - centre)) for c in contacts) or 1.0
    C = np.array([c.wrench_map(length, length, centre) for c in contacts])
    C[:, :3, 0], C[:, 3:, 0] = P[:, :3], (P[:, 3:] - np.cross(centre, P[:, :3])) / length
    size = float(np.linalg.norm(P[:, :3], axis=1).sum())
    V1, V2 = (np.ascontiguousarray(getattr(c.body, "vertices").T) / size for c in contacts)  # noqa: B009
    C[:, :, 0] /= size
    grasp = C, V1, V2, KINDS.index(kind)
    answer = _along(grasp, np.asarray(direction, float)) if direction is not None else _worst(grasp)
    return Payload(size * answer.force, size * answer.upper, answer.direction, answer.borne)


# both contacts, forces in units of that of the grasp: C (2, 6, 4), vertices (3, k) of each, and the kind
_Grasp = tuple[FloatArray, FloatArray, FloatArray, int]


def _along(grasp: _Grasp, d: FloatArray) -> Payload:
    """Largest load along one direction, of any length."""
    d = d / np.linalg.norm(d)
    # the answer has no part across the load: two more rows
    across = np.linalg.svd(d[None])[2][1:]
    rows = np.zeros((5, 6))
    rows[:3, 3:], rows[3:, :3] = np.eye(3), across
    section = _Section(grasp, rows)
    most, point, basis = section.farthest(-d, section.begin)
    least = -section.farthest(d, basis)[0]  # from which load on: 0 or less where none is needed
    if most < -ROUNDING_FORCE or least > ROUNDING_FORCE:
        return Payload(0.0, 0.0, d, False)
    return Payload(max(float(-d @ point[:3]), 0.0), max(most, 0.0), d, True)


def _worst(grasp: _Grasp) -> Payload:
    """Largest load in every direction, and one in which a larger one is lost."""
    search = _Section(grasp, np.hstack([np.zeros((3, 3)), np.eye(3)]))
    begin = search.begin
    for u in np.vstack([np.eye(3), -np.eye(3)]):
        begin = search.look(u, begin)
        if search.upper < -ROUNDING_FORCE:
            return Payload(0.0, 0.0, -search.u, False)
    # a set that is flat has no hull, and no ball round 0
    thin = np.linalg.svd(search.forces - search.forces.mean(axis=0))[2][-1]
    for u in (thin, -thin):
        search.look(u, begin)
    flat = np.linalg.svd(search.forces - search.forces.mean(axis=0))[1][-1] <= ROUNDING_FORCE
    lower = 0.0 if flat or search.upper <= ROUNDING_FORCE else search.refine()
    force = min(lower, search.upper) if lower > ROUNDING_FORCE else 0.0
    return Payload(force, max(search.upper, 0.0), -search.u, search.upper >= -ROUNDING_FORCE)


class _Section:
    """Points of W without a part along ``rows (m, 6)``: those that directions have found, and the least support.

    ``upper`` is that support, along ``u``; ``begin (m + 1, 8)``: basis that fulfils the rows with the least that no
    point takes.
    """

    def __init__(self, grasp: _Grasp, rows: FloatArray) -> None:
        self.grasp, self.rows, m = grasp, rows, len(rows) + 1
        self.begin = np.zeros((m, 8))
        # every row but the last, which counts the points, begins with a column of its own
        self.begin[:, 7] = np.arange(1, m + 1)
        first, _ = _farthest(*grasp, np.ones(6))
        self.begin[-1, :6], self.begin[-1, 6:] = first, (1.0, 0.0)
        off = TORQUE_OFFSET * np.sqrt(np.arange(2.0, m + 1)) - rows @ first
        self.begin[:-1, 6] = np.where(off < 0, -1.0, 1.0)
        self.points: list[FloatArray] = []
        self.bases: list[FloatArray] = []
        self.upper, self.u = np.inf, np.zeros(3)

    @property
    def forces(self) -> FloatArray:
        """Forces ``(n, 3)`` of the points."""
        return np.array(self.points)

    def farthest(self, along: FloatArray, basis: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Support of the section, the point ``(6,)`` that it touches and its basis; -inf where the section is empty."""
        new = basis.copy()
        upper, point, missing = _programme(*self.grasp, along, self.rows, new)
        return (upper if missing < ROUNDING_FORCE else -np.inf), point, new

    def look(self, u: FloatArray, start: FloatArray) -> FloatArray:
        """Add the point that is farthest in a direction; the basis it was found with."""
        support, point, basis = self.farthest(u, start)
        self.points.append(point[:3])
        self.bases.append(basis)
        if support < self.upper:
            self.upper, self.u = support, u
        return basis

    def refine(self) -> float:
        """Distance of the hull's nearest facet, after looking along all that are nearer than the least support."""
        n, hull = len(self.points), ConvexHull(self.forces)
        points, bases = np.zeros((MOST_POINTS, 3)), np.zeros((MOST_POINTS, *self.begin.shape))
        points[:n], bases[:n] = self.points, self.bases
        corners = hull.simplices.astype(np.int64)  # in no order round their facets
        inward = np.einsum("fi,fi->f", _planes(points, corners)[:, :3], hull.equations[:, :3]) < 0
        corners[inward] = corners[inward, ::-1]
        begun = points, bases, n, corners, hull.equations, self.upper, self.u
        lower, self.upper, self.u = _refined(*self.grasp, self.rows, *begun)
        return float(lower)


@njit(cache=True)
def _planes(points, corners):
    """Outward unit normal and offset ``(m, 4)`` of facets with these corners ``(m, 3)``."""
    p = points[corners[:, 0]]
    normal = np.cross(points[corners[:, 1]] - p, points[corners[:, 2]] - p)
    normal /= np.sqrt((normal**2).sum(axis=1)).reshape(-1, 1)
    return np.column_stack((normal, -(normal * p).sum(axis=1)))


@njit(cache=True)
def _joined(points, n, corners, planes):
    """Facets of a hull, their ``corners (m, 3)`` and ``planes (m, 4)``, with the ``n``-th of the points joined to it.

    The facets that see the point give way to those between it and their rim. Where it is beyond a facet by rounding
    alone that one stays: a facet so thin would have no normal.
    """
    keep, rim = np.ones(len(corners), np.bool_), np.zeros((n, n), np.bool_)
    for f in range(len(corners)):
        if planes[f, :3] @ points[n] + planes[f, 3] > ROUNDING_FORCE:
            keep[f] = False
            for k in range(3):
                rim[corners[f, k], corners[f, (k + 1) % 3]] = True
    edges = np.argwhere(rim & ~rim.T)
    new = np.column_stack((edges, np.full(len(edges), n)))
    return np.concatenate((corners[keep], new)), np.concatenate((planes[keep], _planes(points, new)))


@njit(cache=True)
def _refined(C, V1, V2, kind, rows, points, bases, count, corners, planes, upper, u):
    """Distance of the nearest facet, and the least support and its direction, as `_Section.refine` finds them.

    ``count`` of the ``points, bases`` are known; ``corners, planes`` are the facets of their hull.
    """
    before = np.zeros(4)
    while True:
        nearest = planes[:, 3].argmax()
        plane = planes[nearest]
        # a point that the hull has already ends the search: along its nearest facet both bounds are the same
        known = (plane == before).all() or count == len(points)
        if known or upper < ROUNDING_FORCE or -plane[3] >= upper * (1.0 - BOUND_GAP):
            return -plane[3], upper, u
        before, bases[count] = plane, bases[corners[nearest, 0]]
        support, point, missing = _programme(C, V1, V2, kind, plane[:3], rows, bases[count])
        points[count] = point[:3]
        # a programme that did not fill its rows says nothing of the support
        if missing < ROUNDING_FORCE and support < upper:
            upper, u = support, plane[:3]
        corners, planes = _joined(points, count, corners, planes)
        count += 1


@njit(cache=True)
def _touching(C, V, q, out):
    """Support of ``P + B`` along ``q (6,)``; its point goes into ``out (6,)``."""
    t = C.T @ q
    best, at = -np.inf, 0
    for k in range(V.shape[1]):
        h = V[0, k] * t[1] + V[1, k] * t[2] + V[2, k] * t[3]
        if h > best:
            best, at = h, k
    for i in range(6):
        out[i] = C[i, 0] + C[i, 1] * V[0, at] + C[i, 2] * V[1, at] + C[i, 3] * V[2, at]
    return t[0] + best


@njit(cache=True)
def _farthest(C, V1, V2, kind, q):
    """Point ``(6,)`` of W that is farthest along ``q``, and how far."""
    w1, w2 = np.empty(6), np.empty(6)
    h1, h2 = _touching(C[0], V1, q, w1), _touching(C[1], V2, q, w2)
    if kind == 0:
        return (2.0 * w1, 2.0 * h1) if h1 >= h2 else (2.0 * w2, 2.0 * h2)
    if kind == 1:
        return w1 * (h1 > 0.0) + w2 * (h2 > 0.0), max(h1, 0.0) + max(h2, 0.0)
    return w1 + w2, h1 + h2


@njit(cache=True)
def _programme(C, V1, V2, kind, along, rows, basis):
    """Largest ``along (3,)`` times the force of points x of W with ``rows . x = off``, by the revised simplex method.

    ``basis (m, 8)`` is where it begins and ends: points ``(6,)``, then 1 and 0; or 0, a sign and the number of the row,
    from 1, for a column that only fills a row. Returns a proved upper bound, the point reached, and what is filled.
    """
    m = len(basis)
    B, cost, right = np.zeros((m, m)), np.zeros(m), np.ones(m)
    for i in range(m - 1):
        right[i] = TORQUE_OFFSET * np.sqrt(i + 2.0)
    for k in range(m):
        if basis[k, 7] > 0:
            B[int(basis[k, 7]) - 1, k], cost[k] = basis[k, 6], -1e5  # a penalty on torques that no point takes
        else:
            B[: m - 1, k] = rows @ basis[k, :6]
            B[m - 1, k], cost[k] = 1.0, along @ basis[k, :3]
    inverse = np.linalg.inv(B)
    x = inverse @ right
    upper, column = np.inf, np.ones(m)
    for _ in range(400):
        y = cost @ inverse
        q = -(y[: m - 1] @ rows)
        q[:3] += along
        point, support = _farthest(C, V1, V2, kind, q)
        bound = support + y[: m - 1] @ right[: m - 1]
        upper = min(upper, bound)
        if bound - cost @ x <= 1e-9 * (1.0 + abs(bound)):
            break
        column[: m - 1] = rows @ point
        d = inverse @ column
        out, most = -1, np.inf
        for k in range(m):
            if d[k] > 1e-11 and max(x[k], 0.0) < most * d[k]:
                out, most = k, max(x[k], 0.0) / d[k]
        if out < 0:
            break
        basis[out, :6], basis[out, 6], basis[out, 7], cost[out] = point, 1.0, 0.0, along @ point[:3]
        inverse[out] /= d[out]
        for k in range(m):
            if k != out:
                inverse[k] -= d[k] * inverse[out]
        x = inverse @ right
    point, missing = np.zeros(6), 0.0
    for k in range(m):
        point += x[k] * basis[k, :6]
        missing += abs(x[k]) * (basis[k, 7] > 0)
    return upper, point, missing
