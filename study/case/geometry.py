"""Objects that take compiled loops to build or to judge: meshes, sections, thin walls; where pads meet them first.

`study.case.build` imports this module when a scene has such an object: numba and scipy take longer to load than the
rest of ``check`` takes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.centre_line import CentreLine, centre_line
from softjaw.fem.objects.gap import GapFunction, GapObject, Pose, first_touch
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.outer_surface import OuterSurface
from softjaw.fem.objects.stacked import Stacked as Stacked
from softjaw.fem.objects.traced_surface import TraceReport, traced
from softjaw.fem.shell.wall_material import WallMaterial, wall_material
from softjaw.fem.shell.wall_mesh import MeshSize, along, around, body_mesh, refuse_thick_sections
from softjaw.friction.patch import NEGLIGIBLE, FloatArray
from softjaw.study.case.fit import extremes
from softjaw.study.messages import USAGE, StudyError, fault_of
from softjaw.study.scene.objects import Mesh, Walled
from softjaw.study.scene.sections import Gripper

STEPS_BACK = (0.1, 0.4, 1.6)  # of the pad's thickness: where it stands before it is brought to the smooth surface
ROUNDED_OFF = 2e-5  # so far a smooth surface may lie behind the triangles it is made of where a pad touches first [m]
TOUCH_GRID = 41, 21  # points of a face; odd: planes of symmetry have some, where most objects are met first
KNOWN_DEPTH = 0.9  # of the pad's thickness: how far round the undeformed contact face the object must be known


@lru_cache(maxsize=8)
def mesh_object(shape: Mesh) -> MeshObject:
    """The object of a mesh file; `ValueError` for a file without triangles."""
    return MeshObject.from_file(shape.mesh, shape.unit, shape.axis, shape.grid_step, shape.crease_angle_deg)


@lru_cache(maxsize=8)
def middle_of(shape: Mesh, pad_length: float) -> CentreLine:
    """Line through the middles of a mesh's sections, without waves that a pad of this length [m] would not follow."""
    mesh = mesh_object(shape)
    return centre_line(mesh.points, mesh.triangles, 0.5 * pad_length)


@lru_cache(maxsize=8)
def traced_surface(shape: Mesh) -> tuple[OuterSurface, TraceReport]:
    """Smooth surface of a mesh's wall, and how far it is from the mesh."""
    mesh = mesh_object(shape)
    if not mesh.closed:
        raise MeshError(
            f"{shape.mesh}: is not a closed surface ({'; '.join(mesh.notes) or 'its triangles are not turned alike'}),"
            " which a thin wall needs; close it in a mesh editor, or leave wall_mm out"
        )
    return traced(mesh)


def trace_warning(shape: Mesh) -> str:
    """How far the wall that is simulated lies from the mesh that it was traced on."""
    _, report = traced_surface(shape)
    z, theta = report.place
    return (
        f"the wall traced on {shape.mesh} lies {1e3 * report.rms:.2g} mm (rms), at most {1e3 * report.largest:.2g} mm,"
        f" from the mesh, farthest at z = {1e3 * z:.3g} mm, {math.degrees(theta):.3g} deg; waves shorter than"
        f" {1e3 * report.wavelength:.2g} mm are smoothed out"
    )


def material_of(shape: Walled) -> WallMaterial:
    """Material of a wall, from the table or from the scene's own numbers."""
    name = None if shape.wall_material == "custom" else shape.wall_material
    return wall_material(
        name, young_modulus=shape.young_modulus, poisson_ratio=shape.wall_poisson_ratio,
        yield_strength=shape.yield_strength,
    )  # fmt: skip


def check_wall(shape: Any, surface: OuterSurface) -> None:
    """`StudyError` for a wall too thick for the curvature of outline or sections, or a base where nothing is flat."""
    # at its middle, as a wall that begins on the axis has no lines round it there
    size = MeshSize(heights=(0.5 * sum(surface.heights),) * 2, around=0.01, along=0.005, coarse=0.02)
    if shape.base_wall is not None and surface.flat[0] == 0.0:
        raise StudyError(
            USAGE,
            f"object.base_wall_mm: found {shape.base_wall_mm:g}, expected a flat bottom: this one begins on the axis;"
            " leave it out, or give wall_mm as pairs [z, thickness]",
        )
    with fault_of("object.wall_mm", ValueError):
        if shape.shape == "mesh":  # of other shapes the scene knows how large they are
            most = 100.0 * float(np.ptp(mesh_object(shape).bounds, axis=0).min())
            if max(shape.thicknesses_mm) > most:
                raise ValueError(
                    f"found {max(shape.thicknesses_mm):g}, expected at most {most:.3g} mm, a tenth of the mesh's"
                    " smallest extent; a thicker wall is no shell: leave it out for a rigid object"
                )
        refuse_thick_sections(surface, shape.wall)
        body_mesh(
            surface, shape.wall, size,
            open_top=shape.open_top, open_bottom=shape.open_bottom, base_thickness=shape.base_wall,
        )  # fmt: skip


def wall_lines(
    scene: Any, turned: Any, heights: tuple[float, float], half: float, mirrors: tuple[bool, bool]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lines of a wall's mesh round the object [rad] and along its outline, finer between ``heights`` [m].

    ``scene`` is a `Scene` whose object has a wall, ``turned`` its outer surface as the fingers see it.
    """
    size = MeshSize(*scene.accuracy.wall_sizes)._replace(heights=heights, half_width=half)
    return around(turned, size, mirrors), along(turned, size, scene.object.open_bottom, scene.object.open_top)


@dataclass(frozen=True, eq=False)
class Finger:
    """A pad at first touch with the object.

    ``pose``: the pad's frame at first touch. ``surface``: the object round the contact, in the object's frame.
    ``hole_share``: share of the pad's face before a hole of the object's mesh.
    """

    pose: Pose
    surface: GapFunction
    hole_share: float = 0.0

    @property
    def half_turned(self) -> Finger:
        """In the frame that half a turn about the approach gives the pad: x and y change their signs."""
        return replace(self, pose=Pose(self.pose.rotation * [-1.0, -1.0, 1.0], self.pose.origin))

    def gap(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Signed distance, gradient and Hessian at points of the pad's frame."""
        R = self.pose.rotation
        g, normal, hessian = self.surface.gap(self.pose.to_object(x))
        return g, normal @ R, R.T @ hessian @ R


def approach(obj: GapObject, pose: Pose, gripper: Gripper) -> Finger:
    """Move a pad from afar along its approach to first touch; raises `NoContactError` if the pad passes the object."""
    size = gripper.pad_size
    touch = touching(obj, pose, size)
    box = np.array([0.6 * size[0], 0.6 * size[1], KNOWN_DEPTH * size[2]])
    element = min(side / n for side, n in zip(size[:2], gripper.elements, strict=False))
    surface = obj.near(touch, box * [-1, -1, -0.5], box, element if gripper.element == "hex8" else 0.5 * element)
    face = _contact_face(size)
    if abs(surface.gap(touch.to_object(face))[0].min()) > NEGLIGIBLE:  # smoothed: met earlier or later
        # A smoothed surface may stand before the old touch, so the pad steps back before it looks again.
        touch = _from_behind(surface, touch, face, [step * size[2] for step in STEPS_BACK])
    if isinstance(obj, MeshObject):
        # the smooth surface rounds sharp edges off, and corners pass between the points of the face
        ahead = extremes(touch.to_pad(obj.points), obj.triangles, size[:2])[0]
        if ahead < -ROUNDED_OFF:
            touch = Pose(touch.rotation, touch.origin + ahead * touch.rotation[:, 2])
        return Finger(touch, surface, obj.hole_share(touch, face, KNOWN_DEPTH * size[2]))
    return Finger(_between_points(surface, touch, face), surface)


def _between_points(surface: GapFunction, touch: Pose, face: FloatArray) -> Pose:
    """First touch of what lies between the points of the face, too: round the one that is nearest after each step."""
    ends = face.min(axis=0), face.max(axis=0)
    for _ in range(3):
        nearest = face[surface.gap(touch.to_object(face))[0].argmin()]
        beside = np.clip(nearest + face * [*(2 / (n - 1) for n in TOUCH_GRID), 1], *ends)  # up to the points beside it
        ahead = float(surface.gap(touch.to_object(beside))[0].min())
        if ahead > -0.05 * ROUNDED_OFF:
            break
        # on a steep flank the distance to the surface says little of that along the approach
        touch = _from_behind(surface, touch, beside, [-ahead * 2.0**k for k in range(2, 20)])
    return touch


def _from_behind(surface: GapFunction, touch: Pose, points: FloatArray, steps: Sequence[float]) -> Pose:
    """First touch of points of the face, from the first of the ``steps`` back [m] at which none of them is inside."""
    for step in steps:
        back = Pose(touch.rotation, touch.origin - step * touch.rotation[:, 2])
        if surface.gap(back.to_object(points))[0].min() > 0.0:
            break
    distance = first_touch(surface, back, points, 2 * step)
    return Pose(touch.rotation, back.origin + distance * touch.rotation[:, 2])


def touching(obj: GapObject, pose: Pose, size: tuple[float, float, float]) -> Pose:
    """Pose at first touch; see `approach`."""
    lower, upper = obj.bounds
    # From outside of the object wherever the pose stands; the pad's size covers its corners.
    reach = float(np.linalg.norm(upper - lower)) + size[0] + size[1]
    ahead = float((0.5 * (lower + upper) - pose.origin) @ pose.rotation[:, 2])
    start = Pose(pose.rotation, pose.origin + (ahead - reach) * pose.rotation[:, 2])
    distance = obj.first_touch(start, _contact_face(size), 2.0 * reach)
    return Pose(pose.rotation, start.origin + distance * pose.rotation[:, 2])


def _contact_face(size: tuple[float, float, float]) -> FloatArray:
    """Points spread over the undeformed contact face, independent of the mesh, the planes of symmetry among them."""
    x, y = (np.linspace(-0.5, 0.5, n) * side for n, side in zip(TOUCH_GRID, size, strict=False))
    x, y = np.meshgrid(x, y, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
