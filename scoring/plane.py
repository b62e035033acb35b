"""Convex figures of the plane, given by the outward normals of their sides, each as long as its side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def mixed_area(sides1: FloatArray, sides2: FloatArray) -> float:
    """Mixed area of two convex polygons, ``1/2 sum h_1(n) |n|`` over the sides n of the second.

    Parameters
    ----------
    sides1, sides2 : (m, 2) array
        Outward normals in any order, as long as their sides; each set sums to 0.
    """
    first, second = np.arctan2(sides1[:, 1], sides1[:, 0]), np.arctan2(sides2[:, 1], sides2[:, 0])
    order = np.argsort(first)
    n = sides1[order]
    corners = np.cumsum(np.column_stack([-n[:, 1], n[:, 0]]), axis=0)
    # The corner after the last side before the angle is the farthest point in that direction.
    corner = corners[np.searchsorted(first[order], second) - 1]
    return 0.5 * float((corner * sides2).sum())


def joint_pairs(normals1: FloatArray, normals2: FloatArray, direction: FloatArray) -> float:
    """Sum of ``|n_1 x n_2|`` over the pairs with the direction between ``-n_1`` and ``n_2``.

    Parameters
    ----------
    normals1, normals2 : (m, 2) array
        Vectors in any order.
    direction : (2,) array
        Not zero.
    """
    x, y = direction / np.linalg.norm(direction)
    turn = np.array([[x, -y], [y, x]])
    a, b = -normals1 @ turn, normals2 @ turn
    mirror = np.array([1.0, -1.0])
    return _pairs(a, b) + _pairs(a * mirror, b * mirror)


def _pairs(a: FloatArray, b: FloatArray) -> float:
    """Sum of ``a x b`` over pairs with a below the first axis, b above it, and less than a half turn between them."""
    a, b = a[a[:, 1] < 0], b[b[:, 1] > 0]
    angle = np.arctan2(b[:, 1], b[:, 0])
    order = np.argsort(angle)
    total = np.vstack([np.zeros(2), np.cumsum(b[order], axis=0)])
    reached = total[np.searchsorted(angle[order], np.arctan2(a[:, 1], a[:, 0]) + np.pi)]
    return float((a[:, 0] * reached[:, 1] - a[:, 1] * reached[:, 0]).sum())


def fan_area(support: FloatArray) -> float:
    """Area of the hull of a convex figure and 0.

    Parameters
    ----------
    support : (k,) array
        Support function of the figure at ``k`` equal steps of the full turn; negative where 0 lies outside.

    Notes
    -----
    The hull consists of the triangles between 0 and the sides that look away from it: ``1/2 int h (h + h'')`` over the
    directions with ``h > 0``. Trigonometric interpolation to 64 points per step leaves only the error of ``h`` itself.
    """
    k, fine = len(support), 64
    c = np.fft.rfft(support)
    order = np.arange(len(c))
    if k % 2 == 0:
        c[-1] *= 0.5
    h, bent = (np.fft.irfft(factor * c, fine * k) * fine for factor in (np.ones(len(c)), 1.0 - order**2))
    if (h >= 0).all():
        return 0.5 * float((h * bent).mean()) * 2 * np.pi
    return 0.5 * float((np.maximum(h, 0) * bent).mean()) * 2 * np.pi


def polygon_area(points: FloatArray) -> float:
    """Area of the hull of the points ``(k, 2)`` and 0; also of points on a line."""
    P = np.vstack([points, np.zeros((1, 2))])
    P = P[np.lexsort((P[:, 1], P[:, 0]))]
    lower, upper = _chain(P), _chain(P[::-1])
    x, y = np.array(lower[:-1] + upper[:-1]).T if len(lower) + len(upper) > 2 else np.zeros((2, 1))
    return 0.5 * abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))


def _chain(P: FloatArray) -> list[tuple[float, float]]:
    """Half of a hull, from the first point to the last of points in order (Andrew's monotone chain)."""
    chain: list[tuple[float, float]] = []
    for x, y in P.tolist():
        while len(chain) > 1:
            (ax, ay), (bx, by) = chain[-2:]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                break
            chain.pop()
        chain.append((x, y))
    return chain
