"""A case as a picture without a screen, or as a window with a slider over the forces; through pyvista."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyvista as pv

from softjaw.study.show.tables.ranking import nearest
from softjaw.study.show.view.colours import CROSS
from softjaw.study.show.view.drawing import SIZE, draw_limits, draw_object, draw_pads, draw_words, look_at
from softjaw.study.show.view.model import View
from softjaw.study.show.view.surface import NOBODY


def save_picture(view: View, index: tuple[int, ...], path: Path, quantity: str, motion: str) -> None:
    """Write the view of a case as PNG; needs no screen."""
    with pv.vtk_verbosity("off"):  # it tells of every kind of screen that is not there
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
    plotter.subplot(0, 0)
    draw_object(plotter, view, index, quantity)
    draw_pads(plotter, view, index, motion)
    look_at(plotter, view, index)
    plotter.subplot(0, 2)
    draw_words(plotter, view, index, quantity, motion)
    plotter.subplot(1, 2)
    draw_limits(plotter, view.data, index)
    return plotter


def show_window(view: View, index: tuple[int, ...], quantity: str, motion: str) -> None:
    """Open a window: the slider steps the forces, a click picks the candidate under the pointer."""
    plotter = plot(view, index, quantity, motion, off_screen=False)
    add_controls(plotter, view, index, quantity, motion)
    plotter.show(title=f"softjaw: {view.data.title}")


def add_controls(plotter: Any, view: View, index: tuple[int, ...], quantity: str, motion: str) -> dict[str, Any]:
    """Slider and picking; returns their functions and the case shown, ``at``."""
    state: dict[str, Any] = {"at": index}

    def redraw(at: tuple[int, ...]) -> None:
        if at == state["at"]:
            return
        state["at"] = at
        plotter.subplot(0, 0)
        draw_object(plotter, view, at, quantity)
        draw_pads(plotter, view, at, motion)
        plotter.subplot(0, 2)
        draw_words(plotter, view, at, quantity, motion)
        plotter.subplot(1, 2)
        draw_limits(plotter, view.data, at)
        plotter.subplot(0, 0)

    def force(value: float) -> None:
        redraw((*state["at"][:-1], nearest(view.data.forces, value)))

    def pick(_: Any, picker: Any) -> None:
        found = pv.wrap(picker.GetDataSet())
        if found is None or "candidate" not in found.cell_data:
            return
        candidate = int(found.cell_data["candidate"][picker.GetCellId()])
        if candidate != NOBODY:
            redraw(view.index(candidate, state["at"][-1]))

    plotter.subplot(0, 0)
    if len(view.data.forces) > 1:
        low, high = view.data.forces[[0, -1]]
        plotter.add_slider_widget(force, (low, high), value=view.data.forces[index[-1]], title="normal force [N]",
                                  pointa=(0.32, 0.08), pointb=(0.68, 0.08), color=CROSS)  # fmt: skip
    click = {"left_clicking": True, "show_message": False, "show_point": False}
    plotter.enable_point_picking(pick, picker="cell", use_picker=True, **click)
    return {"state": state, "force": force, "pick": pick}
