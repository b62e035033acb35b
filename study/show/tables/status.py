"""What a result file holds so far: complete cases, failed ones with reasons, the rest, and how each session ended."""

from __future__ import annotations

import json
import tomllib
from argparse import Namespace
from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.export.csv_yaml import csv_text, with_unit
from softjaw.study.flags import flag_sentences, flags_in
from softjaw.study.quantities import DONE, E_N_TARGET, FAILED, MISSING, NO_GRASP, PARTS, STATES, map_row, misses
from softjaw.study.result.lock import holder
from softjaw.study.result.store import open_result, place_text
from softjaw.study.run.progress import duration
from softjaw.study.run.refine import about
from softjaw.study.show.tables.columns import PAPER, terminal_width, wrapped

MOST_REASONS, MOST_PLACES = 12, 3
NO_ERRORS = "errors of the mesh: not known; accuracy.meshes = 2 in the scene gives them"


def status(options: Namespace) -> str:
    """Say what a result file holds so far, as text, JSON or CSV."""
    forms = {"json": status_json, "csv": status_csv}
    with open_result(options.file) as result:
        return forms[options.form](result) if options.form else status_text(result, terminal_width())


def status_text(result: Any, width: int = PAPER) -> str:
    """Answer of ``softjaw status``; the file may be growing meanwhile."""
    runner = holder(result.path)
    open_cases = np.any(result.status == MISSING)
    state = f"running now: {runner}" if runner else "run the same command again to resume" if open_cases else ""
    error = largest_mesh_error(result)
    known = [wrapped(error, width, "  ", "  ")] * bool(error)
    lines = [counts(result), *known, *([wrapped(state, width)] if state else []), *reasons(result, width)]
    return "\n".join([*lines, *sessions(result, bool(runner), width)])


def largest_mesh_error(result: Any) -> str:
    """The largest error by the mesh so far of what the scene's target is for."""
    row = map_row(aim(result)[0]).of_error
    errors = result.read(f"{row.name}/{row.name}") if row in result.layout.quantities else None
    return largest_error(errors, result, result.axes, result.labels)


def aim(cases: Any) -> tuple[str, float]:
    """What the target of a file's scene is for, and the relative error; e_n and the usual one where it names none."""
    accuracy = tomllib.loads(cases.scene).get("accuracy", {})
    if "target" not in accuracy:
        return "e_n", E_N_TARGET
    return accuracy["target_of"], accuracy["target"]


def largest_error(errors: NDArray[np.float64] | None, cases: Any, axes: Sequence[Any], labels: Any) -> str:
    """The largest error by the mesh, how many are above the target, and how many solved cases have none.

    Parameters
    ----------
    errors : array over the cases
        Relative errors; None where a file has none.
    cases : Result or xarray.Dataset
        Has ``status`` and ``scene``.
    axes, labels
        As `result.store.place_text` takes them.
    """
    status = np.asarray(cases.status)
    solved = int(np.count_nonzero(status == DONE))
    if not solved or errors is None:
        return NO_ERRORS if solved else ""
    known = np.where(status == DONE, errors, np.nan)
    count = int(np.count_nonzero(np.isfinite(known)))
    if not count:
        return f"errors of the mesh: none of {solved} solved cases has one"
    worst = tuple(map(int, np.unravel_index(int(np.nanargmax(known)), status.shape)))
    name, target = aim(cases)
    parts = [f"largest error of {name} by the mesh: {100 * known[worst]:.2g} % ({place_text(axes, labels, worst)})"]
    if above := int(np.count_nonzero(misses(known, target))):
        parts.append(f"{above} of {count} cases above {100 * target:g} %")
    if count < solved:
        parts.append(f"{solved - count} of {solved} cases have none")
    return "; ".join(parts)


def status_json(result: Any) -> str:
    """One object: counts, who is running, failed cases and notes on solved ones with their places (SI), sessions."""
    total = {name.replace(" ", "_"): int(np.sum(result.status == code)) for code, name in enumerate(STATES)}
    found = {"file": str(result.path), "title": result.title, "running": holder(result.path) or None}
    found |= {"cases": int(result.status.size), **total, "units": {axis.name: axis.units for axis in result.axes}}
    found |= {"largest_error": largest_mesh_error(result)} | _added(result)
    found |= {"no_grasp": [case for state in NO_GRASP for case in _cases(result, state)]}
    found |= {"failures": _cases(result, FAILED), "notes": _cases(result, DONE), "sessions": list(result.sessions)}
    return json.dumps(found, indent=2)


def _added(result: Any) -> dict[str, Any]:
    """What each round of a refinement added: stations, or poses in the frame of the object's own file."""
    rounds = result.layout.added
    if result.axes[-3].units:
        return {"added_stations_mm": [list(some) for some in rounds]}
    poses = [[{"step": x[0], "point_mm": x[1:4], "approach": x[4:7], "long_side": x[7:]} for x in r] for r in rounds]
    return {"added_poses": poses}


def status_csv(result: Any) -> str:
    """One line for each case, in the order of the file: state, message and place, SI units in the header."""
    names = ["row", "state", "message", *(with_unit(axis.name, axis.units) for axis in result.axes)]
    status, messages = result.status.ravel(), result.messages.ravel()
    rows = ([row, STATES[int(status[row])], str(messages[row]), *_place(result, row)] for row in range(status.size))
    return csv_text([names, *rows])


def _cases(result: Any, state: int) -> list[dict[str, Any]]:
    """Cases in one state that have a message; with the state where there is no grasp."""
    messages, names = result.messages.ravel(), [axis.name for axis in result.axes]
    found = []
    for row in map(int, np.flatnonzero((result.status.ravel() == state) & (messages != ""))):
        label = "" if result.axes[-3].units else str(result.labels[np.unravel_index(row, result.layout.shape)[-3:-1]])
        where = dict(zip(names, _place(result, row), strict=True)) | ({"label": label} if label else {})
        where |= {"state": STATES[state]} if state in NO_GRASP else {}
        found.append({"row": row, **where, "message": str(messages[row])})
    return found


def place(result: Any, row: int) -> str:
    """A case in words."""
    return place_text(result.axes, result.labels, tuple(map(int, np.unravel_index(row, result.layout.shape))))


def _place(result: Any, row: int) -> list[float]:
    index = np.unravel_index(row, result.layout.shape)
    return [float(axis.values[i]) for axis, i in zip(result.axes, index, strict=True)]


def counts(result: Any) -> str:
    """How many cases are in which state, and how many grasps a refinement added."""
    title = f" ({result.title})" if result.title else ""
    states = [*(f"{int(np.sum(result.status == state))} {STATES[state]}" for state in (FAILED, MISSING)),
              *no_grasps(result.status)]  # fmt: skip
    done = f"{int(np.sum(result.status == DONE))} of {result.status.size} cases {STATES[DONE]}"
    stations = f"\n{wrapped(text, PAPER, '  ', '    ')}" if (text := about(result)) else ""
    return f"{result.path}{title}:\n  {', '.join([done, *states])}{stations}"


def no_grasps(codes: NDArray[np.integer]) -> list[str]:
    """How many cases have each of the states that are no grasp, as far as there are any."""
    counts = {state: int(np.sum(codes == state)) for state in NO_GRASP}
    return [f"{count} {STATES[state]}" for state, count in counts.items() if count]


def reasons(result: Any, width: int = PAPER) -> list[str]:
    """Reasons of failed cases and of what is no grasp, then notes on solved cases, with some of their places."""
    lines = []
    for state, title in ((FAILED, "failed"), *((state, STATES[state]) for state in NO_GRASP), (DONE, "note")):
        where: dict[str, list[int]] = {}
        for text, row in _reasons(result, state):
            where.setdefault(text, []).append(row)
        texts = sorted(where, key=lambda text: -len(where[text]))
        for text in texts[:MOST_REASONS]:
            places = [place(result, row) for row in where[text][:MOST_PLACES]]
            more = len(where[text]) - len(places)
            lines.append(wrapped(f"{title} {len(where[text])} x {text}", width, "  ", "  "))
            lines.append(wrapped(f"at {'; '.join(places)}" + f"; and {more} more" * (more > 0), width, "      "))
        if len(texts) > MOST_REASONS:
            lines.append(f"  {title}: {len(texts) - MOST_REASONS} more messages; --csv lists every case")
    return lines


def _reasons(result: Any, state: int) -> Iterator[tuple[str, int]]:
    """Reasons and rows of the cases in a state: of solved ones their flags, and what the message adds to these."""
    messages = result.messages.ravel()
    rows = np.flatnonzero((result.status.ravel() == state) & (messages != ""))
    # Read only where it is needed: a file without notes is answered faster.
    flags = np.nan_to_num(result.read("flags/flags")).astype(int).ravel() if state == DONE and rows.size else None
    for row in map(int, rows):
        marks = 0 if flags is None else int(flags[row])
        yield from ((flag.sentence, row) for flag in flags_in(marks))
        # Flags are told one by one, so that cases with several count for each of them.
        if more := str(messages[row]).removeprefix(flag_sentences(marks)).removeprefix("; "):
            yield more, row


def time_split(result: Any) -> list[str]:
    """Where the seconds of all cases went; nothing where no time was measured."""
    # NaN where a case was served by symmetry: it cost nothing.
    total = float(np.nansum(result.read("work/seconds_total")))
    if not total:
        return []
    shares = {part: float(np.nansum(result.read(f"work/seconds_{part}"))) / total for part in PARTS}
    shares["failed cases"] = float(np.nansum(result.read("work/seconds_total")[result.status == FAILED])) / total
    words = [f"{part} {share:.0%}" for part, share in shares.items() if share >= 0.005]
    return [f"time in cases: {duration(total)} on all ranks" + (f" ({', '.join(words)})" if words else "")]


def sessions(result: Any, running: bool, width: int = PAPER) -> list[str]:
    """One line for each time the study was started."""
    lines = []
    for i, s in enumerate(result.sessions, start=1):
        now = running and i == len(result.sessions)
        reason = s["reason"] if s["stop"] else "running" if now else "no end was recorded (killed?)"
        ranks = f"{s['ranks']} rank{'s' * (s['ranks'] != 1)} on {s['host']}"
        wall = _between(s["start"], s["stop"])
        lines.append(wrapped(f"session {i}: {s['start']}, {ranks}{wall}, {reason}", width, "  ", "  "))
    return lines


def _between(start: str, stop: str) -> str:
    try:
        return f", {duration((datetime.fromisoformat(stop) - datetime.fromisoformat(start)).total_seconds())}"
    except ValueError:
        return ""
