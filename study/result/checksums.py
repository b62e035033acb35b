"""Checksums (CRC-32) of a result file: what each covers, how it is made, and what does not match.

HDF5 has checksums of its own (fletcher32), but ranks cannot write to such datasets independently of each other ("Can't
perform independent write with filters in pipeline"). So every row has one checksum for each dataset that it has a value
in, and readers compare it before they believe a value. The last one of a row is that of its state: a case whose state
was lost is not taken for one that was never solved.
"""

import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.quantities import MISSING, STATES
from softjaw.study.result.datasets import SUMS
from softjaw.study.result.hdf5 import StoredFile
from softjaw.study.result.layout import ATTEMPTS, ROOT, Layout

OF_STATE = {state: zlib.crc32(bytes([state])) for state in range(len(STATES))}


def of_array(values: Any) -> int:
    """Checksum of the bytes of an array."""
    return zlib.crc32(np.ascontiguousarray(values).tobytes())


def of_row(layout: Layout, values: Sequence[Any], state: int) -> NDArray[np.uint32]:
    """Checksums of a row and of its state; ``values`` as from `study.result.write.record`."""
    columns = zip(layout.columns, values, strict=True)
    return np.array([*(of_array(np.asarray(v, c.dtype)) for c, v in columns), OF_STATE[state]], "<u4")


def of_rows(layout: Layout, values: Any, rows: NDArray[Any]) -> NDArray[np.uint32]:
    """Checksums of some ``rows`` of a dataset's ``values``."""
    stored = np.ascontiguousarray(values).reshape(layout.rows, -1)
    return np.array([zlib.crc32(stored[row]) for row in rows], np.uint32)


def broken_rows(file: StoredFile, layout: Layout, path: str, values: Any, rows: NDArray[Any]) -> NDArray[Any]:
    """Those of the ``rows`` whose values in the dataset at a path do not match their checksum."""
    sums = of_rows(layout, values, rows)
    wrong = sums != stored_sums(file, layout, path)[rows]
    # a run may have stored a row anew since the sums were read
    return rows[wrong & (sums != stored_sums(file, layout, path, anew=True)[rows])] if wrong.any() else rows[wrong]


def stored_sums(file: StoredFile, layout: Layout, path: str, *, anew: bool = False) -> NDArray[np.uint32]:
    """Checksums of all rows for the dataset at a path, or of the states; as they were read first, or ``anew``."""
    if anew or SUMS not in file.early:
        file.early[SUMS] = file.values(SUMS, (*layout.shape, len(layout.summed)), np.dtype("<u4"), anew=anew)
    return np.asarray(file.early[SUMS][..., layout.summed.index(path)]).ravel()


def broken_states(file: StoredFile, layout: Layout, codes: np.ndarray, under_way: bool) -> np.ndarray:
    """Rows whose state is not the one that was stored.

    Where a run is ``under_way``, or was killed, a row may be stored and not yet marked; nowhere else.
    """
    stored = stored_sums(file, layout, layout.summed[-1], anew=True)
    # A damaged state may be any byte: those that mean nothing get 0 and count as wrong.
    wrong = np.array([OF_STATE.get(state, 0) for state in range(256)], np.uint32)[codes] != stored
    if under_way and wrong.any():
        # A kill between checksum and state leaves exactly this: begun, not computed, and the sum of an end.
        begun = file.values(ATTEMPTS, layout.shape, np.dtype("u1")).ravel() > 0
        ends = [crc for state, crc in OF_STATE.items() if state != MISSING]
        wrong &= ~(begun & (codes == MISSING) & np.isin(stored, ends))
    return np.flatnonzero(wrong)


def of_session(session: np.void) -> int:
    """Checksum of a row of the provenance, without the checksum that it holds."""
    return zlib.crc32(b"".join(session[name].tobytes() for name in session.dtype.names or () if name != "crc"))


def of_header(file: StoredFile, layout: Layout) -> int:
    """Checksum of what is written once, when the file is made: axes, layout, header, scene, definitions."""
    crc = 0
    for name in ("layout", "header", "scene", "definitions", *(f"axes/{name}" for name in layout.names)):
        crc = zlib.crc32(np.asarray(file.values(f"{ROOT}/{name}")).tobytes(), crc)
    return crc
