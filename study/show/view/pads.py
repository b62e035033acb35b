"""Both pads of a case in the object's frame: deformed fronts with their pressure, sides, and friction's directions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softjaw.study.result.layout import DONE
from softjaw.study.result.vtkhdf import corners_of
from softjaw.study.show.data import Data

LIFT = 2e-4  # how far off the object its fronts are drawn, besides where they overlap it [m]
LOADED = 1e-9  # share of the largest pressure below which a face counts as free
MOTIONS = ("x", "y", "turn")
ARROWS = 14  # along the longer side of a pad, at most


@dataclass(frozen=True)
class Pad:
    """One finger's pad in the object's frame [m, Pa].

    ``front (i + 1, j + 1, 3)`` are the corners of the front's faces, ``back (4, 3)`` those of the moved back in the
    order of the front's corners; ``centroid`` and ``normal (i, j, 3)``, ``pressure`` and ``area (i, j)`` belong to the
    faces. The latter are None where the file holds no patches. ``frame (3, 3)`` has the contact frame's axes as rows,
    ``origin (3,)`` is its origin; ``rotation`` and ``position`` place the pad's own frame.
    Fronts overlap the object between the points where contact holds: pictures draw them by ``lift`` farther out.
    """

    front: np.ndarray
    back: np.ndarray
    frame: np.ndarray
    origin: np.ndarray
    rotation: np.ndarray
    position: np.ndarray
    lift: float = LIFT
    centroid: np.ndarray | None = None
    normal: np.ndarray | None = None
    pressure: np.ndarray | None = None
    area: np.ndarray | None = None

    @property
    def approach(self) -> np.ndarray:
        """Direction in which the finger closes ``(3,)``."""
        return self.rotation[:, 2]

    def own(self, x: np.ndarray) -> np.ndarray:
        """Points of the object's frame in the pad's frame."""
        return (x - self.position) @ self.rotation

    @property
    def loaded(self) -> np.ndarray:
        """Faces that carry pressure ``(i, j)``."""
        if self.pressure is None:
            return np.zeros((0, 0), bool)
        return self.pressure > LOADED * max(float(self.pressure.max()), 1e-300)

    def quads(self) -> np.ndarray:
        """Corners of the faces, ``(i j, 4, 3)``, in the order of the faces."""
        f = self.front
        return np.stack([f[:-1, :-1], f[1:, :-1], f[1:, 1:], f[:-1, 1:]], axis=2).reshape(-1, 4, 3)

    def rim(self) -> np.ndarray:
        """The front's border, once round ``(n, 3)``."""
        f = self.front
        return np.concatenate([f[:-1, 0], f[-1, :-1], f[:0:-1, -1], f[0, :0:-1]])

    def sides(self) -> np.ndarray:
        """Straight sides between the front's border and the back, and the back, as ``(k, 4, 3)``."""
        i, j = (n - 1 for n in self.front.shape[:2])
        b = self.back
        edges = [(b[k], b[(k + 1) % 4], (i, j, i, j)[k]) for k in range(4)]
        behind = np.concatenate([p + (q - p) * np.arange(n)[:, None] / n for p, q, n in edges])
        rim = self.rim()
        walls = np.stack([rim, np.roll(rim, -1, axis=0), np.roll(behind, -1, axis=0), behind], axis=1)
        return np.concatenate([walls, b[None]])

    def lines(self) -> np.ndarray:
        """Edges of the pad as segments ``(k, 2, 3)``."""
        rim, b = self.rim(), self.back
        corners = self.front[[0, -1, -1, 0], [0, 0, -1, -1]]
        pairs = [np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in (rim, b)]
        return np.concatenate([*pairs, np.stack([corners, b], axis=1)])

    def arrows(self, motion: str) -> tuple[np.ndarray, np.ndarray]:
        """Where loaded faces are ``(k, 3)`` [m], and the force that each carries over the friction coefficient [N].

        Every face resists in its own plane (curved contact model): the force ``(k, 3)`` acts along the face's share of
        the slip ``motion``, along x or y of the contact frame or a turn about its normal. Of dense meshes every
        second, third, ... face is taken.
        """
        if self.centroid is None or self.normal is None or self.pressure is None or self.area is None:
            return np.empty((0, 3)), np.empty((0, 3))
        step = -(-max(self.pressure.shape) // ARROWS)
        some = (slice(step // 2, None, step),) * 2
        loaded = self.loaded[some]
        c, n, load = self.centroid[some][loaded], self.normal[some][loaded], (self.pressure * self.area)[some][loaded]
        if motion == "turn":
            v = np.cross(self.frame[2], c - self.origin)
        else:
            v = np.broadcast_to(self.frame[MOTIONS.index(motion)], c.shape)
        v = v - np.einsum("ki,ki->k", v, n)[:, None] * n
        size = np.linalg.norm(v, axis=1, keepdims=True)
        return c, load[:, None] * np.divide(v, size, out=np.zeros_like(v), where=size > 1e-12)


def pads(data: Data, gripper: Any, index: tuple[int, ...]) -> list[Pad]:
    """Both pads at a case; empty where it is not solved or the scene cannot be read."""
    names = ("pose_rotation", "pose_origin", "closing", "frame_axes", "frame_origin")
    stored = [data.values(f"fingers/{name}") for name in names]
    if data.status[index] != DONE or gripper is None or any(s is None for s in stored):
        return []
    if not all(np.isfinite(s[index]).all() for s in stored if s is not None):
        return []
    patch = data.result.patch(data.result.row(*index)) if data.result.layout.patches else {}
    if any(not np.isfinite(values).all() for values in patch.values()):
        patch = {}
    overlap = data.values("checks/penetration_depth")
    deepest = np.zeros(2) if overlap is None else np.nan_to_num(overlap[index])
    of_finger = [[s[index][finger] for s in stored if s is not None] for finger in (0, 1)]
    found = [_pad(gripper, {n: v[finger] for n, v in patch.items()}, *of_finger[finger]) for finger in (0, 1)]
    return [replace(pad, lift=LIFT + float(depth)) for pad, depth in zip(found, deepest, strict=True)]


def faces_of(gripper: Any, count: int) -> tuple[int, int] | None:
    """Faces of a patch along and across the pad; None if ``count`` is not that of this mesh."""
    per_side = 3 if gripper.element == "hex27" else 2
    i, j = (per_side * n for n in gripper.elements[:2])
    return (i, j) if i * j == count else None


def _pad(gripper: Any, patch: dict[str, np.ndarray], R: Any, o: Any, closing: Any, axes: Any, origin: Any) -> Pad:
    length, width, thickness = gripper.pad_size
    x, y = 0.5 * length * np.array([-1, 1, 1, -1]), 0.5 * width * np.array([-1, -1, 1, 1])

    def placed(points: np.ndarray) -> np.ndarray:
        return points @ R.T + o

    back = placed(np.column_stack([x, y, np.full(4, closing - thickness)]))
    grid = faces_of(gripper, len(patch["pressure"])) if patch else None
    common = {"back": back, "frame": axes @ R.T, "origin": placed(origin), "rotation": R, "position": o}
    if grid is None:  # only the block before it is pressed
        flat = np.column_stack([x, y, np.zeros(4)])[[0, 3, 1, 2]].reshape(2, 2, 3)
        return Pad(front=placed(flat), **common)
    front = corners_of(patch["centroid"].reshape(*grid, 3))
    return Pad(
        front=placed(front),
        **common,
        centroid=placed(patch["centroid"]).reshape(*grid, 3),
        normal=(patch["normal"] @ R.T).reshape(*grid, 3),
        pressure=patch["pressure"].reshape(grid),
        area=patch["area"].reshape(grid),
    )
