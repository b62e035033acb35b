"""Text that fits a terminal: tables with heads of two lines, and lines that are broken between words."""

from __future__ import annotations

import io
import shutil
import textwrap
from collections.abc import Collection, Iterable, Sequence

from rich.console import Console
from rich.table import Table as Grid

GAP = 2
PAPER = 80  # characters in a line of a text that is kept


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


def aligned(heads: Sequence[str], rows: Iterable[Sequence[str]], left: Collection[int] = ()) -> list[str]:
    """Lines of a table; cells and heads may have several lines, columns numbered in ``left`` begin at the left.

    >>> aligned(["a", "b"], [["1", "bc"], ["23", "d"]], left=[1])
    [' a  b', ' 1  bc', '23  d']
    """
    grid = Grid(box=None, pad_edge=False, padding=(0, GAP, 0, 0))
    for i, head in enumerate(heads):
        grid.add_column(head, justify="left" if i in left else "right", no_wrap=True)
    for row in rows:
        grid.add_row(*row)
    # Much wider than any table, so that nothing is cut; who prints it decides on the width.
    wide = Console(file=io.StringIO(), width=10_000, markup=False, emoji=False, highlight=False, color_system=None)
    with wide.capture() as drawn:
        wide.print(grid)
    return [line.rstrip() for line in drawn.get().splitlines()]


def head(name: str, unit: str) -> str:
    r"""Head of a column, the unit below the name.

    >>> head("e_n", "mm"), head("rank", "")
    ('e_n\n[mm]', 'rank')
    """
    return f"{name}\n[{unit}]" if unit else name


def digits(value: float) -> str:
    """A number with four digits, and with an exponent only where it would be long.

    >>> digits(2.0), digits(0.0123456), digits(31000.4), digits(2e-7)
    ('2.000', '0.01235', '31000', '2.000e-07')
    """
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e6 else f"{value:#.4g}".rstrip(".")
