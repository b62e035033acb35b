"""Levels of every effect: what a case is simulated with, the indicator that says so, and the reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import nan
from typing import Any

import numpy as np

from softjaw.fem.materials import Material, material
from softjaw.fem.pad.backing_plate import relative_compliance
from softjaw.fem.pad.shape import BackingPlate, TiltingMount
from softjaw.friction.patch import FloatArray
from softjaw.study.case.build import pad_shape
from softjaw.study.case.result import surely_below
from softjaw.study.quantities import EFFECTS, REASONS
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import Gripper

# In 440 cases (pads, objects, supports, forces up to 13 N) a rigid plate put e_n off by at most 3.5 times the relative
# compliance of the plate that it stood for (where a pad just reaches the middle of a waist); this keeps it below 1.8 %.
STIFF_PLATE = 0.005
GLUE = 1e4  # stiffness of the glue on a tilting mount over that of the pad: rigid to that share
# In 92 cases friction that acts back moved e_n by at most 0.5 times the traction that it adds, where that was below a
# tenth of the pressure: this keeps it below 1.5 %; see docs/effects.md.
SMALL_TRACTION = 0.03
ONLY, FORCED, BELOW, ABOVE, SYMMETRY, DEFAULT, NO_WALL, CHEAP, LEFT_OUT, APART = range(len(REASONS))
Level = tuple[str, float, int]  # level, indicator (NaN where it is not known) and reason, an index of REASONS
SURFACES = {
    "three_motions": "ellipsoid from three motions",
    "axis_aligned": "fitted ellipsoid",
    "full": "fitted ellipsoid",
    "quartic": "convex quartic",
}
MODEL_SIZES = ("full", "half", "quarter")  # by the number of planes of symmetry


def pad_material(gripper: Gripper) -> Material:
    """Foam of the pads."""
    return material(
        gripper.material, gripper.shear_modulus, gripper.foam_ratio, gripper.shear_moduli, gripper.alpha
    )


def backing_plate(gripper: Gripper) -> BackingPlate:
    """Plate behind each pad."""
    return BackingPlate(gripper.sheet_thickness, gripper.sheet_modulus, gripper.sheet_poisson, gripper.sheet_support)


def tilting_mount(gripper: Gripper) -> TiltingMount | None:
    """Mount of each pad that lets it tilt, or None; its glue is stiff beside the foam."""
    if gripper.tilt_stiffness_nm_per_rad is None:
        return None
    glue = GLUE * pad_material(gripper).young_modulus / gripper.pad_thickness
    return TiltingMount(gripper.tilt_stiffness_nm_per_rad, glue)


@dataclass(frozen=True)
class BackingPlateLevel:
    """Level of the backing plates of a scene; ``reason`` is an index of `study.quantities.REASONS`.

    ``compliance`` is the mean deflection of the plate under an even pressure over that of the pad.
    """

    elastic: bool
    compliance: float
    reason: int


def backing_plate_level(scene: Scene) -> BackingPlateLevel:
    """The level that the scene asks for, else the cheapest whose e_n is good to 2 %."""
    compliance = _compliance(scene.gripper)
    if scene.gripper.tilt_stiffness_nm_per_rad is not None:  # of a plate that is rigid itself
        return BackingPlateLevel(False, compliance, FORCED)
    if scene.effects.sheet != "auto":
        return BackingPlateLevel(scene.effects.sheet == "elastic", compliance, FORCED)
    if surely_below(compliance, STIFF_PLATE):
        return BackingPlateLevel(False, compliance, BELOW)
    return BackingPlateLevel(True, compliance, ABOVE)


@lru_cache(maxsize=8)
def _compliance(gripper: Gripper) -> float:
    shape, (n, m, _) = pad_shape(gripper), gripper.elements
    halves = n % 2 == 0, m % 2 == 0
    x, y = (tuple(map(float, shape.lines(axis, half))) for axis, half in enumerate(halves))
    foam = shape.size[2] / pad_material(gripper).young_modulus
    return relative_compliance(x, y, halves, backing_plate(gripper), foam)


def neglected_traction(state: Any, mu: float) -> float:
    """Share of the pressure sum that friction would add across it, if every point of the face stuck or slid [-].

    A point that moved by ``d`` along the object's surface would be held back by ``min(mu p, E d / thickness)``, as a
    column of foam is that is sheared by ``d``. A slope shows here too: there the whole pad moves along the surface.
    """
    pad, points = state.pad, state.points
    start = np.einsum("qa,fai->fqi", pad.face_N, pad.nodes[pad.face_nodes])
    moved = points.position - start
    along = moved - np.einsum("fqi,fqi->fq", moved, points.normal)[..., None] * points.normal
    stick = pad.modulus_per_thickness * pad.face_area * np.linalg.norm(along, axis=-1)
    # A point that is pulled has no pressure that friction could act on.
    load = np.maximum(points.load, 0.0)
    return float(np.minimum(mu * load, stick).sum() / load.sum())


def dropped_share(wrench: FloatArray, rho: float) -> float:
    """Mean share of a wrench that its three components f_z, tau_x and tau_y make up, of ``wrench (m, 6)``."""
    w = wrench / [1, 1, 1, rho, rho, rho]
    return float((np.linalg.norm(w[:, 2:5], axis=1) / np.linalg.norm(w, axis=1)).mean())


# --- one function for each effect, by its name in study.quantities ----------------------------------------------------


@dataclass(frozen=True)
class Simulated:
    """A solved case: contacts of both fingers, their limit surfaces by friction model, and what solved it."""

    scene: Scene
    contacts: Sequence[Any]
    fits: Sequence[Mapping[str, Any]]
    solver: Any


def effects_of(case: Simulated) -> dict[str, Level]:
    """Level, indicator and reason of every effect of one case, by the names of ``EFFECT_TABLE``.

    Levels that change the solve are chosen before it, by `study.case.wall` and `backing_plate_level`; here they get
    their names.
    """
    return {name: LEVELS[name](case) for name in EFFECTS}


def _forced(case: Simulated, name: str, otherwise: int) -> int:
    """The reason of a level: the scene's word, or ``otherwise`` where it leaves the choice."""
    return otherwise if getattr(case.scene.effects, name) == "auto" else FORCED


def _object(case: Simulated) -> Level:
    """Compliance of the object: the cheapest level that its indicator allows."""
    names, level = EFFECTS["object"], case.solver.level
    if level is None:
        return names[0], nan, NO_WALL
    reason = FORCED if level.forced else BELOW if level.number < len(names) - 1 else ABOVE
    return names[level.number], level.indicator, reason


def _sheet(case: Simulated) -> Level:
    level = backing_plate_level(case.scene)
    return EFFECTS["sheet"][level.elastic], level.compliance, level.reason


def _model_size(case: Simulated) -> Level:
    return MODEL_SIZES[case.solver.planes], nan, _forced(case, "model_size", SYMMETRY)


def _fingers(case: Simulated) -> Level:
    """One finger where a plane of symmetry lies between two that press on one wall."""
    if case.solver.fingers_solved == 1:
        return "one", nan, SYMMETRY
    return "two", nan, _forced(case, "fingers", ONLY)


def _friction(case: Simulated) -> Level:
    S, F_N = (sum(getattr(c.limits["ccm"], name) for c in case.contacts) for name in ("S", "F_N"))
    return "ccm", 1.0 - F_N / S, _forced(case, "friction", CHEAP)


def _wrench(case: Simulated) -> Level:
    dropped = max(dropped_share(own["ccm"].wrench, own["ccm"].rho) for own in case.fits)
    wanted = case.scene.effects.wrench
    return "3-D" if wanted == "auto" else wanted, dropped, _forced(case, "wrench", APART)


def _limit_surface(case: Simulated) -> Level:
    """An ellipsoid, whose quality is 5 to 10 % off, only where the scene asks for it."""
    model = case.scene.limit_surface.model
    error = float(np.max([own["ccm"].fit_error.Erad for own in case.fits]))
    return SURFACES[model], error, _forced(case, "limit_surface", CHEAP) if model == "quartic" else FORCED


def _coupling(case: Simulated) -> Level:
    """Only the scene can ask for friction that acts back; a thin wall, where it cannot yet, has no indicator."""
    levels, wanted = EFFECTS["friction_pressure_coupling"], case.scene.effects.friction_pressure_coupling
    walled = bool(case.solver.level and case.solver.level.number)
    left_out = nan if walled else max(neglected_traction(c.state, case.scene.friction.mu) for c in case.contacts)
    small = DEFAULT if walled else BELOW if surely_below(left_out, SMALL_TRACTION) else LEFT_OUT
    return levels[wanted == "tangential"], left_out, _forced(case, "friction_pressure_coupling", small)


LEVELS: dict[str, Callable[[Simulated], Level]] = {
    "object": _object,
    "sheet": _sheet,
    "model_size": _model_size,
    "fingers": _fingers,
    "friction": _friction,
    "wrench": _wrench,
    "limit_surface": _limit_surface,
    "friction_pressure_coupling": _coupling,
}
