"""Several result files as one, and the ranks that solve what is missing of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.messages import STOPPED
from softjaw.study.quantities import FAILED
from softjaw.study.result.layout import Layout
from softjaw.study.result.write import ResultWriter
from softjaw.study.run.load_path import settle
from softjaw.study.run.plan import Plan
from softjaw.study.run.schedule import Claims, ObjectClaims
from softjaw.study.run.session import Session, Work, finish
from softjaw.study.run.shares import Share, by_cost, shares


@dataclass(frozen=True)
class Part:
    """One object of a batch as all ranks know it: its number in the folder, file, plan, and rows that are torn."""

    number: int
    path: Path
    plan: Plan
    torn: tuple[int, ...]
    seconds: float


class Files:
    """Result files of several objects as one: their rows are counted through, those of the first one first.

    It stands for a `ResultWriter` in a `Session`; opening and closing are collective.
    """

    def __init__(self, folder: Path, parts: Sequence[Part], comm: Any) -> None:
        self.path, self.layout = folder, parts[0].plan.layout
        self.files = [ResultWriter(part.path, part.plan.layout, comm, part.plan.wanted) for part in parts]
        self._first = np.cumsum([0, *(part.plan.layout.rows for part in parts)])

    def _at(self, row: int) -> tuple[ResultWriter, int]:
        k = int(np.searchsorted(self._first, row, "right")) - 1
        return self.files[k], row - int(self._first[k])

    def units(self, parts: Sequence[Part]) -> list[list[Any]]:
        """Units of work of every object, with rows as they are counted here."""
        return [
            [replace(u, rows=tuple(tuple(first + row for row in rows) for rows in u.rows)) for u in part.plan.units]
            for first, part in zip(self._first[:-1].tolist(), parts, strict=True)
        ]

    @property
    def session(self) -> list[int]:
        """Number of this session in every file."""
        return [file.session for file in self.files]

    @session.setter
    def session(self, numbers: Sequence[int]) -> None:
        for file, number in zip(self.files, numbers, strict=True):
            file.session = number

    def layout_of(self, row: int) -> Layout:
        """Layout of the file that a row is stored in."""
        return self._at(row)[0].layout

    def codes(self) -> np.ndarray:
        """State of every row, ``(rows,)``."""
        return np.concatenate([file.codes() for file in self.files])

    def count_attempt(self, row: int, change: int = 1) -> None:
        """As `ResultWriter.count_attempt`."""
        file, at = self._at(row)
        file.count_attempt(at, change)

    def write(self, row: int, values: Sequence[np.ndarray]) -> None:
        """As `ResultWriter.write`."""
        file, at = self._at(row)
        file.write(at, values)

    def fail(self, row: int, message: str, state: int = FAILED, seconds: float = np.nan) -> None:
        """As `ResultWriter.fail`."""
        file, at = self._at(row)
        file.fail(at, message, state, seconds)

    def begin_session(self, **fields: Any) -> None:
        """As `ResultWriter.begin_session`, in every file."""
        for file in self.files:
            file.begin_session(**fields)

    def close(self) -> None:
        """Close on all ranks."""
        for file in self.files:
            file.close()


class ObjectsSession(Session):
    """The ranks that solve what is missing of several objects; ``units`` lists those of every object."""

    def __init__(self, units: list[list[Any]], plan: Plan, work: Work, files: Files, comm: Any, codes: Any) -> None:
        self._units, self._sizes = units, list[int]()
        super().__init__(replace(plan, units=tuple(u for some in units for u in some)), work, files, comm, codes)

    def _divided(self, _plan: Plan, codes: np.ndarray) -> list[Share]:
        """What is missing, object after object, the costliest first; forces are divided where little comes after."""
        ranks = self._comm.size
        whole = [shares(units, codes, 1) for units in self._units]
        costs = [sum(share.cost for share in some) for some in whole]
        left, todo = sum(costs), list[Share]()
        for k in by_cost(costs):
            left -= costs[k]
            busy = left >= ranks * max((share.cost for share in whole[k]), default=0.0)
            some = whole[k] if busy else shares(self._units[k], codes, ranks)
            self._sizes.append(len(some))
            todo += some
        return todo

    def _claims(self) -> Claims:
        return ObjectClaims(self._comm, self._sizes)

    def _finish_alone(self, _name: str) -> None:
        """Each file is finished by the rank that planned its object."""

    def _finish(self, writer: Any, name: str) -> None:
        # A rank hangs: the run ends without it, and the next one derives what follows from all cases.
        for file in writer.files:
            finish(replace(self._work, finalise=None), file, name)
        self._comm.Abort(STOPPED)


def settled(files: Files, parts: Sequence[Part], retry_failed: bool) -> np.ndarray:
    """State of every case of some objects as their run begins; by one process."""
    each = zip(files.files, parts, strict=True)
    return np.concatenate([settle(file, part.plan.units, part.torn, retry_failed) for file, part in each])
