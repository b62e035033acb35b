"""Compiled loops over shell elements: strains, forces and tangent (the element is described in ``fem.shell.element``).

A node's six numbers are ``x = (phi, d)`` or ``(u, w)``; inside an element the four places come first, then the four
directors, ``y (8, 3)``. At its points an element looks at vectors ``P_i = sum_a c_ia y_a`` of places or of directors
(`SAMPLES`), slopes for the most part. Every strain is a sum of products of two of them,

    e_s = sum_m w_sm P_i . P_j        (i, j) = PAIRS[s, m],

so that its first derivative is ``sum_m w_sm (c_i P_j + c_j P_i)`` and its second ``sum_m w_sm (c_i c_j + c_j c_i)``.
Arithmetic is strict IEEE, as in ``fem.materials``.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from softjaw.friction.patch import FloatArray

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
STRAINS = 26  # 4 x 2 membrane, 4 x 2 bending, 2 in-plane shears, 4 transverse shears, 4 thickness strains


def shape(xi: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bilinear shape functions ``N (n, 4)`` and their derivatives by xi and eta at ``n`` points of the square."""
    x, y = 1.0 + np.multiply.outer(xi, CORNERS[:, 0]), 1.0 + np.multiply.outer(eta, CORNERS[:, 1])
    return 0.25 * x * y, 0.25 * CORNERS[:, 0] * y, 0.25 * x * CORNERS[:, 1]


GAUSS = CORNERS / np.sqrt(3.0)
SIDES = np.array([[0.0, -1.0], [0.0, 1.0], [-1.0, 0.0], [1.0, 0.0]])  # 2 E13 on the first two, 2 E23 on the others
N_G, A_G, B_G = shape(*GAUSS.T)
_, A_0, B_0 = (value[0] for value in shape(np.zeros(1), np.zeros(1)))
N_S, A_S, B_S = shape(*SIDES.T)
S_S = np.concatenate([A_S[:2], B_S[2:]])  # derivative along xi on the first two sides, along eta on the others

# At the Gauss points and the centre phi_1, phi_2, d_1, d_2; on the sides a slope of phi, then d; then the nodes' d.
SAMPLES = np.concatenate([
    np.concatenate([np.stack([a, b, a, b]) for a, b in zip([*A_G, A_0], [*B_G, B_0], strict=True)]),
    S_S, N_S, np.eye(4),
])  # fmt: skip
FIRST = np.array([0, 0, 4, 4] * 5 + [0] * 4 + [4] * 8)  # of the four places, or of the four directors


def _pairs() -> NDArray[np.int64]:
    """Samples whose products make up each strain, ``(26, 4, 2)``; those without weight are any."""
    table = np.zeros((STRAINS, 4, 2), np.int64)
    membrane, bending = [(0, 0), (1, 1), (0, 1), (0, 0)], [(0, 2), (1, 3), (0, 3), (1, 2)]
    for s in range(8):
        table[s], table[8 + s] = np.array(membrane) + 4 * (s // 2), np.array(bending) + 4 * (s // 2)
    table[16], table[17] = np.array(membrane) + 16, np.array(bending) + 16
    for i in range(4):
        table[18 + i], table[22 + i] = (20 + i, 24 + i), 28 + i
    return table


PAIRS = _pairs()


@njit(cache=True)
def _samples(x, nodes, y, P):
    """Samples ``P (32, 3)`` of nodal values ``x (k, 6)``; ``y (8, 3)`` is scratch."""
    for i in range(4):
        for k in range(3):
            y[i, k], y[4 + i, k] = x[nodes[i], k], x[nodes[i], 3 + k]
    for i in range(32):
        c, a = SAMPLES[i], FIRST[i]
        for k in range(3):
            P[i, k] = c[0] * y[a, k] + c[1] * y[a + 1, k] + c[2] * y[a + 2, k] + c[3] * y[a + 3, k]


@njit(cache=True)
def _form(P, weights, e):
    """The 26 quadratic forms ``e`` of an element's samples."""
    for s in range(STRAINS):
        e[s] = 0.0
        for m in range(4):
            if weights[s, m] != 0.0:
                p, q = P[PAIRS[s, m, 0]], P[PAIRS[s, m, 1]]
                e[s] += weights[s, m] * (p[0] * q[0] + p[1] * q[1] + p[2] * q[2])


@njit(cache=True)
def forms(nodes, weights, x, e):
    """The quadratic forms ``e (n, 26)`` of all elements for nodal values ``x (k, 6)``."""
    y, P = np.empty((8, 3)), np.empty((32, 3))
    for n in range(nodes.shape[0]):
        _samples(x, nodes[n], y, P)
        _form(P, weights[n], e[n])


@njit(cache=True)
def _stress(C, e, s):
    """Generalised stresses ``s (26,)`` that do work on the strains ``e (26,)``."""
    for i in range(STRAINS):
        s[i] = 0.0
        for j in range(STRAINS):
            s[i] += C[i, j] * e[j]


@njit(cache=True)
def _rows(P, weights, B):
    """Derivatives ``B (26, 8, 3)`` of the strains by places and directors."""
    B[:] = 0.0
    for s in range(STRAINS):
        for m in range(4):
            w = weights[s, m]
            if w != 0.0:
                i, j = PAIRS[s, m, 0], PAIRS[s, m, 1]
                for a in range(4):
                    for k in range(3):
                        B[s, FIRST[i] + a, k] += w * SAMPLES[i, a] * P[j, k]
                        B[s, FIRST[j] + a, k] += w * SAMPLES[j, a] * P[i, k]


@njit(cache=True)
def _geometric(weights, s, G):
    """Second derivative ``G (8, 8)`` of the strains, weighted by the stresses ``s (26,)``, for one component."""
    G[:] = 0.0
    for n in range(STRAINS):
        for m in range(4):
            w = weights[n, m] * s[n]
            if w != 0.0:
                i, j = PAIRS[n, m, 0], PAIRS[n, m, 1]
                for a in range(4):
                    for b in range(4):
                        G[FIRST[i] + a, FIRST[j] + b] += w * SAMPLES[i, a] * SAMPLES[j, b]
                        G[FIRST[j] + b, FIRST[i] + a] += w * SAMPLES[i, a] * SAMPLES[j, b]


@njit(cache=True)
def _material(B, C, CB, K):
    """``K (24, 24) = B^T C B``; ``CB (26, 24)`` is scratch."""
    CB[:], K[:] = 0.0, 0.0
    for i in range(STRAINS):
        for j in range(STRAINS):
            # each strain has a stiffness with few others
            k = C[i, j]
            if k != 0.0:
                for c in range(24):
                    CB[i, c] += k * B[j, c]
        for r in range(24):
            # and depends on part of the numbers
            b = B[i, r]
            if b != 0.0:
                for c in range(24):
                    K[r, c] += b * CB[i, c]


@njit(cache=True)
def residual(nodes, weights, stiffness, start, x, out):
    """Add the nodal forces of all elements in the state ``x (k, 6)`` to ``out (k, 6)`` [N]."""
    y, P, F, e, s = np.empty((8, 3)), np.empty((32, 3)), np.empty((32, 3)), np.empty(STRAINS), np.empty(STRAINS)
    for n in range(nodes.shape[0]):
        _samples(x, nodes[n], y, P)
        _form(P, weights[n], e)
        e -= start[n]
        _stress(stiffness[n], e, s)
        F[:] = 0.0  # forces on the samples
        for t in range(STRAINS):
            for m in range(4):
                w = weights[n, t, m] * s[t]
                i, j = PAIRS[t, m, 0], PAIRS[t, m, 1]
                for k in range(3):
                    F[i, k] += w * P[j, k]
                    F[j, k] += w * P[i, k]
        for i in range(32):
            for a in range(4):
                for k in range(3):
                    out[nodes[n, a], 3 * (FIRST[i] // 4) + k] += SAMPLES[i, a] * F[i, k]


@njit(cache=True)
def tangent(nodes, weights, stiffness, start, x, step, place, width, out):
    """Add the tangent of all elements in the state ``x (k, 6)`` to the values ``out`` of a compressed-row matrix.

    ``step (k, 6)`` is the last change of ``x``, or has no rows. With it, the stresses of the geometric part are those
    that the last linear step predicted: the strains there are the quadratic forms of ``x`` minus those of ``step``.
    The block of nodes i, j of element c starts at ``out[place[c, i, j]]``, its rows are ``width[i]`` apart.
    """
    y, P, B = np.empty((8, 3)), np.empty((32, 3)), np.empty((STRAINS, 8, 3))
    e, s, extra = np.empty(STRAINS), np.empty(STRAINS), np.zeros(STRAINS)
    CB, K, G = np.empty((STRAINS, 24)), np.empty((24, 24)), np.empty((8, 8))
    for n in range(nodes.shape[0]):
        if step.shape[0] > 0:
            _samples(step, nodes[n], y, P)
            _form(P, weights[n], extra)
        _samples(x, nodes[n], y, P)
        _form(P, weights[n], e)
        # strains of the last linear step: its quadratic share is what Newton's linearisation did not see
        e -= start[n] + extra
        _stress(stiffness[n], e, s)
        _rows(P, weights[n], B)
        _material(B.reshape(STRAINS, 24), stiffness[n], CB, K)
        _geometric(weights[n], s, G)
        for a in range(8):
            for b in range(8):
                for k in range(3):
                    K[3 * a + k, 3 * b + k] += G[a, b]
        for i in range(4):
            row = width[nodes[n, i]]
            for j in range(4):
                for k in range(3):
                    up, low = place[n, i, j] + k * row, place[n, i, j] + (3 + k) * row
                    for m in range(3):
                        out[up + m] += K[3 * i + k, 3 * j + m]
                        out[up + 3 + m] += K[3 * i + k, 12 + 3 * j + m]
                        out[low + m] += K[12 + 3 * i + k, 3 * j + m]
                        out[low + 3 + m] += K[12 + 3 * i + k, 12 + 3 * j + m]
