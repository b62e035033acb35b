"""``softjaw watch FILE``: a live view of a run from another terminal, read from its result file."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

INTERRUPTED = 130  # what shells say of a program that Ctrl-C ended


def add_options(parser: argparse.ArgumentParser) -> None:
    """Describe the words after ``softjaw watch``."""
    parser.add_argument("file", metavar="FILE", help="result file (.hdf)")
    parser.add_argument("--every", type=_seconds, default=2.0, metavar="S", help="seconds between looks (default 2)")
    parser.description = (
        f"{parser.description} Ends with the run, and with its exit code: 0, 6 where cases failed, 75 where some are"
        " missing. Ctrl-C ends the view, not the run."
    )


def _seconds(text: str) -> float:
    if not 0.1 <= (value := float(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"found {text}, expected at least 0.1 s")
    return value


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
    from softjaw.study.show.tables.watch_view import View

    stream = stream or sys.stdout
    view = View(stream, live=stream.isatty())
    try:
        while (code := view.look(path)) is None:
            sleep(every)
    except KeyboardInterrupt:
        stream.write("\nno longer watching; the run goes on\n")
        return INTERRUPTED
    return code
