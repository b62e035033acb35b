"""Options of ``softjaw scale``."""

from __future__ import annotations

import argparse


def add_scale_options(parser: argparse.ArgumentParser) -> None:
    """Describe the words after ``softjaw scale``."""
    add = parser.add_argument
    add("file", metavar="FILE", help="result file (.hdf) whose cases were timed")
    add("-n", type=_counts, default=(1, 4, 16, 64, 256, 1024, 4096), metavar="RANKS", dest="ranks",
        help="numbers of ranks (default 1,4,16,64,256,1024,4096)")  # fmt: skip
    add("--repeat", type=_count, default=1, metavar="K", help="take a study of K times as many candidates (default 1)")
    add("--per-node", type=_count, default=64, metavar="R", help="ranks that share a node and its counter (default 64)")
    add("--claim-us", type=_time, default=20.0, metavar="US", help="time of one look at the counter (default 20)")
    add("--write-ms", type=_time, default=0.015, metavar="MS", help="time of one write (default 0.015, as to a "
        "local disk; 1 is a busy network folder)")  # fmt: skip
    add("--writes-per-s", type=_time, default=5e4, metavar="N", help="writes that the file system takes from all ranks "
        "together (default 50000)")  # fmt: skip
    add("--mb-per-s", type=_time, default=1e3, metavar="MB", help="what the file system takes from all (default 1000)")


def _count(text: str) -> int:
    if not 1 <= (value := int(text)) <= 10**6:
        raise argparse.ArgumentTypeError(f"found {text}, expected 1 to 1000000")
    return value


def _counts(text: str) -> tuple[int, ...]:
    return tuple(_count(part) for part in text.split(","))


def _time(text: str) -> float:
    if not 0 < (value := float(text)) < 1e12:
        raise argparse.ArgumentTypeError(f"found {text}, expected a number above 0")
    return value
