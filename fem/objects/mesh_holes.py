"""Holes of a triangle mesh, the triangles that close them, and the volume that a mesh encloses in spite of them.

A hole is a loop of edges that border on one triangle only. A small one is filled by the triangulation of its loop that
has the least area (Barequet and Sharir, 1995); no point moves and none is added. A large one stays open; a lid, a fan
about its middle, tells where it is.

Along a line that crosses closed surfaces each crossing adds to the winding number or takes from it, so that a point is
inside where it is positive: exact for parts that cross or contain each other. A line through a hole does not come back
to zero. So lines are cast along all three axes, and of each point those that come back decide.
"""

import numpy as np
from numba import njit

from softjaw.fem.objects.gap import IntArray, cone_volumes, edges_of, solid_centroid
from softjaw.friction.patch import FloatArray

SMALL_HOLE = 0.02  # of the object's diagonal: smaller holes are filled, others stay open
FEW_SIDES, LARGEST_GAP = 4, 0.1  # a triangle or two that are missing are filled up to this share of the diagonal


def with_holes_filled(points: FloatArray, triangles: IntArray) -> tuple[IntArray, list[str]]:
    """Mesh with its small holes filled, and a note of them; the larger ones stay open.

    Triangles that hardly hang together have no holes to speak of, and stay as they are.
    """
    loops, size = border_loops(triangles), float(np.linalg.norm(np.ptp(points, axis=0)))
    # sides of holes per triangle, above which they are no holes
    if not loops or sum(map(len, loops)) > 0.5 * len(triangles):
        return triangles, []
    edges = set(map(tuple, np.sort(edges_of(triangles), axis=1).tolist()))
    present = set(map(tuple, np.sort(triangles, axis=1).tolist()))
    parts, places = [triangles], []
    for loop in loops:
        x = points[loop]
        across = float(np.linalg.norm(np.ptp(x, axis=0)))
        # a triangle or two that are missing can be meant in one way only, so these may be larger
        small = across <= (SMALL_HOLE if len(loop) > FEW_SIDES else LARGEST_GAP) * size
        new = filling(points, loop, edges) if small else None
        # the border of a triangle that stands alone is no hole
        if new is None or any(tuple(sorted(t)) in present for t in new.tolist()):
            continue
        middle = ", ".join(f"{v:.4g}" for v in x.mean(axis=0))
        places.append(f"{across * 1e3:.3g} mm near ({middle}) m of the file's frame")
        # the filling of the next hole must not use an edge of this one a third time
        edges.update(map(tuple, np.sort(edges_of(new), axis=1).tolist()))
        parts.append(new)
    more = "; ..." if len(places) > 3 else ""
    notes = [f"small holes filled: {len(places)} ({'; '.join(places[:3])}{more})"] if places else []
    return np.concatenate(parts), notes


def border_loops(triangles: IntArray) -> list[list[int]]:
    """Points along each hole, so that ``(p_k, p_k+1)`` runs against the triangle beside it; smallest number first.

    Neighbouring triangles may disagree about their sense: edges are joined whichever way they run.
    """
    sides = edges_of(triangles)
    _, first, count = np.unique(np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True)
    border = sides[np.sort(first[count == 1])]
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


def filling(points: FloatArray, loop: list[int], edges: set[tuple[int, int]]) -> IntArray | None:
    """Triangles ``(n - 2, 3)`` of least area that close a loop of n points, or None where there are none.

    ``edges`` (smaller number first) are those that already have two triangles or would get a third.
    """
    n, x = len(loop), points[loop]
    if n > 60:  # sides of a loop that is filled without a new point: the effort grows with the cube
        return None
    best, cut = np.zeros((n, n)), np.zeros((n, n), np.int64)
    for length in range(2, n):
        for i in range(n - length):
            j = i + length
            k = np.arange(i + 1, j)
            area = 0.5 * np.linalg.norm(np.cross(x[k] - x[i], x[j] - x[i]), axis=1)
            cost = best[i, k] + best[k, j] + area
            chord = (min(loop[i], loop[j]), max(loop[i], loop[j]))
            best[i, j] = np.inf if length < n - 1 and chord in edges else cost.min()
            cut[i, j] = k[cost.argmin()]
    if not np.isfinite(best[0, n - 1]):
        return None
    triangles, spans = [], [(0, n - 1)]
    while spans:
        i, j = spans.pop()
        if j > i + 1:
            corner = int(cut[i, j])
            triangles.append((loop[i], loop[corner], loop[j]))
            spans += [(i, corner), (corner, j)]
    return np.array(triangles)


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


OFF_CENTRE = 0.5 + 1e-4 * np.sqrt(2.0)  # of a cell, where lines run: not through the corners of regular meshes


def solid(points: FloatArray, triangles: IntArray, closed: bool) -> tuple[float, FloatArray, float]:
    """Volume inside triangles turned as their neighbours [m^3], its centroid ``(3,)``, and the error of that [m].

    What lies in several parts counts once. The error is 0 for one ``closed`` surface: the divergence theorem holds.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if closed:
        return abs(float(cone_volumes(points, triangles).sum())), solid_centroid(points, triangles), 0.0
    step = float((high - low).max()) / 128  # cells along the longest side
    shape = np.maximum(np.ceil((high - low) / step).astype(int), 1)
    lines = _inside(points, triangles, low, step, shape)
    count = np.isfinite(lines).sum(axis=0)
    inside = np.nansum(lines, axis=0) / np.maximum(count, 1)
    if not (inside > 0.5).any():
        a, b, c = points[triangles].transpose(1, 0, 2)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return 0.0, area @ (a + b + c) / (3 * area.sum()), float((high - low).max()) / 2
    # lines along an axis know the places of both ends on it; what they do not decide others tell, and what none does
    # counts half in one estimate and not at all in the other
    sure, soft = (inside > 0.5).astype(float), np.where(count > 0, inside, 0.5)
    lines[(lines == 0) & (sure > 0)] = np.nan  # in at one open end and out at the other
    first, second = (
        np.array([_mean_along(np.where(np.isnan(line), share, line), d) for d, line in enumerate(lines)])
        for share in (sure, soft)
    )
    # others than those along an axis take its ends to lie between two cells
    rough = np.isnan(lines[:, sure > 0]).mean() + 2 / np.sqrt(sure.sum())
    volume = step**3 * float(np.where(np.isnan(lines), sure, lines).sum()) / 3
    return volume, low + step * (first + OFF_CENTRE), step * float(np.linalg.norm(first - second) + rough)


def _mean_along(share: FloatArray, axis: int) -> float:
    """Mean index of the cells of a grid along one axis, weighted by their share."""
    sums = share.sum(axis=tuple(k for k in range(3) if k != axis))
    return float(sums @ np.arange(len(sums)) / sums.sum())


def _inside(points: FloatArray, triangles: IntArray, low: FloatArray, step: float, shape: IntArray) -> FloatArray:
    """Share of each cell of a grid that lines along the axes have inside ``(3, *shape)``; NaN where one ends inside."""
    shares = np.empty((3, *shape))
    for axis in range(3):
        order = [(axis + 1) % 3, (axis + 2) % 3, axis]
        x = np.ascontiguousarray((points[:, order] - low[order]) / step - OFF_CENTRE)
        change, part = _crossings(x, triangles, *shape[order])
        above = np.cumsum(change, axis=2)
        valid, below = above[..., -1:] == 0, above - change
        # where parts of an object cross, the winding number is larger than 1
        turns = ((below + part) / np.maximum(np.maximum(below, above), 1))[..., :-1]
        shares[axis] = np.transpose(np.where(valid, np.clip(turns, 0.0, 1.0), np.nan), np.argsort(order))
    return shares


@njit(cache=True)
def _crossings(x, triangles, rows, columns, layers):
    """Changes of the winding number along lines in z, in cells round whole z, and what of it is inside each cell."""
    change, part = np.zeros((rows, columns, layers + 1), np.int64), np.zeros((rows, columns, layers + 1))
    for t in range(len(triangles)):
        a, b, c = x[triangles[t, 0]], x[triangles[t, 1]], x[triangles[t, 2]]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        first, start = max(0, int(np.ceil(min(a[0], b[0], c[0])))), max(0, int(np.ceil(min(a[1], b[1], c[1]))))
        last, stop = min(rows - 1, int(max(a[0], b[0], c[0]))), min(columns - 1, int(max(a[1], b[1], c[1])))
        for i in range(first, last + 1):
            for j in range(start, stop + 1):
                u = ((b[0] - i) * (c[1] - j) - (b[1] - j) * (c[0] - i)) / area
                v = ((c[0] - i) * (a[1] - j) - (c[1] - j) * (a[0] - i)) / area
                w = 1.0 - u - v
                if u >= 0.0 and v >= 0.0 and w >= 0.0:
                    z = u * a[2] + v * b[2] + w * c[2]
                    k = min(max(int(np.round(z)), 0), layers)
                    # a surface that looks down is where the line comes in
                    turn = 1 if area < 0.0 else -1
                    change[i, j, k] += turn
                    part[i, j, k] += turn * min(k + 0.5 - z, 1.0)
    return change, part
