"""Knobs that change what is made of a contact, not the contact: they are timed on contacts that are solved once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from softjaw.friction.frame import contact_frame, contact_length, in_frame
from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.wrench import friction_limits, friction_wrench
from softjaw.lsfit.ellipsoid import three_motion_ellipsoid
from softjaw.scoring.contact import EllipsoidBody, PolytopeBody, SoftContact
from softjaw.scoring.graspit import linearised_contacts
from softjaw.scoring.polytope import hull_volume
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.score import score
from softjaw.study.accuracy.cost.levels import HULL, POINTS, SURFACES, WINKLER
from softjaw.study.accuracy.cost.measure import QUANTITIES, Measured, cpu_seconds, least_seconds
from softjaw.study.accuracy.cost.probes import Probe
from softjaw.study.accuracy.cost.winkler import winkler_pad
from softjaw.study.case import model
from softjaw.study.case.build import build_object
from softjaw.study.case.contact import X_OF_PAD, Contact
from softjaw.study.case.grasp import grasp_values, lengths
from softjaw.study.case.limit_surface import bound
from softjaw.study.case.solving import solver
from softjaw.study.quantities import MODELS
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Solved:
    """Contacts of a probe at its forces, with the CPU time of one contact solve [s]."""

    probe: Probe
    obj: Any
    contacts: list[list[Contact]]
    seconds: float

    @property
    def scene(self) -> Scene:
        """The probe's scene."""
        return self.probe.unit.scene


def solved(probe: Probe) -> Solved:
    """Solve a probe's contacts at the scene's own settings.

    Raises
    ------
    ConvergenceError, CheckError
        Where a force has no state.
    """
    scene = probe.unit.scene
    obj = build_object(scene.object)
    fingers = [model.approach(obj, pose, scene.gripper.pad_size) for pose in probe.unit.candidate.poses]

    def climb() -> list[list[Contact]]:
        solving = solver(scene, fingers, probe.unit.candidate.poses)
        try:
            return [[c for c, *_ in outcome.contacts] for outcome in solving.ladder(probe.forces)]
        finally:
            solving.destroy()

    seconds, contacts = cpu_seconds(climb)
    return Solved(probe, obj, contacts, seconds / len(probe.forces))


def judge(found: Solved, knob: str, level: str) -> Measured:
    """A probe's cases at a level of a knob; the score's hulls only at the highest force, because they take seconds."""
    work: Callable[[list[Contact], float], FloatArray] = {
        "contact model": _contact_model, "motions sampled": _motions, "limit surface": _surface, "score": _score,
    }[knob](found, level)  # fmt: skip
    forces, contacts = found.probe.forces, found.contacts
    if knob == "score":
        forces, contacts = forces[-1:], contacts[-1:]
    values, own, repeats, message = [], 0.0, 1, ""
    for force, pair in zip(forces, contacts, strict=True):
        try:
            seconds, value, repeats = least_seconds(lambda pair=pair, force=force: work(pair, force))
        except Exception as error:  # whatever a case dies of is its result, as in a run
            reason = str(error).partition("\n")[0]  # Qhull prints its whole state
            seconds, value, message = 0.0, np.full(len(QUANTITIES), np.nan), f"{type(error).__name__}: {reason}"
        values.append(value)
        own += seconds / len(forces)
    whole = own if level == WINKLER else own + found.seconds
    return Measured(
        f"{knob}: {level}", level, found.probe.label, np.array(forces), np.array(values), whole, own, repeats, message
    )


def _contact_model(found: Solved, level: str) -> Callable:
    if level == WINKLER:
        return lambda _, force: winkler_case(found, force)
    number = MODELS.index("flat" if level.endswith("planar") else "curved")
    return lambda contacts, _: _judged(found, contacts, found.scene.limit_surface, number)


def _motions(found: Solved, level: str) -> Callable:
    choice = found.scene.limit_surface.model_copy(update={"samples": int(level)})
    return lambda contacts, _: _judged(found, contacts, choice, 0, "quality_fitted")


def _surface(found: Solved, level: str) -> Callable:
    for name, kind, objective in SURFACES:
        if name == level:
            update = {"model": kind, "objective": objective}
            choice = found.scene.limit_surface.model_copy(update=update)
            return lambda contacts, _: _judged(found, contacts, choice, 0, "quality_fitted")
    return lambda contacts, _: _with_quality(found, contacts, [_wrench_hull(found.scene, c) for c in contacts])


def _score(found: Solved, level: str) -> Callable:
    def ellipsoids(contacts: list[Contact]) -> list[EllipsoidBody]:
        return [EllipsoidBody(c.ellipsoids["curved"].semi_axes) for c in contacts]

    if level == "exact":
        return lambda contacts, _: _with_quality(found, contacts, ellipsoids(contacts))

    def hull(contacts: list[Contact], _: float) -> FloatArray:
        size, count = lengths(found.scene, found.obj, contacts), POINTS[level]
        soft = [SoftContact(c.origin, c.axes, body) for c, body in zip(contacts, ellipsoids(contacts), strict=True)]
        cones = []
        for contact in linearised_contacts(soft, count, size.torques):
            V = contact.body.vertices
            load = np.hstack([np.ones((len(V), 1)), V]) @ contact.wrench_map(size.arms, size.torques, np.zeros(3)).T
            cones.append(np.vstack([np.zeros(6), load]))
        sums = (cones[0][:, None] + cones[1][None]).reshape(-1, 6)
        return np.array([*_limits(contacts, "curved"), hull_volume(sums)])

    return hull


def _judged(found: Solved, contacts: list[Contact], choice: Any, number: int, quality: str = "quality") -> FloatArray:
    """`QUANTITIES` with a limit surface fitted as ``choice`` says."""
    bounds = [{m: bound(c.local, c.rho, c.unit_limits[m], m, choice) for m in MODELS} for c in contacts]
    scores, _ = grasp_values(found.scene, found.obj, contacts, bounds)
    return np.array([*_limits(contacts, MODELS[number]), scores[f"maps/{quality}"][number]])


def _limits(contacts: list[Contact], name: str) -> tuple[float, float, float]:
    """e_n, largest force and torque that the weaker finger carries."""
    own = [c.limits[name] for c in contacts]
    return min(x.e_n for x in own), max(min(x.f_x for x in own), min(x.f_y for x in own)), min(x.tau_z for x in own)


def _with_quality(found: Solved, contacts: list[Contact], bodies: list[Any]) -> FloatArray:
    """`QUANTITIES` with the exact quality of any bodies in the pose that the contacts have."""
    size = lengths(found.scene, found.obj, contacts)
    soft = [SoftContact(c.origin, c.axes, body) for c, body in zip(contacts, bodies, strict=True)]
    quality = pose_volume(*soft, size.arms, size.torques, with_l1=False).linf
    return np.array([*_limits(contacts, "curved"), quality])


def _wrench_hull(scene: Scene, contact: Contact) -> PolytopeBody:
    """The limit surface itself, from inside: the hull of many friction wrenches per unit of S."""
    twists = fibonacci_twists(HULL, contact.rho)
    wrench = friction_wrench(contact.local, twists, scene.friction.mu)[:, [0, 1, 5]] / contact.limits["curved"].S
    wrench = np.vstack([wrench, -wrench])  # the reverse of a motion
    try:
        return PolytopeBody(wrench[ConvexHull(wrench / [1.0, 1.0, contact.rho]).vertices])
    except QhullError:
        return PolytopeBody(wrench)


def winkler_case(found: Solved, force: float) -> FloatArray:
    """`QUANTITIES` of a rigid object between two Winkler foundations, from the scene alone."""
    scene, ellipsoids, limits, origins = found.scene, [], [], []
    for pose in found.probe.unit.candidate.poses:
        finger = model.approach(found.obj, pose, scene.gripper.pad_size)
        patch = winkler_pad(scene.gripper, finger).patch(force)
        frame = contact_frame(patch, X_OF_PAD)
        local = in_frame(patch, frame)
        own = friction_limits(local, scene.friction.mu, "flat")
        limits.append(own)
        ellipsoids.append(three_motion_ellipsoid(*own.per_unit_force, contact_length(local)).semi_axes)
        origins.append(finger.pose.to_object(frame.origin[None])[0])
    distance = float(np.linalg.norm(origins[1] - origins[0]))
    arms = scene.score.object_length or float(np.ptp(found.obj.bounds, axis=0).max())
    torques = scene.score.contact_length or scene.gripper.pad_length
    torques = arms if scene.score.torque_scale == "object" else torques
    e_n, force_x, force_y, torque = (min(getattr(x, n) for x in limits) for n in ("e_n", "f_x", "f_y", "tau_z"))
    return np.array([e_n, max(force_x, force_y), torque, score(*ellipsoids, distance, arms, torques).quality])
