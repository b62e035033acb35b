"""The only door to pyvista: pads, surfaces, arrows and images of them, for windows, pictures and figures.

Lengths are drawn in mm and pressures in kPa. Nothing here needs a screen.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyvista as pv

from softjaw.study.pictures import COLOURS, INK, SOFT
from softjaw.study.show.view.model import FORCE, NEUTRAL, PAD
from softjaw.study.show.view.pads import Pad

LIGHT = {"ambient": 0.62, "diffuse": 0.42, "specular": 0.0}  # colours have to be those of the bar
PAPER, MARGIN = 250, 6  # grey level from which a pixel is empty paper, and pixels that are kept round what is drawn


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
            look(plotter, towards, up)
            return trimmed(plotter.screenshot(return_img=True))
        finally:
            plotter.close()


def look(plotter: Any, towards: Any, up: Any, zoom: float = 1.0) -> None:
    """See everything from a direction, without perspective."""
    plotter.view_vector(towards, viewup=up)
    plotter.enable_parallel_projection()
    plotter.reset_camera()
    plotter.camera.zoom(zoom)


def trimmed(image: np.ndarray) -> np.ndarray:
    """The part of an image that is not empty paper, with a small margin."""
    drawn = (image[..., :3] < PAPER).any(axis=-1)
    rows, columns = (np.flatnonzero(drawn.any(axis=k)) for k in (1, 0))
    if not rows.size:
        return image
    (top, bottom), (left, right) = ((max(a[0] - MARGIN, 0), a[-1] + 1 + MARGIN) for a in (rows, columns))
    return image[top:bottom, left:right]


def surface(
    plotter: Any, points: np.ndarray, triangles: np.ndarray, values: Any = None, candidate: Any = None, **look: Any
) -> None:
    """Triangles ``(m, 3)`` among points ``(n, 3)``: of one colour, or in those of ``values (m,)``; grey without one.

    ``candidate (m,)`` are numbers that a click finds again.
    """
    mesh = pv.PolyData.from_regular_faces(points, triangles)
    if values is not None:
        mesh.cell_data["value"] = values
        look = {"scalars": "value", "nan_color": NEUTRAL, **look}
    if candidate is not None:
        mesh.cell_data["candidate"] = candidate
    # points of two candidates' cells lie on each other: joined, or the light would show the cells' borders
    # degrees; normals are not averaged over sharper bends
    mesh = mesh.clean().compute_normals(split_vertices=True, feature_angle=40, cell_normals=False)
    plotter.add_mesh(mesh, **{**LIGHT, **look})


def faces(plotter: Any, corners: np.ndarray, values: Any = None, **look: Any) -> None:
    """Quadrilaterals ``(k, 4, 3)``, of one colour or in those of ``values (k,)``."""
    mesh = pv.PolyData.from_regular_faces(corners.reshape(-1, 3), np.arange(4 * len(corners)).reshape(-1, 4))
    if values is not None:
        mesh.cell_data["value"] = values
        look = {"scalars": "value", **look}
    plotter.add_mesh(mesh, **{"lighting": False, **look})


def block(plotter: Any, pad: Pad, name: str = "pad") -> None:
    """A pad's sides, which one sees through, and its edges."""
    faces(plotter, 1e3 * pad.sides(), color=PAD, opacity=0.22, name=f"{name} sides")
    lines(plotter, 1e3 * pad.lines(), PAD, name=f"{name} lines")


def pressures(plotter: Any, pad: Pad, top: float, **look: Any) -> None:
    """The loaded faces of a pad in the colours of their pressure, up to ``top`` [kPa]."""
    look = {"cmap": COLOURS["pressure"], "clim": (0, top), "edge_color": SOFT, "line_width": 1, **look}
    faces(plotter, *pad.pressed(), **look)


def lines(plotter: Any, ends: np.ndarray, colour: str, width: float = 2.0, **look: Any) -> None:
    """Segments ``(k, 2, 3)``."""
    plotter.add_mesh(pv.line_segments_from_points(ends.reshape(-1, 3)), color=colour, line_width=width, **look)


def arrows(plotter: Any, ends: np.ndarray, **look: Any) -> None:
    """Arrows along segments ``(k, 2, 3)``, such as those of `study.show.view.pads.Pad.arrows`."""
    cloud = pv.PolyData(ends[:, 0])
    cloud["vector"] = ends[:, 1] - ends[:, 0]
    if cloud["vector"].any():
        shape = pv.Arrow(tip_length=0.35, tip_radius=0.14, shaft_radius=0.06, tip_resolution=10, shaft_resolution=8)
        glyphs = cloud.glyph(orient="vector", scale="vector", geom=shape)
        plotter.add_mesh(glyphs, color=FORCE, lighting=False, **look)


def dots(plotter: Any, places: np.ndarray, radius: float, values: Any = None, **look: Any) -> None:
    """Balls at ``places (n, 3)``, of one colour or in those of values."""
    cloud = pv.PolyData(places)
    if values is not None:
        cloud["value"] = values
        look = {"scalars": "value", "nan_color": NEUTRAL, **look}
    ball = pv.Sphere(radius=radius, theta_resolution=12, phi_resolution=12)
    plotter.add_mesh(cloud.glyph(geom=ball, scale=False, orient=False), **{**LIGHT, **look})


def labels(plotter: Any, places: np.ndarray, texts: list[str], size: int = 34, **look: Any) -> None:
    """Names at places, on white ground."""
    ground = {"shape": "rounded_rect", "shape_color": "white", "shape_opacity": 0.75, "margin": 4}
    plotter.add_point_labels(places, texts, font_size=size, text_color=INK, show_points=False, always_visible=True,
                             **{**ground, **look})  # fmt: skip
