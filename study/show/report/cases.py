"""Cases of a report: how many are in which state, why some failed, how the others pass their checks, and all."""

from __future__ import annotations

import numpy as np

from softjaw.study.flags import flags_in
from softjaw.study.result.layout import DONE, FAILED, MISSING
from softjaw.study.show.data import ABOVE, LIMITS, Data, number, passes
from softjaw.study.show.report.page import details, paragraph, table
from softjaw.study.show.report.words import VALUES, head, value
from softjaw.study.show.tables.ranking import largest

MOST_REASONS, MOST_PLACES = 20, 4
MOST_CASES = 8000  # that a page lists one by one; more would make it heavy
STATES = {DONE: "solved", FAILED: "failed", MISSING: "missing"}
MORE = ("epsilon", "contact_area", "p_max", "travel", "dent", "wall_stress", "safety_factor")


def states(data: Data) -> str:
    """Counts and notes on solved cases, alike messages together."""
    counts = [[name, str(data.count(state))] for state, name in STATES.items()]
    return table("State of the cases", ["state", "cases"], counts, texts=(0,)) + _reasons(data, DONE)


def failures(data: Data) -> str:
    """Why cases failed, alike reasons together; empty where none failed."""
    return _reasons(data, FAILED)


def _reasons(data: Data, state: int) -> str:
    caption = "Why cases failed" if state == FAILED else "Notes on solved cases"
    groups = data.grouped(state)
    rows = [[str(count), text, _places(data, where)] for count, text, where in groups[:MOST_REASONS]]
    html = table(caption, ["cases", "message (one example)", "where"], rows, wide=(1, 2)) if rows else ""
    if len(groups) > MOST_REASONS:
        more = len(groups) - MOST_REASONS
        html += paragraph(f"{more} more kinds of messages are in status/message of the file.", "note")
    return html


def _places(data: Data, where: list[tuple[int, ...]]) -> str:
    words = [data.place(index, force=True) for index in where[:MOST_PLACES]]
    return "; ".join([*words, *["…"] * (len(where) > MOST_PLACES)])


def listed(data: Data) -> bool:
    """Whether a page lists every case."""
    return 1 < data.status.size <= MOST_CASES


def every_case(data: Data) -> str:
    """A folded table of all cases, from which the page tells the values of a map's cells."""
    if not listed(data):
        if data.status.size == 1:
            return ""
        text = f"The {data.status.size} cases are too many to be listed here; softjaw export writes all of them."
        return paragraph(text, "note")
    names = [name for name in (*VALUES, *MORE) if data.map(name) is not None]
    rows, ids = [], []
    for row, index in enumerate(np.ndindex(data.shape)):
        state = int(data.status[index])
        values = [value(data, name, index) for name in names]
        rows.append([data.place(index, force=True), STATES.get(state, "missing"), *values, remark(data, index)])
        ids.append(f"case-{row}")
    heads = ["case", "state", *(head(data, name) for name in names), "remarks"]
    caption = f"All {len(rows)} cases (curved model, weaker finger)"
    best = "" if data.best is None else str(int(data.rows[data.best]))
    html = table(caption, heads, rows, texts=(0, 1), wide=(len(heads) - 1,), ids=("all-cases", ids), best=best)
    return details(f"All {len(rows)} cases as a table", html)


def remark(data: Data, index: tuple[int, ...]) -> str:
    """The reason of a failed case; the checks that a solved one misses, and its flags."""
    if data.status[index] == FAILED:
        return str(data.result.messages[index]) or "no reason was given"
    if data.status[index] != DONE:
        return ""
    return ", ".join([*data.flagged(index), *(flag.word for flag in flags_in(int(data.flags[index])))])


def checks(data: Data) -> str:
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
        rows.append([_path(data, f"checks/{name}"), number(worst), limit, state, data.place(index[:-1], force=True)])
    if not rows:
        return paragraph("No checks are stored.", "note")
    heads = ["check", "worst value", "should be", "", "worst case"]
    return table("Checks of the contact solutions, worst of all solved cases and fingers", heads, rows, texts=(0, 3, 4))


def _path(data: Data, path: str) -> str:
    found = next((d for d in data.result.layout.datasets if d.path.endswith(f"/{path}")), None)
    return str(found.attributes.get("long_name", path)) if found else path
