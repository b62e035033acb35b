"""Maps of a report: every quantity over station, angle and force, CCM beside PCM; levels, safe forces, and effort."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softjaw.study.page import Block, label, plot
from softjaw.study.quantities import EFFECTS, PARTS
from softjaw.study.result.layout import DONE, FAILED, MISSING
from softjaw.study.show import plots
from softjaw.study.show.data import Data, number, shown
from softjaw.study.show.report.tables import note
from softjaw.study.show.tables.ranking import largest

MOST_PANELS, MOST_LABELS, MOST_REMARKS = 6, 16, 8000
FIRST = ("quality", "e_n")
MORE = ("quality_fitted", "epsilon", "f_x_max", "f_y_max", "tau_z_max", "safety_factor", "contact_area", "p_max",
        "closing", "curvature_loss", "fit_error", "indentation", "wall_stress", "support_force")  # fmt: skip
LEVEL_COLOURS = ("#e9eef2", "#8fb4cf", "#12436d")  # light to dark with the cost of a level
PART_COLOURS = ("#12436d", "#6f9cc0", "#c05a00", "#c9ced2")  # as PARTS


def main_axis(data: Data) -> int:
    """Position of the axis that maps are drawn over: the stations, or a sweep where there is only one station."""
    lengths = data.shape[:-3]
    place = len(lengths)
    return int(np.argmax(lengths)) if data.shape[place] == 1 and max(lengths, default=1) > 1 else place


def plane(array: np.ndarray, x: int, y: int, index: Sequence[int]) -> np.ndarray:
    """Two-dimensional cut ``(y, x)`` through an array over all cases, all other axes at ``index``."""
    cut = array[tuple(slice(None) if i in (x, y) else index[i] for i in range(array.ndim))]
    return cut if y < x else cut.T


def ticks(data: Data, position: int) -> tuple[Any, dict[str, Any]]:
    """Values of an axis for a figure, and its settings: names and few levels as categories, else numbers."""
    axis = data.axes[position]
    values = axis.values * shown(axis.units)[1]
    texts = data.texts(axis)
    if position == len(data.shape) - 3 and data.by_poses:
        texts = [str(name) or str(i) for i, name in enumerate(data.ds["label"].values[:, 0])]
    elif len(values) == 1 or (position >= len(data.shape) - 2 and len(values) <= MOST_LABELS):
        texts = [number(v, 5) for v in values]
    settings = {"title_text": data.axis_label(axis)}
    return ([label(t) for t in texts], settings | {"type": "category"}) if texts else (values, settings)


def different_angles(data: Data) -> list[int]:
    """Angles whose maps are not those of an earlier angle (images by symmetry)."""
    found: list[int] = []
    arrays = [np.moveaxis(a, -2, 0) for name in FIRST if (a := data.map(name)) is not None]
    states = np.moveaxis(data.status, -2, 0)
    for j in range(data.shape[-2]):
        same = any(
            np.array_equal(states[i], states[j])
            and all(np.allclose(a[i], a[j], rtol=1e-9, atol=0, equal_nan=True) for a in arrays)
            for i in found
        )
        found += [] if same else [j]
    return found


def some(values: Sequence[int], kept: int) -> list[int]:
    """At most `MOST_PANELS` of the values, evenly spread, ``kept`` among them where it is one."""
    if len(values) <= MOST_PANELS:
        return list(values)
    spread = {values[int(i)] for i in np.linspace(0, len(values) - 1, MOST_PANELS)}
    return sorted(spread if kept in spread or kept not in values else {kept, *sorted(spread)[1:]})


def maps(data: Data, index: tuple[int, ...]) -> list[Block]:
    """Maps over the main axis and the force for the different angles; over main axis and angle for the forces."""
    x, angle, force = main_axis(data), len(data.shape) - 2, len(data.shape) - 1
    angles = different_angles(data)
    made = [_maps(data, index, x, force, angle, some(angles, index[-2]))]
    if len(angles) > 1:
        made.append(_maps(data, index, x, angle, force, some(range(len(data.forces)), index[-1])))
    return made


def _maps(data: Data, index: tuple[int, ...], x: int, y: int, over: int, panels: list[int]) -> Block:
    """Panels over two axes, a row for each of ``panels`` along a third one, CCM beside the planar model."""
    models = ("ccm", data.planar)
    unit, factor = shown(data.axes[over].units)
    levels = [f"{data.name(data.axes[over])} {number(data.axes[over].values[p] * factor, 4)} {unit}" for p in panels]
    titles = [f"{plots.MODELS[m][0]}, {level}" for level in levels for m in models]
    height = max(110, min(26 * data.shape[y] + 60, 240))
    total = 110 + height * len(panels)
    gap = min(0.45 * height, 70) / (total - 110) if len(panels) > 1 else 0.1
    made = plots.figure(len(panels), 2, titles, shared_xaxes=True, shared_yaxes=True, horizontal_spacing=0.05,
                        vertical_spacing=min(gap, 0.9 / max(len(panels) - 1, 1)))  # fmt: skip
    (xv, xs), (yv, ys) = ticks(data, x), ticks(data, y)
    notes = _notes(data)
    cuts = [(m, (*index[:over], p, *index[over + 1 :])) for p in panels for m in models]
    for k, (_, here) in enumerate(cuts):
        row, column = k // 2 + 1, k % 2 + 1
        notes = None if notes is None else plane(notes, x, y, here)
        made.add_heatmap(x=xv, y=yv, customdata=notes, coloraxis="coloraxis", hoverongaps=True, row=row, col=column)
        _marks(made, data, plane(data.status, x, y, here), xv, yv, row, column)
    made.update_xaxes(**{k: v for k, v in xs.items() if k != "title_text"}, showgrid=False)
    made.update_xaxes(title_text=xs["title_text"], row=len(panels))
    made.update_yaxes(**{k: v for k, v in ys.items() if k != "title_text"}, showgrid=False)
    made.update_yaxes(title_text=ys["title_text"], col=1)
    buttons = [_button(data, name, cuts, x, y) for name in _names(data)]
    made.update(data=[{key: v[k] for key, v in buttons[0]["args"][0].items()} if t.type == "heatmap" else {}
                      for t, k in zip(made.data, _numbers(made), strict=True)])  # fmt: skip
    heat = [i for i, t in enumerate(made.data) if t.type == "heatmap"]
    for button in buttons:
        button["args"].append(heat)
    made.update_layout(buttons[0]["args"][1], updatemenus=[{"buttons": buttons, "x": 0, "xanchor": "left", "y": 1,
                       "yanchor": "bottom", "pad": {"b": 28}}], margin={"t": 90}, plot_bgcolor=plots.EMPTY,
                       showlegend=False)  # fmt: skip
    name = data.name(data.axes[y])
    where = elsewhere(data, index, x, y, over)
    caption = (
        f"{f'At {where}. ' if where else ''}Choose the quantity at the upper left; point at a cell for its values and"
        " notes. Crosses: failed. Dots: not computed yet."
    )
    alt = f"Maps over {data.name(data.axes[x])} and {name}, CCM and {data.planar}. {extremes(data, index)}"
    return plot(made, caption, alt, total)


def _numbers(made: Any) -> list[int]:
    """Number of every trace among the heat maps."""
    return (np.cumsum([t.type == "heatmap" for t in made.data]) - 1).tolist()


def _names(data: Data) -> list[str]:
    """Maps with values, and the error estimates of the first ones; quality where nothing is known."""
    errors = [f"{name}_error" for name in (*FIRST, "tau_z_max")]
    return [n for n in dict.fromkeys((data.score, *FIRST, *MORE, *errors)) if data.map(n) is not None] or ["quality"]


def _button(data: Data, name: str, cuts: Any, x: int, y: int) -> dict[str, Any]:
    """Entry of the menu that shows a quantity in all panels."""
    text, unit, factor = data.units(name)
    if name.endswith("_error"):
        unit, factor = "%", 100.0
    title = f"{text} [{unit}]" if unit else text
    found = {m: data.map(name, m) for m, _ in cuts}
    z = [np.full((1, 1), np.nan) if found[m] is None else factor * plane(found[m], x, y, here) for m, here in cuts]
    (xl, xu), (yl, yu) = ((data.name(data.axes[a]), shown(data.axes[a].units)[0]) for a in (x, y))
    hover = f"{xl} %{{x}} {xu}, {yl} %{{y}} {yu}<br>{label(title)}: %{{z:.4g}}<br>%{{customdata}}<extra></extra>"
    low, high = plots.span(np.concatenate([a.ravel() for a in z]))
    rows = [None if not np.isfinite(a).any() else np.where(np.isfinite(a), a, None).tolist() for a in z]
    axis = {"colorscale": plots.colours(name), "cmin": low, "cmax": high,
            "colorbar": {"title": {"text": label(title), "side": "right"}, "thickness": 14}}  # fmt: skip
    return {"label": label(title), "method": "update",
            "args": [{"z": rows, "hovertemplate": [hover] * len(rows)}, {"coloraxis": axis}]}  # fmt: skip


def _notes(data: Data) -> np.ndarray | None:
    """State and notes of all cases; None where there are too many for a page."""
    if data.status.size > MOST_REMARKS:
        return None
    words = {DONE: "", FAILED: "failed: ", MISSING: "not computed"}
    found = [label(words[int(data.status[i])] + note(data, i)) for i in np.ndindex(data.shape)]
    return np.array(found, object).reshape(data.shape)


def _marks(made: Any, data: Data, states: np.ndarray, xv: Any, yv: Any, row: int, column: int) -> None:
    for state, symbol in ((FAILED, "x-thin-open"), (MISSING, "circle")):
        i, j = np.nonzero(states == state)
        if i.size:
            look = {"symbol": symbol, "size": 8 if state == FAILED else 3, "color": plots.SOFT}
            made.add_scatter(x=[xv[k] for k in j], y=[yv[k] for k in i], mode="markers", marker=look, hoverinfo="skip",
                             row=row, col=column)  # fmt: skip


def elsewhere(data: Data, index: Sequence[int], *drawn: int) -> str:
    """Where the axes stand that a figure does not show."""
    words = []
    for i, axis in enumerate(data.axes):
        if i not in drawn and data.shape[i] > 1:
            unit, factor = shown(axis.units)
            texts = data.texts(axis)
            value = texts[index[i]] if texts else f"{number(axis.values[index[i]] * factor, 4)} {unit}".rstrip()
            words.append(f"{data.name(axis)} {value}".replace(" °", "°"))
    return ", ".join(words)


def extremes(data: Data, index: tuple[int, ...]) -> str:
    """Ranges of the first maps at the force shown, in words."""
    words = []
    for name in FIRST:
        found = data.map(name)
        if found is not None and np.isfinite(found[..., index[-1]]).any():
            text, unit, factor = data.units(name)
            values = found[..., index[-1]] * factor
            low, high = (np.unravel_index(largest(sign * values), values.shape) for sign in (-1, 1))
            words.append(f"{text} from {number(values[low])} ({data.place((*low, index[-1]))}) to "
                         f"{number(values[high])} {unit} ({data.place((*high, index[-1]))})")  # fmt: skip
    return f"At {number(data.forces[index[-1]])} N {'; '.join(words)}." if words else "No values."


def safe_forces(data: Data, index: tuple[int, ...]) -> Block | None:
    """Safe force range of every candidate: from the minimum holding force to the maximum force before damage."""
    high, low = data.bound("force_high"), data.bound("force_low")
    if high is None or not np.isfinite(high).any() or high.size == 1:
        return None
    x, angle = main_axis(data), len(data.shape) - 2
    panels = some(different_angles(data), index[-2])
    titles = [f"angle {number(np.degrees(data.axes[angle].values[p]), 4)}°" for p in panels]
    made = plots.figure(1, len(panels), titles if data.shape[angle] > 1 else (), shared_yaxes=True)
    values, settings = ticks(data, x)
    for column, p in enumerate(panels, start=1):
        cut = tuple(slice(None) if i == x else (p if i == angle else k) for i, k in enumerate(index[:-1]))
        top, bottom = high[cut], np.zeros(data.shape[x]) if low is None else low[cut]
        good = bottom <= top
        made.add_bar(x=values, y=np.where(good, top - bottom, np.nan), base=bottom, marker_color="#2a8c82", row=1,
                     col=column, hovertemplate="%{x}: %{base:.3g} to %{customdata:.3g} N<extra></extra>",
                     customdata=top)  # fmt: skip
        for bound, symbol in ((bottom, "triangle-up"), (top, "triangle-down")):
            bad = np.isfinite(top) & np.isfinite(bound) & ~good
            look = {"symbol": f"{symbol}-open", "color": plots.INK, "size": 8}
            made.add_scatter(x=[values[k] for k in np.flatnonzero(bad)], y=bound[bad], mode="markers", marker=look,
                             row=1, col=column)  # fmt: skip
    made.update_layout(showlegend=False)
    made.update_xaxes(**settings)
    made.update_yaxes(range=[0, 1.12 * data.forces[-1]])
    made.update_yaxes(title_text="normal force [N]", col=1)
    count = int(np.sum((0 if low is None else low) <= high))
    caption = (
        "Bars: from the minimum holding force (safety factor 1, CCM; zero without a mass) to the maximum force before"
        " the indentation passes what is allowed or the stress the yield strength, by straight lines between solved"
        " forces. No bar: no force is safe; triangles mark what holding takes (up) and what the wall bears (down)."
    )
    return plot(made, caption, f"Safe force ranges: {count} of {high.size} grasps have one.", 300)


def levels(data: Data, index: tuple[int, ...]) -> Block | None:
    """Level at which each candidate's wall was simulated; None where it is nowhere chosen."""
    level, indicator = data.values("effects/object_level"), data.values("effects/object_indicator")
    if not data.walled or level is None or data.grasps == 1:
        return None
    x, y = main_axis(data), len(data.shape) - 2
    top, depth = (plane(_over_forces(f), x, y, index) for f in (level, np.full(data.shape, np.nan) if indicator is None
                                                                else indicator))  # fmt: skip
    (xv, xs), (yv, ys) = ticks(data, x), ticks(data, y)
    steps = [[(i + s) / 3, c] for i, c in enumerate(LEVEL_COLOURS) for s in (0, 1)]
    bar = {"tickvals": [0, 1, 2], "ticktext": list(EFFECTS["object"]), "thickness": 14}
    made = plots.figure()
    z = np.where(np.isfinite(top), top, None).tolist()
    made.add_heatmap(x=xv, y=yv, z=z, zmin=-0.5, zmax=2.5, colorscale=steps, colorbar=bar, customdata=depth,
                     hovertemplate="%{x}, %{y}: level %{z}, indicator %{customdata:.3g}"
                     "<extra></extra>")  # fmt: skip
    made.update_xaxes(**xs).update_yaxes(**ys).update_layout(plot_bgcolor=plots.EMPTY)
    counts = [f"{name}: {int(np.sum(top == k))}" for k, name in enumerate(EFFECTS["object"]) if np.any(top == k)]
    caption = f"Level of the object by candidate ({', '.join(counts)}); point at a cell for its indicator."
    return plot(made, caption, f"Level of the object by candidate: {', '.join(counts)}.", 120 + 34 * min(len(top), 8))


def _over_forces(found: np.ndarray) -> np.ndarray:
    """The one value of a candidate at all its forces; NaN where no force is solved."""
    top = np.where(np.isnan(found), -np.inf, found).max(axis=-1)
    return np.where(np.isfinite(top), top, np.nan)


def effort(data: Data, index: tuple[int, ...]) -> Block | None:
    """Newton iterations, halved load steps and seconds of every candidate, all forces and angles together."""
    x = main_axis(data)
    if data.shape[x] < 2 or data.values("work/newton_iterations") is None:
        return None
    values, settings = ticks(data, x)
    iterations, halvings = (_sums(data, f"work/{name}", x, index) for name in ("newton_iterations", "step_halvings"))
    made = plots.figure(1, 3, ("Newton iterations", "halved load steps", "seconds"))
    made.add_bar(x=values, y=iterations, marker_color=plots.MODELS["ccm"][1], row=1, col=1, showlegend=False)
    made.add_bar(x=values, y=halvings, marker_color=plots.MODELS["ccm"][1], row=1, col=2, showlegend=False)
    for part, colour in zip(PARTS, PART_COLOURS, strict=False):
        made.add_bar(x=values, y=_sums(data, f"work/seconds_{part}", x, index), name=part, marker_color=colour, row=1,
                     col=3)  # fmt: skip
    made.update_layout(barmode="stack", legend={"y": -0.3}).update_xaxes(**settings)
    totals = [number(np.nansum(found), 6) for found in (iterations, halvings)]
    said = f"{totals[0]} Newton iterations and {totals[1]} halved load steps in all"
    caption = f"Sums over all forces and angles, images of a grasp included though they are solved once: {said}."
    return plot(made, caption, f"Effort over {data.name(data.axes[x])}: {said}.", 320)


def _sums(data: Data, path: str, x: int, index: tuple[int, ...]) -> np.ndarray:
    """Sums over forces and angles along the main axis, of two fingers the larger count; NaN where nothing is known."""
    found = data.values(path)
    if found is None:
        return np.full(data.shape[x], np.nan)
    found = found.max(axis=-1) if found.ndim > len(data.shape) else found
    last = len(data.shape) - 2
    cut = tuple(slice(None) if i == x or i >= last else k for i, k in enumerate(index))
    values = found[cut].reshape(data.shape[x], -1)
    return np.where(np.isfinite(values).any(axis=1), np.nansum(values, axis=1), np.nan)
