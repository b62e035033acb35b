"""Figs. 4c, 7 and 8 of the paper: what grows with curvature and force, and maps of two objects."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from jobs.figures import drawing
from jobs.figures.contacts import WIDTH, outline
from softjaw.study import pictures
from softjaw.study.quantities import MODELS
from softjaw.study.ranking import largest
from softjaw.study.result.read import scene_of
from softjaw.study.show import plots
from softjaw.study.show.grasps import field, forces, number, place
from softjaw.study.show.object_surface import NOBODY
from softjaw.study.show.view import solids
from softjaw.study.show.view.model import View

COMPONENTS = {"f_y": ("across, f_y", "-", "o"), "tau_z": ("torque, tau_z", "--", "s"), "f_x": ("along, f_x", ":", "^")}
AGAINST = {"pcm": "against the PCM scaled by S, the paper's", "pcm_projected": "against the PCM scaled by F_N"}
LOOKS: dict[str, dict[str, Any]] = {"pcm": {"ms": 6, "mfc": "none", "lw": 1.0}, "pcm_projected": {"ms": 3.5, "lw": 1.3},
                                    "ccm": {"ms": 3, "lw": 1.3}}  # fmt: skip
QUANTITIES = {"e_n": ("e_n [mm]", 1e3), "quality": ("grasp quality [-]", 1.0)}


def curvature(ds: xr.Dataset) -> tuple[Any, str]:
    """(c) Share of the planar models' claims that the curved contact cannot carry, over a/b."""
    x, order = 1 / ds.b_over_a.values, np.argsort(1 / ds.b_over_a.values)
    last = len(forces(ds)) - 1
    drawn, axes = pictures.figure(WIDTH, 3.4, 1, 2, gap=0.1)
    for axis, (model, title) in zip(axes[0], AGAINST.items(), strict=True):
        axis.axhline(0, color=pictures.SOFT, lw=0.7)
        for name, (label, line, mark) in COMPONENTS.items():
            for k, force in enumerate(forces(ds)):
                values, error = _overestimate(ds, name, model, k)
                look = {"alpha": 1.0, "lw": 1.6} if k == last else {"alpha": 0.55, "lw": 1.0, "mfc": "white"}
                axis.errorbar(x[order], values[order], error[order], capsize=2, elinewidth=0.8, ls=line, marker=mark,
                              color=plots.MODELS[model][1], label=f"{label}, {number(force)} N",
                              **look)  # fmt: skip
        axis.set(xlabel="a / b, semi-axis along the approach over across [-]", ylabel="1 - CCM / PCM [%]", title=title)
        axis.legend(frameon=False, fontsize=8)
    axes[0, 0].set_title(f"(c) {AGAINST['pcm']}")
    ends = {name: _overestimate(ds, name, "pcm", last)[0][order] for name in COMPONENTS}
    more = -min(_overestimate(ds, name, "pcm_projected", k)[0].min() for name in COMPONENTS for k in range(last + 1))
    grows = ", ".join(f"{n} {number(ends[n][0], 2)} to {number(ends[n][-1], 2)} %" for n in ("f_y", "tau_z"))
    return drawn, (
        f"at {number(forces(ds)[last])} N the PCM overestimates, from a/b {number(x.min(), 2)} to "
        f"{number(x.max(), 2)}: {grows}; f_x at most {number(np.abs(ends['f_x']).max(), 2)} %; "
        f"against the PCM scaled by F_N the curved contact carries up to {number(more, 2)} % more"
    )


def _overestimate(ds: xr.Dataset, name: str, model: str, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Overestimate along the sweep at a force ``(r,)`` [%], and its difference to the coarser mesh."""
    key = f"{name}_overestimate" + ("" if model == "pcm" else "_pcm_projected")
    found, error = ds[key].values[:, 0, 0, k], field(ds, f"{key}_error")
    return 100 * found, 100 * np.abs(np.zeros(len(found)) if error is None else error[:, 0, 0, k])


def force_study(ds: xr.Dataset) -> tuple[Any, str]:
    """(a) Normalised friction force, (b) normalised torque, (c) e_n, (d) score; below: what the planar model adds."""
    lines = over_force(ds)
    drawn, axes = pictures.figure(WIDTH, 4.6, 2, 4, gap=0.06, sharex=True, height_ratios=[1.5, 1])
    results = []
    for k, (name, (title, values)) in enumerate(lines.items()):
        top, below = axes[:, k]
        gap = {model: 100 * (1 - values["ccm"] / values[model]) for model in LOOKS}
        for model, look in LOOKS.items():
            top.plot(forces(ds), values[model], **drawing.model_look(model, **look))
            if model != "ccm":
                below.plot(forces(ds), gap[model], **drawing.model_look(model, **look))
        top.set_title(f"({'abcd'[k]}) {title}")
        top.margins(y=0.12)
        below.axhline(0, color=pictures.SOFT, lw=0.7)
        below.set(xlabel="normal force [N]", xlim=(0, None))
        claim = f"below the PCM by {number(gap['pcm'].min(), 2)} to {number(gap['pcm'].max(), 2)} %"
        over, top_at = [number(value, 4) for value in values["ccm"]], int(values["ccm"].argmax())
        peak = f" over {over[top_at]} at {number(forces(ds)[top_at])} N" if 0 < top_at < len(over) - 1 else ""
        results.append(f"{name} {over[0]}{peak} to {over[-1]}, {claim}")
    axes[1, 0].set_ylabel("1 - CCM / PCM [%]")
    named = axes[0, 0].get_legend_handles_labels()
    drawn.legend(*named, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return drawn, f"from {number(forces(ds)[0])} to {number(forces(ds)[-1])} N: {'; '.join(results)}"


def over_force(ds: xr.Dataset) -> dict[str, tuple[str, dict[str, np.ndarray]]]:
    """Title and values over the force ``(k,)`` of every panel, in each friction model.

    Forces are over the pressure sum S, as in the paper; torques over F times the pad's length.
    """
    length, F = scene_of(ds).gripper.pad_length, forces(ds)

    def of(name: str, factor: Any) -> dict[str, np.ndarray]:
        return {model: ds[name].sel(model=model).values[0, 0] * factor for model in MODELS}

    return {
        "force": ("f_y / S [-]", of("f_y_max", 1 / ds.S.values[0, 0])),
        "torque": (f"tau_z / (F · {number(1e3 * length)} mm)", of("tau_z_max", 1 / (F * length))),
        "e_n": ("e_n [mm]", of("e_n", 1e3)),
        "score": ("grasp quality [-]", of("quality", 1.0)),
    }


def maps(*objects: xr.Dataset) -> tuple[Any, str]:
    """e_n and quality of every candidate on its place of the object, at the highest force that some wall bears."""
    drawn, axes = pictures.figure(WIDTH, 4.2, 1, len(QUANTITIES) * len(objects))
    for ds, pair in zip(objects, axes.reshape(len(objects), -1), strict=True):
        for panel, (name, (label, _)) in zip(pair, QUANTITIES.items(), strict=True):
            image, limits = _map(ds, name)
            drawing.placed(panel, image, f"{ds.attrs['title']}, {number(forces(ds)[ds.attrs['level']])} N")
            drawing.scale(drawn, panel, label, pictures.COLOURS[name], limits)
    return drawn, "; ".join(best_and_widest(ds) for ds in objects)


def _map(ds: xr.Dataset, name: str) -> tuple[np.ndarray, tuple[float, float]]:
    """The deformed object in the colours of a map, and the limits of these [mm for lengths]."""
    view, index = View(ds), (0, 0, ds.attrs["level"])
    corners, cell = view.surface.triangles, view.surface.candidate
    values = QUANTITIES[name][1] * view.over_candidates(ds[name].sel(model="ccm").values, index[-1])
    limits, shown = pictures.span(values), np.where(cell == NOBODY, np.nan, values[cell])

    def draw(plotter: Any) -> None:
        solids.surface(plotter, 1e3 * view.moved(index), corners, shown, cmap=pictures.COLOURS[name], clim=limits)

    return drawing.rendered(draw, (0.8, 0.6, 0.25), (0, 0, 1), (900, 1300)), limits


def best_and_widest(ds: xr.Dataset) -> str:
    """Where e_n and quality are largest, how large they are where the object is widest, and the best grasp."""
    k, stations, wide = ds.attrs["level"], 1e3 * ds.station.values, widest(ds)
    results = []
    for name in QUANTITIES:
        values = ds[name].sel(model="ccm").values[..., k]
        i, _ = np.unravel_index(largest(values), values.shape)
        share = 100 * np.nanmax(values[wide]) / np.nanmax(values)
        results.append(f"{name} largest at {number(stations[i])} mm, where widest at most {number(share)} % of that")
    ends = np.flatnonzero(np.diff(wide.astype(int), prepend=0, append=0)).reshape(-1, 2)
    span = " and ".join(f"{number(stations[a])} to {number(stations[b - 1])} mm" for a, b in ends)
    results.append(f"best grasp that the wall bears: {place(ds, ds.attrs['best'])}")
    return f"{ds.attrs['title']}, {number(forces(ds)[k])} N, widest at {span}: {'; '.join(results)}"


def widest(ds: xr.Dataset) -> np.ndarray:
    """Stations ``(s,)`` where the object itself is widest, to 0.5 %."""
    shape, stations = scene_of(ds).object, ds.station.values
    half = np.max([np.interp(stations, *outline(shape, angle)) for angle in ds.angle.values], axis=0)
    return half >= 0.995 * half.max()
