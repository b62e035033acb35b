"""Which candidates promise most on a bed of springs, and which cannot hold: known before anything is solved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softjaw.friction.patch import NoContactError
from softjaw.study.case.bed import JawsOnSurface, held
from softjaw.study.case.build import build_object, surface_triangles
from softjaw.study.case.candidates import Unit
from softjaw.study.case.contact import slips
from softjaw.study.case.fit import jaws_of
from softjaw.study.case.poses import STANDOFF
from softjaw.study.case.task import Task, task_of
from softjaw.study.quantities import MISSING, SLIPS, WORSE
from softjaw.study.scene import Scene


@dataclass(frozen=True)
class Promise:
    """What a bed of springs says of a grasp: its payload [kg], less where foam is crushed, and lean of its line [rad].

    ``rim`` tells whether a pad bears on its rim alone.
    """

    payload: float
    lean: float
    rim: bool


def promise(surface: Any, unit: Unit, task: Task | None) -> Promise | None:
    """What a unit's grasp of a surface promises, with its payload if there is a task; None where a pad passes."""
    pose, jaws = unit.candidate.poses[0], jaws_of(unit.scene)
    point = pose.origin + STANDOFF * pose.rotation[:, 2]
    try:
        grip = JawsOnSurface(surface, point, pose.rotation, jaws)
        _, lean = grip.misalignment
        centres = np.abs([side.centre for side in grip.sides]) / jaws.pad[:2]
        payload = grip.peak * held(grip.contacts, task) if task else 0.0
        # share of a pad's side, from its middle: where pressure centred further out bears on the rim alone
        return Promise(payload, lean, bool((centres > 0.4).any()))
    except NoContactError:
        return None


def chosen(scene: Scene, units: Sequence[Unit]) -> list[Unit]:
    """Units with the states of those that the scene does not want solved, and a mark on those that come last.

    Each point of a sweep chooses for itself; images of one grasp count once.
    """
    where = scene.candidates
    # units whose order of work is looked at where the scene does not ask for it
    if where.solve_best is None and len(units) > 2000:
        return list(units)
    known: list[tuple[Unit, float]] = []
    for unit in units:
        if unit.state == MISSING:
            shape = unit.scene.object
            task = task_of(unit.scene, build_object(shape)) if isinstance(where.solve_best, int) else None
            unit, payload = _seen(
                unit, promise(surface_triangles(shape), unit, task), where.solve_best == "holding"
            )
        else:
            payload = -math.inf
        known.append((unit, payload))
    return _best(known, where.solve_best if isinstance(where.solve_best, int) else None)


def _seen(unit: Unit, promise: Promise | None, skip: bool) -> tuple[Unit, float]:
    if promise is None:
        return unit, -math.inf
    mu = unit.scene.friction.mu
    # a bed of springs is believed that a grasp slips where 1.1 of the friction coefficient do not hold it
    if not slips(promise.lean, 1.1 * mu):
        return replace(unit, hopeless=promise.rim), promise.payload
    text = (
        f"the line that joins the contacts leans by {math.degrees(promise.lean):.0f} degrees on a bed of springs,"
        f" friction holds up to {math.degrees(math.atan(mu)):.0f}"
    )
    if not skip:
        return replace(unit, hopeless=True), promise.payload
    return replace(unit, hopeless=True, state=SLIPS, reason=text), promise.payload


def _best(known: Sequence[tuple[Unit, float]], count: int | None) -> list[Unit]:
    """The best ``count`` units of each point of the sweep stay, those that cannot hold are the worst."""
    if count is None:
        return [unit for unit, _ in known]
    points: dict[int, list[int]] = {}
    for i, (unit, _) in enumerate(known):
        if unit.state == MISSING:
            points.setdefault(id(unit.scene), []).append(i)
    made = [unit for unit, _ in known]
    for members in points.values():
        best = max((known[i][1] for i in members), default=0.0)
        share = [max(payload, 0.0) / best if best > 0 else 0.0 for _, payload in known]
        # digits of a payload over the best one, by which units are ranked: ties go to the first
        ranks = sorted(members, key=lambda i: (made[i].hopeless, -round(share[i], 3), i))
        for place, i in enumerate(ranks[count:], start=count + 1):
            text = f"place {place} of {len(ranks)} on a bed of springs, candidates.solve_best is {count}"
            made[i] = replace(made[i], state=WORSE, reason=text)
    return made
