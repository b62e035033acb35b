"""The scene kept in a result file, and outlines of its object in the plane of the fingers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softjaw.study.case.build import outer_surface
from softjaw.study.result.grid_surface import scene_at
from softjaw.study.scene import parse_scene
from softjaw.study.scene.problems import SceneError


def read_scene(text: str) -> Any:
    """The scene kept in a result file; None if this version cannot read it."""
    try:
        return parse_scene(text, check_files=False)
    except SceneError:
        return None


def swept_object(scene: Any, index: tuple[int, ...]) -> Any:
    """The object at this point of the sweep; None if the point is not one of this scene."""
    return getattr(scene_at(scene, index), "object", None)


def shape_outline(shape: Any, angle: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Heights and half widths along the approach at ``angle`` [rad] of a shape; None for meshes and plates."""
    c, s = abs(math.cos(angle)), abs(math.sin(angle))
    kind = getattr(shape, "shape", "")
    if kind == "revolution":
        return tuple(np.array(shape.profile).T)
    if kind == "sphere":
        t = np.linspace(-np.pi / 2, np.pi / 2, 121)
        return shape.radius * np.sin(t), shape.radius * np.cos(t)
    if kind == "elliptic_cylinder":
        half = math.hypot(shape.semi_axis_a * c, shape.semi_axis_b * s)
        return np.array([-0.5, 0.5]) * shape.length, np.full(2, half)
    if kind == "box":
        x, y, z = shape.size
        return np.array([-0.5, 0.5]) * z, np.full(2, 0.5 * (x * c + y * s))
    return _stacked_outline(shape, angle) if kind == "sections" else None


def _stacked_outline(shape: Any, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Heights and half widths of stacked sections along their wall."""
    surface = outer_surface(shape)[0]
    theta, s = np.meshgrid(np.linspace(0, 2 * np.pi, 73), np.linspace(*surface.wall, 161), indexing="ij")
    place = surface.jets(theta, s)[:, 0].reshape(*theta.shape, 3)
    along = place[..., 0] * math.cos(angle) + place[..., 1] * math.sin(angle)
    return place[0, :, 2], 0.5 * np.ptp(along, axis=0)
