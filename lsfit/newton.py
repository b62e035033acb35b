"""Compiled search for the points of a quartic surface with given normals."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def support_points(tensor, T, start, out):  # pragma: no cover - compiled
    """Points ``out (m, d)`` of a closed quartic surface farthest along ``T (m, d)``, by Newton's method.

    ``P(w) - t . w`` is smallest on the ray through the point of the surface that is wanted, whether ``P`` is convex or
    not. Steps are halved until the function falls; where the second derivative is not positive it is shifted.

    Parameters
    ----------
    tensor : (d, d, d, d) array
        ``Q``, symmetric: the second derivative is ``H_ij = Q_ijkl w_k w_l``, the gradient ``H w / 3``.
    T : (m, d) array
        Unit normals.
    start : (m, d) array
        Points near the ones wanted, of any length; the lowest valley near them is found.

    Returns
    -------
    int
        How many of the searches did not converge.
    """
    m, d = T.shape
    H, g, s, y, A = np.empty((d, d)), np.empty(d), np.empty(d), np.empty(d), np.empty((d, d))
    failed = 0
    for n in range(m):
        t = T[n]
        w = start[n].copy()
        P = _second(tensor, w, H, g)
        along = max(np.dot(t, w), 1e-3 * np.sqrt(np.dot(w, w)))
        w *= (along / (4 * P)) ** (1 / 3)
        P = _second(tensor, w, H, g)
        converged = False
        for _ in range(200):
            size, shift = 0.0, 1e-13
            for i in range(d):
                size += abs(H[i, i])
            while True:
                for i in range(d):
                    s[i] = t[i] - g[i]
                    for j in range(d):
                        A[i, j] = H[i, j]
                    A[i, i] += shift * size
                if _solve(A, s):
                    break
                shift = max(10.0 * shift, 1e-3)
            fall = 0.0
            for i in range(d):
                fall += s[i] * (t[i] - g[i])
            phi = P - np.dot(t, w)
            if converged:
                break
            converged = fall <= 1e-12 * abs(phi)  # one more step squares what is left
            length, new = 1.0, phi
            for _ in range(60):
                y[:] = w + length * s
                P = _second(tensor, y, H, g)
                new = P - np.dot(t, y)
                if new <= phi - 1e-4 * length * fall or converged:
                    break
                length *= 0.5
            w[:] = y
        if not converged:
            failed += 1
        out[n] = w / P**0.25
    return failed


@njit(cache=True)
def _second(tensor, w, H, g):  # pragma: no cover - compiled
    """Second derivative and gradient at ``w``, written to ``H`` and ``g``; the value is returned."""
    d = len(w)
    P = 0.0
    for i in range(d):
        g[i] = 0.0
        for j in range(d):
            h = 0.0
            for k in range(d):
                for m in range(d):
                    h += tensor[i, j, k, m] * w[k] * w[m]
            H[i, j] = h
            g[i] += h * w[j] / 3
        P += g[i] * w[i] / 4
    return P


@njit(cache=True)
def _solve(A, b):  # pragma: no cover - compiled
    """Solve ``A x = b`` in place by Gauss elimination; False where the symmetric matrix is not positive definite."""
    d = len(b)
    for k in range(d):
        if not A[k, k] > 0.0:
            return False
        for i in range(k + 1, d):
            f = A[i, k] / A[k, k]
            for j in range(k, d):
                A[i, j] -= f * A[k, j]
            b[i] -= f * b[k]
    for k in range(d - 1, -1, -1):
        for j in range(k + 1, d):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]
    return True
