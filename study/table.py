"""One table, four renderings: text for a terminal, a block of a page, CSV and JSON.

A table is data: columns that know their unit, rows of plain values in SI units, notes. Whoever answers a question
composes one; a renderer knows nothing of grasps.
"""

import csv
import io
import json
import math
import shutil
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table as Grid

from softjaw.study.units import number as number
from softjaw.study.units import shown, shown_unit

GAP = 2  # characters between columns
PAPER = 80  # characters in a line of a text that is not for a terminal
MOST_NOTES = 3  # below a table in a terminal; the other renderings have all
LONGEST_CELL = 24  # characters
Row = dict[str, Any]


class Column(NamedTuple):
    """A quantity as it is shown.

    ``name``: key of the rows, and name in CSV and JSON; ``unit``: SI unit of the rows; ``label``: displayed head, the
    name where it is empty. ``error``: key of the error, a share of the value where it is ``relative``, else in the
    unit; ``digits``: significant ones where no error says how many there are. ``display, programs``: whether text and
    page show it, and CSV and JSON hold it. ``drop``: above 0, what a narrow text leaves out, the largest number first.
    ``wrap``: characters in a line of its cells, which begin at the left; 0 for numbers.
    """

    name: str
    unit: str = ""
    label: str = ""
    error: str = ""
    relative: bool = True
    digits: int = 4
    display: bool = True
    programs: bool = True
    drop: int = 0
    wrap: int = 0


@dataclass(frozen=True)
class Table:
    """An answer: what it is about, its columns and rows, and what a reader should know beside them.

    ``facts`` are single values that programs get too, ``name`` is what the rows are called there.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    notes: Sequence[str] = ()
    facts: dict[str, Any] = field(default_factory=dict)
    name: str = "rows"

    def cell(self, row: Row, column: Column) -> str:
        """A value as it is displayed, with its error where that is known."""
        value = row.get(column.name)
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, str | int):
            return str(value)
        if value is None or math.isnan(value):
            return "-"
        value, error = float(shown(value, column.unit)), row.get(column.error, math.nan)
        if math.isfinite(error):
            return with_error(value, abs(value * error) if column.relative else shown(error, column.unit))
        return number(value, column.digits)

    def records(self) -> list[Row]:
        """Rows as JSON takes them: SI units, None for what is not there."""
        return [{c.name: plain(row.get(c.name)) for c in self.columns if c.programs} for row in self.rows]


# --- numbers and lines -----------------------------------------------------------------------------------------------


def with_error(value: float, error: float) -> str:
    """A value with as many digits as its error leaves, four at most, and the error.

    >>> with_error(872.3, 12.0), with_error(17.0812, 0.152), with_error(1.5, 1e-9), with_error(0.0, 0.0)
    ('872 ± 12', '17.08 ± 0.15', '1.500 ± 0.001', '0 ± 0')
    """
    if not value and not error:
        return "0 ± 0"
    of_value, of_error = (math.floor(math.log10(x)) if x else -99 for x in (abs(value), error))
    decimals = max(0, min(3 - of_value, 1 - of_error) if of_value > -99 else 1 - of_error)
    return f"{value:.{decimals}f} ± {max(error, 10.0**-decimals if decimals else error):.{decimals}f}"


def with_unit(name: str, unit: str) -> str:
    """Name of a column in one line: ``e_n [m]``."""
    return f"{name} [{unit}]" if unit else name


def plain(value: Any) -> Any:
    """Numbers, lists and texts that JSON knows: an array as lists, None for what has no number."""
    if isinstance(value, dict):
        return {key: plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        values = plain(value.tolist())
        return None if isinstance(values, list) and values and all(v is None for v in values) else values
    return None if isinstance(value, float) and not math.isfinite(value) else value


def terminal_width() -> int:
    """Characters in a line of the terminal, or ``COLUMNS``; where the output is no terminal, `PAPER`."""
    return shutil.get_terminal_size().columns


def wrapped(text: str, width: int, indent: str = "", more: str = "") -> str:
    """A text broken into lines of up to ``width`` characters: the first after ``indent``, the rest after ``more`` too.

    Words are never broken, so that file names can be copied.
    """
    # A terminal of a few characters would get one word per line.
    return textwrap.fill(
        text, max(width, 40), initial_indent=indent, subsequent_indent=indent + more,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def hanging(text: str, width: int) -> str:
    """Lines such as ``  name        value`` broken so that their values stay in one column."""
    lines = text.splitlines()
    return "\n".join(wrapped(line, width, more=" " * (14 if line.startswith("  ") else 2)) for line in lines)


# --- renderings ------------------------------------------------------------------------------------------------------


def as_text(table: Table, width: int = PAPER) -> str:
    """For a terminal: aligned columns with their units, notes below; lengths in mm, angles in degrees.

    Columns that do not fit into ``width`` characters are left out.
    """
    title = [wrapped(table.title, width)] * bool(table.title)
    columns = _fitting(table, width)
    heads = [with_unit(c.label or c.name, shown_unit(c.unit)).replace(" [", "\n[") for c in columns]
    cells = [[_broken(table.cell(row, c), c.wrap) for c in columns] for row in table.rows]
    lines = aligned(heads, cells, [i for i, c in enumerate(columns) if c.wrap]) if table.rows else []
    notes, more = list(table.notes[:MOST_NOTES]), len(table.notes) - MOST_NOTES
    notes += [f"and {more} more note{'s' * (more > 1)}: --json lists all"] * (more > 0)
    return "\n".join([*title, *lines, *(wrapped(note, width, more="  ") for note in notes)])


def as_json(table: Table) -> str:
    """For a program: title, facts, notes, units and every column of every row, SI units; what is not there is null."""
    units = {c.name: c.unit for c in table.columns if c.programs}
    record = {"title": table.title, **plain(table.facts), "notes": list(table.notes), "units": units}
    return json.dumps(record | {table.name: table.records()}, indent=2, allow_nan=False)


def as_csv(table: Table) -> str:
    """For a spreadsheet: one line for each row, SI units in the header, no line end after the last one."""
    columns = [c for c in table.columns if c.programs]
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n").writerow
    write([_csv_cell(with_unit(c.name, c.unit)) for c in columns])
    for record in table.records():
        write([_csv_cell(record[c.name]) for c in columns])
    return text.getvalue().rstrip("\n")


def rendered(table: Table, form: str | None) -> str:
    """``json`` or ``csv``; for the terminal where neither is asked for."""
    return {"json": as_json, "csv": as_csv}[form](table) if form else as_text(table, terminal_width())


def _csv_cell(value: Any) -> Any:
    """A cell of CSV: None is empty, and a text that a spreadsheet would compute stands behind an apostrophe.

    >>> _csv_cell("=1+1"), _csv_cell("-3.5"), _csv_cell("at 0 mm"), _csv_cell(None)
    ("'=1+1", '-3.5', 'at 0 mm', '')
    """
    if not isinstance(value, str) or value[:1] not in ("=", "+", "-", "@", "\t", "\r"):
        return "" if value is None else value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


def aligned(heads: Sequence[str], rows: Iterable[Sequence[str]], left_aligned: Sequence[int] = ()) -> list[str]:
    """Lines of a table; cells and heads may have several lines, columns numbered in ``left_aligned`` begin at the left.

    >>> aligned(["a", "b"], [["1", "bc"], ["23", "d"]], left_aligned=[1])
    [' a  b', ' 1  bc', '23  d']
    """
    grid = Grid(box=None, pad_edge=False, padding=(0, GAP, 0, 0))
    for i, head in enumerate(heads):
        grid.add_column(head, justify="left" if i in left_aligned else "right", no_wrap=True)
    for row in rows:
        grid.add_row(*row)
    # Much wider than any table, so that nothing is cut; who prints it decides on the width.
    wide = Console(file=io.StringIO(), width=10_000, markup=False, emoji=False, highlight=False, color_system=None)
    with wide.capture() as drawn:
        wide.print(grid)
    return [line.rstrip() for line in drawn.get().splitlines()]


def _broken(text: str, width: int) -> str:
    r"""A cell in lines of up to ``width`` characters (0: one line, cut where it is very long).

    >>> _broken("hole, slips", 6), _broken("0.5", 0)
    ('hole,\nslips', '0.5')
    """
    if not width:
        return text if len(text) <= LONGEST_CELL else f"{text[: LONGEST_CELL - 3]}..."
    return "\n".join(textwrap.wrap(text, width, break_long_words=False))


def _fitting(table: Table, width: int) -> list[Column]:
    """The displayed columns that fit into a line, without the least important ones where need be."""
    columns = [c for c in table.columns if c.display]
    sizes = {}
    for c in columns:
        cells = [c.label or c.name, shown_unit(c.unit) + "[]"]
        cells += [line for row in table.rows for line in _broken(table.cell(row, c), c.wrap).split("\n")]
        sizes[c.name] = GAP + max(map(cell_len, cells))
    for c in sorted((c for c in columns if c.drop), key=lambda c: -c.drop):
        if sum(sizes[other.name] for other in columns) <= width + GAP:
            break
        columns.remove(c)
    return columns
