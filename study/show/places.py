"""Places of grasps: which ones of a ranking are distinct, and where they lie in words of the object."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from softjaw.study.case.build import build_object, centre_of_mass, own_frame, surface_triangles
from softjaw.study.ranking import Place
from softjaw.study.result.read import scene_of
from softjaw.study.scene import SceneError
from softjaw.study.show.grasps import Index, axis_text, field, unravelled
from softjaw.study.units import shown_text

SAME_EXTENT = 0.05  # relative difference of extents that makes no side the longer one
NEARBY = 1e-3  # from the centre of mass, within which a grasp is at it [m]
SIDES = ("broad sides", "narrow sides", "ends")  # of an object, by its extent between them


def folded_text(ds: xr.Dataset, place: Place) -> str:
    """What a line of a list stands for besides its grasp."""
    parts = []
    if place.images:
        angles = [axis_text(ds, "angle", unravelled(i, ds.status.shape[:-1])[-1]) for i in place.images]
        parts.append(f"same at {', '.join(angles[:2])}{f' and {len(angles) - 2} more' * (len(angles) > 2)}")
    if place.near:
        parts.append(f"and {len(place.near)} within {max(math.ceil(1e3 * place.within), 1)} mm")
    return ", ".join(parts)


def short_name(ds: xr.Dataset, candidate: int) -> str:
    """Name of a candidate in a list, which ``--candidate`` takes: p07 of poses, s07 of stations."""
    return f"{'p' if ds.attrs['poses'] else 's'}{candidate:02d}"


def named(ds: xr.Dataset) -> bool:
    """Whether somebody gave poses names."""
    return any(label != f"p{i:02d}" for i, label in enumerate(ds.label.values[..., 0].ravel()))


class Spot(NamedTuple):
    """A grasp on its object in words, the sides of poses alone, and how far the weight is from the pads' middle [m]."""

    sides: str
    beside: str
    lever: float


def spot(ds: xr.Dataset, index: Index) -> Spot:
    """Where a grasp lies on its object; without words where the file does not tell the object."""
    origin, turn = (field(ds, f"finger_pose_{name}") for name in ("origin", "rotation"))
    try:
        scene = scene_of(ds, index)
        centre = centre_of_mass(scene, build_object(scene.object))
        frame, points = own_frame(scene.object), surface_triangles(scene.object)[0]
    except (SceneError, ValueError, OSError, AttributeError):
        return Spot("", "", math.nan)
    if origin is None or turn is None or not np.isfinite(turn[index]).all():
        return Spot("", "", math.nan)
    offset = origin[index].mean(axis=0) - frame.to_object(centre)
    closing = turn[index][0, :, 2]
    half = 0.5 * abs(np.diff(origin[index], axis=0)[0] @ closing)
    offset -= np.clip(offset @ closing, -half, half) * closing  # between the fingers both bear along it
    sides = _sides(np.ptp(frame.to_object(points), axis=0), closing) if ds.attrs["poses"] else ""
    vector = ", ".join(f"{x + 0.0:.2g}" for x in np.round(closing, 2))
    closes = f"closing along ({vector}), " * (sides == "on the sides")  # where no axis says it
    return Spot(sides, closes + _beside(offset), float(np.linalg.norm(offset)))


def _sides(extents: np.ndarray, closing: np.ndarray) -> str:
    """Which sides of an object the pads press on."""
    axis = int(np.abs(closing).argmax())
    if abs(closing[axis]) < math.cos(math.radians(15.0)):
        return "on the sides"
    rank = int(np.sum(extents < extents[axis] * (1 - SAME_EXTENT)))
    alone = np.sum(np.abs(extents - extents[axis]) <= SAME_EXTENT * extents[axis]) == 1
    return f"on the {SIDES[rank] if alone else 'sides'} facing {'xyz'[axis]}"


def _beside(offset: np.ndarray) -> str:
    """Where the middle of the pads lies from the centre of mass [m].

    >>> _beside(np.array([0.0, -0.012, 0.003]))
    '12 mm towards -y and 3 mm towards +z of the centre of mass'
    """
    parts = [f"{shown_text(abs(d), 'm', 2)} towards {'-' if d < 0 else '+'}{axis}"
             for axis, d in zip("xyz", offset, strict=True) if abs(d) > NEARBY]  # fmt: skip
    return f"{' and '.join(parts)} of the centre of mass" if parts else "at the centre of mass"


