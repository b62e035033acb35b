"""Shell as a whole: forces and tangent of all its numbers in one fixed pattern, supports and reactions.

Numbers are ordered node by node, ``6 * node + [u_x, u_y, u_z, w_x, w_y, w_z]``, all in metres; a state is one vector
``q`` of ``6 k`` numbers, zero in the reference. The pattern ``start, column`` holds every pair of numbers whose nodes
share an element, fixed ones too; who solves leaves out what is fixed (``Shell.entries``). For example, by hand::

    shell = Shell(mesh, young_modulus=2e9, poisson_ratio=0.38)
    force = shell.residual(q)                 # (6 k,), inner forces plus springs
    values = shell.tangent(q, q_before)       # (nnz,) at shell.start, shell.column; None instead of q_before: plain
    K = scipy.sparse.csr_matrix((values, shell.column, shell.start))

or inside a larger problem whose unknown number of each shell number is ``unknown (6 k,)``, -1 where fixed::

    rows, columns = shell.entries(unknown)    # once; they belong to the values one by one
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.shell import element_kernel as kernel
from softjaw.fem.shell.element import elements
from softjaw.fem.shell.mesh import ShellMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
NO_STEP = np.empty((0, 6))


class Shell:
    """Thin-walled object.

    Parameters
    ----------
    mesh : ShellMesh
    young_modulus, poisson_ratio : float
        [Pa], [-].
    springs : (6 k,) array, optional
        Stiffness to ground of every number [N/m]; the weak springs of a freely held object, for example.

    Attributes
    ----------
    size : int
        ``6 k``.
    start, column : (6 k + 1,), (nnz,) arrays
        Compressed-row pattern of the tangent, columns ascending.
    node_area : (k,) array
        Reference area that belongs to each node [m^2].
    """

    def __init__(
        self, mesh: ShellMesh, young_modulus: float, poisson_ratio: float, springs: FloatArray | None = None
    ) -> None:
        self.mesh, self.young_modulus, self.poisson_ratio = mesh, float(young_modulus), float(poisson_ratio)
        self.elements = elements(mesh.X, mesh.D, mesh.elements, self.young_modulus, self.poisson_ratio)
        self.size = 6 * len(mesh.X)
        self.springs = np.zeros(self.size) if springs is None else springs
        self._reference = np.hstack([mesh.X, mesh.D])
        self.node_area = np.bincount(
            mesh.elements.ravel(), (self.elements.area @ kernel.N_G).ravel(), minlength=len(mesh.X)
        )
        self._build_pattern()

    def _build_pattern(self) -> None:
        """Blocks of 6 x 6 between nodes that share an element."""
        nodes, n = self.elements.nodes, len(self.mesh.X)
        keys = (nodes[:, :, None].astype(np.int64) * n + nodes[:, None, :]).ravel()
        loose = np.arange(n, dtype=np.int64) * (n + 1)
        blocks, position = np.unique(np.concatenate([keys, loose]), return_inverse=True)
        row, neighbour = blocks // n, blocks % n
        first = np.searchsorted(row, np.arange(n + 1))
        count = np.diff(first)
        self._width = (6 * count).astype(np.int32)
        place = 36 * first[row] + 6 * (np.arange(len(blocks)) - first[row])
        self._place = place[position[: keys.size]].reshape(-1, 4, 4).astype(np.int32)
        self.start = np.concatenate([[0], np.cumsum(np.repeat(6 * count, 6))]).astype(np.int32)
        self.column = np.empty(self.start[-1], dtype=np.int32)
        for k in range(6):
            for m in range(6):
                self.column[place + k * 6 * count[row] + m] = 6 * neighbour + m
        where = np.repeat(np.arange(self.size), np.diff(self.start)) == self.column
        self._diagonal = np.flatnonzero(where)

    @property
    def nodes(self) -> int:
        """Number of nodes ``k``."""
        return len(self.mesh.X)

    def residual(self, q: FloatArray) -> FloatArray:
        """Inner forces of the state ``q (6 k,)``, springs included: ``(6 k,)`` [N]."""
        out = (self.springs * q).reshape(-1, 6)
        kernel.residual(*self.elements.loops, self._reference + q.reshape(-1, 6), out)
        return out.ravel()

    def tangent(self, q: FloatArray, before: FloatArray | None = None) -> FloatArray:
        """Values ``(nnz,)`` of the tangent [N/m] in ``q (6 k,)``, at ``start`` and ``column``.

        Parameters
        ----------
        q : (6 k,) array
        before : (6 k,) array, optional
            State at the previous tangent of the same Newton solve. With it the tangent is that of mixed integration
            points (Magisano, Leonetti, Garcea, Int. J. Num. Meth. Eng. 109, 2017): its geometric part uses the stresses
            that the last linear step predicted. The residual, and so the solution, is untouched; thin shells get
            there in far fewer iterations. Leave it out in the first iteration, also after every cut step.
        """
        values = np.zeros(self.start[-1])
        values[self._diagonal] = self.springs
        q = q.reshape(-1, 6)
        step = NO_STEP if before is None else q - before.reshape(-1, 6)
        kernel.tangent(*self.elements.loops, self._reference + q, step, self._place, self._width, values)
        return values

    def entries(self, unknown: IntArray) -> tuple[IntArray, IntArray]:
        """Row and column ``(nnz,)`` of every value; ``unknown (6 k,)`` numbers the shell's numbers, -1 where fixed."""
        return np.repeat(unknown, np.diff(self.start)), unknown[self.column]

    def displacement(self, q: FloatArray) -> FloatArray:
        """Displacement ``u + w`` of the outer face's nodes, ``(k, 3)`` [m]."""
        parts = q.reshape(-1, 6)
        return parts[:, :3] + parts[:, 3:]
