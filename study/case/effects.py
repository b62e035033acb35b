"""Which level of each effect a case was simulated with, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import nan
from typing import Any

import numpy as np

from softjaw.study.case.coupling_level import coupling_level
from softjaw.study.case.limit_surface import dropped_share
from softjaw.study.case.sheet_level import sheet_level
from softjaw.study.quantities import EFFECTS, REASONS
from softjaw.study.scene import Scene

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


def effects_of(
    scene: Scene, contacts: Sequence[Any], bounds: Sequence[Mapping[str, Any]], solving: Any
) -> dict[str, tuple[str, float, int]]:
    """Level, indicator and reason of every effect of one case; keys and levels as in ``EFFECTS``.

    The indicators are those of ``INDICATORS``. Levels that change the solve are chosen before it, by
    `study.case.wall`, `study.case.pad_level` and `study.case.sheet_level`; here they only get their names.
    """
    wanted = scene.effects

    def only(name: str) -> int:
        return ONLY if getattr(wanted, name, "auto") == "auto" else FORCED

    pad, sheet = solving.pad_level, sheet_level(scene)
    strain = max(c.state.checks.max_strain for c in contacts)
    S, F_N = (sum(getattr(c.limits["curved"], name) for c in contacts) for name in ("S", "F_N"))
    curved = [own["curved"] for own in bounds]
    dropped = max(dropped_share(b.wrench, b.rho) for b in curved)
    size = MODEL_SIZES[solving.planes]
    return {
        "object": _object(solving.level),
        "pad": (EFFECTS["pad"][not pad.linear], strain, REASONS.index(pad.reason)),
        "sheet": (EFFECTS["sheet"][sheet.elastic], sheet.compliance, REASONS.index(sheet.reason)),
        "model_size": (size, nan, SYMMETRY if wanted.model_size == "auto" else FORCED),
        "fingers": _fingers(solving, only("fingers")),
        "friction": ("curved", 1.0 - F_N / S, CHEAP if wanted.friction == "auto" else FORCED),
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


def _surface(scene: Scene, bounds: Sequence[Any]) -> tuple[str, float, int]:
    """Form of the limit surface: an ellipsoid, whose quality is 5 to 10 % off, only where the scene asks for it."""
    model = scene.limit_surface.model
    costs_little = model == "quartic" and scene.effects.limit_surface == "auto"
    return SURFACES[model], float(np.max([b.misfit.Erad for b in bounds])), CHEAP if costs_little else FORCED


def _fingers(solving: Any, only: int) -> tuple[str, float, int]:
    """One finger where a plane of symmetry lies between two that press on one wall."""
    return ("one", nan, SYMMETRY) if solving.fingers_solved == 1 else ("two", nan, only)
