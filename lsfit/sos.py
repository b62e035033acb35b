"""Semidefinite programmes of the fits: a convex quadratic under one linear matrix inequality, solved by Clarabel.

A quartic form in three variables that is convex is sos-convex (Ahmadi, Blekherman, Parrilo, "Convex ternary quartics
are SOS-convex", 2024): its Gram matrix, written with 15 coefficients and 9 free numbers, is the whole constraint.
"""

from __future__ import annotations

from functools import lru_cache

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from softjaw.lsfit.flag import FitError
from softjaw.lsfit.form import exponents
from softjaw.lsfit.gram import ball_gram, gram_map, quadratic_map, upper_triangle
from softjaw.lsfit.interior import least_quadratic

FloatArray = NDArray[np.float64]


MARGIN = 1e-7
"""Smallest eigenvalue asked of a Gram matrix, in coordinates where that of a ball has eigenvalues of 4 and more."""


@lru_cache
def _maps(dimension: int) -> tuple[FloatArray, csr_array, FloatArray]:
    E = exponents(dimension, 4)
    A = gram_map(E)
    # Half of a ball's swapped pairs moved to the diagonal blocks: the choice with the largest smallest eigenvalue.
    return A.toarray(), upper_triangle(A), ball_gram(E)[len(E) :]


@lru_cache
def quadratic_parts(dimension: int) -> tuple[FloatArray, csr_array]:
    """Map from coefficients of a quadratic form to its matrix ``(d * d, k)``, and the upper triangle of that."""
    A = quadratic_map(exponents(dimension, 2))
    return A.toarray(), upper_triangle(A)


def ball_freedom(dimension: int) -> FloatArray:
    """Free numbers ``(f,)`` of the Gram matrix of ``|y|^4`` that make it most definite."""
    return _maps(dimension)[2]


def gram_matrix(v: FloatArray, free: FloatArray, dimension: int) -> FloatArray:
    """Gram matrix ``(d * d, d * d)`` of the quartic with coefficients ``v (k,)`` and free numbers ``(f,)``."""
    return (_maps(dimension)[0] @ np.concatenate([v, free])).reshape(dimension**2, dimension**2)


def convex_least_squares(
    N: FloatArray, b: FloatArray, ball: FloatArray, dimension: int, loose: bool, floor: float = MARGIN
) -> tuple[FloatArray, FloatArray]:
    """Coefficients ``v (k,)`` that minimise ``v' N v / 2 - b . v`` among sos-convex quartics, and their Gram matrix.

    The solver's last digits may leave an eigenvalue just below ``floor``. Then the result moves towards ``ball`` by as
    little as brings it back to half of it: some ``1e-8`` of its length.

    Parameters
    ----------
    N, b
        Normal equations in coordinates in which the body is nearly the unit ball.
    ball : (k,) array
        Coefficients of ``|y|^4``.
    loose : bool
        Whether ``N`` leaves directions undetermined; of all solutions the one nearest to the ball is taken then.
    floor : float
        Smallest eigenvalue of the Gram matrix, below 4. The body reaches at most ``(12 / floor)^(1/4)`` far.
    """
    k = len(b)
    size = np.trace(N) / k
    N, b = N / size, b / size
    if loose:
        N, b = N + 1e-8 * np.eye(k), b + 1e-8 * ball
    matrix, triangle, free = _maps(dimension)
    whole = np.concatenate([ball, free])
    H, g = np.zeros((len(whole),) * 2), np.zeros(len(whole))
    H[:k, :k], g[:k] = N, b
    try:
        x = least_in_cone(H, g, triangle, floor)
    except FitError:
        # Few samples leave Clarabel short of its tolerance. The other method stays within the cone all the way; a ball
        # of this size has no eigenvalue below the floor.
        low = floor / 4 * whole
        x = low + least_quadratic(H, g - H @ low, csr_array(matrix), whole).x
    lack = floor / 2 - float(np.linalg.eigvalsh(gram_matrix(x[:k], x[k:], dimension))[0])
    if lack > 0:
        most = float(np.linalg.eigvalsh(gram_matrix(ball, free, dimension))[0])
        share = lack / (most - floor / 2 + lack)
        x = (1 - share) * x + share * whole
    return x[:k], gram_matrix(x[:k], x[k:], dimension)


def least_in_cone(N: FloatArray, b: FloatArray, triangle: csr_array, floor: float) -> FloatArray:
    """Minimiser of ``x' N x / 2 - b . x`` among the ``x`` whose symmetric matrix has no eigenvalue below ``floor``.

    Parameters
    ----------
    N : (n, n) array
        Positive semidefinite.
    b : (n,) array
        Slope at zero with opposite sign.
    triangle : (s (s + 1) / 2, n) sparse array
        Upper triangle of the matrix as `lsfit.gram.upper_triangle` orders it.
    floor : float
        Smallest eigenvalue allowed.

    Raises
    ------
    FitError
        If the programme is not solved.
    """
    size = round((np.sqrt(8 * triangle.shape[0] + 1) - 1) / 2)
    column, row = np.tril_indices(size)
    right = np.where(row == column, -floor, 0.0)
    x, found = _solve(csc_array(np.triu(N)), -b, csc_array(-triangle), right, size)
    if found.status != clarabel.SolverStatus.Solved:
        raise FitError(
            f"Clarabel stopped with {found.status} after {found.iterations} iterations on {len(b)} unknowns: look at "
            "the samples for outliers and components of very different size"
        )
    return x


def _solve(P, q, A, right, size):
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    found = clarabel.DefaultSolver(P, q, A, right, [clarabel.PSDTriangleConeT(size)], settings).solve()
    return np.array(found.x), found
