"""A comparison of two result files as text for a terminal, and as JSON or CSV for programs."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from softjaw.study.scene.text import value_text
from softjaw.study.show.tables.columns import PAPER, aligned, csv_text, digits, two_lines, with_unit, wrapped
from softjaw.study.show.tables.compare import AxisMatch, Comparison, Difference
from softjaw.study.show.tables.ranking import falling
from softjaw.study.units import shown, shown_unit

MOST_SETTINGS, WIDEST_SETTING = 12, 24
BEYOND = {True: "yes", False: "no", None: "-"}


def comparison_text(found: Comparison, top: int = 10, width: int = PAPER) -> str:
    """What differs, in lines of at most ``width`` letters; the ``top`` largest differences (0: all) case by case."""
    a, b = found.done
    states = [(a & b, "solved in both"), (a & ~b, "only in a"), (~a & b, "only in b"), (~a & ~b, "in neither")]
    counts = ", ".join(f"{int(which.sum())} {words}" for which, words in states if which.any())
    lines = [*(f"{letter}: {file}" for letter, file in zip("ab", found.files, strict=True)), *_settings(found)]
    lines += [f"common cases: {counts}"]
    lines += [wrapped(line, width, more="  ") for axis in found.axes for line in _only(axis)]
    tables = [*_summary(found), "", *_cases(found, top)]
    return "\n".join([*lines, "", *tables, wrapped(_verdict(found), width, more="  ")]).rstrip()


def _settings(found: Comparison) -> list[str]:
    if found.settings is None:
        return ["settings: the scene of a file cannot be read"]
    if not found.settings:
        return ["settings: no difference"]
    rows = [(key, *map(_short, map(value_text, pair))) for key, *pair in found.settings[:MOST_SETTINGS]]
    more = len(found.settings) - len(rows)
    return aligned([("setting", "a", "b"), *rows], left=range(3)) + [f"and {more} more settings"] * (more > 0)


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
    rows: list[tuple[str, ...]] = [
        ("", "mean", "mean", "mean b-a", "largest", "exceed"),
        ("quantity", "a", "b", "[%]", "[%]", "errors"),
    ]
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
    return aligned(rows, left=[0]) if len(rows) > 2 else ["no case is solved in both"]


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
    heads = [two_lines(axis.name, shown_unit(axis.units)) for axis in axes]
    heads += [two_lines(name, unit) for name in ("a", "b", "b-a")] + [("b-a", "[%]")]
    judged = any(d.exceed)
    heads += [two_lines("errors", unit), ("exceeds", "errors")] * judged
    rows = []
    for i in listed:
        index = np.unravel_index(i, d.change.shape)
        numbers = [digits(shown(float(v[index]), d.units)) for v in (*d.values, d.change)]
        error = shown(float(d.error[index]), d.units)
        tail = ["-" if np.isnan(error) else f"{error:.2g}", BEYOND[d.beyond[index]]] * judged
        rows.append((*(_place(found, axis, index) for axis in axes), *numbers, _percent(d.relative[index]), *tail))
    title = f"{with_unit(d.name, unit)}: {len(listed)} of {len(order)} differences, the largest first"
    return [title, *aligned([*zip(*heads, strict=True), *rows]), ""]


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
    head = [with_unit(renamed.get(name, name), units.get(name, "")) for name in rows[0]]
    return csv_text([head, *(list(row.values()) for row in rows)])


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
