"""The run: prepare or resume the file, solve what is missing, tell how it went. The same on any number of ranks."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI

from study import provenance
from study.exits import CANNOT_WRITE, DONE, SOME_FAILED, STOPPED, StudyError
from study.ladder import Climber, settle
from study.layout import FAILED, MISSING
from study.lock import Lock
from study.plan import Plan, by_cost
from study.progress import Progress
from study.schedule import Claims
from study.stopping import Stopper
from study.store import ResultWriter, create, open_result, torn_rows, verify

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
    """

    solve_unit: Callable[[Any], Iterable[tuple[int, Any]]]
    image: Callable[[Any, Any, int], Any] | None = None
    finalise: Callable[[ResultWriter], None] | None = None
    summary: Callable[[Any], str] | None = None


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
    owner = f"host {os.uname().nodename}, process {os.getpid()}, {comm.size} ranks"
    lock = Lock(path, owner)
    try:
        on_rank0(comm, _take, lock, path)
        if comm.rank:
            lock.join()
        comm.Barrier()
        on_rank0(comm, lock.confirm)
        created, torn = on_rank0(comm, _prepare, path, plan)
        code = _solve(plan, work, path, comm, torn, retry_failed, created)
        if comm.rank == 0:
            _print_summary(path, work)
            lock.remove()
        comm.Barrier()
    finally:
        lock.release()
    return code


def _take(lock: Lock, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
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


def _solve(plan: Plan, work: Work, path: Path, comm: Any, torn: list[int], retry_failed: bool, created: bool) -> int:
    writer = ResultWriter(path, plan.layout, comm)
    codes = on_rank0(comm, settle, writer, plan.units, torn, retry_failed)
    todo = [unit for unit in plan.units if any(codes[row] == MISSING for rows in unit.rows for row in rows)]
    todo = [todo[i] for i in by_cost([unit.cost for unit in todo])]
    progress = _begin(plan, writer, path, comm, codes, torn, created)
    claims = Claims(comm, len(todo))
    climber = Climber(writer, work.solve_unit, work.image, claims)
    look = (lambda: progress.due() and progress.update(writer.codes())) if progress else (lambda: None)
    with Stopper(climber.on_stop) as stopper:
        for position in claims:
            climber.climb(todo[position], codes, stopper, look)
        _wait(comm, look)
        name = max(comm.allgather(stopper.name))
    claims.free()
    codes = writer.codes()
    missing, failed = int(np.sum(codes == MISSING)), int(np.sum(codes == FAILED))
    if progress:
        progress.clear()
        if work.finalise is not None and not missing:
            work.finalise(writer)
        reason = f"stopped by {name or 'another rank'}" if missing else "complete"
        library = MPI.Get_library_version()
        counts = {"done": codes.size - missing - failed, "failed": failed}
        writer.update_session(
            stop=provenance.timestamp(), reason=reason, versions=provenance.versions(library), **counts
        )
    writer.close()
    return STOPPED if missing else SOME_FAILED if failed else DONE


def _begin(plan: Plan, writer: ResultWriter, path: Path, comm: Any, codes: Any, torn: list[int], created: bool):
    hosts = len(set(comm.allgather(MPI.Get_processor_name())))
    if comm.rank:
        return None
    writer.begin_session(**provenance.session(comm.size, hosts, MPI.Get_library_version()))
    again = f", {len(torn)} torn results are solved again" if torn else ""
    left = int(np.sum(codes == MISSING))
    ranks = f"{comm.size} rank{'s' * (comm.size > 1)}"
    state = "new file" if created else "resumed"
    print(f"{path}: {state}, {left} of {codes.size} cases to solve on {ranks}{again}", flush=True)
    weights = np.ones(codes.size)
    for unit in plan.units:
        for rows in unit.rows:
            weights[list(rows)] = unit.cost / max(len(rows) * len(unit.rows), 1) or 1.0
    # Under mpirun every rank's output claims to be a terminal, also when it goes to a file.
    launched = comm.size > 1 or any(name.startswith(("OMPI_", "PMIX_", "PMI_")) for name in os.environ)
    return Progress(weights, codes, sys.stdout, live=not launched and sys.stdout.isatty())


def _wait(comm: Any, look: Callable[[], Any]) -> None:
    request = comm.Ibarrier()  # a plain barrier would keep a core busy and rank 0 silent
    while not request.Test():
        look()
        time.sleep(0.02)


def _print_summary(path: Path, work: Work) -> None:
    if work.summary is not None:
        with open_result(path) as result:
            print(work.summary(result), flush=True)
