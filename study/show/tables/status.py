"""What a result file holds so far: done, failed with reasons, missing, and how each session ended."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np

from softjaw.study.quantities import PARTS, STATES
from softjaw.study.result.layout import DONE, FAILED, MISSING
from softjaw.study.result.lock import holder
from softjaw.study.result.reading import place_text
from softjaw.study.result.store import open_result
from softjaw.study.run.progress import duration
from softjaw.study.show.tables.columns import PAPER, csv_text, terminal_width, with_unit, wrapped

MOST_REASONS, MOST_PLACES = 12, 3


def status(options: Namespace) -> str:
    """Say what a result file holds so far, as text, JSON or CSV."""
    forms = {"json": status_json, "csv": status_csv}
    with open_result(options.file) as result:
        return forms[options.form](result) if options.form else status_text(result, terminal_width())


def status_text(result: Any, width: int = PAPER) -> str:
    """Answer of ``softjaw status``; the file may be growing meanwhile."""
    runner = holder(result.path)
    missing = int(np.sum(result.status == MISSING))
    state = f"running now: {runner}" if runner else "the same 'softjaw run' goes on from here" if missing else ""
    told = [counts(result), *([wrapped(state, width)] if state else []), *reasons(result, width)]
    return "\n".join([*told, *sessions(result, bool(runner), width)])


def status_json(result: Any) -> str:
    """One object: counts, who is running, failed cases and notes on solved ones with their places (SI), sessions."""
    status = result.status
    total = {name: int(np.sum(status == code)) for code, name in enumerate(STATES)}
    told = {"file": str(result.path), "title": result.title, "running": holder(result.path) or None}
    told |= {"cases": int(status.size), **total, "units": {axis.name: axis.units for axis in result.axes}}
    told |= {"failures": _cases(result, FAILED), "notes": _cases(result, DONE), "sessions": list(result.sessions)}
    return json.dumps(told, indent=2)


def status_csv(result: Any) -> str:
    """One line for each case, in the order of the file: state, message and place, SI units in the header."""
    head = ["row", "state", "message", *(with_unit(axis.name, axis.units) for axis in result.axes)]
    status, messages = result.status.ravel(), result.messages.ravel()
    rows = ([row, STATES[int(status[row])], str(messages[row]), *_place(result, row)] for row in range(status.size))
    return csv_text([head, *rows])


def _cases(result: Any, state: int) -> list[dict[str, Any]]:
    """Cases in one state that have a message."""
    messages = result.messages.ravel()
    names = [axis.name for axis in result.axes]
    found = []
    for row in map(int, np.flatnonzero((result.status.ravel() == state) & (messages != ""))):
        label = "" if result.axes[-3].units else str(result.labels[np.unravel_index(row, result.layout.shape)[-3:-1]])
        where = dict(zip(names, _place(result, row), strict=True)) | ({"label": label} if label else {})
        found.append({"row": row, **where, "message": str(messages[row])})
    return found


def place(result: Any, row: int) -> str:
    """A case in words."""
    return place_text(result.axes, result.labels, np.unravel_index(row, result.layout.shape))


def _place(result: Any, row: int) -> list[float]:
    index = np.unravel_index(row, result.layout.shape)
    return [float(axis.values[i]) for axis, i in zip(result.axes, index, strict=True)]


def counts(result: Any) -> str:
    """How many cases are in which state."""
    status = result.status
    done, failed = int(np.sum(status == DONE)), int(np.sum(status == FAILED))
    title = f" ({result.title})" if result.title else ""
    missing = status.size - done - failed
    return f"{result.path}{title}:\n  {done} of {status.size} cases done, {failed} failed, {missing} missing"


def reasons(result: Any, width: int = PAPER) -> list[str]:
    """Messages of failed cases, then notes on solved ones, the most frequent first and with some of their places."""
    status, messages = result.status.ravel(), result.messages.ravel()
    lines = []
    for state, title in ((FAILED, "failed"), (DONE, "note")):
        where: dict[str, list[int]] = {}
        for row in np.flatnonzero((status == state) & (messages != "")):
            # a solved case may have several notes, a failed one has one reason
            for text in messages[row].split("; ") if state == DONE else [messages[row]]:
                where.setdefault(text, []).append(int(row))
        texts = sorted(where, key=lambda text: -len(where[text]))
        for text in texts[:MOST_REASONS]:
            places = [place(result, row) for row in where[text][:MOST_PLACES]]
            more = len(where[text]) - len(places)
            lines.append(wrapped(f"{title} {len(where[text])} x {text}", width, "  ", "  "))
            lines.append(wrapped(f"at {'; '.join(places)}" + f"; and {more} more" * (more > 0), width, "      "))
        if len(texts) > MOST_REASONS:
            lines.append(f"  {title}: {len(texts) - MOST_REASONS} more messages; --csv lists every case")
    return lines


def time_split(result: Any) -> list[str]:
    """Where the seconds of all cases went; nothing where no time was measured."""
    total = float(np.nansum(result.work("seconds_total")))
    if not total:
        return []
    shares = {part: float(np.nansum(result.work(f"seconds_{part}"))) / total for part in PARTS}
    words = [f"{part} {share:.0%}" for part, share in shares.items() if share >= 0.005]
    return [f"time in cases: {duration(total)} on all ranks" + (f" ({', '.join(words)})" if words else "")]


def sessions(result: Any, running: bool, width: int = PAPER) -> list[str]:
    """One line for each time the study was started."""
    found: Sequence[dict[str, Any]] = result.sessions
    lines = []
    for i, s in enumerate(found):
        last = i == len(found) - 1
        reason = s["reason"] if s["stop"] else "running" if last and running else "ended without a word (killed?)"
        wall = _between(s["start"], s["stop"])
        ranks = f"{s['ranks']} rank{'s' * (s['ranks'] != 1)} on {s['host']}"
        lines.append(wrapped(f"session {i + 1}: {s['start']}, {ranks}{wall}, {reason}", width, "  ", "  "))
    return lines


def _between(start: str, stop: str) -> str:
    try:
        return f", {duration((datetime.fromisoformat(stop) - datetime.fromisoformat(start)).total_seconds())}"
    except ValueError:
        return ""
