"""Whether the grasp holds the object's weight, and with how much to spare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softjaw.scoring.contact import PolytopeBody, SoftContact
from softjaw.scoring.task import hold_task, weight_wrench
from softjaw.study.case.contact import Contact
from softjaw.study.case.limit_surface import Bound
from softjaw.study.quantities import MODELS
from softjaw.study.scene import Scene


def safety_factors(
    scene: Scene, obj: Any, contacts: Sequence[Contact], bounds: Sequence[Mapping[str, Bound]]
) -> list[float]:
    """Largest multiple of the object's weight that the grasp holds, for each friction model.

    Each finger presses with at most the normal force of this case. Its friction is the hull of the sampled wrenches,
    which lies inside the exact limit surface: the factor errs on the safe side, by about 1 % with 500 samples.
    """
    mu = scene.friction.mu
    if mu == 0 or any(b.surface.rank < 3 for own in bounds for b in own.values()):
        return [np.nan] * len(MODELS)
    centre = scene.task.centre_of_mass or np.mean(obj.bounds, axis=0)
    weight = weight_wrench(scene.object.mass, scene.task.weight_direction, centre)
    grip = [c.limits[MODELS[0]].F_N for c in contacts]
    factors = []
    for m in MODELS:
        soft = []
        for c, own in zip(contacts, bounds, strict=True):
            wrench = mu / c.limits[m].F_N * own[m].wrench[:, [0, 1, 5]]
            soft.append(SoftContact(c.origin, c.axes, PolytopeBody(np.vstack([wrench, -wrench]))))
        factors.append(hold_task(soft, grip, weight).safety_factor)
    return factors
