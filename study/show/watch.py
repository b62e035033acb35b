"""``softjaw watch FILE``: a live view of a run from another terminal, read from its result file or its index."""

import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from softjaw.study.messages import STOPPED
from softjaw.study.quantities import DONE, FAILED, MAIN
from softjaw.study.ranking import index_of, ranked
from softjaw.study.result.lock import holder
from softjaw.study.result.read import dataset
from softjaw.study.result.store import open_result, place_text
from softjaw.study.run.progress import Progress, code_of
from softjaw.study.show.best_grasps import value_text
from softjaw.study.show.status import RESUME, lasted, reasons, unfinished
from softjaw.study.table import terminal_width

INTERRUPTED = 130  # what shells say of a program that Ctrl-C ended
Look = Callable[[], tuple[list[str], int | None]]


def watch(look: Look, every: float, stream: TextIO | None = None, sleep: Callable[[float], None] = time.sleep) -> int:
    """Look at a run until it ends; its exit code.

    ``look``: gives lines, of which the first has the counts, and the exit code once the run has ended. Files are opened
    anew for every look, so that a run never waits for its watchers. ``every``: seconds between two looks. ``stream``:
    where to write. On a terminal the lines are drawn over themselves, elsewhere new counts are a line. ``sleep``: waits
    for so many seconds.
    """
    # Titles and messages are the user's text: brackets in them are no markup.
    console = Console(file=stream or sys.stdout, markup=False, emoji=False, highlight=False)
    counts, code = "", None
    try:
        # Without a thread of its own, which would draw while the file is read.
        with Live(console=console, auto_refresh=False) if console.is_terminal else nullcontext() as live:
            while code is None:
                lines, code = look()
                if live:
                    live.update(Text("\n".join(lines)), refresh=True)
                    lines = []
                # In a log only a new count is worth a line, not a new estimate of the rest.
                elif counts != (counts := lines[0].partition(" done")[0]):
                    console.print(f"[{time.strftime('%H:%M:%S')}] {lines[0]}", soft_wrap=True)
                if code is None:
                    sleep(every)
    except KeyboardInterrupt:
        # Whoever presses Ctrl-C may fear for the run.
        console.print("no longer watching; the run continues")
        return INTERRUPTED
    for line in lines[1:]:
        console.print(line, soft_wrap=True)
    return code


def file_look(path: Path) -> Look:
    """Looks at the result file of a run."""
    progress: Progress | None = None

    def look() -> tuple[list[str], int | None]:
        nonlocal progress
        runner = holder(path)  # asked first: what a run writes before it ends is then read below
        with open_result(path) as result:
            codes = result.status.ravel()
            if progress is None or progress.rows != codes.size or not runner:
                # Weights are not in the file, so all cases count alike.
                progress = Progress(np.ones(codes.size), codes, sys.stdout, live=False)
            rounds = len(result.layout.added)
            counts = f"{progress.line(codes)}{f', round {rounds} of further grasps' * bool(rounds)}"
            if not runner:
                incomplete = unfinished(result)
                return [counts, *_end(result, incomplete)], STOPPED if incomplete else code_of(codes)
            title = f" ({result.title})" * bool(result.title)
            since = lasted(result.sessions[-1]["start"]) if result.sessions else ""
            about = f"{result.path}{title}: {runner}{f', for {since}' * bool(since)}"
            failures = reasons(result, terminal_width())[: bool((codes == FAILED).any())]
            return [counts, about, best_so_far(result, codes), *failures], None

    return look


def _end(result: Any, incomplete: bool) -> list[str]:
    if incomplete:
        return [f"not complete: {RESUME}"]
    return ["complete", *reasons(result, terminal_width()), f"'softjaw show {result.path}' lists the best grasps"]


def best_so_far(result: Any, codes: np.ndarray) -> str:
    """The best grasp at the highest force at which any is solved, in one line."""
    # Low forces are solved first, so the highest force has nothing to show for long.
    solved = (codes.reshape(-1, result.layout.shape[-1]) == DONE).any(axis=0)
    if not solved.any():
        return "best so far: no case is complete yet"
    ds, level = dataset(result), int(np.flatnonzero(solved)[-1])
    index = index_of(ds, int(ranked(ds, level)[0]), level)
    values = ", ".join(f"{name} {value_text(ds, name, index, unit=True)}" for name in MAIN[:2] if name in ds)
    return f"best so far: {values}, at {place_text(result.axes, result.labels, index)}"
