"""What a report says of a thin wall: its limits, how it takes a case, and between which forces that is safe."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.quantities import EFFECTS
from softjaw.study.show.data import Data, number
from softjaw.study.show.outline import swept_object
from softjaw.study.show.report.page import paragraph, table
from softjaw.study.show.tables.overview import wall_text

HEADS = {
    "dent": "dent [mm]", "wall_stress": "wall stress [MPa]", "wall_strain": "largest strain [%]",
    "support_force": "support force [N]", "safety_factor": "safety factor",
}  # fmt: skip
FACTORS = {"dent": 1e3, "wall_stress": 1e-6, "wall_strain": 1e2}
MOST = 6
SAFE = (
    "Safe forces: normal forces per finger that hold the object's weight, where its mass is given, and that its wall"
    " bears; a plus: the wall bears the largest solved force."
)
STRESS = (
    "Wall stress is the largest von Mises stress on both faces; support force is what the table or the clamp has to"
    " bear along the axis because the pads push an object with sloping walls."
)


def wall_sentence(data: Data, index: tuple[int, ...]) -> str:
    """How a thin wall takes one case, and between which forces it would be safe; empty without a wall."""
    dent, stress = data.at("dent", index), data.at("wall_stress", index)
    if not np.isfinite(dent):
        return ""
    said = f"The wall is dented by {number(1e3 * dent)} mm and its stress reaches {number(1e-6 * stress)} MPa."
    low, high = (data.bound(name) for name in ("force_low", "force_high"))
    if high is None or not np.isfinite(high[index[:-1]]):
        return said
    top, bottom = float(high[index[:-1]]), None if low is None else float(low[index[:-1]])
    if bottom is not None and not bottom <= top:
        return f"{said} No force that was solved both holds the object and is borne by its wall."
    upper = f"at least {number(top)} N" if top >= data.forces[-1] * (1 - 1e-9) else f"{number(top)} N"
    if bottom is None:
        return f"{said} The wall bears {upper} per finger there."
    return (
        f"{said} Safe forces there: from {number(bottom)} N, which holds the object, to {upper}, which its wall bears."
    )


def wall(data: Data, scene: Any, index: tuple[int, ...]) -> str:
    """Definitions that the pictures of a thin wall need, and its limits in this case."""
    shape = swept_object(scene, index) if scene else None
    limits = [f"The wall: {wall_text(shape)}."] if shape is not None else []
    return paragraph(" ".join([*limits, STRESS])) + _table(data)


def _table(data: Data) -> str:
    """What the wall bears in the best grasps at the force shown."""
    there = [name for name in HEADS if data.map(name) is not None]
    level = data.values("effects/object_level")
    rows = []
    for index in data.order(data.k)[:MOST]:
        values = [number(data.at(name, index) * FACTORS.get(name, 1.0)) for name in there]
        known = level is not None and np.isfinite(level[index])
        simulated = EFFECTS["object"][int(level[index])] if known else "–"
        rows.append([data.place(index), *values, window_text(data, index), simulated])
    head = ["grasp", *(HEADS[name] for name in there), "safe forces [N]", "wall simulated as"]
    caption = f"The wall in the best grasps at {number(data.forces[data.k])} N per finger"
    return table(caption, head, rows, texts=(0, len(head) - 1), first=True)


def window_text(data: Data, index: tuple[int, ...]) -> str:
    """The window of forces of one candidate, for a table."""
    low, high = (data.bound(name) for name in ("force_low", "force_high"))
    top = float("nan") if high is None else float(high[index[:-1]])
    bottom = 0.0 if low is None else float(low[index[:-1]])
    if not np.isfinite(top):
        return "–"
    more = "+" if top >= data.forces[-1] * (1 - 1e-9) else ""
    if not bottom <= top:
        return "none"
    below = "≤ " if low is None and not more else "" if low is None else f"{number(bottom)}–"
    return f"{below}{number(top)}{more}"
