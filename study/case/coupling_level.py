"""What friction that does not act back on the pressure leaves out, and whether that may move e_n."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softjaw.fem.contact.press import Pressed
from softjaw.study.case.margin import surely_below
from softjaw.study.quantities import EFFECTS, REASONS
from softjaw.study.scene import Scene

# In 92 cases friction that acts back moved e_n by at most 0.5 times the traction that it adds, where that was below a
# tenth of the pressure: this keeps it below 1.5 %; see docs/effects.md.
SMALL = 0.03


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
    small = surely_below(left_out, SMALL)
    reason = "indicator below the target" if small else "left out, though the indicator is above the target"
    return level, left_out, REASONS.index(reason)


def neglected_traction(state: Pressed, mu: float) -> float:
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
