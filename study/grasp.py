"""Score of the grasp by both contacts: in closed form where they face each other, by integration elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scoring.score import score
from scoring.volume import volume_linf
from study.contact import Contact
from study.limit_surface import Bound
from study.quantity import MODELS
from study.scene import Scene


def grasp_values(
    scene: Scene, obj: Any, contacts: Sequence[Contact], bounds: Sequence[Mapping[str, Bound]]
) -> tuple[dict[str, Any], int]:
    """Maps of the grasp's quality, one value for each friction model, and the flag of the score."""
    object_length = scene.score.object_length or float(np.ptp(obj.bounds, axis=0).max())
    contact_length = scene.score.contact_length or scene.gripper.pad_length
    if scene.score.torque_scale == "object":
        contact_length = object_length
    distance = float(np.linalg.norm(contacts[1].origin - contacts[0].origin))
    found: dict[str, list[float]] = {"quality": [], "quality_fitted": [], "epsilon": []}
    flag = 0
    for m in MODELS:
        one, two = (c.ellipsoids[m].semi_axes for c in contacts)
        exact = score(one, two, distance, object_length, contact_length)
        sizes = [size for own in bounds for size in _volume_and_shadow(own[m], scene.friction.mu, contact_length)]
        found["quality"].append(exact.quality)
        found["quality_fitted"].append(volume_linf(*sizes, distance / object_length))
        found["epsilon"].append(exact.epsilon)
        flag |= int(exact.flag) * (m == MODELS[0])
    return {f"maps/{name}": values for name, values in found.items()}, flag


def _volume_and_shadow(bound: Bound, mu: float, contact_length: float) -> tuple[float, float]:
    """Volume and shadow of a fitted surface in ``(f_x, f_y, tau_z / contact_length)`` per unit force."""
    return mu**3 * bound.rho / contact_length * bound.surface.volume, mu**2 * bound.surface.shadow_area
