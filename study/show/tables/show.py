"""The best grasps of a result file, as a table for people and as JSON or CSV for programs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import xarray as xr

from softjaw.study.flags import BORNE, LOST, OF_FILE
from softjaw.study.quantities import TABLE, WINDOW
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import axes_of, values_of
from softjaw.study.show.tables.certainty import sure, verdict
from softjaw.study.show.tables.columns import csv_text, with_unit
from softjaw.study.show.tables.ranking import borne_level, judged, nearest, passed_over, ranking
from softjaw.study.show.tables.show_text import Columns, Table, alike
from softjaw.study.show.tables.show_text import as_text as as_text


def best(ds: xr.Dataset, force: float | None = None, top: int = 10, whole_lines: bool = False) -> Table:
    """The ``top`` grasps (0: all) at the force level nearest to ``force`` [N].

    The default is the highest level, or the highest at which a grasp is within its window of forces where there is one.
    With ``whole_lines`` images of one grasp, which share a line of `as_text`, count as one.
    """
    axes, flags = axes_of(ds), judged(ds)
    forces, shape = axes[-1].values, ds.status.shape[:-1]
    k, why = _level(ds, flags, force)
    maps = {(name, unit): found[..., k].ravel() for name, unit, found in _columns(ds)}
    scored = next(c for c in (("quality", ""), ("e_n", "m")) if c[0] == "e_n" or np.isfinite(maps[c]).any())
    score = maps[scored]
    done = np.flatnonzero(ds.status.values[..., k].ravel() == DONE)
    flags = flags[..., k].ravel()
    order = done[ranking(score[done], flags[done])]
    labels = np.broadcast_to(ds.label.values, shape).ravel()
    named = [("label", "")] if ds.attrs["poses"] else []
    maps |= {(name, "N"): ds[name].values.ravel() for name in WINDOW if name in ds}
    titles = (("rank", ""), *((axis.name, axis.units) for axis in axes[:-1]), *named, *maps, ("flags", ""))

    def row(rank: int, i: int) -> tuple[Any, ...]:
        place = [float(axis.values[j]) for axis, j in zip(axes[:-1], np.unravel_index(i, shape), strict=True)]
        values = [float(column[i]) for column in maps.values()]
        return (rank, *place, *([str(labels[i])] * len(named)), *values, int(flags[i]))

    rows = _first((row(rank, i) for rank, i in enumerate(order, start=1)), top, titles if whole_lines else ())
    what = f"best {len(rows)} of {len(done)} solved candidates" if rows else "no candidate is solved"
    if not rows:
        why += _solved_elsewhere(ds)
    holding = [int(i) for i in order if not flags[i] & LOST and np.isfinite(score[i])]
    same = [tuple(np.delete(index, -1)) for index in np.ndindex(shape)]
    told = verdict(sure(ds, scored[0], k), holding, same, scored[1])
    told = " ".join(filter(None, [told, _passed_over(score[done], flags[done])]))
    return Table(f"{what} at {forces[k]:g} N{why}", titles, tuple(rows), float(forces[k]), told)


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


def _level(ds: xr.Dataset, flags: np.ndarray, force: float | None) -> tuple[int, str]:
    """Number of the force level that is shown, and why where that is not plain."""
    forces = ds.normal_force.values
    if force is not None:
        k = nearest(forces, force)
        return k, "" if np.isclose(force, forces[k]) else f", the level nearest to {force:g} N"
    k = borne_level(ds.status.values, flags) if (flags & BORNE).any() else None
    if k is None or k == len(forces) - 1:
        return len(forces) - 1, ""
    return k, ", the highest that a grasp holds and its wall bears"


def _columns(ds: xr.Dataset) -> Iterator[tuple[str, str, np.ndarray]]:
    """Name, unit and values of the main maps, each with what is known of its error behind it."""
    for q in (q for q in TABLE if q.group == "maps" and q.rank and q.name in ds):
        yield q.name, q.unit, values_of(ds, q.name)
        for error in (f"{q.name}_interval", f"{q.name}_error"):
            if error in ds:
                yield error, ds[error].units, values_of(ds, error)
                break
        if q.name == "e_n":  # what the paper compares it with
            yield f"e_n_{ds.planar}", q.unit, values_of(ds, q.name, ds.planar)


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
    """One object with the title, the force [N], the units (SI) and a list of grasps; what is not there is null."""
    names = [name for name, _ in table.columns]
    rows = [dict(zip(names, map(_plain, row), strict=True)) for row in table.rows]
    told = {"title": table.title, "verdict": table.verdict, "force": table.force}
    told |= {"units": dict(table.columns), "grasps": rows}
    return json.dumps(told, indent=2)


def as_csv(table: Table) -> str:
    """One line for each grasp, SI units in the header."""
    head = [with_unit(name, units) for name, units in table.columns]
    # flags as text, as they are; None is an empty cell
    return csv_text([head, *([None if _plain(v) is None else v for v in row] for row in table.rows)])


def _plain(value: Any) -> Any:
    """A value for programs; flags, the only integers but ranks, as the file has them."""
    if isinstance(value, int):
        return value & OF_FILE
    return None if isinstance(value, float) and not np.isfinite(value) else value
