"""Faces of a contact patch from a table (CSV), brought to SI units; what the headers of all kinds of files mean."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softjaw.friction.patch import FloatArray
from softjaw.study.messages import OTHER_FILE, USAGE, Problem, StudyError, shortened, shown
from softjaw.study.patch.faces import ReadPatch, checked, corner_geometry, refuse

ENDINGS = (".csv", ".vtu", ".vtp")
MOST_PATCH_FACES = 500_000
FACTORS = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "area": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
    "pressure": {"pa": 1.0, "kpa": 1e3, "mpa": 1e6, "n/mm2": 1e6},
    "number": {"-": 1.0, "1": 1.0},
}
OPTIONS = {"length": ("--unit", "mm", "mm"), "area": ("--unit", "mm2", "mm"),
           "pressure": ("--pressure-unit", "kpa", "kpa")}  # fmt: skip
CENTRE, NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
CORNERS = tuple(f"{axis}{k}" for k in (1, 2, 3, 4) for axis in "xyz")
KINDS = dict.fromkeys((*CENTRE, *CORNERS), "length") | dict.fromkeys(NORMAL, "number")
KINDS |= {"area": "area", "pressure": "pressure"}
ALIASES = {f"{stem}_{axis}": f"n{axis}" for stem in ("n", "normal") for axis in "xyz"}
HEADER = re.compile(r"(?P<name>.*?)\s*(?:_(?P<tail>[^_\s\[\]()]+)|[\[(](?P<boxed>[^\[\]()]*)[\])])?", re.DOTALL)
MINIMAL = "x_mm, y_mm, z_mm, area_mm2, nx, ny, nz, pressure_kpa, or corners x1_mm ... z4_mm with pressure_kpa"


class Reading(NamedTuple):
    """What the user says about a file that the file does not say itself.

    ``unit`` is that of bare lengths and, squared, of bare areas, ``pressure_unit`` that of a bare pressure;
    ``pressure_name`` is the column or data array of the pressure, ``flip_normals`` turns all normals.
    """

    unit: str | None = None
    pressure_unit: str | None = None
    pressure_name: str | None = None
    flip_normals: bool = False


def checked_file(file: str, endings: Sequence[str]) -> Path:
    """The path of a file with one of these endings, which can be read."""
    path = Path(file)
    if path.suffix.lower() not in endings:
        actual = f"the ending {path.suffix}" if path.suffix else "no ending"
        expected = f"{'one of ' * (len(endings) > 1)}{', '.join(endings)}"
        remedy = "export the patch as CSV, or as VTU or VTP from ParaView" if len(endings) > 1 else "export a table"
        raise StudyError(USAGE, f"{file}: found {actual}, expected {expected}; {remedy}")
    try:
        if path.exists() and not path.is_file():  # a device or a pipe may have no end
            raise StudyError(OTHER_FILE, f"{file}: not a regular file; name the file of a patch")
        path.open("rb").close()
    except OSError as error:
        raise StudyError(OTHER_FILE, f"{file}: cannot be read ({error.strerror}); check the path") from error
    return path


def refused(path: Path, line: int | None, key: str, actual: str, expected: str, remedy: str) -> StudyError:
    """The error of a single problem of a file."""
    return StudyError(USAGE, str(Problem(str(path), line, key, actual, expected, remedy)))


def check_count(path: Path, count: int) -> None:
    """Refuse more faces than a patch may have, before they are read."""
    if count > MOST_PATCH_FACES:
        text = f"{path}: found {count} faces, expected at most {MOST_PATCH_FACES}; export the contact surface alone"
        raise StudyError(USAGE, text)


def split_header(header: str, pressure_name: str | None = None) -> tuple[str, str | None] | None:
    """Quantity and unit of a header (None where it has no unit); None for a column that has no meaning here.

    ``pressure_name`` is the header, with or without its unit, of the column that holds the pressure.

    >>> split_header("x_mm"), split_header("Pressure [kPa]"), split_header("area"), split_header("x_inch")
    (('x', 'mm'), ('pressure', 'kpa'), ('area', None), None)
    """
    text = header.strip().lower()
    wanted = (pressure_name or "pressure").strip().lower()
    match = HEADER.fullmatch(text)
    assert match  # any text is at least a name
    name, unit = match["name"], re.sub("[ ^]", "", match["tail"] or match["boxed"] or "").replace("²", "2") or None
    if text in ALIASES:
        name, unit = ALIASES[text], None
    if wanted == text:
        return "pressure", unit if unit in FACTORS["pressure"] else None
    if name == "pressure" or wanted == name:
        return ("pressure", unit) if wanted == name and unit in FACTORS["pressure"] else None
    known = name in KINDS and (unit is None or unit in FACTORS[KINDS[name]])
    return (name, unit) if known else None


# --- table ------------------------------------------------------------------------------------------------------------


def read_table(path: Path, reading: Reading) -> ReadPatch:
    """Loaded faces of a CSV file with one face per line: centre, area and normal of each, or its corners."""
    numbers, (headers, *cells) = table_rows(path)
    pairs = [split_header(header, reading.pressure_name) for header in headers]
    position = {pair[0]: i for i, pair in enumerate(pairs) if pair}
    twice = [(pair[0], headers[i], headers[position[pair[0]]]) for i, pair in enumerate(pairs)
             if pair is not None and position[pair[0]] != i]  # fmt: skip
    refuse([Problem(str(path), 1, name, f"{first} and {other}", "one column for it", "remove one of the two")
            for name, first, other in twice] + _missing(path, headers, position, reading))  # fmt: skip
    needed = _needed(position)
    values = si_columns(path, numbers[1:], cells, headers, {name: position[name] for name in needed}, reading)
    unused = [h for pair, h in zip(pairs, headers, strict=True) if not pair or pair[0] not in needed]
    notes = (f"not used of {path}: {', '.join(unused)}",) if unused else ()
    stacked = {names: np.stack([values[name] for name in names], axis=-1) for names in (CENTRE, NORMAL)
               if names[0] in values}  # fmt: skip
    corners = None
    if CORNERS[0] not in values:
        geometry = stacked[CENTRE], values["area"], stacked[NORMAL]
    else:
        corners = np.stack([values[name] for name in CORNERS if name in values], axis=-1).reshape(len(cells), -1, 3)
        if corners.shape[1] == 4:  # a triangle leaves its fourth corner empty
            corners[:, 3] = np.where(np.isnan(corners[:, 3]).all(axis=1)[:, None], corners[:, 2], corners[:, 3])
        centroid, area, normal = corner_geometry(corners)
        geometry = centroid, area, stacked.get(NORMAL, normal)
    return checked(
        str(path), lambda i: f"line {numbers[i + 1]}", *geometry, values["pressure"], corners, notes,
        reading.flip_normals,
    )  # fmt: skip


def table_rows(path: Path) -> tuple[list[int], list[list[str]]]:
    """Numbers of the lines that are neither empty nor comments, and their cells."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise StudyError(OTHER_FILE, f"{path}: not a text file; export the patch as CSV, VTU or VTP") from error
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        actual, expected = "one line" if lines else "an empty file", "a line of column names and one line per face"
        raise refused(path, None, "", actual, expected, f"write {MINIMAL}")
    check_count(path, len(lines) - 1)
    mark = max(",;\t", key=lines[0][1].count)
    # not by a reader of CSV: no quotation mark may swallow the lines behind it
    rows = [[re.sub(r'^"(.*)"$', r"\1", cell.strip()) for cell in line.split(mark)] for _, line in lines]
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
    actual = f"the columns {shortened(', '.join(headers), 300)}"
    return [Problem(str(path), 1, "", actual, f"also {', '.join(absent)}", f"{remedy} (known units: {units})")]


def si_columns(
    path: Path, numbers: Sequence[int], rows: Sequence[Sequence[str]], headers: Sequence[str], position: dict[str, int],
    reading: Reading,
) -> dict[str, FloatArray]:  # fmt: skip
    """Values of the columns at some positions in SI units; a fourth corner may be empty (NaN)."""
    pairs = {name: split_header(headers[k], reading.pressure_name) for name, k in position.items()}
    area = f"{reading.unit}2" if reading.unit else None
    bare_units = {"length": reading.unit, "area": area, "pressure": reading.pressure_unit, "number": "-"}
    units = {name: (pair and pair[1]) or bare_units[KINDS[name]] or "" for name, pair in pairs.items()}
    problems = []
    for kind in dict.fromkeys(KINDS[name] for name in position if not units[name]):
        bare = [headers[k] for name, k in position.items() if KINDS[name] == kind and not units[name]]
        option, suffix, unit = OPTIONS[kind]
        remedy = f"write {bare[0]}_{suffix}, or add {option} {unit}: units are not guessed"
        problems.append(Problem(str(path), 1, ", ".join(bare), "no unit", f"a unit of {kind}", remedy))
    refuse(problems)
    values = _numbers(path, numbers, rows, headers, position)
    with np.errstate(over="ignore"):  # what is not finite is reported with its place
        return {name: FACTORS[KINDS[name]][units[name]] * column for name, column in values.items()}


def _numbers(
    path: Path, numbers: Sequence[int], rows: Sequence[Sequence[str]], headers: Sequence[str], position: dict[str, int]
) -> dict[str, FloatArray]:
    """Values of the columns at some positions, as they stand there."""
    problems = []
    values = {name: np.full(len(rows), np.nan) for name in position}
    for i, (line, cells) in enumerate(zip(numbers, rows, strict=True)):
        if len(cells) != len(headers):
            actual, expected = f"{len(cells)} cells", f"{len(headers)} as in the line of names"
            remedy = "complete the line; write numbers with a decimal point, not a comma"
            problems.append(Problem(str(path), line, "", actual, expected, remedy))
            continue
        for name, k in position.items():
            cell = cells[k]
            if _is_number(cell):
                values[name][i] = float(cell)
            elif cell or name not in CORNERS[9:]:
                comma = "," in cell and "." not in cell
                remedy = "write a decimal point" if comma else "repair the cell or leave the face out"
                actual = shown(cell) if cell else "an empty cell"
                problems.append(Problem(str(path), line, headers[k], actual, "a finite number", remedy))
    refuse(problems)
    return values


def _is_number(cell: str) -> bool:
    try:
        return bool(np.isfinite(float(cell)))
    except ValueError:
        return False
