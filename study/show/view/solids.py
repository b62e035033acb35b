"""The only door to pyvista: a case as a picture, without a screen; the parts of such pictures; files for ParaView.

Lengths are drawn in mm and pressures in kPa; files are in SI units.
"""

from contextlib import closing
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
import pyvista as pv
import xarray as xr

from softjaw.study.messages import CANNOT_WRITE, OTHER_FILE, StudyError, beside, with_ending
from softjaw.study.pictures import COLOURS, INK, SOFT
from softjaw.study.quantities import DONE, FAILED, MISSING, NO_GRASP
from softjaw.study.ranking import judge
from softjaw.study.show.grasps import Index, field, forces, label_of
from softjaw.study.show.object_surface import NOBODY
from softjaw.study.show.stored_surface import COMPONENTS, weaker
from softjaw.study.show.view.model import ARROW_MM, CROSSED, FORCE, NEUTRAL, OPEN, PAD, View, maps_of, view_of
from softjaw.study.show.view.pads import Pad

SIZE, SMALL = (1400, 900), 208
BODY, FINGER = "#b8c7d4", "#ed8c40"
LIGHT = {"ambient": 0.62, "diffuse": 0.42, "specular": 0.0}  # colours have to be those of the bar
BAR = {"vertical": True, "height": 0.36, "width": 0.045, "title_font_size": 15, "label_font_size": 13, "n_labels": 5,
       "color": INK, "fmt": "%.4g", "position_x": 0.07}  # fmt: skip


def save_picture(view: View, index: Index, path: Path, quantity: str, motion: str) -> None:
    """Write a case as PNG: the object on the left, its values and the limit surface on the right; needs no screen."""
    groups = [(slice(0, 2), slice(0, 2))]
    with (
        pv.vtk_verbosity("off"),  # VTK warns of every kind of screen that is not there
        closing(pv.Plotter(off_screen=True, window_size=SIZE, shape=(2, 3), groups=groups, border=False)) as plotter,
    ):
        plotter.set_background("white", all_renderers=True)
        plotter.subplot(0, 2)
        lines = [view.ds.attrs["title"], *view.summary(index, quantity), "", *view.legend(index, motion)]
        _say(plotter, "\n".join(fill(line, 60) for line in lines))
        plotter.subplot(1, 2)
        _limit(plotter, view, index)
        look(plotter, (0.8, -1.0, 0.55), (0, 0, 1), 0.95)
        plotter.subplot(0, 0)
        _object(plotter, view, index, quantity)
        _pads(plotter, view, index, motion)
        look(plotter, *view.eye(index), 0.9)
        plotter.add_axes(color=INK, viewport=(0.8, 0.0, 1.0, 0.25))
        plotter.screenshot(path)


def thumbnail(view: View, index: Index) -> bytes:
    """A small square PNG of an object between the pads of a case; empty where the object cannot be drawn."""
    body, pads, image = view.surface, view.pads(index), BytesIO()
    if not len(body.triangles) or not pads:
        return b""
    with pv.vtk_verbosity("off"), closing(pv.Plotter(off_screen=True, window_size=(SMALL, SMALL))) as plotter:
        plotter.set_background("white")
        surface(plotter, 1e3 * body.points, body.triangles, color=BODY)
        for pad in pads:
            faces(plotter, 1e3 * np.concatenate([pad.quads(), pad.sides()]), color=FINGER, lighting=True)
        look(plotter, *view.eye(index))
        plotter.screenshot(image)
    return image.getvalue()


def _object(plotter: Any, view: View, index: Index, quantity: str) -> None:
    """The object in the colours of the map at this force, deformed where the file has its wall."""
    over_all, limits = view.coloured(quantity)
    values, state = view.over_candidates(over_all, index[-1]), view.state(index[-1])
    bar = {**BAR, "position_y": 0.55, "title": fill(label_of(view.ds, quantity), 22)}
    colours = {"cmap": COLOURS.get(quantity, "viridis"), "clim": limits[index[-1]], "scalar_bar_args": bar}
    corners, cell = view.surface.triangles, view.surface.candidate
    of = np.where(cell == NOBODY, NOBODY, state[cell])
    known = (of == DONE) & np.isfinite(values[cell])
    none = np.isin(of, (NOBODY, *NO_GRASP)) | ((of == DONE) & ~known)
    x = 1e3 * view.moved(index)
    for colour, chosen in ((NEUTRAL, none), (CROSSED, of == FAILED), (OPEN, of == MISSING)):
        if chosen.any():
            surface(plotter, x, corners[chosen], color=colour)
    if known.any():
        surface(plotter, x, corners[known], values[cell[known]], **colours)


def _pads(plotter: Any, view: View, index: Index, motion: str) -> None:
    """Both pads: see-through sides, pressure on the loaded faces, and the friction of these."""
    pads = view.pads(index)
    top = max((1e-3 * pad.pressure.max(initial=0.0) for pad in pads), default=0.0)
    bar = {**BAR, "position_y": 0.1, "title": "contact pressure [kPa]"}
    for pad in pads:
        block(plotter, pad)
        if pad.loaded.any():
            pressures(plotter, pad, top, scalar_bar_args=bar)
            arrows(plotter, pad.arrows(motion, ARROW_MM))


def _say(plotter: Any, text: str) -> None:
    """Text in the characters that VTK's own font has."""
    plain = text.encode("latin-1", "replace").decode("latin-1")
    plotter.add_text(plain, position="upper_left", font_size=10, color=INK)


def _limit(plotter: Any, view: View, index: Index) -> None:
    """The weaker finger's limit surface, each axis over the largest that it carries."""
    points = view.limit(index)
    if points is None:
        return _say(plotter, "no limit surface stored for this case")
    reach = np.abs(points).max(axis=(0, 1))
    x, y, z = np.moveaxis(points / reach, -1, 0)
    plotter.add_mesh(pv.StructuredGrid(x, y, z), color="#9cc0e0", show_edges=True, edge_color="#54728c", line_width=0.5,
                     **LIGHT)  # fmt: skip
    axes = 1.45 * np.array([[-np.eye(3)[k], np.eye(3)[k]] for k in range(3)])
    lines(plotter, axes, INK)
    texts = [f"{name} {r:.3g} {unit}" for (name, unit), r in zip(COMPONENTS, reach, strict=True)]
    labels(plotter, axes[:, 1] * 1.05, texts, 15, shape=None)
    title = f"fitted limit surface of finger {weaker(view.ds, index) + 1} (CCM):\nloads carried without slipping"
    return _say(plotter, title)


# --- parts -----------------------------------------------------------------------------------------------------------


def look(plotter: Any, towards: Any, up: Any, zoom: float = 1.0) -> None:
    """See everything from a direction, without perspective."""
    plotter.view_vector(towards, viewup=up)
    plotter.enable_parallel_projection()
    plotter.reset_camera()
    plotter.camera.zoom(zoom)


def surface(plotter: Any, points: np.ndarray, triangles: np.ndarray, values: Any = None, **look: Any) -> None:
    """Triangles ``(m, 3)`` among points ``(n, 3)``: of one colour, or in those of ``values (m,)``; grey without one."""
    mesh = pv.PolyData.from_regular_faces(points, triangles)
    if values is not None:
        mesh.cell_data["value"] = values
        look = {"scalars": "value", "nan_color": NEUTRAL, **look}
    # points of two candidates' cells lie on each other: joined, or the light would show the cells' borders
    # degrees; normals are not averaged over sharper bends
    mesh = mesh.clean().compute_normals(split_vertices=True, feature_angle=40, cell_normals=False)
    plotter.add_mesh(mesh, **{**LIGHT, **look})


def faces(plotter: Any, corners: np.ndarray, values: Any = None, **look: Any) -> None:
    """Quadrilaterals ``(k, 4, 3)``, of one colour or in those of ``values (k,)``."""
    plotter.add_mesh(separate(corners), **{"lighting": False, "scalars": values, **look})


def separate(corners: np.ndarray) -> pv.PolyData:
    """A mesh of quadrilaterals ``(k, 4, 3)`` that share no points."""
    return pv.PolyData.from_regular_faces(corners.reshape(-1, 3), np.arange(4 * len(corners)).reshape(-1, 4))


def block(plotter: Any, pad: Pad) -> None:
    """A pad's sides, which one sees through, and its edges."""
    faces(plotter, 1e3 * pad.sides(), color=PAD, opacity=0.22)
    lines(plotter, 1e3 * pad.lines(), PAD)


def pressures(plotter: Any, pad: Pad, top: float, **look: Any) -> None:
    """The loaded faces of a pad in the colours of their pressure, up to ``top`` [kPa]."""
    look = {"cmap": COLOURS["pressure"], "clim": (0, top), "edge_color": SOFT, "line_width": 1, **look}
    faces(plotter, *pad.pressed(), **look)


def lines(plotter: Any, ends: np.ndarray, colour: str, width: float = 2.0) -> None:
    """Segments ``(k, 2, 3)``."""
    plotter.add_mesh(pv.line_segments_from_points(ends.reshape(-1, 3)), color=colour, line_width=width)


def arrows(plotter: Any, ends: np.ndarray, **look: Any) -> None:
    """Arrows along segments ``(k, 2, 3)``, such as those of `study.show.view.pads.Pad.arrows`."""
    cloud = pv.PolyData(ends[:, 0])
    cloud["vector"] = ends[:, 1] - ends[:, 0]
    if cloud["vector"].any():
        shape = pv.Arrow(tip_length=0.35, tip_radius=0.14, shaft_radius=0.06, tip_resolution=10, shaft_resolution=8)
        glyphs = cloud.glyph(orient="vector", scale="vector", geom=shape)
        plotter.add_mesh(glyphs, color=FORCE, lighting=False, **look)


def labels(plotter: Any, places: np.ndarray, texts: list[str], size: int = 34, **look: Any) -> None:
    """Names at places, on white ground."""
    ground = {"shape": "rounded_rect", "shape_color": "white", "shape_opacity": 0.75, "margin": 4}
    plotter.add_point_labels(places, texts, font_size=size, text_color=INK, show_points=False, always_visible=True,
                             **{**ground, **look})  # fmt: skip


# --- files for ParaView: SI units -------------------------------------------------------------------------------------


def write_vtk(ds: xr.Dataset, path: Path, force: float | None = None) -> Path:
    """Write a dataset as a block for the object and, with ``.vtm``, one of all pads for every force.

    The object has every map as cell data, once for each force (``quality, 5 N``), the pads pressure, area, normal,
    finger and candidate. Positions are in the frame of the object's own file [m]. Of a sweep the first point is
    written. An object with a thin wall has the displacement of the best case, at ``force`` [N] if it is given.

    Raises `StudyError`: the ending is another, the file cannot be written, or the object cannot be drawn.
    """
    with_ending("-o", path, ".vtm", ".vtp")
    view, index = view_of(judge(ds), None, (None, None), force)
    if not len(view.surface.triangles):
        raise StudyError(OTHER_FILE, f"{ds.attrs['file']}: {view.note or 'there is no object to write'}")
    body = _object_file(view, index)
    blocks = pv.MultiBlock({"object": body})
    if path.suffix.lower() == ".vtm" and ds.attrs["patches"]:
        for k, level in enumerate(forces(ds)):
            if (pads := _pads_file(view, k)) is not None:
                blocks[f"pads, {level:g} N"] = pads
    with beside(path) as part:  # VTK itself only prints that it cannot write
        part.touch()
    with pv.vtk_verbosity("off"):
        (blocks if path.suffix.lower() == ".vtm" else body).save(path)
    if not path.stat().st_size:
        raise StudyError(CANNOT_WRITE, f"{path}: cannot be written; choose another place")
    return path


def _object_file(view: View, index: Index) -> pv.PolyData:
    """The object's surface with its maps."""
    x, corners, cell, _ = view.surface
    body = pv.PolyData.from_regular_faces(x, corners)
    body.cell_data["candidate"] = cell
    maps = {name: field(view.ds, name) for name in maps_of(view.ds)}
    for k, force in enumerate(forces(view.ds)):
        state = view.state(k)
        values = {name: np.where(state == DONE, view.over_candidates(v, k), np.nan) for name, v in maps.items()}
        for name, array in {"status": state.astype(float), **values}.items():
            body.cell_data[f"{name}, {force:g} N"] = np.where(cell == NOBODY, np.nan, array[cell])
    if view.displacement(index) is not None:
        name = f"displacement, candidate {view.candidate(index)}, {forces(view.ds)[index[-1]]:g} N"
        body.point_data[name] = view.moved(index) - x
    return body


def _pads_file(view: View, force: int) -> pv.PolyData | None:
    """Both pads' contact faces of all candidates at a force level; None where none is stored."""
    cases = [(c, view.pads(view.index(c, force))) for c in range(view.candidates)]
    pads = [(c, finger, pad) for c, both in cases for finger, pad in enumerate(both, start=1) if pad.pressure.size]
    if not pads:
        return None
    faces = separate(np.concatenate([pad.quads() for *_, pad in pads]))
    sizes = [pad.pressure.size for *_, pad in pads]
    faces.cell_data["candidate"] = np.repeat([c for c, *_ in pads], sizes)
    faces.cell_data["finger"] = np.repeat([finger for _, finger, _ in pads], sizes)
    for name in ("pressure", "area", "normal"):
        faces.cell_data[name] = np.concatenate([getattr(p, name).reshape(p.pressure.size, -1) for *_, p in pads])
    return faces
