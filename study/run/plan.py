"""What a run will do, before it is begun: layout, units of work, disk, memory and time."""

import math
import shutil
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softjaw.study.case import candidates as grasps
from softjaw.study.case.build import (
    centroid_and_bounds,
    check_object,
    forces_apart,
    geometry,
    has_wall,
    outer_surface,
    own_frame,
    pad_elements,
    pad_shape,
    samples_together,
)
from softjaw.study.case.candidates import decided
from softjaw.study.quantities import ALONG, AROUND, NO_GRASP, STATES
from softjaw.study.result.derived import derived
from softjaw.study.result.layout import Header, Layout
from softjaw.study.run.estimate import END_S, TIMED, timed
from softjaw.study.run.progress import duration
from softjaw.study.run.refine import Rounds, added_cases, refined
from softjaw.study.run.shares import makespan
from softjaw.study.scene.sections import COARSE, FINE, FINEST

# Measured on ten scenes at the end of a run: bytes of a rank with the libraries and compiled loops that it needs, and
# numbers over dofs^(4/3), the growth of nested dissection in 3-D, of factors, matrices and the solutions that are kept.
LIBRARY_BYTES, FILL_FACTOR = 4.5e8, 160.0
BYTES_PER_UNKNOWN = 9e4  # of a wall, measured on a cup and a bottle: 16 kB are factors, the rest kept solutions
SCREENED_COST = 0.1  # of a force on the coarse mesh alone, over that on the scene's


class Plan(NamedTuple):
    """What is to be done: the file's layout and header, and the units of work (``rows``, ``cost``)."""

    layout: Layout
    header: Header
    units: tuple[Any, ...]

    @property
    def tried(self) -> list[Any]:
        """Units that are to be solved; on finer meshes at once if not sampled, for rounds may take all there."""
        tried = [unit for unit in self.units if not unit.state]
        return [replace(u, finest=(), together=False) if u.finest and COARSE not in u.finest else u for u in tried]

    @property
    def wanted(self) -> np.ndarray | None:
        """Finest mesh of every row ``(rows,)``; None where no case waits for a finer one."""
        if not any(unit.finest for unit in self.units):
            return None
        wanted = np.zeros(self.layout.rows, int)
        for unit in self.units:
            wanted[np.array(unit.rows)] = unit.finest or 0
        return wanted

    @property
    def served(self) -> int:
        """Number of candidates, those that share a unit by symmetry counted one by one."""
        return sum(len(unit.rows) for unit in self.units)


def make_plan(scene: Any, scene_file: str = "", overrides: Sequence[str] = (), rounds: Rounds = ()) -> Plan:
    """The plan of a scene, with what ``rounds`` of refinement added; builds its objects."""
    # First, because all that follows builds the object and would fail less clearly.
    check_object(scene)
    grasps.check_candidates(scene)
    digest, text = scene.digest, scene.effective_toml()
    scene = refined(scene, rounds)
    faces = math.prod(pad_shape(scene.gripper).patch_faces) if scene.run.patches != "none" else 0
    layout = Layout(tuple(grasps.axes(scene)), faces, tuple(derived(scene)), has(scene), rounds)
    units: Sequence[Any] = decided(grasps.units(scene))
    if (together := samples_together(scene)) or (scene.candidates.sampled and forces_apart(scene)):
        named, least = layout.finer, COARSE if scene.candidates.sampled else FINE
        units = [replace(_with_meshes(unit, layout, named, least), together=together) for unit in units]
    title = getattr(scene.object, "name", None) or Path(scene_file).stem
    petsc_options = " ".join(f"-{key} {value}" for key, value in scene.petsc.items())
    labels = tuple(candidate.label for candidate in grasps.candidates(scene))
    header = Header(
        digest=digest, scene=text, title=title, scene_file=scene_file, overrides=tuple(overrides),
        petsc_options=petsc_options, labels=labels, about=_about(scene),
    )  # fmt: skip
    return Plan(layout, header, tuple(units))


def _about(scene: Any) -> dict[str, Any]:
    """What a file says about its object besides the scene; centroid and bounds where building it takes a mesh."""
    placed = own_frame(scene.object)
    about: dict[str, Any] = {"object_rotation": placed.rotation, "object_origin": placed.origin}
    if scene.candidates.rejected:
        about["rejected"] = np.array(scene.candidates.rejected, np.float32)
    if scene.object.shape == "mesh" and not any(key.startswith("object.") for key in scene.sweep):
        about |= centroid_and_bounds(scene.object)
        if scene.task.centre_of_mass is None:
            about["object_centroid_error"] = np.array([geometry().mesh_object(scene.object).solid[2]])
    return about


def _with_meshes(unit: Any, layout: Layout, named: Counter[Any], least: int) -> Any:
    """A unit of forces on the ``least`` mesh at first, and on finer ones as often as a case of it was ``named``."""
    *_, stations, angles, forces = layout.shape
    places = [divmod(rows[0] // forces, stations * angles) for rows in unit.rows]
    # a case is solved on the same meshes with all samples of uncertain inputs: their differences are no mesh's
    times = [max(named[point // layout.inputs, number, k] for point, number in places) for k in range(forces)]
    finest = tuple(min(max(COARSE + n, least), FINEST) for n in times)
    share = sum(1.0 if mesh else SCREENED_COST for mesh in finest) / forces
    return replace(unit, finest=finest, cost=unit.cost * share)


def has(scene: Any) -> tuple[str, ...]:
    """Which of `study.quantities.NEEDS` besides patches a scene asks for."""
    asked = {"two meshes": scene.accuracy.meshes > 1, "six components": scene.effects.wrench == "6-D"}
    asked["mass"] = scene.object.mass_g is not None
    asked["task"] = asked["mass"] or scene.task.direction is not None
    asked["wall"] = has_wall(scene.object)
    asked["finer meshes"] = scene.accuracy.target is not None
    return tuple(name for name, wanted in asked.items() if wanted)


def memory(scene: Any) -> float:
    """Rough memory of one rank [bytes]: the libraries, what whole pads take on their finest mesh, and a wall."""
    pad = 8.0 * FILL_FACTOR * (3.0 * _pad_nodes(scene)) ** (4.0 / 3.0)
    shell = has_wall(scene.object) and scene.effects.object != "rigid"
    return LIBRARY_BYTES + pad + (BYTES_PER_UNKNOWN * wall_unknowns(scene) if shell else 0.0)


def gigabytes(size: float, digits: int) -> str:
    """A size in bytes, rounded.

    >>> gigabytes(2.62e11, 1), gigabytes(6.8e8, 2)
    ('300 GB', '0.68 GB')
    """
    return f"{float(f'{size:.{digits}g}') / 1e9:g} GB"


def plan_rows(plan: Plan, scene: Any, path: Path, ranks: Sequence[int]) -> Iterator[str]:
    """Cases, units and disk, memory on the first of these numbers of ranks, and in the end time on each."""
    layout = plan.layout
    each = memory(scene)
    shared = plan.served - len(plan.units)
    symmetric = f", {shared} candidates are images of others by symmetry" if shared else ""
    shapes = layout.rows * 24 * AROUND * ALONG / 1e6 if "wall" in layout.has else 0.0
    space = f"{layout.nbytes / 1e6:.1f} MB in {path}" + f", {shapes:.1f} MB of it deformed walls" * bool(shapes)
    rows = {
        "cases": f"{layout.rows} = {' x '.join(map(str, layout.shape))} ({', '.join(layout.names)})",
        "units": f"{len(plan.units)} load paths of {layout.shape[-1]} forces{symmetric}",
        "no grasp": _no_grasps(plan),
        "rounds": _rounds(plan, scene),
        "disk": f"{space}, {free_bytes(path) / 1e9:.1f} GB free",
        "memory": f"roughly {gigabytes(each, 1)} on each rank, {gigabytes(each * ranks[0], 2)} on {ranks[0]}",
    }
    for name, text in rows.items():
        if text:
            yield f"  {name:<10}  {text}"
    failed: list[str] = []
    yield f"  {'time':<10}  {_time(plan, scene, ranks, failed)}"  # what is known at once need not wait for it
    if failed:
        yield f"  {'failed':<10}  {len(failed)} of the cases that were solved for it: {failed[0]}"


def _no_grasps(plan: Plan) -> str:
    """How many candidates are not solved and why, those of every point of a sweep counted; empty where there are none.

    The first of a state represents the others.
    """
    texts = []
    for state in NO_GRASP:
        units = [unit for unit in plan.units if unit.state == state]
        count = sum(len(unit.rows) for unit in units)
        texts += [f"{count} of {plan.served} {STATES[state]}: {units[0].reason}"] if units else []
    return "; ".join(texts)


def _rounds(plan: Plan, scene: Any) -> str:
    """What a refinement may add; empty without one."""
    asked = scene.candidates.refine
    if asked is None:
        return ""
    each = added_cases(plan.units, plan.layout)
    what = "poses" if scene.candidates.poses else "stations"
    return f"up to {asked // each} more {what}, {each} cases each; the time counts them, no other row does"


def _time(plan: Plan, scene: Any, ranks: Sequence[int], failed: list[str]) -> str:
    """Time on each of these numbers of ranks; reasons of cases that fail are added to ``failed``."""
    if not (tried := plan.tried):
        return "no grasp is solved"
    before = time.process_time()  # what a run does before it solves, a plan did as well
    each, loads = timed(tried, inputs=plan.layout.inputs, failed=failed)
    start = before + loads + END_S
    added = 1.0 + (scene.candidates.refine or 0) / (len(each) * plan.layout.shape[-1])
    counts = [plan.layout.shape[-1] if unit.apart else 1 for unit in tried]  # forces that ranks may divide
    parts = [added * cost / n for cost, n in zip(each, counts, strict=True) for _ in range(n)]
    times = (f"{duration(start + makespan(parts, n))} on {n} rank{'s' * (n > 1)}" for n in ranks)
    return f"about {', '.join(times)} for all cases, {TIMED}"


def free_bytes(path: Path) -> int:
    """Free space of the disk on which a file will be made [bytes]."""
    # The folder of the result is made later: the nearest one that exists tells the disk.
    return shutil.disk_usage(next(folder for folder in path.absolute().parents if folder.is_dir())).free


def wall_unknowns(scene: Any) -> int:
    """Unknowns of the shell, of a candidate in the middle of the scene's stations."""
    where, surface = scene.candidates, outer_surface(scene.object)
    turned = surface.turned(0.0 if where.poses else where.angles[0])
    mirrors = _mirrors(scene, turned.symmetric)
    theta, s = geometry().wall_lines(scene, turned, *_covered(scene, surface), mirrors)
    return 6 * len(theta) * len(s)


def _mirrors(scene: Any, symmetric: tuple[bool, bool]) -> tuple[bool, bool]:
    """Planes of symmetry of a grasp across the axis that the meshes can use."""
    if scene.candidates.poses or scene.effects.model_size == "full":
        return False, False
    upright, even = abs(math.sin(scene.candidates.roll)) < 1e-9, scene.gripper.elements[1] % 2 == 0
    return symmetric[0] and scene.effects.model_size != "half", symmetric[1] and upright and even


def _covered(scene: Any, surface: Any) -> tuple[tuple[float, float], float]:
    """Heights that a pad reaches over at the middle station, and half of what it covers round the object [m]."""
    gripper, where = scene.gripper, scene.candidates
    margin = 0.1 * max(gripper.pad_size[:2])  # share of the pad's length, round what it covers
    ends = surface.heights
    middle = 0.5 * sum(ends) if where.poses else where.station_values[len(where.station_values) // 2]
    c, s = abs(math.cos(where.roll)), abs(math.sin(where.roll))
    height, breadth = 0.5 * np.array([[c, s], [s, c]]) @ gripper.pad_size[:2] + margin
    low, high = np.clip([middle - height, middle + height], *ends)
    return (float(low), float(high)), breadth


def _pad_nodes(scene: Any) -> int:
    """Nodes of one whole pad, on its finest mesh."""
    each, sides = 2 if scene.gripper.element == "hex27" else 1, pad_elements(scene, scene.accuracy.most_meshes - 1)
    return math.prod(n * each + 1 for n in sides)
