"""Levels of every effect: what a case is simulated with, the indicator that says so, and the reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import nan
from typing import Any

import numpy as np

from softjaw.fem.materials import Material, material
from softjaw.fem.pad.backing_plate import Sheet, relative_compliance
from softjaw.friction.patch import FloatArray
from softjaw.study.case.build import pad_shape
from softjaw.study.case.result import surely_below
from softjaw.study.quantities import EFFECTS, REASONS
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import Gripper

# In 440 cases (pads, objects, supports, forces up to 13 N) a rigid sheet put e_n off by at most 3.5 times the relative
# compliance of the sheet that it stood for (where a pad just reaches the middle of a waist); this keeps it below 1.8 %.
STIFF_SHEET = 0.005
# In 92 cases friction that acts back moved e_n by at most 0.5 times the traction that it adds, where that was below a
# tenth of the pressure: this keeps it below 1.5 %; see docs/effects.md.
SMALL_TRACTION = 0.03
ONLY, FORCED, BELOW, ABOVE, SYMMETRY = range(5)  # of REASONS
CHEAP = REASONS.index("never skipped, because it costs next to nothing")
APART = REASONS.index("e_n and quality do not depend on it")
SURFACES = {
    "three_motions": "ellipsoid from three motions",
    "axis_aligned": "fitted ellipsoid",
    "full": "fitted ellipsoid",
    "quartic": "convex quartic",
}
MODEL_SIZES = ("full", "half", "quarter")  # by the number of planes of symmetry


def pad_material(gripper: Gripper) -> Material:
    """Foam of the pads."""
    nu = 0.25 if gripper.material == "blatz_ko" else gripper.poisson_ratio
    return material(gripper.material, gripper.shear_modulus, nu, gripper.shear_moduli, gripper.alpha)


def sheet(gripper: Gripper) -> Sheet:
    """Plate behind each pad."""
    return Sheet(gripper.sheet_thickness, gripper.sheet_modulus, gripper.sheet_poisson, gripper.sheet_support)


@dataclass(frozen=True)
class SheetLevel:
    """Level of the sheets of a scene; ``reason`` is one of `study.quantities.REASONS`.

    ``compliance`` is the mean deflection of the sheet under an even pressure over that of the pad.
    """

    elastic: bool
    compliance: float
    reason: str


def sheet_level(scene: Scene) -> SheetLevel:
    """The level that the scene asks for, else the cheapest whose e_n is good to 2 %."""
    compliance = _compliance(scene.gripper)
    if scene.effects.sheet != "auto":
        return SheetLevel(scene.effects.sheet == "elastic", compliance, "forced by the scene")
    if surely_below(compliance, STIFF_SHEET):
        return SheetLevel(False, compliance, "indicator below the target")
    return SheetLevel(True, compliance, "indicator above the target")


@lru_cache(maxsize=8)
def _compliance(gripper: Gripper) -> float:
    shape, halves = pad_shape(gripper), tuple(n % 2 == 0 for n in gripper.elements[:2])
    x, y = (tuple(map(float, shape.lines(axis, half))) for axis, half in enumerate(halves))
    return relative_compliance(x, y, halves, sheet(gripper), shape.size[2] / pad_material(gripper).young_modulus)


def coupling_level(scene: Scene, contacts: Sequence[Any], walled: bool) -> tuple[str, float, int]:
    """Level, indicator and reason of the effect in one case; only the scene can ask for friction that acts back.

    On a thin wall, where friction cannot act back yet, there is no indicator.
    """
    wanted, levels = scene.effects.friction_pressure_coupling, EFFECTS["friction_pressure_coupling"]
    level = levels[wanted == "tangential"]
    left_out = float("nan") if walled else max(neglected_traction(c.state, scene.friction.mu) for c in contacts)
    if wanted != "auto":
        return level, left_out, REASONS.index("forced by the scene")
    if walled:
        return level, left_out, REASONS.index("the default level of this version")
    small = surely_below(left_out, SMALL_TRACTION)
    reason = "indicator below the target" if small else "left out, though the indicator is above the target"
    return level, left_out, REASONS.index(reason)


def neglected_traction(state: Any, mu: float) -> float:
    """Share of the pressure sum that friction would add across it, if every point of the front stuck or slid [-].

    A point that moved by ``d`` along the object's surface would be held back by ``min(mu p, E d / thickness)``, as a
    column of foam is that is sheared by ``d``. A slope shows here too: there the whole pad moves along the surface.
    """
    pad, points = state.pad, state.points
    start = np.einsum("qa,fai->fqi", pad.face_N, pad.nodes[pad.face_nodes])
    moved = points.position - start
    along = moved - np.einsum("fqi,fqi->fq", moved, points.normal)[..., None] * points.normal
    stick = pad.modulus_per_thickness * pad.face_area * np.linalg.norm(along, axis=-1)
    load = np.maximum(points.load, 0.0)
    return float(np.minimum(mu * load, stick).sum() / load.sum())


def dropped_share(wrench: FloatArray, rho: float) -> float:
    """Mean share of a wrench that its three components f_z, tau_x and tau_y make up, of ``wrench (m, 6)``."""
    w = wrench / [1, 1, 1, rho, rho, rho]
    return float((np.linalg.norm(w[:, 2:5], axis=1) / np.linalg.norm(w, axis=1)).mean())


def effects_of(
    scene: Scene, contacts: Sequence[Any], fits: Sequence[Mapping[str, Any]], solving: Any
) -> dict[str, tuple[str, float, int]]:
    """Level, indicator and reason of every effect of one case; keys and levels as in ``EFFECTS``.

    The indicators are those of ``INDICATORS``. Levels that change the solve are chosen before it, by
    `study.case.wall` and `sheet_level`; here they only get their names.
    """
    wanted = scene.effects

    def only(name: str) -> int:
        return ONLY if getattr(wanted, name, "auto") == "auto" else FORCED

    sheet = sheet_level(scene)
    S, F_N = (sum(getattr(c.limits["ccm"], name) for c in contacts) for name in ("S", "F_N"))
    curved = [own["ccm"] for own in fits]
    dropped = max(dropped_share(b.wrench, b.rho) for b in curved)
    size = MODEL_SIZES[solving.planes]
    return {
        "object": _object(solving.level),
        "sheet": (EFFECTS["sheet"][sheet.elastic], sheet.compliance, REASONS.index(sheet.reason)),
        "model_size": (size, nan, SYMMETRY if wanted.model_size == "auto" else FORCED),
        "fingers": _fingers(solving, only("fingers")),
        "friction": ("ccm", 1.0 - F_N / S, CHEAP if wanted.friction == "auto" else FORCED),
        "wrench": ("3-D", dropped, APART) if wanted.wrench == "auto" else (wanted.wrench, dropped, FORCED),
        "limit_surface": _surface(scene, curved),
        "friction_pressure_coupling": coupling_level(scene, contacts, bool(solving.level and solving.level.number)),
    }


def _object(level: Any) -> tuple[str, float, int]:
    """Level of the object's compliance: the cheapest that its indicator allows."""
    names = EFFECTS["object"]
    if level is None:
        return names[0], nan, REASONS.index("the object has no wall")
    reason = FORCED if level.forced else BELOW if level.number < len(names) - 1 else ABOVE
    return names[level.number], level.indicator, reason


def _surface(scene: Scene, fits: Sequence[Any]) -> tuple[str, float, int]:
    """Form of the limit surface: an ellipsoid, whose quality is 5 to 10 % off, only where the scene asks for it."""
    model = scene.limit_surface.model
    costs_little = model == "quartic" and scene.effects.limit_surface == "auto"
    return SURFACES[model], float(np.max([b.fit_error.Erad for b in fits])), CHEAP if costs_little else FORCED


def _fingers(solving: Any, only: int) -> tuple[str, float, int]:
    """One finger where a plane of symmetry lies between two that press on one wall."""
    return ("one", nan, SYMMETRY) if solving.fingers_solved == 1 else ("two", nan, only)
