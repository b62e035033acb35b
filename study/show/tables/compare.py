"""Two result files side by side: which settings and cases differ, and which differences exceed the stated errors."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from softjaw.study.case.result import TIE
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.quantities import TABLE, map_row
from softjaw.study.ranking import falling
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import axes_of, mesh_error, values_of
from softjaw.study.scene.text import changes, value_text
from softjaw.study.show.tables.columns import PAPER, aligned, csv_text, digits, head, with_unit, wrapped
from softjaw.study.units import shown, shown_unit

FloatArray = NDArray[np.float64]
ALIKE = 1e-9  # relative difference of coordinates that is only rounding
MOST_SETTINGS, WIDEST_SETTING = 12, 24
BEYOND = {True: "yes", False: "no", None: "-"}


@dataclass(frozen=True)
class AxisMatch:
    """Values of one axis that both files have, at which positions, and those that only one of them has."""

    name: str
    units: str
    common: FloatArray
    at: tuple[NDArray[np.int64], NDArray[np.int64]]
    only: tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class Difference:
    """One quantity of both files over the common axes; NaN where a file has no result.

    ``error`` is the sum of both errors: half-widths of intervals, or else errors of the mesh; NaN where a file does not
    state them. ``stated`` tells of each file whether it has a map of them.
    """

    name: str
    units: str
    values: tuple[FloatArray, FloatArray]
    error: FloatArray
    stated: tuple[bool, bool]

    @property
    def change(self) -> FloatArray:
        """Second file minus first."""
        return self.values[1] - self.values[0]

    @property
    def relative(self) -> FloatArray:
        """Change over the first file's value; NaN where that is 0."""
        base = np.abs(self.values[0])
        return np.divide(self.change, base, out=np.full(base.shape, np.nan), where=base > 0)

    @property
    def beyond(self) -> NDArray[np.object_]:
        """Whether a difference exceeds the errors of both, and `TIE` of the value; None where an error is unknown."""
        found = (np.abs(self.change) > self.error + TIE * np.abs(self.values[0])).astype(object)
        found[~(np.isfinite(self.change) & np.isfinite(self.error))] = None
        return found

    @property
    def exceed(self) -> tuple[int, int]:
        """How many differences exceed the errors, of how many that could be judged."""
        judged = [value for value in self.beyond.ravel() if value is not None]
        return sum(map(bool, judged)), len(judged)


@dataclass(frozen=True)
class Comparison:
    """Two files: their names, settings that differ, the axes, states of the common cases, and the quantities."""

    files: tuple[Path, Path]
    settings: tuple[tuple[str, Any, Any], ...] | None
    axes: tuple[AxisMatch, ...]
    done: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    labels: NDArray[np.str_] | None
    quantities: tuple[Difference, ...]
    asked: Difference


def compare(one: xr.Dataset, other: xr.Dataset, quantity: str = "e_n", model: str = "ccm") -> Comparison:
    """Compare two result files, as `study.result.read.open` gives them.

    Parameters
    ----------
    one, other : xarray.Dataset
    quantity : str
        Map to be listed case by case.
    model : str
        Friction model of all quantities.

    Raises
    ------
    StudyError
        Different kinds of axes, nothing in common, or an unknown quantity.
    """
    pair = (one, other)
    axes = _matched(*pair)
    done = tuple(ds.status.values[_block(axes, i)] == DONE for i, ds in enumerate(pair))
    names = [q.name for q in TABLE if q.group == "maps" and q.name != "flags" and q.name in one and q.name in other]
    if quantity not in names:
        text = f"--quantity: found '{quantity}', expected one that both files have: {', '.join(names)}"
        raise StudyError(USAGE, text)
    found = {name: _difference(pair, axes, name, model) for name in names if map_row(name).rank or name == quantity}
    labels = None if one[axes[-3].name].units else one.label.values[axes[-3].at[0]][:, 0]
    paths = Path(one.file), Path(other.file)
    return Comparison(paths, _settings(*pair), axes, done, labels, tuple(found.values()), found[quantity])


def _settings(one: xr.Dataset, other: xr.Dataset) -> tuple[tuple[str, Any, Any], ...] | None:
    try:
        return tuple(changes(one.scene, other.scene))
    except ValueError:
        return None


def _matched(one: xr.Dataset, other: xr.Dataset) -> tuple[AxisMatch, ...]:
    both = axes_of(one), axes_of(other)
    kinds = [[(axis.name, axis.units) for axis in axes] for axes in both]
    if kinds[0] != kinds[1]:
        words = [", ".join(with_unit(*axis) for axis in kind) for kind in kinds]
        text = f"the maps have different axes: {words[0]} in {one.file}, {words[1]} in {other.file}"
        raise StudyError(USAGE, f"{text}; compare files with the same kind of candidates and the same swept keys")
    axes = tuple(_match(*pair) for pair in zip(*both, strict=True))
    for axis in axes:
        if not len(axis.common):
            here, there = (", ".join(f"{v:.6g}" for v in values[:5]) for values in axis.only)
            text = f"no common {axis.name} [{axis.units or '-'}]: {here} in {one.file}, {there} in {other.file}"
            raise StudyError(USAGE, f"{text}; there is nothing to compare")
    return axes


def _match(one: Any, other: Any) -> AxisMatch:
    scale = max(np.abs(one.values).max(), np.abs(other.values).max(), 1e-300)
    same = np.abs(one.values[:, None] - other.values) <= ALIKE * scale
    if one.options and other.options:  # numbers stand for texts
        same = np.array(one.options)[:, None] == np.array(other.options)
    at = np.nonzero(same)
    only = one.values[~same.any(axis=1)], other.values[~same.any(axis=0)]
    return AxisMatch(one.name, one.units, one.values[at[0]], (at[0], at[1]), only)


def _block(axes: tuple[AxisMatch, ...], i: int) -> tuple[NDArray[np.int64], ...]:
    return np.ix_(*(axis.at[i] for axis in axes))


def _difference(pair: tuple[xr.Dataset, xr.Dataset], axes: tuple[AxisMatch, ...], name: str, model: str) -> Difference:
    values = [values_of(ds, name, model)[_block(axes, i)] for i, ds in enumerate(pair)]
    errors = [_error(ds, name, model) for ds in pair]
    known = [np.full(v.shape, np.nan) if e is None else e[_block(axes, i)]
             for i, (v, e) in enumerate(zip(values, errors, strict=True))]  # fmt: skip
    stated = (errors[0] is not None, errors[1] is not None)
    return Difference(name, map_row(name).unit, (values[0], values[1]), known[0] + known[1], stated)


def _error(ds: xr.Dataset, name: str, model: str) -> FloatArray | None:
    """Error of a map in its unit; None where the file has none, as for models other than CCM."""
    if map_row(name).by_model and model != "ccm":
        return None
    if f"{name}_interval" in ds:
        return values_of(ds, f"{name}_interval")
    return mesh_error(ds, name)


def comparison_text(found: Comparison, top: int = 10, width: int = PAPER) -> str:
    """What differs, in lines of at most ``width`` characters; the ``top`` largest differences (0: all) case by case."""
    a, b = found.done
    states = [(a & b, "solved in both"), (a & ~b, "only in a"), (~a & b, "only in b"), (~a & ~b, "in neither")]
    counts = ", ".join(f"{int(which.sum())} {words}" for which, words in states if which.any())
    lines = [*(f"{letter}: {file}" for letter, file in zip("ab", found.files, strict=True)), *_setting_lines(found)]
    lines += [f"common cases: {counts}"]
    lines += [wrapped(line, width, more="  ") for axis in found.axes for line in _only(axis)]
    tables = [*_summary(found), "", *_cases(found, top)]
    return "\n".join([*lines, "", *tables, wrapped(_verdict(found), width, more="  ")]).rstrip()


def _setting_lines(found: Comparison) -> list[str]:
    if found.settings is None:
        return ["settings: the scene of a file cannot be read"]
    if not found.settings:
        return ["settings: no difference"]
    rows = [(key, *map(_short, map(value_text, pair))) for key, *pair in found.settings[:MOST_SETTINGS]]
    more = len(found.settings) - len(rows)
    return aligned(("setting", "a", "b"), rows, left=range(3)) + [f"and {more} more settings"] * (more > 0)


def _short(text: str) -> str:
    return text if len(text) <= WIDEST_SETTING else f"{text[: WIDEST_SETTING - 3]}..."


def _only(axis: AxisMatch) -> list[str]:
    lines = []
    for letter, values in zip("ab", axis.only, strict=True):
        if len(values):
            texts = [f"{shown(v, axis.units):.5g}" for v in values]
            texts = texts if len(texts) <= 8 else [*texts[:3], "...", texts[-1], f"({len(texts)} values)"]
            lines.append(f"{axis.name} only in {letter}, left out: {' '.join(texts)} {shown_unit(axis.units)}".rstrip())
    return lines


def _summary(found: Comparison) -> list[str]:
    """One line for each quantity: means, mean and largest difference, how many exceed the errors."""
    heads = ("quantity", "mean\na", "mean\nb", "mean b-a\n[%]", "largest\n[%]", "exceed\nerrors")
    rows: list[tuple[str, ...]] = []
    for d in found.quantities:
        both = np.isfinite(d.change)
        if not both.any():
            continue
        means = [digits(shown(float(v[both].mean()), d.units)) for v in d.values]
        largest = np.nanmax(np.abs(d.relative)) if np.isfinite(d.relative).any() else np.nan
        mean = d.change[both].mean() / max(np.abs(d.values[0][both]).mean(), 1e-300)
        exceed, judged = d.exceed
        beyond = f"{exceed} of {judged}" if judged else "-"
        shares = _percent(mean), _percent(largest).lstrip("+")
        rows.append((with_unit(d.name, shown_unit(d.units)), *means, *shares, beyond))
    return aligned(heads, rows, left=[0]) if rows else ["no case is solved in both"]


def _verdict(found: Comparison) -> str:
    """How many differences of the quantity that was asked for exceed the errors; or which file states none."""
    d = found.asked
    solved, (exceed, judged) = int(np.isfinite(d.change).sum()), d.exceed
    silent = " and ".join(letter for letter, states in zip("ab", d.stated, strict=True) if not states)
    if not solved:
        return ""
    if silent:
        states = "states" if len(silent) == 1 else "state"
        text = f"whether the differences exceed the errors is not known: {silent} {states} no error of {d.name}"
        return f"{text}; accuracy.meshes = 2 in a scene gives the errors of e_n and of the friction limits"
    more = f", {solved - judged} could not be judged" * (solved > judged)
    return f"{exceed} of {judged} differences of {d.name} exceed the errors of both files together{more}"


def _cases(found: Comparison, top: int) -> list[str]:
    d = found.asked
    order = [int(i) for i in falling(np.abs(d.change.ravel())) if np.isfinite(d.change.ravel()[i])]
    listed = order[: top or None]
    if not listed:
        return []
    unit = shown_unit(d.units)
    axes = [axis for axis in found.axes if len(axis.common) > 1 or axis is found.axes[-1]]
    heads = [head(axis.name, shown_unit(axis.units)) for axis in axes]
    heads += [*(head(name, unit) for name in ("a", "b", "b-a")), head("b-a", "%")]
    judged = any(d.exceed)
    heads += [head("errors", unit), "exceeds\nerrors"] * judged
    rows = []
    for i in listed:
        index = np.unravel_index(i, d.change.shape)
        numbers = [digits(shown(float(v[index]), d.units)) for v in (*d.values, d.change)]
        error = shown(float(d.error[index]), d.units)
        tail = ["-" if np.isnan(error) else f"{error:.2g}", BEYOND[d.beyond[index]]] * judged
        rows.append((*(_place(found, axis, index) for axis in axes), *numbers, _percent(d.relative[index]), *tail))
    title = f"{with_unit(d.name, unit)}: {len(listed)} of {len(order)} differences, the largest first"
    return [title, *aligned(heads, rows), ""]


def _place(found: Comparison, axis: AxisMatch, index: tuple[Any, ...]) -> str:
    i = index[found.axes.index(axis)]
    if axis is found.axes[-3] and found.labels is not None:
        return str(found.labels[i])
    return f"{shown(axis.common[i], axis.units):.5g}"


def _percent(share: float) -> str:
    if np.isnan(share):
        return "-"
    return text if float(text := f"{100 * share:+.2f}") else "0.00"


def comparison_rows(found: Comparison) -> list[dict[str, Any]]:
    """All common cases of the quantity that was asked for, in SI units; None is not there."""
    d, rows = found.asked, []
    for index in np.ndindex(d.change.shape):
        place: dict[str, Any] = {x.name: float(x.common[i]) for x, i in zip(found.axes, index, strict=True)}
        if found.labels is not None:
            place["label"] = str(found.labels[index[-3]])
        numbers = {"a": d.values[0], "b": d.values[1], "difference": d.change, "relative": d.relative, "error": d.error}
        rows.append(place | {name: _plain(v[index]) for name, v in numbers.items()} | {"beyond_error": d.beyond[index]})
    return rows


def comparison_json(found: Comparison) -> str:
    """One object: files, settings, axes, counts for every quantity, and every common case of one, in SI units."""
    axes = {
        x.name: {"units": x.units, "common": x.common.tolist(), "only_a": x.only[0].tolist(),
                 "only_b": x.only[1].tolist()}
        for x in found.axes
    }  # fmt: skip
    changed = found.settings
    settings = None if changed is None else [{"key": key, "a": one, "b": other} for key, one, other in changed]
    names = {letter: os.fspath(file) for letter, file in zip("ab", found.files, strict=True)}
    asked = {"quantity": found.asked.name, "units": found.asked.units, "cases": comparison_rows(found)}
    counts = {"summary": {d.name: _counts(d) for d in found.quantities}}
    return json.dumps({"files": names, "settings": settings, "axes": axes} | counts | asked, indent=2)


def _counts(d: Difference) -> dict[str, int]:
    exceed, judged = d.exceed
    return {"compared": int(np.isfinite(d.change).sum()), "judged": judged, "beyond_error": exceed}


def comparison_csv(found: Comparison) -> str:
    """One line for each common case of the quantity, SI units in the header."""
    rows = comparison_rows(found)
    units = {x.name: x.units for x in found.axes} | dict.fromkeys(("a", "b", "difference", "error"), found.asked.units)
    renamed = {"a": f"{found.asked.name} a", "b": f"{found.asked.name} b"}
    names = [with_unit(renamed.get(name, name), units.get(name, "")) for name in rows[0]]
    return csv_text([names, *(list(row.values()) for row in rows)])


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
