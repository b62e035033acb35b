"""One share of the work: forces of a grasp candidate are solved from the lowest one on, missing rows are stored."""

import math
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.case.result import CaseFailure, TimeLimitError
from softjaw.study.quantities import FAILED, MISSING, NO_GRASP
from softjaw.study.result.lock import OpenedFile
from softjaw.study.result.write import MESH, Files, record
from softjaw.study.run.limits import AbandonedError, Stopper, is_out_of_memory
from softjaw.study.run.shares import Share

Pending = dict[int, list[tuple[int, int]]]  # for each force, the candidates that are served and their rows
DEADLY = 2
KILLED = "the process was killed {n} times while it solved {what}; 'run --retry-failed' tries again"
NOT_TRIED = "not tried, because a lower force of this candidate failed: {text}"
TOO_SLOW = "not solved within {limit:g} s; raise run.time_limit_s and run again with --retry-failed"
NO_MEMORY = "more memory than run.memory_gb leaves to a rank ({text}); run on fewer ranks or a coarser mesh"


def rows_again(units: Iterable[Any], codes: np.ndarray, torn: Iterable[int], retry_failed: bool) -> list[int]:
    """Rows that have a state and are solved all the same: torn ones, failed ones on demand, those left out before."""
    wanted = [row for unit in units if not unit.state for rows in unit.rows for row in rows]
    again = [*torn, *(row for row in wanted if codes[row] in NO_GRASP)]
    return [int(row) for row in [*again, *(np.flatnonzero(codes == FAILED) if retry_failed else [])]]


def settle(writer: Any, units: Iterable[Any], torn: Iterable[int], retry_failed: bool) -> np.ndarray:
    """Decide by one process what is missing: torn rows again, failed ones on demand, no grasps and deadly ones never.

    A case that an earlier run left out and this one tries is missing again. Returns states ``(rows,)`` of the cases.
    """
    units, codes, attempts = list(units), writer.codes(), writer.attempts()
    for row in rows_again(units, codes, torn, retry_failed):
        writer.forget(row)
        codes[row], attempts[row] = MISSING, 0
    for row in writer.not_finer() if retry_failed else ():
        writer.try_again(row)
        codes[row], attempts[row] = MISSING, 0
    # Begun and not ended: a kill may have come between the checksum and the state.
    for row in np.flatnonzero((codes == MISSING) & (attempts > 0)):
        writer.tidy(int(row))
    for unit in units:
        # Decided before any solve, alike in every run of the scene; what a file holds already stays.
        for row in (row for rows in unit.rows for row in rows if unit.state and codes[row] == MISSING):
            writer.fail(row, unit.reason, unit.state)
            codes[row] = unit.state
        for rows in unit.rows:
            deadly = [k for k, row in enumerate(rows) if codes[row] == MISSING and attempts[row] >= DEADLY]
            # Forces above are given up as well where the load path would lead through the deadly one again.
            for k in range(deadly[0], len(rows)) if deadly and not unit.apart else deadly:
                if codes[rows[k]] == MISSING:
                    first = k if k in deadly else deadly[0]
                    what = "this case" if k == first else "a lower force of this candidate"
                    writer.fail(rows[k], KILLED.format(n=attempts[rows[first]], what=what))
                    codes[rows[k]] = FAILED
    return codes


class PathSolver:
    """Solves load paths on one rank and stores each case as soon as it is solved."""

    def __init__(
        self,
        files: Files,
        solve_unit: Callable,
        image: Callable | None,
        claims: Any,
        state: OpenedFile,
    ) -> None:
        self._files, self._solve_unit, self._image, self._claims = files, solve_unit, image, claims
        self._state = state
        self._begun: list[int] = []

    def on_stop(self) -> None:
        """Called by a signal: begin nothing new, and do not count the case in flight as one that killed us."""
        self._claims.stop()
        self._uncount()

    def solve(self, share: Share, codes: np.ndarray, stopper: Stopper, look: Callable[[], Any]) -> None:
        """Solve a share, and store the rows that ``codes`` calls missing.

        Raises `StudyError`: the file cannot be written any more.
        """
        unit, pending = share.unit, _pending(share, codes)
        cases = self._solve_unit(unit, tuple(pending))
        clock = time.perf_counter()
        while pending and not self._claims.stopped:
            # A file that was moved away would be filled where nobody finds it.
            self._state.check()
            # Counted before the solve: a process that is killed cannot count afterwards.
            self._count(pending)
            try:
                with stopper.case():
                    k, result = next(cases)
            except AbandonedError:
                # What was given up for a signal stays not computed, so that resume solves it.
                break
            except (Exception, TimeLimitError) as error:  # whatever a case dies of is its result
                cases.close()
                self._fail(unit, pending, sentence(error, stopper.limit), time.perf_counter() - clock)
                cases, clock = self._solve_unit(unit, tuple(pending)), time.perf_counter()
                continue
            now = time.perf_counter()
            self._store(unit, pending.pop(k, []), result, now - clock)
            clock = now
            look()
        # An orderly end, so what was begun has killed nobody.
        self._uncount()
        cases.close()

    def _store(self, unit: Any, served: list[tuple[int, int]], result: Any, seconds: float) -> None:
        rows = {row for _, row in served}
        # No longer begun before it is stored: a stop amid the writes must not count it back.
        self._begun = [row for row in self._begun if row not in rows]
        for c, row in served:
            writer, at = self._files.at(row)
            if isinstance(result, CaseFailure):
                with self._state.writing():
                    writer.fail(at, result.message, seconds=math.nan if c else seconds)
                continue
            mine = self._image(result, unit, c) if self._image else result
            # A candidate that is served by symmetry cost nothing: its timings stay empty, so that sums are right.
            entries = {k: v for k, v in mine.values.items() if not c or k == MESH or not k.startswith("work/")}
            entries = entries if c else {"work/seconds_total": seconds, **entries}
            values = record(writer.layout, replace(mine, values=entries))
            with self._state.writing():
                writer.write(at, values)

    def _fail(self, unit: Any, pending: Pending, message: str, seconds: float) -> None:
        """Note what failed, and take it from what is pending: the lowest force, and those above that depend on it."""
        self._begun = []
        failed = {k: pending.pop(k) for k in ([min(pending)] if unit.apart else [*pending])}
        with self._state.writing():
            for k, served in failed.items():
                text = message if k == min(failed) else NOT_TRIED.format(text=message)
                for n, (_, row) in enumerate(served):
                    writer, at = self._files.at(row)
                    # the time is spent once for all candidates that are served
                    writer.fail(at, text, seconds=math.nan if n or k > min(failed) else seconds)

    def _count(self, pending: dict[int, list[tuple[int, int]]]) -> None:
        rows = [row for _, row in pending[min(pending)]]
        # Complete forces are solved again on the way and leave the rows as they were: these are counted once.
        if rows != self._begun:
            self._uncount()
            self._add(rows, 1)
            self._begun = rows

    def _uncount(self) -> None:
        # Taken away first: a signal that calls this again meanwhile must not count twice.
        rows, self._begun = self._begun, []
        self._add(rows, -1)

    def _add(self, rows: Iterable[int], change: int) -> None:
        with self._state.writing():
            for writer, at in map(self._files.at, rows):
                writer.count_attempt(at, change)


def _pending(share: Share, codes: np.ndarray) -> Pending:
    """Missing rows of a share: for each force, rising, the candidates and their rows."""
    at = {k: [(c, r[k]) for c, r in enumerate(share.unit.rows) if codes[r[k]] == MISSING] for k in share.forces}
    return {k: served for k, served in at.items() if served}


def sentence(error: BaseException, limit: float) -> str:
    """Why a case, or whatever else was bounded by a time ``limit`` [s], has no result."""
    if isinstance(error, TimeLimitError):
        return TOO_SLOW.format(limit=limit)
    if isinstance(error, StopIteration):
        return "the load path ended before this force; this is a bug"
    if is_out_of_memory(error):
        return NO_MEMORY.format(text=str(error) or "no more was available")
    text = f"{type(error).__name__}: {error}"
    # A builtin error is most likely a bug, and only its place tells which.
    if type(error).__module__ == "builtins" and error.__traceback__:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        text += f" ({Path(frame.filename).name}:{frame.lineno})"
    return text
