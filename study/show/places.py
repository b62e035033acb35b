"""Places of grasps: which ones of a ranking are distinct, and where they lie in words of the object."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from softjaw.study.case.build import build_object, centre_of_mass, own_frame, surface_triangles
from softjaw.study.ranking import Place
from softjaw.study.scene import SceneError, parse_scene
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
    """Name of a candidate in a list, with the number that ``--candidate`` takes: p07 of poses, s07 of stations."""
    return f"{'p' if ds.attrs['poses'] else 's'}{candidate:02d}"


def named(ds: xr.Dataset) -> bool:
    """Whether somebody gave the poses names; those of the sampler have their coordinates as labels."""
    try:
        poses = parse_scene(ds.attrs["scene"], check_files=False).candidates.poses
    except SceneError:
        return True
    # Poses of a file are rounded, so some of their coordinates are too.
    given = [pose.label.replace("-0", "0") != pose.place.replace("-0", "0") for pose in poses if pose.label]
    return 2 * sum(given) > len(given)


class Spot(NamedTuple):
    """A grasp on its object: in words, and how far the centre of mass lies from the middle of the pads [m]."""

    words: str
    lever: float


def spot(ds: xr.Dataset, index: Index) -> Spot:
    """Where a grasp lies on its object; without words where the file does not tell the object."""
    origin, turn = (field(ds, f"finger_pose_{name}") for name in ("origin", "rotation"))
    try:
        scene = parse_scene(ds.attrs["scene"], check_files=False)
        scene = scene.with_values({key: v[i] for (key, v), i in zip(scene.sweep.items(), index, strict=False)})
        centre = centre_of_mass(scene, build_object(scene.object))
        frame, points = own_frame(scene.object), surface_triangles(scene.object)[0]
    except (SceneError, ValueError, OSError, AttributeError):
        return Spot("", math.nan)
    if origin is None or turn is None or not np.isfinite(turn[index]).all():
        return Spot("", math.nan)
    offset = frame.to_pad(origin[index].mean(axis=0)) - centre
    closing = frame.rotation.T @ turn[index][0, :, 2]
    offset -= (offset @ closing) * closing  # both fingers bear along it
    words = [_sides(np.ptp(points, axis=0), closing)] * bool(ds.attrs["poses"])
    return Spot(", ".join([*words, _beside(offset)]), float(np.linalg.norm(offset)))


def _sides(extents: np.ndarray, closing: np.ndarray) -> str:
    """Which sides of an object the pads press on."""
    axis = int(np.abs(closing).argmax())
    if abs(closing[axis]) < math.cos(math.radians(15.0)):
        return "across its edges"
    rank = int(np.sum(extents < extents[axis] * (1 - SAME_EXTENT)))
    alone = np.sum(np.abs(extents - extents[axis]) <= SAME_EXTENT * extents[axis]) == 1
    return f"on the {SIDES[rank] if alone else 'sides'} facing {'xyz'[axis]}"


def _beside(offset: np.ndarray) -> str:
    """Where the middle of the pads lies from the centre of mass [m].

    >>> _beside(np.array([0.0, -0.012, 0.003]))
    '12 mm towards -y of and 3 mm above the centre of mass'
    """
    parts = [f"{shown_text(abs(d), 'm', 2)} towards {'-' if d < 0 else '+'}{axis} of"
             for axis, d in zip("xy", offset[:2], strict=True) if abs(d) > NEARBY]  # fmt: skip
    if abs(offset[2]) > NEARBY:
        parts.append(f"{shown_text(abs(offset[2]), 'm', 2)} {'below' if offset[2] < 0 else 'above'}")
    return f"{' and '.join(parts) or 'at'} the centre of mass"


