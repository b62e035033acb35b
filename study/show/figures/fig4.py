"""Fig. 4 of the paper: the contact with its pressures and friction, and what curvature costs the planar model."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from softjaw.study import pictures
from softjaw.study.show.data import Data, number
from softjaw.study.show.figures import WIDTH
from softjaw.study.show.outline import read_scene
from softjaw.study.show.view import solids
from softjaw.study.show.view.model import NEUTRAL, View
from softjaw.study.show.view.pads import Pad, pads

RATIO = 0.6  # b/a of the contact that is drawn
ARROWS = 9, 3  # at most, along and across the pad
LONGEST = 3.6  # arrow [mm]
FREE = "#eef0f1"  # faces that touch nothing
COMPONENTS = {"f_y": ("across, f_y", "-", "o"), "tau_z": ("torque, tau_z", "--", "s"), "f_x": ("along, f_x", ":", "^")}
AGAINST = {
    "pcm": "planar model scaled by S, the paper's",
    "pcm_projected": "planar model scaled by the force F_N",
}


def contact(data: Data) -> tuple[Any, str]:
    """(a) A pad on the elliptic cylinder with the pressure on its elements; (b) their friction against a turn."""
    ratio = data.bound("b_over_a")
    index = (int(np.abs(ratio - RATIO).argmin()), 0, 0, len(data.forces) - 1)
    view, pad = View(data, index[:1]), pads(data, read_scene(data.ds.attrs["scene"]).gripper, index)[0]
    top = 1e-3 * float(pad.pressure.max())
    out, along, beside = -pad.approach, pad.rotation[:, 0], pad.rotation[:, 1]
    drawn, axes = pictures.figure(WIDTH, 3.2, 1, 2)
    parts = (
        (f"a soft pad on an elliptic cylinder, b/a = {number(ratio[index[0]])}, {number(data.forces[index[-1]])} N",
         lambda plotter: _whole(plotter, view, pad, top), 0.62 * out + 0.75 * beside + 0.3 * along),
        ("its elements' friction against a turn about the normal",
         lambda plotter: _close(plotter, pad, top), 0.9 * out + 0.5 * beside + 0.15 * along),
    )  # fmt: skip
    for panel, letter, (title, draw, towards) in zip(axes[0], "ab", parts, strict=True):
        pictures.placed(panel, solids.rendered(draw, towards, out, (1500, 900)), f"({letter}) {title}")
    pictures.scale(drawn, axes, "contact pressure [kPa]", pictures.COLOURS["pressure"], (0, top))
    tilt = np.degrees(np.arccos(np.clip(pad.normal[pad.loaded] @ pad.approach, -1, 1))).max()
    lost = number(100 * data.at("f_y_overestimate", index), 2)
    return drawn, (
        f"loaded elements tilt by up to {number(tilt, 2)} degrees; of the friction across the cylinder that the planar "
        f"model claims, {lost} % is missing"
    )


def _whole(plotter: Any, view: View, pad: Pad, top: float) -> None:
    solids.surface(plotter, 1e3 * view.surface.points, view.surface.triangles, color=NEUTRAL)
    solids.block(plotter, pad)
    solids.pressures(plotter, pad, top)


def _close(plotter: Any, pad: Pad, top: float) -> None:
    solids.faces(plotter, 1e3 * pad.quads()[~pad.loaded.ravel()], color=FREE)
    solids.pressures(plotter, pad, top, show_edges=True)
    solids.friction(plotter, _fewer(pad), "turn", LONGEST)


def _fewer(pad: Pad) -> Pad:
    """The pad with fewer faces for arrows: those in the middle of equal strides over its loaded part."""
    rows, columns = (np.flatnonzero(pad.loaded.any(axis=k)) for k in (1, 0))
    counts = (min(n, len(k)) for k, n in zip((rows, columns), ARROWS, strict=True))
    i, j = (k[((np.arange(n) + 0.5) / n * len(k)).astype(int)] for k, n in zip((rows, columns), counts, strict=True))
    of = np.ix_(i, j)
    return replace(pad, centroid=pad.centroid[of], normal=pad.normal[of], pressure=pad.pressure[of], area=pad.area[of])


def curvature(data: Data) -> tuple[Any, str]:
    """(c) Share of the planar models' claims that the curved contact cannot carry, over a/b."""
    x, order = 1 / data.bound("b_over_a"), np.argsort(1 / data.bound("b_over_a"))
    drawn, axes = pictures.figure(WIDTH, 3.4, 1, 2, gap=0.1)
    for axis, (model, title) in zip(axes[0], AGAINST.items(), strict=True):
        axis.axhline(0, color=pictures.SOFT, lw=0.7)
        colour = pictures.MODEL_STYLE[model]["color"]
        for name, (label, line, mark) in COMPONENTS.items():
            for k, force in enumerate(data.forces):
                lost, error = _lost(data, name, model, k)
                full = k == len(data.forces) - 1
                look = {"color": colour, "ls": line, "marker": mark, "mfc": colour if full else "white"}
                look |= {"alpha": 1.0 if full else 0.55, "lw": 1.6 if full else 1.0}
                axis.errorbar(x[order], lost[order], error[order], capsize=2, elinewidth=0.8, **look,
                              label=f"{label}, {number(force)} N")  # fmt: skip
        axis.set(xlabel="a / b, semi-axis along the approach over across [-]", title=f"against the {title}")
        axis.set_ylabel("1 - curved / planar [%]")
    axes[0, 0].set_title(f"(c) against the {AGAINST['flat']}")
    axes[0, 0].legend(frameon=False, fontsize=8)
    return drawn, _grows(data, x, order)


def _lost(data: Data, name: str, model: str, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Overestimate along the sweep at a force ``(r,)`` [%], and its difference to the coarser mesh."""
    key = f"{name}_overestimate" + ("" if model == "pcm" else "_pcm_projected")
    found, error = data.map(key)[:, 0, 0, k], data.map(f"{key}_error")
    return 100 * found, 100 * np.abs(np.zeros(len(found)) if error is None else error[:, 0, 0, k])


def _grows(data: Data, x: np.ndarray, order: np.ndarray) -> str:
    last = len(data.forces) - 1
    words = []
    for name in ("f_y", "tau_z"):
        lost = _lost(data, name, "pcm", last)[0][order]
        words.append(f"{name} {number(lost[0], 2)} to {number(lost[-1], 2)} %")
    along = np.abs(_lost(data, "f_x", "pcm", last)[0]).max()
    return (
        f"at {number(data.forces[last])} N the flat model overestimates, from a/b {number(x.min(), 2)} to "
        f"{number(x.max(), 2)}: {', '.join(words)}; f_x at most {number(along, 2)} %"
    )
