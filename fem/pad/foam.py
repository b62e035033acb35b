"""Compiled loops over elements and face points: where the assembly time goes.

Element arrays keep the node index last and contiguous, so that the innermost loop over the nodes of an element becomes
vector instructions; local unknowns are therefore ordered component first, ``(3, nodes)``.
Arithmetic is strict IEEE: with relaxed rules the last bits depend on whether code was compiled now or loaded from the
cache, and a study would not be the same to the bit; these loops gain nothing from them.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from numba import njit

from softjaw.fem import materials
from softjaw.fem.assembly import gather, pairs
from softjaw.fem.materials import inverted, stress
from softjaw.fem.pad.mesh import Pad
from softjaw.friction.patch import FloatArray

SMALLEST_DET = 0.05  # a Newton step is shortened before an element is compressed further than this


@njit(cache=True)
def _gradient(u, dN, nodes, F, B):
    """Deformation gradient and its inverse at one point; returns ``det F``."""
    for i in range(3):
        for j in range(3):
            value = 1.0 if i == j else 0.0
            for a in range(nodes):
                value += u[i, a] * dN[j, a]
            F[i, j] = value
    return inverted(F, B)


@njit(cache=True)
def smallest_det(u, dN):
    """Smallest ``det F`` over all points of all elements [-]."""
    F, B = np.empty((3, 3)), np.empty((3, 3))
    smallest = np.inf
    for e in range(dN.shape[0]):
        for q in range(dN.shape[1]):
            smallest = min(smallest, _gradient(u[e], dN[e, q], dN.shape[3], F, B))
    return smallest


@njit(cache=True, inline="always")
def _elements(law, par, u, dN, w, nodes, r, K):
    """Residual and, where ``K`` has entries, tangent of every element; returns the smallest ``det F``."""
    tangent = K.size > 0
    F, B, P, T = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, nodes))
    A = np.empty((3, 3, 3, 3)) if tangent else np.empty((0, 0, 0, 0))
    smallest = np.inf
    for e in range(w.shape[0]):
        for i in range(3):
            for a in range(nodes):
                r[e, i, a] = 0.0
        if tangent:
            for i in range(3):
                for a in range(nodes):
                    for k in range(3):
                        for b in range(nodes):
                            K[e, i, a, k, b] = 0.0
        for q in range(w.shape[1]):
            g = dN[e, q]
            J = _gradient(u[e], g, nodes, F, B)
            smallest = min(smallest, J)
            stress(law, F, B, J, par, P, A)
            # the node loop is innermost and contiguous, so that it becomes vector instructions
            dv = w[e, q]
            for i in range(3):
                p0, p1, p2 = dv * P[i, 0], dv * P[i, 1], dv * P[i, 2]
                for a in range(nodes):
                    r[e, i, a] += p0 * g[0, a] + p1 * g[1, a] + p2 * g[2, a]
            if not tangent:
                continue
            for i in range(3):
                for k in range(i, 3):  # the tangent is symmetric: blocks below the diagonal follow
                    for j in range(3):
                        a0, a1, a2 = dv * A[i, j, k, 0], dv * A[i, j, k, 1], dv * A[i, j, k, 2]
                        for b in range(nodes):
                            T[j, b] = a0 * g[0, b] + a1 * g[1, b] + a2 * g[2, b]
                    for a in range(nodes):
                        g0, g1, g2 = g[0, a], g[1, a], g[2, a]
                        for b in range(nodes):
                            K[e, i, a, k, b] += g0 * T[0, b] + g1 * T[1, b] + g2 * T[2, b]
        if tangent:
            for i in range(3):
                for k in range(i):
                    for a in range(nodes):
                        for b in range(nodes):
                            K[e, i, a, k, b] = K[e, k, b, i, a]
    return smallest


def _bound_to(laws):
    """Loops that call the material laws, compiled anew whenever the laws' source ``laws`` is another.

    numba's cache looks at the file of a function alone, and at its closure; without this the laws of an older version
    would go on being used.
    """

    @njit(cache=True)
    def elements(law, par, u, dN, w, r, K):
        """Residual ``r`` and tangent ``K`` of hexahedra; returns the smallest ``det F`` [-].

        ``law, par``: as of `Material`; ``u (n, 3, nodes)``: displacements [m]; ``dN (n, points, 3, nodes)``: reference
        gradients [1/m]; ``w (n, points)``: reference volumes [m^3]; out: ``r (n, 3, nodes)`` [N] and ``K (n, 3, nodes,
        3, nodes)`` [N/m], with size 0 ``r`` alone.
        """
        if len(laws) == 0:  # read here, so that it enters the key of the cache
            return np.nan
        # constant node counts let the compiler unroll
        if u.shape[2] == 8:
            return _elements(law, par, u, dN, w, 8, r, K)
        return _elements(law, par, u, dN, w, 27, r, K)

    @njit(cache=True)
    def tangents(law, par, F):
        """Tangents of the law ``(n, 3, 3, 3, 3)`` [Pa] at the deformation gradients ``F (n, 3, 3)``."""
        B, P, A = np.empty((3, 3)), np.empty((3, 3)), np.empty((len(F) if len(laws) > 0 else 0, 3, 3, 3, 3))
        for n in range(len(A)):
            stress(law, F[n], B, inverted(F[n], B), par, P, A[n])
        return A

    return elements, tangents


elements, tangents = _bound_to(hashlib.sha256(Path(materials.__file__).read_bytes()).hexdigest())


class Foam:
    """Foam of a pad; vectors of unknowns are numbered as ``fem.pad.mesh.Pad`` says.

    ``rows, columns``: where the entries of `stiffness` belong, negative means fixed; ``closing_entries``: those in the
    row of the backing plate's closing displacement.
    """

    def __init__(self, pad: Pad) -> None:
        self.pad = pad
        n, nodes = pad.element_nodes.shape
        dofs = pad.dofs[pad.element_nodes].transpose(0, 2, 1)  # (n, 3, nodes)
        rows, columns = pairs(dofs[:, :, :, None, None], dofs[:, None, None, :, :])
        # the condensed plate is one dense element between all free unknowns of the back
        self._elements, behind = len(rows), pad.back_dofs if pad.back else pad.back_dofs[:0]
        self.rows = np.concatenate([rows, np.repeat(behind, len(behind))])
        self.columns = np.concatenate([columns, np.tile(behind, len(behind))])
        self.closing_entries = np.flatnonzero(self.rows == pad.closing_dof)
        self._dofs = dofs.ravel()
        self._shape = (n, 3, nodes, 3, nodes)
        # kept for all evaluations, so that an iteration allocates nothing as large
        self._r = np.empty((n, 3, nodes))
        self._none = np.empty((0, 0, 0, 0, 0))

    def force(self, x: FloatArray) -> tuple[FloatArray, float]:
        """Internal force on every unknown ``(size,)`` [N], the plate's in its closing, and the smallest ``det F``."""
        smallest = self._evaluate(x, self._none)
        R = gather(self._dofs, self._r, self.pad.size)
        if self.pad.back:
            R[self.pad.back_dofs] += self.pad.back.K @ x[self.pad.back_dofs]
        return R, smallest

    def stiffness(self, x: FloatArray, out: FloatArray) -> None:
        """Entries of the tangent [N/m] into ``out (entries,)``."""
        self._evaluate(x, out[: self._elements].reshape(self._shape))
        if self.pad.back:
            # the plate is linear: its stiffness is the same in every state
            out[self._elements :] = self.pad.back.K.ravel()

    def normal_force(self, x: FloatArray) -> float:
        """Normal force on the whole pad that the backing plate must exert at ``x`` [N]."""
        return float(self.force(x)[0][self.pad.closing_dof]) / self.pad.share

    def shorten(self, x: FloatArray, step: FloatArray, longest: float) -> float:
        """Factor that keeps the change of closing below ``longest`` [m] and ``det F`` above `SMALLEST_DET`."""
        # halving ends after 12: a step that is still wrong at 1/4096 is refused by the residual's NaN
        factor = min(1.0, longest / max(abs(step[self.pad.closing_dof]), 1e-300))
        for _ in range(12):
            if smallest_det(self._displacements(x - factor * step), self.pad.dN) > SMALLEST_DET:
                break
            factor *= 0.5
        return factor

    def strains(self, x: FloatArray, directions: FloatArray) -> tuple[float, float, float]:
        """Smallest ``det F``, largest ``|principal stretch - 1|`` and smallest eigenvalue of the acoustic tensor.

        The acoustic tensor ``Q[i, k] = A[i, J, k, L] m_J m_L`` is formed at the first point of every element for the
        given unit ``directions (k, 3)`` and divided by the shear modulus: positive means strongly elliptic (no
        localisation).
        """
        u, dN, law = self._displacements(x), self.pad.dN, self.pad.material
        F = np.eye(3) + np.einsum("eia,eqja->eqij", u, dN)
        # rounding can leave the smallest eigenvalue of a crushed element below zero
        stretch = np.sqrt(np.maximum(np.linalg.eigvalsh(F.swapaxes(-1, -2) @ F), 0.0))
        # one point per element: loss of ellipticity is a warning, and the tensor in 24 directions is dear
        A = tangents(law.number, law.parameters, np.ascontiguousarray(F[:, 0]))
        Q = np.einsum("mj,eijkm->emik", directions, np.einsum("eijkl,ml->eijkm", A, directions))
        ellipticity = np.linalg.eigvalsh(Q).min(initial=np.inf) / law.shear_modulus
        return smallest_det(u, dN), float(np.abs(stretch - 1.0).max()), float(ellipticity)

    def _evaluate(self, x: FloatArray, K: FloatArray) -> float:
        law, pad = self.pad.material, self.pad
        return elements(law.number, law.parameters, self._displacements(x), pad.dN, pad.volume, self._r, K)

    def _displacements(self, x: FloatArray) -> FloatArray:
        return np.ascontiguousarray(self.pad.displacement(x)[self.pad.element_nodes].transpose(0, 2, 1))
