"""The door to result files: creates a result file, fills it in parallel, reads it without trusting it.

Crash safety: one process writes the whole skeleton, closes it, and renames it into place; after that all ranks do
nothing but independent writes to allocated space, in the order values, checksum, state. A killed process can
therefore lose the row it was writing, and nothing else: a row that is marked done but does not match its checksum is
solved again.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.result import checksums
from softjaw.study.result.checksums import broken_rows, broken_states
from softjaw.study.result.guarded import GuardedFile, opened
from softjaw.study.result.layout import MISSING, VERSION, Header, Layout
from softjaw.study.result.reading import Result
from softjaw.study.result.result_writer import ResultWriter
from softjaw.study.result.skeleton import create

__all__ = ["ResultWriter", "create", "open_result", "rows_of", "torn_rows", "verify"]


def open_result(path: str | Path, unchecked: bool = False) -> Result:
    """A result file for reading, also while a run is writing it; raise `StudyError` if it is none.

    ``unchecked`` reads what is there, whether it matches its checksums or not.
    """
    path = Path(path)
    return opened(path, "result file", lambda file: Result(path, file, unchecked), _go_through)


def _go_through(result: Result) -> None:
    """Touch whatever readers of a result may read, however much of it is broken."""
    for dataset in (*result.layout.datasets, *result.layout.grid):
        with suppress(StudyError):
            found = result.file.plain(dataset.path)
            if found.chunks:  # data that have to be unpacked
                result.file.values(found)
    for name in ("scene", "definitions", "report"):
        with suppress(StudyError):
            getattr(result, name)


def verify(path: Path, layout: Layout, header: Header) -> None:
    """Raise `StudyError` unless ``path`` can be written and was made from this scene with this layout."""
    from softjaw.study.scene.text import differences  # who only reads results need not load all that checks scenes

    os.close(os.open(path, os.O_RDWR))
    with open_result(path) as result:
        if result.digest != header.digest:
            text = (
                f"{path}: made from another scene ({result.digest[:8]}, this one is {header.digest[:8]}:"
                f" {differences(result.scene, header.scene)}); choose another file with -o, or move this one away"
            )
            raise StudyError(OTHER_FILE, text)
        # How the object was cut into triangles may differ in the last bit on another machine; the file's own counts.
        same = replace(layout, surface=result.layout.surface)
        old = result.version != str(VERSION)
        if old or result.layout.shape != layout.shape or result.layout.options() != same.options():
            text = f"{path}: made by a version that stored other values; it can be read, but not gone on with"
            raise StudyError(OTHER_FILE, f"{text}: choose another file with -o")
        for dataset in (*result.layout.datasets, *result.layout.grid):
            if result.file.checked(dataset.path, dataset.shape, dataset.dtype).chunks is not None:
                text = f"{path}: was repacked and cannot be written in parallel any more; choose another file with -o"
                raise StudyError(OTHER_FILE, text)
        codes = result.codes.ravel()
        wrong = broken_states(result.file, layout, codes, result.killed)
        if lost := int(np.sum(codes[wrong] == MISSING)):
            text = f"{path}: damaged (the states of {lost} cases are lost, but not their results)"
            raise StudyError(OTHER_FILE, f"{text}; restore it from a copy, or choose another file with -o")


def rows_of(path: Path, layout: Layout) -> Iterator[tuple[int, int, list[Any] | None]]:
    """Every row of a file that is done or failed; see `study.result.checksums.rows_of`."""
    with h5py.File(path, "r") as file:
        yield from checksums.rows_of(GuardedFile(path, file), layout)


def torn_rows(path: Path, layout: Layout) -> list[int]:
    """Rows that are marked done or failed but do not match their checksums."""
    if layout.version == 3:
        return [row for row, _, values in rows_of(path, layout) if values is None]
    with open_result(path, unchecked=True) as result:
        codes = result.codes.ravel()
        marked = np.flatnonzero(codes != MISSING)
        torn = [broken_rows(result.file, layout, part, marked) for part in layout.parts]
        states = broken_states(result.file, layout, codes, under_way=False)
    return sorted({*np.concatenate(torn).tolist(), *(set(states.tolist()) & set(marked.tolist()))})
