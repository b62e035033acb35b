"""Difference curves of a report: what a planar model claims too much, over a swept shape and its curvature."""

from __future__ import annotations

import math
import re
from typing import Any, NamedTuple

import numpy as np

from softjaw.study.quantities import MODELS
from softjaw.study.result.layout import DONE
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number, shown
from softjaw.study.show.outline import swept_object
from softjaw.study.show.report.page import Picture

LINES = (
    {"color": "#12436d", "linestyle": "-", "marker": "o"},
    {"color": "#c05a00", "linestyle": "--", "marker": "s"},
    {"color": "#2a8c82", "linestyle": ":", "marker": "^"},
    {"color": "#801650", "linestyle": "-.", "marker": "D"},
)
NAMES = {"f_x": "along, f_x", "f_y": "across, f_y", "tau_z": "torque, tau_z"}
AGAINST = {"flat": "planar model scaled by S (flat)", "projected": "planar model scaled by F_N (projected)"}


class Line(NamedTuple):
    """One difference curve along a sweep: normalisation, name, values ``(k,)`` and their errors ``(k,)`` or None."""

    model: str
    name: str
    values: np.ndarray
    error: np.ndarray | None


def difference_pictures(data: Data, scene: Any, index: tuple[int, ...]) -> list[tuple[Picture, bytes]]:
    """Curves over each abscissa of the longest sweep of the object's shape, for the page and as PNG."""
    position = _shape_axis(data, scene)
    if position is None:
        return []
    lines = [*_map_lines(data, position, index), *_derived_lines(data, position, index)]
    lines = [line for line in lines if np.isfinite(line.values).any()]
    found = _abscissas(data, scene, position, index) if lines else {}
    return [_picture(data, label, x, lines, index) for label, x in found.items() if np.isfinite(x).any()]


def _shape_axis(data: Data, scene: Any) -> int | None:
    """The longest axis that sweeps a number of the object; any numbered sweep where the scene cannot be read."""
    keys = list(scene.sweep) if scene else []
    known = [p for p in range(len(data.shape) - 3) if data.shape[p] > 1]
    known = [p for p in known if p >= len(keys) or (keys[p].startswith("object.") and data.axes[p].units)]
    return max(known, key=lambda p: data.shape[p], default=None)


def _cut(position: int, index: tuple[int, ...]) -> tuple[Any, ...]:
    return tuple(slice(None) if i == position else k for i, k in enumerate(index))


def _map_lines(data: Data, position: int, index: tuple[int, ...]) -> list[Line]:
    lines = []
    for key, name in NAMES.items():
        for model, suffix in (("flat", ""), ("projected", "_projected")):
            found = data.map(f"{key}_overestimate{suffix}")
            error = data.map(f"{key}_overestimate{suffix}_error")
            if found is not None:
                cut = _cut(position, index)
                lines.append(Line(model, name, found[cut], None if error is None else error[cut]))
    return lines


def _derived(data: Data, position: int, index: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Derived datasets without a unit, or a curvature, over this sweep; the other axes at ``index``."""
    names, found = [axis.name for axis in data.axes], {}
    for d in data.result.layout.derived:
        places = [names.index(n.replace(".", "_")) for n in d.axes]
        if not d.shape and position in places:
            values = data.result.derived(d.name)
            found[d.name] = values[tuple(slice(None) if p == position else index[p] for p in places)]
    return found


def _derived_lines(data: Data, position: int, index: tuple[int, ...]) -> list[Line]:
    units = {d.name: d.units for d in data.result.layout.derived}
    found, lines = _derived(data, position, index), []
    for name, values in found.items():
        if units[name] or name.endswith("_error") or re.search(r"(a_over_b|b_over_a)$", name):
            continue
        model = next((m for m in MODELS[1:] if m in name.split("_")), "flat")
        words = [w for w in name.split("_") if w not in (*MODELS, "difference", "relative")]
        lines.append(Line(model, " ".join(words) or name, values, found.get(f"{name}_error")))
    return lines


def _abscissas(data: Data, scene: Any, position: int, index: tuple[int, ...]) -> dict[str, np.ndarray]:
    """What to draw over: shape and curvature of an ellipse, or else the swept value itself."""
    derived = _derived(data, position, index)
    stored = {"a / b [-]": 1.0 / derived["b_over_a"]} if "b_over_a" in derived else {}
    if "apex_curvature" in derived:
        stored["curvature at the apex [1/m]"] = derived["apex_curvature"]
    points = [(*index[:position], i, *index[position + 1 :]) for i in range(data.shape[position])]
    ellipses = [_ellipse(data, scene, point) for point in points]
    if stored or all(ellipses):
        computed = np.array(ellipses, float).T if all(ellipses) else np.empty((2, 0))
        return stored or {
            "a / b, semi-axis along the approach over that across it [-]": computed[0] / computed[1],
            "curvature at the apex, a / b² [1/m]": computed[0] / computed[1] ** 2,
        }
    axis = data.axes[position]
    return {data.axis_label(axis): axis.values * shown(axis.units)[1]}


def _ellipse(data: Data, scene: Any, index: tuple[int, ...]) -> tuple[float, float] | None:
    """Semi-axes along and across the approach [m] of an elliptic cylinder pressed along one of them."""
    shape = swept_object(scene, index) if scene else None
    if getattr(shape, "shape", "") != "elliptic_cylinder" or data.by_poses:
        return None
    turns = float(data.axes[-2].values[index[-2]]) / (0.5 * math.pi)
    if abs(turns - round(turns)) > 1e-6:
        return None
    both = (shape.semi_axis_a, shape.semi_axis_b)
    return both if round(turns) % 2 == 0 else both[::-1]


def _picture(data: Data, label: str, x: np.ndarray, lines: list[Line], index: tuple[int, ...]) -> tuple[Picture, bytes]:
    models = [m for m in MODELS if any(line.model == m for line in lines)]
    drawn, axes = pictures.figure(10, 3.7, 1, len(models), sharey=True)
    order = np.argsort(x)
    for axis, model in zip(axes[0], models, strict=True):
        axis.axhline(0, color=pictures.SOFT, lw=0.7)
        own = [line for line in lines if line.model == model]
        styles = {line.name: LINES[i % len(LINES)] for i, line in enumerate(own)}
        for line in own:
            if line.error is not None:
                axis.errorbar(x, 100 * line.values, 100 * np.abs(line.error), fmt="none", elinewidth=1, capsize=2.5,
                              ecolor=styles[line.name]["color"])  # fmt: skip
        pictures.curves(axis, x[order], {line.name: 100 * line.values[order] for line in own}, styles)
        axis.set(xlabel=label, title=AGAINST[model], ylabel="1 - curved / planar [%]")
        axis.yaxis.set_tick_params(labelleft=True)
    bars = "Bars: difference to a mesh half as fine. " if any(line.error is not None for line in lines) else ""
    missing = int(np.sum(data.status[..., index[-1]] != DONE))
    gaps = f"{missing} cases at this force have no value. " if missing else ""
    caption = (
        f"At {number(data.forces[index[-1]])} N: the share of the planar model's claim that the curved contact cannot "
        f"carry. {bars}{gaps}Only the trend can be compared with the paper, whose numbers are not published."
    )
    said = "; ".join(
        f"{line.name}, {line.model}: {number(100 * low, 2)} to {number(100 * high, 2)} %"
        for line in lines
        for low, high in [(np.nanmin(line.values), np.nanmax(line.values))]
    )
    shown_ = Picture(pictures.as_svg(drawn), f"Differences of planar and curved model over {label}. {said}.", caption)
    return shown_, pictures.as_png(drawn)
