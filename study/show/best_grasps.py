"""The best grasps of a result file: one table for terminal, page, CSV and JSON, and the answer in a sentence."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softjaw.friction.patch import NEGLIGIBLE
from softjaw.study.case.result import TIE
from softjaw.study.flags import BORNE, LOST, OF_FILE, Flag, flag_words, flags_in
from softjaw.study.messages import first_of
from softjaw.study.quantities import BY_KEY, FORCE_RANGE, LEAST_FORCE, LISTED, MAIN, MISSING, MODELS, STATES, map_row
from softjaw.study.ranking import (
    distinct,
    hand_of,
    index_of,
    judge,
    keys_at,
    least_force,
    passed_over,
    rank_values,
    score_of,
    sure,
    task_keys,
    window,
)
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import axes_of, dataset, other_levels, values_of
from softjaw.study.show.grasps import Index, at, candidate_of, forces, largest_force, note, order, place
from softjaw.study.show.places import folded_text, named, short_name, side_text, spot
from softjaw.study.show.status import (
    MOST_PLACES,
    RESUME,
    aim,
    counts,
    largest_error,
    no_grasps,
    reasons,
    time_split,
    unfinished,
)
from softjaw.study.table import Column, Row, Table, as_text, number, terminal_width, with_error, wrapped
from softjaw.study.units import in_si, shown, shown_text, shown_unit

if TYPE_CHECKING:
    import xarray as xr  # slow to load, and a run needs it at its end only

NOTES_WIDTH, OTHERS_WIDTH, LABEL_WIDTH = 13, 16, 20  # characters
PLANAR_E_N = f"e_n_{MODELS[1]}"  # column
BRIEF = ("payload", "opening", "quality", "e_n")  # maps of a table in a terminal
FINER = Flag.COARSE | Flag.NO_FIT | Flag.NO_CORNERS | Flag.NODAL | Flag.LEFT_OUT  # what a finer mesh or effect cures


def best(
    ds: xr.Dataset,
    force: float | None = None,
    top: int = LISTED,
    by: str | None = None,
    lines: bool = False,
    maps: Collection[str] = MAIN,
) -> Table:
    """The ``top`` grasps (0: all) at a force [N], by default that of `study.ranking.window` or `shown_level`.

    Between two solved forces values lie on power laws. ``by`` names the map that grasps are ranked by. With
    ``lines`` images of one grasp share a row, and rows are counted. Where the scene names a gripper, listed grasps that
    its hand does not reach come last.

    Raises `ValueError` for a force outside of the solved ones.
    """
    ds = judge(ds, force=window(ds) if force is None else force, by=by, top=top, lines=lines)
    k, score, ranking = ds.attrs["level"], ds.attrs["score"], order(ds, ds.attrs["level"])
    places = distinct(ds, [candidate_of(ds, index) for index in ranking], rank_values(ds, score, k), k, top)
    listed = [index_of(ds, place.best, k) for place in places] if lines else ranking[: top or None]
    marks = ds["flags"].values[tuple(np.array(listed, int).reshape(-1, ds.status.ndim).T)]
    table = case_table(ds, listed, True, maps, common(marks) if maps is BRIEF else 0)
    if not ranking:
        if "between" in ds.attrs:
            low, high = ds.attrs["between"]
            text = f"contacts change between {low:g} and {high:g} N, or one of them is not solved"
            return Table(f"no value at {forces(ds)[k]:g} N: {text}", table.columns, ())
        solved = np.any(ds.status.values == DONE, axis=tuple(range(ds.status.ndim - 1)))
        others_ = ", ".join(f"{f:g} N" for f in forces(ds)[solved]) or "none; 'softjaw status' says why"
        return Table(f"no candidate is solved at {forces(ds)[k]:g} N; forces with one: {others_}", table.columns, ())
    rows = [row | {"others": folded_text(ds, place)} for row, place in zip(table.rows, places, strict=False)]
    others = [Column("others", programs=False, wrap=OTHERS_WIDTH)] * any(row["others"] for row in rows)
    columns = [column._replace(drop=0) if column.name == score else column for column in table.columns]
    columns = [*columns[:-1], *others, columns[-1]]
    what = ("place" if lines else "candidate") + "s" * (len(listed) != 1)
    title = f"best {len(listed)} {what} of {len(ranking)} solved candidates by {score} at {forces(ds)[k]:g} N"
    shown = np.full(ds.status.shape, MISSING)
    shown[tuple(np.array(listed).T)] = DONE
    errors, alone = ds.get(f"{aim(ds)[0]}_error"), ds.assign(status=(ds.status.dims, shown))
    known = errors is not None or "e_n_interval" not in ds
    error = largest_error(errors, alone, axes_of(ds), ds.label.values) if known else []
    notes = _notes(ds, [certainty(ds, [place.best for place in places], score, k), *error], marks)
    answers = {key: ", ".join(filter(None, texts)) for key, texts in answer(ds, ranking[0]).items()}
    facts = {"answer": answers, "pads": pads(ds, ranking[0]), "force": float(forces(ds)[k]), "ranked_by": score,
             "largest_error": "; ".join(error)}  # fmt: skip
    return Table(title, columns if lines else table.columns, rows if lines else table.rows, notes, facts, "grasps")


def best_text(ds: xr.Dataset, width: int, force: float | None = None, top: int = LISTED, by: str | None = None) -> str:
    """The answer and the best grasps for a terminal; the choice is that of `best`."""
    table = best(ds, force, top, by, lines=True, maps=BRIEF)
    answers = [wrapped(f"{name:<9}{text}", width, more=" " * 9) for name, text in table.facts.get("answer", {}).items()]
    return "\n".join([*answers, *[""] * bool(answers), as_text(table, width)])


def summary(result: Any) -> str:
    """What a run says at its end: counts, reasons of failures, where the time went, best grasps, the file."""
    width = terminal_width()
    table = [best_text(dataset(result), width)] if np.any(result.status == DONE) else []
    again = f"; {RESUME}" if unfinished(result) else ""
    lines = [counts(result), *reasons(result, width, notes=not table), *time_split(result), *table]
    return "\n".join([*lines, f"results are in {result.path}{again}"])


def case_table(
    ds: xr.Dataset, cases: Iterable[Index], rank: bool = False, maps: Collection[str] = MAIN, known: int = 0
) -> Table:
    """Cases as rows: where they are, their maps with the errors that are known, their flags and notes.

    ``ds`` (xarray.Dataset): with flags as `study.ranking.judged` gives them. ``rank``: whether the cases are the best
    ones in their order, all at one force. ``maps``: which maps a table has; the first ones are the last that a narrow
    text leaves out. ``known``: flags that its notes do not repeat.
    """
    axes, poses = axes_of(ds), ds.attrs["poses"]
    columns = [Column("rank"), Column("name")] if rank else [Column("name"), Column("state", wrap=NOTES_WIDTH)]
    for axis in axes[: -1 if rank else None]:
        title, pose = "force" if axis is axes[-1] else "", poses and axis.name in ("station", "angle")
        columns.append(Column(axis.name, axis.units, title, digits=5, display=not pose))
    columns += [Column("label", wrap=LABEL_WIDTH, display=named(ds))] if poses else []
    middles = ds["finger_pose_origin"].values.mean(axis=-2) if poses and "finger_pose_origin" in ds else None
    columns += [Column(axis, "m", display=False) for axis in "xyz"] * (middles is not None)
    bounds = [Column(name, "N", display=False) for name in FORCE_RANGE if name in ds]
    quantities = [*_map_columns(ds, maps), *bounds]
    values = {c.name: values_of(ds, c.name) for c in quantities if c.name in ds}
    values[PLANAR_E_N] = values_of(ds, "e_n", MODELS[1])
    first = 1 + bool(quantities and quantities[0].error)  # a wide table does not scroll the safe forces out
    safe = [Column("safe_forces", "N", "safe forces", programs=False)] * bool(bounds)
    columns += [*quantities[:first], *safe, *quantities[first:]]
    columns += [Column("flags", display=False), Column("notes", wrap=NOTES_WIDTH)]
    rows: list[Row] = []
    for place_, index in enumerate(cases, start=1):
        row: Row = {a.name: a.options[i] if a.options else float(a.values[i]) for a, i in zip(axes, index, strict=True)}
        row |= {"rank": place_, "name": short_name(ds, candidate_of(ds, index))}
        row |= {"state": STATES[int(ds.status.values[index])]}
        row |= {"label": str(ds.label.values[index[-3:-1]]), "flags": int(ds["flags"].values[index]) & OF_FILE}
        row |= {} if middles is None else dict(zip("xyz", middles[index].tolist(), strict=True))
        row |= {name: float(array[index]) for name, array in values.items()}
        rows.append(row | {"safe_forces": safe_range(ds, index), "notes": note(ds, index, known)})
    return Table("", columns, rows)


def _map_columns(ds: xr.Dataset, maps: Collection[str]) -> list[Column]:
    """Each map before its error, and e_n also of the planar model that the paper compares with."""
    columns: list[Column] = []
    for name in (name for name in maps if name in ds):
        q, least = map_row(name), list(maps).index(name)
        error, interval = q.of_error.name if q.of_error.name in ds else "", f"{name}_interval"
        columns.append(Column(name, q.unit, q.symbol, error, q.error == "relative", drop=least))
        columns += [Column(error, ds[error].units, display=False)] if error else []
        columns += [Column(interval, q.unit, "± inputs", digits=2, drop=50 * least)] * (interval in ds)
        if name == "e_n" and maps is not BRIEF:
            columns.append(Column(PLANAR_E_N, q.unit, drop=len(maps)))
    extra = [name for name in ("misalignment", "pad_elements") if name in ds and maps is MAIN]
    return [*columns, *(Column(name, ds[name].units, drop=99) for name in extra)]


def safe_range(ds: xr.Dataset, index: Index) -> str:
    """Forces that hold the object and leave its wall undamaged; a plus: the wall bears the largest solved one."""
    low, high = (at(ds, name, index) for name in FORCE_RANGE)
    if np.isnan([low, high]).all():
        return "-"
    if "force_low" in ds and np.isnan(low):
        return "none"
    low = np.fmax(low, least_force(ds) or np.nan)
    if low > high:
        return "none"
    more = "+" * bool(high >= largest_force(ds) * (1 - NEGLIGIBLE) and not at(ds, "force_high_error", index) > 0)
    return "..".join("" if np.isnan(bound) else f"{bound:.3g}" for bound in (low, high)) + more


# --- notes -----------------------------------------------------------------------------------------------------------


def certainty(ds: xr.Dataset, places: Sequence[int], score: str, k: int) -> str:
    """How many of some places, the best first, are equal to the first within the errors."""
    errors = sure(ds, score, k)
    if errors is None:
        return ""
    marks = ds["flags"].values[..., k].ravel() & LOST
    usable = (marks & ~(marks[places[0]] & Flag.TOO_WEAK) == 0) & np.isfinite(errors.value)
    first, *others = [i for i in places if usable[i]] or [0]
    apart = [errors.apart(first, i) for i in others]
    if not apart:
        return ""
    if apart[0] is None:
        return "places 1 and 2 cannot be compared: one has no error yet"
    vague = errors.vague
    close = [(n, vague[i]) for n, (i, better) in enumerate(zip(others, apart, strict=True), start=2) if not better]
    alike, hardly = ([n for n, is_vague in close if is_vague == how] for how in (False, True))
    unknown = f"too little is known of {', '.join(map(str, hardly))}"
    if len(hardly) == len(others):
        return f"{unknown} to compare them with place 1"
    more = f", but {unknown}" * bool(hardly)
    if not alike:
        return f"place 1 is best beyond errors{more}"
    without_gap, last = alike[-1] == len(alike) + 1 > 2, alike.pop()
    names = f"1 to {last}" if without_gap else f"{', '.join(map(str, [1, *alike]))} and {last}"
    return f"places {names} are equal within errors{more}"


def common(marks: np.ndarray) -> int:
    """Flags that more than half of some grasps have: a line below says it once."""
    share = ((flag, np.mean(marks & flag != 0)) for flag in flags_in(int(np.bitwise_or.reduce(marks, initial=0))))
    return sum(int(flag) for flag, part in share if part > 0.5 and len(marks) > 2)


def _notes(ds: xr.Dataset, accuracy: Sequence[str], marks: np.ndarray) -> list[str]:
    """At most five notes by what to do about them: how exact, which flags to look at, what is to come or left out."""
    states = ds.status.values[..., ds.attrs["level"]]
    between = "between" in ds.attrs
    apart = [short_name(ds, int(c)) for c in np.flatnonzero(between & (states == MISSING))]
    to_come = np.count_nonzero(ds.status.values == MISSING) * (not between)
    count = {flag: int(np.count_nonzero(marks & flag)) for flag in Flag if flag != Flag.OUT_OF_REACH}
    raised = sorted(filter(count.get, count), key=lambda flag: (-count[flag], flag))
    words = {flag: f"{flag.word} ({count[flag]} of {len(marks)})" for flag in raised}
    faults = [flag for flag in raised if not flag & FINER]
    off = float(ds.attrs.get("object_centroid_error", [0.0])[0])  # of a mesh that is not closed
    centre = f"known to {1e3 * off:.0f} mm, not in the errors: set task.centre_of_mass_mm"
    preset = task_keys(ds, "gripper").get("preset") or ""
    parts = {"centre of mass": [centre] * (off > 1e-3),
             "accuracy": [*filter(None, accuracy), *(words[flag] for flag in raised if flag & FINER)],
             "look at": [f"{words[f]}{f': {f.sentence}' * (len(faults) == 1)}" for f in faults],
             "not ended": [f"{to_come} cases are not computed yet"] * bool(to_come),
             "left out": [*no_grasps(states), *[f"{_some(apart)}, as its contact changes"] * bool(apart)]}  # fmt: skip
    if gone := [short_name(ds, c) for c, approach in ds.attrs["reach"].items() if approach == ()]:
        parts["left out"] = [f"out of the reach of {Path(preset).stem}, so last: {_some(gone)}", *parts["left out"]]
    elif preset and not hand_of(ds):
        parts["left out"] = [f"the reach and the forces of the hand, as {preset} cannot be read", *parts["left out"]]
    return [f"{head}: {'; '.join(clauses)}" for head, clauses in parts.items() if clauses]


def _some(names: Sequence[str]) -> str:
    return ", ".join(first_of(names, MOST_PLACES, ""))


# --- the answer ------------------------------------------------------------------------------------------------------


def answer(ds: xr.Dataset, index: Index) -> dict[str, tuple[str, str]]:
    """What to do with a grasp, and more about it: where, how wide, how hard, what it holds, why it holds no more.

    ``index`` is its case at the force that is shown, of a dataset that `study.show.grasps.judge` gave.
    """
    (part, beside), name = spot(ds, index), place(ds, index)
    nameless = ds.attrs["poses"] and part and not named(ds)
    lines = {"where": (part, f"{beside} ({name})") if nameless else (name, ", ".join(filter(None, (part, beside))))}
    if np.isfinite(opening := at(ds, "opening", index)):
        approach = ds.attrs["reach"].get(candidate_of(ds, index))
        hand = f", the hand comes {side_text(np.array(approach))}" if approach else ""
        lines["opening"] = (shown_text(opening, "m", 3), f"at first touch{hand}")
    lines |= {"force": _force(ds, index), "holds": _held(ds, index), "limit": ("", _limit(ds, index))}
    return {key: value for key, value in lines.items() if any(value)}


def value_text(ds: xr.Dataset, name: str, index: Index, digits: int = 4, unit: bool = False) -> str:
    """A map's value in the unit in which it is shown, with its error where that is known."""
    q, value, si = BY_KEY.get(f"maps/{name}"), at(ds, name, index), ds[name].units if name in ds else ""
    error = q.error_in_unit(at(ds, q.of_error.name, index), value) if q and q.error else np.nan
    text = with_error(*shown(np.array([value, error]), si)) if np.isfinite(error) else number(shown(value, si), digits)
    return f"{text} {shown_unit(si)}".rstrip() if unit else text


def _force(ds: xr.Dataset, index: Index) -> tuple[str, str]:
    """How hard to press: the least force that holds the mass, else what some forces hold and how to name a mass."""
    mass, safety = keys_at(ds, index, "object").get("mass_g"), keys_at(ds, index).get("safety", 1.0)
    pressed = f"{number(forces(ds)[index[-1]], 3)} N per finger"
    if mass is None:
        some = [(*index[:-1], k) for k in other_levels(len(forces(ds)), index[-1])]
        known = [i for i in some if np.isfinite(at(ds, "payload", i)) and not int(ds["flags"].values[i]) & LOST]
        payloads = ", ".join(f"{value_text(ds, 'payload', i, 3, unit=True)} at {forces(ds)[i[-1]]:g} N" for i in known)
        return pressed, "; ".join(filter(None, (ds.attrs["why"], payloads, "object.mass_g gives the least")))
    wanted = f"{safety:g} times its {shown_text(in_si('mass_g', mass), 'kg', 3)}"
    low, error = (at(ds, name, index) for name in ("force_low", "force_low_error"))
    if np.isfinite(low):
        known = np.isfinite(error)
        covers = "±: mesh, interpolation, not mu" if known else "error not known"
        least = with_error(low, error) if known else number(low, 3)
        of_hand, name = least_force(ds), Path(task_keys(ds, "gripper").get("preset") or "").stem
        if at(ds, "force_high", index) < max(low, of_hand):
            press = f"; {name} presses with {of_hand:g} N at least" * (of_hand > low)
            need = f"{wanted} need {least} N per finger ({covers}), the wall bears {_borne(ds, index)}"
            return "none is safe", need + press
        usable = (ds.status.values[index[:-1]] == DONE) & (ds["flags"].values[index[:-1]] & LOST == 0)
        reached = not int(ds["flags"].values[index]) & Flag.OUT_OF_REACH  # another force would not help
        harm = not usable.any() and reached and "between" not in ds.attrs
        alone = "; no solved force does without harm: solve one" * harm
        if low < of_hand:
            return f"{of_hand:g} N per finger", f"the least of {name}; {least} N hold {wanted} ({covers}){alone}"
        return f"{least} N per finger", f"the least that holds {wanted} ({covers}){alone}"
    weak = not at(ds, "safety_factor", index) >= safety * (1 - TIE)
    return pressed, f"no solved force holds {wanted}" if weak else f"the smallest solved force that holds {wanted}"


def _borne(ds: xr.Dataset, index: Index) -> str:
    """The largest force that the wall bears, with its error where that is known."""
    high, error = (at(ds, name, index) for name in ("force_high", "force_high_error"))
    return f"{with_error(high, error) if error > 0 else number(high, 3)} N"


def _held(ds: xr.Dataset, index: Index) -> tuple[str, str]:
    """What is held at the force shown, and what its error covers."""
    if not np.isfinite(at(ds, "payload", index)):
        return "", ""
    aims = keys_at(ds, index).get("weight_direction", "worst") != "worst"
    every = "in the direction of its weight" if aims else "pulled in any direction"
    every += f" at {forces(ds)[index[-1]]:g} N" * ("force_low" in ds)
    share = at(ds, "payload_error", index)
    covers = "±: mesh and method" if np.isfinite(share) else "error not known"
    if np.isfinite(interval := at(ds, "payload_interval", index)):
        covers += f"; inputs: ± {shown_text(interval, 'kg', 2)} in 95 %"
    return value_text(ds, "payload", index, 3, unit=True), f"{every} ({covers})"


def _limit(ds: xr.Dataset, index: Index) -> str:
    """Why a grasp holds no more: what lies beyond its force, and better grasps that fail."""
    k, high = index[-1], at(ds, "force_high", index)
    if high < largest_force(ds) * (1 - NEGLIGIBLE):
        friction = f"friction at {forces(ds)[k]:g} N, and " * bool(forces(ds)[k] < high)
        solved = (ds.status.values[index[:-1]][forces(ds) > high * (1 + NEGLIGIBLE)] == DONE).any()
        # between two solved forces those beyond are not known, but a bound that is none of them is the wall's own
        solved |= "between" in ds.attrs and not np.isclose(ds.attrs["between"], high).any()
        bears = f"which bears {_borne(ds, index)} at most" if solved else f"beyond {high:g} N nothing is solved"
        parts = [f"{friction}the wall, {bears}"]
    else:
        parts = [f"friction at {forces(ds)[k]:g} N{_beyond(ds, index)}"]
    done = np.flatnonzero(ds["status"].values[..., k].ravel() == DONE)
    name = ds.attrs["score"] if ds.attrs["score"] != LEAST_FORCE else score_of(ds)
    values = rank_values(ds, name, k)[done]
    better, lacks = passed_over(values, ds["flags"].values[..., k].ravel()[done])
    if better:
        top = f"{short_name(ds, int(done[better[0]]))} with {shown_text(values[better[0]], ds[name].units, 3)}"
        parts.append(f"{len(better)} with more {name} cannot be used ({top}): {lacks}")
    faults = flags_in(int(ds["flags"].values[index]) & LOST & ~BORNE)
    return "; ".join([*(fault.sentence for fault in faults), *parts])


def _beyond(ds: xr.Dataset, index: Index) -> str:
    """What a larger force would do, at the largest one that is solved."""
    last = (*index[:-1], len(forces(ds)) - 1)
    if last == index:
        return ", the largest solved" * ("between" not in ds.attrs)
    payload = f"it holds {value_text(ds, 'payload', last, 3, unit=True)}" * bool(np.isfinite(at(ds, "payload", last)))
    more = flag_words(int(ds["flags"].values[last]) & LOST) or payload
    return f"; at {forces(ds)[-1]:g} N {more}" if more else ""


def pads(ds: xr.Dataset, index: Index) -> dict[str, Any]:
    """Middle of both pads [m], the way finger 1 closes and their long side, in the frame of the object's own file."""
    if "finger_pose_origin" not in ds:
        return {}
    turn = ds.finger_pose_rotation.values[index][0]
    return {"middle": ds.finger_pose_origin.values[index].mean(axis=0), "closing": turn[:, 2], "long_side": turn[:, 0]}
