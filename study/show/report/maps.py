"""Maps of a report: every quantity over station, angle and force, CCM beside PCM."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from softjaw.study.page import Block, label, plot
from softjaw.study.pictures import SOFT, span
from softjaw.study.quantities import FAILED, FIRST, MISSING, MODELS, NO_GRASP, TABLE
from softjaw.study.show import plots
from softjaw.study.show.grasps import (
    Index,
    axis_label,
    axis_text,
    axis_values,
    choices,
    field,
    forces,
    label_of,
    number,
    quantity,
    spoken,
    stated,
)
from softjaw.study.units import shown_unit

MOST_PANELS, MOST_LABELS, MOST_NOTES = 6, 16, 8000
MARKS = (((FAILED,), "x-thin-open", 8), (NO_GRASP, "line-ew-open", 8), ((MISSING,), "circle", 3))  # of states; size


def plane(array: np.ndarray, x: int, y: int, index: Sequence[int]) -> np.ndarray:
    """Two-dimensional cut ``(y, x)`` through an array over all cases, all other axes at ``index``."""
    cut = array[tuple(slice(None) if i in (x, y) else index[i] for i in range(array.ndim))]
    return cut if y < x else cut.T


def ticks(ds: xr.Dataset, position: int, by_name: bool = True) -> tuple[Any, dict[str, Any]]:
    """Values of an axis for a figure, and its settings: names, and (``by_name``) few levels, as categories."""
    axis = str(ds.status.dims[position])
    values, texts = axis_values(ds, axis), list(ds[axis].attrs.get("options", ()))
    if axis == "station" and ds.attrs["poses"]:
        texts = [str(name) or str(i) for i, name in enumerate(ds.label.values[:, 0])]
    elif by_name and (len(values) == 1 or (axis in ("angle", "normal_force") and len(values) <= MOST_LABELS)):
        texts = [number(v, 5) for v in values]
    settings = {"title_text": axis_label(ds, axis)}
    return ([label(t) for t in texts], settings | {"type": "category"}) if texts else (values, settings)


def different_angles(ds: xr.Dataset) -> list[int]:
    """Angles whose maps are not those of an earlier angle (images by symmetry)."""
    different: list[int] = []
    arrays = [np.moveaxis(a, -2, 0) for a in (ds.status.values, *(field(ds, name) for name in FIRST)) if a is not None]
    for j in range(ds.sizes["angle"]):
        same = (all(np.allclose(a[i], a[j], rtol=1e-9, atol=0, equal_nan=True) for a in arrays) for i in different)
        different += [] if any(same) else [j]
    return different


def some(values: Sequence[int], required: int) -> list[int]:
    """At most `MOST_PANELS` of the values, evenly spread, ``required`` among them where it is one."""
    if len(values) <= MOST_PANELS:
        return list(values)
    spread = {values[int(i)] for i in np.linspace(0, len(values) - 1, MOST_PANELS)}
    return sorted(spread if required in spread or required not in values else {required, *sorted(spread)[1:]})


def maps(ds: xr.Dataset, index: Index) -> list[Block]:
    """Maps over stations, or a sweep if there is one station, and force for the angles; over the angle for forces."""
    *sweeps, stations, _, _ = ds.status.shape
    swept = stations == 1 and max(sweeps, default=1) > 1
    x, force = int(np.argmax(sweeps)) if swept else len(sweeps), len(index) - 1
    angles = different_angles(ds)
    made = [_maps(ds, index, x, force, force - 1, some(angles, index[-2]))]
    if len(angles) > 1:
        made.append(_maps(ds, index, x, force - 1, force, some(range(len(forces(ds))), index[-1])))
    return made


def _maps(ds: xr.Dataset, index: Index, x: int, y: int, over: int, panels: list[int]) -> Block:
    """Panels over two axes, a row for each of ``panels`` along a third one, CCM beside the planar model."""
    models, axes = MODELS[:2], [str(axis) for axis in ds.status.dims]
    levels = [f"{spoken(axes[over])} {axis_text(ds, axes[over], p)}" for p in panels]
    titles = [f"{plots.MODELS[m][0]}, {level}" for level in levels for m in models]
    height = max(110, min(26 * ds.status.shape[y] + 60, 240))
    total = 110 + height * len(panels)
    made = plots.figure(len(panels), 2, titles, shared_xaxes=True, shared_yaxes=True, horizontal_spacing=0.05,
                        vertical_spacing=min(0.45 * height, 70) / (total - 110))  # fmt: skip
    cuts = [(m, (*index[:over], p, *index[over + 1 :])) for p in panels for m in models]
    buttons = [_button(ds, name, cuts, x, y) for name in _names(ds)]
    for k in range(len(cuts)):
        first = {key: values[k] for key, values in buttons[0]["args"][0].items()}
        made.add_heatmap(coloraxis="coloraxis", hoverongaps=True, row=k // 2 + 1, col=k % 2 + 1, **first)
    _on_cells(made, ds, cuts, x, y)
    made.update_layout(buttons[0]["args"][1], updatemenus=[{"buttons": buttons, "x": 0, "xanchor": "left", "y": 1,
                       "yanchor": "bottom", "pad": {"b": 28}}], margin={"t": 90}, plot_bgcolor=plots.EMPTY,
                       showlegend=False)  # fmt: skip
    where = elsewhere(ds, index, x, y, over)
    marks = "Crosses: failed. Lines: no grasp. Dots: not computed yet."
    choose = "Choose the quantity at the upper left; point at a cell for its values and notes."
    caption = f"{f'At {where}. ' if where else ''}{choose} {marks}"
    names = " and ".join(plots.MODELS[m][0] for m in models)
    alt = f"Maps over {spoken(axes[x])} and {spoken(axes[y])}, {names}."
    return plot(made, caption, alt, total)


def _on_cells(made: Any, ds: xr.Dataset, cuts: Any, x: int, y: int) -> None:
    """Axes of all panels, notes on their cells, and marks of cases without values."""
    (xv, xs), (yv, ys), notes = ticks(ds, x), ticks(ds, y), _notes(ds)
    made.update_traces(x=xv, y=yv)
    for k, (_, cut) in enumerate(cuts):
        row, column = k // 2 + 1, k % 2 + 1
        made.data[k].customdata = None if notes is None else plane(notes, x, y, cut)
        states = plane(ds.status.values, x, y, cut)
        for which, symbol, size in MARKS:
            i, j = np.nonzero(np.isin(states, which))
            if i.size:
                look = {"symbol": symbol, "size": size, "color": SOFT}
                made.add_scatter(x=[xv[n] for n in j], y=[yv[n] for n in i], mode="markers", marker=look,
                                 hoverinfo="skip", row=row, col=column)  # fmt: skip
    titles = xs.pop("title_text"), ys.pop("title_text")
    made.update_xaxes(**xs, showgrid=False).update_xaxes(title_text=titles[0], row=len(cuts) // 2)
    made.update_yaxes(**ys, showgrid=False).update_yaxes(title_text=titles[1], col=1)


def _names(ds: xr.Dataset) -> list[str]:
    """Maps with values, and the error estimates of the first ones; quality where nothing is known."""
    more = [q.of_error.name for q in TABLE if q.error and q.rank]
    more += ["effect_object_level"] * ("wall" in ds.attrs["has"])
    return choices(ds, ds.attrs["score"], *more) or ["quality"]


def _button(ds: xr.Dataset, name: str, cuts: Any, x: int, y: int) -> dict[str, Any]:
    """Entry of the menu that shows a quantity in all panels."""
    title, factor = label_of(ds, name), quantity(ds, name)[2]
    if name.endswith("_error") and factor == 1:
        title, factor = f"{title} [%]", 100.0
    arrays = ((field(ds, name, m), at) for m, at in cuts)
    z = [np.full((1, 1), np.nan) if array is None else factor * plane(array, x, y, at) for array, at in arrays]
    axes = [str(ds.status.dims[a]) for a in (x, y)]
    (xl, xu), (yl, yu) = ((spoken(axis), shown_unit(ds[axis].units)) for axis in axes)
    hover = f"{xl} %{{x}} {xu}, {yl} %{{y}} {yu}<br>{label(title)}: %{{z:.4g}}<br>%{{customdata}}<extra></extra>"
    low, high = span(np.concatenate([a.ravel() for a in z]))
    rows = [None if not np.isfinite(a).any() else a.tolist() for a in z]
    axis = {"colorscale": plots.colours(name), "cmin": low, "cmax": high, "colorbar": plots.bars(label(title))}
    traces = {"z": rows, "hovertemplate": [hover] * len(rows)}
    return {"label": label(title), "method": "update", "args": [traces, {"coloraxis": axis}, [*range(len(rows))]]}


def _notes(ds: xr.Dataset) -> np.ndarray | None:
    """State and notes of all cases; None where there are too many for a page."""
    status = ds.status.values
    if status.size > MOST_NOTES:
        return None
    notes = [label(stated(ds, i)) for i in np.ndindex(status.shape)]
    return np.array(notes, object).reshape(status.shape)


def elsewhere(ds: xr.Dataset, index: Index, *drawn: int) -> str:
    """Values of the axes that a figure does not show."""
    axes = [str(axis) for axis in ds.status.dims]
    others = [(axis, i) for k, (axis, i) in enumerate(zip(axes, index, strict=True)) if k not in drawn]
    return ", ".join(f"{spoken(axis)} {axis_text(ds, axis, i)}" for axis, i in others if ds.sizes[axis] > 1)
