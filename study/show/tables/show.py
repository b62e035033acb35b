"""The best grasps of a result file, as a table for people and as JSON or CSV for programs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.study.accuracy.uncertainty.verdict import sure, verdict
from softjaw.study.flags import OF_FILE
from softjaw.study.result.layout import DONE
from softjaw.study.show.tables.columns import csv_text, with_unit
from softjaw.study.show.tables.ranking import BORNE, LOST, borne_level, judged, nearest, passed_over, ranking
from softjaw.study.show.tables.show_text import WINDOW, Columns, alike
from softjaw.study.show.tables.show_text import as_text as as_text
from softjaw.study.units import shown_text

COLUMNS = (  # map, friction model ("" where it has none), unit
    ("quality", "curved", ""),
    ("quality_fitted", "curved", ""),
    ("misfit", "", ""),
    ("e_n", "curved", "m"),
    ("e_n", "planar", "m"),
    ("f_x_max", "curved", "N"),
    ("f_y_max", "curved", "N"),
    ("tau_z_max", "curved", "N m"),
)
SOMETIMES = (  # columns of files that have the map
    ("safety_factor", "curved", ""),
    ("dent", "", "m"),
    ("wall_stress", "", "Pa"),
)


@dataclass(frozen=True)
class Table:
    """Grasps in the order of their quality at one force [N]: names and units of the columns, and the rows.

    An error stands behind the quantity it belongs to, relative unless the column has a unit; a band is in the unit of
    the quantity. ``verdict`` says whether the best grasp is better than the others beyond the errors.
    """

    title: str
    columns: Columns
    rows: tuple[tuple[Any, ...], ...]
    force: float
    verdict: str = ""


def best(result: Any, force: float | None = None, top: int = 10, whole_lines: bool = False) -> Table:
    """The ``top`` grasps (0: all) at the force level nearest to ``force`` [N].

    The default is the highest level, or the highest at which a grasp is within its window of forces where there is one.
    With ``whole_lines`` images of one grasp, which share a line of `as_text`, count as one.
    """
    forces, flags = result.axes[-1].values, judged(result)
    k, why = _level(result, flags, force)
    maps = {(name, units): found[..., k].ravel() for name, units, found in _maps(result)}
    scored = next(c for c in (("quality", ""), ("e_n", "m")) if c[0] == "e_n" or np.isfinite(maps[c]).any())
    score = maps[scored]
    done = np.flatnonzero(result.status[..., k].ravel() == DONE)
    flags = flags[..., k].ravel()
    order = done[ranking(score[done], flags[done])]
    labels = np.broadcast_to(result.labels, result.layout.shape[:-1]).ravel()
    named = [("label", "")] if has_poses(result) else []
    head = [(axis.name, axis.units) for axis in result.axes[:-1]]
    maps |= {(name, "N"): bound.ravel() for name, bound in _window(result).items()}
    titles = (("rank", ""), *head, *named, *maps, ("flags", ""))

    def row(rank: int, i: int) -> tuple[Any, ...]:
        index = np.unravel_index(i, result.layout.shape[:-1])
        place = [float(axis.values[j]) for axis, j in zip(result.axes[:-1], index, strict=True)]
        values = [float(column[i]) for column in maps.values()]
        return (rank, *place, *([str(labels[i])] * len(named)), *values, int(flags[i]))

    rows = _first((row(rank, i) for rank, i in enumerate(order, start=1)), top, titles if whole_lines else ())
    what = f"best {len(rows)} of {len(done)} solved candidates" if rows else "no candidate is solved"
    if not rows:
        why += _solved_elsewhere(result)
    holding = [int(i) for i in order if not flags[i] & LOST and np.isfinite(score[i])]
    same = [tuple(np.delete(index, -1)) for index in np.ndindex(result.layout.shape[:-1])]
    told = verdict(sure(result, scored[0], k), holding, same, scored[1])
    told = " ".join(filter(None, [told, _passed_over(score[done], flags[done])]))
    return Table(f"{what} at {forces[k]:g} N{why}", titles, tuple(rows), float(forces[k]), told)


def _solved_elsewhere(result: Any) -> str:
    """Which other forces have solved cases."""
    solved = np.any(result.status == DONE, axis=tuple(range(result.status.ndim - 1)))
    if not solved.any():
        return ", nor at any other force"
    return f"; --force takes {', '.join(f'{f:g}' for f in result.axes[-1].values[solved])}"


def _passed_over(score: np.ndarray, flags: np.ndarray) -> str:
    """That grasps of a higher score than the best one stand last, and why."""
    better, why = passed_over(score, flags)
    if not better:
        return ""
    count = "one grasp scores" if len(better) == 1 else f"{len(better)} grasps score"
    return f"{count} higher but cannot be used and stand last: {why}"


def _level(result: Any, flags: np.ndarray, force: float | None) -> tuple[int, str]:
    """Number of the force level that is shown, and why where that is not plain."""
    forces = result.axes[-1].values
    if force is not None:
        k = nearest(forces, force)
        return k, "" if np.isclose(force, forces[k]) else f", the level nearest to {force:g} N"
    k = borne_level(result.status, flags) if (flags & BORNE).any() else None
    if k is None or k == len(forces) - 1:
        return len(forces) - 1, ""
    return k, ", the highest that a grasp holds and its wall bears"


def _window(result: Any) -> dict[str, np.ndarray]:
    """Derived bounds of the forces, over all axes but the force."""
    there = {d.name for d in getattr(result.layout, "derived", ())}
    return {name: result.derived(name) for name in WINDOW if name in there}


def _maps(result: Any) -> Iterator[tuple[str, str, np.ndarray]]:
    """Name, unit and values of the columns between the place and the flags."""
    there = {q.name: q for q in result.layout.quantities}
    bands = {d.name for d in getattr(result.layout, "derived", ())}
    for name, model, units in (*COLUMNS, *(column for column in SOMETIMES if column[0] in there)):
        model = result.layout.planar if model == "planar" else model
        yield f"{name}_{model}" if model not in ("", "curved") else name, units, result.map(name, model or None)
        if model not in ("", "curved"):
            continue
        if f"{name}_band" in bands:
            yield f"{name}_band", units, result.derived(f"{name}_band")
        elif error := there.get(f"{name}_error"):
            yield error.name, error.unit, result.map(error.name)


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


def has_poses(result: Any) -> bool:
    """Whether the candidates are explicit poses: those are numbered along the axis of stations, and have labels."""
    return not result.axes[-3].units


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


def place(result: Any, row: int) -> str:
    """A case in words: ``station 12 mm, angle 90 deg, normal_force 5 N``; an explicit pose by its label."""
    index = np.unravel_index(row, result.layout.shape)
    words = []
    label = f'"{result.labels[index[-3:-1]]}"' if has_poses(result) else ""
    for axis, i in zip(result.axes, index, strict=True):
        if label and axis.name in ("station", "angle"):
            words += [label] * (axis.name == "station")
            continue
        words.append(f"{axis.name} {shown_text(axis.values[i], axis.units, 5)}")
    return ", ".join(words)


def _plain(value: Any) -> Any:
    """A value for programs; flags, the only integers but ranks, as the file has them."""
    if isinstance(value, int):
        return value & OF_FILE
    return None if isinstance(value, float) and not np.isfinite(value) else value
