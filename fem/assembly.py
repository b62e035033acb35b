"""From element contributions to global vectors and matrices: compressed rows whose pattern may grow, and sums."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from softjaw.friction.patch import FloatArray

IntArray = NDArray[np.int32]


class Pattern:
    """Entries of a square matrix in compressed rows (``start, column, values``); the diagonal is always stored.

    ``rows, columns (k,)`` are places in any order and with repeats; negative ones are left out.
    """

    def __init__(self, size: int, rows: IntArray, columns: IntArray) -> None:
        self.size = size
        # MUMPS and the bounded solver expect a diagonal entry in every row, also where it is zero
        diagonal = np.arange(size, dtype=np.int64) * (size + 1)
        self._set(np.unique(np.concatenate([self._keys(rows, columns), diagonal])))

    def slots(self, rows: IntArray, columns: IntArray) -> IntArray:
        """Index into ``values`` of every entry, -1 for negative rows or columns; all must be in the pattern."""
        # fixed unknowns keep -1, so that element matrices are added whole and `gather` skips those entries
        slots = np.full(len(rows), -1, dtype=np.int32)
        slots[(rows >= 0) & (columns >= 0)] = np.searchsorted(self.keys, self._keys(rows, columns))
        return slots

    def grow(self, rows: IntArray, columns: IntArray) -> IntArray:
        """Store these entries too; returns where each old entry has moved to."""
        wanted = np.unique(self._keys(rows, columns))
        place = np.searchsorted(self.keys, wanted)
        # `searchsorted` may point behind the last key, hence the minimum; such a key is new anyway
        fresh = self.keys[np.minimum(place, len(self.keys) - 1)] != wanted
        new, place = wanted[fresh], place[fresh]
        # every old entry moves by the number of new ones before it
        moved = np.arange(len(self.keys)) + np.cumsum(np.bincount(place, minlength=len(self.keys) + 1))[:-1]
        if len(new):
            self._set(np.insert(self.keys, place, new))
        return moved.astype(np.int32)

    def _keys(self, rows: IntArray, columns: IntArray) -> NDArray[np.int64]:
        # one sortable number per place; 64 bits, because the square of the size passes 2^31 from 46,341 unknowns on
        keep = (rows >= 0) & (columns >= 0)
        return rows[keep].astype(np.int64) * self.size + columns[keep]

    def _set(self, keys: NDArray[np.int64]) -> None:
        self.keys = keys
        self.start = np.searchsorted(keys, np.arange(self.size + 1) * np.int64(self.size)).astype(np.int32)
        first = np.arange(self.size) * np.int64(self.size)
        self.column = (keys - np.repeat(first, np.diff(self.start))).astype(np.int32)
        self.values = np.zeros(len(keys))


def pairs(rows: IntArray, columns: IntArray) -> tuple[IntArray, IntArray]:
    """Rows and columns ``(entries,)`` of element matrices, from two index arrays that broadcast against each other."""
    first, second = np.broadcast_arrays(rows, columns)
    return first.ravel().astype(np.int32, copy=False), second.ravel().astype(np.int32, copy=False)


def shifted(index: IntArray, offset: int) -> IntArray:
    """Unknowns of a part as unknowns of the whole; fixed ones stay fixed."""
    return np.where(index >= 0, index + offset, -1).astype(np.int32)


def gather(dofs: IntArray, values: FloatArray, size: int) -> FloatArray:
    """Sum element values into a vector ``(size,)``; those of fixed unknowns (index -1) are left out."""
    out = np.zeros(size)
    _add(dofs.ravel(), values.ravel(), out)
    return out


@njit(cache=True)
def _add(dofs, values, out):
    for k in range(dofs.size):
        if dofs[k] >= 0:
            out[dofs[k]] += values[k]
