"""The contact of one case in a report: pressure and friction on the pad, and the limit surfaces that follow from it."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.page import Block, plot
from softjaw.study.show import plots
from softjaw.study.show.best_grasps import value_text
from softjaw.study.show.grasps import Index, at, number, place
from softjaw.study.show.stored_surface import (
    NAMES,
    PLANES,
    StoredSurface,
    body,
    shadow_outline,
    stored_surface,
    weaker,
)
from softjaw.study.show.view.model import FORCE, View
from softjaw.study.show.view.pads import Pad

SLIPS = {"x": "slip along x", "turn": "turn about z"}


def patch(view: View, index: Index) -> Block | None:
    """Pressure and friction on the pads of one case, seen from the object; None if they are not stored."""
    both = view.pads(index)
    if not any(pad.loaded.any() for pad in both):
        return None
    one, two = (np.sort(pad.pressure, axis=None) for pad in both)
    top = max(one[-1], two[-1])
    # difference of the fingers' pressures over the largest one that is not drawn twice
    alike = bool(np.abs(one - two).max() <= 1e-3 * top)
    fingers = {"both fingers alike": both[0]} if alike else {f"finger {k}": pad for k, pad in enumerate(both, start=1)}
    titles = [f"{name}: friction against a {slip}" for name in fingers for slip in SLIPS.values()]
    made = plots.figure(len(fingers), 2, titles, specs=[[{"type": "scene"}] * 2] * len(fingers),
                        horizontal_spacing=0.02, vertical_spacing=0.06)  # fmt: skip
    for row, pad in enumerate(fingers.values(), start=1):
        for column, motion in enumerate(SLIPS, start=1):
            for trace in pad_face(pad, motion, top, bar=row == column == 1):
                made.add_trace(trace, row=row, col=column)
    eye = {"eye": {"x": 0, "y": 0, "z": 2.1}, "up": {"x": 0, "y": 1, "z": 0}, "projection": {"type": "orthographic"}}
    made.update_scenes(plots.scene(camera=eye)).update_layout(margin={"l": 0, "r": 80, "t": 58, "b": 0})
    words = {name: value_text(view.ds, name, index, unit=True) for name in ("p_max", "contact_area")}
    summary = f"largest pressure {words['p_max']}, contact area {words['contact_area']}"
    frame = "The pad's deformed face in its own frame, x along the pad; faces without contact are pale."
    blue = "Blue: friction of the faces against a slip along x or a turn about z of the contact frame (black axes)."
    caption = f"{place(view.ds, index, force=True)}: {summary}. {frame} {blue} Drag to turn it."
    return plot(made, caption, f"Contact pressure and friction on the pad, {summary}", 300 * len(fingers) + 40)


def pad_face(pad: Pad, motion: str, top: float, bar: bool) -> list[Any]:
    """Traces of one pad in its own frame [mm, kPa]: faces with their pressure, friction, contact frame."""
    corners = 1e3 * pad.own(pad.quads().reshape(-1, 3))
    corners -= [0, 0, corners[:, 2].min()]
    quads, loaded = np.arange(len(corners)).reshape(-1, 4), pad.loaded.ravel()
    traces = [plots.mesh(corners, plots.triangles(quads[~loaded]), color="#eef0f1", hoverinfo="skip", **plots.FLAT)]
    pressure = np.repeat(1e-3 * pad.pressure.ravel()[loaded], 2)
    traces.append(plots.mesh(
        corners, plots.triangles(quads[loaded]), intensity=pressure, intensitymode="cell", cmin=0, cmax=1e-3 * top,
        colorscale=plots.colours("pressure"), showscale=bar, hoverinfo="skip", colorbar=plots.bars("pressure [kPa]"),
        **plots.FLAT,
    ))  # fmt: skip
    high = np.array([0, 0, 0.3 + np.ptp(corners[:, 2])])
    arrows = 1e3 * pad.own(1e-3 * pad.arrows(motion, np.ptp(corners[:, 0]) / 16)) * [1, 1, 0] + high
    traces.append(plots.segments(arrows, line={"color": FORCE, "width": 4}))
    traces.append(plots.points(arrows[:, 1], FORCE, 2.5))
    axes = 0.3 * np.ptp(corners[:, 1]) * (pad.frame @ pad.rotation)[:2]
    ends = 1e3 * pad.own(pad.origin) * [1, 1, 0] + high + np.stack([np.zeros((2, 3)), axes], 1)
    traces.append(plots.segments(ends, line={"color": plots.INK, "width": 5}))
    return [*traces, plots.points(ends[:, 1], plots.INK, 1, text=["x", "y"])]


def limit_surfaces(view: View, index: Index) -> Block | None:
    """Shadows of the weaker finger's limit surfaces, CCM beside PCM, and both in space; None where none is stored."""
    ds, finger, faces = view.ds, weaker(view.ds, index), view.faces(index)
    stored = {model: stored_surface(ds, index, finger, model, faces) for model in ("ccm", "pcm")}
    known = {model: s for model, s in stored.items() if s is not None and s.ellipsoid.rank == 3}
    if not known:
        return None
    made = plots.figure(2, 3, specs=[[{}, {}, {}], [{"type": "scene", "colspan": 3}, None, None]],
                        row_heights=[0.42, 0.58], vertical_spacing=0.1)  # fmt: skip
    for column, (i, j) in enumerate(PLANES, start=1):
        for model, surface in reversed(known.items()):  # the CCM on top
            _shadow(made, surface, model, i, j, column)
        made.update_xaxes(title_text=NAMES[i], row=1, col=column).update_yaxes(title_text=NAMES[j], row=1, col=column)
    made.update_yaxes(scaleanchor="x", row=1, col=1)
    for model, surface in known.items():
        _in_space(made, surface, model)
    made.update_scenes(plots.scene("", NAMES, aspectmode="cube"))
    made.update_layout(legend={"y": 0.56, "yanchor": "middle"}, margin={"t": 20, "b": 10})
    exact = "Dots: exact wrenches of slip motions. " if any(s.patch for s in known.values()) else ""
    worst = [at(ds, name, index) for name in ("overclaim", "overclaim_ellipsoid")]
    mean = [at(ds, name, index) for name in ("fit_error", "fit_error_ellipsoid")]
    parts = zip(worst, mean, strict=True)
    fitted, ellipsoid = (f"{number(100 * w, 2)} % (mean error {number(100 * m, 2)} %)" for w, m in parts)
    off = f"They claim too much by up to (CCM): {fitted} the fitted surface, {ellipsoid} the ellipsoid."
    caption = f"{place(ds, index, force=True)}: the loads that one contact carries without slipping, and their shadows."
    caption += f" Full: the fitted surface; dashed: the ellipsoid from three motions. {exact}"
    caption += off * bool(np.isfinite([*worst, *mean]).all())
    return plot(made, caption, f"Limit surfaces of {' and '.join(known)} over f_x, f_y and tau_z.", 820)


def _shadow(made: Any, surface: StoredSurface, model: str, i: int, j: int, column: int) -> None:
    name, colour, _, symbol = plots.MODELS[model]
    scale = surface.unit[[i, j]]
    common = {"row": 1, "col": column, "showlegend": column == 1, "hoverinfo": "x+y"}
    for kind, shape, dash in (("fitted", surface.chosen, "solid"), ("three motions", surface.ellipsoid, "dash")):
        if shape is not None:
            outline = shadow_outline(shape, i, j, 120) * scale
            x, y = np.vstack([outline, outline[:1]]).T
            made.add_scatter(x=x, y=y, mode="lines", name=f"{name}, {kind}", line={"color": colour, "dash": dash},
                             legendgroup=f"{model} {kind}", **common)  # fmt: skip
    exact = surface.outline(i, j, 48)
    if exact is not None:
        x, y = (exact * scale).T
        made.add_scatter(x=x, y=y, mode="markers", name=f"{name}, exact", legendgroup=f"{model} exact", **common,
                         marker={"color": colour, "symbol": f"{symbol}-open", "size": 5})  # fmt: skip


def _in_space(made: Any, surface: StoredSurface, model: str) -> None:
    colour, points = plots.MODELS[model][1], body(surface)
    if points is not None:
        x, y, z = np.moveaxis(points.astype(np.float32), -1, 0)
        made.add_surface(x=x, y=y, z=z, colorscale=[[0, colour], [1, colour]], showscale=False, row=2, col=1,
                         opacity=0.75 if model == "ccm" else 0.25, name=plots.MODELS[model][0])  # fmt: skip
    exact = surface.samples(300)  # exact wrenches that are drawn
    if exact is not None and model == "ccm":
        made.add_trace(plots.points(exact * surface.unit, plots.INK, 1.5), row=2, col=1)
