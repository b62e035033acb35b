"""Tables of a report: best grasps, cases and their reasons, checks, effects, cost, definitions, provenance."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.flags import flags_in
from softjaw.study.page import Block, bullets, details, table, text, verbatim
from softjaw.study.quantities import EFFECTS, PARTS, REASONS
from softjaw.study.result.layout import DONE, FAILED, MISSING
from softjaw.study.run.progress import duration
from softjaw.study.show.data import ABOVE, LIMITS, Data, number, passes
from softjaw.study.show.report.verdict import VALUES, flags_of, listed, safe_range, value
from softjaw.study.show.tables.overview import RULE, wall_text
from softjaw.study.show.tables.ranking import largest

HEADS = dict(zip(VALUES, ("quality", "quality, fitted", "e_n [mm]", "max f_x [N]", "max f_y [N]", "max tau_z [N mm]"),
                 strict=True))  # fmt: skip
BEST, MOST_REASONS, MOST_PLACES = 6, 20, 4
MOST_CASES = 8000  # that a page lists one by one; more would make it heavy
STATES = {DONE: "solved", FAILED: "failed", MISSING: "missing"}
MORE = ("epsilon", "contact_area", "p_max", "closing", "indentation", "wall_stress", "safety_factor")
WALL = ("indentation", "wall_stress", "wall_strain", "support_force", "safety_factor")
FORCED = REASONS.index("forced by the scene")
SAFE = (
    "Safe forces: normal forces per finger that hold the object's weight, where its mass is given, and that its wall"
    " bears; a plus: the wall bears the largest solved force."
)
STRESS = (
    "Wall stress is the largest von Mises stress on both faces; support force is what the table or the clamp has to"
    " bear along the axis because the pads push an object with sloping walls."
)


def best_grasps(data: Data) -> list[Block]:
    """The best grasps at the force shown, and the best one at each force."""
    order = data.order(data.k)
    if not order:
        return []
    walled = data.bound("force_high") is not None
    heads = ["grasp", *HEADS.values(), "safe forces [N]" if walled else f"e_n, PCM ({data.planar}) [mm]",
             "checks and notes"]  # fmt: skip
    chosen: list[tuple[int, ...]] = []
    merged: set[tuple[int, ...]] = set()
    for index in order:
        if index not in merged and len(chosen) < BEST:
            chosen.append(index)
            merged |= set(_turned(data, index))
    rows = [[_with_angles(data, index), *_row(data, index)] for index in chosen]
    caption = f"Best grasps at {number(data.forces[data.k])} N per finger, candidates solved: {len(order)} (CCM)"
    found = [table(caption, heads, rows, texts=(0,), wide=(len(heads) - 1,), first=True)]
    tops = [data.order(k)[:1] for k in range(len(data.forces))]
    if len(data.forces) > 1:
        none = ["–"] * (len(heads) - 2) + ["not solved"]
        rows = [[number(force), *([data.place(top[0]), *_row(data, top[0])] if top else ["–", *none])]
                for force, top in zip(data.forces, tops, strict=True)]  # fmt: skip
        found.append(table("Best grasp at each force", ["force [N]", *heads], rows, wide=(1, len(heads))))
    if walled:
        found.append(text(SAFE, "note"))
    listed_cases = (*chosen, *(index for top in tops for index in top))
    words = {flag.word: flag.sentence for index in listed_cases for flag in flags_of(data, index)}
    return found + [text(f"{word}: {meaning}.", "note") for word, meaning in words.items()]


def _turned(data: Data, index: tuple[int, ...]) -> list[tuple[int, ...]]:
    """The same place under other angles, with the same score."""
    return [i for i in data.images(index) if i[:-2] == index[:-2]]


def _with_angles(data: Data, index: tuple[int, ...]) -> str:
    angles = [number(np.degrees(data.axes[-2].values[i[-2]]), 4) + "°" for i in _turned(data, index)]
    return data.place(index) + (f" (and {listed(angles)})" if angles else "")


def _row(data: Data, index: tuple[int, ...]) -> list[str]:
    known = any(np.isfinite(data.check(name, index)) for name in LIMITS)
    checks = data.flagged(index) or ["passed" if known else "not stored"]
    notes = ", ".join([*checks, *(flag.word for flag in flags_of(data, index))])
    planar = number(data.at("e_n", index, data.planar) * 1e3, 4)
    last = planar if data.bound("force_high") is None else safe_range(data, index)
    return [*(value(data, name, index) for name in VALUES), last, notes]


def note(data: Data, index: tuple[int, ...]) -> str:
    """The reason of a failed case; the checks that a solved one misses, and its flags."""
    if data.status[index] == FAILED:
        return str(data.messages[index]) or "no reason was given"
    if data.status[index] != DONE:
        return ""
    return ", ".join([*data.flagged(index), *(flag.word for flag in flags_of(data, index))])


def states(data: Data) -> list[Block]:
    """Counts of the cases by state and by flag, and notes on solved cases, alike messages together."""
    counts = [[name, str(data.count(state))] for state, name in STATES.items()]
    found = [table("State of the cases", ["state", "cases"], counts, texts=(0,))]
    flags = data.flags[data.status == DONE]
    raised = flags_in(int(np.bitwise_or.reduce(flags))) if flags.size else []
    rows = [[f.word, str(int(np.sum(flags & f > 0))), f.sentence] for f in raised]
    if rows:
        found.append(table("Flags of solved cases", ["flag", "cases", "meaning"], rows, texts=(0,), wide=(2,)))
    return found + _reasons(data, DONE)


def failures(data: Data) -> list[Block]:
    """Why cases failed, alike reasons together; empty where none failed."""
    return _reasons(data, FAILED)


def _reasons(data: Data, state: int) -> list[Block]:
    caption = "Why cases failed" if state == FAILED else "Notes on solved cases"
    groups = data.grouped(state)
    rows = [[str(count), words, _places(data, where)] for count, words, where in groups[:MOST_REASONS]]
    found = [table(caption, ["cases", "message (one example)", "where"], rows, wide=(1, 2))] if rows else []
    if len(groups) > MOST_REASONS:
        more = f"{len(groups) - MOST_REASONS} more kinds of messages are in status/message of the file."
        found.append(text(more, "note"))
    return found


def _places(data: Data, where: list[tuple[int, ...]]) -> str:
    words = [data.place(index, force=True) for index in where[:MOST_PLACES]]
    return "; ".join([*words, *["…"] * (len(where) > MOST_PLACES)])


def every_case(data: Data) -> list[Block]:
    """A folded table of all cases."""
    if data.status.size == 1:
        return []
    if data.status.size > MOST_CASES:
        said = f"The {data.status.size} cases are too many to be listed here; softjaw export writes all of them."
        return [text(said, "note")]
    names = [name for name in (*VALUES, *MORE) if data.map(name) is not None]
    rows = [[data.place(i, force=True), STATES.get(int(data.status[i]), "missing"),
             *(value(data, name, i) for name in names), note(data, i)] for i in np.ndindex(data.shape)]  # fmt: skip
    heads = ["case", "state", *(HEADS.get(name) or data.label(name) for name in names), "notes"]
    caption = f"All {len(rows)} cases (CCM, weaker finger)"
    return [details(f"All {len(rows)} cases as a table",
                    [table(caption, heads, rows, texts=(0, 1), wide=(len(heads) - 1,))])]  # fmt: skip


def checks(data: Data) -> Block:
    """The worst value of each check over all solved cases, and where it was found."""
    rows = []
    for name in (*LIMITS, "max_strain"):
        found = data.values(f"checks/{name}")
        if found is None:
            continue
        index = np.unravel_index(largest(-found if name in ABOVE else found), found.shape)
        worst = float(found[index])
        limit = f"> {LIMITS[name]:g}" if name in ABOVE else f"≤ {number(LIMITS[name])}" if name in LIMITS else "–"
        state = "–" if name not in LIMITS else "passed" if passes(name, worst) else "not passed"
        rows.append([name.replace("_", " "), number(worst), limit, state, data.place(index[:-1], force=True)])
    if not rows:
        return text("No checks are stored.", "note")
    heads = ["check", "worst value", "should be", "", "worst case"]
    return table("Checks of the contact solutions, worst of all solved cases and fingers", heads, rows, texts=(0, 3, 4))


def wall(data: Data, shape: Any) -> list[Block]:
    """Limits of a thin wall, and what it bears in the best grasps at the force shown."""
    limits = [f"The wall: {wall_text(shape)}."] if shape is not None else []
    there = [name for name in WALL if data.map(name) is not None]
    level, rows = data.values("effects/object_level"), []
    for index in data.order(data.k)[:BEST]:
        values = [value(data, name, index, 3) for name in there]
        known = level is not None and np.isfinite(level[index])
        simulated = EFFECTS["object"][int(level[index])] if known else "–"
        rows.append([data.place(index), *values, safe_range(data, index), simulated])
    names = [data.label(name) for name in there]
    head = ["grasp", *names, "safe forces [N]", "wall simulated as"]
    caption = f"The wall in the best grasps at {number(data.forces[data.k])} N per finger"
    return [text(" ".join([*limits, STRESS])), table(caption, head, rows, texts=(0, len(head) - 1), first=True)]


def effects(data: Data) -> list[Block]:
    """Level, indicator and reason of every effect over the solved cases, and the rule for a thin wall."""
    rows = []
    for name, names in EFFECTS.items():
        parts = {part: data.values(f"effects/{name}_{part}") for part in ("level", "indicator", "reason")}
        if parts["level"] is None or not (chosen := _counted(parts["level"], names)):
            continue
        indicator = parts["indicator"]
        low, high = (np.nanmin(indicator), np.nanmax(indicator)) if indicator is not None else (np.nan, np.nan)
        area = number(low) if number(low) == number(high) else f"{number(low)} to {number(high)}"
        rows.append([name.replace("_", " "), chosen, area, _counted(parts["reason"], REASONS)])
    if not rows:
        return [text("No effects are stored.", "note")]
    heads = ["effect", "level", "indicator", "reason"]
    return [table("Effects that were simulated", heads, rows, texts=(0, 1, 3)), *_rule(data)]


def _counted(codes: np.ndarray | None, meaning: tuple[str, ...]) -> str:
    if codes is None:
        return ""
    known = codes[np.isfinite(codes)].astype(int)
    counts = {c: int(np.sum(known == c)) for c in sorted(set(known.tolist()) & set(range(len(meaning))))}
    if len(counts) == 1:
        return meaning[next(iter(counts))]
    return "; ".join(f"{meaning[c]} ({n} of {known.size} cases)" for c, n in counts.items())


def _rule(data: Data) -> list[Block]:
    """What the indicator of a thin wall is and how its level follows from it; empty without a wall."""
    level, reason = data.values("effects/object_level"), data.values("effects/object_reason")
    if not data.walled or level is None or reason is None:
        return []
    said = f"The level of the object is chosen for each candidate, for all its forces, {RULE}. Its indicator is that"
    said += " indentation over the wall's thickness."
    if np.nanmin(reason) == FORCED:
        name = EFFECTS["object"][int(np.nanmax(level))]
        said = f"The scene asks for one level of the object for every candidate: {name}."
    return [text(said, "note")]


def time_split(data: Data) -> list[Block]:
    """Where the time of all cases went."""
    total = data.values("work/seconds_total")
    if total is None:
        return []
    whole = float(np.nansum(total))
    found = {part: data.values(f"work/seconds_{part}") for part in PARTS}
    sums = {part: float(np.nansum(seconds)) for part, seconds in found.items() if seconds is not None}
    rows = [[part, duration(seconds), f"{seconds / whole:.0%}" if whole else "–"] for part, seconds in sums.items()]
    rows.append(["all", duration(whole), "100%"])
    longest = np.unravel_index(np.nanargmax(total), total.shape)
    note = f"Longest case: {number(total[longest])} s ({data.place(longest, force=True)})."
    caption = f"Time of {data.count(DONE)} solved cases, summed over all ranks"
    return [table(caption, ["part", "time", "share"], rows, texts=(0,)), text(note, "note")]


def definitions(data: Data) -> list[Block]:
    """The file's own definitions: its introduction, and one row for each quantity."""
    intro = data.ds.attrs["definitions"].partition("\n\n")[0]
    rows = [[str(name), v.attrs.get("units", ""), f"{v.attrs['long_name']}. {v.attrs['definition']}"]
            for name, v in data.ds.data_vars.items() if v.attrs.get("definition")]  # fmt: skip
    head = ["variable", "unit (SI)", "meaning"]
    listed_rows = details("All datasets", [table("What the numbers mean", head, rows, (0, 1), (2,))])
    return [text(" ".join(intro.split())), listed_rows]


def scene(data: Data) -> list[Block]:
    """The effective scene and where it came from."""
    about = data.ds.attrs
    named = {"file": about["scene_file"], "overrides": ", ".join(about["overrides"]), "digest": about["digest"],
             "petsc options": about["petsc_options"]}  # fmt: skip
    items = [f"{name}: {words}" for name, words in named.items() if words]
    return [bullets(items), verbatim(about["scene"])]


def provenance(data: Data) -> list[Block]:
    """Sessions, programs and machines."""
    sessions = data.ds.attrs["provenance"]
    if not sessions:
        return [text("No session is recorded.", "note")]
    rows = [
        [str(i), s["start"], s["stop"] or "–", s["reason"] if s["stop"] else "running, or ended without a word",
         str(s["ranks"]), str(s["done"]), str(s["failed"])]
        for i, s in enumerate(sessions, start=1)
    ]  # fmt: skip
    head = ["session", "start", "stop", "how it ended", "ranks", "solved", "failed"]
    found = [table("Sessions", head, rows, texts=(1, 2, 3))]
    kinds: dict[tuple[str, ...], list[str]] = {}
    for i, s in enumerate(sessions, start=1):
        key = tuple(s[k] for k in ("program", "git", "versions", "host", "cpu", "command", "petsc_options"))
        kinds.setdefault(key, []).append(str(i))
    names = ("program", "sources", "versions", "host", "processor", "command", "PETSc options")
    for key, which in kinds.items():
        rows = [[name, words] for name, words in zip(names, key, strict=True) if words]
        caption = f"Program and machine of session {', '.join(which)}"
        found.append(table(caption, ["what", "value"], rows, texts=(0,), wide=(1,)))
    return found
