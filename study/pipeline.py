"""The paper on one page: press both fingers, read the contact patches, bound the friction, score the grasp.

``solve_unit`` climbs the forces of one candidate; everything it computes goes into the ``CaseResult`` of each force.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.friction.motion import cor_grid
from softjaw.friction.wrench import friction_wrench
from softjaw.study.accuracy.uncertainty.probing import Probing
from softjaw.study.case import model
from softjaw.study.case.build import build_object
from softjaw.study.case.contact import Contact, angles, flags
from softjaw.study.case.effects import effects_of
from softjaw.study.case.grasp import grasp_values, quality
from softjaw.study.case.limit_surface import Bound, bound, fit_flag, surface_values
from softjaw.study.case.solving import Solved, Solver, solver
from softjaw.study.case.wall import wall_flags
from softjaw.study.case.weight import safety_factors
from softjaw.study.flags import flag_sentences
from softjaw.study.quantities import MODELS
from softjaw.study.result.result import CaseFailure, CaseResult
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]
LIMITS = (("f_x", "f_x_max"), ("f_y", "f_y_max"), ("tau_z", "tau_z_max"))  # attribute, quantity
PLANAR = (("flat", ""), ("projected", "_projected"))  # planar model, suffix of the quantities that compare with it


def solve_unit(unit: Any) -> Iterator[tuple[int, CaseResult | CaseFailure]]:
    """Cases of one candidate, force by force upward; each force starts from the state at the one before."""
    scene = unit.scene
    obj = build_object(scene.object)
    fingers = [model.approach(obj, pose, scene.gripper.pad_size) for pose in unit.candidate.poses]
    solving, probing = solver(scene, fingers, unit.candidate.poses), Probing(unit)
    try:
        for k, outcome in enumerate(_outcomes(solving, scene.load.normal_force)):
            if isinstance(outcome, CaseFailure):
                yield k, outcome
                continue
            start = time.perf_counter()
            fine = [c for c, *_ in outcome.contacts]
            bounds = [_bounds(scene, fine[0])]
            bounds.append(bounds[0] if fine[1].patch is fine[0].patch else _bounds(scene, fine[1]))
            values = _values(scene, obj, fine, bounds)
            if outcome.grips:
                values |= solving.wall_values(outcome)
                values["maps/flags"] |= wall_flags(scene, outcome.grips[0], values)
            if scene.accuracy.meshes == 2:
                values |= _mesh_errors(*zip(*outcome.contacts, strict=True))
                values |= _quality_error(scene, obj, outcome, values)
            seconds = time.perf_counter() - start
            result = _result(values, outcome, seconds, effects_of(scene, fine, bounds, solving))
            yield k, _probed(result, probing)
    finally:
        probing.close()
        solving.destroy()


def _probed(result: CaseResult, probing: Probing) -> CaseResult:
    """The result with what the further solves of a probe give, and their time."""
    start = time.perf_counter()
    values = result.values | probing.values()
    for name in ("rest", "total"):
        values[f"work/seconds_{name}"] += time.perf_counter() - start
    told = "; ".join(text for text in (result.message, *probing.failures) if text)
    return replace(result, values=values, message=told)


def _outcomes(solving: Solver, forces: Sequence[float]) -> Iterator[Solved | CaseFailure]:
    """For every force the contacts of both fingers, or why there are none."""
    ladder = solving.ladder(forces)
    for k, force in enumerate(forces):
        try:
            yield next(ladder)
        except (ConvergenceError, CheckError) as error:
            good = f"the last good force is {forces[k - 1]:g} N" if k else "no force below it was tried"
            yield CaseFailure(f"{error}; {good}")
            for _ in forces[k + 1 :]:
                yield CaseFailure(f"not tried, because the ladder of forces ended at {force:g} N: {error}")
            return


def image(result: CaseResult, unit: Any, c: int) -> CaseResult:
    """The result of the ``c``-th candidate that a unit serves: the same grasp, turned about the object's axis."""
    angle = unit.turns[c]
    if angle == 0.0:
        return result
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    values = dict(result.values)
    values["fingers/pose_rotation"] = turn @ values["fingers/pose_rotation"]
    values["fingers/pose_origin"] = values["fingers/pose_origin"] @ turn.T
    if "wall/place" in values:
        values["wall/place"] = values["wall/place"] @ turn.T
    return replace(result, values=values)


def _bounds(scene: Scene, contact: Contact) -> dict[str, Bound]:
    """Limit surface of one finger in every friction model."""
    choice = scene.limit_surface
    return {m: bound(contact.local, contact.rho, contact.unit_limits[m], m, choice) for m in MODELS}


def _values(scene: Scene, obj, contacts: list[Contact], bounds: list[dict[str, Bound]]) -> dict[str, Any]:
    """Maps and per-finger values of one case, keyed as in ``study.quantities``."""
    limits = {
        name: np.array([[getattr(c.limits[m], name) for m in MODELS] for c in contacts])
        for name in ("f_x", "f_y", "tau_z", "e_n", "e_n_projected")
    }
    S, F_N = (np.array([getattr(c.limits["curved"], name) for c in contacts]) for name in ("S", "F_N"))
    distance = float(np.linalg.norm(contacts[1].origin - contacts[0].origin))
    scores, score_flag = grasp_values(scene, obj, contacts, bounds)
    areas = [float(c.patch.area[c.loaded].sum()) for c in contacts]
    values = {
        "maps/tau_pure": min(c.tau_pure for c in contacts),
        "maps/S": S.mean(),
        "maps/F_N": F_N.mean(),
        "maps/travel": np.mean([c.state.travel for c in contacts]),
        "maps/contact_area": np.mean(areas),
        "maps/p_max": max(float(c.patch.pressure.max()) for c in contacts),
        "maps/contact_distance": distance,
        "maps/curvature_loss": 1.0 - F_N.sum() / S.sum(),
        "maps/misalignment": max(angles(*contacts)),
        "maps/flags": flags(contacts, scene.friction.mu, score_flag) | fit_flag(bounds),
        "fingers/tau_pure": [c.tau_pure for c in contacts],
        "fingers/S": S,
        "fingers/F_N": F_N,
        "fingers/travel": [c.state.travel for c in contacts],
        "fingers/frame_origin": [c.frame.origin for c in contacts],
        "fingers/frame_axes": [c.frame.axes for c in contacts],
        "fingers/frame_flag": [int(c.frame.flag) for c in contacts],
        "fingers/pose_rotation": np.array([c.finger.pose.rotation for c in contacts]),
        "fingers/pose_origin": np.array([c.finger.pose.origin for c in contacts]),
    }
    for name in ("semi_axes", "rank"):
        values[f"limit_surface/{name}"] = [[getattr(c.ellipsoids[m], name) for m in MODELS] for c in contacts]
    for name, key in LIMITS:
        values[f"maps/{key}"] = limits[name].min(axis=0)
        values[f"fingers/{key}"] = limits[name]
    for key in ("e_n", "e_n_projected"):
        values[f"maps/{key}"] = limits[key].min(axis=0)
    if scene.friction.cor_grid:
        values["fingers/cor_wrench"] = [_cor_wrenches(scene, c) for c in contacts]
    if scene.object.mass is not None:
        values["maps/safety_factor"] = safety_factors(scene, obj, contacts, bounds)
    values |= scores | surface_values(scene, contacts, bounds)
    return values | {f"maps/{key}": value for key, value in _overestimates(contacts).items()}


def _cor_wrenches(scene: Scene, contact: Contact) -> FloatArray:
    """Friction wrenches ``(f_x, f_y, tau_z)`` for the paper's grid of centres of rotation."""
    twists = cor_grid(scene.friction.cor_grid, contact.rho)
    return friction_wrench(contact.local, twists, scene.friction.mu)[:, [0, 1, 5]]


def _overestimates(contacts: Sequence[Contact]) -> dict[str, float]:
    """Share of each planar model's claim that the curved contact cannot carry, for both forces and the torque."""
    shares = {}
    for name, _ in LIMITS:
        for planar, suffix in PLANAR:
            pairs = [(getattr(c.limits["curved"], name), getattr(c.limits[planar], name)) for c in contacts]
            shares[f"{name}_overestimate{suffix}"] = max(1.0 - f / p if p > 0 else np.nan for f, p in pairs)
    return shares


def _mesh_errors(fine: Sequence[Contact], coarse: Sequence[Contact]) -> dict[str, float]:
    """Differences of the curved model's results between the mesh and the one half as fine."""
    errors = {}
    for name, key in (("e_n", "e_n"), *LIMITS):
        pairs = [tuple(getattr(c.limits["curved"], name) for c in pair) for pair in zip(fine, coarse, strict=True)]
        errors[f"maps/{key}_error"] = max(abs(c - f) / f if f > 0 else np.nan for f, c in pairs)
    shares, rough = _overestimates(fine), _overestimates(coarse)
    return errors | {f"maps/{key}_error": abs(value - rough[key]) for key, value in shares.items()}


def _quality_error(scene: Scene, obj, outcome: Solved, values: dict[str, Any]) -> dict[str, float]:
    fine, coarse = values["maps/quality"][0], quality(scene, obj, [c for _, c in outcome.contacts])
    return {"maps/quality_error": abs(coarse - fine) / fine if fine > 0 else np.nan}


def _result(values: dict[str, Any], outcome: Solved, friction: float, effects: dict) -> CaseResult:
    """Values, checks, work and patches of one case."""
    fine = [c for c, *_ in outcome.contacts]
    checks = {f"checks/{name}": [getattr(c.state.checks, name) for c in fine] for name in vars(fine[0].state.checks)}
    for key, name in (("newton_iterations", "iterations"), ("load_steps", "steps"), ("cuts", "cuts")):
        values[f"work/{key}"] = [getattr(c.state, name) for c in fine]
    spent = [s.seconds for s in outcome.spent]
    for part in ("assembly", "factorisation", "rest"):
        values[f"work/seconds_{part}"] = sum(getattr(s, part) for s in spent)
    values |= {"work/seconds_friction": friction, "work/seconds_total": friction + sum(s.total for s in spent)}
    fields = ("pressure", "area", "centroid", "normal")
    patch = {name: np.stack([getattr(c.patch, name) for c in fine]) for name in fields}
    return CaseResult(values | checks, patch, flag_sentences(values["maps/flags"]), effects)
