"""What a grasp has to hold, and the mass that two contacts hold."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softjaw.friction.wrench import friction_discs
from softjaw.scoring.contact import DiscBody
from softjaw.scoring.payload import BOUND_GAP, Payload, payload
from softjaw.study.case.build import centre_of_mass, own_frame
from softjaw.study.case.contact import Contact
from softjaw.study.flags import Flag
from softjaw.study.quantities import MODELS
from softjaw.study.scene import Scene
from softjaw.study.units import GRAVITY

PLANAR_GAP = 3e-3  # of the bounds of a payload in the planar models, on which no choice depends


class Task(NamedTuple):
    """What a grasp has to hold.

    ``centre_of_mass`` (3,) array: in the object's frame [m]. ``direction`` (3,) array, optional: in which the weight
    pulls; None for every direction. ``kind``: what happens to the normal forces under load, of `scoring.payload.KINDS`.
    ``mass``: of the object [kg].
    """

    centre_of_mass: ArrayLike
    direction: ArrayLike | None = None
    kind: str = "shared"
    mass: float | None = None


def task_of(scene: Scene) -> Task:
    """The task that a scene's sections ``[object]`` and ``[task]`` give."""
    keys, placed = scene.task, own_frame(scene.object)
    direction = None if keys.direction is None else np.array(keys.direction) @ placed.rotation
    return Task(centre_of_mass(scene), direction, keys.drive, scene.object.mass)


def payload_values(contacts: Sequence[Contact], task: Task) -> tuple[dict[str, Any], Flag]:
    """Maps of what the grasp holds, one value for each friction model, and whether it holds itself (curved model)."""
    payloads = [_payload(contacts, model, task) for model in MODELS]
    return _maps(np.array([p.force for p in payloads]), task), Flag(0) if payloads[0].borne else Flag.NOT_BORNE


def payload_alone(contacts: Sequence[Contact], task: Task, least: float = 0.0) -> dict[str, Any]:
    """The maps of `payload_values` in the curved model; of a payload below ``least`` [kg] any bound below it."""
    return _maps(_payload(contacts, MODELS[0], task, least * GRAVITY).force, task)


def _maps(force: Any, task: Task) -> dict[str, Any]:
    """Mass and safety factor by the weight that is held [N]."""
    mass = force / GRAVITY
    return {"maps/payload": mass} | ({} if task.mass is None else {"maps/safety_factor": mass / task.mass})


def _payload(contacts: Sequence[Contact], model: str, task: Task, least: float = 0.0) -> Payload:
    soft = [c.soft(DiscBody(friction_discs(c.local, c.mu, model))) for c in contacts]
    pressure = [c.pressure_wrench for c in contacts]
    drive = [c.drive(p) for c, p in zip(contacts, pressure, strict=True)]
    gap = BOUND_GAP if model == MODELS[0] else PLANAR_GAP
    return payload(soft, pressure, task.centre_of_mass, task.direction, task.kind, drive, gap, least)
