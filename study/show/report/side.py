"""The object from the side, in the colours of the maps, with the pads of the best grasp."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from softjaw.study.result.layout import FAILED
from softjaw.study.show import pictures
from softjaw.study.show.data import Data
from softjaw.study.show.outline import outline, pad_extent, slice_polygon
from softjaw.study.show.report.maps import HOW_TO_READ, MAPS, SHORT, elsewhere, extremes, scaled
from softjaw.study.show.report.page import Picture
from softjaw.study.show.report.spots import spot

MOST_STATIONS = 80  # more ticks than that would be a bar


def side_view(data: Data, scene: Any, index: tuple[int, ...]) -> Picture | None:
    """The object from the side in the colours of both maps, with the best grasp's pads; None if it cannot be drawn."""
    found = None if data.by_poses else outline(data, scene, index)
    if found is None:
        return None
    z, radius, exact = found
    stations = data.axes[-3].values
    length, thickness = pad_extent(scene, data.axes[-3]) if scene else (0.0, 0.0)
    borders = pictures.edges(stations, length or float(np.ptp(z)) or 0.01)
    top, wide = radius.max() + 1.25 * thickness, max(np.ptp(z), np.ptp(borders))
    names = [name for name in MAPS if len(stations) > 1 and np.isfinite(scaled(data, name)).any()]
    if len(stations) > 1 and not names:
        names = list(MAPS[:1])
    size = (10, min(max(3.9 * 2 * top / wide + 0.7, 2.0), 4.8)) if names else (5.5, 3.4)
    size = (6.5, size[1]) if len(names) == 1 else size
    drawn, axes = pictures.figure(*size, 1, len(names) or 1, sharey=True)
    for axis, name in zip(axes[0], names or ("",), strict=True):
        if name:
            _slices(data, drawn, axis, name, index, (z, radius), borders)
        axis.plot(1e3 * np.concatenate([z, z[::-1], z[:1]]), 1e3 * np.concatenate([radius, -radius[::-1], radius[:1]]),
                  color=pictures.INK, lw=0.9)  # fmt: skip
        if len(stations) <= MOST_STATIONS:
            axis.plot(1e3 * stations, np.zeros(len(stations)), "|", color=pictures.INK, ms=5, mew=0.6)
        if data.best is not None:
            _pads(axis, float(data.axes[-3].values[index[-3]]), z, radius, length, thickness)
        axis.set(aspect="equal", xlabel="station [mm]")
        axis.autoscale_view()
    axes[0, 0].set_ylabel("along the approach [mm]")
    how = "" if exact else " The outline is drawn from the measured distance of the contacts."
    pads = " Grey: the pads of the best grasp before they press, to scale." if length and data.best else ""
    where = elsewhere(data, index, len(data.shape) - 3)
    ticks = "Ticks: stations." if len(stations) <= MOST_STATIONS else ""
    read = f" {HOW_TO_READ}" if names else ""
    caption = f"Seen across the approach{f', at {where}' if where else ''}. {ticks}{pads}{read}{how}"
    coloured = " in the colours of grasp quality and e_n" if names else ""
    alt = f"Side view of {data.title}{coloured}. {extremes(data, index)}"
    svg = pictures.as_svg(drawn)
    cases = data.rows[(*index[:-3], slice(None), *index[-2:])][None, :]
    reach = 1e3 * radius.max() * np.array([-1.0, 1.0])
    spots = [spot(a, data.units(name)[0], 1e3 * borders, reach, cases) for a, name in zip(axes[0], names, strict=False)]
    return Picture(svg, alt, caption, narrow=len(names) < 2, spots=tuple(spots))


def _slices(data: Data, drawn: Any, axis: Any, name: str, index: Sequence[int], line: Any, borders: np.ndarray) -> None:
    cut = (*index[:-3], slice(None), *index[-2:])
    values, failed = scaled(data, name)[cut], (data.status == FAILED)[cut]
    corners = [slice_polygon(*line, low, high) for low, high in pairwise(borders)]
    there = np.array([c is not None for c in corners])
    limits = pictures.span(values)
    done = np.flatnonzero(there & np.isfinite(values))
    style = {"cmap": pictures.COLOURS[name], "vmin": limits[0], "vmax": limits[1]}
    mapped = pictures.polygons(axis, [corners[i] for i in done], values[done], **style)
    pictures.dotted(axis, [corners[i] for i in np.flatnonzero(there & ~failed & np.isnan(values))])
    pictures.crossed_out(axis, [corners[i] for i in np.flatnonzero(there & failed)])
    if done.size:
        pictures.colour_bar(drawn, mapped, axis, SHORT[name], beside=True)


def _pads(axis: Any, station: float, z: np.ndarray, radius: np.ndarray, length: float, thickness: float) -> None:
    near = np.abs(z - station) <= length / 2
    ends = np.interp([station - length / 2, station + length / 2], z, radius)
    touch = max([*radius[near], *ends])
    for side in (1.0, -1.0) if length else ():
        low = touch if side > 0 else -touch - thickness
        corner = np.array([[-length / 2, 0], [length / 2, 0], [length / 2, thickness], [-length / 2, thickness]])
        axis.fill(*(1e3 * (corner + np.array([station, low]))).T, facecolor="#c4cacf", edgecolor=pictures.SOFT, lw=0.7)
