"""The only door to matplotlib: figures, their files, and the drawing habits that all pictures of a study share.

Every picture can be read without colour: maps grow evenly in lightness, models differ by line and marker, failed cases
are crossed out. Nothing here needs a display.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from softjaw.study.quantities import MODEL_NAMES

INK, SOFT, EMPTY = "#1d2429", "#6b747b", "#e7e9eb"
MODEL_LOOKS = {  # name, colour, line, marker
    "ccm": (MODEL_NAMES["ccm"], "#12436d", "-", "o"),
    "pcm": (MODEL_NAMES["pcm"], "#c05a00", "--", "s"),
    "pcm_projected": (MODEL_NAMES["pcm_projected"], "#2a8c82", ":", "^"),
}
COLOURS = {
    "payload": "viridis",
    "quality": "viridis",
    "e_n": "cividis",
    "pressure": "magma_r",
    "indentation": "plasma_r",
    "wall_stress": "inferno_r",
}
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.limits": (-3, 4),
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "lines.linewidth": 1.6,
    "lines.markersize": 4,
    "hatch.linewidth": 0.7,
    "svg.hashsalt": "softjaw",  # the same file gives the same page, byte for byte
    "svg.fonttype": "path",
    "figure.dpi": 100,
}


def style() -> Any:
    """Context in which all pictures of a study are drawn and saved."""
    return mpl.rc_context(_STYLE)


def figure(
    width: float, height: float, rows: int = 1, columns: int = 1, gap: float = 0.08, **layout: Any
) -> tuple[Any, Any]:
    """A figure of so many inches and its axes, ``(rows, columns)`` ``gap`` inches apart; it needs no window."""
    made = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=gap))
    FigureCanvasAgg(made)
    return made, made.subplots(rows, columns, squeeze=False, **layout)


def as_svg(drawn: Any) -> bytes:
    """The figure as SVG, text as outlines, without a date."""
    return _saved(drawn, format="svg", dpi=200, metadata={"Date": None, "Creator": None})


def as_png(drawn: Any, dpi: int = 160) -> bytes:
    """The figure as PNG for slides and mails."""
    return _saved(drawn, format="png", dpi=dpi, facecolor="white", metadata={"Software": None})


def _saved(drawn: Any, **options: Any) -> bytes:
    store = io.BytesIO()
    drawn.savefig(store, **options)
    return store.getvalue()


def span(values: Any) -> tuple[float, float]:
    """Smallest and largest finite value, widened where they are one; 0 to 1 where there is none."""
    finite = np.asarray(values)[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    if high - low > 1e-9 * max(abs(low), abs(high)):
        return low, high
    room = 0.05 * abs(high) or 0.5
    return low - room, high + room


def heat(axes: Any, x: np.ndarray, y: np.ndarray, values: np.ndarray, failed: np.ndarray, **look: Any) -> Any:
    """Cells ``values (len(y) - 1, len(x) - 1)`` as colours, between borders ``x`` and ``y``.

    Failed cells are grey with a cross; cells without a value are grey.
    """
    axes.set_facecolor(EMPTY)
    i, j = np.nonzero(failed)
    axes.plot(0.5 * (x[j] + x[j + 1]), 0.5 * (y[i] + y[i + 1]), "x", color=SOFT, ms=4)
    return axes.pcolormesh(x, y, np.ma.masked_invalid(np.where(failed, np.nan, values)), **look)


def thumbnail(corners: Sequence[np.ndarray], colours: np.ndarray, pixels: int = 208) -> bytes:
    """A small square PNG of polygons ``(k, 2)`` in the order in which they cover each other, each of one colour."""
    drawn = Figure(figsize=(1, 1), dpi=pixels)
    FigureCanvasAgg(drawn)
    axes = drawn.add_axes((0, 0, 1, 1))
    axes.add_collection(PolyCollection(list(corners), facecolors=colours, edgecolors=colours, linewidths=0.3))
    points = np.concatenate(list(corners))
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), 0.53 * (high - low).max()
    axes.set(xlim=middle[0] + half * np.array([-1, 1]), ylim=middle[1] + half * np.array([-1, 1]))
    axes.set_axis_off()
    return _saved(drawn, format="png", facecolor="white", metadata={"Software": None})


def colour_bar(drawn: Any, mappable: Any, axes: Any, label: str, beside: bool = False) -> None:
    """A colour bar with its quantity and unit; ``beside`` keeps it as high as axes that have an aspect of their own."""
    if beside:
        place = {"cax": axes.inset_axes([1.03, 0.0, 0.035, 1.0])}
    else:
        place = {"ax": axes, "aspect": 10 * drawn.get_figheight(), "pad": 0.015}
    bar = drawn.colorbar(mappable, label=label, **place)
    bar.outline.set_visible(False)
