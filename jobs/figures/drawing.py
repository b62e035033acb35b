"""Drawing habits of the paper's figures: lines, polygons, arrows, and images of solids among axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.collections import PolyCollection
from matplotlib.patheffects import withStroke

from softjaw.study import pictures
from softjaw.study.show.plots import MODELS
from softjaw.study.show.view import solids

PAPER, MARGIN = 250, 6  # grey level from which a pixel is empty paper, and pixels that are kept round what is drawn
LINES = {"ccm": ("-", "o"), "pcm": ("--", "s"), "pcm_projected": (":", "^")}  # of the friction models


def model_look(model: str, **more: Any) -> dict[str, Any]:
    """How the line of a friction model looks, with its name as label."""
    line, marker = LINES[model]
    return {"label": MODELS[model][0], "color": MODELS[model][1], "linestyle": line, "marker": marker, **more}


def polygons(axes: Any, corners: np.ndarray, values: np.ndarray, limits: tuple[float, float], **look: Any) -> Any:
    """Polygons in the colours of ``values``."""
    look = {"edgecolor": "face", "linewidth": 0.5, **look}
    drawn = PolyCollection(list(corners), array=np.ma.masked_invalid(values), **look)
    drawn.set_clim(*limits)
    axes.add_collection(drawn, autolim=False)
    return drawn


def arrow(axes: Any, tail: np.ndarray, tip: np.ndarray) -> None:
    """An arrow that shows on light and dark ground."""
    style = {"arrowstyle": "-|>", "color": pictures.INK, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tip, tail, arrowprops={**style, "path_effects": [withStroke(linewidth=4, foreground="white")]})


def placed(axes: Any, image: np.ndarray, title: str) -> None:
    """Set an image into axes of its own, without frame and ticks."""
    axes.imshow(image, interpolation="antialiased", interpolation_stage="rgba")
    axes.set_title(title)
    axes.set_axis_off()


def scale(drawn: Any, axes: Any, label: str, colours: str, limits: tuple[float, float]) -> None:
    """A colour bar of images, below the axes that hold them."""
    some = np.ravel(axes)
    mapped = some[0].scatter([], [], c=[], cmap=colours, vmin=limits[0], vmax=limits[1])
    bar = drawn.colorbar(mapped, ax=list(some), location="bottom", label=label, shrink=0.6, aspect=30, pad=0.02)
    bar.outline.set_visible(False)


def scale_beside(drawn: Any, mapped: Any, axes: Any, label: str) -> None:
    """A colour bar as high as axes that have an aspect of their own."""
    bar = drawn.colorbar(mapped, label=label, cax=axes.inset_axes([1.03, 0.0, 0.035, 1.0]))
    bar.outline.set_visible(False)


def rendered(draw: Callable[[Any], None], towards: Any, up: Any, size: tuple[int, int]) -> np.ndarray:
    """Image ``(h, w, 3)`` of what ``draw`` puts on a plotter, seen from the direction ``towards``, without its margins.

    The projection is parallel: lengths in the picture can be compared.
    """
    with pv.vtk_verbosity("off"):  # it warns of every kind of screen that is not there
        plotter = pv.Plotter(off_screen=True, window_size=size, border=False)
        try:
            plotter.set_background("white")
            plotter.enable_anti_aliasing("ssaa")
            draw(plotter)
            for title in list(plotter.scalar_bars.keys()):  # the figure has its own
                plotter.remove_scalar_bar(title)
            solids.look(plotter, towards, up)
            return trimmed(plotter.screenshot(return_img=True))
        finally:
            plotter.close()


def dots(plotter: Any, places: np.ndarray, radius: float, colour: str) -> None:
    """Balls at ``places (n, 3)``."""
    ball = pv.Sphere(radius=radius, theta_resolution=12, phi_resolution=12)
    balls = pv.PolyData(places).glyph(geom=ball, scale=False, orient=False)
    plotter.add_mesh(balls, color=colour, **solids.LIGHT)


def trimmed(image: np.ndarray) -> np.ndarray:
    """The part of an image that is not empty paper, with a small margin."""
    drawn = (image[..., :3] < PAPER).any(axis=-1)
    rows, columns = (np.flatnonzero(drawn.any(axis=k)) for k in (1, 0))
    if not rows.size:
        return image
    (top, bottom), (left, right) = ((max(a[0] - MARGIN, 0), a[-1] + 1 + MARGIN) for a in (rows, columns))
    return image[top:bottom, left:right]
