"""Newton's method for a condensed pad: a small complementarity problem in the pressures of the front.

With normals ``n(u)`` and gaps of the deformed front, its displacements ``u``, the travel ``delta`` and the pressures
``p = kappa l`` obey::

    u - delta e_z - C f(u, l) = 0                f = int N_a p n dA
    G_i(u) = 0  where active, l_i = 0 elsewhere  active: A_i l_i > G_i = int N_i g dA
    sum of f along the approach = -F             or delta = travel

Every iteration takes the active set from the last state and solves the linear system of the loaded part of the front,
whose size is what is left of the pad. Curvature of the object enters by ``df/du``, so that convergence is quadratic.
The solution is that of `fem.contact.problem.ContactProblem` for the pad of linear material.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve
from scipy.sparse import csr_matrix

from softjaw.fem.contact.load_stepping import Settings, Stepping
from softjaw.fem.contact.press import Press
from softjaw.fem.contact.problem import ContactProblem, Gap
from softjaw.fem.errors import ConvergenceError
from softjaw.fem.pad.linear_pad import CondensedPad
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.petsc import Seconds

FloatArray = NDArray[np.float64]
MOST = 25  # iterations


def linear_press(pad: CondensedPad, gap: Gap, fallback: Pad | None = None, settings: Settings | None = None) -> Press:
    """Press a condensed pad on an object; what `fem.contact.press.Press` checks is the state of the linear material.

    ``fallback`` is the same linear pad with nodal gaps.
    """

    def solver(problem: ContactProblem, _options: dict[str, Any]) -> FrontSolver:
        return FrontSolver(problem, pad)

    return Press(pad.pad, gap, {}, fallback, settings or Settings(), solver, stepping=Stepping)


@dataclass(frozen=True)
class _Front:
    """State of the front, and what the equations leave over there.

    ``off`` is the front's displacement less that of the forces [m], ``norm`` all of it as forces [N].
    """

    u: FloatArray
    travel: float
    l: FloatArray  # noqa: E741  (the letter of the equations)
    gap: FloatArray
    force: FloatArray
    active: NDArray[np.bool_]
    off: FloatArray
    drive: float
    norm: float


class FrontSolver:
    """Solves a contact problem of a linear pad on its front; stands in for `fem.petsc.NonlinearSolver`.

    Parameters
    ----------
    problem : ContactProblem
        Of a pad that has the mesh, material and symmetry of ``pad``; the collocation of gaps is its own.
    pad : CondensedPad
    """

    def __init__(self, problem: ContactProblem, pad: CondensedPad) -> None:
        self.problem, self.pad, self.seconds = problem, pad, Seconds()
        own = problem.pad
        self._dofs = pad.position[own.dofs[own.face_nodes]].transpose(0, 2, 1)  # (faces, 3, nodes)
        self._nodes = own.pressure_index[own.face_nodes]
        self._pressures = slice(own.travel_dof + 1, own.size)
        self._scale = problem.kappa * problem.area.sum()  # force per length

    def solve(self, x: FloatArray, tolerance: float, iterations: int | None = None) -> tuple[FloatArray, int]:
        """Solve from ``x`` until the residual's norm is below ``tolerance`` [N]: the solution and the iterations.

        Raises
        ------
        ConvergenceError
            When that takes too many iterations, or nothing holds the pad.
        """
        start, most = time.perf_counter(), iterations or MOST
        try:
            at = self._front(x[self.pad.dofs], x[self.problem.pad.travel_dof], x[self._pressures])
            for done in range(most + 1):
                if at.norm <= tolerance:
                    return self._whole(at), done
                at = self._front(*self._step(at))
        except (LinAlgError, ValueError) as error:
            raise ConvergenceError(f"the condensed pad's equations have no solution: {error}") from error
        finally:
            self.seconds.total += time.perf_counter() - start
        raise ConvergenceError(f"the condensed pad's solve stopped after {most} iterations at residual {at.norm:.3e} N")

    def destroy(self) -> None:
        """Nothing to give back: the condensed pad serves others."""

    def _front(self, u: FloatArray, travel: float, l: FloatArray) -> _Front:  # noqa: E741
        """Evaluate the equations."""
        problem, pad = self.problem, self.pad
        x = np.zeros(problem.size)
        x[pad.dofs], x[self._pressures] = u, l
        gap, force, self._K_uu, self._K_ul = problem.front(x)
        f = -np.bincount(self._dofs.ravel() + 1, force.ravel(), len(u) + 1)[1:]
        control = problem.control
        if control.force is None:
            drive = travel - control.travel
        else:
            drive = (f @ pad.approach + control.force * problem.pad.share) / self._scale
        off = u - travel * pad.approach - pad.compliance @ f
        active = problem.area * l - gap > 0.0
        open_or_closed = np.where(active, gap, problem.area * l)
        left = np.concatenate([problem.kappa * open_or_closed, self._scale / len(u) * off, [self._scale * drive]])
        return _Front(u, travel, l, gap, f, active, off, drive, float(np.linalg.norm(left)))

    def _step(self, at: _Front) -> tuple[FloatArray, float, FloatArray]:
        """Newton's step of displacements, travel and pressures, in the loaded part of the front."""
        problem, pad = self.problem, self.pad
        faces = (at.active | (at.l != 0.0))[self._nodes].any(axis=1)
        loaded = np.unique(self._dofs[faces])
        loaded = loaded[loaded >= 0]
        K, B = self._derivatives(faces, loaded, len(at.u))
        C, e, area = pad.compliance[:, loaded], pad.approach[loaded], problem.area[at.active]
        A, k = B[:, at.active], len(loaded)
        dl = np.where(at.active, 0.0, -at.l)
        released = B @ dl  # what inactive nodes lose
        by_pressure = (A.T @ C.T).T
        M = np.zeros((k + 1 + len(area),) * 2)
        M[:k, :k] = np.eye(k) - (K @ C[loaded].T).T
        M[:k, k], M[:k, k + 1 :] = -e, -by_pressure[loaded]
        M[k + 1 :, :k] = A.T.toarray() / (problem.kappa * area)[:, None]
        right = np.concatenate([C[loaded] @ released - at.off[loaded], [-at.drive], -at.gap[at.active] / area])
        if problem.control.force is None:
            M[k, k] = 1.0
        else:
            M[k, :k], M[k, k + 1 :] = K.T @ e / self._scale, A.T @ e / self._scale
            right[k] -= e @ released / self._scale
        step = solve(M, right, overwrite_a=True, overwrite_b=True)
        dl[at.active], ahead = step[k + 1 :], float(step[k])
        du = ahead * pad.approach + C @ (K @ step[:k] + B @ dl) - at.off
        factor = min(1.0, problem.travel_step / max(abs(ahead), 1e-300))
        return at.u + factor * du, at.travel + factor * ahead, at.l + factor * dl

    def _derivatives(self, faces: NDArray[np.bool_], loaded: NDArray[np.int64], size: int):
        """Derivatives of the loaded part's forces by its displacements ``(k, k)`` and by ``l (k, n)``; sparse."""
        place = np.full(size + 1, -1)
        place[loaded] = np.arange(len(loaded))
        row = place[self._dofs[faces]]  # (faces, 3, nodes)
        node = self._nodes[faces]
        shape = self._K_uu[faces].shape
        i, j = (np.broadcast_to(d, shape) for d in (row[:, :, :, None, None], row[:, None, None, :, :]))
        K = _sparse(-self._K_uu[faces], i, j, (len(loaded),) * 2)
        shape = self._K_ul[faces].shape
        i, j = (np.broadcast_to(d, shape) for d in (row[:, None, :, :], node[:, :, None, None]))
        return K, _sparse(self.problem.kappa * self._K_ul[faces], i, j, (len(loaded), len(self.problem.area)))

    def _whole(self, at: _Front) -> FloatArray:
        """Unknowns of the whole pad."""
        x = np.empty(self.problem.size)
        travel_dof = self.problem.pad.travel_dof
        x[:travel_dof] = self.pad.displacements(at.force, at.travel)
        x[travel_dof], x[self._pressures] = at.travel, at.l
        return x


def _sparse(values: FloatArray, row: NDArray[np.int64], column: NDArray[np.int64], shape: tuple[int, int]):
    """Sum of entries; those with a negative index are left out."""
    keep = (row >= 0) & (column >= 0)
    return csr_matrix((values[keep], (row[keep], column[keep])), shape)
