"""Two models of a wall that gives way: the nonlinear shell, and the linear one condensed to where pads touch.

Both tell a contact problem the same things: unknowns of their own, forces and tangent, where the outer face's nodes
are, and which unknowns move them (``fem.wall_kernel``: ``first`` and ``second``).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fem.pose import FloatArray
from fem.shell_linear import LinearShell
from fem.shell_model import Shell

IntArray = NDArray[np.int32]


class WallModel(Protocol):
    """What a contact problem asks of a wall with ``n`` unknowns and ``k`` nodes."""

    shell: Shell
    size: int
    first: IntArray
    second: IntArray
    both: bool

    def entries(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of `tangent`'s values."""

    def outer(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacement of the outer face and change of the director at every node, ``(k, 3)`` each [m]."""

    def residual(self, y: FloatArray, force: FloatArray) -> FloatArray:
        """Inner forces plus ``force (k, 3)`` on the outer face's nodes: ``(n,)`` [N]."""

    def tangent(self, y: FloatArray, before: FloatArray | None) -> FloatArray:
        """Values of the tangent at ``y``; ``before`` is the state at the last tangent of the same solve, if any."""

    def everywhere(self, load: FloatArray) -> FloatArray:
        """Forces on this model's nodes as forces on all nodes of the shell."""

    def state(self, y: FloatArray, load: FloatArray) -> FloatArray:
        """State of the whole shell ``(6 k,)`` that belongs to ``y`` under the contact forces ``load`` on all nodes."""


class NonlinearWall:
    """Shell with finite displacements; its unknowns are its numbers that are not ``fixed (6 k,)``."""

    both = True

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

    def everywhere(self, load: FloatArray) -> FloatArray:
        """See `WallModel`."""
        return load

    def state(self, y: FloatArray, load: FloatArray) -> FloatArray:
        """See `WallModel`."""
        return self._full(y)

    def _full(self, y: FloatArray) -> FloatArray:
        q = np.zeros(self.shell.size)
        q[self.free] = y
        return q


class LinearWall:
    """Shell with small displacements, condensed to the outer face's nodes that pads can touch.

    Its unknowns are ``[v | w]``: the displacements of those nodes, whose stiffness is the inverse of their compliance,
    and the changes of their directors, which follow linearly, so that normals turn with the wall.

    Parameters
    ----------
    linear : LinearShell
        Factorised once for the object.
    nodes : (k,) array
        Nodes of the shell that pads can touch; node ``i`` of this model is ``nodes[i]``.
    """

    both = False

    def __init__(self, linear: LinearShell, nodes: IntArray) -> None:
        self.linear, self.shell, self.nodes = linear, linear.shell, np.asarray(nodes)
        C, W = linear.compliance(self.nodes)
        self._free = np.flatnonzero(np.diag(C) > 0)  # the others lie in planes of symmetry or are held
        n, k = len(self._free), len(C)
        self.size = n + k
        S = np.linalg.inv(C[np.ix_(self._free, self._free)])
        S = 0.5 * (S + S.T)
        self._scale = float(np.diag(S).mean())  # makes the rows of the directors forces
        self.stiffness = np.zeros((self.size, self.size))
        self.stiffness[:n, :n] = S
        self.stiffness[n:, :n] = -self._scale * (W[:, self._free] @ S)
        self.stiffness[n:, n:] = self._scale * np.eye(k)
        first = np.full(k, -1, dtype=np.int32)
        first[self._free] = np.arange(n, dtype=np.int32)
        self.first = first.reshape(-1, 3)
        self.second = (n + np.arange(k, dtype=np.int32)).reshape(-1, 3)
        self._entries = tuple(index.astype(np.int32) for index in np.nonzero(self.stiffness))

    def entries(self) -> tuple[IntArray, IntArray]:
        """See `WallModel`."""
        return self._entries

    def outer(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `WallModel`."""
        n = len(self._free)
        v = np.zeros(3 * len(self.nodes))
        v[self._free] = y[:n]
        return v.reshape(-1, 3), y[n:].reshape(-1, 3).copy()

    def residual(self, y: FloatArray, force: FloatArray) -> FloatArray:
        """See `WallModel`."""
        R = self.stiffness @ y
        R[: len(self._free)] += force.ravel()[self._free]
        return R

    def tangent(self, y: FloatArray, before: FloatArray | None) -> FloatArray:
        """See `WallModel`."""
        return self.stiffness[self._entries]

    def everywhere(self, load: FloatArray) -> FloatArray:
        """See `WallModel`."""
        full = np.zeros((self.shell.nodes, 3))
        full[self.nodes] = load
        return full

    def state(self, y: FloatArray, load: FloatArray) -> FloatArray:
        """See `WallModel`."""
        return self.linear.solve(np.hstack([load, load]).ravel())
