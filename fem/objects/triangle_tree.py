"""Tree of boxes over triangles: closest points with their sign, and the first triangle on a ray, compiled.

The sign of the distance comes from the pseudo-normal of the feature (face, edge or corner) on which the closest point
lies; the sums of face normals at an edge and the sums weighted by angle at a corner give the right sign wherever the
surface continues all round that feature (Baerentzen and Aanaes, 2005). At the border of an open surface it does not:
such points are marked, and their sign has to come from elsewhere.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from softjaw.fem.objects.gap import IntArray, edges_of
from softjaw.friction.patch import NEGLIGIBLE, FloatArray

LEAF = 4  # triangles in the smallest boxes
DEPTH = 128  # of the stack; a tree of 500 000 triangles is 18 deep


@njit(cache=True)
def _built(corners):
    """Order of the triangles, and nodes: box, first triangle (leaf) or first child, number of triangles (0: inner)."""
    m = len(corners)
    order, along = np.arange(m), np.empty(m)
    most = max(4 * (m // LEAF + 1), 8)
    low, high = np.full((most, 3), np.inf), np.full((most, 3), -np.inf)
    start, count = np.zeros(most, np.int64), np.zeros(most, np.int64)
    start[0], count[0], used, node = 0, m, 1, 0
    while node < used:
        a, n = start[node], count[node]
        if n > LEAF:
            members = order[a : a + n].copy()
            widest, axis = -1.0, 0
            for d in range(3):
                least, largest = np.inf, -np.inf
                for k in members:
                    centre = corners[k, 0, d] + corners[k, 1, d] + corners[k, 2, d]
                    least, largest = min(least, centre), max(largest, centre)
                if largest - least > widest:
                    widest, axis = largest - least, d
            for k in range(n):
                i = members[k]
                along[k] = corners[i, 0, axis] + corners[i, 1, axis] + corners[i, 2, axis]
            order[a : a + n] = members[np.argpartition(along[:n], n // 2)]
            start[used], count[used] = a, n // 2
            start[used + 1], count[used + 1] = a + n // 2, n - n // 2
            start[node], count[node] = used, 0
            used += 2
        node += 1
    for node in range(used - 1, -1, -1):  # children come after their parents
        first = start[node]
        for d in range(3):
            for k in range(first, first + count[node]):
                for c in range(3):
                    z = corners[order[k], c, d]
                    low[node, d], high[node, d] = min(low[node, d], z), max(high[node, d], z)
            if not count[node]:
                low[node, d] = min(low[first, d], low[first + 1, d])
                high[node, d] = max(high[first, d], high[first + 1, d])
    return order, low[:used], high[:used], start[:used], count[:used]


# Below numbers are passed one by one: in such short functions a view of an array takes as long as the rest.
@njit(cache=True)
def _to_box(x0, x1, x2, low, high, n):
    """Squared distance of a point to the ``n``-th box."""
    d0 = max(low[n, 0] - x0, 0.0, x0 - high[n, 0])
    d1 = max(low[n, 1] - x1, 0.0, x1 - high[n, 1])
    d2 = max(low[n, 2] - x2, 0.0, x2 - high[n, 2])
    return d0 * d0 + d1 * d1 + d2 * d2


@njit(cache=True)
def _on_segment(wx, wy, wz, dx, dy, dz):
    """Squared distance of a point at ``w`` from the start of a segment ``d``, and the closest place on it in [0, 1]."""
    length2 = dx * dx + dy * dy + dz * dz
    t = min(max((wx * dx + wy * dy + wz * dz) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    return (wx - t * dx) ** 2 + (wy - t * dy) ** 2 + (wz - t * dz) ** 2, t


@njit(cache=True)
def _on_triangle(x0, x1, x2, corners, m, most):
    """Squared distance of a point to the ``m``-th triangle, the feature that is closest, and the way there.

    Features: 0 the face, 1 to 3 the edges from corner 0, 1, 2 to the next one, 4 to 6 the corners. Infinite where the
    triangle is farther away than ``most``, squared.
    """
    ax, ay, az = corners[m, 0, 0], corners[m, 0, 1], corners[m, 0, 2]
    ux, uy, uz = corners[m, 1, 0] - ax, corners[m, 1, 1] - ay, corners[m, 1, 2] - az
    vx, vy, vz = corners[m, 2, 0] - ax, corners[m, 2, 1] - ay, corners[m, 2, 2] - az
    wx, wy, wz = x0 - ax, x1 - ay, x2 - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    area2 = nx * nx + ny * ny + nz * nz
    sx, sy, sz = vx - ux, vy - uy, vz - uz
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    # squared area over the fourth power of the size, below which a triangle is taken as its three edges
    if area2 > 1e-20 * max(uu, vv) ** 2:
        h = (wx * nx + wy * ny + wz * nz) / area2
        # by more than rounding, which decides between triangles that are as near as each other
        if h * h * area2 > 1.000001 * most:
            return np.inf, 0, 0.0, 0.0, 0.0
        c = ((uy * wz - uz * wy) * nx + (uz * wx - ux * wz) * ny + (ux * wy - uy * wx) * nz) / area2
        b = ((wy * vz - wz * vy) * nx + (wz * vx - wx * vz) * ny + (wx * vy - wy * vx) * nz) / area2
        a = 1.0 - b - c
        if b > 0.0 and c > 0.0 and a > 0.0:
            return h * h * area2, 0, h * nx, h * ny, h * nz
        # in the plane it is at least as far off as from the line of any side that it is beyond
        beside = max(min(b, 0.0) ** 2 / vv, min(c, 0.0) ** 2 / uu, min(a, 0.0) ** 2 / (sx * sx + sy * sy + sz * sz))
        if (h * h + beside) * area2 > 1.000001 * most:
            return np.inf, 0, 0.0, 0.0, 0.0
    best, t = _on_segment(wx, wy, wz, ux, uy, uz)
    feature, fx, fy, fz = 4 if t == 0.0 else 5 if t == 1.0 else 1, wx - t * ux, wy - t * uy, wz - t * uz
    d2, t = _on_segment(wx - ux, wy - uy, wz - uz, sx, sy, sz)
    if d2 < best:
        best, feature = d2, 5 if t == 0.0 else 6 if t == 1.0 else 2
        fx, fy, fz = wx - ux - t * sx, wy - uy - t * sy, wz - uz - t * sz
    d2, t = _on_segment(wx, wy, wz, vx, vy, vz)
    if d2 < best:
        best, feature = d2, 4 if t == 0.0 else 6 if t == 1.0 else 3
        fx, fy, fz = wx - t * vx, wy - t * vy, wz - t * vz
    return best, feature, fx, fy, fz


@njit(cache=True)
def closest(x, corners, order, low, high, start, count):
    """Ways ``(n, 3)`` from the closest points of the triangles ``corners (m, 3, 3)``; triangle and feature of each."""
    n = len(x)
    away, triangle, feature = np.empty((n, 3)), np.zeros(n, np.int64), np.zeros(n, np.int64)
    stack, bound, nearest = np.empty(DEPTH, np.int64), np.empty(DEPTH), 0
    for i in range(n):
        x0, x1, x2 = x[i, 0], x[i, 1], x[i, 2]
        # points come in runs: the triangle of the one before is a good first guess
        best, kind, w0, w1, w2 = _on_triangle(x0, x1, x2, corners, nearest, np.inf)
        top, stack[0], bound[0] = 1, 0, 0.0
        while top > 0:
            top -= 1
            node = stack[top]
            # the best may have fallen since this box was put on the stack
            if bound[top] >= best:
                continue
            if count[node]:
                for j in range(start[node], start[node] + count[node]):
                    d2, other, v0, v1, v2 = _on_triangle(x0, x1, x2, corners, order[j], best)
                    if d2 < best:
                        best, kind, nearest, w0, w1, w2 = d2, other, order[j], v0, v1, v2
                continue
            first, second = start[node], start[node] + 1
            d_one, d_two = _to_box(x0, x1, x2, low, high, first), _to_box(x0, x1, x2, low, high, second)
            # the nearer box comes to lie on top: what it yields often spares the other
            if d_one < d_two:
                first, second, d_one, d_two = second, first, d_two, d_one
            stack[top], bound[top], stack[top + 1], bound[top + 1] = first, d_one, second, d_two
            top += 2
        away[i, 0], away[i, 1], away[i, 2], triangle[i], feature[i] = w0, w1, w2, nearest, kind
    return away, triangle, feature


@njit(cache=True)
def hits(o, d, corners, m):
    """Distance along the ray to the ``m``-th triangle, infinite beside it or in its plane (Moeller and Trumbore)."""
    ax, ay, az = corners[m, 0, 0], corners[m, 0, 1], corners[m, 0, 2]
    ux, uy, uz = corners[m, 1, 0] - ax, corners[m, 1, 1] - ay, corners[m, 1, 2] - az
    vx, vy, vz = corners[m, 2, 0] - ax, corners[m, 2, 1] - ay, corners[m, 2, 2] - az
    qx, qy, qz = d[1] * vz - d[2] * vy, d[2] * vx - d[0] * vz, d[0] * vy - d[1] * vx
    det = ux * qx + uy * qy + uz * qz
    if det == 0.0:
        return np.inf
    wx, wy, wz = o[0] - ax, o[1] - ay, o[2] - az
    b = (wx * qx + wy * qy + wz * qz) / det
    if b < -NEGLIGIBLE or b > 1.0 + NEGLIGIBLE:
        return np.inf
    rx, ry, rz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
    c = (d[0] * rx + d[1] * ry + d[2] * rz) / det
    if c < -NEGLIGIBLE or b + c > 1.0 + NEGLIGIBLE:
        return np.inf
    return (vx * rx + vy * ry + vz * rz) / det


@njit(cache=True)
def first_hit(o, d, least, skipped, anyone, nodes, stack):
    """Distance beyond ``least`` to the first triangle but ``skipped`` on a ray and its number; infinite and -1 if none.

    ``anyone`` stops at whichever triangle is found first.
    """
    corners, order, low, high, start, count = nodes
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
        for j in range(start[node], start[node] + count[node]):
            k = order[j]
            if k != skipped:
                t = hits(o, d, corners, k)
                if least < t < best:
                    best, nearest = t, k
                    if anyone:
                        return best, nearest
    return best, nearest


@njit(cache=True)
def _along(x, d, least, skipped, nodes):
    """`first_hit` from points ``(n, 3)`` in directions ``(n, 3)``, each without a triangle ``skipped (n,)``."""
    stack, distance, hit = np.empty(DEPTH, np.int64), np.empty(len(x)), np.empty(len(x), np.int64)
    for i in range(len(x)):
        distance[i], hit[i] = first_hit(x[i], d[i], least, skipped[i], False, nodes, stack)
    return distance, hit


def components(pairs: NDArray[np.integer], count: int) -> NDArray[np.intp]:
    """Number ``(count,)`` of the connected part of each of some things, that ``pairs (k, 2)`` of them link."""
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1])


def area_vectors(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Normals ``(m, 3)`` of triangles, as long as twice their areas [m^2]."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def corner_angles(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Angles ``(m, 3)`` of triangles at their corners [rad]."""
    corners = points[triangles]
    along = np.roll(corners, -1, axis=1) - corners
    along /= np.maximum(np.linalg.norm(along, axis=2), 1e-300)[:, :, None]
    # rounding can push the cosine beyond 1
    return np.arccos(np.clip(-np.einsum("mkd,mkd->mk", along, np.roll(along, 1, axis=1)), -1.0, 1.0))


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """Triangles that can be asked for closest points and for what a ray meets.

    ``points (k, 3)``: corners [m]; ``triangles (m, 3)``: corners of each triangle, counterclockwise from outside.
    """

    points: FloatArray
    triangles: IntArray

    @cached_property
    def nodes(self) -> tuple[np.ndarray, ...]:
        """Corners ``(m, 3, 3)`` and tree, as the compiled functions take them."""
        corners = np.ascontiguousarray(self.points[self.triangles])
        return corners, *_built(corners)

    @cached_property
    def face_normals(self) -> FloatArray:
        """Unit normals ``(m, 3)``; zero for a triangle without area."""
        area = area_vectors(self.points, self.triangles)
        size = np.linalg.norm(area, axis=1)
        return np.ascontiguousarray(area / np.where(size > 0, size, 1.0)[:, None])

    @cached_property
    def _pseudo_normals(self) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
        """Sums of normals round each edge ``(m, 3, 3)`` and, by their angles, point ``(k, 3)``; borders ``(m, 6)``."""
        sides, count = edges_of(self.triangles), len(self.points)
        _, edge, times = np.unique(np.sort(sides, axis=1) @ [count, 1], return_inverse=True, return_counts=True)
        alone = times[edge.ravel()] == 1
        angle = corner_angles(self.points, self.triangles).ravel()
        each, rim = np.repeat(self.face_normals, 3, axis=0), np.zeros(count, dtype=bool)
        rim[sides[alone]] = True
        of_edges = np.stack([np.bincount(edge.ravel(), each[:, d]) for d in range(3)], axis=1)[edge.ravel()]
        of_points = np.stack([np.bincount(self.triangles.ravel(), angle * each[:, d], count) for d in range(3)], axis=1)
        border = np.hstack([alone.reshape(-1, 3), rim[self.triangles]])
        return of_edges.reshape(-1, 3, 3), np.asarray(of_points, float), border

    def along(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Distances ``(n,)`` [m] from points ``(n, 3)`` to the first triangle in a direction; infinite without one."""
        each = np.ascontiguousarray(np.broadcast_to(direction, x.shape))
        return np.asarray(_along(np.ascontiguousarray(x), each, 0.0, np.full(len(x), -1), self.nodes)[0])

    def behind(self, which: IntArray, normals: FloatArray, lift: float) -> tuple[FloatArray, IntArray]:
        """How far behind the middles of triangles ``which (k,)``, against normals, the next one lies, and which it is.

        Infinite and -1 where there is none; nearer than ``lift`` [m] does not count.
        """
        middle = self.points[self.triangles[which]].sum(axis=1) / 3.0
        return _along(middle, -normals, lift, which, self.nodes)

    def signed(self, x: FloatArray) -> tuple[FloatArray, FloatArray, np.ndarray]:
        """Signed distance ``(n,)`` [m], its unit gradient ``(n, 3)``, and whether the border is closest ``(n,)``."""
        x = np.ascontiguousarray(x, dtype=float)
        away, triangle, feature = closest(x, *self.nodes)
        of_edges, of_points, at_border = self._pseudo_normals
        vector, on_edge, on_point = self.face_normals[triangle], (feature > 0) & (feature < 4), feature > 3
        vector[on_edge] = of_edges[triangle[on_edge], feature[on_edge] - 1]
        vector[on_point] = of_points[self.triangles[triangle[on_point], feature[on_point] - 4]]
        border = (feature > 0) & at_border[triangle, feature - 1]
        length = np.linalg.norm(away, axis=1)
        sign = np.where(np.einsum("nd,nd->n", away, vector) < 0, -1.0, 1.0)
        # on the surface itself the direction to the foot is rounding
        on = length <= 1e-9 * np.ptp(self.points)
        normal = np.where(on[:, None], vector, sign[:, None] * away)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        return sign * length, normal, border
