"""The contact of one case in a report: pressure and friction on the pad, and the limit surfaces that follow from it."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.page import Block, plot
from softjaw.study.show import plots
from softjaw.study.show.data import Data, number
from softjaw.study.show.stored_surface import StoredSurface, shadow_outline, stored_surface
from softjaw.study.show.tables.ranking import largest
from softjaw.study.show.view.pads import Pad, pads

ALIKE = 1e-3  # difference of the fingers' pressures over the largest one that is not drawn twice
COMPONENTS = (("f_x", "N", 1.0), ("f_y", "N", 1.0), ("tau_z", "N mm", 1e3))
FACTORS = np.array([c[2] for c in COMPONENTS])
PLANES = ((0, 1), (0, 2), (1, 2))
SAMPLES = 300  # exact wrenches that are drawn
ROWS, COLUMNS = 25, 49  # directions from pole to pole, and round
SLIPS = {"x": "slip along x", "turn": "turn about z"}


def patch(data: Data, gripper: Any, index: tuple[int, ...]) -> Block | None:
    """Pressure and friction on the pads of one case, seen from the object; None if they are not stored."""
    both = [pad for pad in pads(data, gripper, index) if pad.pressure is not None]
    if not both or not any(pad.loaded.any() for pad in both):
        return None
    top = max(float(pad.pressure.max()) for pad in both)
    alike = len(both) < 2 or bool(np.abs(np.sort(both[0].pressure, None) - np.sort(both[1].pressure, None)).max()
                                  <= ALIKE * top)  # fmt: skip
    fingers = both[:1] if alike else both
    names = ["both fingers alike" if alike else f"finger {k + 1}" for k in range(len(fingers))]
    titles = [f"{name}: friction against a {slip}" for name in names for slip in SLIPS.values()]
    made = plots.figure(len(fingers), 2, titles, specs=[[{"type": "scene"}] * 2] * len(fingers),
                        horizontal_spacing=0.02, vertical_spacing=0.06)  # fmt: skip
    for row, pad in enumerate(fingers, start=1):
        for column, motion in enumerate(SLIPS, start=1):
            for trace in front(pad, motion, top, bar=row == column == 1):
                made.add_trace(trace, row=row, col=column)
    eye = {"eye": {"x": 0, "y": 0, "z": 2.1}, "up": {"x": 0, "y": 1, "z": 0}, "projection": {"type": "orthographic"}}
    made.update_scenes(plots.scene(camera=eye)).update_layout(margin={"l": 0, "r": 80, "t": 58, "b": 0})
    area = data.at("contact_area", index) * 1e6
    said = f"largest pressure {number(1e-3 * top)} kPa, contact area {number(area)} mm²"
    caption = (
        f"{data.place(index, force=True)}: {said}. The pad's deformed face in its own frame: x along the pad, y across"
        " it; faces that touch nothing are pale. Blue: the friction that faces carry, each in its own plane, while the"
        " object slips along x or turns about z of the contact frame (black axes). Drag to turn it."
    )
    return plot(made, caption, f"Contact pressure and friction on the pad, {said}", 300 * len(fingers) + 40)


def front(pad: Pad, motion: str, top: float, bar: bool) -> list[Any]:
    """Traces of one pad in its own frame [mm, kPa]: faces with their pressure, friction, contact frame."""
    corners = 1e3 * pad.own(pad.quads().reshape(-1, 3))
    corners -= [0, 0, corners[:, 2].min()]
    number_, loaded = np.arange(len(corners)).reshape(-1, 4), pad.loaded.ravel()
    flat = {"lighting": {"ambient": 1, "diffuse": 0, "specular": 0}, "flatshading": True}
    traces = [plots.mesh(corners, plots.triangles(number_[~loaded]), color="#eef0f1", hoverinfo="skip", **flat)]
    pressure = np.repeat(1e-3 * pad.pressure.ravel()[loaded], 2)
    traces.append(plots.mesh(
        corners, plots.triangles(number_[loaded]), intensity=pressure, intensitymode="cell", cmin=0, cmax=1e-3 * top,
        colorscale=plots.colours("pressure"), showscale=bar, hoverinfo="skip", **flat,
        colorbar={"title": {"text": "pressure [kPa]", "side": "right"}, "thickness": 14},
    ))  # fmt: skip
    places, forces = pad.arrows(motion)
    high = np.array([0, 0, 0.3 + np.ptp(corners[:, 2])])
    base = 1e3 * pad.own(pad.origin)
    if len(places):
        start = 1e3 * pad.own(places) * [1, 1, 0] + high
        step = np.ptp(corners[:, 0]) / 16 / max(float(np.linalg.norm(forces, axis=1).max()), 1e-300)
        arrows = step * (forces @ pad.rotation)
        traces.append(plots.segments(np.stack([start - 0.5 * arrows, start + 0.5 * arrows], 1),
                                     line={"color": "#00a5bf", "width": 4}))  # fmt: skip
        tips = start + 0.5 * arrows
        traces.append(plots.points(tips, "#00a5bf", 2.5))
    axes = 0.3 * np.ptp(corners[:, 1]) * (pad.frame @ pad.rotation)[:2]
    ends = base * [1, 1, 0] + high + np.stack([np.zeros((2, 3)), axes], 1)
    traces.append(plots.segments(ends, line={"color": plots.INK, "width": 5}))
    traces.append(plots.points(ends[:, 1], plots.INK, 1, text=["x", "y"]))
    return traces


def weaker(data: Data, index: tuple[int, ...]) -> int:
    """The finger that carries the smaller torque."""
    found = data.values("fingers/tau_z_max")
    return 0 if found is None else largest(-np.nan_to_num(found[index][:, 0]))


def body(surface: StoredSurface) -> np.ndarray | None:
    """Points ``(ROWS, COLUMNS, 3)`` of a limit surface [N, N, N mm], row by latitude; None where it is unbounded."""
    t, phi = np.meshgrid(np.linspace(0, np.pi, ROWS), np.linspace(0, 2 * np.pi, COLUMNS), indexing="ij")
    u = np.stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.cos(t)], axis=-1)
    radius = (surface.chosen or surface.ellipsoid).radius(u.reshape(-1, 3)).reshape(ROWS, COLUMNS, 1)
    return u * radius * surface.unit * FACTORS if np.isfinite(radius).all() else None


def limit_surfaces(data: Data, index: tuple[int, ...]) -> Block | None:
    """Shadows of the weaker finger's limit surfaces, CCM beside PCM, and both in space; None where none is stored."""
    finger = weaker(data, index)
    found = {model: stored_surface(data, index, finger, model) for model in ("ccm", data.planar)}
    known = {model: s for model, s in found.items() if s is not None and s.ellipsoid.rank == 3}
    if not known:
        return None
    made = plots.figure(2, 3, specs=[[{}, {}, {}], [{"type": "scene", "colspan": 3}, None, None]],
                        row_heights=[0.42, 0.58], vertical_spacing=0.1)  # fmt: skip
    for column, (i, j) in enumerate(PLANES, start=1):
        for model, surface in reversed(known.items()):  # the CCM on top
            _shadow(made, surface, model, i, j, column)
        made.update_xaxes(title_text=_name(i), row=1, col=column).update_yaxes(title_text=_name(j), row=1, col=column)
    made.update_yaxes(scaleanchor="x", row=1, col=1)
    for model, surface in known.items():
        _in_space(made, surface, model)
    names = [_name(i) for i in range(3)]
    made.update_scenes(plots.scene("", names, aspectmode="cube"))
    made.update_layout(legend={"y": 0.56, "yanchor": "middle"}, margin={"t": 20, "b": 10})
    exact = "Dots: exact wrenches of slip motions. " if any(s.patch for s in known.values()) else ""
    fitted, ellipsoid = data.at("fit_error", index), data.at("fit_error_ellipsoid", index)
    off = f"Fit error (CCM): {number(100 * fitted, 2)} % fitted, {number(100 * ellipsoid, 2)} % from three motions."
    caption = (
        f"{data.place(index, force=True)}: the loads that one contact carries without slipping. Above its shadows: full"
        f" lines the fitted surface, dashed the ellipsoid from three motions. {exact}"
    ) + off * bool(np.isfinite(fitted) and np.isfinite(ellipsoid))
    return plot(made, caption, f"Limit surfaces of {' and '.join(known)} over f_x, f_y and tau_z.", 820)


def _name(i: int) -> str:
    return f"{COMPONENTS[i][0]} [{COMPONENTS[i][1]}]"


def _shadow(made: Any, surface: StoredSurface, model: str, i: int, j: int, column: int) -> None:
    name, colour, _, symbol = plots.MODELS[model]
    scale = (surface.unit * FACTORS)[[i, j]]
    common = {"row": 1, "col": column, "showlegend": column == 1, "hoverinfo": "x+y"}
    for words, shape, dash in (("fitted", surface.chosen, "solid"), ("three motions", surface.ellipsoid, "dash")):
        if shape is not None:
            outline = shadow_outline(shape, i, j, 120) * scale
            closed = np.vstack([outline, outline[:1]])
            made.add_scatter(x=closed[:, 0], y=closed[:, 1], mode="lines", name=f"{name}, {words}",
                             line={"color": colour, "dash": dash}, legendgroup=f"{model} {words}",
                             **common)  # fmt: skip
    exact = surface.outline(i, j, 48)
    if exact is not None:
        x, y = (exact * scale).T
        made.add_scatter(x=x, y=y, mode="markers", name=f"{name}, exact", legendgroup=f"{model} exact", **common,
                         marker={"color": colour, "symbol": f"{symbol}-open", "size": 5})  # fmt: skip


def _in_space(made: Any, surface: StoredSurface, model: str) -> None:
    colour, place = plots.MODELS[model][1], body(surface)
    if place is not None:
        x, y, z = np.moveaxis(place.astype(np.float32), -1, 0)
        made.add_surface(x=x, y=y, z=z, colorscale=[[0, colour], [1, colour]], showscale=False, row=2, col=1,
                         opacity=0.75 if model == "ccm" else 0.25, name=plots.MODELS[model][0])  # fmt: skip
    exact = surface.samples(SAMPLES)
    if exact is not None and model == "ccm":
        made.add_trace(plots.points(exact * surface.unit * FACTORS, plots.INK, 1.5), row=2, col=1)
