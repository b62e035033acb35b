"""Holes of a triangle mesh, the triangles that close them, and the volume that a mesh encloses in spite of them.

A hole is a loop of edges that border on one triangle only. A small one is filled by a fan about its middle; no point
moves. A large one stays open; a lid, such a fan, tells where it is.

The divergence theorem gives what closed surfaces enclose, and counts twice where parts cross. Along a line each
crossing adds to the winding number or takes from it, so lines along the three axes tell how much that is: exact in
their own direction, sampled across it. Holes that stay open count as closed by their lids. Where some edges have three
triangles there is no such theorem; lines measure the whole volume, and one that does not come back to zero is left out.
"""

import numpy as np
from numba import njit

from softjaw.fem.objects.gap import IntArray, edges_of
from softjaw.fem.objects.triangle_tree import area_vectors
from softjaw.friction.patch import FloatArray

SMALL_HOLE = 0.02  # of the object's diagonal: smaller holes are filled, others stay open
FEW_SIDES, LARGEST_GAP = 4, 0.1  # a triangle or two that are missing are filled up to this share of the diagonal


def with_holes_filled(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray, list[str]]:
    """Mesh with its small holes filled, each by a fan, and a note of them; the larger ones stay open.

    Triangles that hardly hang together have no holes to speak of, and stay as they are.
    """
    if not (loops := _holes(triangles)):
        return points, triangles, []
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    present, edges = (set(map(tuple, np.sort(of, axis=1).tolist())) for of in (triangles, edges_of(triangles)))
    middles, parts, places = [points], [triangles], []
    for loop in loops:
        x, few, apex = points[loop], len(loop) <= FEW_SIDES, len(points) + len(middles) - 1
        across, middle = float(np.linalg.norm(np.ptp(x, axis=0))), x.mean(axis=0)
        # of a triangle or two that are missing it is hardly in doubt how: no point is added, and they may be larger
        sides = np.stack([loop, np.roll(loop, -1)], axis=1)
        fans = [np.insert(sides, 2, apex, axis=1)]
        if few:
            free = [k for k in range(len(loop) - 2) if len(loop) < 4 or tuple(sorted(loop[k::2])) not in edges]
            fans = [np.insert(np.roll(sides, -k, axis=0)[1:-1], 2, loop[k], axis=1) for k in free]
        # the border of a triangle that stands alone is no hole
        fans = [fan for fan in fans if not any(tuple(sorted(t)) in present for t in fan.tolist())]
        if not fans or across > (LARGEST_GAP if few else SMALL_HOLE) * size:
            continue
        sizes = [np.linalg.norm(area_vectors(points, fan), axis=1).sum() if few else 0.0 for fan in fans]
        new = fans[int(np.argmin(sizes))]
        places.append(f"{across * 1e3:.3g} mm near ({', '.join(f'{v:.4g}' for v in middle)}) m of the file's frame")
        parts.append(new)
        # the filling of the next hole must not use an edge of this one a third time
        edges.update(map(tuple, np.sort(edges_of(new), axis=1).tolist()))
        middles += [middle[None]] * (not few)
    more = "; ..." if len(places) > 3 else ""
    notes = [f"small holes filled: {len(places)} ({'; '.join(places[:3])}{more})"] if places else []
    return np.concatenate(middles), np.concatenate(parts), notes


def _holes(triangles: IntArray) -> list[list[int]]:
    """Loops round the holes of triangles; none where they hardly hang together."""
    loops = border_loops(triangles)
    # a tube of one band of triangles has as many sides at its ends as triangles, but two ends
    return loops if len(loops) <= 2 + 0.05 * len(triangles) else []


def border_edges(triangles: IntArray) -> IntArray:
    """Edges of one triangle alone ``(b, 2)``, as they run and in the order of the triangles."""
    sides = edges_of(triangles)
    edge = np.sort(sides, axis=1) @ [triangles.max(initial=0) + 1, 1]
    _, first, count = np.unique(edge, return_index=True, return_counts=True)
    return sides[np.sort(first[count == 1])]


def border_loops(triangles: IntArray) -> list[list[int]]:
    """Points along each hole, so that ``(p_k, p_k+1)`` runs against the triangle beside it; smallest number first.

    Neighbouring triangles may disagree about their sense: edges are joined whichever way they run.
    """
    border = border_edges(triangles)
    at: dict[int, list[int]] = {}
    for k, (a, b) in enumerate(border.tolist()):
        at.setdefault(a, []).append(k)
        at.setdefault(b, []).append(k)
    remaining, loops = set(range(len(border))), []
    for start in range(len(border)):
        if start not in remaining:
            continue
        remaining.remove(start)
        path = [int(border[start, 1]), int(border[start, 0])]
        while (point := path[-1]) != path[0] and (ways := [k for k in at[point] if k in remaining]):
            # one that runs the same way, if there is a choice: two holes may share a point
            k = min(ways, key=lambda k: (border[k, 1] != point, k))
            remaining.remove(k)
            path.append(int(border[k, 0] if border[k, 1] == point else border[k, 1]))
            loops += _closed_part(path)
    return loops


def _closed_part(path: list[int]) -> list[list[int]]:
    """Cut the loop that the last point of the ``path`` closes, if any; the path keeps the rest."""
    start = path.index(path[-1])
    if start == len(path) - 1:
        return []
    loop = path[start:-1]
    del path[start + 1 :]
    return [loop] if len(loop) > 2 else []


def lid_corners(points: FloatArray, loops: list[list[int]]) -> FloatArray:
    """Corners ``(l, 3, 3)`` [m] of fans over open holes, each about the middle of its loop, weighted by length."""
    lids = [np.empty((0, 3, 3))]
    for loop in loops:
        x, following = points[loop], points[np.roll(loop, -1)]
        along = np.linalg.norm(following - x, axis=1)
        if along.sum() > 0:
            middle = np.average(0.5 * (x + following), axis=0, weights=along)
            lids.append(np.stack([x, following, np.broadcast_to(middle, x.shape)], axis=1))
    return np.concatenate(lids)


def solid(points: FloatArray, triangles: IntArray, closed: bool) -> tuple[float, FloatArray, float]:
    """Volume inside triangles turned as their neighbours [m^3], its centroid ``(3,)``, and the error of that [m].

    What lies in several parts counts once. The error is how far lines along the three axes differ, next to none where
    no parts of a ``closed`` mesh cross; of an open one also what a rounder end than its lids would change.
    """
    size = np.maximum(np.ptp(points, axis=0), 1e-9)
    middle = points.min(axis=0) + size / 2
    loops = [] if closed else _holes(triangles)
    lids = lid_corners(points, loops) - middle
    x, balanced = np.concatenate([points[triangles] - middle, lids]), closed or _balanced(triangles, loops)
    measured = np.array([_along(x, size, axis, balanced) for axis in range(3)])
    if balanced:
        cones = np.einsum("ij,ij->i", x[:, 0], np.cross(x[:, 1], x[:, 2])) / 6
        measured[:, :4] += [cones.sum(), *(cones @ x.sum(axis=1) / 4)]
    volume, *moments, lost = measured.T
    weight = (lost + 0.01) ** -2 / ((lost + 0.01) ** -2).sum()  # a direction that loses its lines hardly counts
    full, area = float(weight @ volume), np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2
    if full <= 1e-6 * area.sum() * size.max():  # it has no inside
        return 0.0, middle + area @ x.mean(axis=1) / area.sum(), float(size.max()) / 2
    each = np.transpose(moments / np.maximum(volume, 1e-3 * full))
    place = weight @ each
    # of a cap on a ball of the object's size; the mean height of a shallow one is 1/2 of this, of half a ball 4/3
    height = np.linalg.norm(lids[:, :2].mean(axis=1) - lids[:, 2], axis=1) ** 2 / size.max()
    bulge = 2 / 3 * (area[len(triangles) :] * height)[:, None] * (lids.mean(axis=1) - place) / full
    # ends that are alike cancel, though hardly to the last fiftieth
    bulges = np.linalg.norm(bulge.sum(axis=0)) + 0.02 * np.linalg.norm(bulge, axis=1).sum()
    # beyond four standard deviations between directions is hardly one object in a hundred
    error = 4 * np.sqrt((weight @ (each - place) ** 2).sum()) + bulges
    return full, middle + place, float(min(error, size.max() / 2))


def _balanced(triangles: IntArray, loops: list[list[int]]) -> bool:
    """Whether triangles and lids run through every edge as often in one sense as in the other."""
    sides = np.concatenate([edges_of(triangles), *(np.stack([loop, np.roll(loop, -1)], axis=1) for loop in loops)])
    edge = np.unique(sides.min(axis=1) * (triangles.max() + 1) + sides.max(axis=1), return_inverse=True)[1]
    return not np.bincount(edge, np.where(sides[:, 0] < sides[:, 1], 1.0, -1.0)).any()


def _along(x: FloatArray, size: FloatArray, axis: int, balanced: bool) -> FloatArray:
    """Volume inside, its first moments, and the share of lines that end inside ``(5,)``, by lines along an axis.

    ``x (m, 3, 3)`` are corners about the middle of a box. Of a ``balanced`` surface it is what has to be added to what
    the divergence theorem gives. One goes through each of n x n cells, shifted from row to row by the golden section: a
    straight side of the object then cuts off its true share of them.
    """
    order, shift = [(axis + 1) % 3, (axis + 2) % 3, axis], np.arange(128) * 0.5 * (np.sqrt(5.0) - 1.0) % 1.0
    cell = np.append(size[order[:2]] / len(shift), 1.0)
    line, z, turn = _crossings(np.ascontiguousarray((x + size / 2)[..., order] / cell), shift)
    crossed, ended = np.bincount(line, minlength=1) > 0, np.bincount(line, turn, minlength=1) != 0
    k = np.lexsort((z, line))
    k = k[~ended[line[k]]]
    line, z, winding = line[k], z[k], np.cumsum(turn[k])
    lost = ended.sum() / max(crossed.sum(), 1)
    inside = (winding != 0) - winding if balanced else 1.0 * (winding != 0) / max(1 - lost, 1e-9)
    k = np.flatnonzero(inside)
    i, j = np.divmod(line[k], len(shift))
    middle = np.stack([i + shift[j], j + shift[i], (z[k] + z[k + 1]) / 2], axis=1) * cell - size[order] / 2
    part = inside[k] * (z[k + 1] - z[k]) * cell[0] * cell[1]
    return np.array([part.sum(), *(part @ middle)[np.argsort(order)], lost])


@njit(cache=True)
def _crossings(x, shift):
    """Where lines along z, one in each of n x n cells, cross triangles: line, z, change of winding number ``(k,)``."""
    n = len(shift)
    lines, places, turns = [], [], []
    for t in range(len(x)):
        a, b, c = x[t, 0], x[t, 1], x[t, 2]
        low, high = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        bx, by, bz, cx, cy, cz = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        for i in range(int(min(a[0], b[0], c[0])), min(n - 1, int(max(a[0], b[0], c[0]))) + 1):
            for j in range(int(min(a[1], b[1], c[1])), min(n - 1, int(max(a[1], b[1], c[1]))) + 1):
                u, v = i + shift[j], j + shift[i]
                left = _left(a, b, u, v)
                if nz != 0.0 and left == _left(b, c, u, v) and left == _left(c, a, u, v):
                    z = a[2] - (nx * (u - a[0]) + ny * (v - a[1])) / nz
                    lines.append(i * n + j)
                    places.append(min(max(z, low), high))
                    # a surface that looks down is where the line comes in
                    turns.append(-1 if left else 1)
    return np.array(lines), np.array(places), np.array(turns)


@njit(cache=True)
def _left(p, q, u, v):
    """Whether (u, v) lies to the left of an edge; an edge that is run through the other way has the other answer."""
    back = p[0] > q[0] or (p[0] == q[0] and p[1] > q[1])
    if back:
        p, q = q, p
    return ((q[0] - p[0]) * (v - p[1]) - (q[1] - p[1]) * (u - p[0]) > 0.0) != back
