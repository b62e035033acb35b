"""How far a run has come: one line that is rewritten on a terminal, timed lines in a log."""

import os
import time
from collections.abc import Callable
from functools import partial
from typing import Any, TextIO

import numpy as np

from softjaw.study.messages import DONE as ENDED
from softjaw.study.messages import SOME_FAILED, STOPPED
from softjaw.study.quantities import DONE, FAILED, MISSING, NO_GRASP


def duration(seconds: float) -> str:
    """A time in the two units that matter.

    >>> duration(6660.0), duration(75.0), duration(0.2)
    ('1 h 51 min', '1 min 15 s', '0.2 s')
    """
    if seconds < 60:
        return f"{seconds:.{int(seconds < 10)}f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours < 48 else f"{hours // 24} d {hours % 24} h"


def code_of(codes: np.ndarray) -> int:
    """The exit code of a run that ends with these states."""
    return STOPPED if np.any(codes == MISSING) else SOME_FAILED if np.any(codes == FAILED) else ENDED


MIN_CASES, MOST_CASES, MIN_SECONDS = 5, 50, 3.0  # cases and seconds from the first case on, before a rest is foretold


class Progress:
    """Prints how many cases are done and how long the rest will take, judged by the cost of the cases.

    The clock for that starts when the first cases are done: until then a cold start has compiled, not solved.

    ``weights`` (rows,) array: expected cost of each case, in any unit. ``codes`` (rows,) array: state of each case at
    the start. ``stream``: where to write. ``live``: rewrite one line (a terminal) instead of adding lines. Under mpirun
    every output looks like a terminal, so the caller has to know. ``clock``: seconds that only grow.
    """

    def __init__(
        self,
        weights: np.ndarray,
        codes: np.ndarray,
        stream: TextIO,
        *,
        live: bool,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._weights, self._todo = weights, codes == MISSING
        self._stream, self._live, self._clock = stream, live, clock
        self._looked = self._printed = clock()
        self._share = 0.0
        self._first: tuple[float, int, float] | None = None  # when the first cases were done, how many, their weight

    @property
    def rows(self) -> int:
        """Number of cases."""
        return len(self._todo)

    def due(self) -> bool:
        """Whether it is time to look at the states again; cheap, to be asked often."""
        # Reading the states costs the file system something, so it is done seldom.
        if self._clock() - self._looked < (0.2 if self._live else 1.0):
            return False
        self._looked = self._clock()
        return True

    def update(self, codes: np.ndarray) -> None:
        """Print a line if the last one is ten seconds or five percent old, on a terminal always."""
        share = float(np.mean(codes != MISSING))
        # A log that is kept must not grow with every case.
        if not self._live and self._clock() - self._printed < 10 and share - self._share < 0.05:
            return
        self._share, self._printed = share, self._clock()
        text = self.line(codes)
        # Cleared to the end of the line: a shorter text must not keep the tail of a longer one.
        self._stream.write(f"\r\x1b[K{text}" if self._live else f"[{time.strftime('%H:%M:%S')}] {text}\n")
        self._stream.flush()

    def line(self, codes: np.ndarray) -> str:
        """Counts, and as soon as they mean something seconds for each case and the expected rest."""
        solved = self._todo & (codes != MISSING)
        done, failed = int(np.sum(codes == DONE)), int(np.sum(codes == FAILED))
        tried = int(np.sum(~np.isin(codes, NO_GRASP)))
        text = f"{done}/{tried} done" + (f", {failed} failed" if failed else "")
        now, count, gone = self._clock(), int(solved.sum()), float(self._weights[solved].sum())
        if self._first is None and count:
            self._first = now, count, gone
        since, cases, weight = (b - a for a, b in zip(self._first or (now, 0, 0.0), (now, count, gone), strict=True))
        # A few cases of one load path tell little of the others; too many would keep the reader waiting.
        enough = min(max(MIN_CASES, 0.03 * int(self._todo.sum())), MOST_CASES)
        if cases >= enough and since >= MIN_SECONDS and weight > 0:
            # By cost, not by number: the most expensive load paths come first.
            remaining = since * float(self._weights[self._todo & ~solved].sum()) / weight
            text += f", {since / cases:.3g} s/case, {duration(remaining)} left"
        return text

    def clear(self) -> None:
        """Leave the terminal with an empty line."""
        if self._live:
            self._stream.write("\r\x1b[K")
            self._stream.flush()


class Unbreakable:
    """A stream that a study outlives: when its reader goes away, what is written to it is lost, and nothing else."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        """What the stream has; it writes and flushes, or forgets."""
        act = getattr(self._stream, name)
        return partial(self._try, act) if name in ("write", "flush") else act

    def _try(self, act: Callable[..., Any], *text: str) -> Any:
        try:
            return act(*text)
        except BrokenPipeError:
            # Into nowhere from now on: the interpreter's last flush would complain too.
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
            return None
