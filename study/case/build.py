"""From the sections of a scene to what ``fem`` works with; heavy modules are imported only for what is built."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

from softjaw.study.messages import USAGE, StudyError
from softjaw.study.scene.grasp_checks import station_warnings

if TYPE_CHECKING:
    from softjaw.fem.materials import Material
    from softjaw.fem.objects.gap import GapObject
    from softjaw.fem.objects.outer_surface import OuterSurface
    from softjaw.fem.objects.traced_surface import TracedSurface, TraceReport
    from softjaw.fem.pad.backing_plate import Sheet
    from softjaw.fem.pad.shape import PadShape
    from softjaw.study.scene import Scene
    from softjaw.study.scene.objects import Shape, Walled
    from softjaw.study.scene.sections import Gripper


@lru_cache(maxsize=8)
def build_object(shape: Shape) -> GapObject:
    """Object of a scene's section ``[object]``.

    Raises
    ------
    ValueError
        For geometry that cannot be, a mesh that is open or crosses itself among others.
    """
    if shape.shape == "mesh":
        from softjaw.fem.objects.mesh_object import MeshObject

        return MeshObject.from_file(shape.mesh, shape.unit, shape.axis, shape.grid_step, shape.crease_angle_deg)
    import numpy as np

    from softjaw.fem.objects import shapes as objects

    match shape.shape:
        case "revolution":
            return objects.Revolution(np.array(shape.profile))
        case "sections":
            from softjaw.fem.objects.stacked import Stacked

            return Stacked(outer_surface(shape)[0])
        case "elliptic_cylinder":
            return objects.EllipticCylinder(shape.semi_axis_a, shape.semi_axis_b, shape.length)
        case "sphere":
            return objects.Sphere(shape.radius)
        case "box":
            return objects.Box(np.array(shape.size), shape.edge_radius)
        case _:
            return objects.Plane(shape.thickness)


@lru_cache(maxsize=8)
def outer_surface(shape: Walled) -> tuple[OuterSurface, bool]:
    """Outer surface of an object that can have a wall, and whether it is a body of revolution.

    Raises
    ------
    ValueError
        For geometry that cannot be.
    """
    from softjaw.fem.objects.outer_surface import Section, of_revolution, of_sections

    if shape.shape == "revolution":
        return of_revolution(build_object(shape)), True
    if shape.shape == "mesh":
        surface, _ = _traced(shape)
        return surface, surface.round
    sections = [Section(s.z, s.a, s.b, s.exponent, s.shift) for s in shape.sections]
    return of_sections(sections), shape.axis_symmetry == 0


@lru_cache(maxsize=8)
def _traced(shape: Walled) -> tuple[TracedSurface, TraceReport]:
    """Smooth surface of a mesh's wall, and how far it is from the mesh."""
    from softjaw.fem.objects.traced_surface import traced

    return traced(build_object(shape), shape.wall_heights)


def has_wall(shape: Any) -> bool:
    """Whether an object is hollow."""
    return getattr(shape, "wall", None) is not None


def shapes_of(scene: Scene) -> list[Shape]:
    """The object at every point of the sweep, each once."""
    swept = {key: values for key, values in scene.sweep.items() if key.startswith("object.")}
    if not swept:
        return [scene.object]
    points = product(*swept.values())
    return list(dict.fromkeys(scene.with_values(dict(zip(swept, p, strict=True))).object for p in points))


def check_object(scene: Scene) -> None:
    """Refuse geometry that cannot be, and stations beside a mesh, before any work starts.

    Outlines and meshes are built to be judged, at the price of importing numpy, scipy and numba; of the other shapes
    the scene itself has checked every number, and whatever passes there can be built.

    Raises
    ------
    StudyError
        With the key and what is wrong with it.
    """
    for shape in shapes_of(scene):
        keys = {"revolution": "object.profile_mm", "sections": "object.sections", "mesh": "object.mesh"}
        key = keys.get(shape.shape)
        if key is None:
            return
        try:
            build_object(shape)
            if shape.wall is not None:
                outer_surface(shape)
        except ValueError as error:
            raise StudyError(USAGE, f"{key}: {error}") from error
        if shape.wall is not None:
            _check_wall(shape)
        if shape.shape == "mesh":
            _check_stations(scene, shape)


def _check_wall(shape: Walled) -> None:
    """Refuse a wall that is too thick for the curvature of its outline, by meshing it coarsely."""
    import numpy as np

    from softjaw.fem.shell.wall_mesh import MeshSize, body_mesh

    surface, _ = outer_surface(shape)
    lowest = float(surface.curve.derivative(np.linspace(*surface.wall, 65))[:, 0].min())
    size = MeshSize(heights=(lowest, lowest), around=0.01, along=0.005, coarse=0.02)
    wall = shape.wall if isinstance(shape.wall, float) else [list(pair) for pair in shape.wall]
    try:
        body_mesh(surface, wall, size, open_top=shape.open_top, base_thickness=shape.base_wall)
    except ValueError as error:
        key = "wall_mm" if shape.wall_mm is not None else "wall_profile_mm"
        raise StudyError(USAGE, f"object.{key}: {error}") from error


def _check_stations(scene: Scene, mesh: Shape) -> None:
    low, high = axis_span(mesh) or (-math.inf, math.inf)
    beside = [s for s in scene.candidates.station_values_mm if not low <= s <= high]
    if beside:
        raise StudyError(
            USAGE,
            f"candidates: found stations off the object, {', '.join(f'{s:g}' for s in beside[:5])} mm; expected {low:g}"
            f" to {high:g} mm, the mesh along its axis {mesh.axis}, counted from its lowest point; change the stations"
            " or object.unit",
        )


def axis_span(shape: Shape) -> tuple[float, float] | None:
    """Where the object begins and ends along its axis [mm]; None where it has no end."""
    if shape.shape != "mesh":
        return shape.spans_mm.get("z")
    low, high = 1e3 * build_object(shape).bounds[:, 2]
    return float(low), float(high)


def warnings(scene: Scene) -> tuple[str, ...]:
    """Sentences about values that are allowed but seldom meant; builds the object if it is a mesh."""
    shapes = shapes_of(scene)
    edges = (station_warnings(shape, axis_span(shape), scene.candidates, scene.gripper) for shape in shapes)
    walls = [_distance(shape) for shape in shapes if shape.shape == "mesh" and shape.wall is not None]
    meshes = dict.fromkeys(shape for shape in shapes if shape.shape == "mesh")
    mended = [f"{shape.mesh}: {note}" for shape in meshes for note in build_object(shape).notes]
    return (*scene.warnings, *next((found for found in map(tuple, edges) if found), ()), *walls, *mended)


def _distance(shape: Walled) -> str:
    """How far the wall that is simulated lies from the mesh that it was traced on."""
    _, report = _traced(shape)
    z, theta = report.place
    return (
        f"the wall traced on {shape.mesh} lies {1e3 * report.rms:.2g} mm (rms), at most {1e3 * report.largest:.2g} mm,"
        f" from the mesh, farthest at z = {1e3 * z:.3g} mm, {math.degrees(theta):.3g} deg; waves shorter than"
        f" {1e3 * report.wavelength:.2g} mm are smoothed out"
    )


def pad_material(gripper: Gripper) -> Material:
    """Foam of the pads."""
    from softjaw.fem.materials import material

    nu = 0.25 if gripper.material == "blatz_ko" else gripper.poisson_ratio
    return material(gripper.material, gripper.shear_modulus, nu, gripper.shear_moduli, gripper.alpha)


def sheet(gripper: Gripper) -> Sheet:
    """Plate behind each pad."""
    from softjaw.fem.pad.backing_plate import Sheet

    return Sheet(gripper.sheet_thickness, gripper.sheet_modulus, gripper.sheet_poisson, gripper.sheet_support)


def pad_shape(gripper: Gripper, coarser: bool = False) -> PadShape:
    """Dimensions and mesh of the pads; ``coarser`` has half as many elements in every direction."""
    from softjaw.fem.pad.shape import PadShape

    shape = PadShape(gripper.pad_size, gripper.elements, gripper.grading, gripper.element)
    return shape.halved() if coarser else shape
