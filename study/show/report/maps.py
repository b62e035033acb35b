"""Maps of a report: scores over station, angle and force."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np

from softjaw.study.result.layout import FAILED
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number, shown
from softjaw.study.show.report.page import Picture
from softjaw.study.show.report.spots import Spot, spot
from softjaw.study.show.tables.ranking import largest

MOST_ANGLES, MOST_TICKS, FEW = 4, 12, 5
SHORT = {"quality": "grasp quality [-]", "e_n": "e_n [mm]", "dent": "dent [mm]", "wall_stress": "wall stress [MPa]"}
MAPS = ("quality", "e_n")
OF_WALL = ("dent", "wall_stress")
POINT = "Point at a cell, tap it, or reach a map with the tab key and go on with the arrow keys: its values are told."
HOW_TO_READ = "Crossed out: failed. Dotted: no value yet."


def main_axis(data: Data) -> int:
    """Position of the axis that maps are drawn over: the stations, or a sweep where there is only one station."""
    lengths = data.shape[:-3]
    place = len(lengths)
    return int(np.argmax(lengths)) if data.shape[place] == 1 and max(lengths, default=1) > 1 else place


def plane(data: Data, array: np.ndarray, x: int, y: int, index: Sequence[int]) -> np.ndarray:
    """Two-dimensional cut ``(y, x)`` through an array over all cases, all other axes at ``index``."""
    cut = array[tuple(slice(None) if i in (x, y) else index[i] for i in range(array.ndim))]
    return cut if y < x else cut.T


def scaled(data: Data, name: str) -> np.ndarray:
    """A map in the unit people read; NaN everywhere if the file has no value of it."""
    found = data.map(name)
    return np.full(data.shape, np.nan) if found is None else found * data.units(name)[2]


def ticks(data: Data, position: int) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Cell borders, tick places and tick texts of an axis; few levels get rows of equal width."""
    axis = data.axes[position]
    factor = shown(axis.units)[1]
    values = axis.values * factor
    poses = position == len(data.shape) - 3 and data.by_poses
    if texts := data.texts(axis):
        return np.arange(len(values) + 1) - 0.5, np.arange(len(values)), texts
    if poses or (position >= len(data.shape) - 2 and len(values) <= MOST_TICKS):
        texts = _pose_texts(data) if poses else [f"{v:.5g}" for v in values]
        step = -(-len(values) // (3 * MOST_TICKS))
        return np.arange(len(values) + 1) - 0.5, np.arange(len(values))[::step], texts[::step]
    return pictures.edges(values, 1.0), np.empty(0), []


def _pose_texts(data: Data) -> list[str]:
    """Names of explicit poses: wrapped where there are few, cut short and upright where there are many."""
    names = [str(name) or str(i) for i, name in enumerate(data.result.labels[:, 0])]
    if len(names) <= FEW:
        return [fill(name, 60 // len(names)) for name in names]
    return [name if len(name) < 25 else f"{name[:23]}…" for name in names]


def different_angles(data: Data) -> list[int]:
    """Angles whose maps are not those of an earlier angle (images by symmetry)."""
    found: list[int] = []
    arrays = [np.moveaxis(scaled(data, name), -2, 0) for name in MAPS]
    states = np.moveaxis(data.status, -2, 0)
    for j in range(data.shape[-2]):
        same = any(
            np.array_equal(states[i], states[j])
            and all(np.allclose(a[i], a[j], rtol=1e-9, atol=0, equal_nan=True) for a in arrays)
            for i in found
        )
        found += [] if same else [j]
    return found


def chosen_angles(data: Data, index: Sequence[int]) -> list[int]:
    """At most `MOST_ANGLES` of the different angles, that of the best case among them."""
    angles = different_angles(data)
    if len(angles) <= MOST_ANGLES:
        return angles
    spread = {angles[int(i)] for i in np.linspace(0, len(angles) - 1, MOST_ANGLES)}
    best = index[-2] if index[-2] in angles else angles[0]
    return sorted(spread if best in spread else {best, *sorted(spread)[1:]})


def draw_panel(
    data: Data, axes: Any, name: str, x: int, y: int, index: Sequence[int], limits: tuple[float, float]
) -> Any:
    """One map over two axes, its largest value marked; returns what its colour bar belongs to."""
    (xe, xt, xl), (ye, yt, yl) = ticks(data, x), ticks(data, y)
    values, failed = plane(data, scaled(data, name), x, y, index), plane(data, data.status == FAILED, x, y, index)
    drawn = pictures.heat(
        axes, xe, ye, values, failed, cmap=pictures.COLOURS[name], vmin=limits[0], vmax=limits[1]
    )  # fmt: skip
    axes.set(xlim=(xe[0], xe[-1]), ylim=(ye[0], ye[-1]))
    if xl:
        axes.set_xticks(xt, xl, rotation=90 if len(xl) > FEW and max(map(len, xl)) > 6 else 0)
    if yl:
        axes.set_yticks(yt, yl)
    if np.isfinite(values).any():
        i, j = np.unravel_index(largest(values), values.shape)
        place = (0.5 * (xe[j] + xe[j + 1]), 0.5 * (ye[i] + ye[i + 1]))
        for colour, width in (("white", 2.6), (pictures.INK, 1.1)):
            axes.plot(*place, "o", ms=7, mfc="none", mec=colour, mew=width)
    if data.walled:
        _cross(axes, xe, ye, plane(data, data.lost, x, y, index))
    return drawn


def panel_spot(data: Data, axes: Any, name: str, x: int, y: int, index: Sequence[int], where: str = "") -> Spot:
    """Where the cells of a panel are on a drawn picture, and their cases."""
    cases = plane(data, data.rows, x, y, index)
    label = f"{data.units(name)[0]}{f' at {where}' if where else ''}"
    return spot(axes, label, ticks(data, x)[0], ticks(data, y)[0], cases)


def _cross(axes: Any, x: np.ndarray, y: np.ndarray, chosen: np.ndarray) -> None:
    """Small crosses in the middle of cells between borders ``x`` and ``y``, one marker for all of them."""
    i, j = np.nonzero(chosen)
    places = 0.5 * (x[j] + x[j + 1]), 0.5 * (y[i] + y[i + 1])
    for colour, width in (("white", 2.6), (pictures.INK, 1.0)):
        axes.plot(*places, "x", ms=4, mec=colour, mew=width)


def elsewhere(data: Data, index: Sequence[int], *drawn: int) -> str:
    """Where the axes stand that a picture does not show."""
    words = []
    for i, axis in enumerate(data.axes):
        if i not in drawn and data.shape[i] > 1:
            unit, factor = shown(axis.units)
            if texts := data.texts(axis):
                words.append(f"{data.name(axis)} {texts[index[i]]}")
                continue
            text = f"{data.name(axis)} {number(axis.values[index[i]] * factor, 4)} {unit}"
            words.append(text.rstrip().replace(" °", "°"))
    return ", ".join(words)


def force_maps(data: Data, index: tuple[int, ...], names: tuple[str, str] = MAPS) -> tuple[Picture, bytes]:
    """Two maps over the main axis and the force, one row for each angle; and the same as PNG."""
    x, y, angle = main_axis(data), len(data.shape) - 1, len(data.shape) - 2
    rows = chosen_angles(data, index)
    height = min(max(1.2 + 0.22 * data.shape[y], 1.7), 2.8)
    texts = ticks(data, x)[2]
    upright = 0.07 * max(map(len, texts), default=0) if len(texts) > FEW else 0.0
    drawn, axes = pictures.figure(10, height * len(rows) + 0.7 + upright, len(rows), 2, sharex=True, sharey=True)
    at = shown(data.axes[angle].units)[1]
    for column, name in enumerate(names):
        values = scaled(data, name)
        limits, last = pictures.span(np.take(values, rows, angle)), None
        for row, j in enumerate(rows):
            here = (*index[:angle], j, index[-1])
            last = draw_panel(data, axes[row, column], name, x, y, here, limits)
            title = f"angle {data.axes[angle].values[j] * at:.4g}°" if data.shape[angle] > 1 else ""
            axes[row, column].set_title(title)
        if np.isfinite(values).any():
            pictures.colour_bar(drawn, last, list(axes[:, column]), SHORT[name])
        else:
            axes[0, column].set_title(f"{data.units(name)[0]}: no values")
        axes[-1, column].set_xlabel(data.axis_label(data.axes[x]))
    for row in range(len(rows)):
        axes[row, 0].set_ylabel("force per finger [N]")
    labels = [data.units(name)[0] for name in names]
    crossed = data.walled and data.lost.any()
    marks = " Small cross: too weak or too strong for the object, or the grasp is lost." if crossed else ""
    caption = f"The circle marks the largest value of each panel.{marks} {HOW_TO_READ}"
    if where := elsewhere(data, index, x, y, angle):
        caption = f"At {where}. {caption}"
    hidden = data.shape[angle] - len(rows)
    if hidden:
        images = len(different_angles(data)) == len(rows)
        why = "the same map" if images else "see the next picture or the file"
        caption += f" {hidden} more angle{'s' * (hidden > 1)} not drawn here: {why}."
    over = f"{data.name(data.axes[x])} and normal force"
    alt = f"Heat maps of {' and '.join(labels)} over {over}. {extremes(data, index, names)}"
    svg = pictures.as_svg(drawn)
    spots = []
    for row, j in enumerate(rows):
        here = (*index[:angle], j, index[-1])
        titles = [panel.get_title("left") for panel in axes[row]]
        spots += [panel_spot(data, axes[row, c], name, x, y, here, titles[c]) for c, name in enumerate(names)]
    shown_ = Picture(svg, alt, caption, spots=tuple(spots))
    drawn.suptitle(f"{data.title}: {' and '.join(labels)}", fontsize=10, x=0.01, ha="left")
    return shown_, pictures.as_png(drawn)


def extremes(data: Data, index: tuple[int, ...], names: tuple[str, ...] = MAPS) -> str:
    """Ranges of maps at the force shown, in words."""
    words = []
    for name in names:
        values = scaled(data, name)[..., index[-1]]
        if np.isfinite(values).any():
            low, high = (np.unravel_index(largest(sign * values), values.shape) for sign in (-1, 1))
            label, unit, _ = data.units(name)
            words.append(
                f"{label} runs from {number(values[low])} ({data.place((*low, index[-1]))}) to "
                f"{number(values[high])} {unit} ({data.place((*high, index[-1]))})".replace("  ", " ")
            )
    return f"At {number(data.forces[index[-1]])} N " + "; ".join(words) + "." if words else "No values."
