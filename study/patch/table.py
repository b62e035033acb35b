"""Patches from tables: one line per face, named columns that carry their units."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.friction.patch import FloatArray
from softjaw.study.messages import OTHER_FILE, StudyError, shortened
from softjaw.study.patch.reading import (
    CENTRE,
    CORNERS,
    FACTORS,
    KINDS,
    NORMAL,
    Faces,
    Reading,
    check_count,
    corner_geometry,
    refuse,
    split_header,
)
from softjaw.study.scene.problems import Problem, shown

MINIMAL = "x_mm, y_mm, z_mm, area_mm2, nx, ny, nz, pressure_kpa, or corners x1_mm ... z4_mm with pressure_kpa"


def read_table(path: Path, reading: Reading) -> Faces:
    """Faces of a CSV file with one face per line: centre, area and normal of each, or its corners."""
    numbers, (headers, *cells) = _rows(path)
    found = [split_header(header, reading.pressure_name) for header in headers]
    position = {pair[0]: i for i, pair in enumerate(found) if pair}
    refuse([*_twice(path, headers, found), *_missing(path, headers, position, reading)])
    needed = _needed(position)
    units = {name: found[position[name]][1] or reading.unit_of(KINDS[name]) for name in needed}
    refuse(_without_unit(path, {name: headers[position[name]].strip() for name in needed if units[name] is None}))
    values = _numbers(path, numbers[1:], cells, headers, {name: position[name] for name in needed})
    with np.errstate(over="ignore"):  # what is not finite is reported with its place
        values = {name: FACTORS[KINDS[name]][units[name]] * row for name, row in values.items()}
    unused = [h.strip() for pair, h in zip(found, headers, strict=True) if pair and pair[0] not in needed]
    unused += [h.strip() for pair, h in zip(found, headers, strict=True) if pair is None]
    notes = (f"not used of {path}: {', '.join(unused)}",) if unused else ()

    def stacked(names: Sequence[str]) -> FloatArray:
        return np.stack([values[name] for name in names], axis=-1)

    corners = None
    if CORNERS[0] not in values:
        geometry = stacked(CENTRE), values["area"], stacked(NORMAL)
    else:
        corners = stacked([name for name in CORNERS if name in values]).reshape(len(cells), -1, 3)
        if corners.shape[1] == 4:  # a triangle leaves its fourth corner empty
            corners[:, 3] = np.where(np.isnan(corners[:, 3]).all(axis=1)[:, None], corners[:, 2], corners[:, 3])
        centroid, area, normal = corner_geometry(corners)
        geometry = centroid, area, stacked(NORMAL) if NORMAL[0] in values else normal
    return Faces(str(path), lambda i: f"line {numbers[i + 1]}", *geometry, values["pressure"], corners, notes)


def _rows(path: Path) -> tuple[list[int], list[list[str]]]:
    """Numbers of the lines that are neither empty nor comments, and their cells."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise StudyError(OTHER_FILE, f"{path}: is no text file; export the patch as CSV, VTU or VTP") from error
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        found, expected = "one line" if lines else "an empty file", "a line of column names and one line per face"
        refuse([Problem(str(path), None, "", found, expected, f"write {MINIMAL}")])
    check_count(path, len(lines) - 1)
    mark = max(",;\t", key=lines[0][1].count)
    rows = []
    for number, line in lines:  # one by one: no quotation mark may swallow the lines behind it
        try:
            rows += csv.reader([line], delimiter=mark, strict=True)
        except csv.Error as error:
            remedy = "write numbers with a decimal point, without quotation marks"
            refuse([Problem(str(path), number, "", f"a line that is no table ({error})", "cells", remedy)])
    return [k for k, _ in lines], rows


def _needed(names: Any) -> list[str]:
    """Quantities that are read: corners and what goes with them if there are any."""
    if CORNERS[0] in names:
        return [*CORNERS[:9], *(n for n in (*CORNERS[9:], *NORMAL) if n in names), "pressure"]
    return [*CENTRE, "area", *NORMAL, "pressure"]


def _missing(path: Path, headers: Sequence[str], names: Any, reading: Reading) -> list[Problem]:
    wanted = _needed(names)
    for group in (CORNERS[9:], NORMAL):  # all or none of them
        wanted += group if any(n in names for n in group) else ()
    absent = [name for name in dict.fromkeys(wanted) if name not in names]
    if not absent:
        return []
    remedy = f"name the columns, for example {MINIMAL}"
    if all(map(_is_number, headers)):
        return [Problem(str(path), 1, "", "numbers and no column names", "column names in the first line", remedy)]
    if absent == ["pressure"]:
        named = f"called {reading.pressure_name}" if reading.pressure_name else "named pressure"
        remedy = f"no column is {named}: give the column's name with --pressure-name"
    units = ", ".join(unit for kind, factors in FACTORS.items() if kind != "number" for unit in factors)
    found = f"the columns {shortened(', '.join(h.strip() for h in headers), 300)}"
    return [Problem(str(path), 1, "", found, f"also {', '.join(absent)}", f"{remedy} (known units: {units})")]


def _twice(path: Path, headers: Sequence[str], found: Sequence[tuple[str, str | None] | None]) -> list[Problem]:
    seen: dict[str, str] = {}
    problems = []
    for header, pair in zip(headers, found, strict=True):
        if pair and pair[0] in seen:
            both = f"{seen[pair[0]]} and {header.strip()}"
            problems.append(Problem(str(path), 1, pair[0], both, "one column for it", "remove one of the two"))
        if pair:
            seen[pair[0]] = header.strip()
    return problems


def _without_unit(path: Path, bare: dict[str, str]) -> list[Problem]:
    problems = []
    for kind, option, unit, value in (
        ("length", "--unit", "mm", "mm"), ("area", "--unit", "mm2", "mm"), ("pressure", "--pressure-unit", "kpa", "kpa")
    ):  # fmt: skip
        headers = [header for name, header in bare.items() if KINDS[name] == kind]
        if headers:
            remedy = f"write {headers[0]}_{unit}, or add {option} {value}: units are not guessed"
            problems.append(Problem(str(path), 1, ", ".join(headers), "no unit", f"a unit of {kind}", remedy))
    return problems


def _numbers(
    path: Path, numbers: Sequence[int], rows: Sequence[Sequence[str]], headers: Sequence[str], position: dict[str, int]
) -> dict[str, FloatArray]:
    """Values of the columns at some positions, as they stand there; a fourth corner may be empty (NaN)."""
    problems = []
    values = {name: np.full(len(rows), np.nan) for name in position}
    for i, (line, cells) in enumerate(zip(numbers, rows, strict=True)):
        if len(cells) != len(headers):
            found, expected = f"{len(cells)} cells", f"{len(headers)} as in the line of names"
            remedy = "complete the line; write numbers with a decimal point, not a comma"
            problems.append(Problem(str(path), line, "", found, expected, remedy))
            continue
        for name, k in position.items():
            cell = cells[k].strip()
            if _is_number(cell):
                values[name][i] = float(cell)
            elif cell or name not in CORNERS[9:]:
                comma = "," in cell and "." not in cell
                remedy = "write a decimal point" if comma else "repair the cell or leave the face out"
                found = shown(cell) if cell else "an empty cell"
                problems.append(Problem(str(path), line, headers[k].strip(), found, "a finite number", remedy))
    refuse(problems)
    return values


def _is_number(cell: str) -> bool:
    try:
        return bool(np.isfinite(float(cell)))
    except ValueError:
        return False
