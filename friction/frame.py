"""Contact frame: where the planar reading of a curved patch has its origin and its normal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntFlag

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from friction.patch import ContactPatch, FloatArray, NoContactError

MAX_ITERATIONS = 100
TOLERANCE = 1e-9  # of a face's size: a line through an edge belongs to both faces


class FrameFlag(IntFlag):
    """What the reader of a contact frame should know; flags add up."""

    CLEAN = 0
    CYCLE = 1  # origin and normal alternated between faces: the normal is their mean
    HOLE = 2  # the line through the centre of pressure meets no face: the nearest face was taken
    NO_CORNERS = 4  # the faces have no corners: the face with the nearest centre was taken
    ORIENTATION = 8  # neighbouring normals point to opposite sides: normal force and frame cannot be trusted
    OVERHANG = 16  # some loaded normals are more than 90 degrees away from the contact normal


@dataclass(frozen=True, eq=False)
class Frame:
    """Right-handed frame of a contact.

    Parameters
    ----------
    origin : (3,) array
        Point of the contact area on the line through the centre of pressure along the normal [m].
    axes : (3, 3) array
        Rows are x (along the hint), y and the contact normal z [-].
    iterations : int
        Passes of the iteration for origin and normal.
    flag : FrameFlag
        0 if nothing is unusual.
    centre_of_pressure : (3,) array
        Mean of the centres weighted with the loads [m].
    overhang_count : int
        Loaded faces whose normal is more than 90 degrees from z.
    overhang_share : float
        Their share of the sum of the loads [-].
    """

    origin: FloatArray
    axes: FloatArray
    iterations: int
    flag: FrameFlag
    centre_of_pressure: FloatArray
    overhang_count: int = 0
    overhang_share: float = 0.0


def contact_frame(patch: ContactPatch, x_hint: ArrayLike) -> Frame:
    """Origin O, normal N and axes of the contact, found together by iteration.

    The line through the centre of pressure along N meets the contact area in O; N is the mean normal of the faces
    that contain O. The first N is the mean normal weighted with the loads.

    Parameters
    ----------
    patch : ContactPatch
        ``n`` faces in any frame; faces without load are left out.
    x_hint : (3,) array
        Direction that becomes x after projection on the contact plane (the long side of the pad).

    Raises
    ------
    ValueError
        If the contact forces cancel or ``x_hint`` is parallel to the normal.
    """
    faces = patch.loaded
    load = faces.load
    S = load.sum()
    cop = (load[:, None] * faces.centroid).sum(axis=0) / S
    N = _direction((load[:, None] * faces.normal).sum(axis=0), S)
    flag = FrameFlag.CLEAN if faces.corners is not None else FrameFlag.NO_CORNERS
    visited: list[tuple[int, ...]] = []
    for iterations in range(1, MAX_ITERATIONS + 1):
        origin, met, missed = _foot(faces, cop, N)
        new = _direction(faces.normal[met].mean(axis=0))
        step, N = np.linalg.norm(new - N), new
        if step < 1e-12:
            break
        key = tuple(met.tolist())
        if key in visited or iterations == MAX_ITERATIONS:
            start = visited.index(key) if key in visited else 0
            union = sorted(set().union(*visited[start:]))
            N = _direction(faces.normal[union].mean(axis=0))
            origin, met, missed = _foot(faces, cop, N)
            flag |= FrameFlag.CYCLE
            break
        visited.append(key)
    if missed and faces.corners is not None:
        flag |= FrameFlag.HOLE
    below = faces.normal @ N < 0
    if below.any():
        flag |= FrameFlag.OVERHANG
    if _orientation_is_mixed(faces, below):
        flag |= FrameFlag.ORIENTATION
    share = float(load[below].sum() / S)
    return Frame(origin, _axes(N, x_hint), iterations, flag, cop, int(below.sum()), share)


def in_frame(patch: ContactPatch, frame: Frame) -> ContactPatch:
    """Patch in the coordinates of the contact frame, where all friction quantities are computed."""
    turn = frame.axes.T
    corners = None if patch.corners is None else (patch.corners - frame.origin) @ turn
    return replace(patch, centroid=(patch.centroid - frame.origin) @ turn, normal=patch.normal @ turn, corners=corners)


def contact_length(patch: ContactPatch) -> float:
    """Longer side ``rho`` of the rectangle around the loaded faces, along x and y of the contact frame [m].

    Without corners each face counts as a square of its area around its centre.
    """
    faces = patch.loaded
    if faces.corners is not None:
        points = faces.corners[..., :2].reshape(-1, 2)
        return float(np.ptp(points, axis=0).max())
    half = 0.5 * np.sqrt(faces.area)[:, None]
    xy = faces.centroid[:, :2]
    return float(((xy + half).max(axis=0) - (xy - half).min(axis=0)).max())


def _direction(vector: FloatArray, scale: float = 1.0) -> FloatArray:
    length = np.linalg.norm(vector)
    if length <= 1e-12 * scale:
        raise NoContactError(
            "the normals of the patch cancel, so the contact has no direction: check that all normals point to the "
            "same side and that the patch is one side of an object"
        )
    return vector / length


def _axes(N: FloatArray, x_hint: ArrayLike) -> FloatArray:
    hint = np.asarray(x_hint, float)
    x = hint - (hint @ N) * N
    if not np.linalg.norm(x) > 1e-9 * np.linalg.norm(hint):
        raise ValueError(
            f"x_hint {hint.tolist()} is parallel to the contact normal {N.tolist()}: give another direction"
        )
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(N, x), N])


def _foot(faces: ContactPatch, cop: FloatArray, N: FloatArray) -> tuple[FloatArray, np.ndarray, bool]:
    """Point where the line ``cop + s N`` meets the patch, the faces that hold it, and whether it met none."""
    offset = faces.centroid - cop
    along = offset @ N
    away = np.linalg.norm(offset - along[:, None] * N, axis=1)
    slope = faces.normal @ N
    steep = np.abs(slope) < 1e-9
    s = np.where(steep, along, (offset * faces.normal).sum(axis=1) / np.where(steep, 1.0, slope))
    met = np.array([], dtype=int) if faces.corners is None else _pierced(faces, cop, N, away, steep)
    if len(met):
        nearest = met[np.argmin(np.abs(s[met]))]
        q = faces.corners[met]
        warp = np.abs(((q - faces.centroid[met, None]) * faces.normal[met, None]).sum(axis=-1)).max(axis=1)
        size = np.ptp(q, axis=1).max(axis=1)
        met = met[np.abs(s[met] - s[nearest]) <= TOLERANCE * size + warp]
        return cop + s[nearest] * N, met, False
    met = np.flatnonzero(away <= away.min() + TOLERANCE * np.sqrt(faces.area.max()))
    return cop + s[met].mean() * N, met, True


def _pierced(faces: ContactPatch, cop: FloatArray, N: FloatArray, away: FloatArray, steep: np.ndarray) -> np.ndarray:
    """Faces, edges included, that the line through ``cop`` along ``N`` runs through."""
    offset = faces.corners - faces.centroid[:, None]
    reach = np.sqrt(np.einsum("ikj,ikj->ik", offset, offset).max(axis=1))
    near = np.flatnonzero((away <= (1 + 1e-6) * reach) & ~steep)
    if not len(near):
        return near
    across = np.linalg.svd(N[None])[2][1:]
    q = (faces.corners[near] - cop) @ across.T
    d = np.roll(q, -1, axis=1) - q
    side = d[..., 1] * q[..., 0] - d[..., 0] * q[..., 1]
    slack = TOLERANCE * reach[near, None] * np.linalg.norm(d, axis=-1)
    return near[(side >= -slack).all(axis=1) | (side <= slack).all(axis=1)]


def _orientation_is_mixed(faces: ContactPatch, below: np.ndarray) -> bool:
    """Whether some normals disagree with the mesh's winding, or oppose those of the faces next to them."""
    if faces.corners is not None:
        q = faces.corners
        last = min(3, q.shape[1] - 1)
        wound = np.einsum("ij,ij->i", np.cross(q[:, 2] - q[:, 0], q[:, last] - q[:, 1]), faces.normal)
        if (wound > 0).any() and (wound < 0).any():
            return True
    if not below.any() or len(below) == 1:
        return False
    # A real overhang turns gradually from face to face; a flipped face opposes all its neighbours.
    near = cKDTree(faces.centroid).query(faces.centroid[below], k=min(5, len(below)))[1]
    cosines = np.einsum("ij,ikj->ik", faces.normal[below], faces.normal[near])
    return bool((cosines < -0.5).any())
