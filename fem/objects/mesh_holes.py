"""Holes of a triangle mesh: loops of edges that border on one triangle only, and triangles that close them.

A small hole is filled by the triangulation of its loop that has the least area (Barequet and Sharir, 1995); no point
moves and none is added. A large one stays open; a lid, a fan about its middle, tells where it is.
"""

from __future__ import annotations

import numpy as np

from softjaw.fem.objects.gap import FloatArray, IntArray, edges_of

SMALL_HOLE = 0.02  # of the object's diagonal: smaller holes are filled, others stay open
FEW_SIDES, LARGEST_GAP = 4, 0.1  # a triangle or two that are missing are filled up to this share of the diagonal
MOST_PLACES = 3  # of defects that one note names


def with_holes_filled(points: FloatArray, triangles: IntArray) -> tuple[IntArray, list[str]]:
    """Mesh with its small holes filled, and a note of them; the larger ones stay open.

    Triangles that hardly hang together have no holes to speak of, and stay as they are.
    """
    loops, size = border_loops(triangles), float(np.linalg.norm(np.ptp(points, axis=0)))
    # sides of holes per triangle, above which they are no holes
    if not loops or sum(map(len, loops)) > 0.5 * len(triangles):
        return triangles, []
    taken = set(map(tuple, np.sort(edges_of(triangles), axis=1).tolist()))
    present = set(map(tuple, np.sort(triangles, axis=1).tolist()))
    parts, places = [triangles], []
    for loop in loops:
        x = points[loop]
        across = float(np.linalg.norm(np.ptp(x, axis=0)))
        # a triangle or two that are missing can be meant in one way only, so these may be larger
        small = across <= (SMALL_HOLE if len(loop) > FEW_SIDES else LARGEST_GAP) * size
        new = filling(points, loop, taken) if small else None
        # the border of a triangle that stands alone is no hole
        if new is None or any(tuple(sorted(t)) in present for t in new.tolist()):
            continue
        places.append(f"{across * 1e3:.3g} mm near {named_place(x.mean(axis=0))}")
        # the filling of the next hole must not use an edge of this one a third time
        taken.update(map(tuple, np.sort(edges_of(new), axis=1).tolist()))
        parts.append(new)
    more = "; ..." if len(places) > MOST_PLACES else ""
    notes = [f"small holes filled: {len(places)} ({'; '.join(places[:MOST_PLACES])}{more})"] if places else []
    return np.concatenate(parts), notes


def named_place(x: FloatArray) -> str:
    """A point for a message."""
    return f"({', '.join(f'{v:.4g}' for v in x)}) m of the file's frame"


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
    left, loops = set(range(len(border))), []
    for start in range(len(border)):
        if start not in left:
            continue
        left.remove(start)
        path = [int(border[start, 1]), int(border[start, 0])]
        while (here := path[-1]) != path[0] and (ways := [k for k in at[here] if k in left]):
            # one that runs the same way, if there is a choice: two holes may share a point
            k = min(ways, key=lambda k: (border[k, 1] != here, k))
            left.remove(k)
            path.append(int(border[k, 0] if border[k, 1] == here else border[k, 1]))
            loops += _closed_part(path)
    return loops


def _closed_part(path: list[int]) -> list[list[int]]:
    """Cut the loop that the last point of the ``path`` closes, if any; the path keeps the rest."""
    here = path.index(path[-1])
    if here == len(path) - 1:
        return []
    loop = path[here:-1]
    del path[here + 1 :]
    return [loop] if len(loop) > 2 else []


def filling(points: FloatArray, loop: list[int], taken: set[tuple[int, int]]) -> IntArray | None:
    """Triangles ``(n - 2, 3)`` of least area that close a loop of n points, or None where there are none.

    ``taken`` are edges (smaller number first) that already have two triangles or would get a third.
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
            best[i, j] = np.inf if length < n - 1 and chord in taken else cost.min()
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
