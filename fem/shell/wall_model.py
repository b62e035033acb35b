"""Two models of a wall that gives way, the nonlinear shell and the linear one; strain and stress of its faces.

Both give a contact problem the same things: unknowns of their own, forces and tangent, where the outer face's nodes
are, and which unknowns move them (``fem.shell.wall_kernel``: ``first`` and ``second``).

Strains of a bilinear element are of second order in its size in its middle alone (Barlow, Int. J. Num. Meth. Eng. 10,
1976). So those of the middles are interpolated linearly to the crossings of the grid lines, as patch recovery does on a
grid (Zienkiewicz and Zhu, Int. J. Num. Meth. Eng. 33, 1992). Planes of symmetry have images behind them, so a part of a
body gives what the whole one does.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.sparse import csr_matrix

from softjaw.fem.assembly import IntArray
from softjaw.fem.petsc import Factors
from softjaw.fem.shell import element_kernel as kernel
from softjaw.fem.shell.element import Shell
from softjaw.fem.shell.wall_mesh import BodyMesh
from softjaw.friction.patch import FloatArray

AT_ONCE = 192  # right-hand sides; bounds the memory


def free_numbers(fixed: FloatArray) -> tuple[IntArray, IntArray]:
    """Unknown of each shell number, -1 where ``fixed (6 k,)`` is set, and the numbers that are unknown."""
    free = np.flatnonzero(~np.asarray(fixed, dtype=bool).ravel())
    unknown = np.full(np.size(fixed), -1, dtype=np.int32)
    unknown[free] = np.arange(len(free), dtype=np.int32)
    return unknown, free


class LinearShell:
    """Linear statics of a shell whose numbers ``fixed (6 k,)`` are zero; they or springs must hold it."""

    def __init__(self, shell: Shell, fixed: FloatArray) -> None:
        self.shell = shell
        unknown, self.free = free_numbers(fixed)
        self._factors = Factors(_matrix(len(self.free), shell.entries(unknown), shell.tangent(np.zeros(shell.size))))

    def solve(self, load: FloatArray) -> FloatArray:
        """State ``q`` [m] under the load [N], both ``(6 k,)`` or several as the columns of ``(6 k, m)``."""
        q = np.zeros(load.shape)
        q[self.free] = self._factors.solve(load[self.free])
        return q

    def compliance(self, nodes: IntArray) -> FloatArray:
        """Compliance ``(3 n, 3 n)`` of the outer face's nodes ``(n,)`` to forces on them, node by node [m/N]."""
        u = (6 * np.asarray(nodes, dtype=np.int64)[:, None] + np.arange(3)).ravel()
        C = np.empty((len(u), len(u)))
        # the whole load matrix of a fine wall would not fit into memory
        for k in range(0, len(u), AT_ONCE):
            part = u[k : k + AT_ONCE]
            load = np.zeros((self.shell.size, len(part)))
            columns = np.arange(len(part))
            load[part, columns] = load[part + 3, columns] = 1.0  # a force on the outer face works on u + w
            q = self.solve(load)
            C[:, k : k + AT_ONCE] = q[u] + q[u + 3]
        return C

    def destroy(self) -> None:
        """Give the factors' memory back."""
        self._factors.destroy()


class NonlinearWall:
    """Shell with finite displacements, as part of a contact problem; numbers ``fixed (6 k,)`` are zero.

    ``first, second (k, 3)``: unknowns that move every node's middle and director, -1 where fixed; both move the outer
    face. ``entries``: rows and columns of `tangent`'s values.
    """

    def __init__(self, shell: Shell[BodyMesh], fixed: FloatArray) -> None:
        self.shell = shell
        unknown, self.free = free_numbers(fixed)
        self.size = len(self.free)
        self.entries = shell.entries(unknown)
        numbers = unknown.reshape(-1, 6)
        self.first, self.second = np.ascontiguousarray(numbers[:, :3]), np.ascontiguousarray(numbers[:, 3:])

    def outer(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacement of the outer face and change of the director at every node, ``(k, 3)`` each [m]."""
        parts = self.state(y).reshape(-1, 6)
        return parts[:, :3] + parts[:, 3:], np.ascontiguousarray(parts[:, 3:])

    def residual(self, y: FloatArray, force: FloatArray) -> FloatArray:
        """Inner forces plus ``force (k, 3)`` on the outer face's nodes, which works on both vectors: ``(n,)`` [N]."""
        inner = self.shell.residual(self.state(y)).reshape(-1, 6) + np.hstack([force, force])
        return inner.ravel()[self.free]

    def tangent(self, y: FloatArray, before: FloatArray | None) -> FloatArray:
        """Values of the tangent at ``y``; ``before`` is the state at the last tangent of the same solve, if any."""
        return self.shell.tangent(self.state(y), None if before is None else self.state(before))

    def state(self, y: FloatArray) -> FloatArray:
        """State of the whole shell ``(6 k,)`` [m] that belongs to the unknowns ``y (n,)``."""
        q = np.zeros(self.shell.size)
        q[self.free] = y
        return q


class LinearWall(NonlinearWall):
    """Shell with small displacements: its first stiffness at every state.

    Directors change linearly too and the normals that pads see turn with them. Condensing the wall to where pads touch
    does not pay: its compliance is dense, and dearer to factorise than the whole sparse stiffness.
    """

    def __init__(self, shell: Shell[BodyMesh], fixed: FloatArray) -> None:
        super().__init__(shell, fixed)
        self._values = shell.tangent(np.zeros(shell.size))
        self.stiffness = _matrix(self.size, self.entries, self._values)

    def residual(self, y: FloatArray, force: FloatArray) -> FloatArray:
        """See `NonlinearWall`."""
        return self.stiffness @ y + np.hstack([force, force]).ravel()[self.free]

    def tangent(self, y: FloatArray, before: FloatArray | None) -> FloatArray:
        """See `NonlinearWall`."""
        return self._values


def _matrix(size: int, entries: tuple[IntArray, IntArray], values: FloatArray) -> csr_matrix:
    """Compressed rows with the values of these entries; those in negative rows or columns are left out."""
    rows, columns = entries
    free = (rows >= 0) & (columns >= 0)
    return csr_matrix((values[free], (rows[free], columns[free])), shape=(size, size))


class FaceState(NamedTuple):
    """Strain (Green-Lagrange, 11, 22, gamma_12) and stress (11, 22, 12 [Pa]) of one face ``(..., 3)``.

    Along the elements' axes: 1 along theta, 2 along s where the lines of these are at right angles.
    """

    strain: FloatArray
    stress: FloatArray

    @property
    def von_mises(self) -> FloatArray:
        """Equivalent stress of plane stress at every place [Pa]."""
        a, b, c = np.moveaxis(self.stress, -1, 0)
        return np.sqrt(a * a - a * b + b * b + 3.0 * c * c)

    @property
    def principal_strain(self) -> FloatArray:
        """Smaller and larger principal strain in the wall, ``(..., 2)``."""
        a, b, c = np.moveaxis(self.strain, -1, 0)
        # half of c, because gamma is twice the tensor's shear
        middle, radius = 0.5 * (a + b), np.hypot(0.5 * (a - b), 0.5 * c)
        return np.stack([middle - radius, middle + radius], axis=-1)


def faces(shell: Shell[BodyMesh], q: FloatArray) -> tuple[FaceState, FaceState]:
    """Outer and inner face where grid lines cross, ``(m + 1, n + 1)``, in the state ``q (6 k,)``."""
    outer, inner = (_state(shell, _at_crossings(shell.mesh, middle.strain)) for middle in middles(shell, q))
    return outer, inner


def middles(shell: Shell, q: FloatArray) -> tuple[FaceState, FaceState]:
    """Outer and inner face in the middles of the ``n`` elements in the state ``q (6 k,)``."""
    nodes, weights, _, start = shell.loops
    e = np.empty((len(nodes), kernel.STRAINS))
    kernel.forms(nodes, weights, np.hstack([shell.mesh.X, shell.mesh.D]) + q.reshape(-1, 6), e)
    e -= start
    membrane, bending = (e[:, first : first + 8].reshape(-1, 4, 2).mean(axis=1) for first in (0, 8))
    outer, inner = (
        _state(shell, np.column_stack([membrane + zeta * bending, e[:, 16] + zeta * e[:, 17]])) for zeta in (1.0, -1.0)
    )
    return outer, inner


def _state(shell: Shell, strain: FloatArray) -> FaceState:
    """Strain and its stress: plane stress as in the element, whose thickness strain has no coupling with the others."""
    E, nu = shell.young_modulus, shell.poisson_ratio
    C = E / (1.0 - nu**2) * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu)]])
    return FaceState(strain, strain @ C)


def _at_crossings(mesh: BodyMesh, values: FloatArray) -> FloatArray:
    """Strains where grid lines cross, ``(m + 1, n + 1, 3)``, from those in the middles of the elements ``(m n, 3)``."""
    grid, lines = values.reshape(len(mesh.theta) - 1, len(mesh.s) - 1, 3), mesh.theta
    middles = 0.5 * (lines[1:] + lines[:-1])
    # what lies before the first line and behind the last: the other end, or the image, whose shear has the other sign
    image = np.array([1.0, 1.0, -1.0])
    if mesh.closed:
        before, behind, (first, last) = grid[-1:], grid[:1], middles[[-1, 0]] + [-2 * np.pi, 2 * np.pi]
    else:
        before, behind, (first, last) = image * grid[:1], image * grid[-1:], 2 * lines[[0, -1]] - middles[[0, -1]]
    around = np.concatenate([[first], middles, [last]]), np.concatenate([before, grid, behind])
    grid = make_interp_spline(*around, k=1)(lines)
    # beyond the ends as between the last
    return make_interp_spline(0.5 * (mesh.s[1:] + mesh.s[:-1]), grid, k=1, axis=1)(mesh.s)
