"""Contact frame: where the planar reading of a curved patch has its origin and its normal."""

from dataclasses import replace
from enum import IntFlag
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from softjaw.friction.foot import ContactFace, foot
from softjaw.friction.patch import CANCEL, NEGLIGIBLE, ContactPatch, FloatArray, NoContactError, cross, slivers

MAX_ITERATIONS = 100
STILL = 1e-12  # change of the unit normal at which the iteration ends
EQUAL = 1e-6  # relative difference of extents, and difference of components, that decide nothing
HALVED = 20  # passes after which the steps on a whole face are halved, again and again


class FrameFlag(IntFlag):
    """What the reader of a contact frame should know; flags add up."""

    CLEAN = 0
    CYCLE = 1  # origin and normal alternated between faces: the normal is their mean
    HOLE = 2  # the line through the centre of pressure meets no face: the nearest one was taken
    NO_CORNERS = 4  # the faces have no corners: the face with the nearest centre was taken
    ORIENTATION = 8  # neighbouring normals point to opposite sides: normal force and frame cannot be trusted
    OVERHANG = 16  # some loaded normals are more than 90 degrees away from the contact normal
    WINDING = 32  # the corners of some faces are wound against their normals, which were taken


class Frame(NamedTuple):
    """Right-handed frame of a contact.

    ``origin (3,)`` is the point of the contact area on the line through the ``centre_of_pressure (3,)``, the mean of
    the centres weighted with the loads, along the normal [m]; the rows of ``axes (3, 3)`` are x (along the hint), y and
    the contact normal z. ``iterations`` are the passes for both. ``overhang_count`` loaded faces, with
    ``overhang_share`` of the sum of the loads, have a normal that is more than 90 degrees from z.
    """

    origin: FloatArray
    axes: FloatArray
    iterations: int
    flag: FrameFlag
    centre_of_pressure: FloatArray
    overhang_count: int = 0
    overhang_share: float = 0.0


def contact_frame(patch: ContactPatch, x_hint: ArrayLike, whole_face: bool = False) -> Frame:
    """Origin O, normal N and axes of the contact, found together by iteration.

    The line through the centre of pressure along N meets the contact area in O; N is the mean normal of the faces
    that contain O. The first N is the mean normal weighted with the loads.

    Parameters
    ----------
    patch : ContactPatch
        ``n`` faces in any frame.
    x_hint : (3,) array
        Direction that becomes x after projection on the contact plane (the long side of the pad).
    whole_face : bool
        Whether the line may meet faces without load too, and the normal turns continuously from face to face, as
        `friction.foot.ContactFace` says. Frames of neighbouring grasps are then neighbours, also where the centre of
        pressure lies over a hole of the patch. By default faces without load are left out, as in the paper.

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
    # a sliver carries load, so it counts above; it has no plane, so nothing below can stand on it
    faces = faces.only(firm(faces))
    if whole_face:
        origin, N, iterations, flag = _on_the_whole(ContactFace.of(patch), cop, N)
    else:
        origin, N, iterations, flag = _on_faces(faces, cop, N)
    turned = behind(faces.normal, N)
    if turned.any():
        flag |= FrameFlag.OVERHANG
    side = wound(faces)
    # flipped normals make the winding differ too: the graver flag says it alone
    if opposing(faces, turned):
        flag |= FrameFlag.ORIENTATION
    elif side.min() < 0 < side.max():
        flag |= FrameFlag.WINDING
    share = float(faces.load[turned].sum() / S)
    return Frame(origin, _axes(N, x_hint), iterations, flag, cop, int(turned.sum()), share)


def principal_direction(patch: ContactPatch) -> FloatArray:
    """Direction ``(3,)`` in which the loaded faces extend most, across their mean normal.

    Where no direction is longer it is the file's axis that lies most nearly in the contact plane. Its largest component
    is positive; of equally large ones the first.
    """
    faces = patch.loaded
    N = faces.load @ faces.normal
    N = N / max(np.linalg.norm(N), np.finfo(float).tiny)
    across = np.eye(3) - np.outer(N, N)
    offset = (faces.centroid - faces.area @ faces.centroid / faces.area.sum()) @ across
    spread, directions = np.linalg.eigh(offset.T @ (faces.area[:, None] * offset))
    if spread[2] - spread[1] <= EQUAL * spread[2]:
        return np.eye(3)[np.argmax(np.abs(N) <= np.abs(N).min() + EQUAL)]
    longest = directions[:, 2]
    return longest * np.sign(longest[np.argmax(np.abs(longest) >= np.abs(longest).max() - EQUAL)])


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
        return float(np.ptp(faces.corners[..., :2].reshape(-1, 2), axis=0).max())
    # the area alone does not say which way a face is longer
    half = 0.5 * np.sqrt(faces.area)[:, None]
    xy = faces.centroid[:, :2]
    return float(((xy + half).max(axis=0) - (xy - half).min(axis=0)).max())


def _direction(vector: FloatArray, scale: float = 1.0) -> FloatArray:
    length = np.linalg.norm(vector)
    if length <= CANCEL * scale:
        text = "the normals of the patch cancel: check that all point to one side and that it is one side of an object"
        raise NoContactError(text)
    return vector / length


def _on_faces(faces: ContactPatch, cop: FloatArray, N: FloatArray) -> tuple[FloatArray, FloatArray, int, FrameFlag]:
    """Origin, normal, passes and flag on plane faces."""
    flag = FrameFlag.CLEAN if faces.corners is not None else FrameFlag.NO_CORNERS
    visited: list[tuple[int, ...]] = []
    for iterations in range(1, MAX_ITERATIONS + 1):
        origin, met, missed = foot(faces, cop, N)
        new = _direction(faces.normal[met].mean(axis=0))
        step, N = np.linalg.norm(new - N), new
        if step < STILL:
            break
        # the normal is a function of the faces that are met: one set twice is a cycle, without a tolerance
        key = tuple(met.tolist())
        if key in visited or iterations == MAX_ITERATIONS:
            # without a cycle in sight after all passes, every face that was met counts
            start = visited.index(key) if key in visited else 0
            N = _direction(faces.normal[sorted(set().union(*visited[start:]))].mean(axis=0))
            origin, met, missed = foot(faces, cop, N)
            flag |= FrameFlag.CYCLE
            break
        visited.append(key)
    if missed and faces.corners is not None:
        flag |= FrameFlag.HOLE
    return origin, N, iterations, flag


def _on_the_whole(face: ContactFace, cop: FloatArray, N: FloatArray) -> tuple[FloatArray, FloatArray, int, FrameFlag]:
    """Origin, normal, passes and flag on one surface; steps are halved where they lead to and fro."""
    flag, normals = FrameFlag.CLEAN, []
    for iterations in range(1, MAX_ITERATIONS + 1):
        origin, new, missed = face.foot(cop, N)
        step = new - N
        if np.linalg.norm(step) < STILL:
            break
        normals.append(new)
        N = _direction(N + 0.5 ** (iterations // HALVED) * step)
    if np.linalg.norm(step) > NEGLIGIBLE:  # still to and fro: the mean of the last normals
        N = _direction(np.mean(normals[-HALVED:], axis=0))
        origin, _, missed = face.foot(cop, N)
        flag |= FrameFlag.CYCLE
    return origin, N, iterations, flag | FrameFlag.HOLE * missed


def _axes(N: FloatArray, x_hint: ArrayLike) -> FloatArray:
    hint = np.asarray(x_hint, float)
    x = hint - (hint @ N) * N
    if np.linalg.norm(x) <= CANCEL * np.linalg.norm(hint):
        text = f"x_hint {hint.tolist()} is parallel to the contact normal {N.tolist()}: give another direction"
        raise ValueError(text)
    x = x / np.linalg.norm(x)
    return np.stack([x, cross(N, x), N])


ANGLE = 1e-6  # of a cosine: files in single precision know their directions to some 1e-7


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
    twice_area, error = faces.area_vectors
    along = np.einsum("ij,ij->i", twice_area, faces.normal)
    margin = np.maximum(error, ANGLE * np.linalg.norm(twice_area, axis=1))
    return (np.sign(along) * (np.abs(along) > margin)).astype(np.int8)


def firm(faces: ContactPatch) -> NDArray[np.bool_]:
    """Which faces are no slivers ``(n,)``: all without corners, and all where every one is a sliver."""
    if faces.corners is None:
        return np.ones(len(faces.area), dtype=bool)
    plane = ~slivers(*faces.area_vectors)
    return plane | ~plane.any()


def opposing(faces: ContactPatch, turned: NDArray[np.bool_]) -> bool:
    """Whether any of the ``turned`` faces opposes a face next to it by more than 120 degrees; undecided is no.

    A real overhang turns gradually from face to face; a flipped face opposes all its neighbours.
    """
    if not turned.any() or len(turned) == 1:
        return False
    tree, count = cKDTree(faces.centroid), min(5, len(turned))
    # all faces as far away as the last neighbour count, or which one does would hang on rounding
    reach = tree.query(faces.centroid[turned], k=[count])[0][:, 0] * (1 + 1e-6)
    pairs = zip(faces.normal[turned], tree.query_ball_point(faces.centroid[turned], reach), strict=True)
    # cosine between the normals of neighbours: a real overhang turns by less from face to face
    return any((faces.normal[some] @ n).min() < -0.5 - ANGLE for n, some in pairs)
