"""Points on a limit surface: where a plane touches it, and a mesh of triangles over all of it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from softjaw.scoring.contact import Body

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
STEP = 1e-5  # of differences of a support function of size 1: rounding and bending both leave some 1e-10
THIN = 1e-9  # of the longest extent; what is thinner counts as flat


def ellipsoid_matrix(body: Body) -> FloatArray | None:
    """Symmetric ``A (3, 3)`` such that the body is the image of the unit ball under it; None if it is no ellipsoid."""
    if getattr(body, "degree", None) != 2:
        return None
    pairs = [(0, 1), (0, 2), (1, 2)]
    reach = body.support(np.eye(3))
    # Differences of scaled supports, so that a short axis keeps its digits beside long ones.
    scale = np.where(reach > 0, reach, 1.0)
    both = body.support([np.eye(3)[i] / scale[i] + np.eye(3)[j] / scale[j] for i, j in pairs])
    B = np.diag((reach / scale) ** 2)
    for (i, j), h in zip(pairs, both, strict=True):
        cross = (h**2 - B[i, i] - B[j, j]) / 2
        B[i, j] = B[j, i] = cross if abs(cross) > 1e-14 else 0.0
    B *= np.outer(scale, scale)
    if np.array_equal(B, np.diag(B.diagonal())):
        return np.diag(reach)
    values, vectors = np.linalg.eigh(B)
    return (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T


def touching_points(body: Body, t: ArrayLike) -> FloatArray:
    """A point of the body that is farthest in each direction, ``(m, 3) -> (m, 3)``."""
    T = np.atleast_2d(np.asarray(t, float))
    if hasattr(body, "vertices"):
        return np.asarray(body.vertices)[(T @ np.asarray(body.vertices).T).argmax(axis=1)]
    A = ellipsoid_matrix(body)
    if A is not None:
        felt = T @ A
        length = np.linalg.norm(felt, axis=1, keepdims=True)
        return felt / np.where(length > 0, length, 1.0) @ A
    if hasattr(body, "support_points"):
        return np.asarray(body.support_points(T))
    reach = body.support(np.eye(3))
    scale = 1 / np.where(reach > 0, reach, 1.0)
    S = T / scale
    S /= np.linalg.norm(S, axis=1, keepdims=True)
    steps = STEP * np.vstack([np.eye(3), -np.eye(3)])
    h = body.support(((S[None] + steps[:, None]) * scale).reshape(-1, 3)).reshape(6, len(S))
    return (h[:3] - h[3:]).T / (2 * STEP) / scale


def surface_mesh(body: Body, level: int) -> tuple[FloatArray, IntArray]:
    """Triangles inscribed in the body's surface, seen anticlockwise from outside.

    Parameters
    ----------
    body : Body
        A polytope, whose faces are returned whatever the level, or a smooth body.
    level : int
        Each level has four times as many triangles as the one before, 20 at level 0.

    Returns
    -------
    points : (k, 3) array
    triangles : (m, 3) array of int
    """
    if hasattr(body, "vertices"):
        return _hull_mesh(np.asarray(body.vertices, float))
    points, triangles = sphere_mesh(level)
    reach = body.support(np.eye(3))
    if hasattr(body, "radius") and (reach > 0).all():
        u = points * reach
        return u * np.asarray(body.radius(u))[:, None], triangles
    return touching_points(body, points / np.where(reach > 0, reach, 1.0)), triangles


def _hull_mesh(vertices: FloatArray) -> tuple[FloatArray, IntArray]:
    """Faces of the hull; a flat one is given a thickness of 1e-9, so that its rim has normals."""
    centre = vertices.mean(axis=0)
    _, extent, axes = np.linalg.svd(vertices - centre)
    extent = np.append(extent, np.zeros(3 - len(extent)))
    if extent[0] == 0:
        return vertices, np.zeros((0, 3), dtype=np.intp)
    flat = extent <= THIN * extent[0]
    axes = axes * np.where(flat, THIN * extent[0], extent)[:, None]
    points = np.vstack([vertices, centre + axes[flat], centre - axes[flat]])
    # Hulls turn with linear maps: made as thick as wide, the points cost Qhull no digits.
    round_points = np.linalg.solve(axes.T, (points - centre).T).T
    try:
        hull = ConvexHull(round_points)
    except QhullError:
        hull = ConvexHull(round_points, qhull_options="QJ")
    triangles = hull.simplices.astype(np.intp)
    a, b, c = (round_points[triangles[:, i]] for i in range(3))
    outward = hull.equations[:, :3] * np.sign(np.linalg.det(axes))
    inward = np.einsum("mi,mi->m", np.cross(b - a, c - a), outward) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    return points, triangles


@lru_cache(maxsize=8)
def sphere_mesh(level: int) -> tuple[FloatArray, IntArray]:
    """Icosahedron with every triangle split in four ``level`` times, corners on the unit sphere."""
    g = (1 + 5**0.5) / 2
    points = np.array([(s, t * g, 0.0) for s in (-1, 1) for t in (-1, 1)])
    points = np.vstack([np.roll(points, i, axis=1) for i in range(3)]) / np.hypot(1, g)
    triangles = _hull_mesh(points)[1]
    for _ in range(level):
        edges = np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        edges, place = np.unique(edges, axis=0, return_inverse=True)
        middle = points[edges].sum(axis=1)
        ab, bc, ca = place.reshape(3, -1) + len(points)
        points = np.vstack([points, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        a, b, c = triangles.T
        triangles = np.vstack([np.column_stack(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return points, triangles
