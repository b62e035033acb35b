"""Fig. 8 of the paper: e_n and grasp quality on two objects."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study import pictures
from softjaw.study.result.vtkhdf import NOBODY
from softjaw.study.show.data import WIDE, Data, number
from softjaw.study.show.figures import WIDTH
from softjaw.study.show.outline import read_scene, shape_outline
from softjaw.study.show.tables.ranking import largest
from softjaw.study.show.view import solids
from softjaw.study.show.view.model import View

QUANTITIES = {"e_n": "e_n [mm]", "quality": "grasp quality [-]"}


def maps(*objects: Data) -> tuple[Any, str]:
    """e_n and quality of every candidate on its place of the object, at the highest force that some wall bears."""
    drawn, axes = pictures.figure(WIDTH, 4.2, 1, len(QUANTITIES) * len(objects))
    for data, pair in zip(objects, axes.reshape(len(objects), -1), strict=True):
        for panel, (name, label) in zip(pair, QUANTITIES.items(), strict=True):
            image, limits = _map(data, name)
            pictures.placed(panel, image, f"{data.title}, {number(data.forces[data.k])} N")
            pictures.scale(drawn, panel, label, pictures.COLOURS[name], limits)
    return drawn, "; ".join(best_and_widest(data) for data in objects)


def _map(data: Data, name: str) -> tuple[np.ndarray, tuple[float, float]]:
    """The deformed object in the colours of a map, and the limits of these [mm for lengths]."""
    view, index = View(data, ()), (0, 0, data.k)
    corners, cell = view.surface.triangles, view.surface.candidate
    values = data.units(name)[2] * view.over_candidates(data.map(name), data.k)
    limits = pictures.span(values)
    shown = np.where(cell == NOBODY, np.nan, values[cell])

    def draw(plotter: Any) -> None:
        solids.surface(plotter, 1e3 * view.moved(index), corners, shown, cmap=pictures.COLOURS[name], clim=limits)

    return solids.rendered(draw, (0.8, 0.6, 0.25), (0, 0, 1), (900, 1300)), limits


def best_and_widest(data: Data) -> str:
    """Where e_n and quality are largest, how large they are where the object is widest, and the best grasp."""
    stations, wide = 1e3 * data.axes[-3].values, widest(data)
    words = []
    for name in QUANTITIES:
        values = data.map(name)[..., data.k]
        i, _ = np.unravel_index(largest(values), values.shape)
        share = 100 * np.nanmax(values[wide]) / np.nanmax(values)
        words.append(f"{name} largest at {number(stations[i])} mm, where widest at most {number(share)} % of that")
    ends = np.flatnonzero(np.diff(wide.astype(int), prepend=0, append=0)).reshape(-1, 2)
    span = " and ".join(f"{number(stations[a])} to {number(stations[b - 1])} mm" for a, b in ends)
    best = f"best grasp that the wall bears: {data.place(data.best)}"
    return f"{data.title}, {number(data.forces[data.k])} N, widest at {span}: {'; '.join(words)}; {best}"


def widest(data: Data) -> np.ndarray:
    """Stations ``(s,)`` where the object itself is widest, to 0.5 %."""
    shape, stations = read_scene(data.ds.attrs["scene"]).object, data.axes[-3].values
    half = np.max([np.interp(stations, *shape_outline(shape, angle)) for angle in data.axes[-2].values], axis=0)
    return half >= (1 - WIDE) * half.max()
