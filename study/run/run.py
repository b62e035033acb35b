"""The run: prepare or resume the file, solve what is missing, tell how it went. The same on any number of ranks."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from softjaw.study.exits import CANNOT_WRITE, StudyError
from softjaw.study.result.layout import MISSING
from softjaw.study.result.store import ResultWriter, create, torn_rows, verify
from softjaw.study.run.ladder import settle
from softjaw.study.run.lock import Lock
from softjaw.study.run.plan import Plan
from softjaw.study.run.session import Session, print_summary
from softjaw.study.writing import make_folders

T = TypeVar("T")


@dataclass(frozen=True)
class Work:
    """How it is done.

    Parameters
    ----------
    solve_unit : callable
        ``solve_unit(unit)`` yields ``(k, CaseResult | CaseFailure)`` for the forces of a ladder, upward.
    image : callable, optional
        ``image(result, unit, c)`` turns a result into that of the ``c``-th candidate which the unit serves.
    finalise : callable, optional
        ``finalise(writer)`` runs on rank 0 when no case is missing, to fill derived datasets.
    summary : callable, optional
        ``summary(result)`` gives the text that is printed at the end.
    time_limit : float
        Of a single case [s].
    memory : float, "auto" or "none"
        As for `study.run.memory.limited_memory`.
    """

    solve_unit: Callable[[Any], Iterable[tuple[int, Any]]]
    image: Callable[[Any, Any, int], Any] | None = None
    finalise: Callable[[ResultWriter], None] | None = None
    summary: Callable[[Any], str] | None = None
    time_limit: float = math.inf
    memory: float | str = "none"


def on_rank0(comm: Any, function: Callable[..., T], *arguments: Any) -> T:
    """What ``function`` gives on rank 0; an expected error there is raised on every rank, so that none waits."""
    answer: tuple[T | None, StudyError | None] = (None, None)
    if comm.rank == 0:
        try:
            answer = (function(*arguments), None)
        except StudyError as error:
            answer = (None, error)
        except OSError as error:
            place = f"{error.filename}: " if error.filename else ""
            answer = (None, StudyError(CANNOT_WRITE, f"{place}{error.strerror or error}"))
    value, failure = comm.bcast(answer)
    if failure is not None:
        raise failure
    return value


def run_study(plan: Plan, work: Work, path: Path, comm: Any, *, retry_failed: bool = False) -> int:
    """Solve all missing cases of ``plan`` into ``path`` and return the exit code; collective over ``comm``.

    Raises
    ------
    StudyError
        On every rank: the file is in use, belongs to another scene or cannot be written.
    """
    owner = f"host {os.uname().nodename}, process {os.getpid()}, {comm.size} rank{'s' * (comm.size > 1)}"
    lock = Lock(path, owner)
    try:
        on_rank0(comm, _take, lock, path)
        if comm.rank:
            lock.join()
        comm.Barrier()
        on_rank0(comm, lock.confirm)
        created, torn = on_rank0(comm, _prepare, path, plan)
        writer = ResultWriter(path, plan.layout, comm)
        codes = on_rank0(comm, settle, writer, plan.units, torn, retry_failed)
        session = Session(plan, work, writer, comm, codes)
        if comm.rank == 0:
            print(_begins(path, codes, len(torn), comm.size, created), flush=True)
        code = session.solve()
        if comm.rank == 0:
            print_summary(work, path)
            lock.remove()
        comm.Barrier()
    finally:
        lock.release()
    return code


def _take(lock: Lock, path: Path) -> None:
    make_folders(path.parent)
    if path.is_dir():
        raise StudyError(CANNOT_WRITE, f"{path}: is a folder; name a file with -o")
    lock.take_first()
    if lock.warning:
        print(f"warning: {lock.warning}", file=sys.stderr, flush=True)


def _prepare(path: Path, plan: Plan) -> tuple[bool, list[int]]:
    if not path.exists():
        create(path, plan.layout, plan.header)
        return True, []
    verify(path, plan.layout, plan.header)
    return False, torn_rows(path, plan.layout)


def _begins(path: Path, codes: np.ndarray, torn: int, ranks: int, created: bool) -> str:
    state, left = "new file" if created else "resumed", int(np.sum(codes == MISSING))
    again = f", {torn} torn results are solved again" if torn else ""
    return f"{path}: {state}, {left} of {codes.size} cases to solve on {ranks} rank{'s' * (ranks > 1)}{again}"
