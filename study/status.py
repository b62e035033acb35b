"""What a result file holds so far: done, failed with reasons, missing, and how each session ended."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np

from study.layout import DONE, FAILED, MISSING
from study.lock import holder
from study.progress import duration
from study.show import as_text, best, place

MOST_REASONS, MOST_PLACES = 12, 3
PARTS = ("assembly", "factorisation", "friction", "rest")


def status_text(result: Any) -> str:
    """Answer of ``softjaw status``; the file may be growing meanwhile."""
    runner = holder(result.path)
    missing = int(np.sum(result.status == MISSING))
    state = f"running now: {runner}" if runner else "the same 'softjaw run' goes on from here" if missing else ""
    return "\n".join([counts(result), *([state] if state else []), *reasons(result), *sessions(result, bool(runner))])


def summary(result: Any) -> str:
    """What a run says at its end: counts, reasons of failures, where the time went, best grasps, the file."""
    table = [as_text(best(result, whole_lines=True))] if np.any(result.status == DONE) else []
    return "\n".join([counts(result), *reasons(result), *time_split(result), *table, f"results are in {result.path}"])


def counts(result: Any) -> str:
    """How many cases are in which state."""
    status = result.status
    done, failed = int(np.sum(status == DONE)), int(np.sum(status == FAILED))
    title = f" ({result.title})" if result.title else ""
    missing = status.size - done - failed
    return f"{result.path}{title}: {done} of {status.size} cases done, {failed} failed, {missing} missing"


def reasons(result: Any) -> list[str]:
    """Messages of failed cases, then notes on solved ones, the most frequent first and with some of their places."""
    status, messages = result.status.ravel(), result.messages.ravel()
    lines = []
    for state, title in ((FAILED, "failed"), (DONE, "note")):
        where: dict[str, list[int]] = {}
        for row in np.flatnonzero((status == state) & (messages != "")):
            # a solved case may have several remarks, a failed one has one reason
            for text in messages[row].split("; ") if state == DONE else [messages[row]]:
                where.setdefault(text, []).append(int(row))
        texts = sorted(where, key=lambda text: -len(where[text]))
        for text in texts[:MOST_REASONS]:
            places = "; ".join(place(result, row) for row in where[text][:MOST_PLACES])
            more = "; ..." * (len(where[text]) > MOST_PLACES)
            lines.append(f"  {title} {len(where[text])} x {text} [{places}{more}]")
        if len(texts) > MOST_REASONS:
            lines.append(f"  {title}: {len(texts) - MOST_REASONS} more messages, in status/message of the file")
    return lines


def time_split(result: Any) -> list[str]:
    """Where the seconds of all cases went; nothing where no time was measured."""
    total = float(np.nansum(result.work("seconds_total")))
    if not total:
        return []
    shares = {part: float(np.nansum(result.work(f"seconds_{part}"))) / total for part in PARTS}
    words = [f"{part} {share:.0%}" for part, share in shares.items() if share >= 0.005]
    return [f"time in cases: {duration(total)} on all ranks" + (f" ({', '.join(words)})" if words else "")]


def sessions(result: Any, running: bool) -> list[str]:
    """One line for each time the study was started."""
    found: Sequence[dict[str, Any]] = result.sessions
    lines = []
    for i, s in enumerate(found):
        last = i == len(found) - 1
        reason = s["reason"] if s["stop"] else "running" if last and running else "ended without a word (killed?)"
        wall = _between(s["start"], s["stop"])
        lines.append(f"  session {i + 1}: {s['start']}, {s['ranks']} ranks on {s['host']}{wall}, {reason}")
    return lines


def _between(start: str, stop: str) -> str:
    try:
        return f", {duration((datetime.fromisoformat(stop) - datetime.fromisoformat(start)).total_seconds())}"
    except ValueError:
        return ""
