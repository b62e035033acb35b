"""Knobs that change what is made of a contact, not the contact: they are timed on contacts that are solved once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.wrench import friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.bodies import PolytopeBody, hull_volume
from softjaw.scoring.graspit import linearised_contacts
from softjaw.study.accuracy.cost.knobs import HULL, POINTS, SURFACES, WINKLER
from softjaw.study.accuracy.cost.measure import QUANTITIES, Measured, cpu_seconds, from_maps, least_seconds
from softjaw.study.case import model
from softjaw.study.case.build import build_object
from softjaw.study.case.contact import Contact
from softjaw.study.case.evaluate import EvaluationSettings, evaluate, lengths, quality, volume_in_pose
from softjaw.study.case.probes import Probe, winkler_pad
from softjaw.study.case.solving import solver
from softjaw.study.quantities import MODELS
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SolvedProbe:
    """Contacts of a probe at its forces, with the CPU time of one contact solve [s]."""

    probe: Probe
    obj: Any
    contacts: list[list[Contact]]
    seconds: float

    @property
    def scene(self) -> Scene:
        """The probe's scene."""
        return self.probe.unit.scene

    @property
    def settings(self) -> EvaluationSettings:
        """Lengths and limit surface of the scene, and nothing else that a scene may ask for."""
        return EvaluationSettings(*lengths(self.scene, self.obj), self.scene.limit_surface)


def solved(probe: Probe) -> SolvedProbe:
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
    return SolvedProbe(probe, obj, contacts, seconds / len(probe.forces))


def judge(found: SolvedProbe, knob: str, level: str) -> Measured:
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


def _contact_model(found: SolvedProbe, level: str) -> Callable:
    if level == WINKLER:
        return lambda _, force: winkler_case(found, force)
    number = MODELS.index("pcm" if level.endswith("planar") else "ccm")
    return lambda contacts, _: _judged(found, contacts, found.scene.limit_surface, number)


def _motions(found: SolvedProbe, level: str) -> Callable:
    choice = found.scene.limit_surface.model_copy(update={"samples": int(level)})
    return lambda contacts, _: _judged(found, contacts, choice, 0, "quality_fitted")


def _surface(found: SolvedProbe, level: str) -> Callable:
    for name, kind, objective in SURFACES:
        if name == level:
            update = {"model": kind, "objective": objective}
            choice = found.scene.limit_surface.model_copy(update=update)
            return lambda contacts, _: _judged(found, contacts, choice, 0, "quality_fitted")
    return lambda contacts, _: _with_quality(found, contacts, [_wrench_hull(found.scene, c) for c in contacts])


def _score(found: SolvedProbe, level: str) -> Callable:
    def ellipsoids(contacts: list[Contact]) -> list[Ellipsoid]:
        return [Ellipsoid(c.ellipsoids["ccm"].semi_axes) for c in contacts]

    if level == "exact":
        return lambda contacts, _: _with_quality(found, contacts, ellipsoids(contacts))

    def hull(contacts: list[Contact], _: float) -> FloatArray:
        settings = found.settings
        soft = [c.soft(body) for c, body in zip(contacts, ellipsoids(contacts), strict=True)]
        cones = []
        for contact in linearised_contacts(soft, POINTS[level], settings.torques):
            V = contact.body.vertices
            loads = contact.wrench_map(settings.arms, settings.torques, np.zeros(3))
            cones.append(np.vstack([np.zeros(6), np.hstack([np.ones((len(V), 1)), V]) @ loads.T]))
        sums = (cones[0][:, None] + cones[1][None]).reshape(-1, 6)
        return np.array([*_limits(contacts, "ccm"), hull_volume(sums)])

    return hull


def _judged(
    found: SolvedProbe, contacts: list[Contact], choice: Any, number: int, score: str = "quality"
) -> FloatArray:
    """`QUANTITIES` with a limit surface fitted as ``choice`` says."""
    values, _ = evaluate(contacts, replace(found.settings, surface=choice))
    return from_maps(values, number, score)


def _limits(contacts: list[Contact], name: str) -> tuple[float, float, float]:
    """e_n, largest force and torque that the weaker finger carries."""
    own = [c.limits[name] for c in contacts]
    return min(x.e_n for x in own), max(min(x.f_x for x in own), min(x.f_y for x in own)), min(x.tau_z for x in own)


def _with_quality(found: SolvedProbe, contacts: list[Contact], bodies: list[Any]) -> FloatArray:
    """`QUANTITIES` with the exact quality of any bodies in the pose that the contacts have."""
    return np.array([*_limits(contacts, "ccm"), volume_in_pose(contacts, bodies, found.settings)])


def _wrench_hull(scene: Scene, contact: Contact) -> PolytopeBody:
    """The limit surface itself, from inside: the hull of many friction wrenches per unit of S."""
    twists = fibonacci_twists(HULL, contact.rho)
    wrench = friction_wrench(contact.local, twists, scene.friction.mu)[:, [0, 1, 5]] / contact.limits["ccm"].S
    wrench = np.vstack([wrench, -wrench])  # the reverse of a motion
    try:
        return PolytopeBody(wrench[ConvexHull(wrench / [1.0, 1.0, contact.rho]).vertices])
    except QhullError:
        return PolytopeBody(wrench)


def winkler_case(found: SolvedProbe, force: float) -> FloatArray:
    """`QUANTITIES` of a rigid object between two Winkler foundations, from the scene alone."""
    scene, contacts = found.scene, []
    for pose in found.probe.unit.candidate.poses:
        finger = model.approach(found.obj, pose, scene.gripper.pad_size)
        contacts.append(Contact(winkler_pad(scene.gripper, finger).patch(force), scene.friction.mu, finger.pose))
    return np.array([*_limits(contacts, "pcm"), quality(contacts, found.settings, "pcm")])
