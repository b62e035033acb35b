"""From the sections of a scene to the objects that ``fem`` works with, and what is wrong with them before a run."""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.objects import shapes as objects
from softjaw.fem.objects.gap import IN_PLACE, GapObject, Pose, cone_volumes, solid_centroid
from softjaw.fem.objects.outer_surface import OuterSurface, Section, of_revolution, of_sections
from softjaw.fem.pad.halving import refined
from softjaw.fem.pad.shape import PadShape
from softjaw.study.messages import USAGE, StudyError, fault_of
from softjaw.study.quantities import LISTED_TARGET
from softjaw.study.scene import Scene
from softjaw.study.scene.grasps import listed
from softjaw.study.scene.sections import Accuracy, Gripper
from softjaw.study.units import converted, in_si

MAX_SLOPE = np.radians(60.0)  # of an approach against the planes across a thin-walled object's axis


def geometry() -> Any:
    """The module that builds what needs compiled loops; most scenes are checked and planned without it."""
    from softjaw.study.case import geometry

    return geometry


@lru_cache(maxsize=8)
def build_object(shape: Any) -> GapObject:
    """Object of a scene's section ``[object]``; `ValueError` for geometry that cannot be, as a mesh that is open."""
    match shape.shape:
        case "mesh":
            return geometry().mesh_object(shape)
        case "revolution":
            return objects.Revolution(np.array(shape.profile), beyond=has_wall(shape))
        case "sections":
            return geometry().Stacked(outer_surface(shape))
        case "elliptic_cylinder":
            return objects.EllipticCylinder(shape.semi_axis_a, shape.semi_axis_b, shape.length)
        case "sphere":
            return objects.Sphere(shape.radius)
        case "box":
            return objects.Box(np.array(shape.size), shape.edge_radius)
        case _:
            return objects.Plane(shape.thickness)


def full(shape: Any) -> Any:
    """The object's section for its extents and its weight, which count as full: it ends where its outline does.

    A thin wall's lids have rims beyond, and an open end has no lid at all.
    """
    return shape.model_copy(update={"wall_mm": None}) if has_wall(shape) and shape.shape != "mesh" else shape


@lru_cache(maxsize=8)
def surface_triangles(shape: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points ``(k, 3)`` [m] and triangles ``(m, 3)`` of an object; decimating a large mesh takes time."""
    return build_object(shape).surface()


def own_frame(shape: Any) -> Pose:
    """Where the object's frame lies in that of its mesh file [m]; every other shape is described in its own frame."""
    return geometry().mesh_object(shape).placed if shape.shape == "mesh" else IN_PLACE


def centre_of_volume(obj: Any) -> NDArray[np.float64]:
    """Centroid ``(3,)`` [m] of the body that an object's surface encloses, as if it were full."""
    return np.asarray(obj.solid[1]) if hasattr(obj, "solid") else solid_centroid(*obj.surface())


def centroid_and_bounds(shape: Any) -> dict[str, NDArray[np.float64]]:
    """Centroid ``(3,)`` and bounds ``(2, 3)`` [m] of an object in the frame of its own file."""
    placed = own_frame(shape)
    points = placed.to_object(np.asarray(surface_triangles(full(shape))[0], float))
    centroid = placed.to_object(centre_of_volume(build_object(full(shape)))[None])[0]
    return {"object_centroid": centroid, "object_bounds": np.stack([points.min(axis=0), points.max(axis=0)])}


def volume(shape: Any) -> float:
    """Volume that an object's surface encloses [m^3]: a sphere's exactly, others' within 1 %; `ValueError` if none."""
    if shape.shape == "sphere":
        return 4.0 / 3.0 * math.pi * float(shape.radius) ** 3
    if shape.shape == "plane":
        raise ValueError("two planes enclose no volume")
    obj = build_object(shape)
    if not getattr(obj, "closed", True):
        raise ValueError("the mesh is not closed")
    return obj.solid[0] if hasattr(obj, "solid") else abs(float(cone_volumes(*surface_triangles(shape)).sum()))


def with_mass(scene: Scene) -> Scene:
    """The scene with the mass that its object's density gives, to 0.01 g, in place of the density.

    Raises `StudyError`: the object has no volume, or several in a sweep.
    """
    density = scene.object.density
    if density is None:
        return scene
    check_object(scene)
    with fault_of("object.density", ValueError, ending="; write object.mass_g instead"):
        if any(key.startswith("object.") for key in (*scene.sweep, *scene.uncertainty.spread)):
            raise ValueError("the object changes along the sweep, or is uncertain")
        mass = float(f"{converted(density * volume(scene.object), 'kg', 'g'):.4g}")
    return scene.model_copy(update={"object": scene.object.model_copy(update={"density": None, "mass_g": mass})})


def centre_of_mass(scene: Scene) -> NDArray[np.float64]:
    """Where the weight of a scene's object acts, in the object's frame ``(3,)`` [m]."""
    shape, given = scene.object, scene.task.centre_of_mass
    return centre_of_volume(build_object(full(shape))) if given is None else own_frame(shape).to_pad(np.array(given))


@lru_cache(maxsize=8)
def outer_surface(shape: Any) -> OuterSurface:
    """Outer surface of an object that can have a wall; `ValueError` for geometry that cannot be."""
    if shape.shape == "revolution":
        body = build_object(shape)
        assert isinstance(body, objects.Revolution)
        return of_revolution(body)
    if shape.shape == "mesh":
        return geometry().traced_surface(shape)[0]
    return of_sections([Section(s.z, s.a, s.b, s.exponent, s.shift) for s in shape.sections], has_wall(shape))


def has_wall(shape: Any) -> bool:
    """Whether an object is hollow."""
    return getattr(shape, "wall", None) is not None


def shapes_of(scene: Scene) -> list[Any]:
    """The object at every point that is solved, each once."""
    points = [{key: v for key, v in point.items() if key.startswith("object.")} for point in scene.points]
    each = [point for i, point in enumerate(points) if point not in points[:i]]
    return [scene.at(point).object if point else scene.object for point in each]


def check_object(scene: Scene) -> None:
    """Refuse geometry that cannot be, and stations beside a mesh, before any work starts; `StudyError` names the key.

    Outlines and meshes are built to be judged, at the price of importing numpy, scipy and numba; of the other shapes
    the scene itself has checked every number, and whatever passes there can be built.
    """
    for inputs in scene.realisations[1:]:
        scene.at(inputs)  # samples that are no scene together
    for shape in shapes_of(scene):
        key = {"revolution": "object.profile_mm", "sections": "object.sections", "mesh": "object.mesh"}.get(shape.shape)
        if key is None:
            return
        with fault_of(key, ValueError):
            build_object(shape)
            # An outline may be a good solid and still no wall.
            surface = None if shape.wall is None else outer_surface(shape)
        if surface is not None:
            geometry().check_wall(shape, surface)
        if shape.shape == "mesh":
            _check_stations(scene, shape)


def middle_of(scene: Scene) -> Any:
    """The `CentreLine` that stations follow, None for the axis z; `StudyError` for a mesh without sections across."""
    shape = scene.object
    if shape.shape != "mesh" or not scene.candidates.station_values_mm:
        return None
    with fault_of("object.mesh", ValueError):
        return geometry().middle_of(shape, scene.gripper.pad_size[0])


def _check_stations(scene: Scene, mesh: Any) -> None:
    low, high = axis_span(mesh) or (-math.inf, math.inf)
    beside = [s for s in scene.candidates.station_values_mm if not low <= s <= high]
    if beside:
        raise StudyError(
            USAGE,
            f"candidates: found stations off the object, {listed(beside)} mm; expected {low:g} to {high:g} mm along the"
            f" mesh's axis {mesh.axis} from its lowest point; change the stations or object.unit",
        )


def axis_span(shape: Any) -> tuple[float, float] | None:
    """Where the object begins and ends along its axis [mm]; None where it has no end."""
    if shape.shape != "mesh":
        return shape.spans_mm.get("z")
    low, high = 1e3 * build_object(shape).bounds[:, 2]
    return float(low), float(high)


def warnings(scene: Scene) -> tuple[str, ...]:
    """Sentences about values that are allowed but seldom meant; builds the object if it is a mesh."""
    shapes = shapes_of(scene)
    edges = (scene.candidates.warnings(shape, axis_span(shape), scene.gripper) for shape in shapes)
    walls = [geometry().trace_warning(shape) for shape in shapes if shape.shape == "mesh" and shape.wall is not None]
    # one of each outline: samples of uncertain inputs mostly change something else
    outlines = {getattr(shape, "profile_mm", None) or getattr(shape, "sections", None): shape for shape in shapes}
    swings = dict.fromkeys(filter(None, map(_swing, outlines.values())))
    placed = next((warned for warned in map(tuple, edges) if warned), ())
    return (*scene.warnings, *placed, *_remarks(scene), *swings, *walls)


def _swing(shape: Any) -> str:
    """What there is to say of a smooth outline that lies far off straight lines between its points; mostly nothing."""
    if shape.shape not in ("revolution", "sections"):
        return ""
    if shape.shape == "revolution":
        curve, wall, _ = cast(objects.Revolution, build_object(shape)).closed
        points = np.array(shape.profile_mm)
    else:
        curve, wall = outer_surface(shape).curve, outer_surface(shape).wall
        points = np.array([(s.z_mm, s.a_mm) for s in shape.sections])
    along, beside = np.diff(points, axis=0), 1e3 * curve.derivative(np.linspace(*wall, 500))[:, None] - points[:-1]
    share = np.clip((beside * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    off = float(np.linalg.norm(beside - share[..., None] * along, axis=2).min(axis=1).max())
    # share of the width: less is how a round outline with few points is meant; and what a rounded corner leaves [mm]
    if off < max(0.03 * float(np.ptp([shape.spans_mm[axis] for axis in "xy"], axis=1).max()), 1.0):
        return ""
    return f"object: the outline lies up to {off:.2g} mm off lines between its points; three on a line make it straight"


def notices(scene: Scene) -> list[str]:
    """Lines with all `warnings`, and notes on meshes: what was mended, tolerated, or may be meant otherwise."""
    # share of a pad's shorter side: narrower facets are hardly felt
    notes, width = [], 0.25 * min(scene.gripper.pad_size[:2])
    for shape in dict.fromkeys(shape for shape in shapes_of(scene) if shape.shape == "mesh"):
        mesh = geometry().mesh_object(shape)
        texts = (*mesh_notes(mesh, scene.task.centre_of_mass is None), mesh.sharp_facets(width))
        notes += [f"note: {shape.mesh}: {text}" for text in texts if text]
    return [*(f"warning: {text}" for text in warnings(scene)), *notes]


def mesh_notes(mesh: Any, centroid: bool = True) -> tuple[str, ...]:
    """What of a mesh was mended or left open, and how well its ``centroid`` is known where that is an estimate."""
    # [m]: a smaller error is rounding, or that of parts that hardly cross
    if not centroid or (mesh.closed and mesh.solid[2] < 1e-6):
        return tuple(mesh.notes)
    _, place, error = mesh.solid
    named = ", ".join(f"{1e3 * x:.1f}" for x in mesh.placed.to_object(place[None])[0])
    note = (
        f"{'its parts cross' if mesh.closed else 'it is not closed'}: centroid estimated at ({named}) mm, to"
        f" {1e3 * error:.1g} mm; or set task.centre_of_mass_mm"
    )
    return *mesh.notes, note


def _remarks(scene: Scene) -> Iterator[str]:
    """What is doubtful about the centre line of a mesh at the stations, each remark once."""
    middle, where = middle_of(scene), scene.candidates
    half = in_si("half_extent_mm", where.half_extent_mm(scene.gripper))
    at: dict[str, list[float]] = {}
    for mm, station in zip(where.station_values_mm, where.station_values, strict=True) if middle else ():
        at.setdefault(middle.remark(station, half), []).append(mm)
    for remark, places in at.items():
        if remark:
            count, stations = len(places), len(where.station_values_mm)
            yield f"candidates: at {count} of {stations} stations ({listed(places)} mm) {remark}"


def forces_apart(scene: Scene) -> bool:
    """Whether every force is solved by itself, on a fine mesh that starts from a coarse one and its load path."""
    return scene.accuracy.meshes > 1


def samples_together(scene: Scene) -> bool:
    """Whether rounds name the finer meshes of ``accuracy.target``, for all samples of uncertain inputs alike.

    Samples on other meshes would differ by these too. Walls that are simulated have two meshes in any case.
    """
    rigid = scene.effects.object == "rigid" or not has_wall(scene.object)
    return bool(scene.uncertainty.spread) and scene.accuracy.target is not None and forces_apart(scene) and rigid


def rounds_edges(scene: Scene) -> bool:
    """Whether the object's edges are rounded over a part of a pad's element, and a coarser pad tells what that does."""
    mesh = scene.object.shape == "mesh" and not has_wall(scene.object) and scene.object.grid_step is None
    return mesh and forces_apart(scene)


def listed_accuracy(scene: Scene) -> Accuracy:
    """The accuracy in effect: of sampled grasps without a target of their own that of those that are listed."""
    as_given = not scene.candidates.sampled or scene.accuracy.target is not None or not forces_apart(scene)
    return scene.accuracy if as_given else scene.accuracy.model_copy(update={"target": LISTED_TARGET})


def pad_elements(scene: Scene, mesh: int) -> tuple[int, int, int]:
    """Elements of a pad on the scene's mesh (1) and on the finer ones of ``accuracy.target`` (2, 3)."""
    elements = scene.gripper.elements
    for _ in range(1, mesh):
        elements = refined(elements)
    return elements


def pad_shape(gripper: Gripper, coarser: bool = False) -> PadShape:
    """Dimensions and mesh of the pads; ``coarser`` has half as many elements in every direction."""
    shape = PadShape(gripper.pad_size, gripper.elements, gripper.grading, gripper.element)
    return shape.halved() if coarser else shape
