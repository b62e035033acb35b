"""A case as a picture without a screen, or as a window with a slider over the forces; through pyvista."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
import pyvista as pv

from softjaw.study.pictures import COLOURS, INK, span
from softjaw.study.result.layout import DONE, FAILED
from softjaw.study.result.vtkhdf import NOBODY
from softjaw.study.show.report.contact import COMPONENTS, body, weaker
from softjaw.study.show.stored_surface import stored_surface
from softjaw.study.show.tables.ranking import nearest
from softjaw.study.show.view import solids
from softjaw.study.show.view.model import CROSSED, NEUTRAL, OPEN, View
from softjaw.study.show.view.pads import pads

SIZE = (1400, 900)
MARK = 4.0  # radius of the balls where fingers of explicit poses touch [mm]
LONGEST = 6.0  # arrow [mm]
BAR = {"vertical": True, "height": 0.36, "width": 0.045, "title_font_size": 15, "label_font_size": 13, "n_labels": 5,
       "color": INK, "fmt": "%.4g", "position_x": 0.07}  # fmt: skip


def save_picture(view: View, index: tuple[int, ...], path: Path, quantity: str, motion: str) -> None:
    """Write the view of a case as PNG; needs no screen."""
    with pv.vtk_verbosity("off"):  # it warns of every kind of screen that is not there
        plotter = plot(view, index, quantity, motion, off_screen=True)
        try:
            plotter.screenshot(path)
        finally:
            plotter.close()


def plot(view: View, index: tuple[int, ...], quantity: str, motion: str, *, off_screen: bool) -> Any:
    """The view of a case: the object on the left, words and the limit surface on the right."""
    groups = [(slice(0, 2), slice(0, 2))]
    plotter = pv.Plotter(off_screen=off_screen, window_size=SIZE, shape=(2, 3), groups=groups, border=False)
    plotter.set_background("white", all_renderers=True)
    draw(plotter, view, index, quantity, motion)
    plotter.subplot(1, 2)
    _look(plotter, (0.8, -1.0, 0.55), (0, 0, 1), 0.95)
    plotter.subplot(0, 0)
    found = pads(view.data, view.gripper, index)
    out = -found[0].approach if found else np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0]) if abs(out[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    beside = np.cross(up, out)
    _look(plotter, 0.72 * out + 0.62 * beside / np.linalg.norm(beside) + 0.35 * up, up, 0.9)
    plotter.add_axes(xlabel="x", ylabel="y", zlabel="z", color=INK, viewport=(0.8, 0.0, 1.0, 0.25))
    return plotter


def _look(plotter: Any, towards: Any, up: Any, zoom: float) -> None:
    plotter.view_vector(towards, viewup=up)
    plotter.enable_parallel_projection()
    plotter.reset_camera()
    plotter.camera.zoom(zoom)


def draw(plotter: Any, view: View, index: tuple[int, ...], quantity: str, motion: str) -> None:
    """Draw a case in the place of the one before."""
    for row, column, part in ((0, 0, _object), (0, 0, _pads), (0, 2, _words), (1, 2, _limit)):
        plotter.subplot(row, column)
        part(plotter, view, index, quantity, motion)


def _object(plotter: Any, view: View, index: tuple[int, ...], quantity: str, _: str) -> None:
    """The object in the colours of the map, over the map at all forces, deformed where the file has its wall."""
    label, unit, factor = view.data.units(quantity)
    found = view.data.map(quantity)
    values = np.full(view.candidates, np.nan) if found is None else factor * view.over_candidates(found, index[-1])
    limits = span(np.full(1, np.nan) if found is None else factor * found[view.point])
    state = view.state(index[-1])
    colours = {"cmap": COLOURS.get(quantity, "cividis"), "clim": limits, "scalar_bar_args":
               {**BAR, "position_y": 0.55, "title": fill(f"{label} [{unit}]" if unit else label, 22)}}  # fmt: skip
    for name in ("object", "open", "failed", "none", "marks"):
        plotter.remove_actor(name, render=False)
    corners, cell = view.surface.triangles, view.surface.candidate
    of = np.where(cell == NOBODY, NOBODY, state[cell])
    shown = (of == DONE) & np.isfinite(values[cell]) & (cell != NOBODY)
    plain = {"none": (NEUTRAL, (of == NOBODY) | ((of == DONE) & ~shown)), "failed": (CROSSED, of == FAILED)}
    plain["open"] = (OPEN, (of != NOBODY) & (of != DONE) & (of != FAILED))
    x = 1e3 * view.moved(index)
    for name, (colour, chosen) in plain.items():
        if chosen.any():
            solids.surface(plotter, x, corners[chosen], None, cell[chosen], name=name, color=colour)
    if shown.any():
        solids.surface(plotter, x, corners[shown], values[cell[shown]], cell[shown], name="object", **colours)
    places, owner = view.marks
    if len(places):
        solids.dots(plotter, 1e3 * places, MARK, values[owner], name="marks", **colours)


def _pads(plotter: Any, view: View, index: tuple[int, ...], _: str, motion: str) -> None:
    """Both pads: see-through sides, pressure on the loaded faces, and the friction of these."""
    for name in [name for name in plotter.actors if name.startswith("pad ")]:
        plotter.remove_actor(name, render=False)
    found = pads(view.data, view.gripper, index)
    top = max((1e-3 * float(p.pressure.max()) for p in found if p.pressure is not None), default=0.0)
    most = max((float(np.linalg.norm(p.arrows(motion)[1], axis=1).max(initial=0)) for p in found), default=0.0)
    bar = {**BAR, "position_y": 0.1, "title": "contact pressure [kPa]"}
    for number, pad in enumerate(found):
        solids.block(plotter, pad, f"pad {number}")
        if top > 0 and pad.pressure is not None:
            solids.pressures(plotter, pad, top, name=f"pad {number} pressure", scalar_bar_args=bar, pickable=False)
            solids.friction(plotter, pad, motion, LONGEST, most, name=f"pad {number} arrows", pickable=False)


def _words(plotter: Any, view: View, index: tuple[int, ...], quantity: str, motion: str) -> None:
    slip = {"x": "slip along x of the contact", "y": "slip along y of the contact", "turn": "a turn about the normal"}
    marks = "balls: where the fingers first touch" if view.data.by_poses else "light grey: no candidate there"
    lines = [view.data.title, *view.words(index, quantity), "", f"blue: friction of the faces against {slip[motion]}",
             marks, *["dark grey: failed"] * bool((view.state(index[-1]) == FAILED).any()),
             *["the wall is deformed as computed"] * (view.displacement(index) is not None), view.note]  # fmt: skip
    _say(plotter, "\n".join(fill(line, 46) for line in lines), "words")


def _say(plotter: Any, words: str, name: str) -> None:
    """Text in the characters that VTK's own font has."""
    plain = words.replace("\u00a0", " ").replace("–", "-").encode("latin-1", "replace").decode("latin-1")
    plotter.remove_actor(name, render=False)
    plotter.add_text(plain, position="upper_left", font_size=10, color=INK, name=name)


def _limit(plotter: Any, view: View, index: tuple[int, ...], _: str, __: str) -> None:
    """The weaker finger's limit surface, each axis over the largest that it carries."""
    for name in ("limits", "limit lines", "limit labels"):
        plotter.remove_actor(name, render=False)
    finger = weaker(view.data, index)
    known = stored_surface(view.data, index, finger, "ccm")
    points = None if known is None or known.ellipsoid.rank < 3 else body(known)
    if points is None:
        return _say(plotter, "no limit surface stored for this case", "limit words")
    reach = np.abs(points).max(axis=(0, 1))
    x, y, z = np.moveaxis(points / reach, -1, 0)
    plotter.add_mesh(pv.StructuredGrid(x, y, z), color="#9cc0e0", show_edges=True, edge_color="#54728c", line_width=0.5,
                     name="limits", **solids.LIGHT)  # fmt: skip
    axes = 1.45 * np.array([[-np.eye(3)[k], np.eye(3)[k]] for k in range(3)])
    solids.lines(plotter, axes, INK, name="limit lines")
    texts = [f"{name} {r:.3g} {unit}" for (name, unit, _), r in zip(COMPONENTS, reach, strict=True)]
    solids.labels(plotter, axes[:, 1] * 1.05, texts, 15, name="limit labels", shape=None)
    said = f"limit surface of finger {finger + 1} (CCM):\nwhat it carries without slipping"
    return _say(plotter, said, "limit words")


def show_window(view: View, index: tuple[int, ...], quantity: str, motion: str) -> None:
    """Open a window: the slider steps the forces, a click picks the candidate under the pointer."""
    plotter = plot(view, index, quantity, motion, off_screen=False)
    add_controls(plotter, view, index, quantity, motion)
    plotter.show(title=f"softjaw: {view.data.title}")


def add_controls(plotter: Any, view: View, index: tuple[int, ...], quantity: str, motion: str) -> dict[str, Any]:
    """Slider and picking; returns their functions and the case shown, ``at``."""
    state: dict[str, Any] = {"at": index}

    def redraw(at: tuple[int, ...]) -> None:
        if at != state["at"]:
            state["at"] = at
            draw(plotter, view, at, quantity, motion)
            plotter.subplot(0, 0)

    def force(value: float) -> None:
        redraw((*state["at"][:-1], nearest(view.data.forces, value)))

    def pick(_: Any, picker: Any) -> None:
        found = pv.wrap(picker.GetDataSet())
        if found is not None and "candidate" in found.cell_data:
            candidate = int(found.cell_data["candidate"][picker.GetCellId()])
            if candidate != NOBODY:
                redraw(view.index(candidate, state["at"][-1]))

    plotter.subplot(0, 0)
    if len(view.data.forces) > 1:
        low, high = view.data.forces[[0, -1]]
        plotter.add_slider_widget(force, (low, high), value=view.data.forces[index[-1]], title="normal force [N]",
                                  pointa=(0.32, 0.08), pointb=(0.68, 0.08), color=INK)  # fmt: skip
    click = {"left_clicking": True, "show_message": False, "show_point": False}
    plotter.enable_point_picking(pick, picker="cell", use_picker=True, **click)
    return {"state": state, "force": force, "pick": pick}
