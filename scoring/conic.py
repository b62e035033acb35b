"""Small programmes over products of Lorentz cones, many at once, by a primal-dual interior-point method.

Nesterov and Todd's scaling with Mehrotra's corrector; L. Vandenberghe, "The CVXOPT linear and quadratic cone program
solvers" (2010), gives the formulas used here. Every cone is ``y_0 >= |(y_1, y_2, y_3)|``; with ``y_0`` alone it is a
half-line.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_J = np.array([1.0, -1.0, -1.0, -1.0])
_STEPS = 60
_FAR = 1e5  # a programme whose minimisers lie far away, or reach to infinity, ends there


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
    z[..., 0] = np.abs(cost).sum() / n
    active = np.arange(m)
    for _ in range(_STEPS):
        gap = (y[active] * z[active]).sum(axis=(1, 2))
        off = np.abs(cost + np.einsum("miad,mia->md", G[active], z[active])).max(axis=1)
        far = np.abs(x[active]).max(axis=1) > _FAR
        active = active[((gap > tolerance[active]) | (off > 1e-10)) & ~far]
        if not len(active):
            break
        a = active
        step = _step(cost, G[a], h[a] - np.einsum("miad,md->mia", G[a], x[a]) - y[a], y[a], z[a])
        active = active[step[3]]
        for old, new in zip((x, y, z), step[:3], strict=True):
            old[active] += new[step[3]]
    return x, z


def _step(
    cost: FloatArray, G: FloatArray, missing: FloatArray, y: FloatArray, z: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Steps of x, y and z, and which programmes they are good for."""
    with np.errstate(all="ignore"):
        v, beta = _scaling(y, z)
        lam = _apply(v, beta, z)
        scaled = _apply_inverse(v[..., None, :], beta[..., None], np.swapaxes(G, 2, 3)).swapaxes(2, 3)
        m, n = y.shape[:2]
        good = np.isfinite(scaled).all(axis=(1, 2, 3))
        # orthogonal columns keep the digits that the normal equations would lose near the end
        Q, R = np.linalg.qr(np.where(good[:, None, None], scaled.reshape(m, 4 * n, -1), np.eye(4 * n, len(cost))))
        good &= np.abs(np.einsum("mdd->md", R)).min(axis=1) > 0
        R[~good] = np.eye(len(cost))
        Q = Q.reshape(m, n, 4, -1)
        off = -(cost + np.einsum("miad,mia->md", G, z))
        missing = _apply_inverse(v, beta, missing)

        first = np.linalg.solve(R.swapaxes(1, 2), off[..., None])[..., 0]

        def solve(q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            right = first - np.einsum("miad,mia->md", Q, q - missing)
            dz = np.einsum("miad,md->mia", Q, right) + q - missing
            return np.linalg.solve(R, right[..., None])[..., 0], q - dz, dz

        dx, dy, dz = solve(-lam)
        alpha = np.minimum(1, _longest(lam, dy, dz))
        mu = (lam * lam).sum(axis=(1, 2)) / n
        centre = (1 - alpha) ** 3 * mu
        right = -_product(lam, lam) - _product(dy, dz)
        right[..., 0] += centre[:, None]
        dx, dy, dz = solve(_quotient(lam, right))
        alpha = np.minimum(1, 0.99 * _longest(lam, dy, dz))[:, None, None]
        change = alpha[..., 0] * dx, alpha * _apply(v, beta, dy), alpha * _apply_inverse(v, beta, dz)
        good &= np.isfinite(change[0]).all(axis=1) & np.isfinite(change[2]).all(axis=(1, 2)) & (alpha[:, 0, 0] > 1e-9)
        good &= _inside(y + change[1]) & _inside(z + change[2])
    return *change, good


def _scaling(y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``v`` and ``beta`` of the scaling ``W = beta (2 v v^T - J)`` with ``W z = W^-1 y``."""
    sizes = [np.sqrt((a * a) @ _J) for a in (y, z)]
    y, z = (a / size[..., None] for a, size in zip((y, z), sizes, strict=True))
    w = (y + _J * z) / np.sqrt(2 * (1 + (y * z).sum(axis=2)))[..., None]
    w[..., 0] += 1
    return w / np.sqrt(2 * w[..., :1]), np.sqrt(sizes[0] / sizes[1])[..., None]


def _apply(v: FloatArray, beta: FloatArray, a: FloatArray) -> FloatArray:
    return beta * (2 * (v * a).sum(axis=-1, keepdims=True) * v - _J * a)


def _apply_inverse(v: FloatArray, beta: FloatArray, a: FloatArray) -> FloatArray:
    v = _J * v
    return (2 * (v * a).sum(axis=-1, keepdims=True) * v - _J * a) / beta


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Jordan product of the cone's algebra."""
    c = a[..., :1] * b + b[..., :1] * a
    c[..., 0] = (a * b).sum(axis=-1)
    return c


def _quotient(a: FloatArray, b: FloatArray) -> FloatArray:
    """The ``x`` whose product with ``a`` is ``b``."""
    first = (b * _J * a).sum(axis=-1, keepdims=True) / ((a * a) @ _J)[..., None]
    x = (b - first * a) / a[..., :1]
    x[..., :1] = first
    return x


def _longest(lam: FloatArray, *steps: FloatArray) -> FloatArray:
    """Longest step from ``lam`` that stays in all cones, ``(m,)``."""
    size = np.sqrt((lam * lam) @ _J)[..., None]
    unit = lam / size
    outward = []
    for d in steps:
        along = (unit * _J * d).sum(axis=2, keepdims=True)
        across = d[..., 1:] - (along + d[..., :1]) / (unit[..., :1] + 1) * unit[..., 1:]
        outward.append((np.linalg.norm(across, axis=2) - along[..., 0]) / size[..., 0])
    return 1 / np.maximum(np.max(outward, axis=(0, 2)), 1e-12)


def _inside(y: FloatArray) -> NDArray[np.bool_]:
    return ((y[..., 0] > 0) & ((y * y) @ _J > 0)).all(axis=1)
