"""Whether the sheet behind the pads is simulated as a plate that bends."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from softjaw.fem.pad.backing_plate import relative_compliance
from softjaw.study.case.build import pad_material, pad_shape, sheet
from softjaw.study.case.margin import surely_below
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import Gripper

# In 440 cases (pads, objects, supports, forces up to 13 N) a rigid sheet put e_n off by at most 3.5 times the relative
# compliance of the sheet that it stood for (where a pad just reaches the middle of a waist); this keeps it below 1.8 %.
STIFF = 0.005


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
    if surely_below(compliance, STIFF):
        return SheetLevel(False, compliance, "indicator below the target")
    return SheetLevel(True, compliance, "indicator above the target")


@lru_cache(maxsize=8)
def _compliance(gripper: Gripper) -> float:
    shape, halves = pad_shape(gripper), tuple(n % 2 == 0 for n in gripper.elements[:2])
    x, y = (tuple(map(float, shape.lines(axis, half))) for axis, half in enumerate(halves))
    return relative_compliance(x, y, halves, sheet(gripper), shape.size[2] / pad_material(gripper).young_modulus)
