"""The object with a map on it, the pads of a case and its limit surface: one plotly figure that a page's script steers.

The figure has a trace for each part, without geometry; what the parts hold at every force, candidate and quantity
stands in ``layout.meta.object3d`` and `page.js` fills it in. Lengths are in mm, pressures in kPa.
Arrays are packed as base64.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from softjaw.study.page import Block, Section, label, page, plot, text
from softjaw.study.quantities import ALONG, AROUND
from softjaw.study.result.layout import DONE
from softjaw.study.show import plots
from softjaw.study.show.report.contact import COMPONENTS, body, weaker
from softjaw.study.show.report.tables import note
from softjaw.study.show.stored_surface import stored_surface
from softjaw.study.show.view.model import CROSSED, FORCE, NEUTRAL, OPEN, PAD, View
from softjaw.study.show.view.pads import LIFT, Pad, pads

MOST = 24_000_000  # bytes of pads, walls and limit surfaces; beyond it, those of the worst grasps are left out
SHOWN = ("quality", "quality_fitted", "e_n", "epsilon", "f_x_max", "f_y_max", "tau_z_max", "safety_factor", "F_N", "S",
         "contact_area", "p_max", "closing", "curvature_loss", "indentation", "wall_stress")  # fmt: skip
LONGEST = 6e-3  # arrow [m]
SAID = {"x": "a slip along x of the contact", "y": "a slip along y of the contact", "turn": "a turn about its normal"}


def object_block(
    view: View,
    index: tuple[int, ...],
    quantity: str,
    motion: str,
    cases: Sequence[tuple[int, ...]],
    whole: bool = False,
) -> Block | None:
    """The figure as a part of a page, with the geometry of some cases; None where there is nothing to draw.

    ``whole`` adds the limit surface of the weaker finger.
    """
    if not len(view.surface.points) and not len(view.marks[0]):
        return None
    content, left_out = payload(view, index, quantity, cases, motion, whole)
    made = go.Figure([*_traces(whole)])
    made.update_layout(template="none", margin={"l": 0, "r": 0, "t": 10, "b": 0}, uirevision="keep", showlegend=False)
    made.update_layout(meta={"object3d": content}, scene=plots.scene(**_looking(view, index)))
    if whole:
        names = [f"{name} [{unit}]" for name, unit, _ in COMPONENTS]
        made.update_layout(scene={"domain": {"x": [0, 0.66]}})
        made.update_layout(scene2=plots.scene("", names, aspectmode="cube", domain={"x": [0.7, 1], "y": [0.2, 0.8]}))
    marks = "Balls: where the fingers first touch." if view.data.by_poses else "Light grey: no candidate there."
    wall = " The wall is deformed as computed, not exaggerated." if view.displacement(index) is not None else ""
    gone = f" Pads of the {left_out} worst cases are left out, or the page would be too large." if left_out else ""
    caption = (
        f"Choose quantity and normal force above, click a place for its grasp, drag to turn. {marks} Dark grey: failed;"
        f" grey: not computed. Blue: the friction that the faces of the pads carry against"
        f" {SAID[motion]}.{wall}{gone}"
    )
    alt = f"{view.data.title} in three dimensions in the colours of {quantity}, with both pads."
    return plot(made, caption, alt, 560)


def view_page(view: View, index: tuple[int, ...], quantity: str, motion: str) -> str:
    """The page of a view, which opens at a case and a map, with all cases."""
    forces = sorted(range(len(view.data.forces)), key=lambda k: abs(k - index[-1]))
    cases = [index, *(i for k in forces for i in view.data.order(k) if i[:-3] == view.point)]
    block = object_block(view, index, quantity, motion, list(dict.fromkeys(cases)), whole=True)
    sections: list[Section] = [("object", "", [block or text(view.note[:1].upper() + view.note[1:] + ".", "warn")])]
    return page(view.data.title, view.words(index, quantity)[0], sections)


def payload(
    view: View, index: tuple[int, ...], quantity: str, cases: Sequence[tuple[int, ...]], motion: str, whole: bool
) -> tuple[dict[str, Any], int]:
    """Everything that the figure shows, as plain data, and how many solved cases had to be left out."""
    data, kept, left_out, size = view.data, {}, 0, 0
    for i in cases:
        if data.status[i] == DONE and size > MOST:
            left_out += 1
        elif data.status[i] == DONE:
            kept[f"{i[-1]} {view.candidate(i)}"] = one = case(view, i, motion, whole)
            size += sum(len(part) for part in one.values() if isinstance(part, str))
    forces = range(len(data.forces))
    every = [view.index(c, k) for k in forces for c in range(view.candidates)]
    surface, wall = view.surface, view.wall
    place, of = view.marks
    content = {
        "start": {"force": index[-1], "candidate": view.candidate(index), "quantity": quantity},
        "forces": data.forces.tolist(),
        "names": [label(data.place(view.index(c, 0))) for c in range(view.candidates)],
        "states": [view.state(k).tolist() for k in forces],
        "words": {f"{i[-1]} {view.candidate(i)}": view.words(i, quantity) for i in every},
        "notes": {f"{i[-1]} {view.candidate(i)}": label(said) for i in every if (said := note(data, i))},
        "quantities": _quantities(view, quantity),
        "points": _packed(1e3 * surface.points, "<f4"),
        "triangles": _packed(surface.triangles, "<i4"),
        "owner": _packed(view.owner, "<i4"),
        "marks": {"points": (1e3 * place).round(4).tolist(), "owner": of.tolist()},
        "grid": [AROUND, ALONG],
        "around": "" if wall is None else _packed(np.nan_to_num(wall.around, nan=-1e9), "<f4"),
        "along": "" if wall is None else _packed(np.nan_to_num(wall.along), "<f4"),
        "colours": [NEUTRAL, OPEN, CROSSED],
        "cases": kept,
    }
    return content, left_out


def case(view: View, index: tuple[int, ...], motion: str, whole: bool) -> dict[str, Any]:
    """Pads with pressure and friction, deformed wall and limit surface of one case, packed."""
    both = pads(view.data, view.gripper, index)
    found: dict[str, Any] = {"pads": len(both), "lines": _packed(1e3 * _join([pad.lines() for pad in both], 2), "<f4")}
    quads, pressure, arrows = [], [], []
    for pad in both:
        off = -pad.lift * pad.approach
        if pad.pressure is not None:
            quads.append((pad.quads() + off)[pad.loaded.ravel()])
            pressure.append(1e-3 * pad.pressure.ravel()[pad.loaded.ravel()])
        arrows.append(_arrows(pad, motion) + off)
    corners = 1e3 * _join(quads, 4)
    found["step"] = float(np.abs(corners).max(initial=1e-3)) / 32767
    found["faces"] = _packed(np.round(corners / found["step"]), "<i2")
    found["pressure"] = _packed(np.concatenate(pressure or [np.empty(0)]), "<f4")
    found["arrows"] = _packed(1e3 * _join(arrows, 2), "<f4")
    if (moved := view.displacement(index)) is not None:
        found |= {"wall": _packed(1e3 * moved[0], "<f4"), "angle": moved[1]}
    if whole:
        known = stored_surface(view.data, index, weaker(view.data, index), "ccm")
        points = None if known is None or known.ellipsoid.rank < 3 else body(known)
        if points is not None:
            found |= {"limit": _packed(points, "<f4"), "rows": points.shape[0]}
    return found


def _arrows(pad: Pad, motion: str) -> np.ndarray:
    """Friction of loaded faces as segments ``(k, 2, 3)`` [m], the largest `LONGEST` long."""
    places, forces = pad.arrows(motion)
    size = max(float(np.linalg.norm(forces, axis=1).max(initial=0)), 1e-300)
    start = places - 3 * LIFT * pad.approach
    return np.stack([start, start + LONGEST * forces / size], axis=1)


def _join(parts: list[np.ndarray], corners: int) -> np.ndarray:
    return np.concatenate([np.empty((0, corners, 3)), *parts])


def _packed(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()


def _quantities(view: View, first: str) -> list[dict[str, Any]]:
    """Maps that can be chosen, ``first`` among them."""
    data, found = view.data, []
    for name in dict.fromkeys((*SHOWN, first)):
        values = data.map(name)
        if values is None:
            continue
        words, unit, factor = data.units(name)
        low, high = plots.span(factor * values[view.point])
        rows = [[float(f"{v:.6g}") if np.isfinite(v) else None for v in factor * view.over_candidates(values, k)]
                for k in range(len(data.forces))]  # fmt: skip
        title = f"{words} [{unit}]" if unit else words
        found.append({"name": name, "title": title, "label": label(title), "low": low, "high": high, "values": rows,
                      "scale": plots.colours(name)})  # fmt: skip
    return found


def _traces(whole: bool) -> list[Any]:
    """Empty traces in the script's order: object, rest, marks, pressure, lines, arrows, tips, limit surface."""
    soft = {"lighting": {"ambient": 0.65, "diffuse": 0.5, "specular": 0.02, "roughness": 0.9}, "flatshading": False}
    flat = {"lighting": {"ambient": 1, "diffuse": 0, "specular": 0}, "flatshading": True}
    bar = {"thickness": 14, "len": 0.5, "y": 0.76, "x": 0.0, "title": {"side": "right"}}
    low = {**bar, "y": 0.24, "title": {"text": "contact pressure [kPa]", "side": "right"}}
    made = [
        go.Mesh3d(intensitymode="cell", hoverinfo="text", colorbar=bar, **soft),
        go.Mesh3d(hoverinfo="text", **soft),
        go.Scatter3d(mode="markers", hoverinfo="text", marker={"size": 9, "colorbar": bar}),
        go.Mesh3d(intensitymode="cell", hoverinfo="skip", colorbar=low, colorscale=plots.colours("pressure"), **flat),
        go.Scatter3d(mode="lines", hoverinfo="skip", line={"color": PAD, "width": 4}),
        go.Scatter3d(mode="lines", hoverinfo="skip", line={"color": FORCE, "width": 4}),
        go.Scatter3d(mode="markers", hoverinfo="skip", marker={"color": FORCE, "size": 2.5}),
    ]
    blue = plots.MODELS["ccm"][1]
    limit = {"showscale": False, "colorscale": [[0, blue], [1, blue]], "opacity": 0.85, "scene": "scene2"}
    return [*made, go.Surface(**limit)] if whole else made


def _looking(view: View, index: tuple[int, ...]) -> dict[str, Any]:
    """A camera that sees finger 1 obliquely from behind, and the object upright."""
    found = pads(view.data, view.gripper, index)
    out = -found[0].approach if found else np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0]) if abs(out[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    beside = np.cross(up, out)
    eye = 1.6 * (0.72 * out + 0.62 * beside / np.linalg.norm(beside) + 0.35 * up)
    camera = {"eye": dict(zip("xyz", eye.tolist(), strict=True)), "up": dict(zip("xyz", up.tolist(), strict=True)),
              "projection": {"type": "orthographic"}}  # fmt: skip
    return {"camera": camera}
