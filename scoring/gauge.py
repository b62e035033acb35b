"""How far the grasp wrench space of ellipsoidal contacts reaches along a wrench, with the direction that stops it.

A contact with the wrench map ``c, D`` (wrench of its normal force; root of its limit surface times its other columns)
carries ``lam c + D^T f`` with ``|f| <= lam``. The reach along ``w`` is a pair of convex programmes of one value,

    max s:  s w = sum_i lam_i c_i + D_i^T f_i      =      min sum_i s_i:  u . w = 1,  s_i >= c_i . u + |D_i u|,

with ``0 <= lam_i <= 1`` and ``s_i >= 0`` (L-infinity), or ``sum_i lam_i <= 1`` and one common ``s`` (L1).
`cone_programme` solves the pair for many wrenches at once. Both sides are then evaluated as they stand, so the bounds
hold however well it converged.

The programmes are solved by a primal-dual interior-point method over products of Lorentz cones, with Nesterov and
Todd's scaling and Mehrotra's corrector; L. Vandenberghe, "The CVXOPT linear and quadratic cone program solvers" (2010),
gives the formulas. Every cone is ``y_0 >= |(y_1, y_2, y_3)|``; with ``y_0`` alone it is a half-line.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.scoring.bodies import joined

FloatArray = NDArray[np.float64]


class Bounds(NamedTuple):
    """Bounds of numbers that are found by search, and the unit wrenches or directions that give the upper ones."""

    lower: Any  # number or (m,)
    upper: Any
    u: FloatArray  # (6,) or (m, r)


def contact_support(c: FloatArray, D: FloatArray, u: FloatArray) -> FloatArray:
    """``c_i . u + |D_i u|`` for each direction and contact, ``(m, n)``."""
    return u @ c.T + np.linalg.norm(np.einsum("iad,md->mia", D, u), axis=2)


def gauge(c: FloatArray, D: FloatArray, w: FloatArray, kind: str = "linf", tolerance: float = 1e-10) -> Bounds:
    """Largest ``s`` with ``s w`` in the grasp wrench space, between two bounds.

    Parameters
    ----------
    c, D : (n, r), (n, 3, r) array
        Contacts; together they must span the ``r`` dimensions.
    w : (m, r) array
        Wrenches, none of them 0.
    kind : str
        "linf" or "l1".
    tolerance : float
        Gap at which the programmes stop, relative to the value and to the contacts' supports for ``w / |w|^2``.
    """
    u, z = _facing(c, D, w, kind, tolerance)
    upper = joined(contact_support(c, D, u).T, kind)
    # stationarity reads w ~ sum z_0 c - D' z_1: the multipliers are the loads, friction with the other sign
    lower = _reach(c, D, w, z * [1, -1, -1, -1], kind)
    # rounding may put the lower bound above the upper one where both are the same
    return Bounds(np.minimum(lower, upper), upper, u)


def _facing(
    c: FloatArray, D: FloatArray, w: FloatArray, kind: str, tolerance: float
) -> tuple[FloatArray, FloatArray]:
    """Normals ``u (m, r)``, ``u . w = 1``, where rays along ``w`` leave the space, and multipliers ``(m, n, 4)``."""
    n, r = c.shape
    k = 1 if kind == "l1" else n
    # (u, s) -> (s_i - c_i u, D_i u), then s_i >= 0
    L = np.zeros((n + k, 4, r + k))
    L[:n, 0, :r], L[:n, 1:, :r] = -c, D
    L[np.arange(n), 0, r + np.arange(n) % k] = 1
    L[n + np.arange(k), 0, r + np.arange(k)] = 1
    u0 = w / (w * w).sum(axis=1, keepdims=True)
    h = contact_support(c, D, u0)
    # room for the start inside all cones, also where the supports themselves are nearly 0
    size = np.abs(h).max(axis=1, keepdims=True) + np.linalg.norm(D, axis=(1, 2)).max() * 1e-3
    s = np.maximum(h, 0)
    v0 = np.hstack([u0, (s.max(axis=1, keepdims=True) if kind == "l1" else s) + size])
    B = np.zeros((len(w), r + k, r - 1 + k))  # steps that keep u . w = 1
    # steps in units of |u0| keep the unknowns of one size, whatever the length of w
    B[:, :r, : r - 1] = _across(w) * np.linalg.norm(u0, axis=1)[:, None, None]
    B[:, r:, r - 1 :] = np.eye(k)
    cost = np.concatenate([np.zeros(r - 1), np.ones(k)])
    G, inside = -np.einsum("iad,mde->miae", L, B), np.einsum("iad,md->mia", L, v0)
    x, z = cone_programme(cost, G, inside, tolerance * size[:, 0])
    u = u0 + np.einsum("mde,me->md", B, x)[:, :r]
    # u is an upper bound only with u . w = 1, which rounding has moved
    return u / (u * w).sum(axis=1, keepdims=True), z[:, :n]


def _reach(c: FloatArray, D: FloatArray, w: FloatArray, x: FloatArray, kind: str) -> FloatArray:
    """Reach along ``w`` of the loads ``x = (lam, f)``, ``(m, n, 4)``, once they are made to be in their cones."""
    lam, f = x[..., :1], x[..., 1:]
    # loads are pulled back into their cones, so that the bound holds however far the programme came
    lam = np.maximum(lam, 0)
    length = np.linalg.norm(f, axis=2, keepdims=True)
    f = f * np.minimum(1, lam / np.maximum(length, 1e-300))
    wrench = np.einsum("mi,ir->mr", lam[..., 0], c) + np.einsum("mia,iar->mr", f, D)
    s = (wrench * w).sum(axis=1) / (w * w).sum(axis=1)
    missing = np.linalg.norm(wrench - s[:, None] * w, axis=1)
    size = (lam[..., 0] * (np.linalg.norm(c, axis=1) + np.linalg.norm(D, axis=(1, 2)))).sum(axis=1)
    # forces beyond their limit shrink together, which keeps their wrench along w
    total = {"linf": lam.max(axis=(1, 2)), "l1": lam.sum(axis=(1, 2))}[kind]
    # loads off the line of w prove only s = 0, where none are needed
    return np.where(missing <= 1e-10 * size, s / np.maximum(total, 1), 0.0)


def _across(w: FloatArray) -> FloatArray:
    """Orthonormal columns across each wrench, ``(m, r, r - 1)``, by a reflection that turns it to the first axis."""
    a = w / np.linalg.norm(w, axis=1, keepdims=True)
    # the sign that adds: the difference would cancel where w is near the first axis
    a[:, 0] += np.copysign(1, a[:, 0])
    reflection = np.eye(w.shape[1]) - 2 * a[:, :, None] * a[:, None, :] / (a * a).sum(axis=1)[:, None, None]
    return reflection[:, :, 1:]


LORENTZ = np.array([1.0, -1.0, -1.0, -1.0])


def cone_programme(
    cost: FloatArray, G: FloatArray, h: FloatArray, tolerance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Minimisers ``x`` of ``cost . x`` with ``h - G x`` in the cones, and the multipliers ``z``.

    Parameters
    ----------
    cost : (d,) array
        Costs, the same for all programmes.
    G, h : (m, n, 4, d), (m, n, 4) array
        ``m`` programmes with ``n`` cones; ``x = 0`` must lie inside.
    tolerance : (m,) array
        Gaps at which to stop.

    Returns
    -------
    (m, d) array, (m, n, 4) array
        Where a programme does not converge, the last step: bounds have to be taken from what comes back.
    """
    m, n, _, d = G.shape
    x, y = np.zeros((m, d)), h.copy()
    z = np.zeros_like(h)
    # multipliers start on the axes of their cones, far from the boundary
    z[..., 0] = np.abs(cost).sum() / n
    active = np.arange(m)
    for _ in range(60):
        gap = (y[active] * z[active]).sum(axis=(1, 2))
        off = np.abs(cost + np.einsum("miad,mia->md", G[active], z[active])).max(axis=1)
        far = np.abs(x[active]).max(axis=1) > 1e5  # minimisers at infinity
        # programmes that are done drop out, or all would go on with the slowest
        active = active[((gap > tolerance[active]) | (off > 1e-10)) & ~far]
        if not len(active):
            break
        a = active
        step = _step(cost, G[a], h[a] - np.einsum("miad,md->mia", G[a], x[a]) - y[a], y[a], z[a])
        # where a step fails the last good iterate stays
        active = active[step[3]]
        for old, new in zip((x, y, z), step[:3], strict=True):
            old[active] += new[step[3]]
    return x, z


def _step(
    cost: FloatArray, G: FloatArray, missing: FloatArray, y: FloatArray, z: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Steps of x, y and z, and which programmes they are good for."""
    # some programmes of a stack may break down; `good` sorts them out below
    with np.errstate(all="ignore"):
        v, beta = _scaling(y, z)
        lam = _apply(v, beta, z)
        scaled = _apply_inverse(v[..., None, :], beta[..., None], np.swapaxes(G, 2, 3)).swapaxes(2, 3)
        m, n = y.shape[:2]
        good = np.isfinite(scaled).all(axis=(1, 2, 3))
        # orthogonal columns keep the digits that the normal equations would lose near the end
        Q, R = np.linalg.qr(np.where(good[:, None, None], scaled.reshape(m, 4 * n, -1), np.eye(4 * n, len(cost))))
        good &= np.abs(np.einsum("mdd->md", R)).min(axis=1) > 0
        # one singular factor would stop the solution of the whole stack
        R[~good] = np.eye(len(cost))
        Q = Q.reshape(m, n, 4, -1)
        off = -(cost + np.einsum("miad,mia->md", G, z))
        missing = _apply_inverse(v, beta, missing)

        first = np.linalg.solve(R.swapaxes(1, 2), off[..., None])[..., 0]

        def solve(q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            right = first - np.einsum("miad,mia->md", Q, q - missing)
            dz = np.einsum("miad,md->mia", Q, right) + q - missing
            return np.linalg.solve(R, right[..., None])[..., 0], q - dz, dz

        # Mehrotra: how far the plain step gets tells how much to centre
        dx, dy, dz = solve(-lam)
        alpha = np.minimum(1, _longest(lam, dy, dz))
        mu = (lam * lam).sum(axis=(1, 2)) / n
        centre = (1 - alpha) ** 3 * mu
        # the product of the plain steps is what the linear equations leave out
        right = -_product(lam, lam) - _product(dy, dz)
        right[..., 0] += centre[:, None]
        dx, dy, dz = solve(_quotient(lam, right))
        # short of the boundary, where the scaling has no inverse
        alpha = np.minimum(1, 0.99 * _longest(lam, dy, dz))[:, None, None]
        change = alpha[..., 0] * dx, alpha * _apply(v, beta, dy), alpha * _apply_inverse(v, beta, dz)
        good &= np.isfinite(change[0]).all(axis=1) & np.isfinite(change[2]).all(axis=(1, 2)) & (alpha[:, 0, 0] > 1e-9)
        # rounding may carry a bounded step out of the cones all the same
        good &= _inside(y + change[1]) & _inside(z + change[2])
    return *change, good


def _scaling(y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``v`` and ``beta`` of the scaling ``W = beta (2 v v^T - J)`` with ``W z = W^-1 y``."""
    sizes = [np.sqrt((a * a) @ LORENTZ) for a in (y, z)]
    y, z = (a / size[..., None] for a, size in zip((y, z), sizes, strict=True))
    w = (y + LORENTZ * z) / np.sqrt(2 * (1 + (y * z).sum(axis=2)))[..., None]
    w[..., 0] += 1
    return w / np.sqrt(2 * w[..., :1]), np.sqrt(sizes[0] / sizes[1])[..., None]


def _apply(v: FloatArray, beta: FloatArray, a: FloatArray) -> FloatArray:
    return beta * (2 * (v * a).sum(axis=-1, keepdims=True) * v - LORENTZ * a)


def _apply_inverse(v: FloatArray, beta: FloatArray, a: FloatArray) -> FloatArray:
    v = LORENTZ * v
    return (2 * (v * a).sum(axis=-1, keepdims=True) * v - LORENTZ * a) / beta


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Jordan product of the cone's algebra."""
    c = a[..., :1] * b + b[..., :1] * a
    c[..., 0] = (a * b).sum(axis=-1)
    return c


def _quotient(a: FloatArray, b: FloatArray) -> FloatArray:
    """The ``x`` whose product with ``a`` is ``b``."""
    first = (b * LORENTZ * a).sum(axis=-1, keepdims=True) / ((a * a) @ LORENTZ)[..., None]
    x = (b - first * a) / a[..., :1]
    x[..., :1] = first
    return x


def _longest(lam: FloatArray, *steps: FloatArray) -> FloatArray:
    """Longest step from ``lam`` that stays in all cones, ``(m,)``."""
    size = np.sqrt((lam * lam) @ LORENTZ)[..., None]
    unit = lam / size
    outward = []
    for d in steps:
        # a Lorentz boost takes lam to the axis of the cone, where the way to the boundary is plain
        along = (unit * LORENTZ * d).sum(axis=2, keepdims=True)
        across = d[..., 1:] - (along + d[..., :1]) / (unit[..., :1] + 1) * unit[..., 1:]
        outward.append((np.linalg.norm(across, axis=2) - along[..., 0]) / size[..., 0])
    # a step that never leaves the cones has no longest length
    return 1 / np.maximum(np.max(outward, axis=(0, 2)), 1e-12)


def _inside(y: FloatArray) -> NDArray[np.bool_]:
    return ((y[..., 0] > 0) & ((y * y) @ LORENTZ > 0)).all(axis=1)
