"""Patches from tables: one line per face, named columns that carry their units."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softjaw.friction.patch import FloatArray
from softjaw.study.messages import OTHER_FILE, StudyError, shortened
from softjaw.study.patch.columns import CENTRE, CORNERS, NORMAL, UNITS, Column, used_columns
from softjaw.study.patch.faces import Faces, corner_geometry, refuse
from softjaw.study.patch.reading import Reading, check_count
from softjaw.study.scene.problems import Problem, shown

MINIMAL = "x_mm, y_mm, z_mm, area_mm2, nx, ny, nz, pressure_kpa, or corners x1_mm ... z4_mm with pressure_kpa"
OPTION = {"length": "--unit", "area": "--unit", "pressure": "--pressure-unit"}


@dataclass(frozen=True)
class Table:
    """Lines of a table: the number of each in the file, and its cells."""

    file: str
    headers: list[str]
    numbers: list[int]
    cells: list[list[str]]


def read_table(path: Path, reading: Reading) -> Faces:
    """Faces of a CSV file: centre, area and normal of each, or its corners; everything wrong with it at once."""
    table = _lines(path)
    columns, others = used_columns(table.headers, reading.pressure_name)
    by_name = {c.name: c for c in columns}
    refuse([*_twice(table, columns), *_missing(table, by_name, others, reading)])
    with_corners = CORNERS[0] in by_name
    needed = [by_name[name] for name in _needed(by_name)]
    refuse(_without_unit(table, needed, reading))
    values = _numbers(table, needed, reading)
    number = table.numbers
    unused = [c.header for c in columns if c not in needed] + others
    notes = (f"not used of {table.file}: {', '.join(unused)}",) if unused else ()

    def of(names: Sequence[str]) -> FloatArray:
        return np.stack([values[name] for name in names], axis=-1)

    if not with_corners:
        geometry = of(CENTRE), values["area"], of(NORMAL)
        corners = None
    else:
        corners = of([name for name in CORNERS if name in values]).reshape(len(number), -1, 3)
        if corners.shape[1] == 4:  # a triangle leaves its fourth corner empty
            corners[:, 3] = np.where(np.isnan(corners[:, 3]).all(axis=1)[:, None], corners[:, 2], corners[:, 3])
        centroid, area, normal = corner_geometry(corners)
        geometry = centroid, area, of(NORMAL) if NORMAL[0] in values else normal
    return Faces(table.file, lambda i: f"line {number[i]}", *geometry, values["pressure"], corners, notes)


def _lines(path: Path) -> Table:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise StudyError(OTHER_FILE, f"{path}: is no text file; export the patch as CSV, VTU or VTP") from error
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        found, expected = "one line" if lines else "an empty file", "a line of column names and one line per face"
        refuse([Problem(str(path), None, "", found, expected, f"write {MINIMAL}")])
    marks = {mark: lines[0][1].count(mark) for mark in ",;\t"}
    check_count(str(path), len(lines) - 1)
    rows = []
    for number, line in lines:  # one by one: no quotation mark may swallow the lines behind it
        try:
            rows += csv.reader([line], delimiter=max(marks, key=marks.__getitem__), strict=True)
        except csv.Error as error:
            remedy = "write numbers with a decimal point, without quotation marks"
            refuse([Problem(str(path), number, "", f"a line that is no table ({error})", "cells", remedy)])
    return Table(str(path), rows[0], [k for k, _ in lines[1:]], rows[1:])


def _needed(by_name: dict[str, Column]) -> list[str]:
    """Quantities that are read: corners and what goes with them if there are any."""
    normal = [name for name in NORMAL if name in by_name]
    if CORNERS[0] in by_name:
        fourth = [name for name in CORNERS[9:] if name in by_name]
        return [*CORNERS[:9], *fourth, *normal, "pressure"]
    return [*CENTRE, "area", *NORMAL, "pressure"]


def _missing(table: Table, by_name: dict[str, Column], others: list[str], reading: Reading) -> list[Problem]:
    names = _needed(by_name)
    if any(name in by_name for name in CORNERS[9:]):
        names = [*names, *CORNERS[9:]]
    if CORNERS[0] in by_name and any(name in by_name for name in NORMAL):
        names = [*names, *NORMAL]
    absent = [name for name in dict.fromkeys(names) if name not in by_name]
    if not absent:
        return []
    if all(map(_is_number, table.headers)):
        remedy = f"name the columns in the first line, for example {MINIMAL}"
        return [Problem(table.file, 1, "", "numbers and no column names", "column names", remedy)]
    remedy = f"name the columns, for example {MINIMAL}"
    if absent == ["pressure"]:
        named = f"called {reading.pressure_name}" if reading.pressure_name else "named pressure"
        remedy = f"no column is {named}: give the column's name with --pressure-name"
    if others:
        remedy += f" (known units: {', '.join(unit for kind in OPTION for unit in UNITS[kind])})"
    found = f"the columns {shortened(', '.join(h.strip() for h in table.headers), 300)}"
    return [Problem(table.file, 1, "", found, f"also {', '.join(absent)}", remedy)]


def _twice(table: Table, columns: list[Column]) -> list[Problem]:
    seen: dict[str, Column] = {}
    problems = []
    for column in columns:
        if column.name in seen:
            both = f"{seen[column.name].header} and {column.header}"
            problems.append(Problem(table.file, 1, column.name, both, "one column for it", "remove one of the two"))
        seen[column.name] = column
    return problems


def _without_unit(table: Table, needed: list[Column], reading: Reading) -> list[Problem]:
    problems = []
    for kind in ("length", "area", "pressure"):
        bare = [c.header for c in needed if c.kind == kind and c.unit is None]
        if bare and reading.unit_of(kind) is None:
            option, unit = OPTION[kind], {"length": "mm", "area": "mm2", "pressure": "kpa"}[kind]
            value = "mm" if kind != "pressure" else "kpa"
            remedy = f"write {bare[0]}_{unit}, or add {option} {value}: units are not guessed"
            problems.append(Problem(table.file, 1, ", ".join(bare), "no unit", f"a unit of {kind}", remedy))
    return problems


def _numbers(table: Table, needed: list[Column], reading: Reading) -> dict[str, FloatArray]:
    """Values of the needed columns in SI units."""
    problems = []
    values = np.empty((len(needed), len(table.cells)))
    for i, (line, cells) in enumerate(zip(table.numbers, table.cells, strict=True)):
        if len(cells) != len(table.headers):
            found, expected = f"{len(cells)} cells", f"{len(table.headers)} as in the line of names"
            remedy = "complete the line; write numbers with a decimal point, not a comma"
            problems.append(Problem(table.file, line, "", found, expected, remedy))
            continue
        for j, column in enumerate(needed):
            cell = cells[column.position].strip()
            if not cell and column.name in CORNERS[9:]:
                values[j, i] = np.nan
            elif not _is_number(cell):
                found = shown(cell) if cell else "an empty cell"
                comma = "," in cell and "." not in cell
                remedy = "write a decimal point" if comma else "repair the cell or leave the face out"
                problems.append(Problem(table.file, line, column.header, found, "a finite number", remedy))
            else:
                values[j, i] = float(cell)
    refuse(problems)
    factors = [UNITS[c.kind][c.unit or reading.unit_of(c.kind) or "-"] for c in needed]
    with np.errstate(over="ignore"):  # what is not finite is told of with its place
        return {c.name: factor * row for c, factor, row in zip(needed, factors, values, strict=True)}


def _is_number(cell: str) -> bool:
    try:
        return bool(np.isfinite(float(cell)))
    except ValueError:
        return False
