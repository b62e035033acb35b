"""Two models of a wall that gives way: the nonlinear shell, and the linear one.

Both tell a contact problem the same things: unknowns of their own, forces and tangent, where the outer face's nodes
are, and which unknowns move them (``fem.shell.wall_kernel``: ``first`` and ``second``).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.sparse import csr_matrix

from softjaw.fem.contact.pattern import Pattern, add_up
from softjaw.fem.errors import ConvergenceError
from softjaw.fem.petsc import Factors
from softjaw.fem.shell.element import FloatArray, IntArray, Shell
from softjaw.fem.shell.solve import free_numbers

AT_ONCE = 192  # right-hand sides; bounds the memory
LOOSE = 1e15  # ratio of the largest to the smallest stiffness from which on a shell counts as loose


class LinearShell:
    """Linear statics of a shell whose numbers ``fixed (6 k,)`` are zero.

    Raises
    ------
    ConvergenceError
        When the shell can move without force.
    """

    def __init__(self, shell: Shell, fixed: FloatArray) -> None:
        self.shell = shell
        self.unknown, self.free = free_numbers(fixed)
        rows, columns = shell.entries(self.unknown)
        pattern = Pattern(len(self.free), rows, columns)
        add_up(pattern.slots(rows, columns), shell.tangent(np.zeros(shell.size)), pattern.values)
        self._factors = Factors(pattern)
        self._refuse_loose(float(np.abs(pattern.values).max()))

    def _refuse_loose(self, stiffest: float) -> None:
        """Rounding keeps a loose body's pivots from being exactly zero; its displacements are beyond all bounds."""
        load = np.zeros(self.shell.size)
        load[self.free] = np.random.default_rng(0).normal(size=len(self.free))
        ratio = stiffest * np.abs(self.solve(load)).max() / np.abs(load).max()
        if not ratio < LOOSE:
            raise ConvergenceError(
                "the shell can move without force: fix more of it, or give it weak springs (see fem.shell.thin_walled)"
            )

    def solve(self, load: FloatArray) -> FloatArray:
        """State ``q`` [m] under the load [N], both ``(6 k,)`` or several as the columns of ``(6 k, m)``."""
        q = np.zeros(load.shape)
        q[self.free] = self._factors.solve(load[self.free])
        return q

    def compliance(self, nodes: IntArray) -> tuple[FloatArray, FloatArray]:
        """Answer of the outer face's nodes ``(n,)`` to forces on them.

        Returns
        -------
        C, W : (3 n, 3 n) arrays
            Displacement ``u + w`` and change of the director ``w`` of every node and component (rows, node by node) per
            force on every node and component [m/N]. ``C`` is symmetric; ``W`` turns the outer face's normals.
        """
        u = (6 * np.asarray(nodes, dtype=np.int64)[:, None] + np.arange(3)).ravel()
        C, W = np.empty((len(u), len(u))), np.empty((len(u), len(u)))
        for k in range(0, len(u), AT_ONCE):
            part = u[k : k + AT_ONCE]
            load = np.zeros((self.shell.size, len(part)))
            columns = np.arange(len(part))
            load[part, columns] = load[part + 3, columns] = 1.0  # a force on the outer face works on u + w
            q = self.solve(load)
            C[:, k : k + AT_ONCE], W[:, k : k + AT_ONCE] = q[u] + q[u + 3], q[u + 3]
        return C, W

    def destroy(self) -> None:
        """Give the factors' memory back."""
        self._factors.destroy()


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
