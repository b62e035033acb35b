"""Both pads of a case: deformed faces with their pressure, sides, and friction's directions."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from softjaw.fem.objects.gap import Pose
from softjaw.friction.patch import NEGLIGIBLE
from softjaw.study.case.build import pad_shape
from softjaw.study.result.layout import DONE
from softjaw.study.show.grasps import Index, at

LIFT = 2e-4  # how far off the object contact faces are drawn, besides where they overlap it [m]
Faces = dict[str, np.ndarray]


class Pad(NamedTuple):
    """One finger's pad in the object's frame [m, Pa].

    ``face (i + 1, j + 1, 3)`` are the corners of the contact faces, ``back (4, 3)`` those of the moved back in the
    order of the face's corners; ``centroid`` and ``normal (i, j, 3)``, ``pressure`` and ``area (i, j)`` belong to the
    faces; they are empty where the file holds no patches. ``frame (3, 3)`` has the contact frame's axes as rows,
    ``origin (3,)`` is its origin; ``pose`` places the pad's own frame.
    Contact faces overlap the object between the points where contact holds: pictures draw them by ``lift`` farther out.
    """

    face: np.ndarray
    back: np.ndarray
    frame: np.ndarray
    origin: np.ndarray
    pose: Pose
    lift: float
    centroid: np.ndarray
    normal: np.ndarray
    pressure: np.ndarray
    area: np.ndarray

    @property
    def approach(self) -> np.ndarray:
        """Direction in which the finger closes ``(3,)``."""
        return self.pose.rotation[:, 2]

    @property
    def loaded(self) -> np.ndarray:
        """Faces that carry pressure ``(i, j)``."""
        return self.pressure > NEGLIGIBLE * self.pressure.max(initial=1e-300)

    def quads(self) -> np.ndarray:
        """Corners of the faces, ``(i j, 4, 3)``, in the order of the faces."""
        f = self.face
        return np.stack([f[:-1, :-1], f[1:, :-1], f[1:, 1:], f[:-1, 1:]], axis=2).reshape(-1, 4, 3)

    def pressed(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners ``(k, 4, 3)`` [mm] of the loaded faces as they are drawn, and their pressure ``(k,)`` [kPa]."""
        loaded = np.flatnonzero(self.loaded)
        return 1e3 * (self.quads()[loaded] - self.lift * self.approach), 1e-3 * self.pressure.ravel()[loaded]

    def rim(self) -> np.ndarray:
        """The face's border, once round ``(n, 3)``."""
        f = self.face
        return np.concatenate([f[:-1, 0], f[-1, :-1], f[:0:-1, -1], f[0, :0:-1]])

    def sides(self) -> np.ndarray:
        """Straight sides between the face's border and the back, and the back, as ``(k, 4, 3)``."""
        i, j = (n - 1 for n in self.face.shape[:2])
        b = self.back
        edges = zip(b, np.roll(b, -1, axis=0), (i, j, i, j), strict=True)
        behind = np.concatenate([np.linspace(p, q, n, endpoint=False) for p, q, n in edges])
        rim = self.rim()
        walls = np.stack([rim, np.roll(rim, -1, axis=0), np.roll(behind, -1, axis=0), behind], axis=1)
        return np.concatenate([walls, b[None]])

    def lines(self) -> np.ndarray:
        """Edges of the pad as segments ``(k, 2, 3)``."""
        rim, b = self.rim(), self.back
        corners = self.face[[0, -1, -1, 0], [0, 0, -1, -1]]
        pairs = [np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in (rim, b)]
        return np.concatenate([*pairs, np.stack([corners, b], axis=1)])

    def friction(self, motion: str) -> tuple[np.ndarray, np.ndarray]:
        """Where loaded faces are ``(k, 3)`` [m], and the force that each carries over the friction coefficient [N].

        Every face resists in its own plane (curved contact model): the force ``(k, 3)`` acts along the face's share of
        the slip ``motion``, along x or y of the contact frame or a turn about its normal. Of dense meshes every
        second, third, ... face is taken.
        """
        step = -(-max(*self.pressure.shape, 1) // 14)  # along the longer side of a pad, at most
        some = (slice(step // 2, None, step),) * 2
        loaded = self.loaded[some]
        c, n, load = self.centroid[some][loaded], self.normal[some][loaded], (self.pressure * self.area)[some][loaded]
        v = np.cross(self.frame[2], c - self.origin) if motion == "turn" else self.frame["xy".index(motion)]
        v = v - (v * n).sum(axis=1, keepdims=True) * n
        size = np.linalg.norm(v, axis=1, keepdims=True)
        return c, load[:, None] * np.divide(v, size, out=np.zeros_like(v), where=size > 1e-12)

    def arrows(self, motion: str, longest: float) -> np.ndarray:
        """`friction` as segments ``(k, 2, 3)`` [mm] off the faces; the largest force is ``longest`` [mm] long."""
        places, force = self.friction(motion)
        most = np.linalg.norm(force, axis=1).max(initial=1e-300)
        start = 1e3 * (places - (self.lift + 3 * LIFT) * self.approach)
        return np.stack([start, start + longest * force / most], axis=1)


def corners_of(centres: np.ndarray, per_side: int) -> np.ndarray:
    """Corners ``(i + 1, j + 1, c)`` of a grid of faces from their centres ``(i, j, c)``.

    They lie in the middle between centres. A face at a rim is as wide as the one on the other side of its element,
    along a side of which lie ``per_side``.
    """

    def rim(inner: np.ndarray) -> np.ndarray:
        """The corners before the first ones between faces."""
        return inner[0] - (inner[per_side - 1] - inner[per_side - 2])

    for axis in (0, 1):
        c = np.moveaxis(centres, axis, 0)
        inner = 0.5 * (c[:-1] + c[1:])
        centres = np.moveaxis(np.concatenate([[rim(inner)], inner, [rim(inner[::-1])]]), 0, axis)
    return centres


def pads_of(ds: xr.Dataset, gripper: Any, index: Index, faces: Faces) -> list[Pad]:
    """Both pads at a case with its stored ``faces``; empty where it is not solved or the scene cannot be read."""
    names = ("pose_rotation", "pose_origin", "closing", "frame_axes", "frame_origin")
    if at(ds, "status", index) != DONE or gripper is None:
        return []
    stored = [ds.variables[f"finger_{name}"].values[index] for name in names]
    if not all(np.isfinite(s).all() for s in stored):
        return []
    lifts = LIFT + np.nan_to_num(ds.variables["check_penetration_depth"].values[index])
    return [_pad(gripper, {n: v[k] for n, v in faces.items()}, lifts[k], *(s[k] for s in stored)) for k in (0, 1)]


def _pad(gripper: Any, faces: Faces, lift: Any, R: Any, o: Any, closing: Any, axes: Any, origin: Any) -> Pad:
    pose, (length, width, thickness) = Pose(R, o), gripper.pad_size
    x, y = 0.5 * length * np.array([-1, 1, 1, -1]), 0.5 * width * np.array([-1, -1, 1, 1])
    grid = pad_shape(gripper).patch_faces
    if not faces or faces["pressure"].size != np.prod(grid):  # only the block before it is pressed
        face = np.column_stack([x, y, np.zeros(4)])[[0, 3, 1, 2]].reshape(2, 2, 3)
        grid, faces = (0, 0), {name: np.empty(0) for name in ("centroid", "normal", "pressure", "area")}
    else:
        face = corners_of(faces["centroid"].reshape(*grid, 3), pad_shape(gripper).per_side)
    back = np.column_stack([x, y, np.full(4, closing - thickness)])
    centroid, normal = (faces[name].reshape(*grid, 3) for name in ("centroid", "normal"))
    return Pad(
        face=pose.to_object(face), back=pose.to_object(back), frame=axes @ R.T, origin=pose.to_object(origin),
        pose=pose, lift=lift, centroid=pose.to_object(centroid), normal=normal @ R.T,
        pressure=faces["pressure"].reshape(grid), area=faces["area"].reshape(grid),
    )  # fmt: skip
