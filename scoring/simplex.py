"""Compiled simplex method for the reach of a few polytopes with many vertices."""

from __future__ import annotations

import numpy as np
from numba import njit

PIVOTS = 500


@njit(cache=True)
def best_columns(G, owner, parts, w):  # pragma: no cover - compiled
    """Vertices that hold the largest multiple of ``w`` in a sum of polytopes, each with 0.

    ``max s`` with ``s w = sum_j l_j G_j`` and ``sum l_j <= 1`` for every polytope. Every step takes the vertex whose
    reduced cost is largest. Tiny different right sides keep degenerate steps from going round in circles; so the
    result is a start for a method that proves its own, no more.

    Parameters
    ----------
    G : (k, r) array
        Vertices of all polytopes.
    owner : (k,) array of int
        Polytope of each.
    parts : int
        Number of polytopes.
    w : (r,) array
        Direction.

    Returns
    -------
    (r + parts,) array of int
        Vertices in the last basis; numbers below 0 are other columns of the programme.
    """
    k, r = G.shape
    m = r + parts
    size, length = np.abs(G).max(), np.sqrt((w * w).sum())
    penalty = 1e6 / length
    B = np.eye(m)  # inverse of the basis
    basis = np.full(m, -3)  # -3 artificial, -2 slack, -1 the multiple of w
    cost, x = np.full(m, -penalty), np.ones(m)
    a, d, y = np.empty(m), np.empty(m), np.empty(m)
    for i in range(r):
        x[i] = 1e-9 * size * (1.0 + 0.618 * i)
    basis[r:], cost[r:] = -2, 0.0
    for _ in range(PIVOTS):
        y[:] = 0.0
        for i in range(m):
            y += cost[i] * B[i]
        enter, most = -3, 1e-10 * (1.0 + np.abs(y[r:]).max())
        gain = 1.0 - (y[:r] * w).sum()
        if gain > 1e-10:
            enter, most = -1, gain * size / length
        for j in range(k):
            gain = -y[r + owner[j]]
            for i in range(r):
                gain += y[i] * G[j, i]
            if gain > most:
                enter, most = j, gain
        slack = 0
        for i in range(parts):
            if -y[r + i] > most:
                enter, most, slack = -2, -y[r + i], i
        if enter == -3:
            break
        a[:] = 0.0
        if enter == -1:
            a[:r] = w
        elif enter == -2:
            a[r + slack] = 1.0
        else:
            a[:r] = -G[enter]
            a[r + owner[enter]] = 1.0
        for i in range(m):
            d[i] = (B[i] * a).sum()
        leave, step = -1, np.inf
        for i in range(m):
            if d[i] > 1e-11 and x[i] / d[i] < step:
                leave, step = i, x[i] / d[i]
        if leave < 0:
            break
        x -= step * d
        x[leave] = step
        B[leave] /= d[leave]
        for i in range(m):
            if i != leave:
                B[i] -= d[i] * B[leave]
        basis[leave] = enter
        cost[leave] = 1.0 if enter == -1 else 0.0
    return basis
