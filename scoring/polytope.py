"""Linearised limit surfaces: the vertices other programs use, and the volume and shadow of their hull."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

FloatArray = NDArray[np.float64]
FLAT = 1e-12


def graspit_vertices(semi_axes: ArrayLike) -> FloatArray:
    """The 20 vertices of GraspIt!'s soft contact, ``(20, 3)``.

    Directions at the latitudes 90, 45, 0, -45, -90 degrees with 1, 5, 8, 5, 1 points, pushed out radially to the
    ellipsoid.
    """
    rings = [(90, 1), (45, 5), (0, 8), (-45, 5), (-90, 1)]
    latitude = np.radians(np.concatenate([np.full(k, angle) for angle, k in rings]))
    longitude = np.concatenate([2 * np.pi * np.arange(k) / k for _, k in rings])
    u = np.column_stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    return u / np.linalg.norm(u / np.asarray(semi_axes, float), axis=1, keepdims=True)


def fibonacci_vertices(semi_axes: ArrayLike, m: int) -> FloatArray:
    """``m`` points spread evenly over the unit sphere and stretched to the ellipsoid, ``(m, 3)``."""
    i = np.arange(m)
    z = 1 - (2 * i + 1) / m
    phi = i * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z]) * np.asarray(semi_axes, float)


def polytope_volume(vertices: ArrayLike) -> tuple[float, float]:
    """Volume of the hull of the vertices ``(m, 3)`` and area of its shadow on the first two coordinates.

    Flat vertices give the volume 0, and vertices on a line through the shadow the area 0.
    """
    points = np.asarray(vertices, float)
    return hull_volume(points), hull_volume(points[:, :2])


def hull_volume(points: FloatArray) -> float:
    """Volume of the hull of points ``(m, d)``; 0 where they are flat, thinner than `FLAT` of their longest extent."""
    centred = points - points.mean(axis=0)
    _, extent, axes = np.linalg.svd(centred, full_matrices=False)
    if len(points) <= points.shape[1] or extent[-1] <= FLAT * extent[0]:
        return 0.0
    even = centred @ axes.T / extent  # Qhull loses facets of points that are much longer than wide
    try:
        return float(ConvexHull(even).volume * extent.prod())
    except QhullError:
        # Joggled input always gives a hull; its volume is off by 1e-6 to 1e-5.
        return float(ConvexHull(even, qhull_options="QJ").volume * extent.prod())
