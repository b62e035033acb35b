"""Tables of a report: best grasps, cases and their reasons, checks, effects, cost, definitions, provenance."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from softjaw.study.page import Block, block_of, bullets, table, text
from softjaw.study.quantities import EFFECTS, FORCE_RANGE, PARTS, REASONS
from softjaw.study.ranking import largest
from softjaw.study.show.best_grasps import best, case_table
from softjaw.study.show.grasps import (
    ABOVE,
    LIMITS,
    choices,
    field,
    forces,
    number,
    order,
    passes,
    place,
    reason_lines,
    spoken,
    unravelled,
)
from softjaw.study.show.overview import wall_text
from softjaw.study.show.status import split_of

BEST = 6
# Columns of a page that has room for them.
SHOWN = ("payload", "quality", "quality_fitted", "e_n", "f_x_max", "f_y_max", "tau_z_max", "indentation", "wall_stress",
         "wall_strain", "support_force", "safety_factor")  # fmt: skip
SAFE = "Safe forces per finger hold the object's weight and are borne by its wall; +: also the largest solved force is."
STRESS = "Wall stress: largest von Mises stress on both faces. Support force: what bears the push across the approach."


def best_grasps(ds: xr.Dataset) -> list[Block]:
    """The best grasps at the force shown, the best one at each force, and the candidate that was asked for."""
    if ds.attrs["best"] is None:
        return []
    force, chosen = float(forces(ds)[ds.attrs["level"]]), ds.attrs["chosen"]
    table_ = best(ds, force, top=BEST, lines=True, maps=SHOWN)
    tops = [top for k in range(len(forces(ds))) for top in order(ds, k)[:1]]
    listed = {"Best grasp at each force": tops[len(forces(ds)) < 2 :], "Chosen candidate": [chosen][chosen is None :]}
    shown = {title: case_table(ds, cases, maps=SHOWN) for title, cases in listed.items() if cases}
    more = [block_of(replace(cases, title=title)) for title, cases in shown.items()]
    notes = [*[SAFE] * ("force_high" in ds), *table_.notes]
    return [block_of(table_, first=True), *more, *(text(note, "note") for note in notes)]


def reasons(ds: xr.Dataset, *wanted: int) -> list[Block]:
    """Why cases have no result, or notes on solved ones, alike messages together; empty where there are none."""
    lines = reason_lines(ds, *wanted)
    return [bullets(lines)] if lines else []


def every_case(ds: xr.Dataset) -> list[Block]:
    """A folded table of all cases."""
    count = ds.status.size
    if count == 1:
        return []
    if count > 8000:  # a page with more rows would be heavy
        return [text(f"The {count} cases are too many to list; softjaw export writes all of them.", "note")]
    cases = case_table(ds, np.ndindex(ds.status.shape), maps=[n for n in choices(ds, SHOWN[0]) if n not in FORCE_RANGE])
    folded = block_of(replace(cases, title=f"All {count} cases (CCM, weaker finger)"))
    return [{"kind": "details", "summary": f"All {count} cases as a table", "blocks": [folded]}]


def checks(ds: xr.Dataset) -> list[Block]:
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
    heads = ["check", "worst value", "should be", "", "worst case"]
    title = "Checks of the contact solutions, worst of all solved cases and fingers"
    return [table(title, heads, rows, texts=(0, 3, 4))] if rows else []


def wall(shape: Any) -> Block:
    """Limits of a thin wall, and what the maps of the best grasps say of it."""
    return text(f"The wall: {wall_text(shape)}. {STRESS}" if shape is not None else STRESS)


def effects(ds: xr.Dataset) -> list[Block]:
    """Level, indicator and reason of every effect over the solved cases."""
    rows = []
    for name, levels in EFFECTS.items():
        level, indicator, reason = (field(ds, f"effect_{name}_{part}") for part in ("level", "indicator", "reason"))
        if level is None or not (shown := _counted(level, levels)):
            continue
        low, high = (number(np.nan if indicator is None else f(indicator)) for f in (np.nanmin, np.nanmax))
        span = low if low == high else f"{low} to {high}"
        change = field(ds, f"effect_{name}_change")
        known = [] if change is None else 100.0 * change[np.isfinite(change)]
        moved = f"{min(known):+.2g} to {max(known):+.2g} % ({len(known)} measured)" if len(known) else ""
        rows.append([spoken(name), shown, span, moved, "" if reason is None else _counted(reason, REASONS)])
    heads = ["effect", "level", "indicator", "e_n moves by", "reason"]
    return [table("Effects that were simulated", heads, rows, texts=(0, 1, 3, 4))] if rows else []


def _counted(codes: np.ndarray, meaning: tuple[str, ...]) -> str:
    known = codes[np.isfinite(codes)].astype(int)
    counts = {c: int(np.sum(known == c)) for c in sorted(set(known.tolist()) & set(range(len(meaning))))}
    if len(counts) == 1:
        return meaning[next(iter(counts))]
    return "; ".join(f"{meaning[c]} ({n} of {known.size} cases)" for c, n in counts.items())


def time_split(ds: xr.Dataset) -> list[Block]:
    """Where the time of the solved cases went."""
    if (seconds := field(ds, "work_seconds_total")) is None:
        return []
    longest = unravelled(int(np.nanargmax(seconds)), seconds.shape)
    lines = split_of({part: ds[f"work_seconds_{part}"].values for part in ("total", *PARTS)})
    slowest = f"longest case: {number(seconds[longest])} s ({place(ds, longest, force=True)})"
    return [bullets([*lines, slowest])]


def definitions(ds: xr.Dataset) -> list[Block]:
    """The file's own definitions: its introduction, and one row for each quantity."""
    intro = ds.attrs["definitions"].partition("\n\n")[0]
    rows = [[str(name), v.attrs.get("units", ""), f"{v.attrs['long_name']}. {v.attrs['definition']}"]
            for name, v in ds.data_vars.items() if v.attrs.get("definition")]  # fmt: skip
    folded = table("What the numbers mean", ["variable", "unit (SI)", "meaning"], rows, (0, 1), (2,))
    return [text(" ".join(intro.split())), {"kind": "details", "summary": "All datasets", "blocks": [folded]}]


def scene(ds: xr.Dataset) -> list[Block]:
    """The effective scene and where it came from."""
    about = ds.attrs
    named = {"file": about["scene_file"], "overrides": about["overrides"].replace("\n", ", "),
             "digest": about["digest"], "petsc options": about["petsc_options"]}  # fmt: skip
    listed = bullets(f"{name}: {given}" for name, given in named.items() if given)
    return [listed, {"kind": "pre", "text": about["scene"]}]


def provenance(ds: xr.Dataset) -> list[Block]:
    """Sessions, programs and machines."""
    sessions = json.loads(ds.attrs["provenance"])
    rows = [[spoken(name), *(str(s[name]) for s in sessions)] for name in (sessions[0] if sessions else ())]
    head = ["session", *map(str, range(1, len(sessions) + 1))]
    return [table("Sessions", head, rows, wide=range(len(head)))] if rows else []
