"""Outline of the object in the plane of the fingers: from the scene's shape, or from distances that were measured."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softjaw.study.quantities import ALONG, AROUND
from softjaw.study.show.data import Data

Outline = tuple[np.ndarray, np.ndarray, bool]


def read_scene(text: str) -> Any:
    """The scene kept in a result file; None if this version cannot read it."""
    from softjaw.study.scene import parse_scene
    from softjaw.study.scene.problems import SceneError

    try:
        return parse_scene(text, check_files=False)
    except SceneError:
        return None


def outline(data: Data, scene: Any, index: tuple[int, ...]) -> Outline | None:
    """Heights z ``(k,)``, half widths along the approach ``(k,)`` [m], and whether they are the shape's own."""
    angle = float(data.axes[-2].values[index[-2]])
    found = shape_outline(swept_object(scene, index), angle) if scene else None
    return (*found, True) if found else _measured(data, index)


def swept_object(scene: Any, index: tuple[int, ...]) -> Any:
    """The object at this point of the sweep; None if it cannot be told."""
    from softjaw.study.scene.problems import SceneError

    try:
        if any(any(isinstance(v, str) for v in values) for values in scene.sweep.values()):
            return None
        point = {key: values[i] for (key, values), i in zip(scene.sweep.items(), index, strict=False)}
        return scene.with_values(point).object
    except (SceneError, IndexError):
        return None


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
    from softjaw.study.case.build import outer_surface

    surface = outer_surface(shape)[0]
    theta, s = np.meshgrid(np.linspace(0, 2 * np.pi, 73), np.linspace(*surface.wall, 161), indexing="ij")
    place = surface.jets(theta, s)[:, 0].reshape(*theta.shape, 3)
    along = place[..., 0] * math.cos(angle) + place[..., 1] * math.sin(angle)
    return place[0, :, 2], 0.5 * np.ptp(along, axis=0)


def undeformed(scene: Any, index: tuple[int, ...], angle: float) -> np.ndarray | None:
    """Outer face ``(AROUND, ALONG, 3)`` before anything presses [m], at the places that a file stores.

    ``angle`` is finger 1's about the axis [rad].
    """
    from softjaw.study.case.build import outer_surface

    shape = swept_object(scene, index) if scene else None
    if shape is None:
        return None
    try:
        surface = outer_surface(shape)[0]
    except (AttributeError, OSError, ValueError):
        return None
    end = surface.wall[1] if shape.open_top else surface.end
    around = angle + 2 * np.pi * np.arange(AROUND) / AROUND
    theta, s = np.meshgrid(around, np.linspace(0.0, end, ALONG), indexing="ij")
    return surface.jets(theta, s)[:, 0].reshape(AROUND, ALONG, 3)


def _measured(data: Data, index: tuple[int, ...]) -> Outline | None:
    width = data.map("contact_distance")
    if width is None:
        return None
    half = 0.5 * width[(*index[:-3], slice(None), *index[-2:])]
    known = np.flatnonzero(np.isfinite(half))
    z = data.axes[-3].values[known]
    if not known.size:
        return None
    return (z[[0, 0]] + [-0.01, 0.01], half[known[[0, 0]]], False) if known.size == 1 else (z, half[known], False)


def pad_extent(scene: Any, axis: Any) -> tuple[float, float]:
    """Length of the pads along the object's axis as they are rolled, and their thickness [m]."""
    gripper, roll = scene.gripper, scene.candidates.roll
    along = abs(math.cos(roll)) * gripper.pad_length + abs(math.sin(roll)) * gripper.pad_width
    return along, gripper.pad_thickness


def slice_polygon(z: np.ndarray, radius: np.ndarray, low: float, high: float) -> np.ndarray | None:
    """Part of the outline between two heights as a polygon in mm; None where the object is not."""
    low, high = max(low, z[0]), min(high, z[-1])
    if low >= high:
        return None
    inside = z[(z > low) & (z < high)]
    at = np.concatenate([[low], inside, [high]])
    r = np.interp(at, z, radius)
    return 1e3 * np.concatenate([np.stack([at, r], axis=1), np.stack([at, -r], axis=1)[::-1]])
