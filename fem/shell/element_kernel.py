"""Compiled loops over shell elements: strains, forces and tangent (the element is described in ``fem.shell.element``).

A node's six numbers are ``x = (phi, d)`` or ``(u, w)``; inside an element the four places come first, then the four
directors. Arithmetic is strict IEEE, as in ``fem.pad.foam``.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

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


@njit(cache=True, inline="always")
def _dot(v, w):
    return v[0] * w[0] + v[1] * w[1] + v[2] * w[2]


@njit(cache=True, inline="always")
def _weighted(c, x, first, out):
    """``sum_i c[i] x[first + i]``."""
    for k in range(3):
        out[k] = c[0] * x[first, k] + c[1] * x[first + 1, k] + c[2] * x[first + 2, k] + c[3] * x[first + 3, k]


@njit(cache=True, inline="always")
def _slopes(a, b, x, v):
    """``phi_1, phi_2, d_1, d_2`` at the point with the shape functions' derivatives ``a, b``."""
    _weighted(a, x, 0, v[0])
    _weighted(b, x, 0, v[1])
    _weighted(a, x, 4, v[2])
    _weighted(b, x, 4, v[3])


@njit(cache=True)
def _form(x, plane, twist, v, e):
    """The 26 quadratic forms ``e`` of ``x (8, 3)``: four places, then four directors; ``v (4, 3)`` is scratch."""
    for q in range(4):
        _slopes(A_G[q], B_G[q], x, v)
        m0, m1, m2 = 0.5 * _dot(v[0], v[0]), 0.5 * _dot(v[1], v[1]), _dot(v[0], v[1])
        k0, k1, k2 = _dot(v[0], v[2]), _dot(v[1], v[3]), _dot(v[0], v[3]) + _dot(v[1], v[2])
        for b in range(2):
            t = plane[q, b]
            e[2 * q + b] = t[0] * m0 + t[1] * m1 + t[2] * m2
            e[8 + 2 * q + b] = t[0] * k0 + t[1] * k1 + t[2] * k2
    _slopes(A_0, B_0, x, v)
    e[16] = twist[0] * 0.5 * _dot(v[0], v[0]) + twist[1] * 0.5 * _dot(v[1], v[1]) + twist[2] * _dot(v[0], v[1])
    e[17] = (
        twist[0] * _dot(v[0], v[2]) + twist[1] * _dot(v[1], v[3])
        + twist[2] * (_dot(v[0], v[3]) + _dot(v[1], v[2]))
    )  # fmt: skip
    for s in range(4):
        _weighted(S_S[s], x, 0, v[0])
        _weighted(N_S[s], x, 4, v[2])
        e[18 + s] = _dot(v[0], v[2])
        e[22 + s] = 0.5 * _dot(x[4 + s], x[4 + s])


@njit(cache=True)
def forms(nodes, plane, twist, x, e):
    """The quadratic forms ``e (n, 26)`` of all elements for nodal values ``x (k, 6)``."""
    y, v = np.empty((8, 3)), np.empty((4, 3))
    for n in range(nodes.shape[0]):
        _gather(x, nodes[n], y)
        _form(y, plane[n], twist[n], v, e[n])


@njit(cache=True, inline="always")
def _gather(x, nodes, y):
    for i in range(4):
        for k in range(3):
            y[i, k] = x[nodes[i], k]
            y[4 + i, k] = x[nodes[i], 3 + k]


@njit(cache=True, inline="always")
def _stress(e, membrane, in_plane, shear, thickness, nu, s):
    """Generalised stresses ``s (26,)`` that do work on the strains ``e (26,)``."""
    for q in range(4):
        c = membrane[q]
        s[2 * q], s[2 * q + 1] = c * (e[2 * q] + nu * e[2 * q + 1]), c * (nu * e[2 * q] + e[2 * q + 1])
        # the mean of zeta^2 over the wall
        c = membrane[q] / 3.0
        s[8 + 2 * q] = c * (e[8 + 2 * q] + nu * e[9 + 2 * q])
        s[9 + 2 * q] = c * (nu * e[8 + 2 * q] + e[9 + 2 * q])
    s[16], s[17] = in_plane * e[16], in_plane / 3.0 * e[17]
    for i in range(4):
        s[18 + i] = s[22 + i] = 0.0
        for j in range(4):
            s[18 + i] += shear[i, j] * e[18 + j]
            s[22 + i] += thickness[i, j] * e[22 + j]


@njit(cache=True, inline="always")
def _covariant(t0, t1, s0, s1, n):
    """Weights ``n`` of ``E11, E22, 2 E12`` that do the same work as ``s0, s1`` on the local strains."""
    for k in range(3):
        n[k] = t0[k] * s0 + t1[k] * s1


@njit(cache=True, inline="always")
def _add_in_plane(a, b, v, n, m, f):
    """Nodal forces of the in-plane stresses ``n`` and moments ``m`` at one point."""
    for k in range(3):
        p = n[0] * v[0, k] + n[2] * v[1, k] + m[0] * v[2, k] + m[2] * v[3, k]
        r = n[2] * v[0, k] + n[1] * v[1, k] + m[2] * v[2, k] + m[1] * v[3, k]
        y, z = m[0] * v[0, k] + m[2] * v[1, k], m[2] * v[0, k] + m[1] * v[1, k]
        for i in range(4):
            f[i, k] += a[i] * p + b[i] * r
            f[4 + i, k] += a[i] * y + b[i] * z


@njit(cache=True)
def _force(x, plane, twist, s, v, n, m, f):
    """Nodal forces ``f (8, 3)`` of the generalised stresses ``s (26,)`` in the state ``x (8, 3)``."""
    f[:] = 0.0
    for q in range(4):
        _slopes(A_G[q], B_G[q], x, v)
        _covariant(plane[q, 0], plane[q, 1], s[2 * q], s[2 * q + 1], n)
        _covariant(plane[q, 0], plane[q, 1], s[8 + 2 * q], s[9 + 2 * q], m)
        _add_in_plane(A_G[q], B_G[q], v, n, m, f)
    _slopes(A_0, B_0, x, v)
    _covariant(twist, twist, s[16], 0.0, n)
    _covariant(twist, twist, s[17], 0.0, m)
    _add_in_plane(A_0, B_0, v, n, m, f)
    for side in range(4):
        _weighted(S_S[side], x, 0, v[0])
        _weighted(N_S[side], x, 4, v[2])
        for i in range(4):
            for k in range(3):
                f[i, k] += s[18 + side] * S_S[side, i] * v[2, k]
                f[4 + i, k] += s[18 + side] * N_S[side, i] * v[0, k]
    for i in range(4):
        for k in range(3):
            f[4 + i, k] += s[22 + i] * x[4 + i, k]


@njit(cache=True, inline="always")
def _in_plane_rows(t, a, b, v, membrane, bending):
    """Derivatives of one membrane and one bending strain by the element's 24 numbers."""
    for k in range(3):
        p, r = t[0] * v[0, k] + t[2] * v[1, k], t[1] * v[1, k] + t[2] * v[0, k]
        y, z = t[0] * v[2, k] + t[2] * v[3, k], t[1] * v[3, k] + t[2] * v[2, k]
        for i in range(4):
            membrane[3 * i + k] = a[i] * p + b[i] * r
            # bending is bilinear in places and directors: by the latter it has the membrane's derivative
            bending[12 + 3 * i + k] = membrane[3 * i + k]
            bending[3 * i + k] = a[i] * y + b[i] * z


@njit(cache=True)
def _rows(x, plane, twist, v, M, B):
    """Derivatives of the membrane strains, ``M (9, 12)``, and of bending and transverse shear, ``B (13, 24)``."""
    for q in range(4):
        _slopes(A_G[q], B_G[q], x, v)
        for c in range(2):
            _in_plane_rows(plane[q, c], A_G[q], B_G[q], v, M[2 * q + c], B[2 * q + c])
    _slopes(A_0, B_0, x, v)
    _in_plane_rows(twist, A_0, B_0, v, M[8], B[8])
    for side in range(4):
        _weighted(S_S[side], x, 0, v[0])
        _weighted(N_S[side], x, 4, v[2])
        for i in range(4):
            for k in range(3):
                B[9 + side, 3 * i + k] = S_S[side, i] * v[2, k]
                B[9 + side, 12 + 3 * i + k] = N_S[side, i] * v[0, k]


@njit(cache=True)
def _material_rows(membrane, in_plane, shear, nu, M, B, CM, CB):
    """Stiffness times the rows: ``CM (9, 12)``, ``CB (13, 24)``."""
    for q in range(4):
        c, k = membrane[q], membrane[q] / 3.0
        for i in range(12):
            CM[2 * q, i] = c * (M[2 * q, i] + nu * M[2 * q + 1, i])
            CM[2 * q + 1, i] = c * (nu * M[2 * q, i] + M[2 * q + 1, i])
        for i in range(24):
            CB[2 * q, i] = k * (B[2 * q, i] + nu * B[2 * q + 1, i])
            CB[2 * q + 1, i] = k * (nu * B[2 * q, i] + B[2 * q + 1, i])
    for i in range(12):
        CM[8, i] = in_plane * M[8, i]
    for i in range(24):
        CB[8, i] = in_plane / 3.0 * B[8, i]
        for s in range(4):
            CB[9 + s, i] = (
                shear[s, 0] * B[9, i] + shear[s, 1] * B[10, i] + shear[s, 2] * B[11, i] + shear[s, 3] * B[12, i]
            )


@njit(cache=True)
def _material_tangent(M, B, CM, CB, K):
    """``K (24, 24) = M^T C M + B^T C B``."""
    for i in range(24):
        for j in range(24):
            K[i, j] = 0.0
    for i in range(12):
        for r in range(9):
            c = M[r, i]
            for j in range(12):
                K[i, j] += c * CM[r, j]
        for r in range(13):
            c = B[r, i]
            for j in range(24):
                K[i, j] += c * CB[r, j]
    # membrane strains do not depend on directors, so only bending couples these
    for i in range(12, 24):
        for r in range(13):
            c = B[r, i]
            for j in range(12, 24):
                K[i, j] += c * CB[r, j]


@njit(cache=True, inline="always")
def _add_point(a, b, n, G):
    """Second derivative of in-plane strains with weights ``n``, for one component: ``G (4, 4)``."""
    for i in range(4):
        p, r = n[0] * a[i] + n[2] * b[i], n[2] * a[i] + n[1] * b[i]
        for j in range(4):
            G[i, j] += p * a[j] + r * b[j]


@njit(cache=True)
def _add_geometric(plane, twist, s, n, G, K):
    """Add the stresses' share of the tangent to the blocks of ``K`` on and above the diagonal."""
    # the geometric part is the same for all three components, so one 4 x 4 block per pair serves three
    G[:] = 0.0  # [0] couples places with places, [1] places with directors
    for q in range(4):
        _covariant(plane[q, 0], plane[q, 1], s[2 * q], s[2 * q + 1], n)
        _add_point(A_G[q], B_G[q], n, G[0])
        _covariant(plane[q, 0], plane[q, 1], s[8 + 2 * q], s[9 + 2 * q], n)
        _add_point(A_G[q], B_G[q], n, G[1])
    _covariant(twist, twist, s[16], 0.0, n)
    _add_point(A_0, B_0, n, G[0])
    _covariant(twist, twist, s[17], 0.0, n)
    _add_point(A_0, B_0, n, G[1])
    for side in range(4):
        for i in range(4):
            for j in range(4):
                G[1, i, j] += s[18 + side] * S_S[side, i] * N_S[side, j]
    for i in range(4):
        for j in range(4):
            for k in range(3):
                K[3 * i + k, 3 * j + k] += G[0, i, j]
                K[3 * i + k, 12 + 3 * j + k] += G[1, i, j]
        for k in range(3):
            K[12 + 3 * i + k, 12 + 3 * i + k] += s[22 + i]


@njit(cache=True)
def _add_thickness(x, thickness, K):
    """Add the thickness strains' material tangent, and complete ``K`` below the diagonal."""
    for i in range(4):
        for j in range(4):
            for k in range(3):
                for m in range(3):
                    K[12 + 3 * i + k, 12 + 3 * j + m] += thickness[i, j] * x[4 + i, k] * x[4 + j, m]
    # only places over directors were computed; the other block is its transpose
    for i in range(12):
        for j in range(12):
            K[12 + j, i] = K[i, 12 + j]


@njit(cache=True)
def residual(nodes, plane, twist, membrane, in_plane, shear, thickness, start, nu, x, out):
    """Add the nodal forces of all elements in the state ``x (k, 6)`` to ``out (k, 6)`` [N]."""
    y, f, v = np.empty((8, 3)), np.empty((8, 3)), np.empty((4, 3))
    e, s, n, m = np.empty(STRAINS), np.empty(STRAINS), np.empty(3), np.empty(3)
    for c in range(nodes.shape[0]):
        _gather(x, nodes[c], y)
        _form(y, plane[c], twist[c], v, e)
        for i in range(STRAINS):
            e[i] -= start[c, i]
        _stress(e, membrane[c], in_plane[c], shear[c], thickness[c], nu, s)
        _force(y, plane[c], twist[c], s, v, n, m, f)
        for i in range(4):
            for k in range(3):
                out[nodes[c, i], k] += f[i, k]
                out[nodes[c, i], 3 + k] += f[4 + i, k]


@njit(cache=True)
def tangent(nodes, plane, twist, membrane, in_plane, shear, thickness, start, nu, x, step, place, width, out):
    """Add the tangent of all elements in the state ``x (k, 6)`` to the values ``out`` of a compressed-row matrix.

    ``step (k, 6)`` is the last change of ``x``, or has no rows. With it, the stresses of the geometric part are those
    that the last linear step predicted: the strains there are the quadratic forms of ``x`` minus those of ``step``.
    The block of nodes i, j of element c starts at ``out[place[c, i, j]]``, its rows are ``width[i]`` apart.
    """
    y, v, e, s, n = np.empty((8, 3)), np.empty((4, 3)), np.empty(STRAINS), np.empty(STRAINS), np.empty(3)
    d, extra = np.empty((8, 3)), np.zeros(STRAINS)
    M, B, CM, CB = np.empty((9, 12)), np.empty((13, 24)), np.empty((9, 12)), np.empty((13, 24))
    K, G = np.empty((24, 24)), np.empty((2, 4, 4))
    for c in range(nodes.shape[0]):
        _gather(x, nodes[c], y)
        _form(y, plane[c], twist[c], v, e)
        if step.shape[0] > 0:
            _gather(step, nodes[c], d)
            _form(d, plane[c], twist[c], v, extra)
        # strains of the last linear step: its quadratic share is what Newton's linearisation did not see
        for i in range(STRAINS):
            e[i] -= start[c, i] + extra[i]
        _stress(e, membrane[c], in_plane[c], shear[c], thickness[c], nu, s)
        _rows(y, plane[c], twist[c], v, M, B)
        _material_rows(membrane[c], in_plane[c], shear[c], nu, M, B, CM, CB)
        _material_tangent(M, B, CM, CB, K)
        _add_geometric(plane[c], twist[c], s, n, G, K)
        _add_thickness(y, thickness[c], K)
        for i in range(4):
            row = width[nodes[c, i]]
            for j in range(4):
                for k in range(3):
                    up, low = place[c, i, j] + k * row, place[c, i, j] + (3 + k) * row
                    for m in range(3):
                        out[up + m] += K[3 * i + k, 3 * j + m]
                        out[up + 3 + m] += K[3 * i + k, 12 + 3 * j + m]
                        out[low + m] += K[12 + 3 * i + k, 3 * j + m]
                        out[low + 3 + m] += K[12 + 3 * i + k, 12 + 3 * j + m]
