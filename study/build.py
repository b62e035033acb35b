"""From the sections of a scene to what ``fem`` works with; heavy modules are imported only for what is built."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from study.exits import USAGE, StudyError

if TYPE_CHECKING:
    from fem.materials import Material
    from fem.pad_shape import PadShape
    from fem.shape import GapObject
    from study.scene import Scene
    from study.scene.sections import Gripper
    from study.scene.shapes import Shape


@lru_cache(maxsize=8)
def build_object(shape: Shape) -> GapObject:
    """Object of a scene's section ``[object]``.

    Raises
    ------
    ValueError
        For geometry that cannot be, a mesh that is open or crosses itself among others.
    """
    if shape.shape == "mesh":
        from fem.mesh_object import MeshObject

        return MeshObject.from_file(shape.mesh, shape.unit, shape.axis, shape.grid_step)
    import numpy as np

    from fem import objects

    match shape.shape:
        case "revolution":
            return objects.Revolution(np.array(shape.profile))
        case "elliptic_cylinder":
            return objects.EllipticCylinder(shape.semi_axis_a, shape.semi_axis_b, shape.length)
        case "sphere":
            return objects.Sphere(shape.radius)
        case "box":
            return objects.Box(np.array(shape.size), shape.edge_radius)
        case _:
            return objects.Plane(shape.thickness)


def check_mesh(scene: Scene) -> None:
    """Refuse a mesh that is no sound surface, and stations beside it, before any work starts; other shapes pass.

    Raises
    ------
    StudyError
        With the file and what is wrong with it.
    """
    if scene.object.shape != "mesh":
        return
    try:
        bounds = build_object(scene.object).bounds
    except ValueError as error:
        raise StudyError(USAGE, f"object.mesh: {error}") from error
    low, high = 1e3 * bounds[:, 2]
    beside = [s for s in scene.candidates.station_values_mm if not low <= s <= high]
    if beside:
        raise StudyError(
            USAGE,
            f"candidates: found stations off the object, {', '.join(f'{s:g}' for s in beside[:5])} mm; expected {low:g}"
            f" to {high:g} mm, the mesh along its axis {scene.object.axis}; change the stations or object.unit",
        )


def pad_material(gripper: Gripper) -> Material:
    """Foam of the pads."""
    from fem.materials import material

    nu = 0.25 if gripper.material == "blatz_ko" else gripper.poisson_ratio
    return material(gripper.material, gripper.shear_modulus, nu, gripper.shear_moduli, gripper.alpha)


def pad_shape(gripper: Gripper, coarser: bool = False) -> PadShape:
    """Dimensions and mesh of the pads; ``coarser`` has half as many elements in every direction."""
    from fem.pad_shape import PadShape

    shape = PadShape(gripper.pad_size, gripper.elements, gripper.grading, gripper.element)
    return shape.halved() if coarser else shape
