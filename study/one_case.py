"""One case in memory: the numbers that a run of the scene stores for a grasp candidate and a force, without a file.

A grasp or a force that the scene does not have is added to its own, so the case is that of a run with it: its load
path leads through the scene's forces below, and a candidate that is an image of another one is solved there.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.fem.objects.gap import Pose
from softjaw.friction.patch import ContactPatch, FloatArray
from softjaw.friction.wrench import FrictionLimits
from softjaw.lsfit.surface import LimitSurface
from softjaw.study import pipeline
from softjaw.study.case.build import check_object, with_mass
from softjaw.study.case.candidates import check_candidates, decided, units, with_sampled_grasps
from softjaw.study.case.contact import Contact
from softjaw.study.case.limit_surface import finger_surface
from softjaw.study.case.model import check_petsc
from softjaw.study.case.result import CaseFailure, CaseResult, GraspNumbers
from softjaw.study.flags import Flag, flags_in
from softjaw.study.messages import SOME_FAILED, StudyError, shown
from softjaw.study.quantities import BY_KEY, MAIN, MODELS, STATES, TABLE, checked_model
from softjaw.study.scene import Scene
from softjaw.study.scene.model import plain_tables
from softjaw.study.units import converted, shown_text

READY = 4  # candidates whose matrices are kept for further forces: 10 to 100 MB each
SAME = {"rel_tol": 1e-9, "abs_tol": 1e-12}  # stations [m], angles [deg] and forces [N] that are the scene's own


class CaseError(StudyError):
    """A case without values: it failed, or its gripper does not fit round the object."""

    def __init__(self, message: str) -> None:
        super().__init__(SOME_FAILED, message)


@dataclass(frozen=True, eq=False)
class Case(GraspNumbers):
    """A grasp candidate at a normal force, solved; made by `softjaw.press`.

    Attributes
    ----------
    scene : Scene
        With this case among its own.
    station, angle, force : float
        [m], [rad], [N]; with explicit poses ``station`` is the candidate's number and the angle is 0.
    label : str
        Name of the candidate.
    result : CaseResult
        All that a run stores, in ``result.values`` by ``group/name``, in SI units.
    """

    scene: Scene
    station: float
    angle: float
    force: float
    label: str
    result: CaseResult

    def value(self, name: str, model: str = "ccm") -> float:
        """A quantity of the grasp in SI units, of one friction model where it has several.

        Raises `KeyError`: for a name that the case does not have.
        """
        values = np.asarray(self._read(f"maps/{name}"))
        return float(values[MODELS.index(checked_model(model))] if values.ndim else values)

    def fingers(self, name: str, model: str = "ccm") -> FloatArray:
        """A quantity of both fingers ``(2, ...)``: ``f_x_max`` or ``fingers/S``, ``limit_surface/rho``."""
        key = name if "/" in name else f"fingers/{name}"
        values = np.asarray(self._read(key))
        return values[:, MODELS.index(checked_model(model))] if "model" in BY_KEY[key].dims else values

    @property
    def errors(self) -> dict[str, float]:
        """Absolute error estimates of the curved model by quantity, in its unit; none where there is one mesh."""
        known = [q for q in TABLE if q.error and q.of_error.key in self.result.values]
        return {q.name: q.error_in_unit(self.value(q.of_error.name), self.value(q.name)) for q in known}

    @property
    def pose(self) -> tuple[FloatArray, FloatArray]:
        """Rotations ``(2, 3, 3)`` and origins ``(2, 3)`` [m] of both pads at first touch; see `GraspPoint.pose`."""
        return self.fingers("pose_rotation"), self.fingers("pose_origin")

    @property
    def flags(self) -> Flag:
        """What there is to know of the case, as flags; `notes` says it."""
        return Flag(int(self.value("flags")))

    @property
    def notes(self) -> str:
        """The same and more in sentences; empty where all is well."""
        return self.result.message

    @property
    def contacts(self) -> tuple[Contact, Contact]:
        """Both fingers, with their friction limits.

        ``origin, axes, normal`` are in the frame of the object's own file, ``patch`` and ``frame`` in the pad's.
        """
        first, second = (c.at(Pose(R, x)) for c, R, x in zip(self.result.contacts, *self.pose, strict=True))
        return first, second

    @property
    def weaker(self) -> int:
        """The finger with the smaller e_n (CCM), 1 or 2; 1 where they are alike."""
        first, second = (c.limits["ccm"].e_n for c in self.result.contacts)
        return 2 if second < first else 1

    @property
    def patch(self) -> ContactPatch:
        """Contact patch of the weaker finger, in its pad's frame; ``contacts`` has both."""
        return self.contacts[self.weaker - 1].patch

    @property
    def limits(self) -> dict[str, FrictionLimits]:
        """Friction limits of the weaker finger by friction model (ccm, pcm, pcm_projected)."""
        return self.contacts[self.weaker - 1].limits

    def limit_surface(self, finger: int, model: str = "ccm", fitted: bool = True) -> LimitSurface:
        """Limit surface of finger 1 or 2 in (f_x, f_y, tau_z) [N, N, N m]; see `GraspPoint.limit_surface`."""
        return finger_surface(self.fingers, finger, checked_model(model), fitted)

    def __str__(self) -> str:
        lines, errors = [f"{self.label}, {self.force:g} N"], self.errors
        for name in (n for n in MAIN if f"maps/{n}" in self.result.values):
            units = BY_KEY[f"maps/{name}"].unit
            error = f"  +- {shown_text(errors[name], units, 2)}" if name in errors else ""
            lines.append(f"  {name:<14} {shown_text(self.value(name), units, 5)}{error}")
        return "\n".join([*lines, *(f"  {flag.sentence}" for flag in flags_in(self.flags))])

    def _read(self, key: str) -> Any:
        if key not in self.result.values:
            group = key.partition("/")[0]
            known = sorted(name.partition("/")[2] for name in self.result.values if name.startswith(f"{group}/"))
            raise KeyError(f"{key} is not a value of this case; {group}/ has {', '.join(known)}")
        return self.result.values[key]


# --- from the question to the case ------------------------------------------------------------------------------------


def solved_case(
    scene: Scene,
    station: float | None,
    angle: float | None,
    force: float,
    candidate: int | None = None,
    pose: Any = None,
) -> Case:
    """Solve one case; arguments and errors as for `softjaw.press`."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {scene!r}: expected a Scene, as Scene.from_file(file) gives")
    if scene.sweep:
        key, values = next(iter(scene.sweep.items()))
        remedy = f"choose a point of it by scene.with_values(**{{{key!r}: {values[0]!r}}})"
        raise ValueError(f"scene has a sweep of {', '.join(scene.sweep)}, a case has one value of each; {remedy}")
    scene, number = _asked(with_mass(scene.reread()), station, angle, candidate, pose)
    forces, k = _joined(scene.load.normal_force_n, _number("force", force, "N"))
    scene = scene.with_values({"load.normal_force_n": forces})
    try:
        check_object(scene)
        check_candidates(scene)
    except StudyError as error:  # here a station off a mesh is an argument
        raise ValueError(str(error)) from error
    check_petsc(dict(scene.petsc))
    row = number * len(scene.load.normal_force_n) + k
    unit, c = next((u, c) for u in units(scene) for c, rows in enumerate(u.rows) if row in rows)
    place, what = unit.served[c], f"{unit.served[c].label}, {scene.load.normal_force_n[k]:g} N"
    unit = decided([unit])[0]
    if unit.state:
        raise CaseError(f"{what}: {STATES[unit.state]}: {unit.reason}")
    result = pipeline.image(_outcome(unit, k, what), unit, c)
    return Case(scene, place.station, place.angle, scene.load.normal_force[k], place.label, result)


def _outcome(unit: Any, k: int, what: str) -> CaseResult:
    """Result of the ``k``-th force of a unit; the solvers of the last few units are kept for further forces."""
    try:
        solver = pipeline.solver_of(unit, unit.scene)
        result = next(result for number, result in solver.cases([k]) if number == k)
    except (ArithmeticError, MemoryError, RuntimeError, ValueError) as error:  # a run stores it as the case's failure
        raise CaseError(f"{what}: {type(error).__name__}: {error}") from error
    pipeline.keep(unit, unit.scene, solver, READY)
    if isinstance(result, CaseFailure):
        raise CaseError(f"{what}: {result.message}")
    return result


def _asked(
    scene: Scene, station: float | None, angle: float | None, candidate: int | None, pose: Any
) -> tuple[Scene, int]:
    """The scene with the candidate that is asked for among its own, and the candidate's number."""
    given = {"station": station is not None, "candidate": candidate is not None, "pose": pose is not None}
    if sum(given.values()) != 1:
        names = " and ".join(name for name in given if given[name]) or "none of them"
        raise ValueError(f"found {names}, expected one of station (with an angle), candidate and pose")
    moves = {"roll_deg": scene.candidates.roll_deg, "shift_mm": scene.candidates.shift_mm}
    if pose is not None and not isinstance(pose, Mapping):  # that of a pad, where it stands already
        return _with_candidates(scene, {"poses": [grasp_pose(pose)]}), 0
    if pose is not None:
        poses = [*scene.effective()["candidates"].get("poses", ()), plain_tables(pose)]
        return _with_candidates(scene, {"poses": poses} | moves), len(poses) - 1
    if candidate is not None:
        scene = with_sampled_grasps(scene)
        count = len(scene.candidates.poses)
        if not count:
            raise ValueError("the candidates of this scene are stations and angles: give station and angle")
        if candidate not in range(count):
            raise ValueError(f"candidate is {candidate}: expected a number from 0 to {count - 1}")
        return _with_candidates(scene, {"poses": scene.effective()["candidates"]["poses"]} | moves), int(candidate)
    return _at_station(scene, _number("station", station, "m"), angle)


def _at_station(scene: Scene, station: float, angle: float | None) -> tuple[Scene, int]:
    where = scene.candidates
    if not where.station_values_mm:
        raise ValueError("the candidates of this scene are explicit poses: give candidate=0 or a pose")
    if angle is None:
        if len(where.angles_deg) > 1 and scene.axis_symmetry:
            raise ValueError(f"angle is missing: give it in rad, as {where.angles[0]:.4g}")
        angle = where.angles[0]
    angle = _number("angle", angle, "rad")
    if abs(angle) > 2 * math.pi:
        raise ValueError(f"angle is {angle:g}: expected one up to a whole turn, 2 pi [rad]")
    stations, s = _joined(where.station_values_mm, converted(station, "m", "mm"))
    angles, a = _joined(where.angles_deg, converted(angle, "rad", "deg"))
    table = {"stations_mm": stations, "angles_deg": angles, "roll_deg": where.roll_deg, "shift_mm": where.shift_mm}
    return _with_candidates(scene, table), s * len(angles) + a


def _number(name: str, value: Any, unit: str) -> float:
    if isinstance(value, str | bool) or np.ndim(value) or not np.isreal(value):
        raise TypeError(f"{name} is {value!r}: expected one number [{unit}]")
    if not math.isfinite(value):
        raise ValueError(f"{name} is {value}: expected a finite number [{unit}]")
    return float(value)


def _joined(values: Sequence[float], value: float) -> tuple[list[float], int]:
    """Rising values with one more, unless it is there already, and its position."""
    for i, known in enumerate(values):
        if math.isclose(known, value, **SAME):
            return list(values), i
    joined = sorted([*values, value])
    return joined, joined.index(value)


def _with_candidates(scene: Scene, table: dict[str, Any]) -> Scene:
    return Scene.of_tables(scene.effective() | {"candidates": table})


def grasp_pose(pose: Any) -> Mapping[str, Any]:
    """A pose as a scene's ``[[candidates.poses]]`` has it: from a matrix ``(4, 4)``, or both pads' poses.

    Raises `ValueError`: the matrix is none of a motion; `TypeError`: it is neither.
    """
    if isinstance(pose, tuple) and [np.shape(part) for part in pose] == [(2, 3, 3), (2, 3)]:
        # as `GraspPoint.pose` gives them: finger 1's is enough, for the other one comes from the opposite side
        pose = np.vstack([np.column_stack([pose[0][0], pose[1][0]]), [0.0, 0.0, 0.0, 1.0]])
    matrix = np.zeros(0)
    with suppress(TypeError, ValueError):  # of a text, or of parts of different shapes
        matrix = np.asarray(pose, dtype=float)
    if matrix.shape != (4, 4):
        text = "a mapping with point_mm, approach and long_side, a matrix (4, 4) with the translation in m, or a pair"
        raise TypeError(f"pose is {shown(pose)}: expected {text} of both pads' rotations and origins")
    R, last = matrix[:3, :3], matrix[3] - [0.0, 0.0, 0.0, 1.0]
    if not np.abs(last).max() <= 1e-6:
        raise ValueError(f"pose has the last row {matrix[3].tolist()}: expected 0, 0, 0, 1; is it transposed?")
    if not np.isfinite(matrix).all() or np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0:
        text = "right-handed unit columns: long side, short side, approach"
        raise ValueError(f"pose has the rotation {R.tolist()}: expected {text}")
    return {"point_mm": (1e3 * matrix[:3, 3]).tolist(), "approach": R[:, 2].tolist(), "long_side": R[:, 0].tolist()}
