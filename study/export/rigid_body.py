"""The object of a result as simulators take it: its surface, mass, centre of mass and inertia.

Everything is in the frame of the object's own file, in SI units. The inertia is that of a full body of even density
with the object's mass; of a surface that is not closed its convex hull is taken. The volume is that of
`study.case.build`: what lies in several parts of a mesh counts once.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.transformations import translation_matrix

from softjaw.friction.patch import FloatArray
from softjaw.study.case.build import build_object, centre_of_mass, own_frame, surface_triangles
from softjaw.study.messages import OTHER_FILE, fault_of
from softjaw.study.result.read import axes_of
from softjaw.study.result.read import scene_of as scene_at
from softjaw.study.scene import Scene, SceneError

DENSITY = 1000.0  # of an object without `object.mass_g` [kg/m^3], as simulators have it


@dataclass(frozen=True, eq=False)
class RigidBody:
    """An object: its ``surface`` [m], ``mass`` [kg], ``centre (3,)`` of mass [m].

    ``inertia (3, 3)`` is about the centre of mass [kg m^2], of the convex hull unless the surface is ``closed``.
    ``weighed`` says whether the scene gives the mass, and ``down (3,)`` is the direction of the weight, -z where the
    scene asks for every one. ``pad (3,)`` has the length, width and thickness of the pads that hold it [m].
    """

    surface: Trimesh
    mass: float
    weighed: bool
    centre: FloatArray
    inertia: FloatArray
    closed: bool
    down: FloatArray
    pad: FloatArray


def scene_of(ds: xr.Dataset, case: dict[str, Any]) -> Scene:
    """The scene of a case (`study.export.cases`) with its swept values; `StudyError` if this version cannot read it."""
    index = [int(np.flatnonzero(axis.values == case["place"][axis.name])[0]) for axis in axes_of(ds)[:-3]]
    with fault_of(ds.attrs["file"], SceneError, code=OTHER_FILE):
        return scene_at(ds, index)


def body_of(ds: xr.Dataset, case: dict[str, Any]) -> RigidBody:
    """The object of a case (`study.export.cases`); `StudyError` if it cannot be built, as when its mesh is gone."""
    scene = scene_of(ds, case)
    shape = scene.object
    with fault_of(f"{ds.attrs['file']}: its object cannot be built", ValueError, OSError, code=OTHER_FILE):
        built, frame = build_object(shape), own_frame(shape)
        points, triangles = surface_triangles(shape)
    centre = frame.to_object(centre_of_mass(scene)[None])[0]
    points = frame.to_object(np.asarray(points, float))
    surface = Trimesh(points, triangles, process=False)
    closed = getattr(built, "closed", True)
    solid = surface if closed else surface.convex_hull
    volume = getattr(built, "solid", (0.0,))[0] or solid.volume  # a sheet encloses nothing
    mass = DENSITY * volume if shape.mass is None else shape.mass
    inertia = solid.moment_inertia_frame(translation_matrix(centre)) * mass / solid.volume
    down, pad = np.array(scene.task.direction or (0.0, 0.0, -1.0)), np.array(scene.gripper.pad_size)
    down /= np.linalg.norm(down)
    return RigidBody(surface, mass, shape.mass is not None, centre, inertia, closed, down, pad)


def places(values: NDArray[Any]) -> str:
    """Coordinates or numbers of points as a file lists them, to 0.1 um on an object of 1 m.

    >>> places(np.array([[0.1, 1 / 3], [2, 30000000]]))
    '0.1 0.3333333 2 3e+07'
    """
    return " ".join(str(v) if isinstance(v, int) else f"{v:.7g}" for v in np.ravel(values).tolist())
