"""The contact patch of a pressed pad: faces of the deformed front with their pressures, unfolded to the whole pad."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem.pad import Pad, PadShape
from fem.press import Pressed
from friction.patch import ContactPatch

FloatArray = NDArray[np.float64]


def patch_faces(shape: PadShape) -> tuple[int, int]:
    """Number of patch faces along the pad's length and width: one per hexahedron of the front."""
    return shape.elements[0], shape.elements[1]


def extract(pad: Pad, pressed: Pressed) -> ContactPatch:
    """Faces of the whole pad's front at this state, in the pad's frame at first touch.

    A face's load is the contact force ``f = int p n dA`` of the solution over that face: ``pressure * area * normal = f``
    with the deformed area, so that the loads of all faces add up to the normal force exactly.  An unloaded face keeps the
    normal of the deformed face.  All normals point into the object.  Faces are numbered along the width first, and
    their number does not depend on symmetry.
    """
    step = 1 if pad.shape.element == "hex8" else 2
    position = _unfold(pad, pressed.front.reshape(*pad.front_grid, 3), shared=True)[::step, ::step]
    force = _unfold(pad, pressed.face_force.reshape(*_face_grid(pad), 3), shared=False).reshape(-1, 3)
    corners = np.stack(
        [position[:-1, :-1], position[1:, :-1], position[1:, 1:], position[:-1, 1:]], axis=2
    ).reshape(-1, 4, 3)
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    area = 0.5 * np.linalg.norm(across, axis=1)
    load = np.linalg.norm(force, axis=1)
    # a face that touches nothing may carry a rounding error, in any direction
    loaded = load > 1e-12 * load.max(initial=0.0)
    normal = np.where(loaded[:, None], force / np.maximum(load, 1e-300)[:, None], across / (2.0 * area[:, None]))
    return ContactPatch(
        centroid=corners.mean(axis=1), area=area, normal=normal, pressure=np.where(loaded, load / area, 0.0), corners=corners
    )


def _face_grid(pad: Pad) -> tuple[int, int]:
    """Number of meshed faces of the front along x and y."""
    return tuple(n // 2 if half else n for n, half in zip(pad.shape.elements, pad.symmetry, strict=False))


def _unfold(pad: Pad, grid: FloatArray, shared: bool) -> FloatArray:
    """Mirror a grid of vectors ``(i, j, 3)`` to the whole pad; ``shared`` where the first row lies on the mirror itself."""
    for axis in range(2):
        if pad.symmetry[axis]:
            mirrored = np.flip(grid, axis).copy()
            mirrored[..., axis] *= -1.0
            grid = np.concatenate([np.delete(mirrored, -1, axis) if shared else mirrored, grid], axis)
    return grid
