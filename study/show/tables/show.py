"""The best grasps of a result file, as a table, JSON or CSV."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from rich.cells import cell_len

from softjaw.study.export.csv_yaml import csv_text, with_unit
from softjaw.study.flags import LOST, OF_FILE, flag_words, flags_in
from softjaw.study.quantities import BY_KEY, FORCE_RANGE, MAIN, MODELS, TABLE, map_row
from softjaw.study.ranking import at_level, judged, passed_over, rank_values, ranked, score_of
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import axes_of, values_of
from softjaw.study.show.tables.answer import answer
from softjaw.study.show.tables.certainty import sure, verdict
from softjaw.study.show.tables.columns import GAP, PAPER, aligned, digits, head, wrapped
from softjaw.study.show.tables.status import aim, largest_error, no_grasps
from softjaw.study.units import shown, shown_unit

Columns = tuple[tuple[str, str], ...]  # names and units
RANGE = "force range"
RANGE_MEANS = "normal forces that hold the object, if its mass is given, and leave its wall undamaged; as far as solved"
ERROR, ERROR_MEANS = "+-", "error estimate of the column before it, from two meshes"
INTERVAL_MEANS = (
    "half-width of the uncertainty interval (95 %) of the column before it, by the inputs in [uncertainty] of the scene"
)
MISALIGNMENT = "misalignment"  # its flag is told with the angle
PAD_ELEMENTS = "pad_elements"
FLAGS_WIDTH, LABEL_WIDTH = 15, 20
RESERVED = {"map": 7, "flags": 13}  # characters of a column


@dataclass(frozen=True)
class Table:
    """Grasps from the best one downward at one force [N]: names and units of the columns, and the rows.

    An error stands behind the quantity it belongs to, relative unless the column has a unit; an interval is in the unit
    of the quantity. ``verdict`` says whether the best grasp is better than the others beyond the errors, ``answer``
    what to do with it, ``largest_error`` how far off e_n may be by the mesh, of all cases at all forces.
    """

    title: str
    columns: Columns
    rows: tuple[tuple[Any, ...], ...]
    force: float
    verdict: str = ""
    answer: str = ""
    largest_error: str = ""


def best(
    ds: xr.Dataset, force: float | None = None, top: int = 10, whole_lines: bool = False, by: str | None = None
) -> Table:
    """The ``top`` grasps (0: all) at a force [N], by default that of `study.ranking.shown_level`.

    Between two solved forces values lie on straight lines. ``by`` names the map that grasps are ranked by. With
    ``whole_lines`` images of one grasp, which share a line of `as_text`, count as one.

    Raises
    ------
    ValueError
        For a force outside of the solved ones.
    """
    error = _largest_error(ds)
    ds, k, why = at_level(ds, force)
    axes, flags = axes_of(ds), judged(ds)
    forces, shape = axes[-1].values, ds.status.shape[:-1]
    maps = {(name, unit): found[..., k].ravel() for name, unit, found in _columns(ds)}
    scored = score_of(ds, by)
    score = rank_values(ds, scored, k, each=force is None)
    flags, order = flags[..., k].ravel(), ranked(ds, k, by, each=force is None)
    labels = np.broadcast_to(ds.label.values, shape).ravel()
    named = [("label", "")] if ds.attrs["poses"] else []
    maps |= {(name, "N"): ds[name].values.ravel() for name in FORCE_RANGE if name in ds}
    titles = (("rank", ""), *((axis.name, axis.units) for axis in axes[:-1]), *named, *maps, ("flags", ""))

    def row(rank: int, i: int) -> tuple[Any, ...]:
        place = [float(axis.values[j]) for axis, j in zip(axes[:-1], np.unravel_index(i, shape), strict=True)]
        values = [float(column[i]) for column in maps.values()]
        return (rank, *place, *([str(labels[i])] * len(named)), *values, int(flags[i]))

    rows = _first((row(rank, i) for rank, i in enumerate(order, start=1)), top, titles if whole_lines else ())
    by = "force to use" if force is None and scored == "payload" and "force_low" in ds else scored
    what = f"best {len(rows)} of {len(order)} solved candidates by {by}" if rows else "no candidate is solved"
    holding = [int(i) for i in order if not flags[i] & LOST and np.isfinite(score[i])]
    same = [tuple(np.delete(index, -1)) for index in np.ndindex(shape)]
    errors = verdict(sure(ds, scored, k), holding, same, ds[scored].attrs.get("units", ""))
    errors = " ".join(filter(None, [errors, _passed_over(score[order], flags[order]), _left_out(ds, k)]))
    title = f"{what} at {forces[k]:g} N{why}{'' if rows else _solved_elsewhere(ds)}"
    first = (*(int(i) for i in np.unravel_index(order[0], shape)), k) if rows else None
    told = "" if first is None else answer(ds, first)
    return Table(title, titles, tuple(rows), float(forces[k]), errors, told, error)


def _largest_error(ds: xr.Dataset) -> str:
    """Of e_n by the mesh; nothing where the file has uncertainty intervals instead."""
    name = f"{aim(ds)[0]}_error"
    errors = values_of(ds, name) if name in ds else None
    if errors is None and "e_n_interval" in ds:
        return ""
    return largest_error(errors, ds, axes_of(ds), ds.label.values)


def _solved_elsewhere(ds: xr.Dataset) -> str:
    """Which other forces have solved cases."""
    solved = np.any(ds.status.values == DONE, axis=tuple(range(ds.status.ndim - 1)))
    if not solved.any():
        return ", nor at any other force"
    return f"; --force takes {', '.join(f'{f:g}' for f in ds.normal_force.values[solved])}"


def _passed_over(score: np.ndarray, flags: np.ndarray) -> str:
    """That grasps of a higher score than the best one stand last, and why."""
    better, why = passed_over(score, flags)
    if not better:
        return ""
    count = "one grasp scores" if len(better) == 1 else f"{len(better)} grasps score"
    return f"{count} higher but cannot be used and stand last: {why}"


def _left_out(ds: xr.Dataset, k: int) -> str:
    """Which candidates were not solved because they are no grasp."""
    found = no_grasps(ds.status.values[..., k])
    return f"not solved: {', '.join(found)}; 'softjaw status' says why" if found else ""


def _columns(ds: xr.Dataset) -> Iterator[tuple[str, str, np.ndarray]]:
    """Name, unit and values of the main maps, each with what is known of its error behind it."""
    for q in (q for q in TABLE if q.group == "maps" and q.rank and q.name in ds):
        yield q.name, q.unit, values_of(ds, q.name)
        for error in (f"{q.name}_interval", q.of_error.name):
            if error in ds:
                yield error, ds[error].units, values_of(ds, error)
                break
        if q.name == "e_n":  # what the paper compares it with
            yield f"e_n_{ds.planar}", q.unit, values_of(ds, q.name, ds.planar)
    for name in (name for name in (MISALIGNMENT, PAD_ELEMENTS) if name in ds):
        yield name, ds[name].units, values_of(ds, name)


def _first(rows: Iterable[tuple[Any, ...]], top: int, columns: Columns) -> list[tuple[Any, ...]]:
    """The first ``top`` rows (0: all), or all rows of the first ``top`` lines if the columns of the text are given."""
    taken: list[tuple[Any, ...]] = []
    lines = 0
    for row in rows:
        lines += not (columns and taken and alike(row, taken[-1], columns))
        if top and lines > top:
            break
        taken.append(row)
    return taken


def as_json(table: Table) -> str:
    """One object with answer, title, the force [N], the units (SI) and a list of grasps; what is not there is null."""
    names = [name for name, _ in table.columns]
    rows = [dict(zip(names, map(_plain, row), strict=True)) for row in table.rows]
    record = {"answer": table.answer, "title": table.title, "verdict": table.verdict, "force": table.force}
    record |= {"largest_error": table.largest_error}
    record |= {"units": dict(table.columns), "grasps": rows}
    return json.dumps(record, indent=2)


def as_csv(table: Table) -> str:
    """One line for each grasp, SI units in the header."""
    names = [with_unit(name, units) for name, units in table.columns]
    # flags as text, as they are; None is an empty cell
    return csv_text([names, *([None if _plain(v) is None else v for v in row] for row in table.rows)])


def _plain(value: Any) -> Any:
    """A value for programs; flags, the only integers but ranks, as the file has them."""
    if isinstance(value, int):
        return value & OF_FILE
    return None if isinstance(value, float) and not np.isfinite(value) else value


def as_text(table: Table, width: int = PAPER) -> str:
    """Aligned columns, lengths in mm and angles in degrees; images of one grasp share a line, flags are words.

    Columns that do not fit into ``width`` characters are hidden, and named below.
    """
    if not table.rows:
        return table.title
    displayed = _displayed(table)
    names, heads, body = (
        [name for name, _ in displayed.columns],
        [_head(*column) for column in displayed.columns],
        _body(displayed),
    )
    kept = _fitting([heads, *body], names, width)
    left = [k for k, i in enumerate(kept) if names[i] in ("flags", "label")]
    lines = aligned([heads[i] for i in kept], [[row[i] for i in kept] for row in body], left)
    hidden = [name for i, name in enumerate(names) if i not in kept]
    verdict = [wrapped(table.verdict, width, more="  ")] * bool(table.verdict)
    told = [wrapped(table.answer, width, more="  "), ""] if table.answer else []
    return "\n".join([*told, wrapped(table.title, width), *lines, *verdict, *_legend(displayed, hidden, width)])


def _fitting(cells: Sequence[Sequence[str]], names: Sequence[str], width: int) -> list[int]:
    """Numbers of the columns that fit into ``width`` characters, without the least important ones where need be."""
    # room for any number and for most flags, so that the columns are the same at every force
    room = [RESERVED["flags"] if name == "flags" else RESERVED["map"] * (f"maps/{name}" in BY_KEY) for name in names]
    columns = [[line for cell in column for line in cell.split("\n")] for column in zip(*cells, strict=True)]
    sizes = [GAP + max(wide, *map(cell_len, column)) for wide, column in zip(room, columns, strict=True)]
    kept = list(range(len(names)))
    for name in least(names):
        if sum(sizes[i] for i in kept) <= width + GAP:
            break
        kept.remove(names.index(name))
    return kept


def least(names: Sequence[str]) -> list[str]:
    """Columns that a narrow terminal does without, the first ones first; those of the two first maps stay.

    >>> least(["quality", "quality_error", "fit_error", "e_n", "e_n_error", "e_n_pcm", "f_x_max", "f_x_max_error"])
    ['fit_error', 'f_x_max_error', 'f_x_max', 'e_n_pcm', 'quality_error']
    """
    main = [column for name in reversed(MAIN[3:]) for column in (map_row(name).of_error.name, name) if column in names]
    planar = [name for name in names if name in (f"e_n_{model}" for model in MODELS[1:])]
    last = [name for name in (*(map_row(MAIN[i]).of_error.name for i in (0, 2)), MAIN[2]) if name in names]
    return [*(n for n in (PAD_ELEMENTS, MISALIGNMENT) if n in names), *main, *planar, *last]


def _legend(table: Table, hidden: Sequence[str], width: int) -> list[str]:
    """What the words of the table mean, and which columns it does not show."""
    names = [name for name, _ in table.columns]
    marks = int(np.bitwise_or.reduce([row[names.index("flags")] for row in table.rows]))
    lines = [f"{flag.word}: {flag.sentence}" for flag in flags_in(marks)]
    lines += [f"{RANGE}: {RANGE_MEANS}"] * (RANGE in names)
    kinds = {_kind(name) for name in names}
    meanings = {"interval": INTERVAL_MEANS, "error": f"{ERROR_MEANS}{', in %' * ('interval' in kinds)}"}
    lines += [f"{ERROR}: {text}" for kind, text in meanings.items() if kind in kinds]
    lines += [table.largest_error] * bool(table.largest_error)
    if hidden:
        lines.append(f"columns hidden to fit {width} characters: {', '.join(hidden)} (use --csv or --json for all)")
    return [wrapped(text, width, more="  ") for text in lines]


def _kind(name: str) -> str:
    """What a column says of the map before it, its ``error`` or ``interval``; empty for all other columns.

    >>> _kind("e_n_error"), _kind("e_n_interval"), _kind("fit_error")
    ('error', 'interval', '')
    """
    of, _, kind = name.rpartition("_")
    return kind if kind in ("error", "interval") and f"maps/{of}" in BY_KEY else ""


def _head(name: str, units: str) -> str:
    """What stands above a column."""
    if kind := _kind(name):
        return head(ERROR, shown_unit(units) or "%" * (kind == "error"))
    q = BY_KEY.get(f"maps/{name}")
    return head(q.symbol if q and q.symbol else name, shown_unit(units))


def _body(table: Table) -> list[list[str]]:
    """Cells of every line; images of one grasp share one."""
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
        body.append([*cells[0][:-1], _stacked(cells[0][-1])])
    return body


def _stacked(flags: str) -> str:
    r"""Flags in as many narrow lines as they take, each flag in one piece but for its angle.

    >>> _stacked("hole, not antipodal, too weak")
    'hole,\nnot antipodal,\ntoo weak'
    """
    joined = flags.replace(" ", "\xa0").replace(",\xa0", ", ").replace("\xa0by", " by")
    whole = textwrap.wrap(joined, FLAGS_WIDTH, break_long_words=False)
    return "\n".join(whole).replace("\xa0", " ")


def _several(texts: list[str]) -> str:
    """Some values in one cell.

    >>> _several(["0", "90"]), _several(["0", "60", "120"])
    ('0, 90', '0..120')
    """
    return ", ".join(texts) if len(texts) < 3 else f"{texts[0]}..{texts[-1]}"


def _displayed(table: Table) -> Table:
    """Both bounds of the safe force range in one column of text; explicit poses by number and label alone."""
    if ("label", "") in table.columns:
        kept = [i for i, (name, _) in enumerate(table.columns) if name != "angle"]
        columns = tuple(
            ("pose" if table.columns[i][0] == "station" else table.columns[i][0], table.columns[i][1]) for i in kept
        )
        table = replace(table, columns=columns, rows=tuple(tuple(row[i] for i in kept) for row in table.rows))
    at = [i for i, (name, _) in enumerate(table.columns) if name in FORCE_RANGE]
    if not at:
        return table

    def merged(row: tuple[Any, ...], one: Any) -> tuple[Any, ...]:
        return (*row[: at[0]], one, *row[at[-1] + 1 :])

    names = [table.columns[i][0] for i in at]
    rows = tuple(merged(row, _range_text(dict(zip(names, (row[i] for i in at), strict=True)))) for row in table.rows)
    return replace(table, columns=merged(table.columns, (RANGE, "N")), rows=rows)


def _range_text(bounds: dict[str, float]) -> str:
    """The safe force range as it is displayed.

    >>> _range_text({"force_low": 0.8, "force_high": 2.5}), _range_text({"force_high": 2.5})
    ('0.8..2.5', '..2.5')
    >>> _range_text({"force_low": 3.0, "force_high": 2.5}), _range_text({"force_low": np.nan})
    ('none', '-')
    """
    low, high = (bounds.get(name, np.nan) for name in FORCE_RANGE)
    if np.isnan([*bounds.values()]).all():
        return "-"
    if "force_low" in bounds and "force_high" in bounds and not low <= high:
        return "none"
    return "..".join("" if np.isnan(bound) else f"{bound:.3g}" for bound in (low, high))


def _cells(row: tuple[Any, ...], columns: Columns) -> list[str]:
    """A row as it is displayed; what stands before the quality are coordinates."""
    names = [name for name, _ in columns]
    first, off = names.index("quality"), row[names.index(MISALIGNMENT)] if MISALIGNMENT in names else np.nan
    pairs = zip(row, columns, strict=True)
    return [
        flag_words(value, off) if name == "flags" else _cell(value, name, units, i < first)
        for i, (value, (name, units)) in enumerate(pairs)
    ]


def _cell(value: Any, name: str, units: str, coordinate: bool) -> str:
    if not isinstance(value, float):
        text = str(value)
        return text if len(text) <= LABEL_WIDTH else f"{text[: LABEL_WIDTH - 3]}..."
    if np.isnan(value):
        return "-"
    value, kind = shown(value, units), _kind(name)
    if kind:
        return f"{value * (100 if kind == 'error' and not units else 1):.2g}"
    if coordinate:
        return f"{value:.5g}"
    return f"{value:.2g}" if name == "fit_error" else digits(value)


def alike(row: tuple[Any, ...], other: tuple[Any, ...], columns: Columns) -> bool:
    """Whether two grasps differ in their angle only, as far as a line of text tells."""
    kept = [i for i, (name, _) in enumerate(columns) if name not in ("rank", "angle")]
    one, two = _cells(row, columns), _cells(other, columns)
    return all(one[i] == two[i] for i in kept)
