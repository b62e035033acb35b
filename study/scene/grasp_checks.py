"""What object, wall and grasp candidates must satisfy together, and grasps that are seldom meant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from softjaw.fem.objects.mesh_file import ENDINGS, LARGEST_FILE
from softjaw.study.scene.objects import Box, Mesh, Plate, Revolution, Sections, Shape, Span, Walled
from softjaw.study.scene.problems import Finding, KeyPath, shown
from softjaw.study.scene.sections import Candidates, Effects, GraspPose, Gripper

SMALLEST_MM, LARGEST_MM = 1.0, 2000.0
THICKEST = 0.1  # of the smallest extent: a thicker wall is no shell
NARROW = 0.01  # stations within this share of the object are all but one; in metres they would spread over it
WALL_KEYS = ("base_wall_mm", "young_modulus_gpa", "wall_poisson_ratio", "yield_strength_mpa", "allowed_dent_mm",
             "wall_heights_mm")  # fmt: skip
SIZE_KEYS = {
    "sphere": "radius_mm", "box": "size_mm", "plane": "thickness_mm", "revolution": "profile_mm",
    "sections": "sections",
}  # fmt: skip
CYLINDER_KEYS = {"x": "semi_axis_a_mm", "y": "semi_axis_b_mm", "z": "length_mm"}
WITH_ENDS = ("elliptic_cylinder", "box", "mesh", "revolution", "sections")


def object_findings(shape: Shape) -> Iterator[Finding]:
    """Extents outside 1 mm to 2 m are slips of the unit; edges cannot be rounder than the box is thick."""
    for axis, (low, high) in shape.spans_mm.items():
        extent = high - low
        if not SMALLEST_MM <= extent <= LARGEST_MM:
            meant, other = (extent * 1000, "metres") if extent < SMALLEST_MM else (extent / 1000, "micrometres")
            fits = SMALLEST_MM <= meant <= LARGEST_MM
            hint = f"the unit is mm: if {other} were meant, the extent is {meant:g} mm"
            key = SIZE_KEYS.get(shape.shape, CYLINDER_KEYS[axis])  # type: ignore[attr-defined]
            yield Finding(("object", key), f"an extent of {extent:g} mm along {axis}",
                          f"{SMALLEST_MM:g} mm to {LARGEST_MM / 1000:g} m",
                          hint if fits else "check the unit, which is mm")  # fmt: skip
            break
    if isinstance(shape, Box) and shape.edge_radius_mm > (most := min(shape.size_mm) / 2):
        yield Finding(("object", "edge_radius_mm"), f"{shape.edge_radius_mm:g} mm",
                      f"at most half the smallest size, {most:g} mm", f"write {most:g} or less")  # fmt: skip
    if isinstance(shape, Revolution):
        yield from _profile(shape.profile_mm)
    if isinstance(shape, Sections):
        yield from _sections(shape)


def _profile(points: Sequence[Span]) -> Iterator[Finding]:
    """An outline leads from one end to the other: z never falls, and only the ends may lie on the axis."""
    for i, (z, r) in enumerate(points):
        path = ("object", "profile_mm", i)
        if i and (z < points[i - 1][0] or (z, r) == points[i - 1]):
            found = f"[{z:g}, {r:g}] after [{', '.join(f'{v:g}' for v in points[i - 1])}]"
            yield Finding(path, found, "z to rise from point to point", "sort the points [z, radius] along the axis")
        at_end = i in (0, len(points) - 1)
        if r < 0 or (r == 0 and not at_end):
            expected = "a radius >= 0" if at_end else "a radius > 0 between the ends"
            yield Finding(path, f"radius {r:g} mm", expected, "write each point as [z, radius], in mm")


def _sections(shape: Sections) -> Iterator[Finding]:
    """Sections are stacked upwards; only the first and the last may end on the axis."""
    for i, (low, high) in enumerate(pairwise(shape.sections), 1):
        if high.z_mm <= low.z_mm:
            where, found = ("object", "sections", i, "z_mm"), f"z = {high.z_mm:g} after {low.z_mm:g} mm"
            yield Finding(where, found, "z to rise from section to section", "sort the sections from bottom to top")
    for i, section in enumerate(shape.sections[1:-1], 1):
        if section.a_mm == 0:
            where = ("object", "sections", i, "a_mm")
            yield Finding(where, "0 mm", "a semi-axis above 0 between the ends", "write the semi-axis along x, in mm")


def wall_findings(shape: Shape, effects: Effects) -> Iterator[Finding]:
    """Exactly one thickness, complete materials, and a wall where a shell is asked for."""
    hollow = isinstance(shape, Walled) and shape.wall is not None
    if effects.object.endswith("shell") and not hollow:
        yield Finding(("effects", "object"), f'"{effects.object}" with an object that has no wall',
                      "an object with a wall",
                      "add wall_mm to [object], for example `wall_mm = 0.4`, or write \"auto\"")  # fmt: skip
    if not isinstance(shape, Walled):
        return
    if shape.wall_mm is not None and shape.wall_profile_mm is not None:
        where = ("object", "wall_profile_mm")
        yield Finding(where, "wall_mm and wall_profile_mm", "one of them", "keep the one that is meant")
    for key in WALL_KEYS if not hollow else ():
        if getattr(shape, key, None) is not None:
            yield Finding(("object", key), f"{key} without a wall", "wall_mm beside it",
                          "add wall_mm, for example `wall_mm = 0.4`, or remove the key")  # fmt: skip
    if heights := getattr(shape, "wall_heights_mm", None):
        yield from _rising(("object", "wall_heights_mm"), heights, "two different heights, the lower first")
    if hollow:
        yield from _thickness(shape)
        missing = [k for k in ("young_modulus_gpa", "wall_poisson_ratio") if getattr(shape, k) is None]
        if shape.wall_material == "custom" and missing:
            example = "for example `young_modulus_gpa = 2.0` and `wall_poisson_ratio = 0.38`"
            yield Finding(("object", "wall_material"), f'"custom" without {" and ".join(missing)}', "both of them",
                          f"add {example}, or name a material")  # fmt: skip


def _thickness(shape: Walled) -> Iterator[Finding]:
    pairs = shape.wall_profile_mm or ()
    for i, (low, high) in enumerate(pairwise(pairs), 1):
        if high[0] <= low[0]:
            where, found = ("object", "wall_profile_mm", i), f"z = {high[0]:g} after {low[0]:g} mm"
            yield Finding(where, found, "z to rise from pair to pair", "sort the pairs [z, thickness] along the axis")
    most = THICKEST * min((high - low for low, high in shape.spans_mm.values()), default=math.inf)
    wrong = next((t for t in [t for _, t in pairs] or [shape.wall_mm] if not 0 < t <= most), None)
    if wrong is not None:
        remedy = "leave the wall out for an object that is as good as rigid" if wrong > 0 else "write it in mm"
        yield Finding(("object", "wall_profile_mm" if pairs else "wall_mm"), f"{wrong:g} mm",
                      f"a thickness above 0 and up to {most:g} mm, a tenth of the object's smallest extent",
                      remedy)  # fmt: skip


def _rising(path: KeyPath, pair: Sequence[float], expected: str) -> Iterator[Finding]:
    low, high = pair
    if low >= high:
        yield Finding(path, f"[{low:g}, {high:g}]", expected, f"write [{high:g}, {low:g}]")


def twice(path: KeyPath, values: Sequence[float]) -> Iterator[Finding]:
    """Values that are given more than once."""
    for value in sorted({v for v in values if values.count(v) > 1} if len(values) < 1000 else ()):
        yield Finding(path, f"{value:g} more than once", "each value once", "remove the repetition")


def candidate_findings(c: Candidates) -> Iterator[Finding]:
    """Exactly one way of saying where to grasp."""
    here = ("candidates",)
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
    if c.station_range_mm:
        expected = "two different stations, the lower first [mm]"
        yield from _rising((*here, "station_range_mm"), c.station_range_mm, expected)
    for key in ("stations_mm", "angles_deg"):
        yield from twice((*here, key), getattr(c, key) or ())
    for key in ("angles_deg", "roll_deg") if c.poses else ():
        if getattr(c, key) != Candidates.model_fields[key].default:
            remedy = "remove it; approach and long_side say how each pose is turned"
            yield Finding((*here, key), f"{key} beside explicit poses", "it with stations only", remedy)
    for i, pose in enumerate(c.poses):
        yield from _pose((*here, "poses", i), pose)


def _pose(here: KeyPath, pose: GraspPose) -> Iterator[Finding]:
    """Directions that do not fix a frame, points far from any object."""
    lengths = {key: math.hypot(*getattr(pose, key)) for key in ("approach", "long_side")}
    for key, length in lengths.items():
        if not 1e-6 <= length <= 1e6:
            yield Finding((*here, key), shown(list(getattr(pose, key))), "a direction", "write for example [1, 0, 0]")
            return
    cosine = sum(a * b for a, b in zip(pose.approach, pose.long_side, strict=True)) / math.prod(lengths.values())
    if abs(cosine) > 0.996:
        found, remedy = f"{shown(list(pose.long_side))}, along the approach", "the long side lies in the pad's face"
        yield Finding((*here, "long_side"), found, "a direction across the approach", remedy)
    if max(map(abs, pose.point_mm)) > LARGEST_MM:
        expected = f"a point within {LARGEST_MM:g} mm of the object's origin"
        yield Finding((*here, "point_mm"), shown(list(pose.point_mm)), expected, "check the unit, which is mm")


def station_findings(shape: Shape, candidates: Candidates) -> Iterator[Finding]:
    """Grasps beside the object, or along its faces, cannot touch it."""
    low, high = shape.spans_mm.get("z", (-math.inf, math.inf))
    outside = [s for s in candidates.station_values_mm if not low <= s <= high]
    if outside:
        found = f"{len(outside)} station{'s' * (len(outside) > 1)} beside the object: {_listed(outside)} mm"
        yield Finding(("candidates", _station_key(candidates)), found,
                      f"stations from {low:g} to {high:g} mm, where the object is",
                      "stations are coordinates along the object's axis, in mm")  # fmt: skip
    for angle in candidates.angles_deg if isinstance(shape, Plate) and candidates.station_values_mm else ():
        if abs(math.cos(math.radians(angle))) < 0.5:
            found, expected = f"{angle:g} degrees with two planes", "angles within 60 of 0 or 180: the planes face x"
            yield Finding(("candidates", "angles_deg"), found, expected, "write angles_deg = [0]")


def _station_key(candidates: Candidates) -> str:
    return "stations_mm" if candidates.stations_mm is not None else "station_range_mm"


def _listed(places: Sequence[float]) -> str:
    return ", ".join(f"{s:g}" for s in places[:4]) + (", ..." if len(places) > 4 else "")


def pose_findings(shape: Shape, candidates: Candidates, gripper: Gripper) -> Iterator[Finding]:
    """Pads that pass the box round the object miss the object too; those within it are tried when a run starts."""
    spans = shape.spans_mm
    for i, pose in enumerate(candidates.poses):
        frame = _pad_axes(pose)
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


def _pad_axes(pose: GraspPose) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Unit vectors along the pad's length and width; None where approach and long side do not fix them."""
    width = _cross(pose.approach, pose.long_side)
    length = _cross(width, pose.approach)
    sizes = math.hypot(*length), math.hypot(*width)
    if not all(1e-12 < s < 1e12 for s in sizes):
        return None
    return tuple(v / sizes[0] for v in length), tuple(v / sizes[1] for v in width)


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def mesh_file(shape: Mesh) -> Iterator[Finding]:
    """The mesh's file exists and can be one (its content is judged when it is read)."""
    file, path = Path(shape.mesh), ("object", "mesh")
    remedy = "the path is relative to the scene file"
    if file.suffix.lower() not in ENDINGS:
        yield Finding(path, shown(file.name), f"a triangle mesh in a {', '.join(ENDINGS)} file", "convert it to .stl")
    elif not file.is_file():
        found = "a directory" if file.is_dir() else "no such file"
        yield Finding(path, f"{found} at {file}", "the file of a triangle mesh", remedy)
    elif not (size := file.stat().st_size):
        yield Finding(path, f"an empty file at {file}", "the file of a triangle mesh", remedy)
    elif size > LARGEST_FILE:
        expected = f"at most {LARGEST_FILE >> 20} MiB"
        yield Finding(path, f"{size >> 20} MiB in {file}", expected, "decimate the mesh, or save it as binary .stl")


def station_warnings(shape: Shape, span: Span | None, candidates: Candidates, gripper: Gripper) -> Iterator[str]:
    """Sentences about the stations on an object that reaches from ``span[0]`` to ``span[1]`` along its axis [mm]."""
    places = candidates.station_values_mm
    if span is None or not places:
        return
    (low, high), half = span, half_extent_mm(candidates, gripper)
    spread = places[-1] - places[0]
    if len(places) > 1 and spread < NARROW * (high - low) and low <= 1000 * places[0] <= 1000 * places[-1] <= high:
        yield (
            f"candidates.{_station_key(candidates)}: {spread:.3g} mm between first and last station of an object of"
            f" {high - low:g} mm; metres? Then write {1000 * places[0]:g} to {1000 * places[-1]:g}"
        )
    slack = 1e-6 * (high - low)
    over = [s for s in places if s - half < low - slack or s + half > high + slack]
    if over and shape.shape in WITH_ENDS:
        yield (
            f"candidates: at {len(over)} of {len(places)} stations ({_listed(over)} mm) the pad, {2 * half:g} mm along"
            f" the object's axis, leaves the object, which reaches from {low:g} to {high:g} mm: it meets the edge"
        )


def half_extent_mm(candidates: Candidates, gripper: Gripper) -> float:
    """Half of what a pad covers along the object's axis [mm]."""
    along, across = abs(math.cos(candidates.roll)), abs(math.sin(candidates.roll))
    return (gripper.pad_length_mm * along + gripper.pad_width_mm * across) / 2
