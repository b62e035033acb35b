"""Seconds that load paths will take, from a bed of springs and a calibration, before anything is solved.

A force costs what its elements cost, whose number follows from symmetry, and symmetry from what the pads meet: heights
of the object over a coarse grid on each pad, without compiled loops, because a plan answers at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.case.build import surface_triangles
from softjaw.study.case.candidates import meshes_cost
from softjaw.study.case.fit import bed_closing, doubt, jaws_of
from softjaw.study.case.poses import turn_of_pose

FloatArray = NDArray[np.float64]
FACE_GRID = (13, 7)  # points of a pad's face
# Measured on cylinders, boxes, bottles and meshes of 64 to 2304 solved elements, CPU time of one core of 2024.
CASE, ELEMENT = 0.03, 2.5e-4  # seconds of a force: friction, fits and score; contact, for each trilinear element
QUADRATIC_FACTOR = 10.0  # times as dear is a triquadratic element
START_S = 0.3  # seconds until a rank has loaded what it solves with
FIRST_FORCE_FACTOR = 2.0  # times as long the first force takes, which begins with a coarse step
REGION_S = 0.7  # seconds until the distance to a mesh is known round both pads
# times as dear with friction that acts back, everywhere or where it is found to matter
COUPLED = {"none": 1.0, "auto": 2.2, "tangential": 2.2}
DEEP, HARD = 0.4, 4.0  # closing over the pad's thickness from which forces are cut into steps, and how much that costs


def estimated(units: Sequence[Any]) -> list[float]:
    """Expected time of each unit of work on objects without a wall [s]."""
    # load paths that are looked at, evenly spread; the others take the time of the nearest one
    step = -(-len(units) // 40) if units else 1
    known = [_seconds(unit, *surface_triangles(unit.scene.object)) for unit in units[::step]]
    return [known[i // step] for i in range(len(units))]


def _seconds(unit: Any, points: FloatArray, triangles: NDArray[np.int64]) -> float:
    scene, gripper = unit.scene, unit.scene.gripper
    pose, other = unit.candidate.poses
    low, high = heights((points - pose.origin) @ pose.rotation, triangles, gripper.pad_size[:2])
    fingers = 1 if turn_of_pose(pose, other, scene.object.axis_symmetry) is not None else 2
    planes = _planes(scene, low, high, doubt(points))
    kind = QUADRATIC_FACTOR if gripper.element == "hex27" else 1.0
    elements = kind * fingers * math.prod(gripper.elements) / 2**planes
    each = CASE + ELEMENT * elements * meshes_cost(scene) * COUPLED[scene.effects.friction_pressure_coupling]
    jaws, cell = jaws_of(scene), math.prod(gripper.pad_size[:2]) / math.prod(FACE_GRID)
    forces = scene.load.normal_force
    times = [FIRST_FORCE_FACTOR, *[1.0] * (len(forces) - 1)]
    if np.isfinite(low).any():
        bed = low - low.min()
        shares = [bed_closing(bed, f / (jaws.stiffness * cell)) / gripper.pad_thickness for f in forces]
        times = [t * (HARD if share > DEEP else 1.0) for t, share in zip(times, shares, strict=True)]
    region = REGION_S if scene.object.shape == "mesh" else 0.0
    return region + each * sum(times)


def _planes(scene: Any, low: FloatArray, high: FloatArray, off: float) -> int:
    """Planes of symmetry that the pads' meshes will use; what a mesh from a file holds is never quite symmetric."""
    wanted = scene.effects.model_size
    if wanted == "full" or scene.object.shape == "mesh":
        return 0
    planes = 0
    for axis in (0, 1):
        even = scene.gripper.elements[axis] % 2 == 0
        planes += even and all(_alike(field, np.flip(field, axis), off) for field in (low, high))
    return min(planes, 1) if wanted == "half" else planes


def _alike(values: FloatArray, other: FloatArray, off: float) -> bool:
    both = np.isfinite(values) & np.isfinite(other)
    same_rim = np.mean(np.isfinite(values) != np.isfinite(other)) < 0.1  # rounding decides what a line at the rim meets
    return bool(same_rim and np.abs(values[both] - other[both]).max(initial=0.0) <= off)


def heights(
    points: FloatArray, triangles: NDArray[np.int64], sides: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest z of triangles over a grid of points in a rectangle about the origin; else infinite."""
    x, y = np.meshgrid(*(side * ((np.arange(n) + 0.5) / n - 0.5) for side, n in zip(sides, FACE_GRID, strict=True)),
                       indexing="ij")  # fmt: skip
    corners, half = points[triangles], 0.5 * np.array(sides)
    near = (corners[..., :2].min(axis=1) <= half) & (corners[..., :2].max(axis=1) >= -half)
    corners = corners[near.all(axis=1)]
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    a, u, v, area = (part[area != 0.0] for part in (a, u, v, area))
    dx, dy = x.ravel()[:, None] - a[:, 0], y.ravel()[:, None] - a[:, 1]
    s, t = (dx * v[:, 1] - dy * v[:, 0]) / area, (u[:, 0] * dy - u[:, 1] * dx) / area
    over = (s >= -1e-12) & (t >= -1e-12) & (s + t <= 1 + 1e-12)
    z = a[:, 2] + s * u[:, 2] + t * v[:, 2]
    low = np.where(over, z, np.inf).min(axis=1, initial=np.inf)
    high = np.where(over, z, -np.inf).max(axis=1, initial=-np.inf)
    return low.reshape(FACE_GRID), high.reshape(FACE_GRID)
