"""Score of the grasp by both contacts: in closed form where they face each other, exactly in any pose elsewhere."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.surface import LimitSurface
from softjaw.scoring.contact import PolytopeBody, SoftContact
from softjaw.scoring.epsilon_search import epsilon
from softjaw.scoring.polytope import graspit_vertices, polytope_volume
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.score import ScoreFlag, score
from softjaw.scoring.volume import volume_linf
from softjaw.study.case.contact import Contact, angles
from softjaw.study.case.limit_surface import Bound
from softjaw.study.quantities import MODELS
from softjaw.study.scene import Scene

FACING = math.radians(0.5)  # misalignment up to which the closed form is off by less than 1e-4
NEAR = 1e-2  # relative gap between the bounds of epsilon


@dataclass(frozen=True)
class Lengths:
    """Distance of the contacts, and the lengths by which arms and torques about the normals are divided [m]."""

    distance: float
    arms: float
    torques: float


def lengths(scene: Scene, obj: Any, contacts: Sequence[Contact]) -> Lengths:
    """The lengths of a grasp, as the scene's ``[score]`` and the object give them."""
    arms = scene.score.object_length or float(np.ptp(obj.bounds, axis=0).max())
    torques = scene.score.contact_length or scene.gripper.pad_length
    if scene.score.torque_scale == "object":
        torques = arms
    return Lengths(float(np.linalg.norm(contacts[1].origin - contacts[0].origin)), arms, torques)


def grasp_values(
    scene: Scene, obj: Any, contacts: Sequence[Contact], bounds: Sequence[Mapping[str, Bound]]
) -> tuple[dict[str, Any], ScoreFlag]:
    """Maps of the grasp's quality, one value for each friction model, and the flag of the score."""
    size = lengths(scene, obj, contacts)
    facing = max(angles(*contacts)) <= FACING
    found: dict[str, list[float]] = {"quality": [], "quality_fitted": [], "epsilon": []}
    if scene.score.graspit:
        found["quality_graspit"] = [_graspit(contacts, m, size, facing) for m in MODELS]
    tilt = math.nan  # what the pose makes of the closed form; for all models that of the curved one, which comes first
    for m in MODELS:
        ellipsoids = [c.ellipsoids[m] for c in contacts]
        closed = score(*(e.semi_axes for e in ellipsoids), size.distance, size.arms, size.torques)
        own = [finger[m] for finger in bounds]
        both = _closed_form(own, scene.friction.mu, size)
        if facing or closed.quality == 0:
            found["quality"].append(closed.quality)
            found["quality_fitted"].append(both)
            found["epsilon"].append(closed.epsilon)
            continue
        found["quality"].append(_volume(contacts, ellipsoids, size))
        fitted = _bodies(own, scene.friction.mu)
        if not any(isinstance(body, Quartic) for body in fitted):
            both = _volume(contacts, fitted, size)
        else:
            tilt = _tilt(contacts, fitted, size) if math.isnan(tilt) else tilt
            both *= tilt
        found["quality_fitted"].append(both)
        search = scene.score.epsilon == "everywhere"
        found["epsilon"].append(_epsilon(contacts, ellipsoids, size) if search else math.nan)
    flag = score(*(c.ellipsoids[MODELS[0]].semi_axes for c in contacts), size.distance, size.arms, size.torques).flag
    return {f"maps/{name}": values for name, values in found.items()}, flag


def quality(scene: Scene, obj: Any, contacts: Sequence[Contact]) -> float:
    """The map ``quality`` of the curved model alone."""
    size, ellipsoids = lengths(scene, obj, contacts), [c.ellipsoids[MODELS[0]] for c in contacts]
    closed = score(*(e.semi_axes for e in ellipsoids), size.distance, size.arms, size.torques).quality
    return closed if max(angles(*contacts)) <= FACING or closed == 0 else _volume(contacts, ellipsoids, size)


def _graspit(contacts: Sequence[Contact], model: str, size: Lengths, facing: bool) -> float:
    """Volume with GraspIt!'s 20 points on each ellipsoid; torques over their length decide where the points lie."""
    axes = [c.ellipsoids[model].semi_axes / [1.0, 1.0, size.torques] for c in contacts]
    if any((a == 0).any() for a in axes):
        return 0.0
    points = [graspit_vertices(a) for a in axes]
    if facing:
        (V, A), (W, B) = (polytope_volume(p) for p in points)
        return volume_linf(V, A, W, B, size.distance / size.arms)
    bodies = [PolytopeBody(p * [1.0, 1.0, size.torques]) for p in points]
    return pose_volume(*_soft(contacts, bodies), size.arms, size.torques, with_l1=False).linf


def _bodies(bounds: Sequence[Bound], mu: float) -> list[LimitSurface]:
    """Fitted surfaces in ``(f_x, f_y, tau_z)`` per unit normal force."""
    return [b.surface.scaled(mu * np.array([1.0, 1.0, b.rho])) for b in bounds]


def _closed_form(bounds: Sequence[Bound], mu: float, size: Lengths) -> float:
    """Volume of the grasp wrench space of two contacts that face each other, with the fitted surfaces."""
    V = [mu**3 * b.rho / size.torques * b.surface.volume for b in bounds]
    A = [mu**2 * b.surface.shadow_area for b in bounds]
    return volume_linf(V[0], A[0], V[1], A[1], size.distance / size.arms)


def _tilt(contacts: Sequence[Contact], bodies: Sequence[LimitSurface], size: Lengths) -> float:
    """Volume in the pose by that of the same contacts face to face, for ellipsoids near the bodies.

    It hardly depends on the shape: within 1e-3 it is that of the quartics themselves, whose volume in any pose takes
    several times as long.
    """
    near = [body.ellipsoid if isinstance(body, Quartic) else body for body in bodies]
    if any(body.rank < 3 for body in near):
        return 0.0
    V = [body.volume / size.torques for body in near]
    A = [body.shadow_area for body in near]
    return _volume(contacts, near, size) / volume_linf(V[0], A[0], V[1], A[1], size.distance / size.arms)


def _soft(contacts: Sequence[Contact], bodies: Sequence[Any]) -> list[SoftContact]:
    return [SoftContact(c.origin, c.axes, body) for c, body in zip(contacts, bodies, strict=True)]


def _volume(contacts: Sequence[Contact], bodies: Sequence[Any], size: Lengths) -> float:
    """Volume of the grasp wrench space in any pose; 0 for a contact that carries no load in some direction."""
    if any(body.rank < 3 for body in bodies):
        return 0.0
    return pose_volume(*_soft(contacts, bodies), size.arms, size.torques, with_l1=False).linf


def _epsilon(contacts: Sequence[Contact], bodies: Sequence[Any], size: Lengths) -> float:
    """Radius of the largest ball in the grasp wrench space about the midpoint of the contacts, in any pose."""
    middle = 0.5 * (contacts[0].origin + contacts[1].origin)
    return epsilon(_soft(contacts, bodies), size.arms, size.torques, middle, tolerance=NEAR).upper
