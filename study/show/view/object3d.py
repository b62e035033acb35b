"""The object with a map on it, the pads of a case and its limit surface: one plotly figure that a page's script steers.

The figure has a trace for each part, without geometry; what the parts hold at every force, candidate and quantity
stands in ``layout.meta.object3d`` and `page.js` fills it in. Lengths are in mm, pressures in kPa.
Arrays are packed as base64.
"""

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from softjaw.study.page import Block, label, page, plot, text
from softjaw.study.pictures import INK
from softjaw.study.quantities import ALONG, AROUND
from softjaw.study.result.layout import DONE
from softjaw.study.show import plots
from softjaw.study.show.grasps import Index, choices, forces, label_of, order, place, stated
from softjaw.study.show.stored_surface import NAMES
from softjaw.study.show.view.model import ARROW_MM, CROSSED, FORCE, NEUTRAL, OPEN, PAD, View

MOST = 24_000_000  # bytes of pads, walls and limit surfaces; beyond it, those of the worst grasps are left out


def object_block(
    view: View, index: Index, quantity: str, motion: str, cases: Sequence[Index], limit_surface: bool = False
) -> Block:
    """The figure as a part of a page, with the geometry of some cases; why there is none where nothing can be drawn."""
    if not len(view.surface.points):
        return text(f"{view.note[:1].upper()}{view.note[1:]}.", "warn")
    content, left_out = payload(view, index, quantity, cases, motion, limit_surface)
    made = go.Figure([*_traces(limit_surface), _room(view, index)])
    made.update_layout(template="none", margin={"l": 0, "r": 0, "t": 10, "b": 0}, uirevision="keep", showlegend=False)
    made.update_layout(meta={"object3d": content}, scene=plots.scene(camera=_camera(view, index)))
    if limit_surface:
        made.update_layout(scene={"domain": {"x": [0, 0.66]}})
        made.update_layout(scene2=plots.scene(NAMES, aspectmode="cube", domain={"x": [0.7, 1], "y": [0.2, 0.8]}))
    gone = [f"pads of the {left_out} worst cases are left out, or the page would be too large"] * bool(left_out)
    legend = ". ".join(line[:1].upper() + line[1:] for line in (*view.legend(index, motion), *gone))
    caption = f"Choose quantity and normal force above, click a place for its grasp, drag to turn. {legend}."
    alt = f"{view.ds.attrs['title']} in three dimensions in the colours of {quantity}, with both pads."
    return plot(made, caption, alt, 560)


def view_page(view: View, index: Index, quantity: str, motion: str) -> str:
    """The page of a view, which opens at a case and a map, with all cases."""
    levels = sorted(range(len(forces(view.ds))), key=lambda k: abs(k - index[-1]))
    cases = [index, *(i for k in levels for i in order(view.ds, k) if i[:-3] == view.point)]
    block = object_block(view, index, quantity, motion, list(dict.fromkeys(cases)), limit_surface=True)
    return page(view.ds.attrs["title"], view.summary(index, quantity)[0], [("object", "", [block])])


def payload(
    view: View, index: Index, quantity: str, cases: Sequence[Index], motion: str, limit_surface: bool
) -> tuple[dict[str, Any], int]:
    """Everything that the figure shows, as plain data, and how many solved cases had to be left out."""
    ds, drawn, left_out, size = view.ds, {}, 0, 0
    for i in (i for i in cases if ds.status.values[i] == DONE):
        if size > MOST:
            left_out += 1
            continue
        drawn[f"{i[-1]} {view.candidate(i)}"] = parts = case(view, i, motion, limit_surface)
        size += sum(len(part) for part in parts.values() if isinstance(part, str))
    levels = range(len(forces(ds)))
    every = {f"{k} {c}": view.index(c, k) for k in levels for c in range(view.candidates)}
    surface, wall = view.surface, view.wall
    content = {
        "start": {"force": index[-1], "candidate": view.candidate(index), "quantity": quantity},
        "forces": forces(ds).tolist(),
        "names": [label(place(ds, view.index(c, 0))) for c in range(view.candidates)],
        "states": [view.state(k).tolist() for k in levels],
        "words": {key: view.summary(i, quantity) for key, i in every.items()},
        "notes": {key: label(note) for key, i in every.items() if (note := stated(ds, i))},
        "quantities": [_choice(view, name) for name in choices(ds, quantity)],
        "points": _packed(1e3 * surface.points, "<f4"), "triangles": _packed(surface.triangles, "<i4"),
        "owner": _packed(surface.owner, "<i4"), "grid": [AROUND, ALONG],
        "around": "" if wall is None else _packed(np.nan_to_num(wall[:, 0], nan=-1e9), "<f4"),
        "along": "" if wall is None else _packed(np.nan_to_num(wall[:, 1]), "<f4"),
        "colours": [NEUTRAL, OPEN, CROSSED], "cases": drawn,
    }  # fmt: skip
    return content, left_out


def case(view: View, index: Index, motion: str, limit_surface: bool) -> dict[str, Any]:
    """Pads with pressure and friction, deformed wall and limit surface of one case, packed."""
    both = view.pads(index)
    pressed = [pad.pressed() for pad in both]
    corners = np.concatenate([np.empty((0, 4, 3)), *(c for c, _ in pressed)])
    sides = 1e3 * np.concatenate([np.empty((0, 4, 3)), *(pad.sides() for pad in both)])
    step = float(np.abs(np.concatenate([corners, sides])).max(initial=1e-3)) / 32767
    parts: dict[str, Any] = {
        "pads": len(both), "step": step, "faces": _packed(np.round(corners / step), "<i2"),
        "sides": _packed(np.round(sides / step), "<i2"),
        "lines": _packed(_joined([1e3 * pad.lines() for pad in both]), "<f4"),
        "pressure": _packed(np.concatenate([np.empty(0), *(p for _, p in pressed)]), "<f4"),
        "arrows": _packed(_joined([pad.arrows(motion, ARROW_MM) for pad in both]), "<f4"),
    }  # fmt: skip
    if (moved := view.displacement(index)) is not None:
        parts |= {"wall": _packed(1e3 * moved[0], "<f4"), "angle": moved[1]}
    if limit_surface and (points := view.limit(index)) is not None:
        parts |= {"limit": _packed(points, "<f4"), "rows": points.shape[0]}
    return parts


def _joined(segments: list[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.empty((0, 2, 3)), *segments])


def _packed(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()


def _choice(view: View, name: str) -> dict[str, Any]:
    values, limits = view.coloured(name)
    rows = [[float(f"{v:.6g}") if np.isfinite(v) else None for v in view.over_candidates(values, k)]
            for k in range(values.shape[-1])]  # fmt: skip
    title = label_of(view.ds, name)
    return {"name": name, "title": title, "label": label(title), "limits": limits, "values": rows,
            "scale": plots.colours(name)}  # fmt: skip


def _traces(limit_surface: bool) -> list[Any]:
    """Empty traces in the script's order: object, rest, pressure, pads, lines, arrows, tips, limit surface."""
    soft = {"lighting": {"ambient": 0.8, "diffuse": 0.3, "specular": 0.02, "roughness": 0.9}, "flatshading": False}
    bar = plots.bars("", len=0.5, y=0.76, x=0.0)
    low = plots.bars("contact pressure [kPa]", len=0.5, y=0.24, x=0.0)
    made = [
        go.Mesh3d(intensitymode="cell", hoverinfo="text", colorbar=bar, **soft),
        go.Mesh3d(hoverinfo="text", **soft),
        go.Mesh3d(intensitymode="cell", hoverinfo="skip", colorbar=low, colorscale=plots.colours("pressure"),
                  **plots.FLAT),
        go.Mesh3d(hoverinfo="skip", color=PAD, opacity=0.35, **plots.FLAT),
        go.Scatter3d(mode="lines", hoverinfo="skip", line={"color": INK, "width": 5}),
        go.Scatter3d(mode="lines", hoverinfo="skip", line={"color": FORCE, "width": 4}),
        go.Scatter3d(mode="markers", hoverinfo="skip", marker={"color": FORCE, "size": 2.5}),
    ]  # fmt: skip
    blue = plots.MODELS["ccm"][1]
    limit = {"showscale": False, "colorscale": [[0, blue], [1, blue]], "opacity": 0.85, "scene": "scene2"}
    return [*made, go.Surface(**limit)] if limit_surface else made


def _room(view: View, index: Index) -> Any:
    """Points that nobody sees round what is slender: plotly fits a volume, in which that would stand too tall."""
    points = 1e3 * np.concatenate([view.surface.points, *(pad.sides().reshape(-1, 3) for pad in view.pads(index))])
    ends, extent = np.stack([points.min(axis=0), points.max(axis=0)]), np.ptp(points, axis=0)
    x, y, z = (ends.mean(axis=0) + np.outer([-0.5, 0.5], np.maximum(extent, extent[2] / 2.8))).T
    return go.Scatter3d(x=x, y=y, z=z, mode="markers", marker={"opacity": 0.0}, hoverinfo="skip")


def _camera(view: View, index: Index) -> dict[str, Any]:
    """Where it is seen from; a little below its middle, so that the names of its axes stay in the picture."""
    eye, up = view.eye(index)
    places = {"eye": 1.75 * eye, "up": up, "center": np.array([0.0, 0.0, -0.08])}
    at = {name: dict(zip("xyz", place.tolist(), strict=True)) for name, place in places.items()}
    return {**at, "projection": {"type": "orthographic"}}
