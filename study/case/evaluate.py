"""Friction, fit and score in one function: two contact patches in, all values of a case out.

The study, the cost study and the uncertainty call `evaluate`, or `quality` where one number is enough; ``softjaw
patch`` takes the limits and fits of the same `Contact`, and `exact_score`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softjaw.friction.patch import FloatArray
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.surface import LimitSurface
from softjaw.scoring.closed_form import volume_linf
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.epsilon import epsilon
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.quality import Score, grasp_score, score
from softjaw.study.case.build import build_object, full
from softjaw.study.case.contact import Contact, angle, angles, pose_flags
from softjaw.study.case.limit_surface import SurfaceFit, fit_flag, fit_surface, surface_values
from softjaw.study.case.task import Task, payload_values, task_of
from softjaw.study.flags import raised
from softjaw.study.quantities import MODELS
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import LimitSurfaceKeys as Choice
from softjaw.study.units import in_si

FACING = math.radians(0.5)  # misalignment up to which the closed form is off by less than 1e-4
EPSILON_GAP = 1e-2  # relative gap between the bounds of epsilon
LIMITS = (("f_x", "f_x_max"), ("f_y", "f_y_max"), ("tau_z", "tau_z_max"))  # attribute, quantity
ECCENTRICITIES = ("e_n", "e_n_ratio", "e_n_projected")  # attributes and quantities alike
PLANAR = {"pcm": "", "pcm_projected": "_pcm_projected"}  # suffixes of the quantities that compare with these models
Fits = Mapping[str, SurfaceFit]  # by friction model


@dataclass(frozen=True, eq=False)  # by identity, so that what was computed with it can be found again
class EvaluationSettings:
    """What is computed from two contacts.

    ``arms`` (3,) array or float: lengths by which the arms of forces are divided along x, y and z of the object's
    frame, or one for all [m]. ``torques``: length by which torques about the normals are divided [m]. ``task``: what is
    to be held. ``surface``: section ``[limit_surface]`` of a scene. ``epsilon_everywhere, six``: whether to find
    epsilon in any pose, and 6-D ellipsoids.
    """

    arms: ArrayLike
    torques: float
    task: Task
    surface: Choice = field(default_factory=Choice)
    epsilon_everywhere: bool = False
    six: bool = False


def lengths(scene: Scene, obj: Any) -> tuple[FloatArray, float]:
    """Lengths of arms ``(3,)`` and of torques about the normals [m], as ``[score]`` and the object give them.

    The paper scales the object's length along x, y and z to one, so that the arms are divided by its extents in its own
    frame, each along its axis.
    """
    extents = np.ptp(np.asarray(obj.bounds, float), axis=0)
    if scene.object.axis_symmetry in (0, 4):
        extents[:2] = extents[:2].max()  # alike but for rounding, so that images by that symmetry are
    arms_by, torques_by = scene.score.object_length_mm, scene.score.contact_length_mm
    longest = float(extents.max()) if isinstance(arms_by, str) else in_si("arms_mm", arms_by)
    torques = {"pad": scene.gripper.pad_length, "object": longest}
    arms = extents if arms_by == "per_axis" else np.full(3, longest)
    return arms, torques[torques_by] if isinstance(torques_by, str) else in_si("torques_mm", torques_by)


def settings_of(scene: Scene) -> EvaluationSettings:
    """What a scene asks for."""
    return EvaluationSettings(
        *lengths(scene, build_object(full(scene.object))), task_of(scene), scene.limit_surface,
        epsilon_everywhere=scene.score.epsilon == "everywhere", six=scene.effects.wrench == "6-D",
    )  # fmt: skip


def evaluate(
    contacts: Sequence[Contact], settings: EvaluationSettings
) -> tuple[dict[str, Any], list[dict[str, SurfaceFit]]]:
    """Friction limits, limit surfaces and scores of a grasp by two contacts.

    ``contacts``: with poses in the object's frame. Returns the values, keyed ``group/name`` as in
    ``study.quantities``, in SI units (``maps/flags`` has the flags that follow from patches alone), and the fits: for
    each contact its limit surface in every friction model.
    """
    # friction limits come with the contacts, so fitting is the first step that takes time
    first, second = contacts
    fits = [{m: fit_surface(first, m, settings.surface) for m in MODELS}]
    # the patch object itself tells an image: equal numbers would tell it too, but cost a comparison of all faces
    alike = second.patch is first.patch
    fits.append(fits[0] if alike else {m: fit_surface(second, m, settings.surface) for m in MODELS})
    scores, best = _scores(contacts, fits, settings)
    payloads, flag = payload_values(contacts, settings.task)
    values = _friction_values(contacts) | scores | surface_values(contacts, fits, settings.six) | payloads
    values["maps/flags"] = pose_flags(contacts) | raised(best.flag) | fit_flag(fits) | flag
    return values, fits


def _friction_values(contacts: Sequence[Contact]) -> dict[str, Any]:
    """Friction limits of each contact, and of the weaker one."""
    # axes: finger, friction model
    names = "f_x", "f_y", "tau_z", *ECCENTRICITIES
    limits = {name: np.array([[getattr(c.limits[m], name) for m in MODELS] for c in contacts]) for name in names}
    S, F_N = (np.array([getattr(c.limits["ccm"], name) for c in contacts]) for name in ("S", "F_N"))
    tau_pure = [c.tau_pure for c in contacts]
    values = {
        "maps/tau_pure": min(tau_pure), "maps/S": S.mean(), "maps/F_N": F_N.mean(),
        "maps/contact_area": np.mean([c.area for c in contacts]),
        "maps/p_max": max(c.largest_pressure for c in contacts),
        "maps/contact_distance": float(np.linalg.norm(contacts[1].origin - contacts[0].origin)),
        "maps/curvature_loss": 1.0 - F_N.sum() / S.sum(), "maps/misalignment": max(angles(*contacts)),
        "fingers/tau_pure": tau_pure, "fingers/S": S, "fingers/F_N": F_N,
        "fingers/frame_origin": [c.frame.origin for c in contacts],
        "fingers/frame_axes": [c.frame.axes for c in contacts],
        "fingers/frame_flag": [int(c.frame.flag) for c in contacts],
        "fingers/pose_rotation": np.array([c.pose.rotation for c in contacts]),
        "fingers/pose_origin": np.array([c.pose.origin for c in contacts]),
    }  # fmt: skip
    for name in ("semi_axes", "rank"):
        values[f"limit_surface/{name}"] = [[getattr(c.ellipsoids[m], name) for m in MODELS] for c in contacts]
    # a grasp carries what its weaker finger carries
    for name, key in LIMITS:
        values |= {f"maps/{key}": limits[name].min(axis=0), f"fingers/{key}": limits[name]}
    values |= {f"maps/{key}": limits[key].min(axis=0) for key in ECCENTRICITIES}
    values["fingers/e_n_ratio"] = limits["e_n_ratio"]
    return values | {f"maps/{key}": value for key, value in overestimates(contacts).items()}


def overestimates(contacts: Sequence[Contact]) -> dict[str, float]:
    """Share of each planar model's claim that the curved contact cannot carry, for both forces and the torque."""
    shares = {}
    for name, _ in LIMITS:
        for planar, suffix in PLANAR.items():
            pairs = [(getattr(c.limits["ccm"], name), getattr(c.limits[planar], name)) for c in contacts]
            # NaN where the planar model carries nothing: there is no claim to compare with.
            shares[f"{name}_overestimate{suffix}"] = max(1.0 - f / p if p > 0 else np.nan for f, p in pairs)
    return shares


# --- score ------------------------------------------------------------------------------------------------------------


def _scores(
    contacts: Sequence[Contact], fits: Sequence[Fits], settings: EvaluationSettings
) -> tuple[dict[str, Any], Score]:
    """Maps of the grasp's quality, one value for each friction model, and the score of the curved one.

    In closed form where the contacts face each other, exactly in any pose elsewhere.
    """
    facing = faces(contacts, settings)
    rows: list[tuple[float, float, float]] = []
    closed = {m: _closed(contacts, m, settings) for m in MODELS}
    tilt = math.nan  # what the pose makes of the closed form; for all models that of the curved one, which comes first
    for m in MODELS:
        both = _closed_volume(
            [(c.mu**3 * fit[m].rho / settings.torques * fit[m].surface.volume, c.mu**2 * fit[m].surface.shadow_area)
             for fit, c in zip(fits, contacts, strict=True)], contacts, settings)  # fmt: skip
        # a contact that carries nothing in some direction leaves no volume in any pose
        if facing or closed[m].quality == 0:
            rows.append((closed[m].quality, both, closed[m].epsilon))
        else:
            bodies = [fit[m].body(c.mu) for fit, c in zip(fits, contacts, strict=True)]
            ellipsoids = [c.ellipsoids[m] for c in contacts]
            exact = _volume(contacts, ellipsoids, settings)
            if not any(isinstance(body, Quartic) for body in bodies):
                both = exact if settings.surface.model == "three_motions" else _volume(contacts, bodies, settings)
            else:
                # quartics in a pose take seconds: the pose enters by ellipsoids near them
                tilt = _tilt(contacts, bodies, settings) if math.isnan(tilt) else tilt
                both *= tilt
            least = math.nan
            if settings.epsilon_everywhere:
                lengths = settings.arms, settings.torques, 0.5 * (contacts[0].origin + contacts[1].origin)
                least = epsilon(soft(contacts, ellipsoids), *lengths, tolerance=EPSILON_GAP).upper
            rows.append((exact, both, least))
    names = ("maps/quality", "maps/quality_fitted", "maps/epsilon")
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)), closed[MODELS[0]]


def quality(contacts: Sequence[Contact], settings: EvaluationSettings) -> float:
    """The map ``quality`` of the curved model alone."""
    closed = _closed(contacts, MODELS[0], settings).quality
    if faces(contacts, settings) or closed == 0:
        return closed
    return _volume(contacts, [c.ellipsoids[MODELS[0]] for c in contacts], settings)


def faces(contacts: Sequence[Contact], settings: EvaluationSettings) -> bool:
    """Whether the contacts face each other, up to `FACING`, also where their line is scaled along the object's axes."""
    first, second = contacts
    line = _line(contacts, settings)
    return max(*angles(*contacts), angle(first.normal, line), angle(second.normal, -line)) <= FACING


def _line(contacts: Sequence[Contact], settings: EvaluationSettings) -> FloatArray:
    """From the first contact to the second ``(3,)``, over the lengths of arms [-]."""
    return (contacts[1].origin - contacts[0].origin) / np.asarray(settings.arms, float)


def _closed(contacts: Sequence[Contact], model: str, settings: EvaluationSettings) -> Score:
    """Score of the ellipsoids of contacts that face each other."""
    first, second = (c.ellipsoids[model].semi_axes for c in contacts)
    return score(first, second, float(np.linalg.norm(_line(contacts, settings))), 1.0, settings.torques)


def _closed_volume(
    sizes: Sequence[tuple[float, float]], contacts: Sequence[Contact], settings: EvaluationSettings
) -> float:
    """Volume of the grasp wrench space of contacts that face each other, from volume and shadow of both surfaces."""
    return volume_linf(*sizes[0], *sizes[1], float(np.linalg.norm(_line(contacts, settings))))


def _tilt(contacts: Sequence[Contact], bodies: Sequence[LimitSurface], settings: EvaluationSettings) -> float:
    """Volume in the pose by that of the same contacts face to face, for ellipsoids near the bodies.

    It hardly depends on the shape: within 1e-3 it is that of the quartics themselves, whose volume in any pose takes
    several times as long.
    """
    near = [body.ellipsoid if isinstance(body, Quartic) else body for body in bodies]
    if any(body.rank < 3 for body in near):
        return 0.0
    sizes = [(body.volume / settings.torques, body.shadow_area) for body in near]
    return _volume(contacts, near, settings) / _closed_volume(sizes, contacts, settings)


def _volume(contacts: Sequence[Contact], bodies: Sequence[Any], settings: EvaluationSettings) -> float:
    """Volume of the grasp wrench space in any pose; 0 for a contact that carries no load in some direction."""
    # A flat body would fail in the volume's integration, and its result is known.
    if any(body.rank < 3 for body in bodies):
        return 0.0
    first, second = soft(contacts, bodies)
    return pose_volume(first, second, settings.arms, settings.torques, with_l1=False).linf


def soft(contacts: Sequence[Contact], bodies: Sequence[Any]) -> list[SoftContact]:
    """Contacts as a score takes them, each with a limit surface in ``(f_x, f_y, tau_z)`` per unit of S."""
    return [c.soft(body) for c, body in zip(contacts, bodies, strict=True)]


def exact_score(pair: Sequence[SoftContact], arms: float, torques: float) -> dict[str, Any]:
    """Score of one grasp with any bodies in any pose, which may take seconds.

    Returns ``quality`` and ``quality_l1``, the volumes of the grasp wrench space, and lower and upper bound of
    ``epsilon`` for a centre of mass halfway between the contacts.
    """
    lengths = arms, torques, (pair[0].position + pair[1].position) / 2
    volume, ball = grasp_score(pair, *lengths, with_epsilon=False), epsilon(pair, *lengths)
    return {"quality": volume.quality, "quality_l1": volume.quality_l1, "epsilon": [ball.lower, ball.upper]}
