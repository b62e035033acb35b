"""Small displacements of a shell: its first stiffness, factorised once, and what forces on its outer face do."""

from __future__ import annotations

import numpy as np

from softjaw.fem.contact.pattern import Pattern, add_up
from softjaw.fem.errors import ConvergenceError
from softjaw.fem.petsc import Factors
from softjaw.fem.shell.model import FloatArray, IntArray, Shell
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
                "the shell can move without force: fix more of it, or give it weak springs (see fem.shell.support)"
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
