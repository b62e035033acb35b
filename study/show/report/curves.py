"""Curves of a report: the three friction models side by side over the force, the stations or a sweep."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.quantities import MODELS
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, shown
from softjaw.study.show.report.page import Picture

# map, text of the panel, unit, factor from SI; "F" divides by the normal force
PANELS = (
    ("e_n", "eccentricity parameter e_n [mm]", 1e3),
    ("quality", "grasp quality [-]", 1.0),
    ("f_x_max", "max f_x / F, along the pad [-]", "F"),
    ("f_y_max", "max f_y / F, across the pad [-]", "F"),
    ("tau_z_max", "max tau_z [N mm]", 1e3),
    ("travel", "travel of the pads [mm]", 1e3),
)
Limits = dict[str, tuple[float, float]]


def _along(data: Data, name: str, model: str, position: int, index: tuple[int, ...], factor: Any) -> np.ndarray | None:
    found = data.map(name, model)
    if found is None:
        return None
    cut = tuple(slice(None) if i == position else k for i, k in enumerate(index))
    scale = factor if factor != "F" else 1.0 / (data.forces if position == len(index) - 1 else data.forces[index[-1]])
    return found[cut] * scale


def _lines(data: Data, name: str, position: int, index: tuple[int, ...], factor: Any) -> dict[str, np.ndarray]:
    models = ("",) if name == "travel" else MODELS
    found = {model: _along(data, name, model, position, index, factor) for model in models}
    return {model: line for model, line in found.items() if line is not None}


def _bars(data: Data, name: str, position: int, index: tuple[int, ...], factor: Any) -> list[np.ndarray]:
    """Lower and upper ends of the curved model's error bars; nothing where the file has no errors."""
    value, error = _along(data, name, "curved", position, index, factor), data.map(f"{name}_error")
    if value is None or error is None:
        return []
    half = value * error[tuple(slice(None) if i == position else k for i, k in enumerate(index))]
    return [value - half, value + half]


def limits(data: Data, position: int, *cases: tuple[int, ...]) -> Limits:
    """Common range of each panel for several cases, so that their pictures can be compared."""
    found = {}
    for name, _, factor in PANELS:
        lines = [line for index in cases for line in _lines(data, name, position, index, factor).values()]
        lines += [end for index in cases for end in _bars(data, name, position, index, factor)]
        low, high = pictures.span(np.concatenate(lines) if lines else np.empty(0))
        room = 0.08 * (high - low)
        found[name] = (low - room, high + room)
    return found


def model_curves(data: Data, position: int, index: tuple[int, ...], mu: float | None, common: Limits) -> Picture:
    """Six quantities over one axis at one case, for the curved, flat and projected model."""
    axis = data.axes[position]
    x = axis.values * shown(axis.units)[1]
    drawn, axes = pictures.figure(10, 5.2, 2, 3, gap=0.16, sharex=True)
    ruled = ""
    for panel, (name, text, factor) in zip(axes.flat, PANELS, strict=True):
        panel.set_title(text)
        lines = _lines(data, name, position, index, factor)
        lines = {model: line for model, line in lines.items() if np.isfinite(line).any()}
        if not lines:
            panel.text(0.5, 0.5, "no values", transform=panel.transAxes, ha="center", color=pictures.SOFT)
            continue
        panel.set_ylim(common[name])
        styles = {**pictures.MODEL_STYLE, "": {"color": pictures.INK, "marker": "o"}}
        styles = {m: {**s, "marker": s["marker"] if len(x) <= 16 else ""} for m, s in styles.items()}
        if bars := _bars(data, name, position, index, factor):
            colour = pictures.MODEL_STYLE["curved"]["color"]
            panel.vlines(x, *bars, color=colour, lw=1)
        if factor == "F" and mu is not None and common[name][0] < mu < common[name][1]:
            panel.axhline(mu, color=pictures.SOFT, lw=0.8, zorder=1)
            ruled = f" The grey lines are mu = {mu:g}."
        pictures.curves(panel, x, lines, styles)
    for panel in axes[-1]:
        if texts := data.texts(axis):
            panel.set_xticks(x, texts)
        panel.set_xlabel("normal force per finger [N]" if position == len(index) - 1 else data.axis_label(axis))
    bars = " Bars: difference to a mesh half as fine." if data.map("e_n_error") is not None else ""
    where = data.place(index) if position == len(index) - 1 else data.place(index, force=True)
    own = (f"{data.name(axis)} ", f"{data.name(axis)}\u00a0")
    fixed = ", ".join(words for words in where.split(", ") if not words.startswith(own))
    caption = f"{fixed[:1].upper()}{fixed[1:]}. F is the normal force of one finger.{ruled}{bars}"
    what = "e_n, quality, largest friction forces, torque and travel"
    alt = f"Curves of {what} over {data.name(axis)} for three friction models, {fixed}."
    return Picture(pictures.as_svg(drawn), alt, caption)
