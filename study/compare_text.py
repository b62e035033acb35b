"""A comparison of two result files as text for a terminal, and as JSON or CSV for programs."""

from __future__ import annotations

import csv
import io
import json
import os
from typing import Any

import numpy as np

from study.columns import DISPLAY
from study.compare import AxisMatch, Comparison
from study.scene.difference import value_text

MOST_SETTINGS = 12
NO_ERRORS = "unknown: no error map; accuracy.meshes = 2 in both scenes gives those of e_n and the friction limits"
BEYOND = {True: "yes", False: "no", None: "unknown"}


def comparison_text(found: Comparison, top: int = 10) -> str:
    """What differs, in lines of at most some 100 letters; the ``top`` largest differences (0: all) case by case."""
    a, b = found.done
    states = [(a & b, "solved in both"), (a & ~b, "only in a"), (~a & b, "only in b"), (~a & ~b, "in neither")]
    counts = ", ".join(f"{int(which.sum())} {words}" for which, words in states if which.any())
    lines = [*(f"{letter}: {file}" for letter, file in zip("ab", found.files, strict=True)), *_settings(found)]
    lines += [f"common cases: {counts}", *(line for axis in found.axes for line in _only(axis))]
    return "\n".join([*lines, "", *_summary(found), "", *_cases(found, top)])


def _settings(found: Comparison) -> list[str]:
    if found.settings is None:
        return ["settings: the scene of a file cannot be read"]
    if not found.settings:
        return ["settings: no difference"]
    rows = [(key, value_text(one), value_text(other)) for key, one, other in found.settings[:MOST_SETTINGS]]
    more = len(found.settings) - len(rows)
    return _table([("setting", "a", "b"), *rows], left=3) + [f"and {more} more settings"] * (more > 0)


def _only(axis: AxisMatch) -> list[str]:
    unit, factor = DISPLAY.get(axis.units, (axis.units, 1.0))
    lines = []
    for letter, values in zip("ab", axis.only, strict=True):
        if len(values):
            texts = [f"{v * factor:.5g}" for v in values]
            texts = texts if len(texts) <= 8 else [*texts[:3], "...", texts[-1], f"({len(texts)} values)"]
            lines.append(f"{axis.name} only in {letter}, left out: {' '.join(texts)} {unit}".rstrip())
    return lines


def _summary(found: Comparison) -> list[str]:
    """One line for each quantity: means, mean and largest difference, how many exceed the errors."""
    rows: list[tuple[str, ...]] = [("quantity", "mean a", "mean b", "mean b-a", "largest b-a", "beyond errors")]
    for d in found.quantities:
        both = np.isfinite(d.change)
        if not both.any():
            continue
        unit, factor = DISPLAY.get(d.units, (d.units, 1.0))
        means = [f"{float(v[both].mean()) * factor:.4g}" for v in d.values]
        judged = [v for v in d.beyond.ravel() if v is not None]
        beyond = f"{sum(judged)} of {len(judged)}" if judged else "unknown"
        largest = np.nanmax(np.abs(d.relative)) if np.isfinite(d.relative).any() else np.nan
        mean = d.change[both].mean() / max(np.abs(d.values[0][both]).mean(), 1e-300)
        rows.append((f"{d.name} [{unit}]" if unit else d.name, *means, _percent(mean), _percent(largest)[1:], beyond))
    if len(rows) == 1:
        return ["no case is solved in both"]
    lines = _table(rows, left=1)
    if any(row[-1] == "unknown" for row in rows):
        lines.append(
            "unknown: no error map; accuracy.meshes = 2 in both scenes gives those of e_n and the friction limits"
        )
    return lines


def _cases(found: Comparison, top: int) -> list[str]:
    d = found.asked
    order = [int(i) for i in np.argsort(-np.abs(np.nan_to_num(d.change.ravel())), kind="stable")]
    order = [i for i in order if np.isfinite(d.change.ravel()[i])]
    shown = order[: top or None]
    if not shown:
        return []
    unit, factor = DISPLAY.get(d.units, (d.units, 1.0))
    axes = [axis for axis in found.axes if len(axis.common) > 1 or axis is found.axes[-1]]
    head = [f"{axis.name} [{DISPLAY.get(axis.units, (axis.units, 1.0))[0]}]".replace(" []", "") for axis in axes]
    rows = [(*head, "a", "b", "b-a", "b-a [%]", "error", "beyond")]
    for i in shown:
        index = np.unravel_index(i, d.change.shape)
        place = [_place(found, axis, index) for axis in axes]
        numbers = [f"{v[index] * factor:.4g}" for v in (*d.values, d.change)]
        error = d.error[index] * factor
        tail = ["-" if np.isnan(error) else f"{error:.2g}", BEYOND[d.beyond[index]]]
        rows.append((*place, *numbers, _percent(d.relative[index]).rstrip(" %"), *tail))
    title = f"{d.name}{f' [{unit}]' if unit else ''}, largest {len(shown)} of {len(order)} differences"
    return [title, *_table(rows)]


def _place(found: Comparison, axis: AxisMatch, index: tuple[Any, ...]) -> str:
    i = index[found.axes.index(axis)]
    if axis is found.axes[-3] and found.labels is not None:
        return str(found.labels[i])
    return f"{axis.common[i] * DISPLAY.get(axis.units, ('', 1.0))[1]:.5g}"


def _table(rows: list[Any], left: int = 0) -> list[str]:
    """Aligned columns, the first ``left`` of them at the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    padded = [
        [c.ljust(w) if n < left else c.rjust(w) for n, (c, w) in enumerate(zip(row, widths, strict=True))]
        for row in rows
    ]
    return ["  ".join(row).rstrip() for row in padded]


def _percent(share: float) -> str:
    return "-" if np.isnan(share) else f"{100 * share:+.2f} %"


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


def comparison_json(found: Comparison, _top: int = 0) -> str:
    """One object: files, settings, axes, and every common case of the quantity, in SI units."""
    axes = {
        x.name: {"units": x.units, "common": _list(x.common), "only_a": _list(x.only[0]), "only_b": _list(x.only[1])}
        for x in found.axes
    }
    changed = found.settings
    settings = None if changed is None else [{"key": key, "a": one, "b": other} for key, one, other in changed]
    names = {letter: os.fspath(file) for letter, file in zip("ab", found.files, strict=True)}
    asked = {"quantity": found.asked.name, "units": found.asked.units, "cases": comparison_rows(found)}
    return json.dumps({"files": names, "settings": settings, "axes": axes, **asked}, indent=2)


def comparison_csv(found: Comparison, _top: int = 0) -> str:
    """One line for each common case of the quantity, SI units in the header."""
    rows, text = comparison_rows(found), io.StringIO()
    units = {x.name: x.units for x in found.axes} | dict.fromkeys(("a", "b", "difference", "error"), found.asked.units)
    writer = csv.writer(text, lineterminator="\n")
    renamed = {"a": f"{found.asked.name} a", "b": f"{found.asked.name} b"}
    writer.writerow([_with_unit(renamed.get(name, name), units.get(name, "")) for name in rows[0]])
    writer.writerows([["" if v is None else v for v in row.values()] for row in rows])
    return text.getvalue().rstrip("\n")


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _list(values: np.ndarray) -> list[float]:
    return values.tolist()


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
