"""The volume that any triangles enclose: its centroid, as if it were full, with an estimate of the error.

Along a line that crosses closed surfaces each crossing adds to the winding number or takes from it, so that a point is
inside where it is positive: exact for parts that cross or contain each other. A line through a hole does not come back
to zero. So lines are cast along all three axes, and of each point those that come back decide.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from softjaw.fem.objects.gap import FloatArray, IntArray, solid_centroid

OFF_CENTRE = 0.5 + 1e-4 * np.sqrt(2.0)  # of a cell, where lines run: not through the corners of regular meshes


def centroid(points: FloatArray, triangles: IntArray, closed: bool) -> tuple[FloatArray, float]:
    """Centroid ``(3,)`` of the enclosed volume and an estimate of its error [m]; 0 for one closed piece.

    Parameters
    ----------
    points, triangles : (k, 3) array, (m, 3) int array
        Triangles that are turned as their neighbours [m].
    closed : bool
        Whether they are one closed surface, so that the divergence theorem holds.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if closed:
        return solid_centroid(points, triangles), 0.0
    step = float((high - low).max()) / 128  # cells along the longest side
    shape = np.maximum(np.ceil((high - low) / step).astype(int), 1)
    inside, known = _votes(points, triangles, low, step, shape)
    grid = low + step * (np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1) + OFF_CENTRE)
    if not (inside > 0.5).any():
        a, b, c = points[triangles].transpose(1, 0, 2)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return area @ (a + b + c) / (3 * area.sum()), float((high - low).max()) / 2
    # what no line decides, or lines disagree about, counts half in one estimate and not at all in the other
    sure, soft = (inside > 0.5).astype(float), np.where(known, inside, 0.5)
    first, second = (np.einsum("ijk,ijkd->d", share, grid) / share.sum() for share in (sure, soft))
    return first, float(np.linalg.norm(first - second)) + step / np.sqrt(sure.sum())


def _votes(
    points: FloatArray, triangles: IntArray, low: FloatArray, step: float, shape: IntArray
) -> tuple[FloatArray, np.ndarray]:
    """Share of the lines that call a grid's points inside, of those that decide, and where any decides."""
    votes, count = np.zeros(shape), np.zeros(shape)
    for axis in range(3):
        order = [(axis + 1) % 3, (axis + 2) % 3, axis]
        x = np.ascontiguousarray((points[:, order] - low[order]) / step - OFF_CENTRE)
        crossings = _crossings(x, triangles, *shape[order])
        turns, valid = np.cumsum(crossings[..., :-1], axis=2), crossings.sum(axis=2) == 0
        back = np.argsort(order)
        votes += np.transpose(np.where(valid[..., None], turns > 0, 0.0), back)
        count += np.transpose(np.broadcast_to(valid[..., None], turns.shape), back)
    return votes / np.maximum(count, 1.0), count > 0


@njit(cache=True)
def _crossings(x, triangles, rows, columns, layers):
    """Changes of the winding number along lines in z through whole numbers of x and y, at the next whole number."""
    change = np.zeros((rows, columns, layers + 1), np.int64)
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
                    k = int(np.ceil(u * a[2] + v * b[2] + w * c[2]))
                    # a surface that looks down is where the line comes in
                    change[i, j, min(max(k, 0), layers)] += 1 if area < 0.0 else -1
    return change
