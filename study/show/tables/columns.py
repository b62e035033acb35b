"""Text that fits a terminal: aligned columns under heads of two lines, and lines that are broken between words."""

from __future__ import annotations

import csv
import io
import shutil
import textwrap
from collections.abc import Collection, Iterable, Sequence
from typing import Any

GAP = "  "
PAPER = 80  # letters in a line of a text that is kept


def terminal_width() -> int:
    """Letters in a line of the terminal, or ``COLUMNS``; where the output is no terminal, `PAPER`."""
    return shutil.get_terminal_size().columns


def wrapped(text: str, width: int, indent: str = "", more: str = "") -> str:
    """A text broken into lines of up to ``width`` letters: the first after ``indent``, the rest after ``more`` too."""
    return textwrap.fill(
        text, max(width, 40), initial_indent=indent, subsequent_indent=indent + more,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def hanging(text: str, width: int) -> str:
    """Lines such as ``  name        value`` broken so that their values stay in one column."""
    lines = text.splitlines()
    return "\n".join(wrapped(line, width, more=" " * (14 if line.startswith("  ") else 2)) for line in lines)


def aligned(rows: Sequence[Sequence[str]], left: Collection[int] = ()) -> list[str]:
    """Rows of equal length as lines with aligned columns; those numbered in ``left`` begin at the left.

    >>> aligned([["a", "1"], ["bc", "23"]], left=[0])
    ['a    1', 'bc  23']
    """
    sizes = [max(map(len, column)) for column in zip(*rows, strict=True)]

    def padded(row: Sequence[str]) -> Iterable[str]:
        for i, (cell, size) in enumerate(zip(row, sizes, strict=True)):
            yield cell.ljust(size) if i in left else cell.rjust(size)

    return [GAP.join(padded(row)).rstrip() for row in rows]


def two_lines(name: str, unit: str) -> tuple[str, str]:
    """Head of a column, the unit below the name.

    >>> two_lines("e_n", "mm"), two_lines("rank", "")
    (('e_n', '[mm]'), ('', 'rank'))
    """
    return (name, f"[{unit}]") if unit else ("", name)


def fitting(rows: Sequence[Sequence[str]], drop: Sequence[int], width: int) -> list[int]:
    """Numbers of the columns that fit into ``width`` letters: without the first ones of ``drop`` where need be.

    >>> fitting([["12345", "123", "1"]], drop=[1, 0], width=9)
    [0, 2]
    """
    sizes = [max(map(len, column)) + len(GAP) for column in zip(*rows, strict=True)]
    room, out = width + len(GAP) - sum(sizes), []
    for i in drop:
        if room >= 0:
            break
        out.append(i)
        room += sizes[i]
    for i in reversed(out[:-1]):  # a wide column that had to go may have made room for narrow ones
        if sizes[i] <= room:
            out.remove(i)
            room -= sizes[i]
    return [i for i in range(len(sizes)) if i not in out]


def csv_text(rows: Iterable[Sequence[Any]]) -> str:
    """Rows as CSV without a line end after the last; None is an empty cell."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([[cell(v) for v in row] for row in rows])
    return text.getvalue().rstrip("\n")


def cell(value: Any) -> Any:
    """A value as a cell of CSV: None is empty, and a text that a spreadsheet would compute stands behind an apostrophe.

    >>> cell("=1+1"), cell("-3.5"), cell("at 0 mm"), cell(None)
    ("'=1+1", '-3.5', 'at 0 mm', '')
    """
    if not isinstance(value, str) or value[:1] not in ("=", "+", "-", "@", "\t", "\r"):
        return "" if value is None else value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


def digits(value: float) -> str:
    """A number with four digits, and with an exponent only where it would be long.

    >>> digits(2.0), digits(0.0123456), digits(31000.4), digits(2e-7)
    ('2.000', '0.01235', '31000', '2.000e-07')
    """
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e6 else f"{value:#.4g}".rstrip(".")


def with_unit(name: str, unit: str) -> str:
    """Name of a column in one line: ``e_n [m]``."""
    return f"{name} [{unit}]" if unit else name
