"""How much a gripper holds: the largest force at the centre of mass that both contacts bear in every direction.

The drive of a parallel gripper keeps the sum of the forces along its closing axis. A load along that axis shifts force
from one finger to the other, ``F + s`` and ``F - s``, and the friction of each contact follows its normal force. With
``P_i`` the wrench of finger i's pressure at the force ``F`` and ``B_i`` its limit surface there, the grasp answers with

    W = 2 conv(A_1, A_2)                              ("shared", the default),
    W = conv(0, A_1) + conv(0, A_2)                   ("up_to": each finger gives way down to nothing),
    W = A_1 + A_2                                     ("fixed": each keeps its force),

    A_i = {F w / (d_i . f(w)) : w in P_i + B_i}       f: the force of a wrench, d_i: in which the drive presses.

Where a contact leans, its friction bears a part of the drive, or adds to it, and the pressure becomes less or more: a
wedge that is pulled out at its thin end is pressed less. The map to ``A_i`` takes lines to lines, so points of the
limit surface are all that is needed.

The squeeze comes first: two forces that do not face each other make a couple, and unless 0 lies in W the grasp does not
hold even itself. The forces without a torque about the centre of mass in W are a convex set ``K`` in space, and what
is held in every direction is the radius of the largest ball round 0 in it.

One direction of ``K`` is a linear programme with four rows, whose columns, points of the limit surfaces, are looked for
where its multipliers ask (column generation): among those that are known, and where these have none, among all. The
points that several directions give span a polytope inside ``K``; the normals of its nearest facets are the next
directions. Its nearest facet bounds the radius from below, the support of ``K`` from above, for any direction, so that
the answer knows its error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, QhullError

from softjaw.scoring.contact import Body, FloatArray, IntArray, SoftContact, discs_of, vertices_of

KINDS = ("shared", "up_to", "fixed")
BOUND_GAP = 1e-3  # of the bounds, relative, at which the search ends by default
ROUNDING_FORCE = 1e-7  # of the forces of the grasp, below which a force is rounding
MOST_PRESSED = 2.0  # times the pressure of the grasp that a load may make; beyond it the contact would be another one
MOST_COLUMNS = 2000  # that are kept of a limit surface
NEAR = 4e-4  # relative, to which a programme over all points of sums of discs is solved
MOST_POINTS = 400  # of the section, after which the search ends with the bounds that it has
TORQUE_OFFSET = 1e-11  # torque at which K is taken, so that no two bases of the programme are alike


class Payload(NamedTuple):
    """Largest force that is held.

    ``force`` is that of a load at the centre of mass, as proved, 0 where the squeeze itself is not borne, ``upper``
    what it is at most [N], ``direction (3,)`` in which the load pulls then. ``borne`` says whether friction bears the
    squeeze itself; at the limit, and without friction, it does not.
    """

    force: float
    upper: float
    direction: FloatArray
    borne: bool


class Facets(ConvexHull):
    """A hull that knows its facets alone; volume and extent are half of the price of a point that is added."""

    def _update(self, qhull: Any) -> None:
        qhull.triangulate()
        self.simplices, _, self.equations, *_ = qhull.get_simplex_facet_array()


def payload(
    contacts: Sequence[SoftContact],
    pressure: ArrayLike,
    centre_of_mass: ArrayLike,
    direction: ArrayLike | None = None,
    kind: str = "shared",
    drive: ArrayLike | None = None,
    gap: float = BOUND_GAP,
    least: float = 0.0,
) -> Payload:
    """Largest force at the centre of mass that two contacts hold, along ``direction`` or the worst of all.

    ``contacts``: two, with sums of discs or polytopes as limit surfaces, at the solved forces [N, N, N m];
    ``pressure (2, 6)``: wrench of each finger's pressure on the object, torques about the origin [N, N m];
    ``centre_of_mass (3,)``: where the load acts [m]; ``direction (3,)``: in which it pulls, of any length; ``kind``:
    what happens to the normal forces, of `KINDS`; ``drive (2, 3)``: force with which the gripper presses each
    finger [N], by default that of its pressure. The search ends at a relative ``gap`` of the bounds, or below the force
    ``least`` [N], however far apart they are.
    """
    centre, P = np.asarray(centre_of_mass, float), np.asarray(pressure, float)
    length = max(float(np.linalg.norm(c.position - centre)) for c in contacts) or 1.0
    C = np.array([c.wrench_map(length, length, centre) for c in contacts])
    C[:, :3, 0], C[:, 3:, 0] = P[:, :3], (P[:, 3:] - np.cross(centre, P[:, :3])) / length
    size = float(np.linalg.norm(P[:, :3], axis=1).sum())
    C[:, :, 0] /= size
    pressed = (P[:, :3] if drive is None else np.asarray(drive, float)) / size
    drives = [p @ c[:3] / (p @ p) for p, c in zip(pressed, C, strict=True)]
    first, other = (_surface(contact.body, size, d) for contact, d in zip(contacts, drives, strict=True))
    grasp = C, first, other, KINDS.index(kind)
    answer = _along(grasp, np.asarray(direction, float)) if direction is not None else _worst(grasp, gap, least / size)
    return Payload(size * answer.force, size * answer.upper, answer.direction, answer.borne)


def _surface(body: Body, size: float, drive: FloatArray) -> _Surface:
    """Limit surface of a contact in units of a force; ``drive (4,)`` weighs what its points add to the drive."""
    D, V = discs_of(body), vertices_of(body)
    D = np.zeros((0, 6)) if D is None else np.ascontiguousarray(D / size)
    columns, count = np.empty((4, MOST_COLUMNS if V is None else len(V))), np.zeros(1, np.int64)
    if V is not None:
        columns[0], columns[1:], count[0] = 1.0, V.T / size, len(V)
        columns /= np.maximum(drive @ columns, 1.0 / MOST_PRESSED)
    return columns, count, D, drive


# columns (4, k) of which C makes points of A, how many are known, discs (n, 6), and what points add to the drive (4,)
_Surface = tuple[FloatArray, IntArray, FloatArray, FloatArray]
# both contacts, forces in units of that of the grasp: C (2, 6, 4), the surface of each, and the kind
_Grasp = tuple[FloatArray, _Surface, _Surface, int]


def _along(grasp: _Grasp, d: FloatArray) -> Payload:
    """Largest load along one direction, of any length."""
    d = d / np.linalg.norm(d)
    # the answer has no part across the load: two more rows
    across = np.linalg.svd(d[None])[2][1:]
    rows = np.zeros((5, 6))
    rows[:3, 3:], rows[3:, :3] = np.eye(3), across
    basis = _begin(grasp, rows)
    most, point, missing = _programme(*grasp, -d, rows, basis)
    other, _, also = _programme(*grasp, d, rows, basis)  # a load of more than -other is needed: none where that is < 0
    if max(missing, also) >= ROUNDING_FORCE or min(most, other) < -ROUNDING_FORCE:
        return Payload(0.0, 0.0, d, False)
    lower, upper = (load if load > ROUNDING_FORCE else 0.0 for load in (float(-d @ point[:3]), most))
    return Payload(lower, upper, d, True)


def _worst(grasp: _Grasp, gap: float, least: float) -> Payload:
    """Largest load in every direction, and one in which a larger one is lost."""
    rows = np.hstack([np.zeros((3, 3)), np.eye(3)])
    points, bases = np.zeros((MOST_POINTS, 3)), np.zeros((MOST_POINTS, 4, 8))
    axes = np.vstack([np.eye(3), -np.eye(3)])
    search = *grasp, rows, points, bases
    upper, u = _looked(*search, axes, _begin(grasp, rows), 0, -np.inf, np.inf, axes[0])
    if upper < -ROUNDING_FORCE:
        return Payload(0.0, 0.0, -u, False)
    # a set that is flat has no hull, and no ball round 0
    thin = np.linalg.svd(points[:6] - points[:6].mean(axis=0), full_matrices=False)[2][-1]
    upper, u = _looked(*search, np.stack([thin, -thin]), bases[5], 6, -np.inf, upper, u)
    extent = np.linalg.svd(points[:8] - points[:8].mean(axis=0), compute_uv=False)
    lower, least = 0.0, max(least, ROUNDING_FORCE)
    if extent[-1] > ROUNDING_FORCE and upper > least:
        hull, before = Facets(points[:8], incremental=True), np.zeros(4)
        for n in range(8, MOST_POINTS):
            nearest = hull.equations[:, 3].argmax()
            plane = hull.equations[nearest].copy()
            lower = -plane[3]
            # a point that the hull has already ends the search: along its nearest facet both bounds are the same
            if (plane == before).all() or upper < least or lower >= upper * (1.0 - gap):
                break
            # a programme that did not fill its rows says nothing of the support
            before, basis = plane, bases[hull.simplices[nearest, 0]]
            upper, u = _looked(*search, plane[None, :3], basis, n, np.inf, upper, u)
            try:
                hull.add_points(points[n : n + 1])
            except QhullError:  # of points in the planes of its facets
                hull = Facets(points[: n + 1], incremental=True)
    force = min(lower, upper) if lower > ROUNDING_FORCE else 0.0
    return Payload(force, max(upper, 0.0), -u, upper >= -ROUNDING_FORCE)


def _begin(grasp: _Grasp, rows: FloatArray) -> FloatArray:
    """Basis ``(m + 1, 8)`` of `_programme` that fulfils ``rows (m, 6)`` with the least that no point of W takes."""
    m, point = len(rows) + 1, np.empty(6)
    _farthest(*grasp, np.ones(6), True, point)
    basis = np.zeros((m, 8))
    # every row but the last, which counts the points, begins with a column of its own
    basis[:, 7] = np.arange(1, m + 1)
    basis[-1, :6], basis[-1, 6:] = point, (1.0, 0.0)
    basis[:-1, 6] = np.where(TORQUE_OFFSET * np.sqrt(np.arange(2.0, m + 1)) < rows @ point, -1.0, 1.0)
    return basis


@njit(cache=True)
def _looked(C, A1, A2, kind, rows, points, bases, directions, basis, n, empty, upper, u):
    """Fill in ``points`` and ``bases`` from the ``n``-th on, which are farthest in directions, without a part in rows.

    Each programme begins where the one before ended, the first at ``basis``. Returns the least support and its
    direction, so far ``upper, u``; ``empty`` is that of a programme that did not fill its rows.
    """
    for k in range(len(directions)):
        bases[n] = basis
        support, point, missing = _programme(C, A1, A2, kind, directions[k], rows, bases[n])
        points[n], basis, n = point[:3], bases[n], n + 1
        support = support if missing < ROUNDING_FORCE else empty
        if support < upper:
            upper, u = support, directions[k]
        if upper < -ROUNDING_FORCE:
            break
    return upper, u


@njit(cache=True)
def _times(A, x, out):
    """``out = A x``; BLAS takes longer to call than these few products take."""
    for i in range(A.shape[0]):
        out[i] = 0.0
        for k in range(A.shape[1]):
            out[i] += A[i, k] * x[k]


@njit(cache=True)
def _touching(C, A, q, exact, t, out):
    """Support of ``A`` along ``q (6,)`` over known points or all; its point goes into ``out``, and ``t`` is room."""
    V, count, D, drive = A
    _times(C.T, q, t)
    best, at = -np.inf, -1
    for k in range(count[0]):
        h = V[0, k] * t[0] + V[1, k] * t[1] + V[2, k] * t[2] + V[3, k] * t[3]
        if h > best:
            best, at = h, k
    if len(D) and (exact or at < 0):
        point, h = np.empty(4), max(best, 0.0)
        # the farthest point of a quotient, by Dinkelbach's method, which converges quadratically
        for _ in range(6):
            x, y, z = t[1] - h * drive[1], t[2] - h * drive[2], t[3] - h * drive[3]
            point[:] = 1.0, 0.0, 0.0, 0.0
            for i in range(len(D)):
                a, b = D[i, 0] * x + D[i, 1] * y + D[i, 2] * z, D[i, 3] * x + D[i, 4] * y + D[i, 5] * z
                size = np.sqrt(a * a + b * b)
                if size > 0.0:
                    a, b = a / size, b / size
                    for c in range(3):
                        point[1 + c] += a * D[i, c] + b * D[i, 3 + c]
            point /= max(drive @ point, 1.0 / MOST_PRESSED)
            before, h = h, point @ t
            if abs(h - before) <= 1e-9 * abs(h):
                break
        if h > best:
            best, at = h, min(count[0], V.shape[1] - 1)
            V[:, at], count[0] = point, at + 1
    _times(C, V[:, at], out)
    return best


@njit(cache=True)
def _farthest(C, A1, A2, kind, q, exact, point):
    """How far W goes along ``q``, over the points that are known or all; the farthest ``point (6,)`` is filled in."""
    w1, w2, t = np.empty(6), np.empty(6), np.empty(4)
    h1, h2 = _touching(C[0], A1, q, exact, t, w1), _touching(C[1], A2, q, exact, t, w2)
    a, b = 1.0, 1.0
    if kind == 0:
        a, b = (2.0, 0.0) if h1 >= h2 else (0.0, 2.0)
    elif kind == 1:
        a, b = 1.0 * (h1 > 0.0), 1.0 * (h2 > 0.0)
    point[:] = a * w1 + b * w2
    return a * h1 + b * h2


@njit(cache=True)
def _programme(C, A1, A2, kind, along, rows, basis):
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
            _times(rows, basis[k, :6], B[: m - 1, k])
            B[m - 1, k], cost[k] = 1.0, along @ basis[k, :3]
    inverse = np.linalg.inv(B)
    x, y, d, q, point = np.empty(m), np.empty(m), np.empty(m), np.empty(6), np.empty(6)
    upper, column, near = np.inf, np.ones(m), NEAR if len(A1[2]) + len(A2[2]) else 1e-9
    _times(inverse, right, x)
    for _ in range(400):
        _times(inverse.T, cost, y)
        _times(rows.T, y, q)
        q[:] = -q
        q[:3] += along
        offset, value = y[: m - 1] @ right[: m - 1], cost @ x
        for exact in (False, True):  # the points that are known, and where they have none, all
            bound = _farthest(C, A1, A2, kind, q, exact, point) + offset
            upper = min(upper, bound) if exact else upper
            reached = bound - value <= near * abs(bound) + 1e-9
            if not reached:
                break
        if reached:
            break
        _times(rows, point, column)
        _times(inverse, column, d)
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
        _times(inverse, right, x)
    point, missing = np.zeros(6), 0.0
    for k in range(m):
        point += x[k] * basis[k, :6]
        missing += abs(x[k]) * (basis[k, 7] > 0)
    return upper, point, missing
