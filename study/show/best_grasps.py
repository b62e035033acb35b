"""The best grasps of a result file: one table for terminal, page, CSV and JSON, and the answer in a sentence."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from softjaw.friction.patch import NEGLIGIBLE
from softjaw.study.case.result import TIE
from softjaw.study.flags import LOST, OF_FILE, flags_in
from softjaw.study.quantities import BY_KEY, FORCE_RANGE, MAIN, STATES, map_row
from softjaw.study.ranking import Sure, at_level, judged, passed_over, rank_values, ranked, score_of, sure, task_keys
from softjaw.study.result.layout import DONE, MISSING
from softjaw.study.result.read import axes_of, dataset, values_of
from softjaw.study.show.grasps import Index, at, forces, note, place, unravelled
from softjaw.study.show.status import RESUME, aim, counts, largest_error, no_grasps, reasons, time_split
from softjaw.study.table import Column, Row, Table, as_text, number, terminal_width, with_error, wrapped
from softjaw.study.units import in_si, shown, shown_text, shown_unit

NOTES_WIDTH, LABEL_WIDTH = 11, 20  # characters
MEANING = {"error": "error estimate from two meshes", "interval": "95 % uncertainty interval"}  # of ±


def best(
    ds: xr.Dataset,
    force: float | None = None,
    top: int = 10,
    by: str | None = None,
    lines: bool = False,
    maps: Collection[str] = MAIN,
) -> Table:
    """The ``top`` grasps (0: all) at a force [N], by default that of `study.ranking.shown_level`.

    Between two solved forces values lie on straight lines. ``by`` names the map that grasps are ranked by. With
    ``lines`` images of one grasp share a row, and rows are counted.

    Raises
    ------
    ValueError
        For a force outside of the solved ones.
    """
    errors = values_of(ds, name) if (name := f"{aim(ds)[0]}_error") in ds else None
    known = errors is not None or "e_n_interval" not in ds
    error = largest_error(errors, ds, axes_of(ds), ds.label.values) if known else ""
    ds, k, why = at_level(ds, force)
    flags, shape = judged(ds), ds.status.shape[:-1]
    ds = ds.assign(flags=(ds.status.dims, flags, ds["flags"].attrs))
    order, score = [int(i) for i in ranked(ds, k, by)], score_of(ds, by)
    listed = order[: top * (ds.sizes["angle"] if lines else 1) or None]
    table = case_table(ds, [(*unravelled(i, shape), k) for i in listed], True, maps)
    table = table.merged("rank", "angle").first(top) if lines else table
    what = f"best {len(table.rows) if not lines else min(len(listed), _count(table))} of {len(order)} solved"
    meaning = f" (±: {text})" if (text := meaning_of_errors(table)) else ""
    title = f"{what} candidates by {score} at {forces(ds)[k]:g} N{why}{meaning}"
    if not order:
        return Table(f"no candidate is solved at {forces(ds)[k]:g} N{why}{_solved_elsewhere(ds)}", table.columns, ())
    first = (*unravelled(order[0], shape), k)
    notes = [*certainties(ds, order, score, k), *_legend(flags, listed, k), *[error] * bool(error)]
    facts = {"answer": answer(ds, first), "force": float(forces(ds)[k]), "ranked_by": score, "largest_error": error}
    return Table(title, table.columns, table.rows, notes, facts, "grasps")


def best_text(ds: xr.Dataset, width: int, force: float | None = None, top: int = 10, by: str | None = None) -> str:
    """The answer and the best grasps for a terminal; the choice is that of `best`."""
    table = best(ds, force, top, by, lines=True)
    told = [wrapped(table.facts["answer"], width, more="  "), ""] if table.rows else []
    return "\n".join([*told, as_text(table, width)])


def summary(result: Any) -> str:
    """What a run says at its end: counts, reasons of failures, where the time went, best grasps, the file."""
    width = terminal_width()
    table = [best_text(dataset(result), width)] if np.any(result.status == DONE) else []
    again = f"; {RESUME}" if np.any(result.status == MISSING) else ""
    lines = [counts(result), *reasons(result, width), *time_split(result), *table]
    return "\n".join([*lines, f"results are in {result.path}{again}"])


def _count(table: Table) -> int:
    """Grasps that the rows of a merged table stand for."""
    last = str(table.rows[-1]["rank"]) if table.rows else "0"
    return int(last.replace("..", ",").rpartition(",")[2] or last)


def case_table(ds: xr.Dataset, cases: Iterable[Index], rank: bool = False, maps: Collection[str] = MAIN) -> Table:
    """Cases as rows: where they are, their maps with the errors that are known, their flags and notes.

    Parameters
    ----------
    ds : xarray.Dataset
        With flags as `study.ranking.judged` gives them.
    cases : iterable of indices over the axes of ``status``
    rank : bool
        Whether the cases are the best ones in their order, all at one force.
    maps : collection of str
        Which maps a table has; the first ones are the last that a narrow text leaves out.
    """
    axes, poses = axes_of(ds), ds.attrs["poses"]
    columns = [Column("rank")] if rank else [Column("state", wrap=NOTES_WIDTH)]
    for axis in axes[: -1 if rank else None]:
        title = "pose" if poses and axis.name == "station" else "force" if axis is axes[-1] else ""
        columns.append(Column(axis.name, axis.units, title, digits=5, people=not (poses and axis.name == "angle")))
    columns += [Column("label", wrap=LABEL_WIDTH)] * poses
    quantities = _map_columns(ds, maps)
    values = {c.name: values_of(ds, *_of_model(ds, c.name)) for c in quantities}
    bounds = [name for name in FORCE_RANGE if name in ds]
    columns += [*quantities, *(Column(name, "N", people=False) for name in bounds)]
    columns += [Column("safe_forces", "N", "safe forces", programs=False)] * bool(bounds)
    columns += [Column("flags", people=False), Column("notes", wrap=NOTES_WIDTH)]
    rows: list[Row] = []
    for place_, index in enumerate(cases, start=1):
        row: Row = {axis.name: float(axis.values[i]) for axis, i in zip(axes, index, strict=True)}
        row |= {axis.name: axis.options[i] for axis, i in zip(axes, index, strict=True) if axis.options}
        row |= {"rank": place_, "state": STATES[int(ds.status.values[index])]}
        row |= {"label": str(ds.label.values[index[-3:-1]]), "flags": int(ds["flags"].values[index]) & OF_FILE}
        row |= {name: float(found[index]) for name, found in values.items()}
        row |= {name: float(ds[name].values[index[:-1]]) for name in bounds}
        rows.append(row | {"safe_forces": safe_range(ds, index), "notes": note(ds, index)})
    return Table("", columns, rows)


def _map_columns(ds: xr.Dataset, maps: Collection[str]) -> list[Column]:
    """Each map before its error, and e_n also of the planar model that the paper compares with."""
    columns: list[Column] = []
    for name in (name for name in maps if name in ds):
        q, least = map_row(name), list(maps).index(name)
        error = next((e for e in (f"{name}_interval", q.of_error.name) if e in ds), "")
        columns.append(Column(name, q.unit, q.symbol, error, drop=least * (least > 2)))
        columns += [Column(error, ds[error].units, people=False)] if error else []
        if name == "e_n":
            columns.append(Column(f"e_n_{ds.attrs['planar']}", q.unit, drop=len(maps)))
    extra = [name for name in ("misalignment", "pad_elements") if name in ds and maps is MAIN]
    return [*columns, *(Column(name, ds[name].units, drop=99) for name in extra)]


def _of_model(ds: xr.Dataset, column: str) -> tuple[str, str]:
    """Name of a column's map and the friction model that it is of."""
    planar = ds.attrs["planar"]
    return ("e_n", planar) if column == f"e_n_{planar}" else (column, "ccm")


def safe_range(ds: xr.Dataset, index: Index) -> str:
    """Forces that hold the object and leave its wall undamaged; a plus: the wall bears the largest solved one."""
    known = {name: float(ds[name].values[index[:-1]]) for name in FORCE_RANGE if name in ds}
    low, high = (known.get(name, np.nan) for name in FORCE_RANGE)
    if np.isnan([*known.values()]).all():
        return "-"
    if len(known) > 1 and not low <= high:
        return "none"
    more = "+" * bool(high >= forces(ds)[-1] * (1 - NEGLIGIBLE))
    return "..".join("" if np.isnan(bound) else f"{bound:.3g}" for bound in (low, high)) + more


# --- notes -----------------------------------------------------------------------------------------------------------


def certainties(ds: xr.Dataset, order: Sequence[int], score: str, k: int) -> list[str]:
    """Whether the best grasp is better than the others beyond the errors, and which ones are none or cannot be used."""
    flags, shape = ds["flags"].values[..., k].ravel()[order], ds.status.shape[:-1]
    values = rank_values(ds, score, k)[order]
    units = ds[score].attrs.get("units", "") if score in ds else ""
    holding = [i for i, flag, value in zip(order, flags, values, strict=True) if not flag & LOST and np.isfinite(value)]
    same = [tuple(np.delete(index, -1)) for index in np.ndindex(shape)]
    notes = [verdict(sure(ds, score, k), holding, same, units).replace("+-", "±")]
    better, why = passed_over(values, flags)
    if better and score in ds:
        top = shown_text(values[better[0]], units, 3)
        count = "one grasp scores" if len(better) == 1 else f"{len(better)} grasps score"
        where = place(ds, (*unravelled(order[better[0]], shape), k))
        notes.append(f"{count} higher (up to {top}, {where}) but cannot be used and stand last: {why}")
    if none := no_grasps(ds.status.values[..., k]):
        notes.append(f"not solved: {', '.join(none)}; 'softjaw status' says why")
    return [note for note in notes if note]


def verdict(found: Sure | None, order: Sequence[int], place: Sequence[tuple[int, ...]], units: str = "") -> str:
    """One sentence on the best grasp against those that follow; empty where nothing is known of errors.

    Parameters
    ----------
    found : Sure or None
    order : sequence of int
        The grasps from the best one downward; those that fail in the hand left out.
    place : sequence of tuples of int
        Of every grasp, what images by symmetry have in common.
    units : str
        Of the values, in SI.
    """
    if found is None:
        return ""
    grasps = _without_images(found.value, order, place)
    if len(grasps) < 2:
        return ""
    judged = [found.apart(grasps[0], other) for other in grasps[1:]]
    if not np.isfinite(found.half_width[grasps]).any():
        return "errors are not known: not all cases are solved yet, or not with all samples of the uncertain inputs"
    if judged[0] is None:
        return "whether the best grasp is better than the second is not known: one of them has no error"
    alike = max((i for i, apart in enumerate(judged, start=1) if apart is False), default=0)
    one, other = (_text(found, i, units) for i in (grasps[0], grasps[alike or 1]))
    if not alike:
        return f"the best grasp is better than the second beyond the errors ({one} against {other})"
    between = "" if all(apart is False for apart in judged[:alike]) else ", though some between them can"
    return f"the first {alike + 1} grasps cannot be distinguished ({one} to {other}){between}"


def _without_images(value: np.ndarray, order: Sequence[int], place: Sequence[tuple[int, ...]]) -> list[int]:
    kept: list[int] = []
    for i in order:
        if not any(place[i] == place[j] and abs(value[i] - value[j]) <= TIE * abs(value[j]) for j in kept[-4:]):
            kept.append(i)
    return kept


def _text(found: Sure, i: int, units: str) -> str:
    value = f"{shown(found.value[i], units):#.4g}".rstrip(".")
    return f"{value} +- {shown_text(found.half_width[i], units, 2)}"


def _legend(flags: np.ndarray, listed: Sequence[int], k: int) -> list[str]:
    """What the flags in the table mean, and how many grasps have them."""
    marks = flags[..., k].ravel()[list(listed)]
    raised = flags_in(int(np.bitwise_or.reduce(marks, initial=0)))
    count = {flag: int(np.count_nonzero(marks & flag)) for flag in raised}
    words = [f"{flag.word} ({count[flag]} of {len(marks)}): {flag.sentence}"
             for flag in sorted(raised, key=lambda flag: -count[flag])]  # fmt: skip
    return ["; ".join(words)] * bool(words)


def meaning_of_errors(table: Table) -> str:
    """What the numbers behind ± are."""
    kinds = {c.error.rpartition("_")[2] for c in table.columns if c.error}
    return ", else ".join(text for kind, text in reversed(MEANING.items()) if kind in kinds)


def _solved_elsewhere(ds: xr.Dataset) -> str:
    """Which other forces have solved cases."""
    solved = np.any(ds.status.values == DONE, axis=tuple(range(ds.status.ndim - 1)))
    if not solved.any():
        return ", nor at any other force"
    return f"; --force takes {', '.join(f'{f:g}' for f in ds.normal_force.values[solved])}"


# --- the answer ------------------------------------------------------------------------------------------------------


def answer(ds: xr.Dataset, index: Index) -> str:
    """What to do with a grasp, the best one as a rule; ``index`` is its case at the force that is shown."""
    where = place(ds, index) or "the only candidate"
    parts = [f"grasp at {where}{_pads(ds, index)}"]
    if np.isfinite(opening := at(ds, "opening", index)):
        parts.append(f"open the gripper wider than {shown_text(opening, 'm', 3)}")
    return f"{', '.join(parts)}, {_press(ds, index)}".replace("\N{NO-BREAK SPACE}", " ")


def value_text(ds: xr.Dataset, name: str, index: Index, digits: int = 4, unit: bool = False) -> str:
    """A map's value in the unit in which it is shown, with its error where that is known."""
    q, value, si = BY_KEY.get(f"maps/{name}"), at(ds, name, index), ds[name].units if name in ds else ""
    error = at(ds, f"{name}_interval", index)
    if not np.isfinite(error) and q and q.error:
        error = q.error_in_unit(at(ds, q.of_error.name, index), value)
    text = with_error(*shown(np.array([value, error]), si)) if np.isfinite(error) else number(shown(value, si), digits)
    return f"{text} {shown_unit(si)}".rstrip() if unit else text


def force_to_use(ds: xr.Dataset, index: Index) -> tuple[float, float]:
    """Smallest force that holds the object at a candidate, and its error [N]; NaN where it is not known."""
    names = ("force_low", "force_low_error")
    low, error = (float(ds[n].values[index[:-1]]) if n in ds else float("nan") for n in names)
    return low, error


def _press(ds: xr.Dataset, index: Index) -> str:
    """How hard to press, and what is held then."""
    force, held = f"{forces(ds)[index[-1]]:.3g} N", value_text(ds, "payload", index, 3, unit=True)
    mass, safety = task_keys(ds, "object").get("mass_g"), task_keys(ds).get("safety", 1.0)
    aims = task_keys(ds).get("weight_direction", "worst") != "worst"
    every = "in the direction of its weight" if aims else "in whichever direction it pulls"
    if not np.isfinite(at(ds, "payload", index)):
        return f"press with {force} per finger"
    if mass is None or "force_low" not in ds:
        return f"press with {force} per finger: it then holds {held} {every}"
    low, error = force_to_use(ds, index)
    wanted = f"{safety:g} times the object's {shown_text(in_si('mass_g', mass), 'kg', 3)}"
    if not np.isfinite(low):
        return f"press with {force} per finger: it then holds {held} {every}, but no solved force holds {wanted}"
    least = with_error(low, error) if np.isfinite(error) else number(low)
    return f"press with {least} N per finger: it then holds {wanted} {every} ({held} at {force})"


def _pads(ds: xr.Dataset, index: Index) -> str:
    """Middle of both pads, the way finger 1 closes and their long side, in the frame of the object's own file."""
    if "finger_pose_origin" not in ds:
        return ""
    middle, turn = ds.finger_pose_origin.values[index].mean(axis=0), ds.finger_pose_rotation.values[index][0]
    if not np.isfinite([*middle, *turn.ravel()]).all():
        return ""
    # adding 0 turns -0 into 0
    x = ", ".join(f"{v + 0.0:.4g}" for v in np.round(shown(middle, "m"), 2))
    closing, long_side = (", ".join(f"{v + 0.0:.3g}" for v in np.round(turn[:, k], 3)) for k in (2, 0))
    return f" (pads about [{x}] mm, closing along [{closing}], long side along [{long_side}])"
