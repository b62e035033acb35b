"""The best grasps of a result file, as a table for people and as JSON or CSV for programs."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from study.layout import DONE

DISPLAY = {"m": ("mm", 1e3), "rad": ("deg", 180.0 / np.pi)}  # what people read; programs get SI
COLUMNS = (
    ("quality", "curved"),
    ("e_n", "curved"),
    ("e_n", "planar"),
    ("f_x_max", "curved"),
    ("f_y_max", "curved"),
    ("tau_z_max", "curved"),
)
FLAGS = (  # as study.quantities defines them
    (1, "no torque", "a contact carries no torque about its normal"),
    (2, "no force", "a contact carries no force along one of its axes"),
    (8, "hole", "the centre of pressure lies over a hole of the patch"),
    (4 + 16 + 32 + 64, "frame", "the contact frame came from a rule for degenerate patches"),
    (256, "approx.", "contacts more than 5 deg from antipodal, where the score's closed form is an approximation"),
    (512, "nodal", "solved with nodal gaps, because weighted ones had no solution"),
)
UNITS = {"quality": "", "e_n": "m", "f_x_max": "N", "f_y_max": "N", "tau_z_max": "N m", "e_n_error": ""}


@dataclass(frozen=True)
class Table:
    """Grasps in the order of their quality: names and units of the columns, and the rows."""

    title: str
    columns: tuple[tuple[str, str], ...]
    rows: tuple[tuple[Any, ...], ...]


def best(result: Any, force: float | None = None, top: int = 10) -> Table:
    """The ``top`` grasps (0: all) at the force level nearest to ``force`` [N], by default at the highest one."""
    forces = result.axes[-1].values
    k = len(forces) - 1 if force is None else int(np.abs(forces - force).argmin())
    planar = result.layout.planar
    columns = [(name, planar if model == "planar" else model) for name, model in COLUMNS]
    maps = {column: result.map(*column)[..., k].ravel() for column in columns}
    score = maps[columns[0]] if np.isfinite(maps[columns[0]]).any() else maps[columns[1]]
    done = np.flatnonzero(result.status[..., k].ravel() == DONE)
    order = done[np.argsort(-np.nan_to_num(score[done], nan=-np.inf), kind="stable")][: top or None]
    extra = [("e_n_error", "")] if result.layout.meshes > 1 else []
    error = result.map("e_n_error")[..., k].ravel() if extra else None
    flags = np.nan_to_num(result.map("flags")[..., k].ravel())
    labels = np.broadcast_to(result.labels, result.layout.shape[:-1]).ravel()
    named = [] if result.axes[-3].units else [("label", "")]  # explicit poses are numbered and have names
    rows = []
    for rank, i in enumerate(order, start=1):
        index = np.unravel_index(i, result.layout.shape[:-1])
        place = [float(axis.values[j]) for axis, j in zip(result.axes[:-1], index, strict=True)]
        values = [float(column[i]) for column in maps.values()]
        errors = [] if error is None else [float(error[i])]
        rows.append((rank, *place, *values, *errors, int(flags[i]), *([str(labels[i])] * len(named))))
    head = [(axis.name, axis.units) for axis in result.axes[:-1]]
    quantities = [(name if model == "curved" else f"{name}_{model}", UNITS[name]) for name, model in columns]
    columns = (("rank", ""), *head, *quantities, *extra, ("flags", ""), *named)
    nearest = "" if force is None or np.isclose(force, forces[k]) else f", the level nearest to {force:g} N"
    what = f"best {len(rows)} of {len(done)} solved candidates" if rows else "no candidate is solved"
    return Table(f"{what} at {forces[k]:g} N{nearest}", columns, tuple(rows))


def as_text(table: Table) -> str:
    """Aligned columns, lengths in mm and angles in degrees; images of one grasp share a line, flags are words."""
    if not table.rows:
        return table.title
    shown = [DISPLAY.get(units, (units, 1.0)) for _, units in table.columns]
    names = [name for name, _ in table.columns]
    head = [f"{name} [{unit}]" if unit else name for name, (unit, _) in zip(names, shown, strict=True)]
    body: list[list[str]] = []
    for row in table.rows:
        cells = [_cell(v, factor) for v, (_, factor) in zip(row, shown, strict=True)]
        cells[names.index("flags")] = _words(row[names.index("flags")])
        if body and _without_place(cells, names) == _without_place(body[-1], names):
            for name in ("rank", "angle"):
                body[-1][names.index(name)] += f", {cells[names.index(name)]}"
        else:
            body.append(cells)
    widths = [max(map(len, column)) for column in zip(head, *body, strict=True)]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in [head, *body]]
    legend = [
        f"{word}: {meaning}" for _, word, meaning in FLAGS if any(word in row[-1 - ("label" in names)] for row in body)
    ]
    return "\n".join([table.title, *lines, *legend])


def _without_place(cells: list[str], names: list[str]) -> list[str]:
    return [cell for cell, name in zip(cells, names, strict=True) if name not in ("rank", "angle")]


def _words(flags: int) -> str:
    """Words for the flags of a case, as `FLAGS` explains them."""
    return ", ".join(word for mask, word, _ in FLAGS if flags & mask)


def as_json(table: Table) -> str:
    """One object with the title, the units (SI) and a list of grasps; what is not there is null."""
    names = [name for name, _ in table.columns]
    rows = [dict(zip(names, map(_plain, row), strict=True)) for row in table.rows]
    return json.dumps({"title": table.title, "units": dict(table.columns), "grasps": rows}, indent=2)


def as_csv(table: Table) -> str:
    """One line for each grasp, SI units in the header."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f"{name} [{units}]" if units else name for name, units in table.columns])
    writer.writerows([["" if _plain(v) is None else v for v in row] for row in table.rows])
    return text.getvalue().rstrip("\n")


def place(result: Any, row: int) -> str:
    """A case in words: ``station 12 mm, angle 90 deg, normal_force 5 N``."""
    index = np.unravel_index(row, result.layout.shape)
    words = []
    for axis, i in zip(result.axes, index, strict=True):
        unit, factor = DISPLAY.get(axis.units, (axis.units, 1.0))
        words.append(f"{axis.name} {axis.values[i] * factor:.5g} {unit}".rstrip())
    return ", ".join(words)


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _cell(value: Any, factor: float) -> str:
    if isinstance(value, float):
        return "-" if np.isnan(value) else f"{value * factor:.4g}"
    return str(value)
