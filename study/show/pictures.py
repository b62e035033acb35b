"""The only door to matplotlib: figures, their files, and the drawing habits that all pictures of a study share.

Every picture can be read without colour: maps grow evenly in lightness, models differ by line and marker, failed cases
are crossed out. Nothing here needs a display.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

INK, SOFT, EMPTY = "#1d2429", "#6b747b", "#e7e9eb"
MODEL_STYLE = {
    "curved": {"color": "#12436d", "linestyle": "-", "marker": "o"},
    "flat": {"color": "#c05a00", "linestyle": "--", "marker": "s"},
    "projected": {"color": "#2a8c82", "linestyle": ":", "marker": "^"},
}
COLOURS = {
    "quality": "viridis",
    "e_n": "cividis",
    "pressure": "magma_r",
    "dent": "plasma_r",
    "wall_stress": "inferno_r",
}
RASTER = 150  # polygons above which a map is stored as pixels: a page must stay small
_STYLE = {
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
    import matplotlib as mpl

    return mpl.rc_context(_STYLE)


def figure(
    width: float, height: float, rows: int = 1, columns: int = 1, gap: float = 0.08, **layout: Any
) -> tuple[Any, Any]:
    """A figure of so many inches and its axes, ``(rows, columns)`` ``gap`` inches apart; it needs no window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    made = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(made)
    made.get_layout_engine().set(w_pad=gap)
    return made, made.subplots(rows, columns, squeeze=False, **layout)


def _saved(drawn: Any, form: str, **options: Any) -> bytes:
    store = io.BytesIO()
    drawn.savefig(store, format=form, **options)
    return store.getvalue()


def as_svg(drawn: Any) -> bytes:
    """The figure as SVG, text as outlines, without a date."""
    return _saved(drawn, "svg", dpi=200, metadata={"Date": None, "Creator": None})


def as_png(drawn: Any) -> bytes:
    """The figure as PNG for slides and mails."""
    return _saved(drawn, "png", dpi=160, facecolor="white", metadata={"Software": None})


def as_webp(drawn: Any) -> bytes:
    """The figure as WebP, for what is shaded or has very many parts: a tenth of the size of SVG or PNG."""
    return _saved(drawn, "webp", dpi=190, facecolor="white", pil_kwargs={"quality": 82, "method": 4})


def edges(values: np.ndarray, alone: float = 1.0) -> np.ndarray:
    """Borders of the cells round rising values, halfway between neighbours; one value gets a cell ``alone`` wide.

    >>> edges(np.array([0.0, 1.0, 3.0]))
    array([-0.5,  0.5,  2. ,  4. ])
    """
    values = np.asarray(values, float)
    if len(values) == 1:
        return values[0] + 0.5 * alone * np.array([-1.0, 1.0])
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


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
    """Cells ``values (len(y), len(x))`` as colours, between borders ``x`` and ``y``.

    Failed cells are grey and crossed out; cells without a value are dotted.
    """
    many, missing = values.size > RASTER, np.isnan(values) & ~failed
    crosses, dots = _cells(x, y, failed), _cells(x, y, missing)
    if len(crosses) > RASTER:  # one ground of crosses that shows through is drawn much faster
        crosses = _cells(x[[0, -1]], y[[0, -1]], np.ones((1, 1), bool))
    crossed_out(axes, crosses)
    dotted(axes, dots)
    shown = np.ma.masked_invalid(np.where(failed, np.nan, values))
    seams = {"edgecolors": "none"} if many else {"edgecolors": "face", "linewidth": 0.4}
    return axes.pcolormesh(x, y, shown, rasterized=many, zorder=1.1, **seams, **look)


def _cells(x: np.ndarray, y: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Chosen cells as rectangles, neighbours in a row as one."""
    steps = np.diff(chosen.astype(int), axis=1, prepend=0, append=0)
    rows, first = np.nonzero(steps == 1)
    last = np.nonzero(steps == -1)[1]
    box = np.stack([x[first], y[rows], x[last], y[rows + 1]], axis=-1)
    return box[:, [[0, 1], [2, 1], [2, 3], [0, 3]]]


def crossed_out(axes: Any, corners: Sequence[Any]) -> None:
    """Polygons in the way failed cases are drawn everywhere."""
    from matplotlib.collections import PolyCollection

    if len(corners):
        look = {"facecolor": EMPTY, "edgecolor": SOFT, "linewidth": 0.3, "hatch": "xxxx"}
        axes.add_collection(PolyCollection(corners, zorder=0.5, **look), autolim=False)


def dotted(axes: Any, corners: Sequence[Any]) -> None:
    """Polygons in the way cases without a value are drawn everywhere."""
    for polygon in corners:
        axes.fill(*np.transpose(polygon), facecolor="white", edgecolor="#c3cad0", linewidth=0, hatch="...", zorder=1)


def polygons(axes: Any, corners: Sequence[Any], values: np.ndarray, **look: Any) -> Any:
    """Polygons in the colours of ``values``."""
    from matplotlib.collections import PolyCollection

    look = {"edgecolor": "face", "linewidth": 0.5, "rasterized": len(corners) > RASTER, **look}
    limits = look.pop("vmin", None), look.pop("vmax", None)
    drawn = PolyCollection(corners, array=np.ma.masked_invalid(values), **look)
    drawn.set_clim(*limits)
    axes.add_collection(drawn, autolim=False)
    return drawn


def colour_bar(drawn: Any, mappable: Any, axes: Any, label: str, beside: bool = False) -> None:
    """A colour bar with its quantity and unit; ``beside`` keeps it as high as axes that have an aspect of their own."""
    if beside:
        place = {"cax": axes.inset_axes([1.03, 0.0, 0.035, 1.0])}
    else:
        place = {"ax": axes, "aspect": 10 * drawn.get_figheight(), "pad": 0.015}
    bar = drawn.colorbar(mappable, label=label, **place)
    bar.outline.set_visible(False)


def arrow(axes: Any, tail: np.ndarray, tip: np.ndarray) -> None:
    """An arrow that shows on light and dark ground."""
    from matplotlib.patheffects import withStroke

    style = {"arrowstyle": "-|>", "color": INK, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tip, tail, arrowprops={**style, "path_effects": [withStroke(linewidth=4, foreground="white")]})


def curves(axes: Any, x: np.ndarray, lines: Mapping[str, np.ndarray], styles: Mapping[str, Any] | None = None) -> None:
    """Lines over ``x``, each named at its right end; lines without a finite value are left out."""
    styles = styles or MODEL_STYLE
    ends: list[tuple[float, float, str, str]] = []
    for name, y in lines.items():
        known = np.flatnonzero(np.isfinite(y))
        if not known.size:
            continue
        (drawn,) = axes.plot(x[known], y[known], **{"clip_on": False, "zorder": 3, **styles.get(name, {})})
        ends.append((float(x[known[-1]]), float(y[known[-1]]), name, drawn.get_color()))
    _name_ends(axes, ends)


def _name_ends(axes: Any, ends: list[tuple[float, float, str, str]]) -> None:
    """Write names beside the lines' ends, pushed apart where they would cover each other."""
    if not ends:
        return
    axes.margins(x=0.03, y=0.12)
    low, high = axes.get_ylim()
    ends = sorted(ends, key=lambda e: e[1])
    height = 0.105 * (high - low) * 1.45 / max(_inches(axes), 0.8)
    places = spread([e[1] for e in ends], height, (low, high))
    for (x, y, name, colour), place in zip(ends, places, strict=True):
        axes.annotate(
            name, (x, y), (6, (place - y) / (high - low) * 72 * _inches(axes)), color=colour, fontsize=8,
            textcoords="offset points", va="center", annotation_clip=False,
        )  # fmt: skip


def _inches(axes: Any) -> float:
    grid = axes.get_gridspec()
    return 0.72 * axes.figure.get_figheight() / (grid.nrows if grid else 1)


def spread(places: Sequence[float], least: float, within: tuple[float, float] = (-np.inf, np.inf)) -> list[float]:
    """Rising places moved apart until neighbours are ``least`` from each other, about their common middle.

    >>> spread([0.0, 0.0, 5.0], 1.0)
    [-0.5, 0.5, 5.0]
    >>> spread([0.0, 0.0, 5.0], 1.0, (0.0, 4.0))
    [0.0, 1.0, 4.0]
    """
    groups: list[list[float]] = []
    for place in places:
        groups.append([place])
        while len(groups) > 1 and _too_near(groups[-2], groups[-1], least):
            groups[-2:] = [groups[-2] + groups[-1]]
    found = [sum(g) / len(g) + least * (k - (len(g) - 1) / 2) for g in groups for k in range(len(g))]
    for i in range(len(found)):
        found[i] = max(found[i], within[0] if i == 0 else found[i - 1] + least)
    for i in reversed(range(len(found))):
        found[i] = min(found[i], within[1] if i == len(found) - 1 else found[i + 1] - least)
    return found


def _too_near(below: list[float], above: list[float], least: float) -> bool:
    apart = sum(above) / len(above) - sum(below) / len(below)
    return apart < least * (len(below) + len(above)) / 2 * (1 - 1e-12)
