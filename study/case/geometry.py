"""Objects that take compiled loops to build or to judge: meshes, stacked sections, and thin walls.

`study.case.build` imports this module when a scene has such an object: numba and scipy take longer to load than the
rest of ``check`` takes.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.centre_line import CentreLine, centre_line
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.outer_surface import OuterSurface
from softjaw.fem.objects.stacked import Stacked as Stacked
from softjaw.fem.objects.traced_surface import TraceReport, traced
from softjaw.fem.shell.wall_material import WallMaterial, wall_material
from softjaw.fem.shell.wall_mesh import MeshSize, along, around, body_mesh
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.scene.objects import Mesh, Walled


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
    """Refuse a wall that is too thick for the curvature of its outline, by meshing it coarsely.

    Raises `StudyError` with the key and what is wrong with it.
    """
    size = MeshSize(heights=surface.heights[:1] * 2, around=0.01, along=0.005, coarse=0.02)
    try:
        body_mesh(
            surface, shape.wall, size,
            open_top=shape.open_top, open_bottom=shape.open_bottom, base_thickness=shape.base_wall,
        )  # fmt: skip
    except ValueError as error:
        raise StudyError(USAGE, f"object.wall_mm: {error}") from error


def wall_lines(
    scene: Any, turned: Any, heights: tuple[float, float], half: float, mirrors: tuple[bool, bool]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lines of a wall's mesh round the object [rad] and along its outline, finer between ``heights`` [m].

    ``scene`` is a `Scene` whose object has a wall, ``turned`` its outer surface as the fingers see it.
    """
    size = replace(MeshSize(*scene.accuracy.wall_sizes), heights=heights, half_width=half)
    return around(turned, size, mirrors), along(turned, size, scene.object.open_bottom, scene.object.open_top)
