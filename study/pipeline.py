"""The paper on one page: press both fingers, read the contact patches, bound the friction, score the grasp.

``solve_unit`` follows the load path of one candidate; all that it computes is in the ``CaseResult`` of each force.
"""

import math
import time
from collections.abc import Collection, Generator, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.objects.gap import about_z
from softjaw.fem.pad.halving import halved
from softjaw.fem.petsc import Seconds
from softjaw.study.case.build import forces_apart, own_frame, pad_elements, pad_shape, rounds_edges
from softjaw.study.case.contact import of_fingers, on_faces
from softjaw.study.case.effects import COUPLING, SCREENED, EffectChoice, settled
from softjaw.study.case.errors import coarse_errors
from softjaw.study.case.evaluate import evaluate
from softjaw.study.case.pressing import OnWall, state_flags
from softjaw.study.case.result import CaseFailure, CaseResult
from softjaw.study.case.solver import CandidateSolver, Solution, Solved, join_notes
from softjaw.study.case.wall import foot_note, wall_flags
from softjaw.study.flags import Flag, flag_sentences
from softjaw.study.quantities import MODELS, misses
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import COARSE, FINE, FINEST

MOST_SOLVERS = 24  # whose solutions are kept: some MB each, on a wall 40


def solve_unit(
    unit: Any, wanted: Collection[int] | None = None
) -> Generator[tuple[int, CaseResult | CaseFailure], None, None]:
    """Cases of one candidate, force by force upward, of which ``wanted`` are asked for, else all.

    Each force starts from the state at the one before, so that all up to the last one are solved; or it is independent
    of the others, and only those are. Not a bit of a case depends on what is wanted.
    """
    forces = range(len(unit.scene.load.normal_force)) if wanted is None else sorted(wanted)
    coarse = [k for k in forces if unit.finest and unit.finest[k] == COARSE]
    for some, scene in ((coarse, screened(unit.scene)), ([k for k in forces if k not in coarse], unit.scene)):
        if some:
            solver = solver_of(unit, scene)
            try:
                yield from solver.cases(some)
            except GeneratorExit:  # nobody asks for more
                return keep(unit, scene, solver)
            except BaseException:  # interrupted amid a solve, it is not kept
                solver.solver.put_away()
                raise
            keep(unit, scene, solver)


def screened(scene: Scene) -> Scene:
    """The scene on its coarse mesh alone: no friction that acts back unless it is asked for, and no fits."""
    gripper = scene.gripper.model_copy(update={"elements": halved(scene.gripper.elements)})
    surface = scene.limit_surface.model_copy(update={"model": "three_motions", "objective": "least_squares"})
    parts: dict[str, Any] = {"gripper": gripper, "limit_surface": surface}
    parts["accuracy"] = scene.accuracy.model_copy(update={"meshes": 1})
    if scene.effects.friction_pressure_coupling == "auto":
        parts["effects"] = scene.effects.model_copy(update={"friction_pressure_coupling": "none"})
    return scene.model_copy(update=parts)


class UnitSolver:
    """Cases of a unit as a scene solves them, its own or the screened one; states and choices of effects are kept."""

    def __init__(self, unit: Any, scene: Scene) -> None:
        self.unit = unit
        rounder: CandidateSolver | None = solver_of(unit, screened(scene)).solver if rounds_edges(scene) else None
        self.solver: CandidateSolver = CandidateSolver(scene, unit.candidate.poses, rounder)
        self._choice: EffectChoice | None = None

    def cases(self, wanted: Collection[int]) -> Generator[tuple[int, CaseResult | CaseFailure], None, None]:
        """Cases at these forces, upward."""
        start, before = time.perf_counter(), self.solver.seconds
        self.solver.finest = tuple(self.unit.finest) or (FINEST,) * len(self.solver.forces)
        self.solver.together = self.unit.together
        choice = self._choice = self._choice or EffectChoice(self.solver)
        for k, outcome in _outcomes(choice, wanted):
            if isinstance(outcome, CaseFailure):
                yield k, outcome
            elif k in wanted:
                # the first case has the time in which the effects of all were chosen
                yield k, _result(choice, k, outcome, self.unit, start, before)
                start, before = time.perf_counter(), self.solver.seconds


# of units, by scene and number; the last one used comes last
SOLVERS: dict[tuple[Scene, int], UnitSolver] = {}


def solver_of(unit: Any, scene: Scene) -> UnitSolver:
    """Solver of a unit, with what an earlier round or question has solved if it was kept."""
    solver = SOLVERS.pop((scene, unit.index), None) or UnitSolver(unit, scene)
    solver.unit = unit
    return solver


def keep(unit: Any, scene: Scene, solver: UnitSolver, ready: int = 0) -> None:
    """Keep what a solver has solved; the last few, ``ready``, keep their meshes and factors, too."""
    SOLVERS[scene, unit.index] = solver
    for older in list(SOLVERS.values())[: len(SOLVERS) - ready]:
        older.solver.put_away()
    if len(SOLVERS) > MOST_SOLVERS:
        del SOLVERS[next(iter(SOLVERS))]


def _result(choice: EffectChoice, k: int, solved: Solved, unit: Any, begun: float, before: Seconds) -> CaseResult:
    """Values, checks, work, effects and patches of one case; its clock and the solver's stood at ``begun, before``."""
    scene, fine, coarse, settings = unit.scene, solved.fine, solved.coarse, choice.solver.settings
    finest = unit.finest[k] if unit.finest else FINEST
    start, contacts = time.perf_counter(), fine.contacts
    shape = contacts[0].state.pad.shape
    values, fits = evaluate(contacts, settings)
    values |= _state_values(fine) | of_fingers(contacts, shape.patch_faces)
    values["maps/flags"] |= state_flags(contacts) | choice.flags_at(k)
    foot = ""
    if isinstance(fine.fingers, OnWall):
        values["maps/flags"] |= wall_flags(scene, contacts[0].state, values)
        foot = foot_note(scene, contacts[0].state, fine.fingers.shell)
    if coarse:
        values |= solved.errors(values, _state_values(coarse), settings, choice.skipped_share(k), choice.closes_less())
        # only where every case has a target: without one the sums at the end say how many cases miss the usual one
        if (target := scene.accuracy.target) is not None and not unit.finest:
            error = values[f"maps/{scene.accuracy.target_of}_error"]
            values["maps/flags"] |= Flag.COARSE * bool(misses(error, target))
    effects = choice.effects_at(k, contacts) | settled(choice.solver.scene, fine, fits)
    if finest == COARSE:
        if scene.effects.friction_pressure_coupling == "auto":
            effects[COUPLING] = effects[COUPLING]._replace(reason=SCREENED)
        values |= coarse_errors(contacts, values, fine.views, settings, rounds_edges(scene))
        values["maps/flags"] &= ~Flag.COARSE  # its errors say so
    values |= _work(choice.solver, solved, start, begun, before)
    if scene.accuracy.target is not None:
        # what has no finer state, or too many elements there, needs no further round
        beyond = unit.together and finest > FINE and shape.elements != pad_elements(scene, finest)
        values |= {"maps/pad_elements": math.prod(shape.elements), "work/mesh": FINEST if beyond else finest}
    patches = [on_faces(c, pad_shape(scene.gripper)) for c in contacts]
    patch = {name: np.stack([faces[name] for faces in patches]) for name in patches[0]}
    notes = dict.fromkeys(note for c in contacts for note in c.state.notes)
    message = join_notes(flag_sentences(values["maps/flags"]), *notes, foot, solved.note, unit.candidate.note)
    return CaseResult(values, patch, message, effects, tuple(contacts))


def _outcomes(choice: EffectChoice, wanted: Collection[int]) -> Iterator[tuple[int, Solved | CaseFailure]]:
    """For every force the solutions of its case, or why there are none."""
    forces, apart = choice.solver.forces, forces_apart(choice.solver.scene)
    last, failed = "no force below it was solved", None
    for k in sorted(wanted) if apart else range(len(forces)):
        try:
            yield k, choice.case(k)
            last = f"the last good force is {forces[k]:g} N"
        except (ConvergenceError, CheckError) as failure:
            if apart:
                text = str(failure)
            elif failed and failure is failed[1]:  # the load path has no further states
                text = f"not tried, because the load path ended at {failed[0]:g} N: {failure}"
            else:
                failed, text = (forces[k], failure), f"{failure}; {last}"
            yield k, CaseFailure(text)


def image(result: CaseResult, unit: Any, c: int) -> CaseResult:
    """The result of a unit's ``c``-th candidate: the same grasp turned about the object's axis, in the file's frame."""
    placed = own_frame(unit.scene.object)
    rotation = placed.rotation @ about_z(unit.turns[c])
    values = dict(result.values)
    values["fingers/pose_rotation"] = rotation @ values["fingers/pose_rotation"]
    for name in {"fingers/pose_origin", "wall/place"} & values.keys():
        values[name] = values[name] @ rotation.T + placed.origin
    return replace(result, values=values)


def _state_values(solution: Solution) -> dict[str, Any]:
    """What the solved states say beside their patches."""
    contacts = solution.contacts
    closing, checks = [c.state.closing for c in contacts], [c.state.checks._asdict() for c in contacts]
    values = {"maps/closing": np.mean(closing), "fingers/closing": closing}
    # of the force that the gripper commands, which the checks compare with the force along the approach
    excess = [c.limits["ccm"].F_N / c.state.force - 1.0 for c in contacts]
    values |= {"maps/force_excess": max(excess, key=abs), "fingers/force_excess": excess}
    commanded = [[c.unit_limits[name].tau_z / c.state.force for name in MODELS] for c in contacts]
    values["maps/e_n_commanded"] = np.min(commanded, axis=0)
    first, second = (c.pose for c in contacts)
    opening = float((second.origin - first.origin) @ first.rotation[:, 2])
    values |= {"maps/opening": opening, "maps/opening_loaded": opening - sum(closing)}
    values |= {f"checks/{name}": [check[name] for check in checks] for name in checks[0]}
    return values | solution.fingers.wall_values(contacts)


def _work(solver: CandidateSolver, solved: Solved, friction: float, begun: float, before: Seconds) -> dict[str, Any]:
    """Work of a case: all since clock and solver stood at ``begun, before``, friction and scores since ``friction``."""
    names = (("newton_iterations", "iterations"), ("load_steps", "steps"), ("step_halvings", "halvings"))
    states, now, spent = [c.state for c in solved.fine.contacts], time.perf_counter(), solver.seconds
    work: dict[str, Any] = {f"work/{key}": [getattr(s.work, name) for s in states] for key, name in names}
    parts = {name: getattr(spent, name) - getattr(before, name) for name in ("assembly", "factorisation")}
    parts |= {"friction": now - friction, "total": now - begun}
    parts["rest"] = 2.0 * parts["total"] - sum(parts.values())
    return work | {f"work/seconds_{name}": value for name, value in parts.items()}
