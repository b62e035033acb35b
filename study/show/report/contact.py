"""The contact of one case in a report: pressure and friction on the pad, and the limit surfaces that follow from it."""

from itertools import product
from typing import Any

import numpy as np

from softjaw.lsfit.surface import PLANES, shadow_outline
from softjaw.study.page import Block, plot
from softjaw.study.quantities import BY_KEY
from softjaw.study.show import plots
from softjaw.study.show.best_grasps import value_text
from softjaw.study.show.grasps import Index, at, number, place
from softjaw.study.show.stored_surface import NAMES, StoredSurface, stored_surface, weaker
from softjaw.study.show.view.model import FORCE, SLIPS, View
from softjaw.study.show.view.pads import Pad

MOTIONS = ("x", "turn")


def patch(view: View, index: Index) -> Block | None:
    """Pressure and friction on the pads of one case, each in its own frame; None if they are not stored."""
    both = view.pads(index)
    if not any(pad.loaded.any() for pad in both):
        return None
    first, second = (np.sort(pad.pressure, axis=None) for pad in both)
    top = max(first[-1], second[-1])
    # difference of the fingers' pressures over the largest one that is not drawn twice
    alike = bool(np.abs(first - second).max() <= 1e-3 * top)
    fingers = {"both fingers alike": both[0]} if alike else {f"finger {k}": pad for k, pad in enumerate(both, start=1)}
    titles = [f"{name}: friction against {SLIPS[m]}" for name in fingers for m in MOTIONS]
    made = plots.figure(len(fingers), 2, titles)
    for (row, pad), (column, motion) in product(enumerate(fingers.values(), start=1), enumerate(MOTIONS, start=1)):
        for trace in pad_face(pad, motion):
            made.add_trace(trace, row=row, col=column)
    scale = {"colorscale": plots.colours("pressure"), "cmin": 0, "cmax": 1e-3 * top}
    made.update_layout(coloraxis={**scale, "colorbar": plots.bars("pressure [kPa]")}, plot_bgcolor=plots.EMPTY)
    made.update_xaxes(title_text="x [mm]", showgrid=False, row=len(fingers))
    made.update_yaxes(showgrid=False).update_yaxes(title_text="y [mm]", col=1)
    made.for_each_yaxis(lambda axis: axis.update(scaleanchor=axis.anchor))  # true to scale
    words = {name: value_text(view.ds, name, index, unit=True) for name in ("p_max", "contact_area")}
    summary = f"{BY_KEY['maps/p_max'].label} {words['p_max']}, contact area {words['contact_area']}"
    frame = "The pad's face in its own frame, x along the pad; faces without contact are pale."
    blue = "Blue: friction of the faces against a slip along x or a turn about z of the contact frame (white axes)."
    caption = f"{place(view.ds, index, force=True)}: {summary}. {frame} {blue}"
    return plot(made, caption, f"Contact pressure and friction on the pad, {summary}", 300 * len(fingers) + 40)


def pad_face(pad: Pad, motion: str) -> list[Any]:
    """Traces of one pad in its own frame [mm, kPa]: pressure of the loaded faces, friction, contact frame."""
    centres = 1e3 * pad.pose.to_pad(pad.centroid)
    pressure = np.where(pad.loaded, 1e-3 * pad.pressure, np.nan).T
    size = 0.5 * np.ptp(centres[..., 1])
    arrows = 1e3 * pad.pose.to_pad(1e-3 * pad.arrows(motion, size / 4))
    frame = 0.6 * size * (pad.frame @ pad.pose.rotation)[:2]
    axes = 1e3 * pad.pose.to_pad(pad.origin) + np.stack([np.zeros((2, 3)), frame], axis=1)
    return [plots.heatmap(centres[..., 0].mean(axis=1), centres[..., 1].mean(axis=0), pressure),
            plots.segments(arrows, FORCE), plots.segments(axes, "white", "xy")]  # fmt: skip


def limit_surfaces(view: View, index: Index) -> Block | None:
    """Shadows of the weaker finger's limit surfaces, CCM beside PCM; None where none is stored."""
    ds, finger, faces = view.ds, weaker(view.ds, index), view.faces(index)
    stored = {model: stored_surface(ds, index, finger, model, faces) for model in ("ccm", "pcm")}
    known = {model: s for model, s in stored.items() if s is not None and s.ellipsoid.rank == 3}
    if not known:
        return None
    made = plots.figure(1, 3)
    for column, (i, j) in enumerate(PLANES, start=1):
        for model, surface in reversed(known.items()):  # the CCM on top
            _shadow(made, surface, model, i, j, column)
        made.update_xaxes(title_text=NAMES[i], row=1, col=column).update_yaxes(title_text=NAMES[j], row=1, col=column)
    made.update_yaxes(scaleanchor="x", row=1, col=1)
    made.update_layout(legend={"y": -0.25}, margin={"t": 20})
    exact = "Dots: exact wrenches of slip motions. " if any(s.exact for s in known.values()) else ""
    off = [[100 * at(ds, f"{name}{kind}", index) for name in ("overclaim", "fit_error")] for kind in ("", "_ellipsoid")]
    fitted, ellipsoid = (f"{number(worst, 2)} % (mean error {number(mean, 2)} %)" for worst, mean in off)
    claim = f"They claim too much by up to (CCM): {fitted} the fitted surface, {ellipsoid} the ellipsoid."
    caption = f"{place(ds, index, force=True)}: shadows of the loads that one contact carries without slipping."
    caption += f" Full: the fitted surface; dashed: the ellipsoid from three motions. {exact}"
    caption += claim * bool(np.isfinite(off).all())
    return plot(made, caption, f"Limit surfaces of {' and '.join(known)} over f_x, f_y and tau_z.", 420)


def _shadow(made: Any, surface: StoredSurface, model: str, i: int, j: int, column: int) -> None:
    name, colour, _, symbol = plots.MODELS[model]
    scale = surface.unit[[i, j]]
    common = {"row": 1, "col": column, "showlegend": column == 1, "hoverinfo": "x+y"}
    for kind, shape, dash in (("fitted", surface.chosen, "solid"), ("three motions", surface.ellipsoid, "dash")):
        if shape is not None:
            x, y = (shadow_outline(shape.support_points, i, j, 120) * scale).T
            made.add_scatter(x=x, y=y, mode="lines", name=f"{name}, {kind}", line={"color": colour, "dash": dash},
                             legendgroup=f"{model} {kind}", **common)  # fmt: skip
    if surface.exact is not None:
        x, y = (shadow_outline(surface.exact.support_points, i, j, 48) * scale).T
        made.add_scatter(x=x, y=y, mode="markers", name=f"{name}, exact", legendgroup=f"{model} exact", **common,
                         marker={"color": colour, "symbol": f"{symbol}-open", "size": 5})  # fmt: skip
