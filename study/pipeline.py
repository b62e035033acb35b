"""The paper on one page: press both fingers, read the contact patches, bound the friction, score the grasp.

``solve_unit`` follows the load path of one candidate; all that it computes is in the ``CaseResult`` of each force.
"""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Generator, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from softjaw.study.case import model
from softjaw.study.case.build import build_object, own_frame, pad_shape
from softjaw.study.case.choosing import Candidate
from softjaw.study.case.effects import Simulated, settled
from softjaw.study.case.evaluate import EvaluationSettings, evaluate, mesh_errors, settings_of
from softjaw.study.case.finer import stored, weight_of
from softjaw.study.case.result import CaseFailure, CaseResult
from softjaw.study.case.solving import PressedContact, Solved, state_flags
from softjaw.study.case.topology import of_fingers
from softjaw.study.case.wall import wall_flags
from softjaw.study.flags import Flag, flag_sentences
from softjaw.study.quantities import misses


def solve_unit(
    unit: Any, wanted: Collection[int] | None = None
) -> Generator[tuple[int, CaseResult | CaseFailure], None, None]:
    """Cases of one candidate, force by force upward, of which ``wanted`` are asked for, else all.

    Each force starts from the state at the one before, so that all up to the last one are solved; or it is independent
    of the others, and only those are. Not a bit of a case depends on what is wanted.
    """
    scene = unit.scene
    obj = build_object(scene.object)
    settings = settings_of(scene, obj)
    fingers = [model.approach(obj, pose, scene.gripper) for pose in unit.candidate.poses]
    start = time.perf_counter()
    solving = Candidate(scene, fingers, unit.candidate.poses)
    choosing = time.perf_counter() - start
    try:
        for k, outcome in _outcomes(solving, wanted):
            if isinstance(outcome, CaseFailure):
                yield k, outcome
            else:
                result = _result(settings, solving, k, outcome)
                yield k, _with_note(result, unit.candidate.note, choosing)
                choosing = 0.0  # counted once for all forces
    finally:
        solving.destroy()


def _result(settings: EvaluationSettings, candidate: Candidate, k: int, outcome: Solved) -> CaseResult:
    """Values, checks, work, effects and patches of one case."""
    scene, solving = candidate.asked, candidate.solver
    # of the two finest meshes the finer one is the result, the coarser one tells its error
    start = time.perf_counter()
    fine = [c for c, *_ in outcome.contacts]
    values, fits = evaluate(fine, settings)
    values |= _state_values(fine) | of_fingers(fine, fine[0].state.pad.shape.patch_faces)
    values["maps/flags"] |= state_flags(fine) | candidate.flags_at(k)
    values |= solving.wall_values(outcome)
    if fine[0].state.wall is not None:
        values["maps/flags"] |= wall_flags(scene, fine[0].state, values)
    coarse = [c for _, *coarser in outcome.contacts for c in coarser]
    if len(coarse) == len(fine):
        views = list(zip(*(c.views for c in coarse), strict=True))
        other = _state_values(coarse) | solving.wall_values(outcome, 1)
        values |= mesh_errors(fine, coarse, values, other, settings, views, weight_of(fine, scene))
        # only where the scene asks for a target: without one the sums at the end say how many cases miss the usual one
        if (target := scene.accuracy.target) is not None:
            error = values[f"maps/{scene.accuracy.target_of}_error"]
            values["maps/flags"] |= Flag.COARSE * bool(misses(error, target))
    values |= _work(fine, outcome, time.perf_counter() - start)
    if scene.accuracy.target is not None:
        values["maps/pad_elements"] = math.prod(fine[0].state.pad.shape.elements)
    patches = [stored(c, pad_shape(scene.gripper)) for c in fine]
    patch = {name: np.stack([own[name] for own in patches]) for name in patches[0]}
    message = _notes(values["maps/flags"], fine, outcome.note)
    case = Simulated(scene, fine, fits, solving.planes, solving.fingers_solved)
    effects = candidate.effects_at(k, fine) | settled(case)
    return CaseResult(values, patch, message, effects, tuple(fine))


def _notes(flags: int, contacts: Sequence[PressedContact], note: str) -> str:
    """What there is to know of a case: its flags, what it took to solve it, and a note."""
    own = dict.fromkeys(note for c in contacts for note in c.state.notes)
    return "; ".join(text for text in (flag_sentences(flags), *own, note) if text)


def _with_note(result: CaseResult, note: str, choosing: float) -> CaseResult:
    """The result with a note on the candidate, and the time in which the effects were chosen [s]."""
    times = {key: result.values[key] + choosing for key in ("work/seconds_rest", "work/seconds_total")}
    message = "; ".join(text for text in (result.message, note) if text)
    return replace(result, values=result.values | times, message=message)


def _outcomes(candidate: Candidate, wanted: Collection[int] | None) -> Iterator[tuple[int, Solved | CaseFailure]]:
    """For every force the contacts of both fingers, or why there are none."""
    forces, every = candidate.forces, range(len(candidate.forces))
    if candidate.apart:
        for k, found in candidate.solve(every if wanted is None else sorted(wanted)):
            yield k, found if isinstance(found, Solved) else CaseFailure(str(found))
        return
    last, ended, failed = "no force below it was solved", -1, None
    for k, found in candidate.solve(every):
        if isinstance(found, Solved):
            last = f"the last good force is {forces[k]:g} N"
            yield k, found
        elif found is failed:  # the load path has no further states
            yield k, CaseFailure(f"not tried, because the load path ended at {forces[ended]:g} N: {found}")
        else:
            ended, failed = k, found
            yield k, CaseFailure(f"{found}; {last}")


def image(result: CaseResult, unit: Any, c: int) -> CaseResult:
    """The result of the ``c``-th candidate that a unit serves, in the frame of the object's own file.

    It is the same grasp, turned about the object's axis.
    """
    angle, placed = unit.turns[c], own_frame(unit.scene.object)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    rotation = placed.rotation @ turn
    values = dict(result.values)
    values["fingers/pose_rotation"] = rotation @ values["fingers/pose_rotation"]
    for name in {"fingers/pose_origin", "wall/place"} & values.keys():
        values[name] = values[name] @ rotation.T + placed.origin
    return replace(result, values=values)


def _state_values(contacts: Sequence[PressedContact]) -> dict[str, Any]:
    """What the solved states say beside their patches."""
    closing, checks = [c.state.closing for c in contacts], [vars(c.state.checks) for c in contacts]
    values = {"maps/closing": np.mean(closing), "fingers/closing": closing}
    # of the force that the gripper commands, which the checks compare with the force along the approach
    excess = [c.force_excess for c in contacts]
    values |= {"maps/force_excess": max(excess, key=abs), "fingers/force_excess": excess}
    values["maps/e_n_commanded"] = np.min([c.e_n_commanded for c in contacts], axis=0)
    one, two = (c.pose for c in contacts)
    opening = float((two.origin - one.origin) @ one.rotation[:, 2])
    values |= {"maps/opening": opening, "maps/opening_loaded": opening - sum(closing)}
    return values | {f"checks/{name}": [own[name] for own in checks] for name in checks[0]}


def _work(contacts: Sequence[PressedContact], outcome: Solved, friction: float) -> dict[str, Any]:
    """Work of one case, of which friction, fits and scores took so many seconds."""
    names = (("newton_iterations", "iterations"), ("load_steps", "steps"), ("step_halvings", "halvings"))
    work = {f"work/{key}": [getattr(c.state, name) for c in contacts] for key, name in names}
    spent = [s.seconds for s in outcome.spent]
    for part in ("assembly", "factorisation", "rest"):
        work[f"work/seconds_{part}"] = sum(getattr(s, part) for s in spent)
    return work | {"work/seconds_friction": friction, "work/seconds_total": friction + sum(s.total for s in spent)}
