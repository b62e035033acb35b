"""At which level every candidate's wall was simulated, and by which rule."""

from __future__ import annotations

import numpy as np

from softjaw.study.quantities import EFFECTS, REASONS
from softjaw.study.result.layout import FAILED
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number
from softjaw.study.show.report.maps import elsewhere, main_axis, plane, ticks
from softjaw.study.show.report.page import Picture, paragraph
from softjaw.study.show.tables.overview import RULE

GREYS = ("#e9eef2", "#8fb4cf", "#12436d")  # light to dark with the cost of a level
MOST = 16  # cells in a row that have room for a number
FORCED = REASONS.index("forced by the scene")


def rule(data: Data) -> str:
    """What the indicator of a thin wall is and how its level follows from it; empty without a wall."""
    level, reason = data.values("effects/object_level"), data.values("effects/object_reason")
    if not data.walled or level is None or reason is None:
        return ""
    if np.nanmin(reason) == FORCED:
        name = EFFECTS["object"][int(np.nanmax(level))]
        return paragraph(f"The scene asks for one level of the object for every candidate: {name}.", "note")
    return paragraph(
        f"The level of the object is chosen for each candidate, for all its forces, {RULE}. Its indicator is that dent"
        " over the wall's thickness.", "note",
    )  # fmt: skip


def level_picture(data: Data, index: tuple[int, ...]) -> Picture | None:
    """Levels over the main axis and the angle, with their indicator in each cell where there is room."""
    level, indicator = data.values("effects/object_level"), data.values("effects/object_indicator")
    if not data.walled or level is None or data.grasps == 1:
        return None
    x, y = main_axis(data), len(data.shape) - 2
    top, dents = (plane(data, _over_forces(found), x, y, index) for found in (level, indicator))
    failed = plane(data, np.all(data.status == FAILED, axis=-1), x, y, index)
    (xe, xt, xl), (ye, yt, yl) = ticks(data, x), ticks(data, y)
    drawn, axes = pictures.figure(10, 0.9 + 0.34 * min(len(top), 8), 1, 1)
    panel = axes[0, 0]
    from matplotlib.colors import ListedColormap

    look = {"cmap": ListedColormap(GREYS), "vmin": -0.5, "vmax": 2.5}
    mapped = pictures.heat(panel, xe, ye, top, failed, **look)
    if top.shape[1] <= MOST:
        for i, j in np.argwhere(np.isfinite(top)):
            colour = "white" if top[i, j] == 2 else pictures.INK
            where = 0.5 * (xe[j] + xe[j + 1]), 0.5 * (ye[i] + ye[i + 1])
            panel.text(*where, number(dents[i, j], 2), ha="center", va="center", fontsize=7.5, color=colour)
    panel.set(xlabel=data.axis_label(data.axes[x]), ylabel="angle [°]")
    panel.set_yticks(yt, yl) if yl else None
    panel.set_xticks(xt, xl) if xl else None
    bar = drawn.colorbar(mapped, ax=panel, ticks=[0, 1, 2], pad=0.015, aspect=8)
    bar.ax.set_yticklabels([name.replace(" shell", "\nshell") for name in EFFECTS["object"]], fontsize=7.5)
    bar.outline.set_visible(False)
    counts = [f"{name}: {int(np.sum(top == k))}" for k, name in enumerate(EFFECTS["object"]) if np.any(top == k)]
    where = elsewhere(data, index, x, y, len(data.shape) - 1)
    numbers = " Numbers: dent of a linear wall at the largest force, over the wall's thickness." * (
        top.shape[1] <= MOST
    )
    caption = (
        f"{f'At {where}. ' if where else ''}Level of the object by candidate ({', '.join(counts)}).{numbers} Crossed "
        "out: failed."
    )
    return Picture(pictures.as_svg(drawn), f"Level of the object by candidate: {', '.join(counts)}.", caption)


def _over_forces(found: np.ndarray | None) -> np.ndarray:
    """The one value of a candidate at all its forces; NaN where no force is solved."""
    top = np.where(np.isnan(found), -np.inf, found).max(axis=-1)
    return np.where(np.isfinite(top), top, np.nan)
