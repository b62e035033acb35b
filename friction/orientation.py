"""Which way the faces of a patch look: overhang, normals that oppose their neighbours, corners wound against them.

Every answer has a margin, so that none hangs on rounding; what lies inside of it is undecided and counts as stated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from softjaw.friction.patch import ContactPatch, FloatArray

ANGLE = 1e-6  # of a cosine: files in single precision know their directions to some 1e-7
SLIVER = 1e-9  # area of a face over the square of its size, below which it has no side
ROUNDING = 64 * np.finfo(float).eps  # of coordinates, which makes an area in proportion to a face's size
OPPOSED = -0.5  # cosine between the normals of neighbours: a real overhang turns by less from face to face
NEIGHBOURS = 4
TIED = 1e-6  # of a distance: faces as far away as the last neighbour are neighbours too


def behind(normal: FloatArray, N: FloatArray) -> NDArray[np.bool_]:
    """Which of the normals ``(n, 3)`` are more than 90 degrees from ``N``; undecided ones, at 90 degrees, are not."""
    return normal @ N < -ANGLE


def wound(faces: ContactPatch) -> NDArray[np.int8]:
    """Sense of the corners about the normal of each face ``(n,)``: 1, -1 against it, or 0 if it is undecided.

    Undecided are slivers, whose corners have no sense, faces that stand at 90 degrees to their normals, and faces
    without corners.
    """
    if faces.corners is None:
        return np.zeros(len(faces.area), dtype=np.int8)
    twice_area, error = _area_vectors(faces.corners)
    along = np.einsum("ij,ij->i", twice_area, faces.normal)
    margin = np.maximum(error, ANGLE * np.linalg.norm(twice_area, axis=1))
    return (np.sign(along) * (np.abs(along) > margin)).astype(np.int8)


def firm(faces: ContactPatch) -> NDArray[np.bool_]:
    """Which faces are no slivers ``(n,)``: all without corners, and all where every one is a sliver."""
    if faces.corners is None:
        return np.ones(len(faces.area), dtype=bool)
    found = ~slivers(faces.corners)
    return found | ~found.any()


def slivers(corners: FloatArray) -> NDArray[np.bool_]:
    """Which faces ``(n, k, 3)`` have no area, or none that could be told from rounding."""
    twice_area, error = _area_vectors(corners)
    return np.linalg.norm(twice_area, axis=1) <= error


def _area_vectors(q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Twice the area of each face along its normal, by the order of its corners, and what of it is no area."""
    last = min(3, q.shape[1] - 1)
    size = 2 * np.linalg.norm(q - q.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    error = (SLIVER * size + ROUNDING * np.linalg.norm(q, axis=2).max(axis=1)) * size
    return np.cross(q[:, 2] - q[:, 0], q[:, last] - q[:, 1]), error


def opposing(faces: ContactPatch, turned: NDArray[np.bool_]) -> bool:
    """Whether any of the ``turned`` faces opposes a face next to it by more than 120 degrees; undecided is no.

    A real overhang turns gradually from face to face; a flipped face opposes all its neighbours.
    """
    if not turned.any() or len(turned) == 1:
        return False
    tree, count = cKDTree(faces.centroid), min(NEIGHBOURS + 1, len(turned))
    reach = tree.query(faces.centroid[turned], k=[count])[0][:, 0] * (1 + TIED)
    near = tree.query_ball_point(faces.centroid[turned], reach)
    pairs = zip(faces.normal[turned], near, strict=True)
    return any((faces.normal[some] @ n).min() < OPPOSED - ANGLE for n, some in pairs)
