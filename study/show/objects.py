"""What the index of a folder of objects says: a table of all objects, counts with reasons, and a run as it goes."""

import math
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.messages import STOPPED, StudyError
from softjaw.study.quantities import MISSING
from softjaw.study.result import index
from softjaw.study.result.lock import holder
from softjaw.study.result.store import open_result
from softjaw.study.run.progress import duration
from softjaw.study.table import Column, Row, Table, as_text, wrapped

RESUME = "run the same command again to resume"
LOOKS: dict[str, dict[str, Any]] = {  # of the displayed columns
    "payload": {"error": "payload_error"}, "opening": {"drop": 1}, "force": {}, "e_n": {"drop": 2},
    "grasps": {"drop": 3}, "seconds": {"drop": 4}, "state": {"wrap": 12}, "reason": {"wrap": 34, "drop": 5},
}  # fmt: skip
SHOWN = (
    Column("object", wrap=20),
    *(Column(name, unit, display=name in LOOKS, programs=name != "key", **LOOKS.get(name, {}))
      for name, (_, unit, _) in index.COLUMNS.items()),
)  # fmt: skip


def index_table(path: Path, top: int = 0) -> Table:
    """The objects of an index, those with the largest payload first, then those without one; ``top`` (0: all)."""
    rows, about = index.read_index(path)
    rows = [{key: math.nan if value == -1 else value for key, value in row.items()} for row in rows]
    order = sorted(rows, key=lambda row: (-np.nan_to_num(row["payload"], nan=-1.0), row["object"]))
    facts = {"folder": str(path.parent), "scene_file": about.get("scene_file", "")}
    facts |= {state.replace(" ", "_"): count for state, count in _counts(rows).items()}
    more = len(order[top:]) if top else 0
    notes = [f"and {more} more: 'softjaw show {path.parent} --top 0' lists all"] * bool(more)
    return Table(f"{path.parent}: {counts_text(rows)}", SHOWN, order[: top or None], notes, facts, "objects")


def _counts(rows: list[Row]) -> dict[str, int]:
    counts = Counter(row["state"] for row in rows)
    return {state: counts[state] for state in index.STATES if counts[state]}


def counts_text(rows: list[Row]) -> str:
    """How many objects there are in each state."""
    return f"{len(rows)} objects, " + ", ".join(f"{n} {state}" for state, n in _counts(rows).items())


def status_text(path: Path, width: int) -> str:
    """Counts, cases and time, what runs now, and the reasons of objects without a grasp."""
    rows, _ = index.read_index(path)
    runner = holder(path)
    ended = [row for row in rows if row["state"] != index.STOPPED]
    # The index does not know how far an object was when a run was killed; its file does.
    now = _under_way(path, rows)
    cases = sum(max(row["done"], 0) for row in ended) + sum(done for done, *_ in now)
    seconds = duration(sum(np.nan_to_num(row["seconds"]) for row in ended) + sum(seconds for *_, seconds in now))
    lines = [f"{path}: {counts_text(rows)}", f"  {cases} cases solved; what is done took {seconds} on all ranks"]
    resume = RESUME * (index.code_of(rows) == STOPPED)
    lines += filter(None, [f"running now: {runner}" if runner else resume])
    named = [f"{row['object']}: {row['state']}: {row['reason']}" for row in rows if row["reason"]]
    return "\n".join([*lines, *(wrapped(line, width, "  ", "    ") for line in named)])


def summary(path: Path, width: int, top: int = 10) -> str:
    """What a run says at its end: the objects with the largest payload, and why others have none."""
    return f"{as_text(index_table(path, top), width)}\n{status_text(path, width)}"


def look(path: Path) -> tuple[list[str], int | None]:
    """Counts of the objects and of what is solved now, and the exit code of a run that has ended; for `show.watch`."""
    runner = holder(path)  # asked first: what a run writes before it ends is then read below
    rows, _ = index.read_index(path)
    under_way = _under_way(path, rows)
    done, cases, _ = (sum(part) for part in zip(*under_way, strict=True)) if under_way else (0, 0, 0)
    now = f"; {done}/{cases} cases of {len(under_way)} objects that are solved now" if cases else ""
    return [f"{counts_text(rows)}{now}"], None if runner else index.code_of(rows)


def _under_way(path: Path, rows: list[Row]) -> list[tuple[int, int, float]]:
    """Cases that have an end, all, and seconds they took, of the file of each object that is under way."""
    counts = []
    for file in (path.parent / row["file"] for row in rows if row["state"] == index.STOPPED):
        with suppress(StudyError), open_result(file, unchecked=True) as result:
            seconds = np.nansum(result.read("work/seconds_total"))
            counts.append((int(np.sum(result.codes != MISSING)), result.codes.size, float(seconds)))
    return counts
