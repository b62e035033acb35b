"""Grasps that a scene may ask for and that are seldom meant: pads over the object's end, stations in a wrong unit."""

from __future__ import annotations

import math
from collections.abc import Iterator

from softjaw.study.scene.sections import Candidates, Gripper
from softjaw.study.scene.shapes import Shape, Span

WITH_ENDS = ("elliptic_cylinder", "box", "mesh", "revolution", "sections")
NARROW = 0.01  # stations within this share of the object are all but one; in metres they would spread over it


def station_warnings(shape: Shape, span: Span | None, candidates: Candidates, gripper: Gripper) -> Iterator[str]:
    """Sentences about the stations on an object that reaches from ``span[0]`` to ``span[1]`` along its axis [mm]."""
    places = candidates.station_values_mm
    if span is None or not places:
        return
    (low, high), half = span, half_extent_mm(candidates, gripper)
    spread = places[-1] - places[0]
    if len(places) > 1 and spread < NARROW * (high - low) and low <= 1000 * places[0] <= 1000 * places[-1] <= high:
        key = "stations_mm" if candidates.stations_mm is not None else "station_range_mm"
        yield (
            f"candidates.{key}: {spread:.3g} mm between first and last station of an object of {high - low:g} mm;"
            f" metres? Then write {1000 * places[0]:g} to {1000 * places[-1]:g}"
        )
    slack = 1e-6 * (high - low)
    over = [s for s in places if s - half < low - slack or s + half > high + slack]
    if over and shape.shape in WITH_ENDS:
        listed = ", ".join(f"{s:g}" for s in over[:4]) + (", ..." if len(over) > 4 else "")
        yield (
            f"candidates: at {len(over)} of {len(places)} stations ({listed} mm) the pad, {2 * half:g} mm along the"
            f" object's axis, leaves the object, which reaches from {low:g} to {high:g} mm: it meets the edge"
        )


def half_extent_mm(candidates: Candidates, gripper: Gripper) -> float:
    """Half of what a pad covers along the object's axis [mm]."""
    along, across = abs(math.cos(candidates.roll)), abs(math.sin(candidates.roll))
    return (gripper.pad_length_mm * along + gripper.pad_width_mm * across) / 2
