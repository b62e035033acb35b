"""Window of safe forces of every grasp: bars from the smallest force that holds to the largest that the wall bears."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from softjaw.study.result.layout import DONE
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number, shown
from softjaw.study.show.report.maps import chosen_angles, elsewhere, main_axis, ticks
from softjaw.study.show.report.page import Picture
from softjaw.study.show.tables.ranking import largest

SAFE, NONE = "#2a8c82", "#c9ced2"


def window_picture(data: Data, index: tuple[int, ...]) -> Picture | None:
    """Bars over the stations, one panel for each angle; None where the file derives no window for a wall."""
    high = data.bound("force_high")
    if high is None or not np.isfinite(high).any():
        return None
    low = data.bound("force_low")
    x, angle = main_axis(data), len(data.shape) - 2
    panels = chosen_angles(data, index)
    drawn, axes = pictures.figure(10, 2.9, 1, len(panels), sharey=True)
    borders, places, texts = ticks(data, x)
    for panel, j in zip(axes[0], panels, strict=True):
        cut = tuple(slice(None) if i == x else (j if i == angle else k) for i, k in enumerate(index[:-1]))
        solved = (data.status == DONE).any(axis=-1)[cut]
        _bars(panel, data.forces, borders, None if low is None else low[cut], high[cut], solved)
        panel.set(
            xlim=(borders[0], borders[-1]), ylim=(0, data.forces[-1] * 1.12), xlabel=data.axis_label(data.axes[x])
        )
        if texts:
            panel.set_xticks(places, texts)
        if data.shape[angle] > 1:
            unit, factor = shown(data.axes[angle].units)
            panel.set_title(f"angle {data.axes[angle].values[j] * factor:.4g}{unit}")
    axes[0, 0].set_ylabel("force per finger [N]")
    return Picture(
        pictures.as_svg(drawn), f"Bars of safe forces. {_said(data, index, low, high)}", _caption(data, index, x)
    )


def _bars(panel: Any, forces: np.ndarray, x: np.ndarray, low: Any, high: np.ndarray, solved: np.ndarray) -> None:
    """A bar for each place where a force suits, the bounds alone where none does, crosses where all cases failed."""
    bottom = np.zeros(len(high)) if low is None else low
    middle, width = 0.5 * (x[1:] + x[:-1]), np.minimum(0.72 * np.diff(x), 0.05 * np.ptp(x))
    good = np.isfinite(high) & (bottom <= high)
    panel.bar(middle[good], (high - bottom)[good], width[good], bottom[good], color=SAFE, zorder=2)
    for bound, mark in ((bottom, "^"), (high, "v")):
        bad = np.isfinite(high) & ~good & np.isfinite(bound)
        panel.plot(middle[bad], bound[bad], mark, color=pictures.INK, ms=5, mfc="white", zorder=3)
    gone = [[[a, 0], [b, 0], [b, forces[-1]], [a, forces[-1]]] for a, b in pairwise(x)]
    pictures.crossed_out(panel, [gone[i] for i in np.flatnonzero(~solved)])
    top = good & (high >= forces[-1] * (1 - 1e-9))
    panel.plot(middle[top], high[top], "^", color=SAFE, ms=6, zorder=3)
    for force in forces:
        panel.axhline(force, color=NONE, lw=0.6, zorder=0.4)


def _caption(data: Data, index: tuple[int, ...], x: int) -> str:
    where = elsewhere(data, index, x, len(data.shape) - 2, len(data.shape) - 1)
    low = (
        "from the smallest normal force that holds the object's weight (safety factor 1, curved model)"
        if data.bound("force_low") is not None
        else "from zero, for no mass is given,"
    )
    return (
        f"{f'At {where}. ' if where else ''}Bars reach {low} to the largest one that the wall bears: where its dent"
        " passes what is allowed, or its stress the yield strength, by straight lines between the solved forces (grey"
        " lines). An arrow on a bar: nothing was passed at the largest force. No bar: no force is safe; triangles that"
        " point up and down mark what holding would take and what the wall bears. Crossed out: failed."
    )


def _said(data: Data, index: tuple[int, ...], low: np.ndarray | None, high: np.ndarray) -> str:
    bottom = np.zeros_like(high) if low is None else low
    good = np.argwhere(bottom <= high)
    if not len(good):
        return "No grasp has a safe force."
    wide = np.where(bottom <= high, high - bottom, np.nan)
    widest = tuple(int(i) for i in np.unravel_index(largest(wide), wide.shape))
    ends = f"{number(bottom[widest])} to {number(high[widest])} N"
    return f"{len(good)} of {high.size} grasps have one, the widest from {ends} at {data.place((*widest, index[-1]))}."
