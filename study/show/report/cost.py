"""How hard every candidate was to solve: Newton iterations, repeated steps, and where the time went."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.result.layout import FAILED
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number
from softjaw.study.show.report.maps import elsewhere, main_axis, ticks
from softjaw.study.show.report.page import Picture
from softjaw.study.show.tables.status import PARTS

GREYS = ("#12436d", "#6f9cc0", "#c05a00", "#c9ced2")  # as PARTS; they differ in lightness too
HATCHES = ("", "", "////", "")


def cost_picture(data: Data, index: tuple[int, ...]) -> Picture | None:
    """Iterations, cuts and seconds of all forces over the main axis, bars of one angle each; None if not stored."""
    x = main_axis(data)
    if data.shape[x] < 2 or data.values("work/newton_iterations") is None:
        return None
    iterations, cuts = (_sums(data, f"work/{name}", x, index) for name in ("newton_iterations", "cuts"))
    parts = {part: _sums(data, f"work/seconds_{part}", x, index) for part in PARTS}
    borders, places, texts = ticks(data, x)
    drawn, axes = pictures.figure(10, 2.7, 1, 3, gap=0.14)
    _bars(axes[0, 0], borders, {"": iterations}, "Newton iterations")
    _bars(axes[0, 1], borders, {"": cuts}, "steps tried again (cuts)")
    _bars(axes[0, 2], borders, parts, "seconds")
    axes[0, 2].legend(frameon=False, fontsize=7.5, ncols=2, loc="lower left", bbox_to_anchor=(0, 1.0), borderpad=0)
    gone = _failed(data, x, index)
    for panel, title in zip(axes[0], ("Newton iterations", "cuts", ""), strict=True):
        top = panel.get_ylim()[1]
        pictures.crossed_out(panel, [[[a, 0], [b, 0], [b, top], [a, top]] for a, b in _where(borders, gone)])
        panel.set(title=title, xlabel=data.axis_label(data.axes[x]), xlim=(borders[0], borders[-1]), ylim=(0, top))
        if texts:
            panel.set_xticks(places, texts, rotation=90 if max(map(len, texts)) > 6 else 0)
    worst = int(np.nanargmax(np.nan_to_num(iterations)))
    totals = [number(np.nansum(found), 6) for found in (iterations, cuts)]
    said = (
        f"{totals[0]} Newton iterations and {totals[1]} repeated steps (cuts), most iterations "
        f"({number(iterations[worst])}) at {_named(data, x, worst)}"
    )
    where = elsewhere(data, index, x, len(data.shape) - 2, len(data.shape) - 1)
    caption = (
        f"{f'At {where}. ' if where else ''}Sums over all forces and angles of what each "
        "candidate took, images of a grasp included though they are solved once. Crossed out: some case failed. "
        f"{said}."
    )
    return Picture(pictures.as_svg(drawn), f"Bars of the effort over {data.name(data.axes[x])}: {said}.", caption)


def _sums(data: Data, path: str, x: int, index: tuple[int, ...]) -> np.ndarray:
    """Sums over forces and angles along the main axis, other axes at ``index``; NaN where nothing is known.

    Of two fingers the larger count is taken: they are often one system, or one the image of the other.
    """
    found = data.values(path)
    if found is None:
        return np.full(data.shape[x], np.nan)
    found = found.max(axis=-1) if found.ndim > len(data.shape) else found
    cut = _cut(data, x, index)
    values = found[cut].reshape(data.shape[x], -1)
    return np.where(np.isfinite(values).any(axis=1), np.nansum(values, axis=1), np.nan)


def _cut(data: Data, x: int, index: tuple[int, ...]) -> tuple[Any, ...]:
    last = len(data.shape) - 2
    return tuple(slice(None) if i == x or i >= last else k for i, k in enumerate(index))


def _failed(data: Data, x: int, index: tuple[int, ...]) -> np.ndarray:
    return (data.status[_cut(data, x, index)] == FAILED).reshape(data.shape[x], -1).any(axis=1)


def _where(borders: np.ndarray, chosen: np.ndarray) -> list[tuple[float, float]]:
    return [(float(borders[i]), float(borders[i + 1])) for i in np.flatnonzero(chosen)]


def _bars(panel: Any, borders: np.ndarray, parts: dict[str, np.ndarray], label: str) -> None:
    """Bars on top of each other, one for each place."""
    middle, width, bottom = 0.5 * (borders[1:] + borders[:-1]), 0.8 * np.diff(borders), np.zeros(len(borders) - 1)
    for (name, found), colour, hatch in zip(parts.items(), GREYS, HATCHES, strict=False):
        height = np.nan_to_num(found)
        panel.bar(middle, height, width, bottom, color=colour, hatch=hatch, edgecolor="white", lw=0.2, label=name)
        bottom = bottom + height
    panel.set_ylabel(label)
    panel.locator_params(axis="y", nbins=5, integer=label != "seconds")
    panel.set_ylim(0, 1.08 * max(float(bottom.max()), 1e-3 if label == "seconds" else 1.0))


def _named(data: Data, x: int, i: int) -> str:
    index = [0] * len(data.shape)
    index[x] = i
    if data.by_poses and x == len(index) - 3:
        return data.place(index)
    return elsewhere(data, index, *(k for k in range(len(data.shape)) if k != x))
