"""A case as a picture without a screen, or as a window with a slider over the forces; through pyvista."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
import pyvista as pv

from softjaw.study.pictures import COLOURS, INK
from softjaw.study.quantities import DONE, FAILED, MISSING, NO_GRASP
from softjaw.study.ranking import nearest
from softjaw.study.show.grasps import Index, forces, label_of
from softjaw.study.show.object_surface import NOBODY
from softjaw.study.show.stored_surface import COMPONENTS, weaker
from softjaw.study.show.view import solids
from softjaw.study.show.view.model import ARROW_MM, CROSSED, NEUTRAL, OPEN, View

SIZE = (1400, 900)
BAR = {"vertical": True, "height": 0.36, "width": 0.045, "title_font_size": 15, "label_font_size": 13, "n_labels": 5,
       "color": INK, "fmt": "%.4g", "position_x": 0.07}  # fmt: skip


def save_picture(view: View, index: Index, path: Path, quantity: str, motion: str) -> None:
    """Write the view of a case as PNG; needs no screen."""
    with pv.vtk_verbosity("off"):  # it warns of every kind of screen that is not there
        plotter = plot(view, index, quantity, motion, off_screen=True)
        try:
            plotter.screenshot(path)
        finally:
            plotter.close()


def plot(view: View, index: Index, quantity: str, motion: str, *, off_screen: bool) -> Any:
    """The view of a case: the object on the left, its values and the limit surface on the right."""
    groups = [(slice(0, 2), slice(0, 2))]
    plotter = pv.Plotter(off_screen=off_screen, window_size=SIZE, shape=(2, 3), groups=groups, border=False)
    plotter.set_background("white", all_renderers=True)
    draw(plotter, view, index, quantity, motion)
    plotter.subplot(1, 2)
    solids.look(plotter, (0.8, -1.0, 0.55), (0, 0, 1), 0.95)
    plotter.subplot(0, 0)
    solids.look(plotter, *view.eye(index), 0.9)
    # the object is drawn with its axis upright; its file's own axes are named
    named = ["xyz"[abs(column).argmax()] for column in view.placed.rotation.T]
    labels = dict(zip(("xlabel", "ylabel", "zlabel"), named, strict=True))
    plotter.add_axes(**labels, color=INK, viewport=(0.8, 0.0, 1.0, 0.25))
    return plotter


def draw(plotter: Any, view: View, index: Index, quantity: str, motion: str) -> None:
    """Draw a case in the place of the one before."""
    plotter.subplot(0, 0)
    _object(plotter, view, index, quantity)
    _pads(plotter, view, index, motion)
    plotter.subplot(0, 2)
    lines = [view.ds.attrs["title"], *view.summary(index, quantity), "", *view.legend(index, motion)]
    _say(plotter, "\n".join(fill(line, 46) for line in lines), "values")
    plotter.subplot(1, 2)
    _limit(plotter, view, index)


def _object(plotter: Any, view: View, index: Index, quantity: str) -> None:
    """The object in the colours of the map at this force, deformed where the file has its wall."""
    found, limits = view.coloured(quantity)
    values, state = view.over_candidates(found, index[-1]), view.state(index[-1])
    bar = {**BAR, "position_y": 0.55, "title": fill(label_of(view.ds, quantity), 22)}
    colours = {"cmap": COLOURS.get(quantity, "viridis"), "clim": limits[index[-1]], "scalar_bar_args": bar}
    for name in ("object", "open", "failed", "none", "marks"):
        plotter.remove_actor(name, render=False)
    corners, cell = view.surface.triangles, view.surface.candidate
    of = np.where(cell == NOBODY, NOBODY, state[cell])
    shown = (of == DONE) & np.isfinite(values[cell])
    none = np.isin(of, (NOBODY, *NO_GRASP)) | ((of == DONE) & ~shown)
    plain = {"none": (NEUTRAL, none), "failed": (CROSSED, of == FAILED), "open": (OPEN, of == MISSING)}
    x = 1e3 * view.moved(index)
    for name, (colour, chosen) in plain.items():
        if chosen.any():
            solids.surface(plotter, x, corners[chosen], None, cell[chosen], name=name, color=colour)
    if shown.any():
        solids.surface(plotter, x, corners[shown], values[cell[shown]], cell[shown], name="object", **colours)
    places, owner = view.marks
    if len(places):
        # radius of the balls where fingers of explicit poses touch [mm]
        solids.dots(plotter, 1e3 * places, 4.0, values[owner], name="marks", **colours)


def _pads(plotter: Any, view: View, index: Index, motion: str) -> None:
    """Both pads: see-through sides, pressure on the loaded faces, and the friction of these."""
    for name in [name for name in plotter.actors if name.startswith("pad ")]:
        plotter.remove_actor(name, render=False)
    found = view.pads(index)
    top = max((1e-3 * pad.pressure.max(initial=0.0) for pad in found), default=0.0)
    bar = {**BAR, "position_y": 0.1, "title": "contact pressure [kPa]"}
    for number, pad in enumerate(found):
        solids.block(plotter, pad, f"pad {number}")
        if pad.loaded.any():
            solids.pressures(plotter, pad, top, name=f"pad {number} pressure", scalar_bar_args=bar, pickable=False)
            solids.arrows(plotter, pad.arrows(motion, ARROW_MM), name=f"pad {number} arrows", pickable=False)


def _say(plotter: Any, text: str, name: str) -> None:
    """Text in the characters that VTK's own font has."""
    plain = text.replace("\u00a0", " ").replace("–", "-").encode("latin-1", "replace").decode("latin-1")
    plotter.remove_actor(name, render=False)
    plotter.add_text(plain, position="upper_left", font_size=10, color=INK, name=name)


def _limit(plotter: Any, view: View, index: Index) -> None:
    """The weaker finger's limit surface, each axis over the largest that it carries."""
    for name in ("limits", "limit lines", "limit labels"):
        plotter.remove_actor(name, render=False)
    points = view.limit(index)
    if points is None:
        return _say(plotter, "no limit surface stored for this case", "limit title")
    reach = np.abs(points).max(axis=(0, 1))
    x, y, z = np.moveaxis(points / reach, -1, 0)
    plotter.add_mesh(pv.StructuredGrid(x, y, z), color="#9cc0e0", show_edges=True, edge_color="#54728c", line_width=0.5,
                     name="limits", **solids.LIGHT)  # fmt: skip
    axes = 1.45 * np.array([[-np.eye(3)[k], np.eye(3)[k]] for k in range(3)])
    solids.lines(plotter, axes, INK, name="limit lines")
    texts = [f"{name} {r:.3g} {unit}" for (name, unit), r in zip(COMPONENTS, reach, strict=True)]
    solids.labels(plotter, axes[:, 1] * 1.05, texts, 15, name="limit labels", shape=None)
    title = f"limit surface of finger {weaker(view.ds, index) + 1} (CCM):\nloads that it carries without slipping"
    return _say(plotter, title, "limit title")


def show_window(view: View, index: Index, quantity: str, motion: str) -> None:
    """Open a window: the slider steps the forces, a click picks the candidate under the pointer."""
    plotter = plot(view, index, quantity, motion, off_screen=False)
    add_controls(plotter, view, index, quantity, motion)
    plotter.show(title=f"softjaw: {view.ds.attrs['title']}")


def add_controls(plotter: Any, view: View, index: Index, quantity: str, motion: str) -> dict[str, Any]:
    """Slider and picking; returns their functions and the case shown, ``at``."""
    state: dict[str, Any] = {"at": index}

    def redraw(at: Index) -> None:
        if at != state["at"]:
            state["at"] = at
            draw(plotter, view, at, quantity, motion)
            plotter.subplot(0, 0)

    def force(value: float) -> None:
        redraw((*state["at"][:-1], nearest(forces(view.ds), value)))

    def pick(_: Any, picker: Any) -> None:
        found = pv.wrap(picker.GetDataSet())
        if found is not None and "candidate" in found.cell_data:
            candidate = int(found.cell_data["candidate"][picker.GetCellId()])
            if candidate != NOBODY:
                redraw(view.index(candidate, state["at"][-1]))

    plotter.subplot(0, 0)
    if len(forces(view.ds)) > 1:
        low, high = forces(view.ds)[[0, -1]]
        plotter.add_slider_widget(force, (low, high), value=forces(view.ds)[index[-1]], title="normal force [N]",
                                  pointa=(0.32, 0.08), pointb=(0.68, 0.08), color=INK)  # fmt: skip
    click = {"left_clicking": True, "show_message": False, "show_point": False}
    plotter.enable_point_picking(pick, picker="cell", use_picker=True, **click)
    return {"state": state, "force": force, "pick": pick}
