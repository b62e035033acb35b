"""What the values of a thin wall must satisfy together, and what the sections of a stacked body must."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from softjaw.study.scene.errors import Finding
from softjaw.study.scene.sections import Effects
from softjaw.study.scene.shape import Shape, Walled
from softjaw.study.scene.shapes import Sections

THICKEST = 0.1  # of the smallest extent: a thicker wall is no shell
WALL_KEYS = ("base_wall_mm", "young_modulus_gpa", "wall_poisson_ratio", "yield_strength_mpa", "allowed_dent_mm",
             "wall_heights_mm")  # fmt: skip


def wall(shape: Shape, effects: Effects) -> Iterator[Finding]:
    """Exactly one thickness, complete materials, and a wall where a shell is asked for."""
    hollow = isinstance(shape, Walled) and shape.wall is not None
    if effects.object.endswith("shell") and not hollow:
        where = ("effects", "object")
        yield Finding(where, f'"{effects.object}" with an object that has no wall', "an object with a wall",
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
    heights = getattr(shape, "wall_heights_mm", None)
    if heights is not None and not heights[0] < heights[1]:
        low, high = heights
        yield Finding(("object", "wall_heights_mm"), f"[{low:g}, {high:g}]", "two different heights, the lower first",
                      f"write [{high:g}, {low:g}]")  # fmt: skip
    if hollow:
        yield from _thickness(shape)
        yield from _material(shape)


def _thickness(shape: Walled) -> Iterator[Finding]:
    pairs = shape.wall_profile_mm or ()
    for i, (low, high) in enumerate(pairwise(pairs), 1):
        if high[0] <= low[0]:
            where, found = ("object", "wall_profile_mm", i), f"z = {high[0]:g} after {low[0]:g} mm"
            yield Finding(where, found, "z to rise from pair to pair", "sort the pairs [z, thickness] along the axis")
    given = [t for _, t in pairs] or [shape.wall_mm]
    key = "wall_profile_mm" if pairs else "wall_mm"
    spans = shape.spans_mm
    most = THICKEST * min((high - low for low, high in spans.values()), default=float("inf"))
    for t in given:
        if not 0 < t <= most:
            remedy = "leave the wall out for an object that is as good as rigid" if t > 0 else "write it in mm"
            yield Finding(("object", key), f"{t:g} mm", f"a thickness above 0 and up to {most:g} mm, a tenth of the"
                          " object's smallest extent", remedy)  # fmt: skip
            return


def _material(shape: Walled) -> Iterator[Finding]:
    missing = [k for k in ("young_modulus_gpa", "wall_poisson_ratio") if getattr(shape, k) is None]
    if shape.wall_material == "custom" and missing:
        example = "for example `young_modulus_gpa = 2.0` and `wall_poisson_ratio = 0.38`"
        yield Finding(("object", "wall_material"), f'"custom" without {" and ".join(missing)}', "both of them",
                      f"add {example}, or name a material")  # fmt: skip


def sections(shape: Shape) -> Iterator[Finding]:
    """Sections are stacked upwards; only the first and the last may end on the axis."""
    if not isinstance(shape, Sections):
        return
    for i, (low, high) in enumerate(pairwise(shape.sections), 1):
        if high.z_mm <= low.z_mm:
            where, found = ("object", "sections", i, "z_mm"), f"z = {high.z_mm:g} after {low.z_mm:g} mm"
            yield Finding(where, found, "z to rise from section to section", "sort the sections from bottom to top")
    for i, section in enumerate(shape.sections[1:-1], 1):
        if section.a_mm == 0:
            where = ("object", "sections", i, "a_mm")
            yield Finding(where, "0 mm", "a semi-axis above 0 between the ends", "write the semi-axis along x, in mm")
