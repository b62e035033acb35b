"""A run, on any number of ranks: prepare or resume the file, solve what is missing, and write how it ended."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from mpi4py import MPI
from numba.core.event import Event, Listener, install_listener

from softjaw.study.messages import CANNOT_WRITE, STOPPED, StudyError, complain, launched, make_folders
from softjaw.study.quantities import DONE, FAILED, MISSING
from softjaw.study.result import provenance
from softjaw.study.result.index import INDEX
from softjaw.study.result.lock import Lock, OpenedFile, holder, in_use
from softjaw.study.result.skeleton import ROUND_COMPLETE, create, rewrite
from softjaw.study.result.store import Result, open_result, torn_rows
from softjaw.study.result.write import MESH, Files, ResultWriter, codes_on, keeps_coarser, verify
from softjaw.study.run.limits import Stopper, early, limited_memory
from softjaw.study.run.load_path import PathSolver, rows_again, settle
from softjaw.study.run.plan import Plan
from softjaw.study.run.progress import Progress, code_of
from softjaw.study.run.refine import Rounds, round_text
from softjaw.study.run.schedule import Claims
from softjaw.study.run.shares import divided

T = TypeVar("T")


class Work(NamedTuple):
    """How it is done.

    ``solve_unit``: ``solve_unit(unit, wanted)`` yields ``(k, CaseResult | CaseFailure)`` for forces of a unit, upward:
    for those that are wanted, and for others that it has to solve on the way. ``image``: ``image(result, unit, c)``
    turns a result into that of the ``c``-th candidate which the unit serves. ``finalise``: ``finalise(writer)`` runs on
    rank 0 when no case is missing, to fill derived datasets. ``summary``: ``summary(result)`` gives the text that is
    printed at the end. ``time_limit``: of a single case [s]. ``memory``: as for `study.run.limits.limited_memory`.
    ``more``: ``more(result)`` gives the stations, poses or cases of the next round, from what is stored alone; none at
    the end. ``grown``: ``grown(rounds)`` gives plan and work with what these rounds added; collective.
    ``report``: ``report(result)`` gives the text that is stored when no round is left.
    """

    solve_unit: Callable[[Any, Sequence[int]], Iterable[tuple[int, Any]]]
    image: Callable[[Any, Any, int], Any] | None = None
    finalise: Callable[[ResultWriter], None] | None = None
    summary: Callable[[Any], str] | None = None
    time_limit: float = math.inf
    memory: float | str = "none"
    more: Callable[[Result], tuple[Any, ...]] = lambda _: ()
    grown: Callable[[Rounds], tuple[Plan, Work]] | None = None
    report: Callable[[Any], str] | None = None


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

    Rounds of further grasps and finer meshes follow, each in a file that takes the place of the last.

    Raises `StudyError` on every rank: the file is in use, belongs to another scene or cannot be written.
    """
    if path.is_symlink():  # one lock for all names of a file, and a link stays one
        path = Path(os.path.realpath(path))
    with locked(path, comm):
        if work.grown and (rounds := on_rank0(comm, rounds_in, path, plan)):
            plan, work = work.grown(rounds)
        finished = on_rank0(comm, _finished, path, plan, retry_failed, comm.size)
        code = _solve(plan, work, path, comm, retry_failed) if finished is None else finished
        while work.grown and code != STOPPED and (added := on_rank0(comm, _next_round, path, work)):
            plan, work = work.grown((*plan.layout.rounds, added))
            finished = None
            on_rank0(comm, begin_round, path, plan)
            code = _solve(plan, work, path, comm, retry_failed=False)
        if finished is None and code != STOPPED:
            on_rank0(comm, pack, work, path, plan)
        if comm.rank == 0 and work.summary is not None:
            with open_result(path) as result:
                print(work.summary(result), flush=True)
    early.clear()  # a signal that found nothing left to stop
    return code


@contextlib.contextmanager
def locked(path: Path, comm: Any) -> Iterator[None]:
    """Have a file for the ranks of ``comm`` alone, collective; `StudyError` on every rank if in use or not writable."""
    # Host and process: two runs on one file system must not have the same name.
    owner = f"host {os.uname().nodename}, process {os.getpid()}, {comm.size} rank{'s' * (comm.size > 1)}"
    lock, index = Lock(path, owner), path.with_name(f"{INDEX}.hdf")
    try:
        if index != path and (other := on_rank0(comm, holder, index)):  # the run of a folder holds its files, too
            raise in_use(path, other)
        on_rank0(comm, _take, lock, path)
        if comm.rank:
            lock.join()
        # Only when all ranks hold the lock does nobody slip in between.
        comm.Barrier()
        on_rank0(comm, lock.confirm)
        yield
        if comm.rank == 0:
            # Removed while it is held: without it another run could take a file that is about to vanish.
            lock.remove()
        # Nobody lets go before the file of the lock is gone.
        comm.Barrier()
    finally:
        # Whatever happened: a process that lives on must not keep others out.
        lock.release()


def _finished(path: Path, plan: Plan, retry_failed: bool, ranks: int) -> int | None:
    """Exit code of a file that is packed and lacks nothing, which is left as it is; None of any other."""
    if not path.exists() or not verify(path, plan.layout, plan.header):
        return None
    if retry_failed and has_coarser(path):
        return None
    with open_result(path, unchecked=True) as result:
        codes, wanted = result.codes.ravel(), plan.wanted
        codes = codes if wanted is None else codes_on(wanted, codes, result.read(MESH))
    if np.any(codes == MISSING) or rows_again(plan.units, codes, torn_rows(path, plan.layout), retry_failed):
        return None
    print(_begins(path, codes, 0, ranks, created=False), flush=True)
    return code_of(codes)


def has_coarser(path: Path) -> bool:
    """Whether `keeps_coarser` is true of a case of a file."""
    with open_result(path, unchecked=True) as result:
        return bool(keeps_coarser(result.messages).any())


def _solve(plan: Plan, work: Work, path: Path, comm: Any, retry_failed: bool) -> int:
    """Solve what is missing of a plan in its file, which is made if need be; the exit code."""
    created, torn = on_rank0(comm, file_of, path, plan)
    writer = ResultWriter(path, plan.layout, comm, plan.wanted)
    # Decided by one rank: all must agree on what is missing, whatever is written meanwhile.
    codes = on_rank0(comm, settle, writer, plan.units, torn, retry_failed)
    session = Session([plan.units], work, Files(path, [writer]), comm, codes)
    if comm.rank == 0:
        print(_begins(path, codes, len(torn), comm.size, created), flush=True)
    code = session.solve()
    if comm.rank == 0:
        finish(work, path, plan, writer.session, session.signal)
    return code


def rounds_in(path: Path, plan: Plan) -> Rounds:
    """The rounds of a file that was made from this scene; none where `verify` will refuse it."""
    with contextlib.suppress(StudyError), open_result(path) as result:
        if result.digest == plan.header.digest:
            return result.layout.rounds
    return ()


def _next_round(path: Path, work: Work) -> tuple[Any, ...]:
    with open_result(path) as result:
        added, number = work.more(result), len(result.layout.rounds) + 1
    if added:
        print(f"round {number}: {round_text(added)}", flush=True)
    return added


def _take(lock: Lock, path: Path) -> None:
    make_folders(path.parent)
    if path.is_dir():
        raise StudyError(CANNOT_WRITE, f"{path}: is a folder; name a file with -o")
    lock.take_first()
    if lock.warning:
        print(f"warning: {lock.warning}", file=sys.stderr, flush=True)


def file_of(path: Path, plan: Plan) -> tuple[bool, list[int]]:
    """Make the file of a plan if it is not there, or refuse another one's; whether it was made, and its torn rows."""
    if not path.exists():
        # By one process: ranks that make datasets together would have to do it in step.
        create(path, plan.layout, plan.header)
        return True, []
    if verify(path, plan.layout, plan.header):
        rewrite(path, plan.layout, plan.header)
    return False, torn_rows(path, plan.layout)


def _begins(path: Path, codes: np.ndarray, torn: int, ranks: int, created: bool) -> str:
    state, missing = "new file" if created else "resumed", int(np.sum(codes == MISSING))
    again = f", {torn} torn results are solved again" if torn else ""
    return f"{path}: {state}, {missing} of {codes.size} cases to solve on {ranks} rank{'s' * (ranks > 1)}{again}"


class Session:
    """The ranks that solve the cases which ``codes`` calls missing; creating and solving are collective over ``comm``.

    ``objects``: units of work on each of the ``files``. ``signal`` names the signal that ended it, if one did.
    """

    signal = ""

    def __init__(
        self, objects: Sequence[Sequence[Any]], work: Work, files: Files, comm: Any, codes: np.ndarray
    ) -> None:
        self._work, self._files, self._comm, self._codes = work, files, comm, codes
        self._state = OpenedFile(files.path)
        self._todo, self._groups = divided(objects, codes, comm.size)
        hosts = len(set(comm.allgather(MPI.Get_processor_name())))
        about = provenance.session(comm.size, hosts, MPI.Get_library_version()) if comm.rank == 0 else {}
        for writer in files.writers:
            if comm.rank == 0:
                writer.begin_session(**about)
            # Any rank may be the one that finishes the file.
            writer.session = comm.bcast(writer.session)
        self._progress = _progress(objects, codes, comm.size) if comm.rank == 0 else None

    def solve(self) -> int:
        """Solve, wait for all ranks, close the file; the exit code.

        Raises `StudyError`: the file cannot be written any more; several ranks are all ended at once instead.
        """
        claims = Claims(self._comm, self._groups)
        try:
            name = self._solve_share(claims)
        except StudyError as error:
            if self._comm.size > 1:
                # no rank can continue; the first to notice speaks
                self._comm.Abort(complain(error, claims.first_to_speak()))
            with contextlib.suppress(OSError, RuntimeError):  # where it could not be written, it may not be closed
                self._files.close()
            raise
        # A signal may reach some ranks only; any name is larger than no name.
        self.signal = name = max(self._comm.allgather(name))
        claims.free()
        code = code_of(self._files.codes())
        if name and code != STOPPED:  # the last case was in time: what comes next stops
            early.add(signal.Signals[name])
        self._files.close()
        if self._progress:
            self._progress.clear()
        return code

    def _solve_share(self, claims: Claims) -> str:
        """Solve this rank's share and wait for the others; the signal that came."""
        solver = PathSolver(self._files, self._work.solve_unit, self._work.image, claims, self._state)
        stopper = Stopper(solver.on_stop, self._work.time_limit, last_resort=True)
        listening = install_listener("numba:compile", COMPILING) if self._comm.rank == 0 else contextlib.nullcontext()
        with stopper, limited_memory(self._work.memory, claims.node.size), listening:
            for position in claims:
                solver.solve(self._todo[position], self._codes, stopper, self._look)
            request = self._comm.Ibarrier()  # a plain barrier would keep a core busy and rank 0 silent
            while not request.Test():
                self._look()
                # Sleeping leaves the core to ranks that still solve.
                time.sleep(0.02)
        return stopper.name

    def _look(self) -> None:
        if self._progress and self._progress.due():
            self._progress.update(self._files.codes())


def finish(work: Work, path: Path, plan: Plan, session: int, name: str) -> None:
    """Fill the derived datasets if nothing is missing, and write how this session ended; by one process."""
    with contextlib.closing(ResultWriter(path, plan.layout, MPI.COMM_SELF, plan.wanted)) as writer:
        writer.session, codes = session, writer.codes()
        missing, done, failed = (int(np.sum(codes == state)) for state in (MISSING, DONE, FAILED))
        # Derived values of half a study would look like those of a whole one.
        if work.finalise is not None and not missing:
            work.finalise(writer)
        reason = f"stopped by {name or 'another rank'}" if missing else "complete"
        # Once more: libraries that were loaded for the solves are known only now.
        versions = provenance.versions(MPI.Get_library_version())
        writer.update_session(stop=provenance.timestamp(), reason=reason, versions=versions, done=done, failed=failed)


def begin_round(path: Path, plan: Plan) -> None:
    """Give a file the rows of a further round of the same run; by one process."""
    rewrite(path, plan.layout, plan.header)
    with contextlib.closing(ResultWriter(path, plan.layout, MPI.COMM_SELF)) as writer:
        writer.session = len(writer.result().sessions) - 1
        writer.update_session(reason=ROUND_COMPLETE)


def pack(work: Work, path: Path, plan: Plan) -> None:
    """Write the report of a file to which no further round comes, and pack it, if there is room; by one process."""
    if work.report is not None:
        with contextlib.closing(ResultWriter(path, plan.layout, MPI.COMM_SELF)) as writer:
            writer.write_report(work.report(writer.result()))
    try:
        rewrite(path, plan.layout, plan.header, packed=True)
    except StudyError as error:
        if error.code != CANNOT_WRITE:
            raise
        # every number is in the file already
        print(f"note: {path}: complete, but not made smaller ({error})", file=sys.stderr, flush=True)


class Compiling(Listener):
    """Says once, when the first loop is compiled, why the first cases take so long."""

    _said = False

    def on_start(self, event: Event) -> None:
        """Say it."""
        if not self._said:
            print("compiling for this machine: a minute or two", flush=True)
        self._said = True

    def on_end(self, event: Event) -> None:
        """Nothing."""


COMPILING = Compiling()  # a process says it once, however many sessions it has


def _progress(objects: Iterable[Iterable[Any]], codes: np.ndarray, ranks: int) -> Progress:
    weights = np.ones(codes.size)
    for unit in chain.from_iterable(objects):
        # A unit costs the same however many candidates it serves, so they share its weight.
        weights[np.array(unit.rows)] = unit.cost / np.size(unit.rows) or 1.0
    # Under mpirun every rank's output claims to be a terminal, also when it goes to a file.
    return Progress(weights, codes, sys.stdout, live=ranks == 1 and not launched() and sys.stdout.isatty())
