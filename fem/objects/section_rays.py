"""Where horizontal rays from a centre line leave a closed triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softjaw.fem.objects.gap import IntArray
from softjaw.fem.objects.pose import FloatArray

NO_AREA = 1e-12  # of the mesh's width squared: cuts that enclose less are empty


@dataclass(frozen=True)
class Rays:
    """Hits of ``n`` rays at each of ``k`` heights.

    Attributes
    ----------
    outer, inner : (k, n) arrays
        Distance from the centre to the last and to the first hit [m]; NaN where a ray hits nothing.
    hits : (k, n) array of int
        How often a ray crosses the surface: 1 everywhere if the section is star-shaped about its centre.
    """

    outer: FloatArray
    inner: FloatArray
    hits: IntArray


def sections(points: FloatArray, triangles: IntArray, z: FloatArray) -> tuple[FloatArray, IntArray]:
    """Segments ``(m, 2, 2)`` of the cuts at heights ``z (k,)``, counterclockwise about the material [m].

    Returned with the number ``(m,)`` of each one's cut. Points at a height itself count as above it, so the segments
    close up whatever a cut passes through.
    """
    order = np.argsort(z)
    first, last = (
        np.searchsorted(z[order], end, side="right")
        for end in (points[triangles, 2].min(axis=1), points[triangles, 2].max(axis=1))
    )
    which, place = _spread(first, last - first)
    cut, corner = order[place], triangles[which]
    above = points[corner, 2] >= z[cut][:, None]
    # the corner that is alone on its side, and the two others in the triangle's order
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    row = np.arange(len(cut))
    a, b, c = (corner[row, (alone + k) % 3] for k in range(3))
    ends = np.stack([_crossing(points, a, b, z[cut]), _crossing(points, a, c, z[cut])], axis=1)
    return np.where(above[row, alone][:, None, None], ends, ends[:, ::-1]), cut


def _spread(first: IntArray, many: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs (i, first[i] + j) for j below ``many[i]``."""
    which = np.repeat(np.arange(len(many)), many)
    return which, first[which] + np.arange(len(which)) - np.repeat(np.cumsum(many) - many, many)


def _crossing(points: FloatArray, i: IntArray, j: IntArray, z: FloatArray) -> FloatArray:
    """Places ``(m, 2)`` at which edges pass the heights; equal for both triangles of an edge to the last bit."""
    i, j = np.minimum(i, j), np.maximum(i, j)
    p, q = points[i], points[j]
    t = (z - p[:, 2]) / (q[:, 2] - p[:, 2])
    return p[:, :2] + t[:, None] * (q - p)[:, :2]


def centroids(points: FloatArray, triangles: IntArray, z: FloatArray) -> FloatArray:
    """Centroids ``(k, 2)`` of what the cuts at heights ``z (k,)`` enclose [m]; NaN for empty cuts."""
    segments, cut = sections(points, triangles, z)
    p, q = segments[:, 0], segments[:, 1]
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    total = lambda weight: np.bincount(cut, weight, minlength=len(z))  # noqa: E731
    area = total(3.0 * cross)
    area[np.abs(area) <= NO_AREA * np.ptp(points[:, :2], axis=0).max(initial=0.0) ** 2] = np.nan
    return np.stack([total(cross * (p + q)[:, axis]) / area for axis in (0, 1)], axis=1)


def cast(points: FloatArray, triangles: IntArray, z: FloatArray, centre: FloatArray, count: int) -> Rays:
    """Rays at heights ``z (k,)`` from ``centre (k, 2)`` at ``count`` even angles, the first along x."""
    segments, cut = sections(points, triangles, z)
    which, ray, distance = _hits(segments - centre[cut][:, None], count)
    place, size = cut[which] * count + ray, len(z) * count
    outer, inner = np.full(size, -np.inf), np.full(size, np.inf)
    np.maximum.at(outer, place, distance)
    np.minimum.at(inner, place, distance)
    hits = np.bincount(place, minlength=size)
    outer[hits == 0] = inner[hits == 0] = np.nan
    return Rays(*(v.reshape(len(z), count) for v in (outer, inner, hits)))


def _hits(segments: FloatArray, count: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Segments of ``(m, 2, 2)`` and numbers of the rays that cross them, with the distance from the origin [m]."""
    angle = np.arctan2(segments[..., 1], segments[..., 0]) * (count / (2 * np.pi))
    # half-open intervals of ray numbers: where two segments meet, a ray crosses only one of them
    first = np.ceil(angle).astype(np.int64)
    first[:, 1] -= np.round((angle[:, 1] - angle[:, 0]) / count).astype(np.int64) * count
    which, ray = _spread(first.min(axis=1), np.abs(first[:, 1] - first[:, 0]))
    c, s = np.cos(2 * np.pi / count * ray), np.sin(2 * np.pi / count * ray)
    p, d = segments[which, 0], (segments[:, 1] - segments[:, 0])[which]
    across = c * d[:, 1] - s * d[:, 0]
    distance = (p[:, 0] * d[:, 1] - p[:, 1] * d[:, 0]) / np.where(across == 0, np.inf, across)
    return which, ray % count, np.abs(distance)
