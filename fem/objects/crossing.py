"""Triangles of a mesh that cross each other: every pair whose boxes meet is tested, exactly up to rounding."""

from __future__ import annotations

import numpy as np
from numba import njit

from softjaw.fem.objects.gap import IntArray
from softjaw.fem.objects.pose import FloatArray

ROUNDED = 5e-7  # of the largest coordinate: corners this close to a plane are on it


@njit(cache=True)
def _side(a, b, c, d, noise):
    """Six times the volume of the tetrahedron (a, b, c, d), and a bound below which its sign is rounding."""
    u, v, w = b - a, c - a, d - a
    t_0 = w[0] * (u[1] * v[2] - u[2] * v[1])
    t_1 = w[1] * (u[2] * v[0] - u[0] * v[2])
    t_2 = w[2] * (u[0] * v[1] - u[1] * v[0])
    U, V, W = np.sqrt((u * u).sum()), np.sqrt((v * v).sum()), np.sqrt((w * w).sum())
    volume = t_0 + t_1 + t_2
    return 0 if abs(volume) <= noise * (U * V + V * W + W * U) else (1 if volume > 0 else -1)


@njit(cache=True)
def _pierces(p, q, a, b, c, noise):
    """Whether the segment from p to q crosses the inside of the triangle; touching does not count."""
    if _side(a, b, c, p, noise) * _side(a, b, c, q, noise) >= 0:
        return False
    s = _side(p, q, a, b, noise)
    return s != 0 and _side(p, q, b, c, noise) == s and _side(p, q, c, a, noise) == s


@njit(cache=True)
def _cross(points, t, u, noise):
    """Whether two triangles cross: an edge of one without a corner in common pierces the other."""
    for one, other in ((t, u), (u, t)):
        a, b, c = points[other[0]], points[other[1]], points[other[2]]
        for k in range(3):
            i, j = one[k], one[(k + 1) % 3]
            shared = False
            for m in other:
                shared = shared or m == i or m == j
            if not shared and _pierces(points[i], points[j], a, b, c, noise):
                return True
    return False


@njit(cache=True)
def _swept(points, triangles, lower, upper, order, axis, most, noise):
    """Crossing pairs, by a sweep along ``axis`` over the triangles' boxes."""
    found = np.empty((most, 2), np.int64)
    count = 0
    b, c = (axis + 1) % 3, (axis + 2) % 3
    for m in range(len(order)):
        i = order[m]
        for k in range(m + 1, len(order)):
            j = order[k]
            if lower[j, axis] > upper[i, axis]:
                break
            if lower[j, b] > upper[i, b] or upper[j, b] < lower[i, b]:
                continue
            if lower[j, c] > upper[i, c] or upper[j, c] < lower[i, c]:
                continue
            if _cross(points, triangles[i], triangles[j], noise):
                found[count, 0], found[count, 1] = i, j
                count += 1
                if count == most:
                    return found
    return found[:count]


def crossing_pairs(points: FloatArray, triangles: IntArray, most: int = 10_000) -> IntArray:
    """Pairs ``(c, 2)`` of triangles that cross, at most ``most``; touching and overlap in one plane do not count."""
    corners = points[triangles]
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    axis = int(np.ptp(points, axis=0).argmax())
    order, noise = np.argsort(lower[:, axis], kind="stable"), ROUNDED * np.abs(points).max()
    return _swept(points, triangles, lower, upper, order, axis, most, noise)
