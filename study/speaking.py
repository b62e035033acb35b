"""What a command says: by the first rank alone, and fit for a terminal."""

from __future__ import annotations

import os
import sys

from softjaw.study.exits import StudyError
from softjaw.study.show.tables.printable import printable

RANK = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID")


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
    """Print what may hold texts of files from elsewhere."""
    print(printable(text))
