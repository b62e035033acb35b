"""Which candidates promise most on a bed of springs, and which cannot hold: known before anything is solved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softjaw.friction.patch import NoContactError
from softjaw.study.case.bed import JawsOnSurface
from softjaw.study.case.build import surface_triangles
from softjaw.study.case.candidates import Unit
from softjaw.study.case.contact import slips
from softjaw.study.case.fit import jaws_of
from softjaw.study.case.poses import STANDOFF
from softjaw.study.quantities import MISSING, SLIPS, WORSE
from softjaw.study.scene import Scene

DIGIT = 1e-9  # [m], to which promises are rounded before they are ranked: ties go to the first unit
SURELY = 1.1  # of the friction coefficient, beyond which a bed of springs is believed that a grasp slips
RIM = 0.4  # of a pad's side, from its middle: where pressure centred further out bears on the rim alone
MOST_JUDGED = 2000  # units whose order of work is looked at where the scene does not ask for it


@dataclass(frozen=True)
class Promise:
    """What a bed of springs says of a grasp: `bed.JawsOnSurface.quality` [m], lean of the contacts' line [rad].

    ``rim`` tells whether a pad bears on its rim alone.
    """

    quality: float
    lean: float
    rim: bool


def promise(surface: Any, unit: Unit) -> Promise | None:
    """None where a pad passes the object."""
    pose, jaws = unit.candidate.poses[0], jaws_of(unit.scene)
    point = pose.origin + STANDOFF * pose.rotation[:, 2]
    try:
        grip = JawsOnSurface(surface, point, pose.rotation, jaws)
        _, lean = grip.misalignment
        centres = np.abs([side.centre for side in grip.sides]) / jaws.pad[:2]
        return Promise(grip.quality, lean, bool((centres > RIM).any()))
    except NoContactError:
        return None


def chosen(scene: Scene, units: Sequence[Unit]) -> list[Unit]:
    """Units with the states of those that the scene does not want solved, and a mark on those that come last.

    Each point of a sweep chooses for itself; images of one grasp count once.
    """
    where = scene.candidates
    if where.solve_best is None and len(units) > MOST_JUDGED:
        return list(units)
    known: list[tuple[Unit, float]] = []
    for unit in units:
        if unit.state == MISSING:
            surface = surface_triangles(unit.scene.object)
            unit, quality = _seen(unit, promise(surface, unit), where.solve_best == "holding")
        else:
            quality = -math.inf
        known.append((unit, quality))
    return _best(known, where.solve_best if isinstance(where.solve_best, int) else None)


def _seen(unit: Unit, found: Promise | None, skip: bool) -> tuple[Unit, float]:
    if found is None:
        return unit, -math.inf
    mu = unit.scene.friction.mu
    if not slips(found.lean, SURELY * mu):
        return replace(unit, hopeless=found.rim), found.quality
    text = (
        f"the line that joins the contacts leans by {math.degrees(found.lean):.0f} degrees on a bed of springs,"
        f" friction holds up to {math.degrees(math.atan(mu)):.0f}"
    )
    if not skip:
        return replace(unit, hopeless=True), found.quality
    return replace(unit, hopeless=True, state=SLIPS, reason=text), found.quality


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
        ranks = sorted(members, key=lambda i: (made[i].hopeless, -_rounded(known[i][1]), i))
        for place, i in enumerate(ranks[count:], start=count + 1):
            text = f"place {place} of {len(ranks)} on a bed of springs, candidates.solve_best is {count}"
            made[i] = replace(made[i], state=WORSE, reason=text)
    return made


def _rounded(quality: float) -> float:
    return round(quality / DIGIT) if math.isfinite(quality) else quality
