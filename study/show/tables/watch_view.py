"""What ``softjaw watch`` draws: how far a run has come, how long the rest takes, the best grasp so far, what failed."""

from __future__ import annotations

import math
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from softjaw.study.messages import DONE as ENDED
from softjaw.study.messages import SOME_FAILED, STOPPED
from softjaw.study.result.layout import DONE, FAILED, MISSING
from softjaw.study.result.lock import holder
from softjaw.study.result.read import dataset
from softjaw.study.result.store import open_result
from softjaw.study.run.progress import Progress, duration
from softjaw.study.show.tables.columns import terminal_width, wrapped
from softjaw.study.show.tables.show import best
from softjaw.study.show.tables.status import place, reasons
from softjaw.study.units import shown_text

BAR = 40


class View:
    """What is drawn, and what of it has to be remembered from look to look."""

    def __init__(self, stream: TextIO, *, live: bool) -> None:
        self._stream, self._live = stream, live
        self._progress: Progress | None = None
        self._codes = np.zeros(0)
        self._failure, self._drawn, self._line = -1, 0, ""

    def look(self, path: Path) -> int | None:
        """Open the file, draw what it holds, and give the exit code once no run is working on it."""
        runner = holder(path)  # asked first: what a run writes before it ends is then read below
        with open_result(path) as result:
            codes = result.status.ravel()
            self._remember(codes)
            self._draw(result, codes, runner)
            if runner:
                return None
            for line in self._last_words(result, codes):
                self._stream.write(f"{line}\n")
        return STOPPED if np.any(codes == MISSING) else SOME_FAILED if np.any(codes == FAILED) else ENDED

    def _remember(self, codes: np.ndarray) -> None:
        before = self._codes if self._codes.size else np.full(codes.shape, MISSING)
        fresh = np.flatnonzero((codes == FAILED) & (before != FAILED))
        self._failure = int(fresh[-1]) if fresh.size else self._failure
        self._codes = codes
        if self._progress is None:
            self._progress = Progress(np.ones(codes.size), codes, self._stream, live=self._live)

    def _draw(self, result: Any, codes: np.ndarray, runner: str) -> None:
        assert self._progress is not None
        line = self._progress.line(codes) if runner else _counts(codes)
        if not self._live:
            if line.partition(" done")[0] != self._line.partition(" done")[0]:
                self._stream.write(f"[{time.strftime('%H:%M:%S')}] {line}\n")
                self._stream.flush()
            self._line = line
            return
        width = terminal_width() - 1
        lines = [f"{result.path}{f' ({result.title})' if result.title else ''}", _bar(codes, width), line]
        lines += [f"{runner}{_since(result)}"] if runner else []
        lines += [best_so_far(result, codes)]
        if self._failure >= 0:
            lines += [f"failed last: {result.messages.ravel()[self._failure]}, at {place(result, self._failure)}"]
        shown = [part[:width] for line in lines for part in wrapped(line, width, more="  ").splitlines()]
        over = f"\x1b[{self._drawn}F\x1b[J" if self._drawn else ""
        self._stream.write(over + "\n".join(shown) + "\n")
        self._stream.flush()
        self._drawn = len(shown)

    def _last_words(self, result: Any, codes: np.ndarray) -> list[str]:
        missing = int(np.sum(codes == MISSING))
        if missing:
            return [f"no run is working on it: {missing} cases are missing; the same 'softjaw run' goes on from here"]
        return ["complete", *reasons(result, terminal_width()), f"softjaw show {result.path} lists the best grasps"]


def _bar(codes: np.ndarray, width: int) -> str:
    """Done cases as ``#``, failed ones as ``x``, missing ones as ``.``, and the share that is no longer missing."""
    size = min(BAR, width - 10)
    edges = np.round(np.array([np.sum(codes == DONE), np.sum(codes != MISSING)]) / codes.size * size).astype(int)
    bar = "#" * edges[0] + "x" * (edges[1] - edges[0]) + "." * (size - edges[1])
    missing = int(np.sum(codes == MISSING))
    return f"[{bar}] {math.floor(100 * (1 - missing / codes.size))} %" + (f", {missing} missing" if missing else "")


def _counts(codes: np.ndarray) -> str:
    failed = int(np.sum(codes == FAILED))
    return f"{int(np.sum(codes == DONE))}/{codes.size} done" + (f", {failed} failed" if failed else "")


def _since(result: Any) -> str:
    """How long the last session has been running."""
    try:
        began = datetime.fromisoformat(result.sessions[-1]["start"])
    except (IndexError, ValueError):
        return ""
    return f", for {duration(max((datetime.now(UTC) - began).total_seconds(), 0.0))}"


def best_so_far(result: Any, codes: np.ndarray) -> str:
    """The best grasp at the highest force at which any is solved, in one line."""
    solved = (codes.reshape(-1, result.layout.shape[-1]) == DONE).any(axis=0)
    if not solved.any():
        return "best so far: none is solved yet"
    table = best(dataset(result), float(result.axes[-1].values[np.flatnonzero(solved)[-1]]), top=1)
    row = dict(zip((name for name, _ in table.columns), table.rows[0], strict=True))
    where = [f'"{row["label"]}"'] if "label" in row else []
    axes = result.axes[:-3] if where else result.axes[:-1]
    where += [_coordinate(axis, row[axis.name]) for axis in axes]
    numbers = [f"quality {row['quality']:.4g}", f"e_n {shown_text(row['e_n'], 'm')}"]
    return f"best so far at {table.force:g} N: {', '.join(numbers)}, at {', '.join(where)}"


def _coordinate(axis: Any, value: float) -> str:
    return f"{axis.name} {shown_text(value, axis.units, 5)}"
