"""``softjaw watch FILE``: a live view of a run from another terminal, read from its result file."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.text import Text

from softjaw.study.messages import DONE as ENDED
from softjaw.study.messages import SOME_FAILED, STOPPED
from softjaw.study.quantities import DONE, FAILED, MAIN, MISSING, STATES
from softjaw.study.ranking import ranked
from softjaw.study.result.lock import holder
from softjaw.study.result.read import dataset
from softjaw.study.result.store import open_result
from softjaw.study.run.progress import Progress, duration
from softjaw.study.show.best_grasps import case_table
from softjaw.study.show.grasps import unravelled
from softjaw.study.show.status import no_grasps, place, reasons
from softjaw.study.units import shown_text, shown_unit

INTERRUPTED = 130  # what shells say of a program that Ctrl-C ended


def watch(path: Path, every: float, stream: TextIO | None = None, sleep: Callable[[float], None] = time.sleep) -> int:
    """Look at a result file until its run ends, and give the exit code that goes with what it holds.

    Parameters
    ----------
    path : Path
        The file; it is opened anew for every look, so a run never waits for its watchers.
    every : float
        Seconds between two looks.
    stream : text stream
        Where to write. On a terminal the view is drawn over itself, elsewhere what has changed is a line.
    sleep : callable
        Waits for so many seconds.
    """
    stream = stream or sys.stdout
    # Titles and messages are the user's text: brackets in them are no markup.
    console = Console(file=stream, markup=False, emoji=False, highlight=False)
    view = Display(console, stream)
    try:
        with ExitStack() as stack:
            if console.is_terminal:
                # Without a thread of its own, which would draw while the file is read.
                view.live = stack.enter_context(Live(console=console, auto_refresh=False))
            while view.look(path):
                sleep(every)
    except KeyboardInterrupt:
        # Whoever presses Ctrl-C may fear for the run.
        console.print("no longer watching; the run continues")
        return INTERRUPTED
    for line in view.last_words:
        console.print(line, soft_wrap=True)
    return view.code


class Display:
    """What is drawn, and what of it has to be remembered from look to look.

    ``code`` and ``last_words`` are those of a run that has ended; ``live`` draws over itself on a terminal.
    """

    def __init__(self, console: Console, stream: TextIO) -> None:
        self.code, self.last_words = ENDED, list[str]()
        self.live: Live | None = None
        self._console, self._stream = console, stream
        self._progress: Progress | None = None
        self._codes = np.zeros(0)
        self._failure, self._done = -1, ""

    def look(self, path: Path) -> bool:
        """Open the file and draw what it holds; whether a run is working on it."""
        runner = holder(path)  # asked first: what a run writes before it ends is then read below
        with open_result(path) as result:
            codes = result.status.ravel()
            self._remember(codes)
            line = self._progress.line(codes) if runner and self._progress else _counts(codes)
            line += f", round {len(rounds)} of further grasps" if (rounds := result.layout.added) else ""
            if self.live:
                self.live.update(self._drawn(result, codes, runner, line), refresh=True)
            # In a log only a new count is worth a line, not a new estimate of the rest.
            elif line.partition(" done")[0] != self._done:
                self._console.print(f"[{time.strftime('%H:%M:%S')}] {line}", soft_wrap=True)
                self._done = line.partition(" done")[0]
            if not runner:
                self._end(result, codes)
        return bool(runner)

    def _remember(self, codes: np.ndarray) -> None:
        if codes.size != self._codes.size:  # another round: rows have other numbers, and another end
            self._codes, self._progress, self._failure = np.zeros(0), None, -1
        before = self._codes if self._codes.size else np.full(codes.shape, MISSING)
        fresh = np.flatnonzero((codes == FAILED) & (before != FAILED))
        self._failure = int(fresh[-1]) if fresh.size else self._failure
        self._codes = codes
        if self._progress is None:
            # Weights are not in the file, so all cases count alike.
            self._progress = Progress(np.ones(codes.size), codes, self._stream, live=False)

    def _drawn(self, result: Any, codes: np.ndarray, runner: str, line: str) -> Group:
        title = f" ({result.title})" if result.title else ""
        bar = ProgressBar(total=codes.size, completed=int(np.sum(codes != MISSING)), width=40)
        lines = [line, *([f"{runner}{_since(result)}"] if runner else []), best_so_far(result, codes)]
        if self._failure >= 0:
            where = tuple(int(i) for i in np.unravel_index(self._failure, result.layout.shape))
            lines += [f"failed last: {result.messages.ravel()[self._failure]}, at {place(result, where)}"]
        return Group(Text(f"{result.path}{title}"), bar, *map(Text, lines))

    def _end(self, result: Any, codes: np.ndarray) -> None:
        """Exit code and last words of a run that has ended."""
        missing = int(np.sum(codes == MISSING))
        if missing:
            words = f"the run has ended with {missing} cases {STATES[MISSING]}; run the same command again to resume"
            self.code, self.last_words = STOPPED, [words]
            return
        self.code = SOME_FAILED if np.any(codes == FAILED) else ENDED
        shown = f"'softjaw show {result.path}' lists the best grasps"
        self.last_words = ["complete", *reasons(result, self._console.width), shown]


def _counts(codes: np.ndarray) -> str:
    failed = int(np.sum(codes == FAILED))
    return f"{int(np.sum(codes == DONE))}/{codes.size} done" + "".join(
        f", {text}" for text in ([f"{failed} failed"] if failed else []) + no_grasps(codes)
    )


def _since(result: Any) -> str:
    """How long the last session has been running."""
    try:
        began = datetime.fromisoformat(result.sessions[-1]["start"])
    # A session may be in the middle of being written; the view can do without it.
    except (IndexError, ValueError):
        return ""
    # Never negative: clocks of two machines may disagree.
    return f", for {duration(max((datetime.now(UTC) - began).total_seconds(), 0.0))}"


def best_so_far(result: Any, codes: np.ndarray) -> str:
    """The best grasp at the highest force at which any is solved, in one line."""
    # Low forces are solved first, so the highest force has nothing to show for long.
    solved = (codes.reshape(-1, result.layout.shape[-1]) == DONE).any(axis=0)
    if not solved.any():
        return "best so far: no case is complete yet"
    ds, level = dataset(result), np.flatnonzero(solved)[-1]
    index = (*unravelled(int(ranked(ds, int(level))[0]), ds.status.shape[:-1]), int(level))
    table = case_table(ds, [index], rank=True)
    row, poses = table.rows[0], ds.attrs["poses"]
    where = [f'"{row["label"]}"'] * poses
    where += [f"{axis.name} {shown_text(row[axis.name], axis.units, 5)}" for axis in result.axes[: -3 if poses else -1]]
    first = (c for c in table.columns if c.name in MAIN[:2])
    cells = [f"{c.name} {table.cell(row, c)} {shown_unit(c.unit)}".rstrip() for c in first]
    return f"best so far at {result.axes[-1].values[level]:g} N: {', '.join(cells)}, at {', '.join(where)}"
