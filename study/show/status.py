"""What a result file holds so far: complete cases, failed ones with reasons, the rest, and how each session ended."""

import math
import re
from argparse import Namespace
from collections.abc import Sequence
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.study.flags import flag_sentences, flags_in
from softjaw.study.quantities import DONE, FAILED, MISSING, NO_GRASP, PARTS, STATES, map_row, misses
from softjaw.study.result.index import index_path
from softjaw.study.result.lock import holder
from softjaw.study.result.skeleton import ROUND_COMPLETE, UNFINISHED
from softjaw.study.result.store import open_result, place_text
from softjaw.study.run.progress import duration
from softjaw.study.run.refine import about
from softjaw.study.scene.sections import COARSE, FINEST
from softjaw.study.scene.text import scene_table
from softjaw.study.show import objects
from softjaw.study.show.objects import RESUME
from softjaw.study.table import (
    MOST_NOTES,
    PAPER,
    Column,
    Row,
    Table,
    rendered,
    terminal_width,
    wrapped,
)

MOST_PLACES = 2
NO_ERRORS = "no errors known; accuracy.meshes = 2 gives them"
Index = tuple[int, ...]


class Reason(NamedTuple):
    """Why cases are in a state, or a note on solved ones: an example of the message, and which cases have its like."""

    state: int
    message: str
    cases: list[Index]

    def text(self, axes: Sequence[Any], labels: Any) -> str:
        """Count, state, message and some places in one line."""
        places = "; ".join(place_text(axes, labels, index) for index in self.cases[:MOST_PLACES])
        more = len(self.cases) - MOST_PLACES
        word = "note" if self.state == DONE else STATES[self.state]
        return f"{len(self.cases)} x {word}: {self.message} ({places}{f'; and {more} more' * (more > 0)})"


def status(options: Namespace) -> str:
    """Say what a result file or a folder of objects holds so far, as text, JSON or CSV."""
    form, width = options.form, terminal_width()
    if index := index_path(options.file):
        return rendered(objects.index_table(index), form) if form else objects.status_text(index, width)
    with open_result(options.file) as result:
        return rendered(status_table(result), form) if form else status_text(result, width)


def status_table(result: Any) -> Table:
    """Every case with its state and message; counts, sessions and what a refinement added beside them."""
    axes, poses = result.axes, not result.axes[-3].units
    columns = [Column("row"), Column("state"), Column("message"), *(Column(axis.name, axis.units) for axis in axes)]
    columns += [Column("label")] * poses
    rows = []
    for row, index in enumerate(np.ndindex(result.status.shape)):
        where: Row = {axis.name: float(axis.values[i]) for axis, i in zip(axes, index, strict=True)}
        where |= {"row": row, "label": str(result.labels[index[-3:-1]]), "message": str(result.messages[index])}
        rows.append(where | {"state": STATES[int(result.status[index])]})
    counts = {name.replace(" ", "_"): int(np.sum(result.status == code)) for code, name in enumerate(STATES)}
    facts: Row = {"file": str(result.path), "running": holder(result.path) or None, **counts}
    facts |= {"largest_error": largest_stated_error(result), "waiting": waits(result), "sessions": result.sessions}
    notes = [reason.text(axes, result.labels) for reason in reasons_in(result)]
    return Table(result.title, columns, rows, notes, facts, "cases")


def status_text(result: Any, width: int = PAPER) -> str:
    """Answer of ``softjaw status``; the file may be growing meanwhile."""
    runner = holder(result.path)
    state = f"running now: {runner}" if runner else RESUME if unfinished(result) else ""
    waiting = f"{n} cases wait for a finer mesh" if (n := waits(result)) else ""
    known = [wrapped(text, width, "  ", "  ") for text in (largest_stated_error(result), waiting) if text]
    lines = [counts(result), *known, *[wrapped(state, width)] * bool(state), *reasons(result, width)]
    return "\n".join([*lines, *sessions(result, bool(runner), width)])


# --- stated errors ---------------------------------------------------------------------------------------------------


def meshes(result: Any) -> NDArray[np.float64] | None:
    """Finest mesh that each case was tried on; None where a file has it not."""
    return result.read("work/mesh") if any(q.key == "work/mesh" for q in result.layout.quantities) else None


def waits(result: Any) -> int:
    """Cases that a round named for a finer mesh and that have not been tried on it."""
    mesh = meshes(result)
    if mesh is None or not result.layout.finer:
        return 0
    tried = mesh.reshape(-1, result.layout.inputs, np.prod(mesh.shape[-3:-1]), mesh.shape[-1])
    tried = np.fmin.reduce(tried, axis=1)  # of all samples
    return sum(bool(tried[case] < min(COARSE + n, FINEST)) for case, n in result.layout.finer.items())


def unfinished(result: Any) -> bool:
    """Whether a run of the same command has something to do."""
    # a run that was killed between two rounds left no report
    return bool(np.any(result.status == MISSING)) or waits(result) > 0 or result.report == UNFINISHED


def largest_stated_error(result: Any) -> str:
    """The largest stated error so far of what the scene's target is for."""
    row = map_row(aim(result)[0]).of_error
    errors = result.read(row.key) if row in result.layout.quantities else None
    given = result.status.copy()
    given.reshape(-1, result.layout.inputs, math.prod(given.shape[-3:]))[:, 1:] = MISSING  # samples have no target
    cases = SimpleNamespace(status=given, scene=result.scene)
    return "; ".join(largest_error(errors, cases, result.axes, result.labels, meshes(result)))


def aim(cases: Any) -> tuple[str, float]:
    """What the target of a file's scene is for, and the relative error; payload and infinity where it names none."""
    accuracy = scene_table(cases.scene, "accuracy")
    return accuracy.get("target_of", "payload"), accuracy.get("target", math.inf)


def largest_error(errors: Any, cases: Any, axes: Sequence[Any], labels: Any, mesh: Any = None) -> list[str]:
    """The largest stated error, how many are above a target that the scene names, and how many solved cases have none.

    ``errors`` (array over the cases): relative errors; None where a file has none. ``cases`` (Result or
    xarray.Dataset): has ``status`` and ``scene``. ``axes, labels``: as `result.store.place_text` takes them. ``mesh``
    (array over the cases, optional): as `meshes` gives it; cases on the coarse mesh alone do not count.
    """
    status, done = np.asarray(cases.status), np.asarray(cases.status) == DONE
    done = done if mesh is None else done & (np.asarray(mesh) > COARSE)
    solved = int(np.count_nonzero(done))
    if not solved or errors is None:
        return [NO_ERRORS] * bool(solved)
    known = np.where(done, errors, np.nan)
    count = int(np.count_nonzero(np.isfinite(known)))
    if not count:
        return [f"errors of what accuracy.target_of names: none of {solved} solved cases has one"]
    worst = tuple(map(int, np.unravel_index(int(np.nanargmax(known)), status.shape)))
    name, target = aim(cases)
    # where next to nothing is held the error may be many times what is
    most = f"up to {100 * known[worst]:.3g} %" if known[worst] < 1 else "above 100 %"
    above = int(np.count_nonzero(misses(known, target)))
    parts = [f"{name} errors {most}" + f", {above} of {count} above {100 * target:g} %" * (above > 0)]
    if count < solved:
        parts.append(f"{solved - count} of {solved} have none")
    if coarse := int(np.count_nonzero(status == DONE)) - solved:
        parts.append(f"{coarse} on the coarse mesh alone are not counted")
    return [*parts, f"the largest at {place_text(axes, labels, worst)}"]


# --- counts and reasons ----------------------------------------------------------------------------------------------


def counts(result: Any) -> str:
    """How many cases are in which state, and how many grasps a refinement added."""
    title = f" ({result.title})" if result.title else ""
    stations = f"\n{wrapped(text, PAPER, '  ', '    ')}" if (text := about(result)) else ""
    return f"{result.path}{title}:\n  {state_counts(result.status)}{stations}"


def state_counts(codes: NDArray[np.integer]) -> str:
    """How many cases are in which state."""
    done, *others = (f"{int(np.sum(codes == state))}" for state in (DONE, FAILED, MISSING))
    states = [f"{n} {STATES[state]}" for n, state in zip(others, (FAILED, MISSING), strict=True)]
    return ", ".join([f"{done} of {codes.size} cases {STATES[DONE]}", *states, *no_grasps(codes)])


def no_grasps(codes: NDArray[np.integer]) -> list[str]:
    """How many cases have each of the states that are no grasp, as far as there are any."""
    known = {state: int(np.sum(codes == state)) for state in NO_GRASP}
    return [f"{count} {STATES[state]}" for state, count in known.items() if count]


def grouped(status: NDArray[np.integer], messages: Any, flags: NDArray[Any]) -> list[Reason]:
    """Reasons of failed cases, of what is no grasp, and notes on solved cases, each state's most frequent one first.

    Messages that differ in their numbers only are of one kind; of a solved case each flag counts by itself.
    """
    kinds: dict[tuple[int, str], Reason] = {}
    for row in np.argwhere((messages != "") | (status == FAILED)):
        index = tuple(int(i) for i in row)
        state, text = int(status[index]), str(messages[index])
        texts = [text or "no reason was given"]
        if state == DONE:
            value = int(np.nan_to_num(flags[index]))
            more = text.removeprefix(flag_sentences(value)).removeprefix("; ")
            texts = [*(flag.sentence for flag in flags_in(value)), *[more] * bool(more)]
        for message in texts:
            kind = re.sub(r"[-+]?\d[\d.]*(e[-+]?\d+)?", "#", message)
            kinds.setdefault((state, kind), Reason(state, message, [])).cases.append(index)
    order = (FAILED, *NO_GRASP, DONE)
    listed = (reason for reason in kinds.values() if reason.state in order)
    return sorted(listed, key=lambda reason: (order.index(reason.state), -len(reason.cases)))


def reasons_in(result: Any) -> list[Reason]:
    """The same of an open result file."""
    return grouped(result.status, result.messages, result.read("flags/flags"))


def reasons(result: Any, width: int = PAPER, notes: bool = True) -> list[str]:
    """The most frequent reasons, one line each; ``notes``: also of solved cases."""
    listed = [reason for reason in reasons_in(result) if notes or reason.state != DONE]
    lines = [reason.text(result.axes, result.labels) for reason in listed[:MOST_NOTES]]
    rest = listed[MOST_NOTES:]
    cases = len({case for reason in rest for case in reason.cases})
    lines += [f"and {len(rest)} more kinds on {cases} cases: 'softjaw status --json' lists all"] * bool(rest)
    return [wrapped(line, width, "  ", "    ") for line in lines]


# --- time ------------------------------------------------------------------------------------------------------------


def time_split(result: Any) -> list[str]:
    """Where the seconds of all cases went; nothing where no time was measured."""
    seconds = {part: result.read(f"work/seconds_{part}") for part in ("total", *PARTS)}
    return split_of(seconds | {"failed cases": np.where(result.status == FAILED, seconds["total"], np.nan)})


def split_of(seconds: dict[str, NDArray[np.float64]]) -> list[str]:
    """The same of the seconds of cases by part, ``total`` first; NaN where an image by symmetry cost nothing."""
    total, *parts = (float(np.nansum(values)) for values in seconds.values())
    shares = {name: part / total for name, part in zip([*seconds][1:], parts, strict=True)} if total else {}
    words = ", ".join(f"{name} {share:.0%}" for name, share in shares.items() if share >= 0.005)
    return [f"time in cases: {duration(total)} on all ranks{f' ({words})' * bool(words)}"] * bool(total)


def sessions(result: Any, running: bool, width: int = PAPER) -> list[str]:
    """One line for each time the study was started, and for each further round."""
    lines, number, turn, stored = [], 0, 1, result.sessions
    for i, s in enumerate(stored, start=1):
        further = i > 1 and stored[i - 2]["reason"] == ROUND_COMPLETE
        number, turn = (number, turn + 1) if further else (number + 1, 1)
        now = running and i == len(stored)
        reason = s["reason"] if s["stop"] else "running" if now else "no end was recorded (killed?)"
        ranks = f"{s['ranks']} rank{'s' * (s['ranks'] != 1)} on {s['host']}"
        took = lasted(s["start"], s["stop"]) if s["stop"] else ""
        parts = (f"session {number}{f', round {turn}' * further}: {s['start']}", ranks, took, reason)
        lines.append(wrapped(", ".join(filter(None, parts)), width, "  ", "  "))
    return lines


def lasted(start: str, stop: str = "") -> str:
    """How long it is from one time to another, or to now; empty where one is no time, as while it is written."""
    try:
        end = datetime.fromisoformat(stop) if stop else datetime.now(UTC)
        # Never negative: clocks of two machines may disagree.
        return duration(max((end - datetime.fromisoformat(start)).total_seconds(), 0.0))
    except ValueError:
        return ""
