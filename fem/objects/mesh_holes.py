"""Holes of a triangle mesh: loops of edges that border on one triangle only, and triangles that close them.

A small hole is filled by the triangulation of its loop that has the least area (Barequet and Sharir, 1995); no point
moves and none is added. A large one gets a lid, a fan about its middle, which only tells inside from outside.
"""

from __future__ import annotations

import numpy as np

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.gap import FloatArray, IntArray, edges_of

SMALL_HOLE, LARGEST_HOLE = 0.02, 0.5  # of the object's diagonal: smaller are filled, larger refused, others get a lid
FEW_SIDES, LARGEST_GAP = 4, 0.1  # a triangle or two that are missing are filled up to this share of the diagonal
MOST_PLACES = 3  # of defects that one note names
MOST_SIDES = 60  # of a loop that is filled without a new point: the effort grows with the cube


def without_holes(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray, np.ndarray, list[str]]:
    """Mesh with small holes filled and larger ones under lids, which triangles are lids ``(m,)``, and notes.

    Raises
    ------
    MeshError
        For a hole so large that it leaves open what is inside.
    """
    loops, size = border_loops(triangles), float(np.linalg.norm(np.ptp(points, axis=0)))
    if not loops:
        return points, triangles, np.zeros(len(triangles), dtype=bool), []
    sides = np.sort(edges_of(triangles), axis=1)
    taken = set(map(tuple, sides.tolist()))
    parts, is_lid = [triangles], [np.zeros(len(triangles), dtype=bool)]
    filled: list[str] = []
    covered: list[str] = []
    for loop in loops:
        x = points[loop]
        across, middle = float(np.linalg.norm(np.ptp(x, axis=0))), x.mean(axis=0)
        if across > LARGEST_HOLE * size:
            raise MeshError(
                f"the mesh is not closed: a hole of {across * 1e3:.3g} mm near {named_place(middle)} leaves open what "
                "is inside; fill it in a mesh editor, or give the object as a profile"
            )
        # a triangle or two that are missing can be meant in one way only, so these may be larger
        small = across <= (SMALL_HOLE if len(loop) > FEW_SIDES else LARGEST_GAP) * size
        new = filling(points, loop, taken) if small else None
        (covered if new is None else filled).append(f"{across * 1e3:.3g} mm near {named_place(middle)}")
        is_lid.append(np.full(len(loop) if new is None else len(new), not small))
        if new is None:
            centre, new = lid(points, loop)
            points = np.concatenate([points, centre[None]])
        # the filling of the next hole must not use an edge of this one a third time
        taken.update(map(tuple, np.sort(edges_of(new), axis=1).tolist()))
        parts.append(new)
    notes = [
        f"{what}: {len(where)} ({'; '.join(where[:MOST_PLACES])}{'; ...' if len(where) > MOST_PLACES else ''})"
        for what, where in (("small holes filled", filled), ("holes left open, where no pad may stand", covered))
        if where
    ]
    return points, np.concatenate(parts), np.concatenate(is_lid), notes


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
    if n > MOST_SIDES:
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
    found, spans = [], [(0, n - 1)]
    while spans:
        i, j = spans.pop()
        if j > i + 1:
            corner = int(cut[i, j])
            found.append((loop[i], loop[corner], loop[j]))
            spans += [(i, corner), (corner, j)]
    return np.array(found)


def lid(points: FloatArray, loop: list[int]) -> tuple[FloatArray, IntArray]:
    """Middle of a loop ``(3,)``, weighted by length, and the fan of triangles about it; it is point ``len(points)``."""
    x = points[loop]
    along = np.linalg.norm(np.roll(x, -1, axis=0) - x, axis=1)
    middle = np.average(0.5 * (x + np.roll(x, -1, axis=0)), axis=0, weights=along)
    return middle, np.stack([loop, np.roll(loop, -1), np.full(len(loop), len(points))], axis=1)
