"""Fig. 7 of the paper: force, torque, e_n and score of one grasp over the normal force, in all friction models."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study import pictures
from softjaw.study.quantities import MODELS
from softjaw.study.show.data import Data, number
from softjaw.study.show.figures import WIDTH
from softjaw.study.show.outline import read_scene

LOOKS = {
    "pcm": {"ms": 6, "mfc": "none", "lw": 1.0},
    "pcm_projected": {"ms": 3.5, "lw": 1.3},
    "ccm": {"ms": 3, "lw": 1.3},
}
NAMES = {"ccm": "curved (CCM)", "pcm": "flat (PCM), scaled by S", "pcm_projected": "planar, scaled by F_N"}


def force_study(data: Data) -> tuple[Any, str]:
    """(a) Normalised friction force, (b) normalised torque, (c) e_n, (d) score; below: what the planar model adds."""
    forces = data.forces
    lines = quantities(data)
    drawn, axes = pictures.figure(WIDTH, 4.6, 2, 4, gap=0.06, sharex=True, height_ratios=[1.5, 1])
    for k, (title, values) in enumerate(lines.values()):
        top, below = axes[:, k]
        for model in LOOKS:
            look = {**pictures.MODEL_STYLE[model], **LOOKS[model]}
            top.plot(forces, values[model], **look, label=NAMES[model])
            if model != "ccm":
                below.plot(forces, 100 * (1 - values["ccm"] / values[model]), **look)
        top.set_title(f"({'abcd'[k]}) {title}")
        below.axhline(0, color=pictures.SOFT, lw=0.7)
        below.set(xlabel="normal force [N]", xlim=(0, None))
        top.margins(y=0.12)
    axes[1, 0].set_ylabel("1 - curved / planar [%]")
    named = axes[0, 0].get_legend_handles_labels()
    drawn.legend(*named, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return drawn, _said(data, lines)


def quantities(data: Data) -> dict[str, tuple[str, dict[str, np.ndarray]]]:
    """Title and values over the force ``(k,)`` of every panel, in each friction model.

    Forces are over the pressure sum S, as in the paper; torques over F times the pad's length.
    """
    length = read_scene(data.ds.attrs["scene"]).gripper.pad_length
    S, F = data.map("S")[0, 0], data.forces

    def of(name: str, factor: Any) -> dict[str, np.ndarray]:
        return {model: data.map(name, model)[0, 0] * factor for model in MODELS}

    return {
        "force": ("f_y / S [-]", of("f_y_max", 1 / S)),
        "torque": (f"tau_z / (F · {number(1e3 * length)} mm)", of("tau_z_max", 1 / (F * length))),
        "e_n": ("e_n [mm]", of("e_n", 1e3)),
        "score": ("grasp quality [-]", of("quality", 1.0)),
    }


def _said(data: Data, lines: dict[str, tuple[str, dict[str, np.ndarray]]]) -> str:
    words = []
    for name, (_, values) in lines.items():
        one, other = values["ccm"][[0, -1]]
        gap = 100 * (1 - values["ccm"] / values["pcm"])[[0, -1]]
        words.append(
            f"{name} {number(one, 4)} to {number(other, 4)}, below flat by {number(gap[0], 2)} to {number(gap[1], 2)} %"
        )
    return f"from {number(data.forces[0])} to {number(data.forces[-1])} N: {'; '.join(words)}"
