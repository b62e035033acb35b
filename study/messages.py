"""What a command says and how it ends: exit codes, the error that carries one, and texts fit for a terminal."""

from __future__ import annotations

import os
import re
import sys

DONE, USAGE, OTHER_FILE, IN_USE, CANNOT_WRITE, SOME_FAILED, BUG, STOPPED = 0, 2, 3, 4, 5, 6, 70, 75
MEANING = {
    DONE: "done",
    USAGE: "bad usage or scene, nothing was started",
    OTHER_FILE: "the file belongs to another scene or cannot be read",
    IN_USE: "another run is using the file",
    CANNOT_WRITE: "the file cannot be written",
    SOME_FAILED: "finished, some cases failed",
    BUG: "a bug",
    STOPPED: "stopped, run the same command again",
}
RANK = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID")
# What controls a terminal or hides text: control characters, line separators, changes of direction, surrogates
UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufeff]")


class StudyError(Exception):
    """An expected failure of a run: one sentence for the user and the exit code that goes with it."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(code, message)
        self.code, self.message = code, message

    def __str__(self) -> str:
        return self.message


def printable(text: str) -> str:
    r"""A text of unknown origin with nothing in it that controls a terminal.

    >>> print(printable("a\x1b[2Jb"))
    a\u001b[2Jb
    """
    return UNPRINTABLE.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def shortened(text: str, width: int = 80) -> str:
    """A printable text of at most ``width`` characters."""
    text = printable(text)
    return text if len(text) <= width else text[: width - 4] + " ..."


def first_rank() -> bool:
    """Whether this process speaks for all ranks; known without MPI."""
    return next((os.environ[name] == "0" for name in RANK if name in os.environ), True)


def complain(error: StudyError) -> int:
    """Say what went wrong, once, and give the exit code."""
    if first_rank():
        for line in error.message.splitlines():
            print(f"error: {printable(line)}", file=sys.stderr, flush=True)
    return error.code


def say(text: str) -> None:
    """Print a text that may hold parts of files from elsewhere."""
    print(printable(text))
