"""Search for a positive definite Gram matrix of a given quartic, among all that it has."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
MOST_STEPS = 100


@lru_cache
def _swaps(dimension: int) -> NDArray[np.int64]:
    """Places ``(f, 4)`` of the free numbers: entries ``ab, cd`` gain what ``ef, gh`` lose, in the order of the maps."""
    pairs = [(i, k) for i in range(dimension) for k in range(i + 1, dimension)]
    d = dimension
    swaps = [(i * d + j, k * d + n, i * d + n, k * d + j) for i, k in pairs for j, n in pairs]
    return np.array(swaps, dtype=np.int64).reshape(-1, 4)


def definite_freedom(gram: FloatArray, dimension: int, floor: float) -> FloatArray | None:
    """Change ``(f,)`` of the free numbers that lifts the eigenvalues of a Gram matrix above a floor, None if none does.

    Newton's method for the least ``tau s - log det (Q + s I)`` among all Gram matrices ``Q`` and shifts ``s``, for
    growing ``tau``. What it leaves on the other side is a definite matrix ``Z`` that has the same product with all
    ``Q``: that product over its trace is a bound of every smallest eigenvalue. One below the floor ends the search.

    Parameters
    ----------
    gram : (d * d, d * d) array
        One of the matrices.
    floor : float
        Smallest eigenvalue wanted.
    """
    swaps = _swaps(dimension)
    free = np.zeros(len(swaps))
    if len(swaps) == 0 or not np.isfinite(gram).all():
        return None
    return free if _search(np.ascontiguousarray(gram), swaps, floor, MOST_STEPS, free) else None


@njit(cache=True)
def _search(gram, swaps, floor, most, free):  # pragma: no cover - compiled
    n, f = len(gram), len(swaps)
    Q, X, S, D, Z = gram.copy(), np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    H, slope, step = np.empty((f + 1, f + 1)), np.empty(f + 1), np.empty(f + 1)
    shift = floor
    for i in range(n):
        shift = max(shift, 1.01 * np.abs(gram[i]).sum())  # no eigenvalue is below minus the largest sum of a row
    tau = n / shift
    _shifted(Q, shift, X)
    if not _factor(X):
        return False
    for _ in range(most):
        _invert(X, S)
        phi = tau * shift - _log_det(X)
        _newton_system(S, swaps, tau, H, slope)
        step[:] = slope
        if not _factor(H):
            return False
        _solve(H, step)
        decrement = np.sqrt(max(np.dot(slope, step), 0.0))
        D[:] = 0.0
        _add(D, swaps, step, 1.0)
        for i in range(n):
            D[i, i] += step[f]
        if decrement < 0.9 and _bound(S, D, gram, Z) < floor:
            return False
        length = 1.0
        for _ in range(40):
            _shifted(Q, shift, X)
            X += length * D
            if _factor(X) and tau * (shift + length * step[f]) - _log_det(X) <= phi - 0.1 * length * decrement**2:
                break
            length *= 0.6
        _add(Q, swaps, step, length)
        free += length * step[:f]
        shift += length * step[f]
        _shifted(Q, -floor, Z)
        if _factor(Z):
            return True
        if decrement < 0.9:
            tau *= 5.0
        _shifted(Q, shift, X)
        if not _factor(X):
            return False
    return False


@njit(cache=True)
def _newton_system(S, swaps, tau, H, slope):  # pragma: no cover - compiled
    """Second derivative of ``-log det`` and slope of the objective, along the free numbers and then the shift."""
    f, n = len(swaps), len(S)
    slope[f], H[f, f] = -tau, 0.0
    for i in range(n):
        slope[f] += S[i, i]
        for j in range(n):
            H[f, f] += S[i, j] * S[i, j]
    for a in range(f):
        p, q, r, s = swaps[a]
        slope[a] = 2.0 * (S[p, q] - S[r, s])
        x = 0.0
        for i in range(n):
            x += S[p, i] * S[i, q] - S[r, i] * S[i, s]
        H[f, a] = H[a, f] = 2.0 * x
        for b in range(a + 1):
            H[a, b] = H[b, a] = _curvature(S, swaps[a], swaps[b])


@njit(cache=True)
def _bound(S, D, gram, Z):  # pragma: no cover - compiled
    """Bound of the smallest eigenvalue by ``Z = S - S D S``, definite where Newton's decrement is below 1."""
    n = len(S)
    product = trace = 0.0
    for i in range(n):
        for j in range(n):
            x = 0.0
            for k in range(n):
                x += S[i, k] * D[k, j]
            Z[i, j] = x
    for i in range(n):
        for j in range(n):
            x = S[i, j]
            for k in range(n):
                x -= Z[i, k] * S[k, j]
            product += x * gram[i, j]
            if i == j:
                trace += x
    return product / trace


@njit(cache=True)
def _add(Q, swaps, step, length):  # pragma: no cover - compiled
    for a in range(len(swaps)):
        for c, sign in ((0, 1.0), (2, -1.0)):
            p, q = swaps[a, c], swaps[a, c + 1]
            Q[p, q] += sign * length * step[a]
            Q[q, p] += sign * length * step[a]


@njit(cache=True)
def _curvature(S, one, two):  # pragma: no cover - compiled
    """``trace(S B_1 S B_2)`` of two free numbers' matrices."""
    total = 0.0
    for c in (0, 2):
        for e in (0, 2):
            p, q, r, s = one[c], one[c + 1], two[e], two[e + 1]
            x = 2.0 * (S[p, r] * S[q, s] + S[p, s] * S[q, r])
            total += x if c == e else -x
    return total


@njit(cache=True)
def _factor(A):  # pragma: no cover - compiled
    """Cholesky factor in the lower triangle; False where the matrix is not positive definite."""
    for i in range(len(A)):
        for j in range(i + 1):
            x = A[i, j]
            for k in range(j):
                x -= A[i, k] * A[j, k]
            if i == j:
                if not x > 0.0:
                    return False
                A[i, i] = np.sqrt(x)
            else:
                A[i, j] = x / A[j, j]
    return True


@njit(cache=True)
def _log_det(L):  # pragma: no cover - compiled
    x = 0.0
    for i in range(len(L)):
        x += 2.0 * np.log(L[i, i])
    return x


@njit(cache=True)
def _shifted(Q, shift, out):  # pragma: no cover - compiled
    out[:] = Q
    for i in range(len(Q)):
        out[i, i] += shift


@njit(cache=True)
def _solve(L, b):  # pragma: no cover - compiled
    """Solve ``L L' x = b`` in place."""
    n = len(b)
    for i in range(n):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


@njit(cache=True)
def _invert(L, out):  # pragma: no cover - compiled
    """Inverse of ``L L'``."""
    for c in range(len(L)):
        out[c] = 0.0
        out[c, c] = 1.0
        _solve(L, out[c])
