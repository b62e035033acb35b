"""The only door to matplotlib: figures, their files, and the colours that all pictures of a study share.

Maps grow evenly in lightness, so that they can be read without colour. Nothing here needs a display.
"""

import io
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogLocator, NullFormatter

INK, SOFT = "#1d2429", "#6b747b"
ALIKE = 0.02  # relative, below which colours would draw differences that are errors
COLOURS = {
    "payload": "viridis", "quality": "viridis", "e_n": "cividis", "pressure": "magma_r", "indentation": "plasma_r",
    "wall_stress": "inferno_r",
}  # fmt: skip


def style() -> Any:
    """Context in which all pictures of a study are drawn and saved."""
    return mpl.rc_context(fname=Path(__file__).with_name("templates") / "pictures.mplstyle")


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
    """Smallest and largest finite value, widened where they are all but one; 0 to 1 where there is none."""
    finite = np.asarray(values)[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    if high - low > ALIKE * max(abs(low), abs(high)):
        return low, high
    room = 0.05 * abs(high) or 0.5
    return low - room, high + room


def logarithmic(plot: Any) -> None:
    """Give a plot a logarithmic x axis with plain numbers at 1, 2 and 5 of each decade."""
    plot.set_xscale("log")
    plot.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    plot.xaxis.set_major_formatter("{x:g}")
    plot.xaxis.set_minor_formatter(NullFormatter())
