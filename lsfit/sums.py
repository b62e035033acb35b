"""Compiled sums over samples: monomials, normal equations of quartics, and mean errors.

The order of every sum is fixed, so results are the same to the last bit wherever the code was compiled.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True)
def fill_monomials(w, E, out):  # pragma: no cover - compiled
    """Write the monomials ``w^E``, ``(m, d), (k, d) -> out (m, k)``."""
    power = np.empty((w.shape[1], 1 + (E.max() if E.size else 0)))
    for n in range(w.shape[0]):
        _fill_row(w[n], E, power, out[n])


@njit(cache=True)
def normal_equations(Y, T, inverse, E, beta, gamma, N, b):  # pragma: no cover - compiled
    """Add ``beta (P - 1)^2 + gamma |(I - t t') grad P|^2`` of every sample to normal equations.

    Two directions across a motion in three dimensions hold all of ``(I - t t') grad P``: columns of the reflection
    that takes the motion to the last axis.

    Parameters
    ----------
    Y : (m, r) array
        Wrenches ``w = B y``.
    T : (m, d) array
        Unit motions, or zero where they do not count.
    inverse : (r, d) array
        Pseudo-inverse of B, which takes gradients along ``y`` to those along ``w``.
    E : (k, r) array of int
        Exponents of degree 4.
    N, b : (k, k) and (k,) arrays
        Receive the sums.
    """
    k, r = E.shape
    d = T.shape[1]
    power, row, G = np.empty((r, 5)), np.empty(k), np.empty((r, k))
    for n in range(len(Y)):
        _fill_row(Y[n], E, power, row)
        for i in range(k):
            x = beta * row[i]
            b[i] += x
            for j in range(k):
                N[i, j] += x * row[j]
        t = T[n]
        if gamma == 0.0 or not _any(t):
            continue
        _fill_gradient(E, power, G)
        u = 1.0 / (1.0 + abs(t[d - 1]))
        for c in range(d - 1):
            row[:] = 0.0
            for i in range(r):
                x = 0.0
                for a in range(d):
                    x += inverse[i, a] * _across(t, u, a, c)
                for j in range(k):
                    row[j] += x * G[i, j]
            for i in range(k):
                x = gamma * row[i]
                for j in range(k):
                    N[i, j] += x * row[j]


@njit(cache=True)
def mean_square(Y, T, inverse, E, beta, gamma, v):  # pragma: no cover - compiled
    """Mean of ``beta (P - 1)^2 + gamma |(I - t t') grad P|^2`` for coefficients ``v (k,)``, see `normal_equations`."""
    k, r = E.shape
    d = T.shape[1]
    power, row, G, g = np.empty((r, 5)), np.empty(k), np.empty((r, k)), np.empty(d)
    total = 0.0
    for n in range(len(Y)):
        _fill_row(Y[n], E, power, row)
        P = 0.0
        for i in range(k):
            P += row[i] * v[i]
        total += beta * (P - 1.0) ** 2
        t = T[n]
        if gamma == 0.0 or not _any(t):
            continue
        _fill_gradient(E, power, G)
        g[:] = 0.0
        for i in range(r):
            x = 0.0
            for j in range(k):
                x += G[i, j] * v[j]
            for a in range(d):
                g[a] += x * inverse[i, a]
        along = 0.0
        for a in range(d):
            along += g[a] * t[a]
        for a in range(d):
            total += gamma * (g[a] - along * t[a]) ** 2
    return total / len(Y)


@njit(cache=True)
def mean_errors(P, G, T, degree):  # pragma: no cover - compiled
    """Means of ``|P - 1|``, ``|P^(-1/degree) - 1|`` and the angle [rad] between the rows of ``G`` and ``T (m, d)``."""
    m, d = G.shape
    value = radius = angle = 0.0
    for n in range(m):
        value += abs(P[n] - 1.0)
        if P[n] > 0.0:
            radius += abs((1.0 / math.sqrt(math.sqrt(P[n])) if degree == 4 else P[n] ** (-1.0 / degree)) - 1.0)
        else:
            radius += np.inf
        length = 0.0
        for i in range(d):
            length += G[n, i] ** 2
        length = math.sqrt(length) if length > 0.0 else 1.0
        less = more = 0.0
        for i in range(d):
            u = G[n, i] / length
            less += (u - T[n, i]) ** 2
            more += (u + T[n, i]) ** 2
        # The half-angle form keeps its digits where the arc cosine of a number near one loses them.
        angle += 2.0 * math.atan2(math.sqrt(less), math.sqrt(more))
    return value / m, radius / m, angle / m


@njit(cache=True)
def _fill_row(y, E, power, row):  # pragma: no cover - compiled
    """Powers of the components ``(d, degree + 1)`` and monomials ``(k,)`` of one vector."""
    d, top = power.shape
    for i in range(d):
        power[i, 0] = 1.0
        for e in range(1, top):
            power[i, e] = power[i, e - 1] * y[i]
    for j in range(len(E)):
        x = power[0, E[j, 0]]
        for i in range(1, d):
            x *= power[i, E[j, i]]
        row[j] = x


@njit(cache=True)
def _fill_gradient(E, power, G):  # pragma: no cover - compiled
    """Partial derivatives ``(d, k)`` of the monomials from the powers."""
    d, k = G.shape
    for i in range(d):
        for j in range(k):
            e = E[j, i]
            x = 0.0
            if e > 0:
                x = e * power[i, e - 1]
                for a in range(d):
                    if a != i:
                        x *= power[a, E[j, a]]
            G[i, j] = x


@njit(cache=True)
def _across(t, u, a, c):  # pragma: no cover - compiled
    """Component ``a`` of the ``c``-th direction across the unit vector ``t``, with ``u = 1 / (1 + |t_last|)``."""
    last = len(t) - 1
    end = t[a]
    if a == last:
        end += 1.0 if t[last] >= 0.0 else -1.0
    return (1.0 if a == c else 0.0) - u * t[c] * end


@njit(cache=True)
def _any(t):  # pragma: no cover - compiled
    for x in t:
        if x != 0.0:
            return True
    return False
