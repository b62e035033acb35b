"""Work-precision diagram: error against CPU seconds per case, one line for each knob that has a ladder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softjaw.study.accuracy.cost.choose import NO_LOSS, Combination
from softjaw.study.accuracy.cost.errors import KnobErrors
from softjaw.study.accuracy.cost.levels import WINKLER
from softjaw.study.show import pictures
from softjaw.study.show.page import Block, image

TITLES = ("eccentricity parameter e_n", "largest friction force", "largest torque", "grasp quality")
LOOKS = (("#12436d", "o"), ("#c05a00", "s"), ("#2a8c82", "^"), ("#801650", "D"), ("#6b747b", "v"), ("#3d7a1f", "P"))
LEAST = 1e-6  # errors below are not drawn
QUALITY = 3


def work_precision(tables: Sequence[KnobErrors], best: Sequence[Combination]) -> tuple[Block, bytes]:
    """The diagram as SVG for a page and as PNG."""
    drawn, axes = pictures.figure(10, 7.2, 2, 2, gap=0.12, sharex=True)
    lines = [t for t in tables if not t.judging and t.name not in NO_LOSS]
    for q, (panel, title) in enumerate(zip(axes.flat, TITLES, strict=True)):
        panel.set(title=title, xscale="log", yscale="log")
        panel.grid(which="major", color="#e3e6e8", lw=0.6)
        for table, (colour, marker) in zip(lines, LOOKS * 3, strict=False):
            _ladder(panel, table, q, colour, marker)
        for table in tables:
            _baselines(panel, table, q)
        if q == 0 and len(best) > 1:
            x, y = zip(*sorted((c.seconds, max(c.error, LEAST)) for c in best), strict=True)
            panel.step(x, y, where="post", color=pictures.INK, lw=0.9, ls=":", zorder=2, label="Pareto front")
    for panel in axes[-1]:
        panel.set_xlabel("CPU seconds per case")
    for panel in axes[:, 0]:
        panel.set_ylabel("largest relative error of the probes")
    handles: dict[str, Any] = {}
    for panel in axes.flat:
        handles |= dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    drawn.legend(handles.values(), handles, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    caption = (
        "Every line changes one knob and leaves the others as the scene has them; a ring marks the scene's own. "
        "Errors are against the limit that the knob's ladder leads to, the largest over all probe cases. Lower left is "
        "better; errors below 1e-6 are left out. "
        "The dotted line joins the combinations of all knobs that nothing beats, with predicted errors."
    )
    alt = "Four panels of relative error against CPU seconds per case, logarithmic, one line for each knob."
    return image(pictures.as_svg(drawn), caption, alt), pictures.as_png(drawn)


def _ladder(panel: Any, table: KnobErrors, q: int, colour: str, marker: str) -> None:
    """A knob's levels that are not its reference, joined where they follow one another."""
    points = [(v.seconds, v.worst[q], i) for i, v in enumerate(table.levels) if v.worst[q] > LEAST]
    if not points:
        return
    x, y, place = (np.array(part) for part in zip(*points, strict=True))
    ladder = all(not np.isnan(s.size) for s in table.settings)
    panel.plot(x, y, marker=marker, ls="-" if ladder else "", color=colour, label=table.name, zorder=3)
    if table.own in place:
        k = int(np.flatnonzero(place == table.own)[0])
        panel.plot(x[k], y[k], "o", ms=9, mfc="none", mec=pictures.INK, mew=0.9, zorder=4)


def _baselines(panel: Any, table: KnobErrors, q: int) -> None:
    """What others use: a Winkler foundation and planar friction; surfaces and hulls in the panel of the quality."""
    if table.name == "contact model":
        for level, marker, name in zip(table.levels, "*X", ("Winkler, planar", "finite elements, planar friction"),
                                       strict=False):  # fmt: skip
            if level.worst[q] > LEAST:
                known = WINKLER if level.name == WINKLER else level.name
                size = 10 if known == WINKLER else 6
                panel.plot(level.seconds, level.worst[q], marker, ms=size, color=pictures.INK, label=name, zorder=4)
    elif q == QUALITY and table.judging:
        styles = {"limit surface": ("<", "#801650"), "motions sampled": (">", "#8a6d00"), "score": ("h", "#b3261e")}
        marker, colour = styles[table.name]
        points = [(v.seconds, v.worst[q]) for v in table.levels if v.worst[q] > LEAST]
        if points:
            panel.plot(*zip(*points, strict=True), marker, color=colour, ms=4.5, label=table.name, zorder=3)
