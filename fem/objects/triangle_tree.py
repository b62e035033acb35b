"""Tree of boxes over triangles: closest points with their sign, and the first triangle on a ray, compiled.

The sign of the distance comes from the pseudo-normal of the feature (face, edge or corner) on which the closest point
lies; the sums of face normals at an edge and the sums weighted by angle at a corner give the right sign wherever the
surface goes on all round that feature (Baerentzen and Aanaes, 2005). At the border of an open surface it does not:
such points are marked, and their sign has to come from elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from softjaw.fem.objects.gap import IntArray, edges_of
from softjaw.friction.patch import NEGLIGIBLE, FloatArray

LEAF = 4  # triangles in the smallest boxes
DEPTH = 128  # of the stack; a tree of 500 000 triangles is 18 deep


@njit(cache=True)
def _built(centres, lower, upper):
    """Order of the triangles, and nodes: box, first triangle (leaf) or first child, number of triangles (0: inner)."""
    m = len(centres)
    order = np.arange(m)
    most = max(4 * (m // LEAF + 1), 8)
    low, high = np.empty((most, 3)), np.empty((most, 3))
    start, count = np.zeros(most, np.int64), np.zeros(most, np.int64)
    start[0], count[0], used, node = 0, m, 1, 0
    while node < used:
        a, n = start[node], count[node]
        for d in range(3):
            low[node, d], high[node, d] = np.inf, -np.inf
        c_low, c_high = np.full(3, np.inf), np.full(3, -np.inf)
        for i in order[a : a + n]:
            for d in range(3):
                low[node, d], high[node, d] = min(low[node, d], lower[i, d]), max(high[node, d], upper[i, d])
                c_low[d], c_high[d] = min(c_low[d], centres[i, d]), max(c_high[d], centres[i, d])
        if n > LEAF:
            members = order[a : a + n].copy()
            along = centres[members, np.argmax(c_high - c_low)]
            # a stable sort keeps equal centres in order, so the tree is the same everywhere
            order[a : a + n] = members[np.argsort(along, kind="mergesort")]
            start[used], count[used] = a, n // 2
            start[used + 1], count[used + 1] = a + n // 2, n - n // 2
            start[node], count[node] = used, 0
            used += 2
        node += 1
    return order, low[:used], high[:used], start[:used], count[:used]


@njit(cache=True)
def _to_box(x, low, high):
    """Squared distance of a point to a box."""
    d2 = 0.0
    for d in range(3):
        out = max(low[d] - x[d], 0.0, x[d] - high[d])
        d2 += out * out
    return d2


@njit(cache=True)
def _on_segment(x, a, b, foot):
    """Put the closest point of the segment into ``foot``; squared distance and the place on the segment in [0, 1]."""
    along, length2 = 0.0, 0.0
    for d in range(3):
        along += (x[d] - a[d]) * (b[d] - a[d])
        length2 += (b[d] - a[d]) ** 2
    t = min(max(along / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    d2 = 0.0
    for d in range(3):
        foot[d] = a[d] + t * (b[d] - a[d])
        d2 += (x[d] - foot[d]) ** 2
    return d2, t


@njit(cache=True)
def _on_triangle(x, p, most, foot, other):
    """Put the closest point of the triangle ``p (3, 3)`` into ``foot``; squared distance and feature.

    Features: 0 the face, 1 to 3 the edges from corner 0, 1, 2 to the next one, 4 to 6 the corners. Infinite where the
    triangle's plane is farther away than ``most``, squared.
    """
    ux, uy, uz = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[1, 2] - p[0, 2]
    vx, vy, vz = p[2, 0] - p[0, 0], p[2, 1] - p[0, 1], p[2, 2] - p[0, 2]
    wx, wy, wz = x[0] - p[0, 0], x[1] - p[0, 1], x[2] - p[0, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    area2 = nx * nx + ny * ny + nz * nz
    size2 = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz)
    # squared area over the fourth power of the size, below which a triangle is taken as its three edges
    if area2 > 1e-20 * size2 * size2:
        h = (wx * nx + wy * ny + wz * nz) / area2
        # by more than rounding, which decides between triangles that are as near as each other
        if h * h * area2 > 1.000001 * most:
            return np.inf, 0
        c = ((uy * wz - uz * wy) * nx + (uz * wx - ux * wz) * ny + (ux * wy - uy * wx) * nz) / area2
        b = ((wy * vz - wz * vy) * nx + (wz * vx - wx * vz) * ny + (wx * vy - wy * vx) * nz) / area2
        if b > 0.0 and c > 0.0 and b + c < 1.0:
            foot[0], foot[1], foot[2] = x[0] - h * nx, x[1] - h * ny, x[2] - h * nz
            return h * h * area2, 0
    best, feature = np.inf, 0
    for k in range(3):
        d2, t = _on_segment(x, p[k], p[(k + 1) % 3], other)
        if d2 < best:
            best = d2
            feature = 4 + k if t == 0.0 else (4 + (k + 1) % 3 if t == 1.0 else 1 + k)
            foot[:] = other
    return best, feature


@njit(cache=True)
def closest(x, corners, order, low, high, start, count):
    """Closest points ``(n, 3)`` of the triangles ``corners (m, 3, 3)``, and the triangle and feature of each."""
    n = len(x)
    feet, triangle, feature = np.empty((n, 3)), np.zeros(n, np.int64), np.zeros(n, np.int64)
    foot, other, stack, bound = np.empty(3), np.empty(3), np.empty(DEPTH, np.int64), np.empty(DEPTH)
    for i in range(n):
        best = np.inf
        if i > 0:  # points come in runs: the triangle of the one before is a good first guess
            best, feature[i] = _on_triangle(x[i], corners[triangle[i - 1]], np.inf, foot, other)
            triangle[i] = triangle[i - 1]
            feet[i] = foot
        top, stack[0], bound[0] = 1, 0, 0.0
        while top > 0:
            top -= 1
            node = stack[top]
            # the best may have fallen since this box was put on the stack
            if bound[top] >= best:
                continue
            if count[node]:
                for k in order[start[node] : start[node] + count[node]]:
                    d2, kind = _on_triangle(x[i], corners[k], best, foot, other)
                    if d2 < best:
                        best, triangle[i], feature[i] = d2, k, kind
                        feet[i] = foot
                continue
            first, second = start[node], start[node] + 1
            d_one, d_two = _to_box(x[i], low[first], high[first]), _to_box(x[i], low[second], high[second])
            # the nearer box comes to lie on top: what it yields often spares the other
            if d_one < d_two:
                first, second, d_one, d_two = second, first, d_two, d_one
            stack[top], bound[top], stack[top + 1], bound[top + 1] = first, d_one, second, d_two
            top += 2
    return feet, triangle, feature


@njit(cache=True)
def hits(o, d, p):
    """Distance along the ray to the triangle, infinite beside it or in its plane (Moeller and Trumbore)."""
    ux, uy, uz = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[1, 2] - p[0, 2]
    vx, vy, vz = p[2, 0] - p[0, 0], p[2, 1] - p[0, 1], p[2, 2] - p[0, 2]
    qx, qy, qz = d[1] * vz - d[2] * vy, d[2] * vx - d[0] * vz, d[0] * vy - d[1] * vx
    det = ux * qx + uy * qy + uz * qz
    if det == 0.0:
        return np.inf
    wx, wy, wz = o[0] - p[0, 0], o[1] - p[0, 1], o[2] - p[0, 2]
    b = (wx * qx + wy * qy + wz * qz) / det
    if b < -NEGLIGIBLE or b > 1.0 + NEGLIGIBLE:
        return np.inf
    rx, ry, rz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
    c = (d[0] * rx + d[1] * ry + d[2] * rz) / det
    if c < -NEGLIGIBLE or b + c > 1.0 + NEGLIGIBLE:
        return np.inf
    return (vx * rx + vy * ry + vz * rz) / det


@njit(cache=True)
def first_hit(o, d, least, skipped, anyone, corners, order, low, high, start, count, stack):
    """Distance beyond ``least`` to the first triangle but ``skipped`` on a ray and its number; infinite and -1 if none.

    ``anyone`` stops at whichever triangle is found first.
    """
    best, nearest = np.inf, -1
    top, stack[0] = 1, 0
    while top > 0:
        top -= 1
        node = stack[top]
        # a box behind the best hit so far cannot hold a nearer one
        enter, leave = least, best
        for k in range(3):
            if d[k] != 0.0:
                s, t = (low[node, k] - o[k]) / d[k], (high[node, k] - o[k]) / d[k]
                enter, leave = max(enter, min(s, t) - NEGLIGIBLE), min(leave, max(s, t) + NEGLIGIBLE)
            elif o[k] < low[node, k] or o[k] > high[node, k]:
                leave = -np.inf
        if enter > leave:
            continue
        if not count[node]:
            stack[top], stack[top + 1] = start[node], start[node] + 1
            top += 2
            continue
        for k in order[start[node] : start[node] + count[node]]:
            if k != skipped:
                t = hits(o, d, corners[k])
                if least < t < best:
                    best, nearest = t, k
                    if anyone:
                        return best, nearest
    return best, nearest


@njit(cache=True)
def _along(x, d, least, skipped, nodes):
    """`first_hit` from points ``(n, 3)`` in directions ``(n, 3)``, each without a triangle ``skipped (n,)``."""
    corners, order, low, high, start, count = nodes
    stack, distance, hit = np.empty(DEPTH, np.int64), np.empty(len(x)), np.empty(len(x), np.int64)
    for i in range(len(x)):
        distance[i], hit[i] = first_hit(x[i], d[i], least, skipped[i], False, corners, order, low, high, start, count,
                                        stack)  # fmt: skip
    return distance, hit


def corner_angles(corners: FloatArray) -> FloatArray:
    """Angles ``(m, 3)`` of triangles ``(m, 3, 3)`` at their corners [rad]."""
    along = np.roll(corners, -1, axis=1) - corners
    along /= np.maximum(np.linalg.norm(along, axis=2), 1e-300)[:, :, None]
    # rounding can push the cosine beyond 1
    return np.asarray(np.arccos(np.clip(-np.einsum("mkd,mkd->mk", along, np.roll(along, 1, axis=1)), -1.0, 1.0)))


def pseudo_normals(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, np.ndarray]:
    """Outward vectors ``(m, 7, 3)`` of face, edges and corners, and which lie on a border ``(m, 7)``."""
    corners = points[triangles]
    along = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(along[:, 0], -along[:, 2])
    size = np.linalg.norm(normal, axis=1)
    normal /= np.where(size > 0, size, 1.0)[:, None]  # a triangle without area has no say
    angle = corner_angles(corners)
    at_corner = np.stack([
        np.bincount(triangles.ravel(), (angle * normal[:, d : d + 1]).ravel(), len(points)) for d in range(3)
    ], axis=1)  # fmt: skip
    edges = np.sort(edges_of(triangles), axis=1)
    key, edge, times = np.unique(edges[:, 0] * len(points) + edges[:, 1], return_inverse=True, return_counts=True)
    edge = edge.ravel()
    at_edge = np.stack([np.bincount(edge, np.repeat(normal[:, d], 3), len(key)) for d in range(3)], axis=1)
    border = np.zeros(len(points), dtype=bool)
    border[edges[times[edge] == 1]] = True
    vectors = np.concatenate([normal[:, None], at_edge[edge].reshape(-1, 3, 3), at_corner[triangles]], axis=1)
    on_border = np.concatenate(
        [np.zeros((len(triangles), 1), bool), (times[edge] == 1).reshape(-1, 3), border[triangles]], axis=1
    )
    return vectors, on_border


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """Triangles that can be asked for closest points and for what a ray meets.

    Parameters
    ----------
    points : (k, 3) array
        Corners [m].
    triangles : (m, 3) array of int
        Corners of each triangle, counterclockwise from outside.
    """

    points: FloatArray
    triangles: IntArray

    @cached_property
    def nodes(self) -> tuple[np.ndarray, ...]:
        """Corners ``(m, 3, 3)`` and tree, as the compiled functions take them."""
        corners = np.ascontiguousarray(self.points[self.triangles])
        return corners, *_built(corners.mean(axis=1), corners.min(axis=1), corners.max(axis=1))

    @property
    def face_normals(self) -> FloatArray:
        """Unit normals ``(m, 3)``; zero for a triangle without area."""
        return np.ascontiguousarray(self._vectors[0][:, 0])

    @cached_property
    def _vectors(self) -> tuple[FloatArray, np.ndarray]:
        return pseudo_normals(self.points, self.triangles)

    def along(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Distances ``(n,)`` [m] from points ``(n, 3)`` to the first triangle in a direction; infinite without one."""
        each = np.ascontiguousarray(np.broadcast_to(direction, x.shape))
        return np.asarray(_along(np.ascontiguousarray(x), each, 0.0, np.full(len(x), -1), self.nodes)[0])

    def behind(self, which: IntArray, normals: FloatArray, lift: float) -> tuple[FloatArray, IntArray]:
        """How far behind the middles of triangles ``which (k,)``, against normals, the next one lies, and which it is.

        Infinite and -1 where there is none; nearer than ``lift`` [m] does not count.
        """
        middle = self.points[self.triangles[which]].sum(axis=1) / 3.0
        distance, hit = _along(middle, -normals, lift, which, self.nodes)
        return distance, hit

    def signed(self, x: FloatArray) -> tuple[FloatArray, FloatArray, np.ndarray]:
        """Signed distance ``(n,)`` [m], its unit gradient ``(n, 3)``, and whether the border is closest ``(n,)``."""
        x = np.ascontiguousarray(x, dtype=float)
        feet, triangle, feature = closest(x, *self.nodes)
        vectors, border = self._vectors
        away, vector = x - feet, vectors[triangle, feature]
        length = np.linalg.norm(away, axis=1)
        sign = np.where(np.einsum("nd,nd->n", away, vector) < 0, -1.0, 1.0)
        # on the surface itself the direction to the foot is rounding
        on = length <= 1e-9 * np.ptp(self.points)
        normal = np.where(on[:, None], vector, sign[:, None] * away)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        return sign * length, normal, border[triangle, feature]
