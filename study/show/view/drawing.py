"""The parts of a picture, drawn with pyvista: object, pads, words and limit surface. Lengths are drawn in mm."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pyvista as pv

from softjaw.study.result.layout import DONE, FAILED
from softjaw.study.show.data import Data
from softjaw.study.show.pictures import span
from softjaw.study.show.view import limits
from softjaw.study.show.view.colours import CROSS, CROSSED, FORCE, NEUTRAL, OPEN, PAD, table
from softjaw.study.show.view.model import View
from softjaw.study.show.view.pads import LIFT, Pad, pads
from softjaw.study.show.view.surface import NOBODY, crosses

SIZE = (1400, 900)
LIGHT = {"ambient": 0.62, "diffuse": 0.42, "specular": 0.0}  # colours have to be those of the bar
BAR = {"vertical": True, "height": 0.36, "width": 0.045, "title_font_size": 15, "label_font_size": 13, "n_labels": 5,
       "color": CROSS, "fmt": "%.4g"}  # fmt: skip


def draw_object(
    plotter: Any, view: View, index: tuple[int, ...], quantity: str, limits_: tuple[float, float] | None = None
) -> None:
    """The object in the colours of the map, deformed where the file has its wall; failed cells are crossed out.

    The colours span ``limits_``, or else the map at all forces, so that pictures of two forces can be compared.
    """
    corners, cell = view.surface
    bar = {**BAR, "position_x": 0.07, "position_y": 0.55}
    for name in ("object", "open", "failed", "none", "crosses"):
        plotter.remove_actor(name, render=False)
    if not len(corners):
        return
    label, unit, factor = view.data.units(quantity)
    found = view.data.map(quantity)
    values = np.full(view.candidates, np.nan) if found is None else factor * view.over_candidates(found, index[-1])
    limits_ = limits_ or span(np.full(1, np.nan) if found is None else factor * found[view.point])
    x, state = 1e3 * view.moved(index), view.state(index[-1])
    of = np.where(cell == NOBODY, NOBODY, state[cell])
    shown = (of == DONE) & np.isfinite(values[cell])
    groups = {"none": (of == NOBODY) | ((of == DONE) & ~shown), "open": (of != NOBODY) & (of != DONE) & (of != FAILED)}
    for (name, chosen), colour in zip(
        {**groups, "failed": of == FAILED}.items(), (NEUTRAL, OPEN, CROSSED), strict=True
    ):
        if chosen.any():
            mesh = _surface(x[chosen], corners[chosen], cell[chosen])
            plotter.add_mesh(mesh, color=colour, name=name, **LIGHT).prop.interpolation = "Phong"
    if shown.any():
        mesh = _surface(x[shown], corners[shown], cell[shown])
        mesh.cell_data["value"] = values[cell[shown]]
        title = f"{label} [{unit}]" if unit else label
        look = {"cmap": table(quantity), "clim": limits_, "scalar_bar_args": {**bar, "title": _wrapped(title, 22)}}
        plotter.add_mesh(mesh, scalars="value", name="object", **look, **LIGHT).prop.interpolation = "Phong"
    if (of == FAILED).any() and not view.data.by_poses:
        lines = crosses(corners, cell, np.flatnonzero(state == FAILED), view.data.axes[-2].values)
        plotter.add_mesh(_lines(1e3 * lines), color=CROSS, line_width=3, name="crosses")


def draw_pads(plotter: Any, view: View, index: tuple[int, ...], motion: str) -> None:
    """Both pads: see-through sides, pressure on the loaded faces, and the direction of friction on them."""
    for name in [name for name in plotter.actors if name.startswith("pad ")]:
        plotter.remove_actor(name, render=False)
    found = pads(view.data, view.gripper, index)
    top = max((float(p.pressure.max()) for p in found if p.pressure is not None), default=0.0)
    force = max((float(np.linalg.norm(p.arrows(motion)[1], axis=1).max(initial=0)) for p in found), default=0.0)
    bar = {**BAR, "position_x": 0.07, "position_y": 0.1}
    for number, pad in enumerate(found):
        draw = partial(plotter.add_mesh, reset_camera=False, pickable=False)
        off = -pad.lift * pad.approach
        draw(_quads(1e3 * pad.sides()), color=PAD, opacity=0.22, name=f"pad {number} sides")
        draw(_lines(1e3 * pad.lines()), color=PAD, line_width=2, name=f"pad {number} lines")
        if pad.pressure is None or top <= 0:
            continue
        loaded = pad.loaded.ravel()
        mesh = _quads(1e3 * (pad.quads()[loaded] + off))
        mesh.cell_data["pressure"] = 1e-3 * pad.pressure.ravel()[loaded]
        draw(mesh, scalars="pressure", cmap=table("pressure"), clim=(0, 1e-3 * top), name=f"pad {number} pressure",
             lighting=False, scalar_bar_args={**bar, "title": "contact pressure [kPa]"})  # fmt: skip
        places, forces = pad.arrows(motion)
        if force > 0 and len(places):
            length = 6e-3 * np.linalg.norm(forces, axis=1) / force
            heads = darts(places + off - 3 * LIFT * pad.approach, forces, length)
            draw(_surface(1e3 * heads), color=FORCE, name=f"pad {number} arrows", lighting=False)


def look_at(plotter: Any, view: View, index: tuple[int, ...]) -> None:
    """A camera that sees finger 1 obliquely from behind, and the object upright."""
    found = pads(view.data, view.gripper, index)
    out = -found[0].approach if found else np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0]) if abs(out[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    beside = np.cross(up, out)
    plotter.view_vector(0.72 * out + 0.62 * beside / np.linalg.norm(beside) + 0.35 * up, viewup=up)
    plotter.enable_parallel_projection()
    plotter.reset_camera()
    _fit(plotter.camera, view, found)
    plotter.add_axes(xlabel="x", ylabel="y", zlabel="z", color=CROSS, viewport=(0.8, 0.0, 1.0, 0.25))


def _fit(camera: Any, view: View, found: list[Pad]) -> None:
    """Scale and shift so that everything stands beside the colour bars."""
    seen = [
        view.surface[0][..., :3].reshape(-1, 3),
        *(p for pad in found for p in (pad.front.reshape(-1, 3), pad.back)),
    ]
    x = 1e3 * np.concatenate(seen)
    if not len(x):
        return
    towards = np.subtract(camera.position, camera.focal_point)
    right = np.cross(camera.up, towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right) / np.linalg.norm(towards)
    low, high = (np.array([f(x @ e) for e in (right, up)]) for f in (np.min, np.max))
    middle = 0.5 * (low + high) - [np.dot(camera.focal_point, e) for e in (right, up)]
    shift = middle[0] * right + middle[1] * up
    camera.focal_point, camera.position = shift + camera.focal_point, shift + camera.position
    wide, tall = 0.5 * (high - low)
    free = 0.74  # of the width, right of the bars
    camera.parallel_scale = 1.04 * max(tall, wide / (free * SIZE[0] * 2 / 3 / SIZE[1]))
    camera.SetWindowCenter(free - 1, 0.0)


def draw_words(plotter: Any, view: View, index: tuple[int, ...], quantity: str, motion: str) -> None:
    """What is to be said of the case, and how to read the picture."""
    said = {"x": "slip along x of the contact", "y": "slip along y of the contact", "turn": "a turn about the normal"}
    legend = [f"blue darts: friction of the faces against {said[motion]}", _marks(view)]
    state = view.state(index[-1])
    legend += ["crossed out: failed"] * bool((state == FAILED).any()) + ["darker grey: not solved"] * bool(
        (state == 0).any()
    )
    dent = [] if view.displacement(index) is None else ["the wall is deformed as computed, not exaggerated"]
    lines = [view.data.title, *view.words(index, quantity), "", *legend, *dent, *([view.note] if view.note else [])]
    text = "\n".join(_wrapped(line, 46) for line in lines)
    plotter.remove_actor("words", render=False)
    plotter.add_text(_plain(text), position="upper_left", font_size=10, color=CROSS, name="words")


def _marks(view: View) -> str:
    return "balls: where the fingers first touch" if view.data.by_poses else "light grey: no candidate there"


def draw_limits(plotter: Any, data: Data, index: tuple[int, ...]) -> None:
    """The limit surface in a box whose sides are its reach along each axis."""
    for name in ("limits", "limit lines", "limit words", "limit labels"):
        plotter.remove_actor(name, render=False)
    body = limits.limit_body(data, index)
    if body is None:
        plotter.add_text("no limit surface stored for this case", position="upper_left", font_size=10, color=CROSS,
                         name="limit words")  # fmt: skip
        return
    points = body.points.reshape(-1, 3)
    reach = np.abs(points).max(axis=0)
    mesh = pv.PolyData.from_regular_faces(points / reach, limits.quads())
    plotter.add_mesh(
        mesh, color="#9cc0e0", show_edges=True, edge_color="#54728c", line_width=0.5, name="limits", **LIGHT
    )
    axes = 1.45 * np.array([[-np.eye(3)[k], np.eye(3)[k]] for k in range(3)])
    plotter.add_mesh(_lines(axes), color=CROSS, line_width=2, name="limit lines")
    names = [f"{n} {r:.3g} {u}" for n, u, r in zip(("f_x", "f_y", "tau_z"), ("N", "N", "N mm"), reach, strict=True)]
    plotter.add_point_labels(axes[:, 1] * 1.05, names, font_size=15, text_color=CROSS, shape=None, show_points=False,
                             always_visible=True, name="limit labels")  # fmt: skip
    text = (
        f"limit surface of finger {body.finger + 1}, curved model:\nwhat it carries without slipping\n({body.fitted})"
    )
    plotter.add_text(text, position="upper_left", font_size=10, color=CROSS, name="limit words")
    plotter.view_vector((0.8, -1.0, 0.55), viewup=(0, 0, 1))
    plotter.enable_parallel_projection()
    plotter.reset_camera()
    plotter.camera.zoom(0.95)


def darts(places: np.ndarray, forces: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Slim four-sided darts ``(4 k, 3, 3)`` that begin at ``places`` and point along ``forces``."""
    e = forces / np.maximum(np.linalg.norm(forces, axis=1, keepdims=True), 1e-300)
    side = np.cross(e, np.where(np.abs(e[:, :1]) < 0.6, [1.0, 0, 0], [0, 1.0, 0]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    around = [side, np.cross(e, side), -side, -np.cross(e, side)]
    base = [places + 0.13 * length[:, None] * a for a in around]
    tip = places + length[:, None] * e
    return np.concatenate([np.stack([base[k], base[(k + 1) % 4], tip], axis=1) for k in range(4)])


def _surface(x: np.ndarray, corners: np.ndarray | None = None, cell: np.ndarray | None = None) -> Any:
    """Loose triangles ``(m, 3, 3)`` with the normals of ``corners`` and the candidate of each."""
    mesh = pv.PolyData.from_regular_faces(x.reshape(-1, 3), np.arange(3 * len(x)).reshape(-1, 3))
    if corners is not None:
        mesh.point_data.active_normals = corners[..., 3:].reshape(-1, 3)
    if cell is not None:
        mesh.cell_data["candidate"] = cell
    return mesh


def _quads(x: np.ndarray) -> Any:
    return pv.PolyData.from_regular_faces(x.reshape(-1, 3), np.arange(4 * len(x)).reshape(-1, 4))


def _lines(x: np.ndarray) -> Any:
    return pv.line_segments_from_points(x.reshape(-1, 3))


def _wrapped(text: str, width: int) -> str:
    from textwrap import fill

    return fill(text, width, subsequent_indent="") if text else ""


def _plain(text: str) -> str:
    """Text in the letters that VTK's own font has."""
    return text.replace("\u00a0", " ").replace("–", "-").encode("latin-1", "replace").decode("latin-1")
