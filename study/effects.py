"""Which level of each effect a case was simulated with, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import nan
from typing import Any

import numpy as np

from study.limit_surface import dropped_share
from study.quantities import EFFECTS, REASONS
from study.scene import Scene
from study.sheet_level import sheet_level

ONLY, FORCED, BELOW, ABOVE, SYMMETRY, DEFAULT = range(6)  # of REASONS
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
    """Level, indicator and reason of every effect of one case; keys and levels as in ``study.quantities.EFFECTS``.

    The indicators are those that a choice between levels is made by: the dent that a linear wall would get at the
    largest force, over the wall's thickness, for the object, the largest strain for the pad, the compliance of the
    sheet over that of the pad for the sheet, the share of the normal force that the tilt of the loaded normals takes
    away for the friction model, the mean share of the three dropped components for the wrench, the radial misfit for
    the limit surface.
    """
    wanted = scene.effects

    def only(name: str) -> int:
        return ONLY if getattr(wanted, name, "auto") == "auto" else FORCED

    pad, sheet = solving.pad_level, sheet_level(scene)
    strain = max(c.state.checks.max_strain for c in contacts)
    S, F_N = (sum(getattr(c.limits["curved"], name) for c in contacts) for name in ("S", "F_N"))
    curved = [own["curved"] for own in bounds]
    dropped = max(dropped_share(b.wrench, b.rho) for b in curved)
    radial = float(np.max([b.misfit.Erad for b in curved]))
    six = "3-D" if wanted.wrench == "auto" else wanted.wrench
    size = MODEL_SIZES[solving.planes]
    return {
        "object": _object(solving.level),
        "pad": (EFFECTS["pad"][not pad.linear], strain, REASONS.index(pad.reason)),
        "sheet": (EFFECTS["sheet"][sheet.elastic], sheet.compliance, REASONS.index(sheet.reason)),
        "model_size": (size, nan, SYMMETRY if wanted.model_size == "auto" else FORCED),
        "fingers": _fingers(solving, only("fingers")),
        "friction": ("curved", 1.0 - F_N / S, only("friction")),
        "wrench": (six, dropped, DEFAULT if wanted.wrench == "auto" else FORCED),
        "limit_surface": (SURFACES[scene.limit_surface.model], radial, FORCED),
        "friction_pressure_coupling": _coupling(wanted.friction_pressure_coupling),
    }


def _object(level: Any) -> tuple[str, float, int]:
    """Level of the object's compliance: the cheapest that its indicator allows."""
    names = EFFECTS["object"]
    if level is None:
        return names[0], nan, REASONS.index("the object has no wall")
    reason = FORCED if level.forced else BELOW if level.number < len(names) - 1 else ABOVE
    return names[level.number], level.indicator, reason


def _coupling(wanted: str) -> tuple[str, float, int]:
    """Whether friction acted back on the pressure."""
    names = EFFECTS["friction_pressure_coupling"]
    return names[wanted == "tangential"], nan, DEFAULT if wanted == "auto" else FORCED


def _fingers(solving: Any, only: int) -> tuple[str, float, int]:
    """One finger where a plane of symmetry lies between two that press on one wall."""
    return ("one", nan, SYMMETRY) if solving.fingers_solved == 1 else ("two", nan, only)
