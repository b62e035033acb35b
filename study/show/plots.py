"""The only door to plotly: figures with one look, and the habits that all of them share.

Every figure can be read without colour: maps grow evenly in lightness, friction models differ by line and marker, and
failed cases have crosses.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.colors import get_colorscale
from plotly.subplots import make_subplots

from softjaw.study.pictures import COLOURS, INK, SOFT
from softjaw.study.quantities import MODEL_NAMES

GRID, EMPTY = "#e3e6e8", "#e7e9eb"
MODELS = {  # name, colour, line, marker
    "ccm": (MODEL_NAMES["ccm"], "#12436d", "solid", "circle"),
    "pcm": (MODEL_NAMES["pcm"], "#c05a00", "dash", "square"),
    "pcm_projected": (MODEL_NAMES["pcm_projected"], "#2a8c82", "dot", "triangle-up"),
}
MARGIN = {"l": 60, "r": 20, "t": 58, "b": 50}
FLAT = {"lighting": {"ambient": 1, "diffuse": 0, "specular": 0}, "flatshading": True}  # colours are those of the bar


def colours(quantity: str) -> list[list[Any]]:
    """Colour scale of a map as stops, which plotly's script needs for the names that it does not know."""
    return [list(stop) for stop in get_colorscale(COLOURS.get(quantity, "viridis"))]


def bars(title: str, **more: Any) -> dict[str, Any]:
    """A colour bar with its quantity beside it."""
    return {"title": {"text": title, "side": "right"}, "thickness": 14, **more}


def figure(rows: int = 1, columns: int = 1, titles: Sequence[str] = (), **layout: Any) -> go.Figure:
    """An empty figure of panels; ``layout`` goes to `plotly.subplots.make_subplots`."""
    made = make_subplots(rows, columns, subplot_titles=list(titles) or None, **layout)
    made.update_layout(template="none", font={"size": 12, "color": INK}, margin=MARGIN, hovermode="closest",
                       legend={"orientation": "h", "y": -0.12, "yanchor": "top"})  # fmt: skip
    made.update_annotations(font_size=13)
    made.update_xaxes(gridcolor=GRID, zeroline=False, linecolor=SOFT, ticks="outside", title_standoff=6)
    made.update_yaxes(gridcolor=GRID, zeroline=False, linecolor=SOFT, ticks="outside", title_standoff=6)
    return made


def line(made: go.Figure, x: Any, y: np.ndarray, look: Sequence[str], row: int, column: int, error: Any = None) -> None:
    """A line of a figure's panel, counted from 1; left out where it has no finite value.

    ``x, y`` (k,) arrays: NaN where there is none. ``look``: name, colour, line and marker, as `MODELS` has them.
    ``error`` (k,) array, optional: half lengths of the error bars.
    """
    name, colour, dash, symbol = look
    if np.isfinite(y).any():
        made.add_scatter(
            x=x, y=y, name=name, legendgroup=name, mode="lines+markers", row=row, col=column,
            error_y=None if error is None else {"array": np.nan_to_num(np.abs(error)), "thickness": 1},
            line={"color": colour, "dash": dash}, marker={"symbol": symbol, "size": 6},
            showlegend=not any(t.legendgroup == name for t in made.data),
        )  # fmt: skip


def heatmap(x: np.ndarray, y: np.ndarray, values: np.ndarray) -> go.Heatmap:
    """Values ``(len(y), len(x))`` in the colours of the figure's one bar; nothing where they are NaN."""
    return go.Heatmap(x=x, y=y, z=values.astype(np.float32), coloraxis="coloraxis", hoverinfo="z")


def segments(ends: np.ndarray, colour: str, names: str = "") -> go.Scatter:
    """Lines between pairs of points ``(k, 2, ...)`` of a plane with a dot, or a name, at the second one."""
    gaps = np.concatenate([ends[..., :2], np.full((len(ends), 1, 2), np.nan)], axis=1).reshape(-1, 2)
    texts = [text for name in names for text in ("", name, "")]
    look = {"line": {"color": colour, "width": 1.5}, "textfont": {"color": colour}, "textposition": "top right"}
    sizes = [0, 0 if names else 4, 0] * len(ends)
    return go.Scatter(x=gaps[:, 0], y=gaps[:, 1], mode="lines+markers+text", text=texts, marker={"size": sizes},
                      hoverinfo="skip", showlegend=False, **look)  # fmt: skip


def scene(names: Sequence[str] = ("x [mm]", "y [mm]", "z [mm]"), **more: Any) -> dict[str, Any]:
    """Settings of a panel in three dimensions, seen without perspective so that lengths can be compared."""
    look = {"gridcolor": GRID, "backgroundcolor": "white", "nticks": 5}
    axes = {f"{a}axis": {"title": {"text": name}, **look} for a, name in zip("xyz", names, strict=True)}
    return {"aspectmode": "data", "camera": {"projection": {"type": "orthographic"}}, **axes, **more}
