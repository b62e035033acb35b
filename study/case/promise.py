"""Which candidates a bed of springs says cannot hold: they come last in the order of work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from softjaw.friction.patch import NoContactError
from softjaw.study.case.bed import JawsOnSurface
from softjaw.study.case.build import surface_triangles
from softjaw.study.case.candidates import Unit
from softjaw.study.case.contact import slips
from softjaw.study.case.fit import jaws_of
from softjaw.study.case.poses import STANDOFF
from softjaw.study.quantities import MISSING

MOST_JUDGED = 2000  # units: judging more would keep the ranks waiting


def hopeless_marked(units: Sequence[Unit]) -> list[Unit]:
    """Units with a mark on those that cannot hold."""
    if len(units) > MOST_JUDGED:
        return list(units)
    return [replace(unit, hopeless=unit.state == MISSING and hopeless(unit)) for unit in units]


def hopeless(unit: Unit) -> bool:
    """Whether a grasp slips on a bed of springs, or a pad of it bears on its rim alone; no where a pad passes."""
    pose, jaws = unit.candidate.poses[0], jaws_of(unit.scene)
    point = pose.origin + STANDOFF * pose.rotation[:, 2]
    try:
        grip = JawsOnSurface(surface_triangles(unit.scene.object), point, pose.rotation, jaws)
        _, lean = grip.misalignment
        centres = np.abs([side.centre for side in grip.sides]) / jaws.pad[:2]
    except NoContactError:
        return False
    # the springs are believed where 1.1 of the friction coefficient do not hold, and where the pressure's centre lies
    # further from the pad's middle than this share of its side
    return slips(lean, 1.1 * jaws.mu) or bool((centres > 0.4).any())
