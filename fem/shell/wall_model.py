"""Two models of a wall that gives way: the nonlinear shell, and the linear one.

Both tell a contact problem the same things: unknowns of their own, forces and tangent, where the outer face's nodes
are, and which unknowns move them (``fem.shell.wall_kernel``: ``first`` and ``second``).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from softjaw.fem.contact.pattern import Pattern, add_up
from softjaw.fem.objects.pose import FloatArray
from softjaw.fem.shell.model import Shell

IntArray = NDArray[np.int32]


class WallModel(Protocol):
    """What a contact problem asks of a wall with ``n`` unknowns and ``k`` nodes."""

    shell: Shell
    size: int
    first: IntArray
    second: IntArray

    def entries(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of `tangent`'s values."""

    def outer(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacement of the outer face and change of the director at every node, ``(k, 3)`` each [m]."""

    def residual(self, y: FloatArray, force: FloatArray) -> FloatArray:
        """Inner forces plus ``force (k, 3)`` on the outer face's nodes: ``(n,)`` [N]."""

    def tangent(self, y: FloatArray, before: FloatArray | None) -> FloatArray:
        """Values of the tangent at ``y``; ``before`` is the state at the last tangent of the same solve, if any."""

    def state(self, y: FloatArray) -> FloatArray:
        """State of the whole shell ``(6 k,)`` that belongs to ``y``."""


class NonlinearWall:
    """Shell with finite displacements; its unknowns are its numbers that are not ``fixed (6 k,)``."""

    def __init__(self, shell: Shell, fixed: FloatArray) -> None:
        self.shell = shell
        self.free = np.flatnonzero(~np.asarray(fixed, dtype=bool))
        self.size = len(self.free)
        unknown = np.full(shell.size, -1, dtype=np.int32)
        unknown[self.free] = np.arange(self.size, dtype=np.int32)
        self._entries = shell.entries(unknown)
        numbers = unknown.reshape(-1, 6)
        self.first, self.second = np.ascontiguousarray(numbers[:, :3]), np.ascontiguousarray(numbers[:, 3:])

    def entries(self) -> tuple[IntArray, IntArray]:
        """See `WallModel`."""
        return self._entries

    def outer(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `WallModel`."""
        parts = self._full(y).reshape(-1, 6)
        return parts[:, :3] + parts[:, 3:], np.ascontiguousarray(parts[:, 3:])

    def residual(self, y: FloatArray, force: FloatArray) -> FloatArray:
        """See `WallModel`; a force on the outer face works on both of a node's vectors."""
        inner = self.shell.residual(self._full(y)).reshape(-1, 6) + np.hstack([force, force])
        return inner.ravel()[self.free]

    def tangent(self, y: FloatArray, before: FloatArray | None) -> FloatArray:
        """See `WallModel`."""
        return self.shell.tangent(self._full(y), None if before is None else self._full(before))

    def state(self, y: FloatArray) -> FloatArray:
        """See `WallModel`."""
        return self._full(y)

    def _full(self, y: FloatArray) -> FloatArray:
        q = np.zeros(self.shell.size)
        q[self.free] = y
        return q


class LinearWall(NonlinearWall):
    """Shell with small displacements: its first stiffness at every state.

    Directors change linearly too and the normals that pads see turn with them. Condensing the wall to where pads touch
    does not pay: its compliance is dense, and dearer to factorise than the whole sparse stiffness.
    """

    def __init__(self, shell: Shell, fixed: FloatArray) -> None:
        super().__init__(shell, fixed)
        self._values = shell.tangent(np.zeros(shell.size))
        pattern = Pattern(self.size, *self._entries)
        add_up(pattern.slots(*self._entries), self._values, pattern.values)
        self.stiffness = csr_matrix((pattern.values, pattern.column, pattern.start), shape=(self.size, self.size))

    def residual(self, y: FloatArray, force: FloatArray) -> FloatArray:
        """See `WallModel`."""
        return self.stiffness @ y + np.hstack([force, force]).ravel()[self.free]

    def tangent(self, y: FloatArray, before: FloatArray | None) -> FloatArray:
        """See `WallModel`."""
        return self._values
