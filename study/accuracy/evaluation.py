"""What evaluation parameters change: friction model, motions, limit surface and score of contacts solved once."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.wrench import friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.bodies import PolytopeBody, fibonacci_vertices, hull_volume
from softjaw.study.accuracy.parameters import HULL, POINTS, SURFACES, WINKLER
from softjaw.study.case import model
from softjaw.study.case.build import build_object
from softjaw.study.case.contact import Contact
from softjaw.study.case.effects import EffectChoice
from softjaw.study.case.evaluate import EvaluationSettings, evaluate, lengths, quality, soft, volume_in_pose
from softjaw.study.case.probes import Probe, winkler_pad
from softjaw.study.case.solver import CandidateSolver
from softjaw.study.quantities import MODELS

FloatArray = NDArray[np.float64]
Work = Callable[[Sequence[Contact], float], FloatArray]


@dataclass(frozen=True, eq=False)
class SolvedProbe:
    """Contacts of a probe at its forces, with the CPU time of one contact solve [s]."""

    probe: Probe
    obj: Any
    contacts: Sequence[Sequence[Contact]]
    seconds: float

    @property
    def settings(self) -> EvaluationSettings:
        """Lengths and limit surface of the scene, and nothing else that a scene may ask for."""
        scene = self.probe.unit.scene
        return EvaluationSettings(*lengths(scene, self.obj), scene.limit_surface)


def solved(probe: Probe) -> SolvedProbe:
    """Solve a probe's contacts at the scene's own settings.

    Raises
    ------
    ConvergenceError, CheckError
        Where a force has no state.
    """
    scene = probe.unit.scene
    obj = build_object(scene.object)
    start = time.process_time()
    solver = CandidateSolver(scene, probe.unit.candidate.poses, probe.forces)
    try:
        choice = EffectChoice(solver)
        contacts = [choice.case(k).fine.contacts for k in range(len(probe.forces))]
    finally:
        solver.destroy()
    return SolvedProbe(probe, obj, contacts, (time.process_time() - start) / len(probe.forces))


def as_quantities(values: Mapping[str, Any], model: str = "ccm", score: str = "quality") -> FloatArray:
    """`cost_study.QUANTITIES` of a case in a friction model."""
    names = ("e_n", "f_x_max", "f_y_max", "tau_z_max", score)
    e_n, f_x, f_y, tau_z, volume = (float(values[f"maps/{name}"][MODELS.index(model)]) for name in names)
    return np.array([e_n, max(f_x, f_y), tau_z, volume])


def work_of(found: SolvedProbe, parameter: str, level: str) -> Work:
    """What a level of an evaluation parameter computes from two contacts at a force: `cost_study.QUANTITIES`."""
    match parameter:
        case "contact model" if level == WINKLER:
            return lambda _, force: winkler_case(found, force)
        case "contact model":
            return _evaluated(found, "pcm" if level.endswith("planar") else "ccm", "quality")
        case "motions sampled":
            return _evaluated(found, "ccm", "quality_fitted", samples=int(level))
        case "limit surface" if level in SURFACES:
            kind, objective = SURFACES[level]
            return _evaluated(found, "ccm", "quality_fitted", model=kind, objective=objective)
        case "limit surface":
            mu = found.probe.unit.scene.friction.mu
            return lambda contacts, _: _with_bodies(found, contacts, [_wrench_hull(mu, c) for c in contacts])
        case "score" if level == "exact":
            return lambda contacts, _: _with_bodies(found, contacts, _ellipsoids(contacts))
    return lambda contacts, _: _with_hulls(found, contacts, POINTS[level])


def _evaluated(found: SolvedProbe, friction_model: str, score: str, **choice: Any) -> Work:
    """The ordinary evaluation, with other choices for the limit surface."""
    surface = found.settings.surface.model_copy(update=choice)
    settings = replace(found.settings, surface=surface)
    return lambda contacts, _: as_quantities(evaluate(contacts, settings)[0], friction_model, score)


def _limits(contacts: Sequence[Contact], name: str) -> tuple[float, float, float]:
    """e_n, largest force and torque that the weaker finger carries."""
    own = [c.limits[name] for c in contacts]
    return min(x.e_n for x in own), max(min(x.f_x for x in own), min(x.f_y for x in own)), min(x.tau_z for x in own)


def _ellipsoids(contacts: Sequence[Contact]) -> list[Ellipsoid]:
    return [Ellipsoid(c.ellipsoids["ccm"].semi_axes) for c in contacts]


def _with_bodies(found: SolvedProbe, contacts: Sequence[Contact], bodies: list[Any]) -> FloatArray:
    """Quantities with the exact quality of any bodies in the pose that the contacts have."""
    volume = volume_in_pose(soft(contacts, bodies), found.settings.arms, found.settings.torques)
    return np.array([*_limits(contacts, "ccm"), volume])


def _with_hulls(found: SolvedProbe, contacts: Sequence[Contact], points: int) -> FloatArray:
    """Quantities with the quality by hulls in six dimensions, of so many points on each ellipsoid."""
    settings = found.settings
    cones = []
    for contact, body in zip(soft(contacts, _ellipsoids(contacts)), _ellipsoids(contacts), strict=True):
        V = fibonacci_vertices(body.semi_axes, points)
        loads = contact.wrench_map(settings.arms, settings.torques, np.zeros(3))
        cones.append(np.vstack([np.zeros(6), np.hstack([np.ones((len(V), 1)), V]) @ loads.T]))
    sums = (cones[0][:, None] + cones[1][None]).reshape(-1, 6)
    return np.array([*_limits(contacts, "ccm"), hull_volume(sums)])


def _wrench_hull(mu: float, contact: Contact) -> PolytopeBody:
    """The limit surface itself, from inside: the hull of many friction wrenches per unit of S."""
    twists = fibonacci_twists(HULL, contact.rho)
    wrench = friction_wrench(contact.local, twists, mu)[:, [0, 1, 5]] / contact.limits["ccm"].S
    wrench = np.vstack([wrench, -wrench])  # the reverse of a motion
    try:
        return PolytopeBody(wrench[ConvexHull(wrench / [1.0, 1.0, contact.rho]).vertices])
    except QhullError:
        return PolytopeBody(wrench)


def winkler_case(found: SolvedProbe, force: float) -> FloatArray:
    """Quantities of a rigid object between two Winkler foundations, from the scene alone."""
    scene, contacts = found.probe.unit.scene, []
    for pose in found.probe.unit.candidate.poses:
        finger = model.approach(found.obj, pose, scene.gripper)
        contacts.append(Contact(winkler_pad(scene.gripper, finger).patch(force), scene.friction.mu, finger.pose))
    return np.array([*_limits(contacts, "pcm"), quality(contacts, found.settings, "pcm")])
