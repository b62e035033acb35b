"""The object from two sides without a screen, in the colours of some maps, with the pads of one case."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyvista as pv

from study.view.drawing import draw_object, draw_pads
from study.view.model import View
from study.view.pads import pads

PIXELS = 900  # a side of a picture before its margins are cut
MARGIN = 12


def two_sides(view: View, index: tuple[int, ...], limits: Mapping[str, tuple[float, float]]) -> np.ndarray:
    """Pictures ``(map, side, height, width, 3)`` without colour bars: one row for each map in ``limits``, in its unit.

    The first side looks obliquely at finger 1, the second comes from the other side of the object.
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
        return np.stack([_from(plotter, side * (0.8 * out + 0.6 * beside) + 0.3 * up, up) for side in (1.0, -1.0)])
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
