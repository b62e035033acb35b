"""Curves of a report: friction models over force, stations and sweeps; what curvature costs; how a wall gives way."""

import math
from typing import Any

import numpy as np
import xarray as xr

from softjaw.study.flags import Flag
from softjaw.study.page import Block, label, plot
from softjaw.study.pictures import SOFT
from softjaw.study.quantities import MODELS
from softjaw.study.show import plots
from softjaw.study.show.grasps import (
    Index,
    at,
    axis_label,
    axis_values,
    field,
    forces,
    label_of,
    number,
    place,
    quantity,
    spoken,
)
from softjaw.study.show.object_surface import undeformed
from softjaw.study.show.report.maps import elsewhere, ticks
from softjaw.study.show.view.model import View

PANELS = ("e_n", "quality", "tau_z_max", "f_x_max", "f_y_max", "closing")
OVER_F = ("f_x_max", "f_y_max")  # drawn over the normal force
COMPONENTS = {
    "f_x": ("along, f_x", "#12436d", "solid", "circle"),
    "f_y": ("across, f_y", "#c05a00", "solid", "square"),
    "tau_z": ("torque, tau_z", "#2a8c82", "solid", "triangle-up"),
}
AGAINST = {"pcm": "against PCM, scaled by S", "pcm_projected": "against PCM, scaled by F_N"}
HALF_AS_FINE = " Bars: error estimate from two meshes."
MOST_LINES, FEWEST = 40, 4


def along(position: int, index: Index) -> tuple[Any, ...]:
    """Cut through an array over all cases along one axis, the others at ``index``."""
    return tuple(slice(None) if i == position else k for i, k in enumerate(index))


def models(ds: xr.Dataset, roles: dict[str, Index], mu: float | None) -> list[Block]:
    """Curves over the force for some cases, and over every axis that is worth it for the first of them."""
    best, blocks = next(iter(roles.values())), []
    for role, index in roles.items():
        title = f"{role}, over the force: {place(ds, index)}"
        blocks += [{"kind": "heading", "text": title}, _models(ds, len(best) - 1, index, mu)]
    *sweeps, stations, _, _ = ds.status.shape
    worth_it = [p for p, length in enumerate(sweeps) if length > 1]
    worth_it += [len(sweeps)] * (stations >= FEWEST and not ds.attrs["poses"])  # where these lie along an object
    for position in worth_it:
        title = f"Over the {spoken(str(ds.status.dims[position]))}, all else as in the best case"
        blocks += [{"kind": "heading", "text": title}, _models(ds, position, best, mu)]
    return blocks


def _models(ds: xr.Dataset, position: int, index: Index, mu: float | None) -> Block:
    """Six quantities in all friction models along one axis."""
    titles = [f"{quantity(ds, name)[0]} / F" if name in OVER_F else label_of(ds, name) for name in PANELS]
    made = plots.figure(2, 3, titles, vertical_spacing=0.16, horizontal_spacing=0.07)
    x, settings = ticks(ds, position, by_name=False)
    cut, over_force = along(position, index), position == len(index) - 1
    for k, name in enumerate(PANELS):
        row, column = k // 3 + 1, k % 3 + 1
        F = forces(ds) if over_force else forces(ds)[index[-1]]
        scale = 1 / F if name in OVER_F else quantity(ds, name)[2]
        by_model = {m: values[cut] * scale for m in (MODELS if name != "closing" else ("ccm",))
                    if (values := field(ds, name, m)) is not None}  # fmt: skip
        error = field(ds, f"{name}_error")
        for m, y in by_model.items():
            half = None if error is None or m != "ccm" else y * error[cut]
            plots.line(made, x, y, plots.MODELS[m], row, column, half)
        if name in OVER_F and mu is not None:
            made.add_hline(mu, line={"color": SOFT, "width": 1, "dash": "dash"}, row=row, col=column)
    made.update_xaxes(**settings, row=2)
    bars = HALF_AS_FINE if field(ds, "e_n_error") is not None else ""
    rule = f" Dashed grey: mu = {mu:g}." if mu is not None else ""
    where = place(ds, index, force=not over_force)
    caption = f"{where[:1].upper()}{where[1:]}; F is the normal force of one finger.{rule}{bars}"
    alt = f"Six quantities over {spoken(str(ds.status.dims[position]))} for three friction models; {where}."
    return plot(made, caption, alt, 560)


# --- what curvature costs --------------------------------------------------------------------------------------------


def differences(ds: xr.Dataset, index: Index) -> list[Block]:
    """Share of the planar models' claims that the curved contact cannot carry, along a sweep of the object's shape."""
    swept = [(len(ds[name]), -p) for p, name in enumerate(ds.status.dims[:-3])
             if ds[name].units and ds[name].long_name.startswith("object.") and len(ds[name]) > 1]  # fmt: skip
    position = -max(swept, default=(0, 0))[1]  # the longest axis that sweeps a number of the object
    if not swept or not (lines := overestimates(ds, position, index)):
        return []
    return [_differences(ds, name, x, lines, position, index) for name, x in abscissas(ds, position, index).items()]


def overestimates(ds: xr.Dataset, position: int, index: Index) -> dict[tuple[str, str], Any]:
    """Overestimate of each planar model and component along an axis [-], and its error or None."""
    shares, cut = {}, along(position, index)
    for model, suffix in (("pcm", ""), ("pcm_projected", "_pcm_projected")):
        for key in COMPONENTS:
            values, error = (field(ds, f"{key}_overestimate{suffix}{end}") for end in ("", "_error"))
            if values is not None and np.isfinite(values[cut]).any():
                shares[model, key] = (values[cut], None if error is None else error[cut])
    return shares


def abscissas(ds: xr.Dataset, position: int, index: Index) -> dict[str, np.ndarray]:
    """What differences are drawn over: shape and curvature of an ellipse pressed at angle 0, or the swept value."""
    axis, cut = str(ds.status.dims[position]), along(position, index[:-3])
    if "b_over_a" not in ds or ds.angle.values[index[-2]]:
        return {axis_label(ds, axis): axis_values(ds, axis)}
    return {
        "a / b, semi-axis along the approach over that across it [-]": 1 / ds.b_over_a.values[cut],
        "curvature at the apex, a / b² [1/m]": ds.apex_curvature.values[cut],
    }


def _differences(
    ds: xr.Dataset, name: str, x: np.ndarray, lines: dict[Any, Any], position: int, index: Index
) -> Block:
    shown_models = [m for m in AGAINST if any(model == m for model, _ in lines)]
    made = plots.figure(1, len(shown_models), [AGAINST[m] for m in shown_models])
    order = np.argsort(x)
    for (model, key), (values, error) in lines.items():
        half = None if error is None else 100 * error[order]
        plots.line(made, x[order], 100 * values[order], COMPONENTS[key], 1, shown_models.index(model) + 1, half)
    made.update_xaxes(title_text=label(name)).update_yaxes(title_text="1 - CCM / PCM [%]")
    made.update_layout(legend={"y": -0.25})
    fine = HALF_AS_FINE if any(e is not None for _, e in lines.values()) else ""
    share = "the share of the planar model's claim that the curved contact cannot carry."
    at = elsewhere(ds, index, position) or f"{number(forces(ds)[index[-1]])} N"
    caption = f"At {at}: {share}{fine}"
    return plot(made, caption, f"Differences of PCM and CCM over {name}.", 400)


# --- a thin wall -----------------------------------------------------------------------------------------------------


def wall_curves(ds: xr.Dataset, index: Index, allowed: float | None) -> Block | None:
    """Normal force over closing and over indentation of the stations; ``allowed``: what the scene allows [m]."""
    closing, indentation = field(ds, "closing"), field(ds, "indentation")
    if indentation is None or closing is None or len(forces(ds)) < 2:
        return None
    cut: Any = (*index[:-3], slice(None), index[-2], slice(None))
    snapped = (ds["flags"].values & Flag.SNAPPED > 0)[cut]
    made = plots.figure(1, 2, ("closing displacement of the pads [mm]", "indentation [mm]"), shared_yaxes=True)
    others = [i for i in range(len(snapped)) if i != index[-3]]
    for i in (*others[:: -(-len(others) // MOST_LINES) or 1], index[-3]):
        chosen = i == index[-3]
        name = label(place(ds, (*index[:-3], i, *index[-2:])))
        look = {"color": "#12436d" if chosen else "#aeb6bc", "width": 2.5 if chosen else 1}
        symbols = ["circle", *np.where(snapped[i], "diamond-open", "circle")]
        for column, displacement in enumerate((closing, indentation), start=1):
            made.add_scatter(x=[0, *1e3 * displacement[cut][i]], y=[0, *forces(ds)], mode="lines+markers", line=look,
                             marker={"symbol": symbols, "size": 6}, name=name, showlegend=False, connectgaps=False,
                             row=1, col=column)  # fmt: skip
    if allowed is not None:
        made.add_vline(1e3 * allowed, line={"color": "#c05a00", "dash": "dash"}, row=1, col=2)
    made.update_yaxes(title_text="normal force [N]", col=1)
    rule = f" Dashed: the allowed indentation, {1e3 * allowed:g} mm." if allowed is not None else ""
    caption = f"Dark: {place(ds, index)}; grey: others. Open diamonds: the wall snapped in at a smaller force.{rule}"
    summary = f"{number(1e3 * indentation[index])} mm at {place(ds, index, force=True)}"
    return plot(made, caption, f"Force over closing and indentation; {summary}.", 340)


def wall_section(view: View, index: Index) -> Block | None:
    """Sections through the outer face of a deformed wall beside the undeformed one; None where none is stored."""
    displaced, origin = view.displacement(index), field(view.ds, "finger_pose_origin")
    if displaced is None or origin is None:
        return None
    (u, angle), placed = displaced, view.placed
    u = u @ placed.rotation
    before: Any = undeformed(view.scene.object, angle)
    out = np.array([math.cos(angle), math.sin(angle), 0.0])
    beside = np.array([-out[1], out[0], 0.0])
    j = int(np.abs(before[0, :, 2] - placed.to_pad(origin[index][0])[2]).argmin())
    made = plots.figure(1, 2, ("along the axis, through both fingers", f"across it at {1e3 * before[0, j, 2]:.4g} mm"))
    half = len(before) // 2
    for points, name, dash in ((before, "undeformed", "dash"), (before + u, "deformed", "solid")):
        look = {"color": SOFT if dash == "dash" else "#12436d", "dash": dash}
        upright = np.concatenate([points[half, ::-1], points[0]])
        ring = np.concatenate([points[:, j], points[:1, j]])
        for column, (x, y) in enumerate(((upright[:, 2], upright @ out), (ring @ beside, ring @ out)), start=1):
            made.add_scatter(x=1e3 * x, y=1e3 * y, mode="lines", line=look, name=name, showlegend=column == 1, row=1,
                             col=column)  # fmt: skip
    made.update_yaxes(title_text="along the approach [mm]", col=1)
    made.update_yaxes(scaleanchor="x", row=1, col=1).update_yaxes(scaleanchor="x2", row=1, col=2)
    made.update_xaxes(title_text="along the axis [mm]", col=1).update_xaxes(title_text="beside it [mm]", col=2)
    indentation = number(1e3 * at(view.ds, "indentation", index))
    caption = f"{place(view.ds, index, force=True)}: indentation {indentation} mm. True to scale."
    return plot(made, caption, f"Sections through the deformed wall; indentation {indentation} mm.", 420)
