"""Places of grasps: which ones of a ranking are distinct, and where they lie in words of the object."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from softjaw.study.case.build import centroid_and_bounds
from softjaw.study.ranking import Place
from softjaw.study.result.read import scene_of
from softjaw.study.scene import SceneError
from softjaw.study.show.grasps import Index, axis_text, field, unravelled
from softjaw.study.units import shown_text

if TYPE_CHECKING:
    import xarray as xr  # slow to load, and a run needs it at its end only

SAME_EXTENT = 0.05  # relative difference of extents that makes no side the longer one
NEARBY = 1e-3  # from the centre of mass, within which a grasp is at it [m]
SIDES = ("broad sides", "narrow sides", "ends")  # of an object, by its extent between them
THIRD = 1 / 3  # of half an extent, beyond which a place is not in the middle
ALONG_AXIS = math.cos(math.radians(15.0))  # between a direction and an axis that is named instead


def folded_text(ds: xr.Dataset, place: Place) -> str:
    """What a line of a list represents besides its grasp."""
    parts = []
    if place.images:
        angles = [axis_text(ds, "angle", unravelled(i, ds.status.shape[:-1])[-1]) for i in place.images]
        parts.append(f"same at {', '.join(angles[:2])}{f' and {len(angles) - 2} more' * (len(angles) > 2)}")
    if place.near:
        parts.append(f"{len(place.near)} within {max(math.ceil(1e3 * place.within), 1)} mm")
    return ", ".join(parts)


def short_name(ds: xr.Dataset, candidate: int) -> str:
    """Name of a candidate in a list, which ``--candidate`` takes: p07 of poses, s07 of stations."""
    return f"{'p' if ds.attrs['poses'] else 's'}{candidate:02d}"


def named(ds: xr.Dataset) -> bool:
    """Whether somebody gave poses names."""
    return any(label != f"p{i:02d}" for i, label in enumerate(ds.label.values[..., 0].ravel()))


def spot(ds: xr.Dataset, index: Index) -> tuple[str, str]:
    """On which part of its object a grasp lies, and where from the centre of mass; empty where that is not known."""
    origin, turn = (field(ds, f"finger_pose_{name}") for name in ("origin", "rotation"))
    try:
        scene = scene_of(ds, index)
        body = ds.attrs if "object_bounds" in ds.attrs else centroid_and_bounds(scene.object)
    except (SceneError, ValueError, OSError, AttributeError):
        return "", ""
    if origin is None or turn is None or not np.isfinite(turn[index]).all():
        return "", ""
    middle, closing = origin[index].mean(axis=0), turn[index][0, :, 2]
    given = scene.task.centre_of_mass
    offset = middle - (body["object_centroid"] if given is None else np.array(given))
    bounds = np.reshape(body["object_bounds"], (2, 3))
    if ds.attrs["poses"]:
        part = _sides(bounds, middle, closing)
    else:
        along = int(np.abs(ds.attrs["object_rotation"][2::3]).argmax())
        alike = ", any angle alike" * (scene.axis_symmetry == 0)
        part = f"{_third(bounds, middle, [along])} of the object{alike}"
    return part, _beside(offset)


def _sides(bounds: np.ndarray, middle: np.ndarray, closing: np.ndarray) -> str:
    """On which sides of an object the pads press, and where on these."""
    axis, extents = int(np.abs(closing).argmax()), np.ptp(bounds, axis=0)
    if abs(closing[axis]) < ALONG_AXIS:
        return f"on the sides, closing {side_text(closing)}"
    rank = int(np.sum(extents < extents[axis] * (1 - SAME_EXTENT)))
    alone = np.sum(np.abs(extents - extents[axis]) <= SAME_EXTENT * extents[axis]) == 1
    third = _third(bounds, middle, [other for other in range(3) if other != axis])
    return f"{third} of the {SIDES[rank] if alone else 'sides'} facing {'xyz'[axis]}"


def _third(bounds: np.ndarray, middle: np.ndarray, axes: list[int]) -> str:
    """Where a point lies along the axis of some on which it is farthest off the middle.

    >>> _third(np.array([[0.0, 0, 0], [1, 1, 3]]), np.array([0.5, 0.4, 2.5]), [1, 2])
    'upper third'
    >>> _third(np.array([[0.0, 0, 0], [1, 1, 3]]), np.array([1.5, 0.4, 2.5]), [0, 1])
    'beyond the +x end'
    """
    share = (2 * middle - bounds.sum(axis=0)) / np.ptp(bounds, axis=0)
    axis = max(axes, key=lambda axis: abs(share[axis]))
    if abs(share[axis]) <= THIRD:
        return "middle"
    side = ("lower", "upper")[int(share[axis] > 0)] if axis == 2 else towards(axis, share[axis])
    return f"{side} third" if abs(share[axis]) <= 1.0 else f"beyond the {side} end"


def towards(axis: int, sign: float) -> str:
    """A direction along an axis."""
    return f"{'-' if sign < 0 else '+'}{'xyz'[axis]}"


def _beside(offset: np.ndarray) -> str:
    """Where the middle of the pads lies from the centre of mass [m].

    >>> _beside(np.array([0.0, -0.012, 0.003])), _beside(np.array([0.002, 0.0, 0.0]))
    ('3 mm above (+z) and 12 mm towards -y of the centre of mass', '2 mm towards +x of the centre of mass')
    """
    words = [f"towards {towards(axis, offset[axis])}" for axis in range(2)]
    words.append(f"{('below', 'above')[int(offset[2] > 0)]} ({towards(2, offset[2])})")
    far = [axis for axis in (2, 0, 1) if abs(offset[axis]) > NEARBY]
    parts = [f"{shown_text(abs(offset[axis]), 'm', 2)} {words[axis]}" for axis in far]
    if not parts:
        return "at the centre of mass"
    return f"{' and '.join(parts)} {'of ' * (far != [2])}the centre of mass"


def side_text(direction: np.ndarray) -> str:
    """From where something comes that moves in a direction.

    >>> side_text(np.array([0.0, 0, -1])), side_text(np.array([0.1, 1, 0])), side_text(np.array([0.8, 0.6, 0]))
    ('from above (+z)', 'from -y', 'along (0.8, 0.6, 0)')
    """
    axis = int(np.abs(direction).argmax())
    if abs(direction[axis]) < ALONG_AXIS * np.linalg.norm(direction):
        return f"along ({', '.join(f'{x + 0.0:.2g}' for x in np.round(direction, 2))})"
    side = towards(axis, -direction[axis])
    return f"from {side}" if axis < 2 else f"from {('below', 'above')[int(direction[2] < 0)]} ({side})"
