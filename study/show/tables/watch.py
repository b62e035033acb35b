"""``softjaw watch FILE``: a live view of a run from another terminal, read from its result file."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

from softjaw.study.show.tables.watch_view import View

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
    view = View(stream, live=stream.isatty())
    try:
        while (code := view.look(path)) is None:
            sleep(every)
    except KeyboardInterrupt:
        stream.write("\nno longer watching; the run goes on\n")
        return INTERRUPTED
    return code
