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

from study.exits import OTHER_FILE, StudyError
from study.storage.guarded import GuardedFile, opened
from study.storage.layout import DONE, MISSING, ROOT, VERSION, Header, Layout
from study.storage.reading import Result
from study.storage.record import crc32
from study.storage.result_writer import ResultWriter
from study.storage.skeleton import create

__all__ = ["ResultWriter", "create", "open_result", "rows_of", "torn_rows", "verify"]


def open_result(path: str | Path) -> Result:
    """A result file for reading, also while a run is writing it; raise `StudyError` if it is none."""
    path = Path(path)
    return opened(path, "result file", lambda file: Result(path, file), _go_through)


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
    from study.scene.difference import differences

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
                text = f"{path}: was repacked and cannot be written in parallel any more; 'softjaw repair' undoes that"
                raise StudyError(OTHER_FILE, text)


def torn_rows(path: Path, layout: Layout) -> list[int]:
    """Rows that are marked done but do not match their checksum."""
    return [row for row, state, values in rows_of(path, layout) if state == DONE and values is None]


def rows_of(path: Path, layout: Layout) -> Iterator[tuple[int, int, list[Any] | None]]:
    """Every row that is done or failed: number, state, and values, or None where they do not match their checksum."""
    expected = {d.path: d for d in layout.datasets}
    with h5py.File(path, "r") as file:
        guarded = GuardedFile(path, file)
        found = {at: guarded.checked(at, d.shape, d.dtype) for at, d in expected.items()}
        views = [_mapped(path, found[c.path], c.dtype) for c in layout.columns]
        codes, crc = (guarded.values(found[f"{ROOT}/status/{name}"]).ravel() for name in ("code", "crc"))
    for row in np.flatnonzero(codes != MISSING):
        pairs = zip(views, layout.places(row), strict=True)
        values = [None if place is None else view[place] for view, place in pairs]
        yield int(row), int(codes[row]), values if crc32(layout, row, values) == crc[row] else None


def _mapped(path: Path, dataset: h5py.Dataset, dtype: np.dtype) -> np.ndarray:
    if dataset.size == 0:
        return np.empty(dataset.shape, dtype)
    if dataset.chunks:  # a file that was repacked
        return dataset[()].astype(dtype)
    return np.memmap(path, dtype, "r", dataset.id.get_offset(), dataset.shape)
