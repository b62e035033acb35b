"""Seconds of a study: of load paths on a bed of springs, before anything is solved; of those that are measured.

A force costs what its elements cost, whose number follows from symmetry, and symmetry from what the pads meet: heights
of the object over a coarse grid on each pad, without compiled loops, because a plan answers at once.
"""

import math
import time
import timeit
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import FloatArray
from softjaw.study.case.build import surface_triangles
from softjaw.study.case.candidates import meshes_cost
from softjaw.study.case.fit import bed_closing, doubt, heights_over, jaws_of
from softjaw.study.case.poses import turn_of_pose
from softjaw.study.quantities import FAILED, LISTED
from softjaw.study.result.store import open_result

FACE_GRID = (13, 7)  # points of a pad's face
# Measured on cylinders, boxes, bottles and meshes of 64 to 2304 solved elements, CPU time of one core of 2026.
CASE, ELEMENT = 0.06, 2.75e-4  # seconds of a force: friction, fits and score; contact, for each trilinear element
SECTIONS_FACTOR = 1.7  # times as dear is a body of stacked sections, on whose surface places are searched
QUADRATIC_FACTOR = 10.0  # times as dear is a triquadratic element
START_S = 3.5  # seconds until a rank has loaded what it solves with, and at the end to pack and list
FIRST_FORCE_FACTOR = 2.0  # times as long the first force takes, which begins with a coarse step
REGION_S = 0.3  # seconds until the distance to a mesh is known round both pads
# times as dear with friction that acts back, everywhere or where it is found to matter
COUPLED = {"none": 1.0, "auto": 2.2, "tangential": 2.2}
SCREENED_COST = 0.1  # of a force on the coarse mesh alone, over that on the scene's
ROUNDS = 2.3  # of the cases that a list shows, each once on the scene's mesh: with others, and with finer meshes
DEEP, HARD = 0.4, 4.0  # closing over the pad's thickness from which forces are cut into steps, and how much that costs
OPERATIONS_S = 3.6e-3  # seconds that `slowness` counts where cases take what is said above


def estimated(units: Sequence[Any]) -> list[float]:
    """Expected time of each unit of work on objects without a wall [s]."""
    # load paths that are looked at, evenly spread; the others take the time of the nearest one
    step = -(-len(units) // 40) if units else 1
    known = [_seconds(unit, *surface_triangles(unit.scene.object)) for unit in units[::step]]
    # any of sampled grasps may be among those that rounds solve well
    rounds = ROUNDS * min(LISTED, len(units)) / max(len(units), 1)
    return [known[i // step][0] + rounds * known[i // step][1] for i in range(len(units))]


def slowness() -> float:
    """How long small operations of numpy take here, over where the seconds of this module were measured."""
    a = np.arange(300.0)

    def operations() -> list[float]:
        return [float((a * 2 + i).max()) for i in range(400)]

    # the processor's time: others may share it now
    return min(timeit.repeat(operations, timer=time.process_time, repeat=25, number=2)) / OPERATIONS_S


def _seconds(unit: Any, points: FloatArray, triangles: NDArray[np.int64]) -> tuple[float, float]:
    """Time before any round, and that of its cases which rounds may solve [s]."""
    scene, gripper = unit.scene, unit.scene.gripper
    pose, other = unit.candidate.poses
    low, high = heights((points - pose.origin) @ pose.rotation, triangles, gripper.pad_size[:2])
    fingers = 1 if turn_of_pose(pose, other, scene.object.axis_symmetry) is not None else 2
    planes = _planes(scene, low, high, doubt(points))
    kind = QUADRATIC_FACTOR if gripper.element == "hex27" else 1.0
    kind *= SECTIONS_FACTOR if scene.object.shape == "sections" else 1.0
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
    if not unit.finest:
        return region + each * sum(times), 0.0
    # with a mass the least force that holds it lies between two
    levels = 2 if scene.object.mass_g is not None and len(forces) > 1 else 1
    return SCREENED_COST * each * sum(times), region + levels * FIRST_FORCE_FACTOR * each


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
    z, over = heights_over(corners[near.all(axis=1)], np.column_stack([x.ravel(), y.ravel()]))
    low = np.where(over, z, np.inf).min(axis=1, initial=np.inf)
    high = np.where(over, z, -np.inf).max(axis=1, initial=-np.inf)
    return low.reshape(FACE_GRID), high.reshape(FACE_GRID)


# --- from measured times ----------------------------------------------------------------------------------------------


def unit_seconds(plan: Any, seconds: np.ndarray) -> list[float]:
    """Expected time of every unit that is tried [s]; empty where nothing was measured.

    ``seconds (rows,)`` are the measured times of some cases, NaN for the others. Measured units keep their
    time, the others are judged by their cost.
    """
    # Candidates served by symmetry have no times, so the solved one speaks for the unit. A load path that is measured
    # in part has none either: it would be taken for a cheap one.
    times = np.array([seconds[list(unit.rows[0])].sum() for unit in plan.tried])
    costs = np.array([unit.cost for unit in plan.tried])
    known = np.isfinite(times)
    if not costs[known].sum():
        return []
    return np.where(known, times, times[known].sum() / costs[known].sum() * costs).tolist()


def measured_seconds(plan: Any, path: Path) -> Any:
    """Seconds of every solved case ``(rows,)`` in the result file of a plan; None where there is no such file.

    Stations that a refinement added are left out. Raises `StudyError`: the file is of another scene.
    """
    if not path.is_file():
        return None
    with open_result(path) as result:
        result.refuse_other(plan.header)
        planned = np.flatnonzero(np.isin(result.axes[-3].values, plan.layout.axes[-3].values))
        seconds = np.where(result.status == FAILED, np.nan, result.read("work/seconds_total"))
        return seconds.take(planned, axis=-3).ravel()
