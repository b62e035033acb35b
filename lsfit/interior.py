"""Interior-point method for a convex quadratic under one linear matrix inequality.

The matrix is written by its unknowns, so each step factorises one dense system of their number (351 for the Gram matrix
of a quartic in six dimensions). That takes half to two thirds of Clarabel's time for the same programme; and every
iterate lies strictly inside the cone, so the Gram matrix that comes out is positive definite as it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.sparse import csr_array

from softjaw.lsfit.flag import FitError

FloatArray = NDArray[np.float64]


class Optimum(NamedTuple):
    """Minimiser with what proves it.

    ``X`` is positive definite and equals the matrix of ``x`` up to rounding; ``gap = X . Z`` bounds how far the
    objective is from the smallest, up to the ``residual`` of the dual equation relative to its terms.
    """

    x: FloatArray
    X: FloatArray
    objective: float
    gap: float
    residual: float
    iterations: int


def least_quadratic(
    H: FloatArray,
    g: FloatArray,
    A: csr_array,
    x: FloatArray,
    tolerance: float = 1e-9,
    enough: float = 1e-5,
    most: int = 60,
) -> Optimum:
    """Minimiser of ``x' H x / 2 - g' x`` among the ``x`` whose matrix ``X = mat(A x)`` is positive semidefinite.

    Primal-dual steps with Mehrotra's predictor and corrector in the direction of Helmberg, Rendl, Vanderbei and
    Wolkowicz (HKM). Every iterate satisfies the inequality strictly.

    Parameters
    ----------
    H : (n, n) array
        Positive semidefinite.
    g : (n,) array
        Slope at zero with opposite sign.
    A : (s * s, n) sparse array
        Columns are symmetric matrices.
    x : (n,) array
        Start with a positive definite matrix.
    tolerance : float
        Gap and dual residual to reach, as shares of ``1 + |objective|`` and ``1 + max |g|``.
    enough : float
        The same, accepted where rounding ends the steps before that; the optimum states what was reached.
    most : int
        Largest number of steps.

    Raises
    ------
    FitError
        If the steps end before that.
    """
    X = _matrix(A, x)
    Z = np.eye(len(X)) * max(1.0, float(np.abs(g).max())) / len(X)
    AT = A.T.tocsr()
    for step in range(most):
        slope = H @ x - g - AT @ Z.ravel()
        objective, gap = float(x @ (H @ x) / 2 - g @ x), float((X * Z).sum())
        residual = float(np.abs(slope).max() / (1 + np.abs(g).max()))
        worst = max(gap / (1 + abs(objective)), residual)
        best = Optimum(x, X, objective, gap, residual, step)
        if worst <= tolerance:
            return best
        try:
            dx, dX, dZ = _direction(H, A, AT, X, Z, slope)
            # One length for both: the quadratic couples the residual of the dual equation to the step of x.
            length = min(1.0, 0.95 * min(_reach(X, dX), _reach(Z, dZ)))
        except np.linalg.LinAlgError:
            break
        x, Z = x + length * dx, Z + length * dZ
        X = _matrix(A, x)
    if worst <= enough:
        return best
    raise FitError(
        f"the search ended after {step + 1} steps with gap {gap:.1e} and dual residual {residual:.1e}: scale the data "
        f"to about one, whiten them, or add a ridge"
    )


def _direction(
    H: FloatArray, A: csr_array, AT: csr_array, X: FloatArray, Z: FloatArray, slope: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Step ``(dx, dX, dZ)`` with the centring that the plain Newton step suggests."""
    n = len(X)
    inverse = cho_solve(cho_factor(X), np.eye(n))
    M = AT @ (AT @ np.kron(inverse, Z)).T
    factor = cho_factor(H + (M + M.T) / 2)
    mu = (X * Z).sum() / n

    def newton(R: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        dx = cho_solve(factor, AT @ R.ravel() - slope)
        dX = _matrix(A, dx)
        return dx, dX, R - _symmetric(inverse @ dX @ Z)

    _, dX, dZ = newton(-Z)
    length = min(1.0, _reach(X, dX), _reach(Z, dZ))
    ahead = ((X + length * dX) * (Z + length * dZ)).sum() / n
    centring = max(1e-6, (ahead / mu) ** 3) * mu
    return newton(centring * inverse - Z - _symmetric(inverse @ dX @ dZ))


def _matrix(A: csr_array, x: FloatArray) -> FloatArray:
    n = round(np.sqrt(A.shape[0]))
    return (A @ x).reshape(n, n)


def _symmetric(M: FloatArray) -> FloatArray:
    return (M + M.T) / 2


def _reach(X: FloatArray, dX: FloatArray) -> float:
    """Largest length of a step along ``dX`` that keeps ``X`` positive semidefinite."""
    L = np.linalg.cholesky(X)
    M = solve_triangular(L, solve_triangular(L, dX, lower=True).T, lower=True)
    smallest = float(np.linalg.eigvalsh(_symmetric(M))[0])
    return np.inf if smallest >= 0 else -1 / smallest
