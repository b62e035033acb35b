"""The object from two sides without a screen, in the colours of some maps, with the pads of one case."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyvista as pv

from softjaw.study.show.view.drawing import draw_object, draw_pads
from softjaw.study.show.view.model import View
from softjaw.study.show.view.pads import pads

PIXELS = 900  # a side of a picture before its margins are cut
MARGIN = 12
OBLIQUE = 0.65  # angle from the first finger to the first side [rad]


def two_sides(view: View, index: tuple[int, ...], limits: Mapping[str, tuple[float, float]]) -> np.ndarray:
    """Pictures ``(map, side, height, width, 3)`` without colour bars: one row for each map in ``limits``, in its unit.

    The first side looks obliquely at finger 1. The second one is a quarter turn on where the object looks alike after
    half a turn, so that it shows what the first does not, and else half a turn on.
    """
    with pv.vtk_verbosity("off"):
        return trimmed(np.stack([_seen(view, index, name, limits[name]) for name in limits]))


def _seen(view: View, index: tuple[int, ...], name: str, limits: tuple[float, float]) -> np.ndarray:
    plotter = pv.Plotter(off_screen=True, window_size=(PIXELS, PIXELS))
    try:
        plotter.set_background("white")
        draw_object(plotter, view, index, name, limits)
        draw_pads(plotter, view, index, "x")
        for title in list(plotter.scalar_bars.keys()):
            plotter.remove_scalar_bar(title)
        out, beside, up = _directions(view, index)
        on = 0.5 * np.pi if getattr(view.object, "axis_symmetry", 1) % 2 == 0 else np.pi
        level = [np.cos(a) * out + np.sin(a) * beside for a in (OBLIQUE, OBLIQUE + on)]
        return np.stack([_from(plotter, place + 0.3 * up, up) for place in level])
    finally:
        plotter.close()


def _directions(view: View, index: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors away from the object towards finger 1, beside it, and up."""
    found = pads(view.data, view.gripper, index)
    out = -found[0].approach if found else np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0]) if abs(out[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    beside = np.cross(up, out)
    return out, beside / np.linalg.norm(beside), up


def _from(plotter: Any, place: np.ndarray, up: np.ndarray) -> np.ndarray:
    plotter.enable_parallel_projection()
    plotter.view_vector(place, viewup=up)
    plotter.reset_camera()
    return np.asarray(plotter.screenshot(return_img=True))[..., :3]


def trimmed(pictures: np.ndarray) -> np.ndarray:
    """Pictures ``(..., height, width, 3)`` without the white margins that all of them have.

    >>> a = np.full((1, 60, 80, 3), 255); a[0, 30, 40] = 0
    >>> trimmed(a).shape
    (1, 25, 25, 3)
    """
    ink = (pictures < 255).any(axis=-1).any(axis=tuple(range(pictures.ndim - 3)))
    kept = []
    for axis in (1, 0):
        found = np.flatnonzero(ink.any(axis=axis))
        kept.append(slice(max(found[0] - MARGIN, 0), found[-1] + MARGIN + 1) if found.size else slice(None))
    return pictures[..., kept[0], kept[1], :]
