"""Quartics that are convex, as matrices: Gram matrices of sos-convex quartics, and programmes over them.

A quartic form ``P`` is sos-convex when ``z' Hess P(w) z = (z x w)' Q (z x w)`` for some positive semidefinite ``Q`` of
size ``d^2`` with ``z x w`` the products ``z_i w_j``. The matrices ``Q`` of one ``P`` form an affine family: the fully
symmetric one, ``Q_(ij)(kl) = d^4 P / dw_i dw_j dw_k dw_l / 2``, plus one free number for every pair ``i < k`` and
``j < l``, because ``z_i w_j z_k w_l = z_i w_l z_k w_j``. Writing ``Q`` with these ``k + f`` unknowns satisfies all
``(d (d + 1) / 2)^2`` equalities by construction: 24 unknowns in three dimensions, 351 in six. In three variables every
convex quartic is sos-convex, so there the Gram matrix is the whole constraint.

Clarabel solves the programmes: 1 ms in three dimensions, 0.7 s in six.

References: Ahmadi, Parrilo, "A convex polynomial that is not sos-convex", Mathematical Programming 135 (2012); Ahmadi,
Blekherman, Parrilo, "Convex ternary quartics are SOS-convex" (2024).
"""

from collections.abc import Callable
from functools import lru_cache

import clarabel
import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.special import factorial

from softjaw.lsfit.form import exponents, tensor_places
from softjaw.lsfit.surface import FitError, FloatArray

MIN_EIGENVALUE = 1e-7  # of a Gram matrix, in coordinates where that of a ball has eigenvalues of 4 and more
ENOUGH = 1e-6  # relative gap and residuals of a solution that is taken though Clarabel ends short of its own 1e-8


@lru_cache
def gram_map(dimension: int) -> csr_array:
    """Matrix ``A (d^4, k + f)`` with ``vec(Q) = A [v, free]`` for the coefficients ``v`` of a quartic form."""
    d, k = dimension, len(exponents(dimension, 4))
    column, value = tensor_places(d)
    i, j, a, b = np.indices((d, d, d, d)).reshape(4, -1)
    pairs = d * (d - 1) // 2
    pair = np.zeros((d, d), dtype=int)
    upper = np.triu_indices(d, 1)
    pair[upper] = pair.T[upper] = np.arange(pairs)
    # z_i w_j z_k w_l = z_i w_l z_k w_j says something only where both indices differ
    row, free = np.arange(d**4), (i != a) & (j != b)
    freedom = (k + pair[i, a] * pairs + pair[j, b])[free]
    # opposite signs on the two sides of that equation: in the form they cancel
    entries = np.concatenate([value, (np.sign(a - i) * np.sign(b - j))[free]])
    return csr_array((entries, (np.r_[row, row[free]], np.r_[column, freedom])), shape=(d**4, k + pairs**2))


@lru_cache
def ball_gram(dimension: int) -> FloatArray:
    """Unknowns ``[v, free]`` of ``P = |w|^4`` with the most definite of its Gram matrices, ``(k + f,)``."""
    E = exponents(dimension, 4)
    v = np.where((E % 2 == 0).all(axis=1), 2 / factorial(E // 2).prod(axis=1), 0.0)
    # Half of what the symmetric choice puts on swapped pairs moves to the diagonal blocks, which makes it definite.
    return np.concatenate([v, 2 * np.eye(dimension * (dimension - 1) // 2).ravel()])


@lru_cache
def quadratic_map(dimension: int) -> csr_array:
    """Matrix ``A (d^2, k)`` with ``vec(M) = A v`` for the symmetric matrix ``M`` of a quadratic form."""
    d, upper = dimension, np.triu_indices(dimension)
    number = np.zeros((d, d), dtype=int)
    number[upper] = number.T[upper] = np.arange(len(upper[0]))  # the order of `exponents`
    # two entries of a symmetric matrix share a mixed coefficient
    value = np.where(np.eye(d, dtype=bool), 1.0, 0.5).ravel()
    return csr_array((value, (np.arange(d * d), number.ravel())), shape=(d * d, len(upper[0])))


def upper_triangle(A: csr_array) -> csr_array:
    """Rows of the upper triangle, column by column, the rest of it times ``sqrt 2``: the cone's order in Clarabel."""
    n = round(np.sqrt(A.shape[0]))
    column, row = np.tril_indices(n)
    return csr_array(diags_array(np.where(row == column, 1.0, np.sqrt(2))) @ A[row * n + column])


@lru_cache
def parts(of: Callable[[int], csr_array], dimension: int) -> tuple[FloatArray, csr_array]:
    """A map from coefficients to a matrix, `gram_map` or `quadratic_map`, in full, and the upper triangle of it."""
    A = of(dimension)
    return A.toarray(), upper_triangle(A)


def gram_matrix(v: FloatArray, free: FloatArray, dimension: int) -> FloatArray:
    """Gram matrix ``(d * d, d * d)`` of the quartic with coefficients ``v (k,)`` and free numbers ``(f,)``."""
    return (parts(gram_map, dimension)[0] @ np.concatenate([v, free])).reshape(dimension**2, dimension**2)


def convex_least_squares(
    N: FloatArray, b: FloatArray, dimension: int, loose: bool, floor: float = MIN_EIGENVALUE
) -> tuple[FloatArray, FloatArray]:
    """Coefficients ``v (k,)`` that minimise ``v' N v / 2 - b . v`` among sos-convex quartics; free numbers ``(f,)``.

    The normal equations ``N, b`` are in coordinates in which the body is nearly the unit ball; where they leave
    directions undetermined (``loose``) the solution nearest to the ball is taken. ``floor``, below 4, is the smallest
    eigenvalue of the Gram matrix: the body reaches at most ``(12 / floor)^(1/4)`` far. The solver's last digits may
    leave an eigenvalue just below it. Then the result moves towards a ball by as little as brings it back to half of
    it: some ``1e-8`` of its length. `FitError`: the programme is not solved.
    """
    k, ball = len(b), ball_gram(dimension)
    # an objective of size one: the solvers' tolerances are partly absolute
    size = np.trace(N) / k
    N, b = N / size, b / size
    if loose:
        # as little as decides what the samples do not, and far more than the solver's tolerance
        N, b = N + 1e-8 * np.eye(k), b + 1e-8 * ball[:k]
    # the free numbers only prove convexity; they cost nothing
    H, g = np.zeros((len(ball),) * 2), np.zeros(len(ball))
    H[:k, :k], g[:k] = N, b
    # few samples leave Clarabel short of its own tolerance; what it reached is near enough to be mended below
    x = least_in_cone(H, g, parts(gram_map, dimension)[1], floor)
    lack = floor / 2 - smallest(gram_matrix(x[:k], x[k:], dimension))
    # a mixture of two sos-convex forms is one, and that of the ball lifts every eigenvalue
    if lack > 0:
        most = smallest(gram_matrix(ball[:k], ball[k:], dimension))
        # the smallest eigenvalue is concave: the mixture has at least the mean of both, by their shares
        share = lack / (most - floor / 2 + lack)
        x = (1 - share) * x + share * ball
    return x[:k], x[k:]


def smallest(matrix: FloatArray) -> float:
    """Smallest eigenvalue of a symmetric matrix."""
    return float(np.linalg.eigvalsh(matrix)[0])


def least_in_cone(N: FloatArray, b: FloatArray, triangle: csr_array, floor: float) -> FloatArray:
    """Minimiser of ``x' N x / 2 - b . x`` among the ``x`` whose symmetric matrix has no eigenvalue below ``floor``.

    ``N (n, n)`` is positive semidefinite; ``triangle (s (s + 1) / 2, n)`` gives the matrix's upper triangle as
    `upper_triangle` orders it. `FitError`: the programme is not solved.
    """
    size = side(triangle)
    # the columns of the upper triangle are the rows of the lower one
    column, row = np.tril_indices(size)
    right = np.where(row == column, -floor, 0.0)
    # Clarabel reads the upper triangle of the objective only
    return conic_solution(csc_array(np.triu(N)), -b, -triangle, right, [clarabel.PSDTriangleConeT(size)])


def side(triangle: csr_array) -> int:
    """Number of rows of the matrix whose upper triangle this is."""
    return round((np.sqrt(8 * triangle.shape[0] + 1) - 1) / 2)


def conic_solution(P: csc_array, q: FloatArray, A: csr_array, b: FloatArray, cones: list) -> FloatArray:
    """Minimiser of ``x' P x / 2 + q . x`` with ``b - A x`` in the cones, by Clarabel.

    `FitError`: neither Clarabel's own tolerance is reached, nor a gap and residuals of `ENOUGH`.
    """
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1  # the ranks of a run share the cores
    answer = clarabel.DefaultSolver(P, q, csc_array(A), b, cones, settings).solve()
    # relative, unlike Clarabel's own gap: an objective far below one can be wrong altogether at a gap of 1e-8
    short = max(answer.r_prim, answer.r_dual, abs(answer.obj_val - answer.obj_val_dual) / abs(answer.obj_val))
    almost = answer.status == clarabel.SolverStatus.AlmostSolved and short < ENOUGH
    if not (answer.status == clarabel.SolverStatus.Solved or almost):
        raise FitError(
            f"Clarabel stopped with {answer.status} and errors of {short:.1e} after {answer.iterations} iterations on "
            f"{len(q)} unknowns: look at the samples for outliers and components of very different size"
        )
    return np.array(answer.x)
