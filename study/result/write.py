"""Filling a result file, on all ranks at once: nothing but independent writes to space that is there already."""

import math
import os
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from softjaw.study.case.result import CaseResult
from softjaw.study.messages import CANNOT_WRITE, OTHER_FILE, StudyError
from softjaw.study.quantities import EFFECTS, FAILED, MEASURED, MEASURED_EFFECTS, MISSING, MODELS
from softjaw.study.result import checksums
from softjaw.study.result.datasets import CLOSING_SUMS, MESSAGE_BYTES, SUMS
from softjaw.study.result.hdf5 import StoredFile, text_of
from softjaw.study.result.layout import DONE, ROOT, SESSION, Header, Layout
from softjaw.study.result.skeleton import HDF5_VERSIONS, report_bytes, text_bytes
from softjaw.study.result.store import Result, open_result
from softjaw.study.scene.sections import COARSE, FINEST

MESH = "work/mesh"
NOT_FINER = "on a finer mesh it was not solved: "


def keeps_coarser(messages: Any) -> NDArray[np.bool_]:
    """Which cases have the values of a coarser mesh, because they were not solved on a finer one, by their messages."""
    return np.char.find(messages.astype(str), NOT_FINER) >= 0


class ResultWriter:
    """A result file open on all ranks of ``comm``; opening and closing are collective, everything else is not.

    With ``comm = None`` this process has it alone and needs no MPI; nor does a single rank. A row that is stored from a
    coarser mesh than ``wanted (rows,)`` counts as missing; it keeps its values until those of the finer one are there.
    """

    def __init__(self, path: Path, layout: Layout, comm: Any, wanted: np.ndarray | None = None) -> None:
        if comm is not None and not h5py.get_config().mpi:
            if comm.size > 1:
                text = "this h5py was loaded without MPI; 'softjaw doctor' says how to cure that"
                raise StudyError(CANNOT_WRITE, f"{text}, and a script reads results after softjaw.run only")
            comm = None
        self.path, self.layout = path, layout
        shared = {} if comm is None else {"driver": "mpio", "comm": comm}
        self._file = h5py.File(path, "r+", libver=HDF5_VERSIONS, **shared)
        # Opened once: finding an object by its path takes longer than a small write.
        self._columns = [_Column(self._file, c.path, c.share) for c in layout.columns]
        self._code, self._attempts = (self._file[f"{ROOT}/status/{name}"] for name in ("code", "attempts"))
        self._sums, self._closing_sums = self._file[SUMS], self._file[CLOSING_SUMS]
        self._sessions = self._file[f"{ROOT}/provenance/sessions"]
        self.session, self._wanted = 0, wanted

    def codes(self) -> np.ndarray:
        """State of every row, ``(rows,)``."""
        codes: np.ndarray = self._code[()]
        if self._wanted is None:
            return codes.ravel()
        return codes_on(self._wanted, codes, self._file[f"{ROOT}/{MESH}"][()])

    def attempts(self) -> np.ndarray:
        """How often every row was begun without an end, ``(rows,)``."""
        # a row that was tried on a coarser mesh was begun once for that
        return np.maximum(self._attempts[()].ravel().astype(int) - np.isin(self._code[()], (DONE, FAILED)).ravel(), 0)

    def count_attempt(self, row: int, change: int = 1) -> None:
        """Note that a case is about to be solved (or, with -1, that it was given up in an orderly way)."""
        index = self._index(row)
        # One byte holds it, which must neither wrap round nor fall below 0.
        self._attempts[index] = min(max(int(self._attempts[index]) + change, 0), 255)

    def forget(self, row: int) -> None:
        """Make a failed or torn row a missing one that was never tried."""
        # State first, attempts last: a kill in between leaves a begun row, which the next run tidies.
        self._code[self._index(row)] = MISSING
        self.tidy(row)
        self._attempts[self._index(row)] = 0

    def tidy(self, row: int) -> None:
        """Make a missing row that a killed process had stored, but not marked, like any other missing one."""
        if self._code[self._index(row)] == MISSING:  # not one that has the values of a coarser mesh
            self._sums[(*self._index(row), -1)] = checksums.OF_STATE[MISSING]

    def fail(self, row: int, message: str, state: int = FAILED, seconds: float = math.nan) -> None:
        """Store why a case has no result: it failed after ``seconds``, or is one of `study.quantities.NO_GRASP`.

        One that has the values of a coarser mesh keeps them, with the message.
        """
        # those that are finer start from the one that has no state
        mesh = math.nan if self._wanted is None else COARSE if self._wanted[row] == COARSE else FINEST
        if self._wanted is not None and self._code[self._index(row)] == DONE:
            self.write(row, self._tried_on(row, mesh, NOT_FINER + message))
        else:
            self.write(row, blank(self.layout, message, seconds, mesh), state)

    def not_finer(self) -> list[int]:
        """Rows that keep the values of a coarser mesh, because `fail` was said of the one that is wanted."""
        messages = self.read("status/message").ravel() if self._wanted is not None else ()
        return [row for row, message in enumerate(messages) if NOT_FINER.encode() in message]

    def try_again(self, row: int) -> None:
        """Make such a row one that was never tried on the mesh that is wanted."""
        assert self._wanted is not None
        values = self._tried_on(row, self._wanted[row] - 1, "")
        self._code[self._index(row)] = MISSING
        self.write(row, values)

    def _tried_on(self, row: int, mesh: float, failure: str) -> list[np.ndarray]:
        """The stored values of a row as tried on a ``mesh``, where there was this ``failure``."""
        values = [np.asarray(h5py.Dataset(column.dataset)[self._index(row)]) for column in self._columns]
        values[[c.key for c in self.layout.columns].index(MESH)] = np.asarray(mesh)
        known = text_of(bytes(values[-1].item())).partition(NOT_FINER)[0].removesuffix("; ")
        values[-1] = np.array(text_bytes("; ".join(filter(None, (known, failure))), MESSAGE_BYTES))
        return values

    def write(self, row: int, values: Sequence[np.ndarray], state: int = DONE) -> None:
        """Store a case; ``values`` as from ``record``."""
        index = self._index(row)
        # A complete case is final, unless a finer mesh is wanted: readers that look on must not see it change.
        if self._code[index] in (DONE, FAILED):
            if self.codes()[row] == DONE:
                raise ValueError(f"row {row} is done already and must not be written again")
            self._code[index] = MISSING  # a later round may name it again
        self._attempts[index] = 1  # a row that is stored was begun: what killed it before is no sign for a finer mesh
        # Values, sums, state: a kill in between leaves a row that reads as not computed.
        for place, column, value in zip(self._columns, self.layout.columns, values, strict=True):
            place.write(index, np.asarray(value, column.dtype, "C"))
        self._sums[index] = checksums.of_row(self.layout, values, state)
        self._code[index] = state

    def _index(self, row: int) -> tuple[int, ...]:
        return tuple(int(i) for i in np.unravel_index(row, self.layout.shape))

    def read(self, path: str) -> np.ndarray:
        """Any dataset by its path below ``/study`` (``e_n/ccm``), or the key of its quantity."""
        return self._file[self.layout.paths.get(path, f"{ROOT}/{path}")][()]

    def result(self) -> Result:
        """The same file for reading; not to be closed by itself."""
        return Result(self.path, StoredFile(self.path, self._file))

    def write_report(self, text: str) -> None:
        """Write the report, cut where it is too long; by one rank, after all rows."""
        self._file[f"{ROOT}/report"][()] = report = report_bytes(text)
        # The sum follows the values: a reader that comes in between looks again.
        self._close("report", report)

    def write_derived(self, name: str, values: Any) -> None:
        """Fill a derived dataset; by one rank, after all rows."""
        dataset = self._file[f"{ROOT}/derived/{name}"]
        dataset[...] = filled = np.broadcast_to(np.asarray(values, dataset.dtype), dataset.shape)
        self._close(f"derived/{name}", filled)

    def _close(self, name: str, values: np.ndarray) -> None:
        self._closing_sums[self.layout.closing.index(name)] = checksums.of_array(values)

    def begin_session(self, **fields: Any) -> None:
        """Add a row to the provenance; by one rank."""
        used = self._sessions[()]["start"] != b""
        # When all rows are used the last one is written over: provenance must not stop a run.
        self.session = min(int(used.sum()), len(used) - 1)
        self._sessions[self.session] = np.zeros((), SESSION)
        self.update_session(**fields)

    def update_session(self, **fields: Any) -> None:
        """Change fields of this run's row of the provenance; by one rank."""
        row = self._sessions[self.session]
        for name, value in fields.items():
            kind = row.dtype[name]
            row[name] = text_bytes(value, kind.itemsize) if kind.kind == "S" else value
        row["crc"] = checksums.of_session(row)
        self._sessions[self.session] = row

    def close(self) -> None:
        """Close on all ranks."""
        self._file.close()


class Files:
    """Result files as one: their rows are counted through, those of the first one first; closing is collective."""

    def __init__(self, path: Path, writers: Sequence[ResultWriter]) -> None:
        self.path, self.writers = path, writers
        self._first = np.cumsum([0, *(writer.layout.rows for writer in writers)]).tolist()

    def at(self, row: int) -> tuple[ResultWriter, int]:
        """The file that has a row, and the row's number there."""
        k = bisect_right(self._first, row) - 1
        return self.writers[k], row - self._first[k]

    def counted(self, number: int, units: Sequence[Any]) -> list[Any]:
        """Units of work on one of the files, with rows as they are counted here."""
        first = self._first[number]
        return [replace(u, rows=tuple(tuple(first + row for row in rows) for rows in u.rows)) for u in units]

    def codes(self) -> np.ndarray:
        """State of every row, ``(rows,)``."""
        return np.concatenate([writer.codes() for writer in self.writers])

    def close(self) -> None:
        """Close on all ranks."""
        for writer in self.writers:
            writer.close()


class _Column:
    """A dataset with a ``share`` of each case, whose writing takes a tenth of the time of ``dataset[index] =``."""

    def __init__(self, file: h5py.File, path: str, share: tuple[int, ...]) -> None:
        self.dataset = h5py.h5d.open(file.id, path.encode())
        # an array's own type knows no encoding of a text, and HDF5 would not convert it
        self._kind, self._space = self.dataset.get_type(), self.dataset.get_space()
        self._room, self._first = h5py.h5s.create_simple(share or (1,)), (0,) * len(share)
        self._count = (*[1] * (len(self._space.shape) - len(share)), *share)

    def write(self, index: tuple[int, ...], values: np.ndarray) -> None:
        """Write the values of the case at an index, which are contiguous and of the dataset's type."""
        self._space.select_hyperslab((*index, *self._first), self._count)
        self.dataset.write(self._room, self._space, values, self._kind)


def blank(layout: Layout, message: str = "", seconds: float = math.nan, mesh: float = math.nan) -> list[np.ndarray]:
    """A row without values, as a case without a result leaves it after so many ``seconds`` on a ``mesh``."""
    known = {"work/seconds_total": seconds, MESH: mesh}
    row = [np.full(c.share, known.get(c.key, c.fill), c.dtype) for c in layout.columns]
    row[-1] = np.array(text_bytes(message, MESSAGE_BYTES), layout.columns[-1].dtype)
    return row


def rounded(faces: np.ndarray) -> np.ndarray:
    """Values of faces to 3e-5 of the largest one: far below the error of their mesh, and packed to 60 % of the size.

    >>> rounded(np.array([0.75, 1e-6, 1 / 3])).tolist()
    [0.75, 0.0, 0.333343505859375]
    """
    step = np.exp2(np.frexp(np.fmax.reduce(np.abs(faces), axis=None, initial=0.0))[1] - 15)
    return np.asarray(np.round(faces / step) * step, faces.dtype)


def record(layout: Layout, result: CaseResult) -> list[np.ndarray]:
    """The row of a solved case, aligned with ``layout.columns``; what the result does not give stays empty.

    `ValueError` for a key or a shape that is not in ``study.quantities``: a bug of the caller, not a failed case.
    """
    given = _flattened(layout, result)
    row = blank(layout, result.message)
    for i, column in enumerate(layout.columns[:-1]):
        if column.key not in given:
            continue
        value = np.asarray(given.pop(column.key), column.dtype)
        if value.shape != column.share:
            raise ValueError(f"'{column.key}' of a case has shape {value.shape}, its quantity says {column.share}")
        row[i] = value if column.dtype.kind != "f" or column.dtype.itemsize > 4 else rounded(value)
    # A key that nobody stores would be lost without a word.
    if given:
        raise ValueError(f"a case gives {', '.join(sorted(given))}, which study.quantities does not list")
    return row


def _flattened(layout: Layout, result: CaseResult) -> dict[str, Any]:
    given = dict(result.values)
    for q in layout.quantities:
        if q.group == "maps" and q.by_model and q.key in given:
            values = np.asarray(given.pop(q.key), float)
            if values.shape != (len(MODELS),):
                raise ValueError(f"'{q.key}' of a case has shape {values.shape}, expected one for each of {MODELS}")
            given.update({f"{q.key}/{model}": value for model, value in zip(MODELS, values, strict=True)})
    if layout.faces and result.patch is not None:
        given.update({f"patch/{name}": value for name, value in result.patch.items()})
    for name, (level, indicator, reason, *changes) in result.effects.items():
        index = EFFECTS.get(name, ()).index(level) if isinstance(level, str) else level
        parts = {"level": index, "indicator": indicator, "reason": reason}
        if name in MEASURED_EFFECTS:
            parts |= dict(zip(MEASURED, changes, strict=False))
        given.update({f"effects/{name}_{part}": value for part, value in parts.items()})
    return given


def codes_on(wanted: np.ndarray, codes: np.ndarray, meshes: np.ndarray) -> np.ndarray:
    """States ``(rows,)`` of which a case that was tried on a coarser mesh than ``wanted (rows,)`` alone is missing."""
    return np.where(np.isin(codes, (DONE, FAILED)).ravel() & (meshes.ravel() < wanted), MISSING, codes.ravel())


def verify(path: Path, layout: Layout, header: Header) -> bool:
    """Whether ``path`` is packed; `StudyError` unless it can be written and was made from this scene and layout."""
    # Tried, not asked: mode bits know nothing of read-only mounts.
    os.close(os.open(path, os.O_RDWR))
    with open_result(path) as result:
        result.refuse_other(header)
        if result.layout.shape != layout.shape or result.layout.text() != layout.text():
            text = f"{path}: stores other values, by run.patches or its version; it can be read, but not resumed"
            raise StudyError(OTHER_FILE, f"{text}: choose another file with -o")
        datasets = [result.file.checked(d.path, d.shape, d.dtype) for d in result.layout.datasets]
        packed = any(dataset.chunks is not None for dataset in datasets)
        codes = result.codes.ravel()
        wrong = checksums.broken_states(result.file, layout, codes, result.killed)
        # Solving them again would write over results that may be right.
        if lost := int(np.sum(codes[wrong] == MISSING)):
            text = f"the states of {lost} cases are lost, but not their results"
            raise result.file.damaged(text, "restore it from a copy, or choose another file with -o")
    return packed
