"""Three-dimensional parts of the paper's figures: drawn without a screen, then set into a figure among its axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyvista as pv

from softjaw.study.show import pictures
from softjaw.study.show.view.colours import NEUTRAL
from softjaw.study.show.view.drawing import LIGHT, darts
from softjaw.study.show.view.pads import Pad

SIZE = (1500, 1500)
PAPER = 250  # grey level from which a pixel counts as empty paper
MARGIN = 6  # pixels kept round what is drawn


def rendered(
    draw: Callable[[Any], None], towards: Any, up: Any = (0, 0, 1), size: tuple[int, int] = SIZE
) -> np.ndarray:
    """Image ``(h, w, 3)`` of what ``draw`` puts on a plotter, seen from the direction ``towards``, without its margins.

    The projection is parallel: lengths in the picture can be compared.
    """
    with pv.vtk_verbosity("off"):  # it tells of every kind of screen that is not there
        plotter = pv.Plotter(off_screen=True, window_size=size, border=False)
        try:
            plotter.set_background("white")
            plotter.enable_anti_aliasing("ssaa")
            draw(plotter)
            for title in list(plotter.scalar_bars.keys()):  # the figure has its own
                plotter.remove_scalar_bar(title)
            plotter.view_vector(towards, viewup=up)
            plotter.enable_parallel_projection()
            plotter.reset_camera()
            image = plotter.screenshot(return_img=True)
        finally:
            plotter.close()
    return trimmed(image)


def trimmed(image: np.ndarray) -> np.ndarray:
    """The part of an image that is not empty paper, with a small margin."""
    drawn = (image[..., :3] < PAPER).any(axis=-1)
    rows, columns = (np.flatnonzero(drawn.any(axis=k)) for k in (1, 0))
    if not rows.size:
        return image
    (top, bottom), (left, right) = ((max(a[0] - MARGIN, 0), a[-1] + 1 + MARGIN) for a in (rows, columns))
    return image[top:bottom, left:right]


def placed(axes: Any, image: np.ndarray, title: str) -> None:
    """Set an image into axes of its own, without frame and ticks."""
    axes.imshow(image, interpolation="antialiased", interpolation_stage="rgba")
    axes.set_title(title)
    axes.set_axis_off()


def scale(drawn: Any, axes: Any, label: str, colours: str, limits: tuple[float, float], where: str = "bottom") -> None:
    """A colour bar of images, beside or below the axes that hold them."""
    some = np.ravel(axes)
    mapped = some[0].scatter([], [], c=[], cmap=colours, vmin=limits[0], vmax=limits[1])
    bar = drawn.colorbar(mapped, ax=list(some), location=where, label=label, shrink=0.6, aspect=30, pad=0.02)
    bar.outline.set_visible(False)


def surface(plotter: Any, points: np.ndarray, triangles: np.ndarray, colour: str, **look: Any) -> None:
    """A smooth surface of one colour."""
    mesh = pv.PolyData.from_regular_faces(points, triangles)
    plotter.add_mesh(mesh, color=colour, smooth_shading=True, split_sharp_edges=True, **{**LIGHT, **look})


def cells(plotter: Any, corners: np.ndarray, values: np.ndarray, colours: Any, limits: tuple[float, float]) -> None:
    """Triangles ``(m, 3, 6)`` with the normals of their corners in the colours of their values; grey without one."""
    mesh = pv.PolyData.from_regular_faces(corners[..., :3].reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    mesh.point_data.active_normals = corners[..., 3:].reshape(-1, 3)
    mesh.cell_data["value"] = values
    drawn = plotter.add_mesh(mesh, scalars="value", cmap=colours, clim=limits, nan_color=NEUTRAL, **LIGHT)
    drawn.prop.interpolation = "Phong"


def faces(plotter: Any, corners: np.ndarray, values: np.ndarray, colours: Any, top: float, **look: Any) -> None:
    """Quadrilaterals ``(k, 4, 3)`` in the colours of their values, with their borders."""
    mesh = pv.PolyData.from_regular_faces(corners.reshape(-1, 3), np.arange(4 * len(corners)).reshape(-1, 4))
    mesh.cell_data["value"] = values
    edges = {"show_edges": True, "edge_color": pictures.SOFT, "line_width": 1}
    plotter.add_mesh(mesh, scalars="value", cmap=colours, clim=(0, top), lighting=False, **{**edges, **look})


def block(plotter: Any, pad: Pad, colour: str) -> None:
    """A pad's sides, which one sees through, and its edges."""
    sides = pad.sides()
    faces(plotter, 1e3 * sides, np.zeros(len(sides)), [colour], 1.0, opacity=0.25, show_edges=False)
    lines(plotter, 1e3 * pad.lines(), colour)


def pressures(plotter: Any, pad: Pad, colours: Any, top: float, **look: Any) -> None:
    """The loaded faces of a pad in the colours of their pressure [kPa]."""
    loaded = pad.loaded.ravel()
    corners = pad.quads()[loaded] - pad.lift * pad.approach
    faces(plotter, 1e3 * corners, 1e-3 * pad.pressure.ravel()[loaded], colours, top, **look)


def lines(plotter: Any, ends: np.ndarray, colour: str, width: float = 2.0) -> None:
    """Segments ``(k, 2, 3)``."""
    plotter.add_mesh(pv.line_segments_from_points(ends.reshape(-1, 3)), color=colour, line_width=width)


def arrows(plotter: Any, places: np.ndarray, forces: np.ndarray, longest: float, colour: str) -> None:
    """Darts from ``places`` along ``forces``, the largest force as long as ``longest``."""
    size = np.linalg.norm(forces, axis=1)
    made = darts(places, forces, longest * size / max(float(size.max(initial=0)), 1e-300))
    mesh = pv.PolyData.from_regular_faces(made.reshape(-1, 3), np.arange(3 * len(made)).reshape(-1, 3))
    plotter.add_mesh(mesh, color=colour, lighting=False)


def dots(plotter: Any, places: np.ndarray, radius: float, colour: str = "", **values: Any) -> None:
    """Balls at ``places``, of one colour or in the colours of values, as `pyvista.Plotter.add_mesh` takes them."""
    cloud = pv.PolyData(places)
    if "scalars" in values:
        cloud.point_data["value"] = values.pop("scalars")
        values["scalars"] = "value"
    balls = cloud.glyph(
        geom=pv.Sphere(radius=radius, theta_resolution=12, phi_resolution=12), scale=False, orient=False
    )
    plotter.add_mesh(balls, **({"color": colour} if colour else {}), **values, **LIGHT)


def labels(plotter: Any, places: np.ndarray, texts: list[str]) -> None:
    """Words at places, on white ground."""
    look = {"shape": "rounded_rect", "shape_color": "white", "shape_opacity": 0.75, "margin": 4}
    plotter.add_point_labels(places, texts, font_size=34, text_color=pictures.INK, show_points=False,
                             always_visible=True, **look)  # fmt: skip
