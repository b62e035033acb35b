"""Compiled loops over samples: monomials, residuals of quartics, and mean errors.

The order of every sum is fixed, so results are the same to the last bit wherever the code was compiled.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

ENDLESS = 1e-12  # value of a polynomial at a sample from which it counts as zero there: nowhere near its surface


@njit(cache=True)
def fill_monomials(w, E, out):  # pragma: no cover - compiled
    """Write the monomials ``w^E``, ``(m, d), (k, d) -> out (k, m)``."""
    power = _powers(w, E)
    for j in range(len(E)):
        out[j] = power[0, E[j, 0]]
        for i in range(1, w.shape[1]):
            out[j] *= power[i, E[j, i]]


@njit(cache=True)
def fill_residuals(Y, T, inverse, E, beta, gamma, out):  # pragma: no cover - compiled
    """Write what ``sqrt(beta) P`` and ``sqrt(gamma) (I - t t') grad P`` are per coefficient, for every sample.

    In ``d`` dimensions the ``d - 1`` directions across a motion hold all of the latter: columns of the reflection that
    takes the motion to the last axis.

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
    out : (k, d, m) or (k, 1, m) array
        Receives P and then its slopes, if there is room for them.
    """
    (k, r), d, m = E.shape, T.shape[1], len(Y)
    power = _powers(Y, E)
    for j in range(k):
        out[j, 0] = math.sqrt(beta) * power[0, E[j, 0]]
        for i in range(1, r):
            out[j, 0] *= power[i, E[j, i]]
    out[:, 1:] = 0.0
    if out.shape[1] == 1:
        return
    along, slope = np.empty((r, d - 1, m)), np.empty(m)
    for c in range(d - 1):
        for n in range(m):
            t = T[n]
            u = t[c] / (1.0 + abs(t[d - 1]))
            end = 1.0 if t[d - 1] >= 0.0 else -1.0
            moving = 0.0
            for a in range(d):
                moving = math.sqrt(gamma) if t[a] != 0.0 else moving
            for i in range(r):
                x = inverse[i, c] - u * end * inverse[i, d - 1]
                for a in range(d):
                    x -= u * t[a] * inverse[i, a]
                along[i, c, n] = moving * x
    for j in range(k):
        for i in range(r):
            if E[j, i] == 0:
                continue
            slope[:] = E[j, i] * power[i, E[j, i] - 1]
            for a in range(r):
                if a != i:
                    slope *= power[a, E[j, a]]
            for c in range(d - 1):
                out[j, c + 1] += along[i, c] * slope


@njit(cache=True)
def mean_errors(P, G, T, degree):  # pragma: no cover - compiled
    """Means of ``|P - 1|``, ``|P^(-1/degree) - 1|`` and the angle [rad] between the rows of ``G`` and ``T (m, d)``."""
    m, d = G.shape
    value = radius = angle = 0.0
    for n in range(m):
        value += abs(P[n] - 1.0)
        if P[n] > ENDLESS:
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
def fill_floors(c, E, M, out):  # pragma: no cover - compiled
    """Write ``min over tau of P(x, y, tau)`` for monomials ``M (n, 15)`` at tau 1, ``-> out (n, 3)``.

    The derivative along tau is a cubic, ``s^3 + p s + q = 0`` for ``tau = s - a_3 / (4 a_4)``. The least value is at
    its root farthest on the side of ``-q``; ``p`` and ``q`` come first in ``out``. For a convex polynomial ``p`` is not
    negative; where it is, ``q = 0`` means two valleys of equal depth.
    """
    a = np.empty(5)
    for n in range(len(M)):
        a[:] = 0.0
        for j in range(len(c)):
            a[E[j, 2]] += c[j] * M[n, j]
        shift = a[3] / (4.0 * a[4])
        p = a[2] / (2.0 * a[4]) - 3.0 * shift**2
        q = 2.0 * shift**3 - a[2] * shift / (2.0 * a[4]) + a[1] / (4.0 * a[4])
        inner = q**2 / 4.0 + p**3 / 27.0
        s = 0.0
        if inner >= 0.0:
            u = (abs(q) / 2.0 + math.sqrt(inner)) ** (1.0 / 3.0)
            if u > 0.0:
                s = u - p / (3.0 * u)
        else:
            reach = math.sqrt(-p / 3.0)
            s = 2.0 * reach * math.cos(math.acos(min(abs(q) / (2.0 * reach**3), 1.0)) / 3.0)
        tau = -shift - (s if q > 0.0 else -s)
        out[n, 0], out[n, 1] = p, q
        out[n, 2] = (((a[4] * tau + a[3]) * tau + a[2]) * tau + a[1]) * tau + a[0]


@njit(cache=True)
def _powers(w, E):  # pragma: no cover - compiled
    """Powers of the components ``(d, degree + 1, m)``."""
    m, d = w.shape
    power = np.empty((d, 1 + (E.max() if E.size else 0), m))
    for i in range(d):
        power[i, 0] = 1.0
        for e in range(1, power.shape[1]):
            for n in range(m):
                power[i, e, n] = power[i, e - 1, n] * w[n, i]
    return power
