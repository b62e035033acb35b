"""Tables of a report: best grasps, cases and their reasons, checks, effects, cost, definitions, provenance."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from softjaw.study.flags import flags_in
from softjaw.study.page import Block, block_of, bullets, details, table, text, verbatim
from softjaw.study.quantities import DONE, EFFECTS, NO_GRASP, PARTS, REASONS, STATES
from softjaw.study.ranking import largest
from softjaw.study.run.progress import duration
from softjaw.study.show.best_grasps import best, case_table, safe_range, value_text
from softjaw.study.show.grasps import (
    ABOVE,
    LIMITS,
    field,
    forces,
    grouped,
    label_of,
    number,
    order,
    passes,
    place,
    spoken,
    unravelled,
)
from softjaw.study.show.overview import RULE, wall_text
from softjaw.study.show.status import MOST_PLACES

BEST, MOST_REASONS = 6, 20
# Columns of a page that has room for them.
SHOWN = ("payload", "quality", "quality_fitted", "e_n", "f_x_max", "f_y_max", "tau_z_max")
MORE = ("epsilon", "contact_area", "p_max", "closing", "indentation", "wall_stress", "safety_factor")
WALL = ("indentation", "wall_stress", "wall_strain", "support_force", "safety_factor")
FORCED = REASONS.index("forced by the scene")
SAFE = "Safe forces per finger hold the object's weight and are borne by its wall; +: also the largest solved force is."
STRESS = "Wall stress: largest von Mises stress on both faces. Support force: what table or clamp bears along the axis."


def best_grasps(ds: xr.Dataset) -> list[Block]:
    """The best grasps at the force shown, and the best one at each force."""
    if ds.attrs["best"] is None:
        return []
    table_ = best(ds, top=BEST, lines=True, maps=SHOWN)
    tops = [top for k in range(len(forces(ds))) for top in order(ds, k)[:1]]
    blocks = [block_of(table_, first=True)]
    if len(forces(ds)) > 1:
        blocks.append(block_of(replace(case_table(ds, tops, maps=SHOWN), title="Best grasp at each force")))
    marks = int(np.bitwise_or.reduce([ds["flags"].values[index] for index in tops]))
    marks |= int(np.bitwise_or.reduce([row["flags"] for row in table_.rows]))
    words = [f"{flag.word}: {flag.sentence}." for flag in flags_in(marks)]
    return blocks + [text(sentence, "note") for sentence in [*[SAFE] * ("force_high" in ds), *words]]


def states(ds: xr.Dataset) -> list[Block]:
    """Counts of the cases by state, and notes on solved cases, alike ones together."""
    status = ds.status.values
    counts = [[name, str(int(np.sum(status == state)))] for state, name in enumerate(STATES)
              if state not in NO_GRASP or np.any(status == state)]  # fmt: skip
    return [table("State of the cases", ["state", "cases"], counts, texts=(0,)), *reasons(ds, DONE)]


def reasons(ds: xr.Dataset, *wanted: int) -> list[Block]:
    """Why cases have no result, or notes on solved ones, alike messages together; empty where there are none."""
    kinds = [reason for reason in grouped(ds) if reason.state in wanted]
    rows = [[STATES[kind.state], str(len(kind.cases)), kind.message, _places(ds, kind.cases)]
            for kind in kinds[:MOST_REASONS]]  # fmt: skip
    caption = "Notes on solved cases" if wanted == (DONE,) else "Why cases have no result"
    head = ["state", "cases", "message (one example)", "where"]
    blocks = [table(caption, head, rows, texts=(0,), wide=(2, 3))] if rows else []
    if len(kinds) > MOST_REASONS:
        more = f"{len(kinds) - MOST_REASONS} more kinds of messages are in status/message of the file."
        blocks.append(text(more, "note"))
    return blocks


def _places(ds: xr.Dataset, cases: list[tuple[int, ...]]) -> str:
    places = [place(ds, index, force=True) for index in cases[: 2 * MOST_PLACES]]
    return "; ".join([*places, *["…"] * (len(cases) > len(places))])


def every_case(ds: xr.Dataset) -> list[Block]:
    """A folded table of all cases."""
    count = ds.status.size
    if count == 1:
        return []
    if count > 8000:  # a page with more rows would be heavy
        summary = f"The {count} cases are too many to be listed here; softjaw export writes all of them."
        return [text(summary, "note")]
    names = [name for name in (*SHOWN, *MORE) if field(ds, name) is not None]
    cases = case_table(ds, np.ndindex(ds.status.shape), maps=names)
    title = f"All {count} cases (CCM, weaker finger)"
    return [details(f"All {count} cases as a table", [block_of(replace(cases, title=title))])]


def checks(ds: xr.Dataset) -> Block:
    """The worst value of each check over all solved cases, and where it was found."""
    rows = []
    for name in (*LIMITS, "max_strain"):
        values = field(ds, f"check_{name}")
        if values is None:
            continue
        index = unravelled(largest(-values if name in ABOVE else values), values.shape)
        worst = float(values[index])
        limit = f"> {LIMITS[name]:g}" if name in ABOVE else f"≤ {number(LIMITS[name])}" if name in LIMITS else "-"
        state = "-" if name not in LIMITS else "passed" if passes(name, worst) else "not passed"
        rows.append([spoken(name), number(worst), limit, state, place(ds, index[:-1], force=True)])
    if not rows:
        return text("No checks are stored.", "note")
    heads = ["check", "worst value", "should be", "", "worst case"]
    return table("Checks of the contact solutions, worst of all solved cases and fingers", heads, rows, texts=(0, 3, 4))


def wall(ds: xr.Dataset, shape: Any) -> list[Block]:
    """Limits of a thin wall, and what it bears in the best grasps at the force shown."""
    limits = [f"The wall: {wall_text(shape)}."] if shape is not None else []
    there = [name for name in WALL if field(ds, name) is not None]
    level, rows = field(ds, "effect_object_level"), []
    for index in order(ds, ds.attrs["level"])[:BEST]:
        values = [value_text(ds, name, index, 3) for name in there]
        known = level is not None and level[index] >= 0
        simulated = EFFECTS["object"][int(level[index])] if known else "-"
        rows.append([place(ds, index), *values, safe_range(ds, index), simulated])
    head = ["grasp", *(label_of(ds, name) for name in there), "safe forces [N]", "wall simulated as"]
    caption = f"The wall in the best grasps at {number(forces(ds)[ds.attrs['level']])} N per finger"
    return [text(" ".join([*limits, STRESS])), table(caption, head, rows, texts=(0, len(head) - 1), first=True)]


def effects(ds: xr.Dataset) -> list[Block]:
    """Level, indicator and reason of every effect over the solved cases, and the rule for a thin wall."""
    rows = []
    for name, levels in EFFECTS.items():
        level, indicator, reason = (field(ds, f"effect_{name}_{part}") for part in ("level", "indicator", "reason"))
        if level is None or not (shown := _counted(level, levels)):
            continue
        low, high = (number(np.nan if indicator is None else f(indicator)) for f in (np.nanmin, np.nanmax))
        span = low if low == high else f"{low} to {high}"
        change = field(ds, f"effect_{name}_change")
        moved = "" if change is None or not np.isfinite(change).any() else _percent(change)
        rows.append([spoken(name), shown, span, moved, "" if reason is None else _counted(reason, REASONS)])
    if not rows:
        return [text("No effects are stored.", "note")]
    heads = ["effect", "level", "indicator", "e_n moves by", "reason"]
    return [table("Effects that were simulated", heads, rows, texts=(0, 1, 3, 4)), *_rule(ds)]


def _percent(change: np.ndarray) -> str:
    """Range of relative changes, and how many there are."""
    known = 100.0 * change[np.isfinite(change)]
    return f"{known.min():+.2g} to {known.max():+.2g} % ({known.size} measured)"


def _counted(codes: np.ndarray, meaning: tuple[str, ...]) -> str:
    known = codes[np.isfinite(codes)].astype(int)
    counts = {c: int(np.sum(known == c)) for c in sorted(set(known.tolist()) & set(range(len(meaning))))}
    if len(counts) == 1:
        return meaning[next(iter(counts))]
    return "; ".join(f"{meaning[c]} ({n} of {known.size} cases)" for c, n in counts.items())


def _rule(ds: xr.Dataset) -> list[Block]:
    """How the level of a thin wall is chosen; empty without a wall."""
    level, reason = field(ds, "effect_object_level"), field(ds, "effect_object_reason")
    if "wall" not in ds.attrs["has"] or level is None or reason is None:
        return []
    if np.nanmin(reason) == FORCED:
        forced = EFFECTS["object"][int(np.nanmax(level))]
        return [text(f"The scene asks for one level of the object for every candidate: {forced}.", "note")]
    rule = f"The level of the object is chosen for each candidate, for all its forces, {RULE}. Its indicator is that"
    return [text(f"{rule} indentation over the wall's thickness.", "note")]


def time_split(ds: xr.Dataset) -> list[Block]:
    """Where the time of all cases went."""
    total = field(ds, "work_seconds_total")
    if total is None:
        return []
    whole = float(np.nansum(total))
    sums = {part: float(np.nansum(s)) for part in PARTS if (s := field(ds, f"work_seconds_{part}")) is not None}
    rows = [[part, duration(seconds), f"{seconds / whole:.0%}" if whole else "-"] for part, seconds in sums.items()]
    rows.append(["all", duration(whole), "100%"])
    longest = unravelled(int(np.nanargmax(total)), total.shape)
    slowest = f"Longest case: {number(total[longest])} s ({place(ds, longest, force=True)})."
    caption = f"Time of {int(np.sum(ds.status.values == DONE))} solved cases, summed over all ranks"
    return [table(caption, ["part", "time", "share"], rows, texts=(0,)), text(slowest, "note")]


def definitions(ds: xr.Dataset) -> list[Block]:
    """The file's own definitions: its introduction, and one row for each quantity."""
    intro = ds.attrs["definitions"].partition("\n\n")[0]
    rows = [[str(name), v.attrs.get("units", ""), f"{v.attrs['long_name']}. {v.attrs['definition']}"]
            for name, v in ds.data_vars.items() if v.attrs.get("definition")]  # fmt: skip
    head = ["variable", "unit (SI)", "meaning"]
    listed_rows = details("All datasets", [table("What the numbers mean", head, rows, (0, 1), (2,))])
    return [text(" ".join(intro.split())), listed_rows]


def scene(ds: xr.Dataset) -> list[Block]:
    """The effective scene and where it came from."""
    about = ds.attrs
    named = {"file": about["scene_file"], "overrides": ", ".join(about["overrides"]), "digest": about["digest"],
             "petsc options": about["petsc_options"]}  # fmt: skip
    return [bullets(f"{name}: {given}" for name, given in named.items() if given), verbatim(about["scene"])]


def provenance(ds: xr.Dataset) -> list[Block]:
    """Sessions, programs and machines."""
    sessions = ds.attrs["provenance"]
    if not sessions:
        return [text("No session is recorded.", "note")]
    rows = [
        [str(i), s["start"], s["stop"] or "-", s["reason"] if s["stop"] else "running, or killed", str(s["ranks"]),
         str(s["done"]), str(s["failed"])]
        for i, s in enumerate(sessions, start=1)
    ]  # fmt: skip
    head = ["session", "start", "stop", "how it ended", "ranks", "solved", "failed"]
    blocks = [table("Sessions", head, rows, texts=(1, 2, 3))]
    kinds: dict[tuple[str, ...], list[str]] = {}
    for i, s in enumerate(sessions, start=1):
        key = tuple(s[k] for k in ("program", "git", "versions", "host", "cpu", "command", "petsc_options"))
        kinds.setdefault(key, []).append(str(i))
    names = ("program", "sources", "versions", "host", "processor", "command", "PETSc options")
    for key, which in kinds.items():
        rows = [[name, given] for name, given in zip(names, key, strict=True) if given]
        caption = f"Program and machine of session {', '.join(which)}"
        blocks.append(table(caption, ["what", "value"], rows, texts=(0,), wide=(1,)))
    return blocks
