"""The table of the best grasps as people read it in a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softjaw.study.flags import flag_words, flags_in
from softjaw.study.quantities import BY_KEY, MAIN, MODELS, WINDOW
from softjaw.study.show.tables.columns import PAPER, aligned, digits, fitting, two_lines, wrapped
from softjaw.study.units import shown, shown_unit

Columns = tuple[tuple[str, str], ...]  # names and units
WINDOW_MEANS = "normal forces that hold the object, if its mass is given, and that its wall bears, as far as was solved"
ERROR, ERROR_MEANS = "+-", "error of the column before it, from the coarser of two meshes"
INTERVAL_MEANS = (
    "half-width of the interval of the column before it; about 95 of 100 lie within. [uncertainty] says of what"
)
NO_ERRORS = "errors of the mesh: not known; accuracy.meshes = 2 or uncertainty.mesh = true in the scene gives them"
FLAGS_WIDTH, LABEL_WIDTH = 18, 28


@dataclass(frozen=True)
class Table:
    """Grasps in the order of their quality at one force [N]: names and units of the columns, and the rows.

    An error stands behind the quantity it belongs to, relative unless the column has a unit; an interval is in the unit
    of the quantity. ``verdict`` says whether the best grasp is better than the others beyond the errors.
    """

    title: str
    columns: Columns
    rows: tuple[tuple[Any, ...], ...]
    force: float
    verdict: str = ""


def as_text(table: Table, width: int = PAPER) -> str:
    """Aligned columns, lengths in mm and angles in degrees; images of one grasp share a line, flags are words.

    Columns that do not fit into ``width`` letters are left out, and named below.
    """
    if not table.rows:
        return table.title
    told = _for_people(table)
    body, flags = _lines(told)
    heads = [_head(name, units) for name, units in told.columns]
    rows = [*(list(line) for line in zip(*heads, strict=True)), *body]
    names = [name for name, _ in told.columns]
    drop = [names.index(name) for name in least(names)]
    kept = fitting([[*row[:-1], row[-1][:FLAGS_WIDTH]] for row in rows], drop, width)
    left = [kept.index(len(names) - 1)] + [k for k, i in enumerate(kept) if names[i] == "label"]
    lines = aligned([[row[i] for i in kept] for row in rows], left)
    absent = ", ".join(names[i] for i in sorted(set(drop) - set(kept)))
    verdict = [wrapped(table.verdict, width, more="  ")] * bool(table.verdict)
    return "\n".join([wrapped(table.title, width), *lines, *verdict, *_legend(told, flags, absent, width)])


def symbol(name: str) -> str:
    """Head of a column."""
    q = BY_KEY.get(f"maps/{name}")
    return q.symbol if q and q.symbol else name


def least(names: Sequence[str]) -> list[str]:
    """Columns that a narrow terminal does without, the first ones first; those of the two first maps stay.

    >>> least(["quality", "quality_error", "fit error", "e_n", "e_n_error", "e_n_pcm", "f_x_max", "f_x_max_error"])
    ['fit error', 'f_x_max_error', 'e_n_pcm', 'f_x_max', 'quality_error']
    """
    main = [name for name in reversed(MAIN[2:]) if name in names]
    errors = [f"{name}_error" for name in main if f"{name}_error" in names]
    planar = [name for name in names if name in (f"e_n_{model}" for model in MODELS[1:])]
    return [*main[:1], *errors, *main[1:2], *planar, *main[2:], *(n for n in ("quality_error",) if n in names)]


def _legend(table: Table, flags: int, absent: str, width: int) -> list[str]:
    """What the words of the table mean, and what it does not show."""
    names = [name for name, _ in table.columns]
    told = [f"{flag.word}: {flag.sentence}" for flag in flags_in(flags)]
    told += [f"window: {WINDOW_MEANS}"] * ("window" in names)
    kinds = {
        "_interval": INTERVAL_MEANS,
        "_error": f"{ERROR_MEANS}{', in %' * any(n.endswith('_interval') for n in names)}",
    }
    told += [f"{ERROR}: {text}" for end, text in kinds.items() if any(n.endswith(end) for n in names)] or [NO_ERRORS]
    told += [f"not shown in {width} letters a line: {absent}; --csv and --json have all"] * bool(absent)
    return [wrapped(text, width, more="  ") for text in told]


def _head(name: str, units: str) -> tuple[str, str]:
    """Both lines above a column."""
    if name.endswith(("_error", "_interval")):
        return two_lines(ERROR, shown_unit(units) or "%" * name.endswith("_error"))
    return two_lines(symbol(name), shown_unit(units))


def _lines(table: Table) -> tuple[list[list[str]], int]:
    """Cells of every line, images of one grasp in one, and all flags that stand in them."""
    names = [name for name, _ in table.columns]
    groups: list[list[tuple[Any, ...]]] = []
    for row in table.rows:
        if groups and alike(row, groups[-1][-1], table.columns):
            groups[-1].append(row)
        else:
            groups.append([row])
    body: list[list[str]] = []
    for group in groups:
        cells = [_cells(row, table.columns) for row in group]
        for name in {"rank", "angle"} & set(names):
            cells[0][names.index(name)] = _several([row[names.index(name)] for row in cells])
        words = _stacked(cells[0][-1])  # flags go on in lines of their own
        body.append([*cells[0][:-1], words[0]])
        body += [[""] * (len(names) - 1) + [more] for more in words[1:]]
    flags = 0
    for row in table.rows:
        flags |= row[names.index("flags")]
    return body, flags


def _stacked(flags: str) -> list[str]:
    """Flags in as many narrow lines as they take, each flag in one piece.

    >>> _stacked("hole, not antipodal, too weak")
    ['hole, not antipodal,', 'too weak']
    """
    whole = textwrap.wrap(flags.replace(" ", "\xa0").replace(",\xa0", ", "), FLAGS_WIDTH, break_long_words=False)
    return [line.replace("\xa0", " ") for line in whole] or [""]


def _several(texts: list[str]) -> str:
    """Some values in one cell.

    >>> _several(["0", "90"]), _several(["0", "60", "120"])
    ('0, 90', '0..120')
    """
    return ", ".join(texts) if len(texts) < 3 else f"{texts[0]}..{texts[-1]}"


def _for_people(table: Table) -> Table:
    """Both bounds of the window of forces in one column of text; explicit poses by number and label alone."""
    if ("label", "") in table.columns:
        kept = [i for i, (name, _) in enumerate(table.columns) if name != "angle"]
        columns = tuple(
            ("pose" if table.columns[i][0] == "station" else table.columns[i][0], table.columns[i][1]) for i in kept
        )
        table = replace(table, columns=columns, rows=tuple(tuple(row[i] for i in kept) for row in table.rows))
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
    """A row as people read it; what stands before the quality are coordinates."""
    first = [name for name, _ in columns].index("quality")
    pairs = zip(row, columns, strict=True)
    return [_cell(value, name, units, i < first) for i, (value, (name, units)) in enumerate(pairs)]


def _cell(value: Any, name: str, units: str, coordinate: bool) -> str:
    if name == "flags":
        return flag_words(value)
    if not isinstance(value, float):
        text = str(value)
        return text if len(text) <= LABEL_WIDTH else f"{text[: LABEL_WIDTH - 3]}..."
    if np.isnan(value):
        return "-"
    if name.endswith("_error"):
        return f"{shown(value, units) * (1 if units else 100):.2g}"
    if name.endswith("_interval"):
        return f"{shown(value, units):.2g}"
    value = shown(value, units)
    if coordinate:
        return f"{value:.5g}"
    return f"{value:.2g}" if name == "fit_error" else digits(value)


def alike(row: tuple[Any, ...], other: tuple[Any, ...], columns: Columns) -> bool:
    """Whether two grasps differ in their angle only, as far as a line of text tells."""
    kept = [i for i, (name, _) in enumerate(columns) if name not in ("rank", "angle")]
    one, two = _cells(row, columns), _cells(other, columns)
    return all(one[i] == two[i] for i in kept)
