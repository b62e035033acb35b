"""The best grasps of a result file, as a table for people and as JSON or CSV for programs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from study.layout import DONE
from study.ranking import BORNE, FLAGS, OF_FILE, borne_level, judged, ranking

DISPLAY = {"m": ("mm", 1e3), "rad": ("deg", 180.0 / np.pi), "Pa": ("MPa", 1e-6)}  # people read this; programs get SI
COLUMNS = (  # map, friction model ("" where it has none), unit
    ("quality", "curved", ""),
    ("quality_fitted", "curved", ""),
    ("misfit", "", ""),
    ("e_n", "curved", "m"),
    ("e_n", "planar", "m"),
    ("f_x_max", "curved", "N"),
    ("f_y_max", "curved", "N"),
    ("tau_z_max", "curved", "N m"),
)
SOMETIMES = (  # columns of files that have the map
    ("safety_factor", "curved", ""),
    ("dent", "", "m"),
    ("wall_stress", "", "Pa"),
    ("e_n_error", "", ""),
)
WINDOW = ("force_low", "force_high")  # derived bounds; people see them in one column
WINDOW_MEANS = "normal forces that hold the object, if its mass is given, and that its wall bears, as far as was solved"
# names that are too long for a line of text
HEADS = {"quality_fitted": "fitted", "safety_factor": "safety", "wall_stress": "stress"}
Columns = tuple[tuple[str, str], ...]  # names and units


@dataclass(frozen=True)
class Table:
    """Grasps in the order of their quality at one force [N]: names and units of the columns, and the rows."""

    title: str
    columns: Columns
    rows: tuple[tuple[Any, ...], ...]
    force: float


def best(result: Any, force: float | None = None, top: int = 10, whole_lines: bool = False) -> Table:
    """The ``top`` grasps (0: all) at the force level nearest to ``force`` [N].

    The default is the highest level, or the highest at which a grasp is within its window of forces where there is one.
    With ``whole_lines`` images of one grasp, which share a line of `as_text`, count as one.
    """
    forces, flags = result.axes[-1].values, judged(result)
    k, why = _level(result, flags, force)
    maps = {(name, units): found[..., k].ravel() for name, units, found in _maps(result)}
    score = next(maps[c] for c in (("quality", ""), ("e_n", "m")) if c[0] == "e_n" or np.isfinite(maps[c]).any())
    done = np.flatnonzero(result.status[..., k].ravel() == DONE)
    flags = flags[..., k].ravel()
    order = done[ranking(score[done], flags[done])]
    labels = np.broadcast_to(result.labels, result.layout.shape[:-1]).ravel()
    named = [("label", "")] if has_poses(result) else []
    head = [(axis.name, axis.units) for axis in result.axes[:-1]]
    maps |= {(name, "N"): bound.ravel() for name, bound in _window(result).items()}
    titles = (("rank", ""), *head, *maps, ("flags", ""), *named)

    def row(rank: int, i: int) -> tuple[Any, ...]:
        index = np.unravel_index(i, result.layout.shape[:-1])
        place = [float(axis.values[j]) for axis, j in zip(result.axes[:-1], index, strict=True)]
        values = [float(column[i]) for column in maps.values()]
        return (rank, *place, *values, int(flags[i]), *([str(labels[i])] * len(named)))

    rows = _first((row(rank, i) for rank, i in enumerate(order, start=1)), top, titles if whole_lines else ())
    what = f"best {len(rows)} of {len(done)} solved candidates" if rows else "no candidate is solved"
    return Table(f"{what} at {forces[k]:g} N{why}", titles, tuple(rows), float(forces[k]))


def _level(result: Any, flags: np.ndarray, force: float | None) -> tuple[int, str]:
    """Number of the force level that is shown, and why where that is not plain."""
    forces = result.axes[-1].values
    if force is not None:
        k = int(np.abs(forces - force).argmin())
        return k, "" if np.isclose(force, forces[k]) else f", the level nearest to {force:g} N"
    k = borne_level(result.status, flags) if (flags & BORNE).any() else None
    if k is None or k == len(forces) - 1:
        return len(forces) - 1, ""
    return k, ", the highest that a grasp holds and its wall bears"


def _window(result: Any) -> dict[str, np.ndarray]:
    """Derived bounds of the forces, over all axes but the force."""
    there = {d.name for d in getattr(result.layout, "derived", ())}
    return {name: result.derived(name) for name in WINDOW if name in there}


def _maps(result: Any) -> Iterator[tuple[str, str, np.ndarray]]:
    """Name, unit and values of the columns between the place and the flags."""
    there = {q.name for q in result.layout.quantities}
    for name, model, units in (*COLUMNS, *(column for column in SOMETIMES if column[0] in there)):
        model = result.layout.planar if model == "planar" else model
        yield f"{name}_{model}" if model not in ("", "curved") else name, units, result.map(name, model or None)


def _first(rows: Iterable[tuple[Any, ...]], top: int, columns: Columns) -> list[tuple[Any, ...]]:
    """The first ``top`` rows (0: all), or all rows of the first ``top`` lines if the columns of the text are given."""
    taken: list[tuple[Any, ...]] = []
    lines = 0
    for row in rows:
        lines += not (columns and taken and _alike(row, taken[-1], columns))
        if top and lines > top:
            break
        taken.append(row)
    return taken


def as_text(table: Table) -> str:
    """Aligned columns, lengths in mm and angles in degrees; images of one grasp share a line, flags are words."""
    if not table.rows:
        return table.title
    table = _for_people(table)
    shown = [DISPLAY.get(units, (units, 1.0)) for _, units in table.columns]
    names, flags = [name for name, _ in table.columns], 0
    short = [HEADS.get(name, name) for name in names]
    head = [f"{name} [{unit}]" if unit else name for name, (unit, _) in zip(short, shown, strict=True)]
    body: list[list[str]] = []
    for before, row in zip((None, *table.rows), table.rows, strict=False):
        cells = _cells(row, table.columns)
        flags |= row[names.index("flags")]
        if before is not None and _alike(row, before, table.columns):
            for name in ("rank", "angle"):
                body[-1][names.index(name)] += f", {cells[names.index(name)]}"
        else:
            body.append(cells)
    widths = [max(map(len, column)) for column in zip(head, *body, strict=True)]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in [head, *body]]
    legend = [f"{word}: {meaning}" for mask, word, meaning in FLAGS if flags & mask]
    legend += [f"window: {WINDOW_MEANS}"] * ("window" in names)
    return "\n".join([table.title, *lines, *legend])


def _for_people(table: Table) -> Table:
    """Both bounds of the window of forces in one column of text."""
    at = [i for i, (name, _) in enumerate(table.columns) if name in WINDOW]
    if not at:
        return table

    def merged(row: tuple[Any, ...], one: Any) -> tuple[Any, ...]:
        return (*row[: at[0]], one, *row[at[-1] + 1 :])

    names = [table.columns[i][0] for i in at]
    rows = tuple(merged(row, _window_text(dict(zip(names, (row[i] for i in at), strict=True)))) for row in table.rows)
    return replace(table, columns=merged(table.columns, ("window", "N")), rows=rows)


def _window_text(bounds: dict[str, float]) -> str:
    """The window of forces as people read it.

    >>> _window_text({"force_low": 0.8, "force_high": 2.5}), _window_text({"force_high": 2.5})
    ('0.8..2.5', '..2.5')
    >>> _window_text({"force_low": 3.0, "force_high": 2.5}), _window_text({"force_low": np.nan})
    ('none', '-')
    """
    low, high = (bounds.get(name, np.nan) for name in WINDOW)
    if np.isnan([*bounds.values()]).all():
        return "-"
    if "force_low" in bounds and "force_high" in bounds and not low <= high:
        return "none"
    return "..".join("" if np.isnan(bound) else f"{bound:.3g}" for bound in (low, high))


def _cells(row: tuple[Any, ...], columns: Columns) -> list[str]:
    """A row as people read it."""
    factors = [DISPLAY.get(units, (units, 1.0))[1] for _, units in columns]
    pairs = zip(row, factors, columns, strict=True)
    return [_words(value) if name == "flags" else _cell(value, factor) for value, factor, (name, _) in pairs]


def _alike(row: tuple[Any, ...], other: tuple[Any, ...], columns: Columns) -> bool:
    """Whether two grasps differ in their angle only, as far as a line of text tells."""
    kept = [i for i, (name, _) in enumerate(columns) if name not in ("rank", "angle")]
    one, two = _cells(row, columns), _cells(other, columns)
    return all(one[i] == two[i] for i in kept)


def has_poses(result: Any) -> bool:
    """Whether the candidates are explicit poses: those are numbered along the axis of stations, and have labels."""
    return not result.axes[-3].units


def _words(flags: int) -> str:
    """Words for the flags of a case, as `FLAGS` explains them."""
    return ", ".join(word for mask, word, _ in FLAGS if flags & mask)


def as_json(table: Table) -> str:
    """One object with the title, the force [N], the units (SI) and a list of grasps; what is not there is null."""
    names = [name for name, _ in table.columns]
    rows = [dict(zip(names, map(_plain, row), strict=True)) for row in table.rows]
    told = {"title": table.title, "force": table.force, "units": dict(table.columns), "grasps": rows}
    return json.dumps(told, indent=2)


def as_csv(table: Table) -> str:
    """One line for each grasp, SI units in the header."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f"{name} [{units}]" if units else name for name, units in table.columns])
    writer.writerows([["" if _plain(v) is None else v for v in row] for row in table.rows])
    return text.getvalue().rstrip("\n")


def place(result: Any, row: int) -> str:
    """A case in words: ``station 12 mm, angle 90 deg, normal_force 5 N``; an explicit pose by its label."""
    index = np.unravel_index(row, result.layout.shape)
    words = []
    label = f'"{result.labels[index[-3:-1]]}"' if has_poses(result) else ""
    for axis, i in zip(result.axes, index, strict=True):
        if label and axis.name in ("station", "angle"):
            words += [label] * (axis.name == "station")
            continue
        unit, factor = DISPLAY.get(axis.units, (axis.units, 1.0))
        words.append(f"{axis.name} {axis.values[i] * factor:.5g} {unit}".rstrip())
    return ", ".join(words)


def _plain(value: Any) -> Any:
    """A value for programs; flags, the only integers but ranks, as the file has them."""
    if isinstance(value, int):
        return value & OF_FILE
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _cell(value: Any, factor: float) -> str:
    if isinstance(value, float):
        return "-" if np.isnan(value) else f"{value * factor:.4g}"
    return str(value)
