"""Checksums (CRC-32) of a result file: what each covers, how it is made, and what does not match.

HDF5 has checksums of its own (fletcher32), but ranks cannot write to such datasets independently of each other ("Can't
perform independent write with filters in pipeline"). So the rows carry these, and readers compare them before they
believe a value. One covers one *part* of a row (its maps, its fingers, its patch, ...): who wants little reads little.
A state has one of its own: a case whose state was lost is not taken for one that was never solved.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from softjaw.study.quantities import MISSING, STATES
from softjaw.study.result.datasets import CLOSING, STATE, SUMS, Column
from softjaw.study.result.guarded import GuardedFile
from softjaw.study.result.layout import ROOT, Layout

BLOCK = 2**24  # bytes of rows that are put side by side at a time
OF_STATE = {state: zlib.crc32(bytes([state])) for state in range(len(STATES))}
ABOUT = {"axes": ("units", "long_name", "scene_key"), "scene": ("digest", "file", "overrides", "petsc_options")}
PLACED = ("object_rotation", "object_origin")


def of_array(values: Any) -> int:
    """Checksum of the bytes of an array."""
    return zlib.crc32(np.ascontiguousarray(values).tobytes())


def of_parts(layout: Layout, row: int, values: Sequence[Any]) -> dict[str, int]:
    """Checksum of every part of a row; ``values`` as from ``study.result.write.record``."""
    places = layout.places(row)

    def data(i: int) -> bytes:
        return b"" if places[i] is None else np.asarray(values[i], layout.columns[i].dtype).tobytes()

    return {part: zlib.crc32(b"".join(map(data, columns))) for part, columns in layout.parts.items()}


def sums_of(file: GuardedFile, layout: Layout, part: str, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Those of the ``rows`` that have a part, and the checksums of the values that stand there."""
    columns = [layout.columns[i] for i in layout.parts[part]]
    # Some parts are stored for few candidates only: other rows have nothing to compare.
    if columns[0].among:
        rows = rows[_lines(layout, columns[0], rows) >= 0]
    if not rows.size:
        return rows, np.empty(0, np.uint32)
    views = [(_bytes(file, layout, c), c) for c in columns]
    # In blocks, because all rows of a wide part side by side may not fit into memory.
    step = max(BLOCK // max(sum(view.shape[1] for view, _ in views), 1), 1)
    found: list[int] = []
    for some in (rows[start : start + step] for start in range(0, len(rows), step)):
        block = np.concatenate([view[_lines(layout, c, some)] for view, c in views], axis=1)
        found += [zlib.crc32(line) for line in block]
    return rows, np.array(found, np.uint32)


def broken_rows(file: GuardedFile, layout: Layout, part: str, rows: np.ndarray) -> np.ndarray:
    """Those of the ``rows`` whose values of a part do not match their checksum."""
    rows, found = sums_of(file, layout, part, rows)
    return rows[found != _sums(file, layout, part)[rows]]


def broken_states(file: GuardedFile, layout: Layout, codes: np.ndarray, under_way: bool) -> np.ndarray:
    """Rows whose state is not the one that was stored.

    Where a run is ``under_way``, or was killed, a row may be stored and not yet marked; nowhere else.
    """
    stored = _sums(file, layout, STATE)
    # A damaged state may be any byte: those that mean nothing get 0 and count as wrong.
    wrong = np.array([OF_STATE.get(state, 0) for state in range(256)], np.uint32)[codes] != stored
    if under_way and wrong.any():
        # A kill between checksum and state leaves exactly this: begun, not computed, and the sum of an end.
        begun = file.values(file.checked(f"{ROOT}/status/attempts", layout.shape, np.dtype("u1"))).ravel() > 0
        ends = [crc for state, crc in OF_STATE.items() if state != MISSING]
        wrong &= ~(begun & (codes == MISSING) & np.isin(stored, ends))
    return np.flatnonzero(wrong)


def of_session(session: np.void) -> int:
    """Checksum of a row of the provenance, without the checksum that it holds."""
    return zlib.crc32(b"".join(session[name].tobytes() for name in session.dtype.names or () if name != "crc"))


def of_header(file: GuardedFile, layout: Layout) -> int:
    """Checksum of what is written once, when the file is made: axes, options, scene, definitions, labels."""
    axes = [f"axes/{name}" for name in layout.names]
    study = file.attributes(ROOT)
    # Lists of texts: the repr of an array is shortened and depends on the version of numpy.
    parts = [study.get("options"), study.get("title"), [str(name) for name in study.get("axes", ())]]
    for name in ("scene", *axes):
        found = file.attributes(f"{ROOT}/{name}")
        parts.append([found.get(key) for key in ABOUT[name.partition("/")[0]]])
        parts += [np.asarray(found[key]).tolist() for key in PLACED if key in found]
        parts += [[str(text) for text in found["options"]]] if "options" in found else []
    crc = zlib.crc32(repr(parts).encode())
    arrays = ["scene", "definitions", "candidates/label", *axes]
    arrays += ["wrenches/motion", "wrenches/candidate"] * bool(layout.sampled)
    for name in arrays:
        crc = zlib.crc32(np.asarray(file.values(file.plain(f"{ROOT}/{name}"))).tobytes(), crc)
    return crc


def closing_sum(file: GuardedFile, layout: Layout, name: str) -> int:
    """The stored checksum of something that is filled after all rows, by its name in ``layout.closing``."""
    found = file.checked(f"{SUMS}/{CLOSING}", (len(layout.closing),), np.dtype("<u4"))
    return int(file.values(found)[layout.closing.index(name)])


def _sums(file: GuardedFile, layout: Layout, part: str) -> np.ndarray:
    return file.values(file.checked(f"{SUMS}/{part}", layout.shape, np.dtype("<u4"))).ravel()


def _bytes(file: GuardedFile, layout: Layout, column: Column) -> np.ndarray:
    """A column's dataset as bytes, one line for every row that has a value in it."""
    found = layout.dataset(column.path)
    values = np.ascontiguousarray(file.values(file.checked(found.path, found.shape, found.dtype)))
    size = int(np.prod(column.shape, dtype=int)) * column.dtype.itemsize
    return values.reshape(-1).view(np.uint8).reshape(-1, size) if size else np.empty((layout.rows, 0), np.uint8)


def _lines(layout: Layout, column: Column, rows: np.ndarray) -> np.ndarray:
    """Lines of `_bytes` in which rows stand; -1 where they have none."""
    if not column.among:
        return rows
    index = np.unravel_index(rows, layout.shape)
    chosen = layout.chosen[column.among]
    slots = np.full(int(np.prod(layout.shape[-3:-1])), -1)
    slots[list(chosen)] = np.arange(len(chosen))
    slot = slots[index[-3] * layout.shape[-2] + index[-2]]
    lead = (*layout.shape[:-3], len(chosen), layout.shape[-1])
    # -1 cannot be ravelled; such rows are marked again below.
    lines = np.ravel_multi_index((*index[:-3], np.maximum(slot, 0), index[-1]), lead)
    return np.where(slot < 0, -1, lines)
