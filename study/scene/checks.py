"""What the values of a scene must satisfy together: the object, the grasps on it, and the list of all checks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from softjaw.study.scene.effect_checks import coupling
from softjaw.study.scene.errors import Finding, shown
from softjaw.study.scene.file_checks import output_file, petsc_options
from softjaw.study.scene.gripper_checks import pad_material, pad_mesh, sheet
from softjaw.study.scene.limit_surface_checks import sampled_candidates, surface_choice, weight
from softjaw.study.scene.sections import Candidates, GraspPose, Gripper, Load
from softjaw.study.scene.shapes import Box, Plate, Revolution, Shape
from softjaw.study.scene.uncertainty_section import no_sweep, uncertainty_checks, wall_is_there
from softjaw.study.scene.wall_checks import sections, wall

SMALLEST_MM, LARGEST_MM, MOST_CASES = 1.0, 2000.0, 1_000_000


def object_size(shape: Shape) -> Iterator[Finding]:
    """Extents outside 1 mm to 2 m are slips of the unit."""
    for axis, (low, high) in shape.spans_mm.items():
        extent = high - low
        if not SMALLEST_MM <= extent <= LARGEST_MM:
            meant, other = (extent * 1000, "metres") if extent < SMALLEST_MM else (extent / 1000, "micrometres")
            remedy = f"the unit is mm: if {other} were meant, the extent is {meant:g} mm"
            if not SMALLEST_MM <= meant <= LARGEST_MM:
                remedy = "check the unit, which is mm"
            path, found = ("object", _size_key(shape, axis)), f"an extent of {extent:g} mm along {axis}"
            yield Finding(path, found, f"{SMALLEST_MM:g} mm to {LARGEST_MM / 1000:g} m", remedy)
            return


def _size_key(shape: Shape, axis: str) -> str:
    keys = {"sphere": "radius_mm", "box": "size_mm", "plane": "thickness_mm", "revolution": "profile_mm"}
    keys["sections"] = "sections"
    cylinder = {"x": "semi_axis_a_mm", "y": "semi_axis_b_mm", "z": "length_mm"}
    return keys.get(shape.shape, cylinder[axis])  # type: ignore[attr-defined]


def profile(shape: Shape) -> Iterator[Finding]:
    """An outline leads from one end to the other: z never falls, and only the ends may lie on the axis."""
    if not isinstance(shape, Revolution):
        return
    points = shape.profile_mm
    for i, (z, r) in enumerate(points):
        path = ("object", "profile_mm", i)
        if i and (z < points[i - 1][0] or (z, r) == points[i - 1]):
            found = f"[{z:g}, {r:g}] after [{', '.join(f'{v:g}' for v in points[i - 1])}]"
            yield Finding(path, found, "z to rise from point to point", "sort the points [z, radius] along the axis")
        at_end = i in (0, len(points) - 1)
        if r < 0 or (r == 0 and not at_end):
            expected = "a radius >= 0" if at_end else "a radius > 0 between the ends"
            yield Finding(path, f"radius {r:g} mm", expected, "write each point as [z, radius], in mm")


def box_edges(shape: Shape) -> Iterator[Finding]:
    """Edges cannot be rounder than the box is thick."""
    if isinstance(shape, Box) and shape.edge_radius_mm > min(shape.size_mm) / 2:
        most = min(shape.size_mm) / 2
        expected = f"at most half the smallest size, {most:g} mm"
        yield Finding(("object", "edge_radius_mm"), f"{shape.edge_radius_mm:g} mm", expected, f"write {most:g} or less")


def candidate_choice(candidates: Candidates) -> Iterator[Finding]:
    """Exactly one way of saying where to grasp."""
    c, here = candidates, ("candidates",)
    spread = c.stations is not None or c.station_range_mm is not None
    given = {"stations": spread, "stations_mm": c.stations_mm is not None, "poses": bool(c.poses)}
    ways = [way for way in given if given[way]]
    example = "for example `stations = 35` with `station_range_mm = [25, 175]`"
    if len(ways) != 1:
        expected = "one of stations_mm, stations with station_range_mm, or [[candidates.poses]]"
        found = " and ".join(ways) or "no grasp candidates"
        yield Finding((*here, *ways[-1:]), found, expected, "keep one of them" if ways else f"add one, {example}")
    if spread and (c.stations is None or c.station_range_mm is None):
        found, missing = ("stations", "station_range_mm") if c.stations else ("station_range_mm", "stations")
        yield Finding((*here, found), f"{found} alone", f"{missing} beside it", f"add {missing}, {example}")
    if c.station_range_mm and c.station_range_mm[0] >= c.station_range_mm[1]:
        low, high = c.station_range_mm
        path, found = (*here, "station_range_mm"), f"[{low:g}, {high:g}]"
        yield Finding(path, found, "two different stations, the lower first [mm]", f"write [{high:g}, {low:g}]")
    for key in ("stations_mm", "angles_deg"):
        yield from _twice((*here, key), getattr(c, key) or ())
    for key in ("angles_deg", "roll_deg") if c.poses else ():
        if getattr(c, key) != Candidates.model_fields[key].default:
            remedy = "remove it; approach and long_side say how each pose is turned"
            yield Finding((*here, key), f"{key} beside explicit poses", "it with stations only", remedy)


def _twice(path: tuple[str, ...], values: tuple[float, ...]) -> Iterator[Finding]:
    for value in sorted({v for v in values if values.count(v) > 1} if len(values) < 1000 else ()):
        yield Finding(path, f"{value:g} more than once", "each value once", "remove the repetition")


def stations_on_object(shape: Shape, candidates: Candidates) -> Iterator[Finding]:
    """Grasps beside the object, or along its faces, cannot touch it."""
    low, high = shape.spans_mm.get("z", (-math.inf, math.inf))
    outside = [s for s in candidates.station_values_mm if not low <= s <= high]
    if outside:
        key = "stations_mm" if candidates.stations_mm is not None else "station_range_mm"
        places = ", ".join(f"{s:g}" for s in outside[:4]) + (", ..." if len(outside) > 4 else "")
        found = f"{len(outside)} station{'s' * (len(outside) > 1)} beside the object: {places} mm"
        expected = f"stations from {low:g} to {high:g} mm, where the object is"
        remedy = "stations are coordinates along the object's axis, in mm"
        yield Finding(("candidates", key), found, expected, remedy)
    for angle in candidates.angles_deg if isinstance(shape, Plate) and candidates.station_values_mm else ():
        if abs(math.cos(math.radians(angle))) < 0.5:
            found, expected = f"{angle:g} degrees with two planes", "angles within 60 of 0 or 180: the planes face x"
            yield Finding(("candidates", "angles_deg"), found, expected, "write angles_deg = [0]")


def explicit_poses(candidates: Candidates) -> Iterator[Finding]:
    """Directions that do not fix a frame, points far from any object."""
    for i, pose in enumerate(candidates.poses):
        here = ("candidates", "poses", i)
        lengths = {key: math.hypot(*getattr(pose, key)) for key in ("approach", "long_side")}
        for key, length in lengths.items():
            if not 1e-6 <= length <= 1e6:
                found = shown(list(getattr(pose, key)))
                yield Finding((*here, key), found, "a direction", "write for example [1, 0, 0]")
                return
        cosine = sum(a * b for a, b in zip(pose.approach, pose.long_side, strict=True)) / math.prod(lengths.values())
        if abs(cosine) > 0.996:
            found, remedy = f"{shown(list(pose.long_side))}, along the approach", "the long side lies in the pad's face"
            yield Finding((*here, "long_side"), found, "a direction across the approach", remedy)
        if max(map(abs, pose.point_mm)) > LARGEST_MM:
            expected = f"a point within {LARGEST_MM:g} mm of the object's origin"
            yield Finding((*here, "point_mm"), shown(list(pose.point_mm)), expected, "check the unit, which is mm")


def poses_on_object(shape: Shape, candidates: Candidates, gripper: Gripper) -> Iterator[Finding]:
    """Pads that pass the box round the object miss the object too; those within it are tried when a run starts."""
    spans = shape.spans_mm
    for i, pose in enumerate(candidates.poses):
        frame = pose_axes(pose)
        if frame is None or len(spans) < 3 or max(map(abs, pose.point_mm)) > LARGEST_MM:
            continue
        for axis, size in zip(frame, (gripper.pad_length_mm, gripper.pad_width_mm), strict=True):
            off = sum((p - sum(spans[k]) / 2) * a for p, k, a in zip(pose.point_mm, "xyz", axis, strict=True))
            reach = sum((spans[k][1] - spans[k][0]) / 2 * abs(a) for k, a in zip("xyz", axis, strict=True)) + size / 2
            if abs(off) > reach:
                label = f" of '{pose.label}'" if pose.label else ""
                found = f"a pad{label} that passes the object at a distance of {abs(off) - reach:.3g} mm"
                remedy = "point_mm is in mm, in the frame in which the object's shape is given"
                yield Finding(("candidates", "poses", i, "point_mm"), found, "a pad that meets it", remedy)
                break


def pose_axes(pose: GraspPose) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Unit vectors along the pad's length and width; None where approach and long side do not fix them."""
    a, b = pose.approach, pose.long_side
    width = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    length = (width[1] * a[2] - width[2] * a[1], width[2] * a[0] - width[0] * a[2], width[0] * a[1] - width[1] * a[0])
    sizes = math.hypot(*length), math.hypot(*width)
    if not all(1e-12 < s < 1e12 for s in sizes):
        return None
    return tuple(v / sizes[0] for v in length), tuple(v / sizes[1] for v in width)


def forces(load: Load) -> Iterator[Finding]:
    """Every force once."""
    yield from _twice(("load", "normal_force_n"), load.normal_force_n)


CHECKS: tuple[tuple[tuple[str, ...], Callable[..., Iterator[Finding]]], ...] = (
    (("object",), object_size), (("object",), profile), (("object",), box_edges), (("gripper", "effects"), pad_mesh),
    (("gripper", "effects", "accuracy"), sheet),
    (("object", "effects"), coupling),
    (("gripper",), pad_material), (("candidates",), candidate_choice), (("object", "candidates"), stations_on_object),
    (("candidates",), explicit_poses), (("object", "candidates", "gripper"), poses_on_object), (("load",), forces),
    (("output",), output_file), (("petsc",), petsc_options), (("limit_surface", "effects"), surface_choice),
    (("limit_surface", "candidates"), sampled_candidates), (("task",), weight), (("object", "effects"), wall),
    (("object",), sections), (("uncertainty", "candidates", "friction"), uncertainty_checks),
    (("uncertainty", "object"), wall_is_there), (("uncertainty", "sweep"), no_sweep),
)  # fmt: skip


def findings(given: Mapping[str, Any]) -> list[Finding]:
    """Everything wrong with the sections that are there; a check whose sections are not all there is left out."""
    ready = [(names, check) for names, check in CHECKS if all(name in given for name in names)]
    return [finding for names, check in ready for finding in check(*(given[name] for name in names))]
