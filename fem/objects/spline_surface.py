"""Smooth surface ``X(theta, s)``: what a wall's outer face looks like before it is deformed.

A tensor grid of exact points is joined by C2 cubic splines, so that position, normal and curvature are known
everywhere between the nodes of a shell mesh, whatever shape the points came from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from softjaw.fem.objects.gap import FloatArray


@dataclass(frozen=True, eq=False)
class SplineSurface:
    """Piecewise bicubic surface; on cell ``(i, j)`` the powers of ``theta - theta_i`` and ``s - s_j``.

    Parameters
    ----------
    theta, s : (m + 1,), (k + 1,) arrays
        Ascending parameters of the grid lines: angle about the axis [rad] and a length along the outline [m].
    coefficients : (m, k, 3, 4, 4) array
        Of the powers of ``theta`` and of ``s``, lowest first [m].
    closed : bool
        Whether ``theta`` runs once round; it is then taken modulo the full turn.
    """

    theta: FloatArray
    s: FloatArray
    coefficients: FloatArray
    closed: bool

    def at(self, theta: ArrayLike, s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Points ``(n, 3)`` [m] and unit normals ``(n, 3)``, the cross product of the theta and s directions.

        A normal is zero where the surface has none: where a line of the grid shrinks to a point on the axis.
        """
        theta, s = np.broadcast_arrays(np.asarray(theta, float), np.asarray(s, float))
        D = np.empty((theta.size, 6, 3))
        for n, pair in enumerate(zip(theta.ravel(), s.ravel(), strict=True)):
            evaluate(self.theta, self.s, self.coefficients, self.closed, *pair, D[n])
        normal = np.cross(D[:, 1], D[:, 2])
        return D[:, 0], normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)


def spline_surface(theta: ArrayLike, s: ArrayLike, points: ArrayLike, closed: bool) -> SplineSurface:
    """Surface through ``points (m + 1, k + 1, 3)`` on the grid ``theta (m + 1,)``, ``s (k + 1,)``.

    Raises
    ------
    ValueError
        If the parameters do not ascend, or a closed surface does not end where it began.
    """
    theta, s, X = np.asarray(theta, float), np.asarray(s, float), np.array(points, dtype=float)
    if X.shape != (len(theta), len(s), 3):
        raise ValueError(f"points has shape {X.shape}, expected {(len(theta), len(s), 3)} for this grid")
    if closed:
        off = np.abs(X[0] - X[-1]).max()
        if off > 1e-9 * np.abs(X).max():
            raise ValueError(f"a closed surface must end where it began, found {off:.3g} m between its two ends")
        # periodic splines want both ends equal
        X[-1] = X[0]
    around = CubicSpline(theta, X, axis=0, bc_type="periodic" if closed else "not-a-knot").c[::-1]  # (4, m, k + 1, 3)
    along = CubicSpline(s, around, axis=2).c[::-1]  # (4, k, 4, m, 3)
    return SplineSurface(theta, s, np.ascontiguousarray(along.transpose(3, 1, 4, 2, 0)), closed)


@njit(cache=True)
def evaluate(theta_lines, s_lines, coefficients, closed, theta, s, D):
    """Position and derivatives ``D (6, 3)``: ``X, X_t, X_s, X_tt, X_ts, X_ss``, continued beyond the ends."""
    if closed:
        turn = theta_lines[-1] - theta_lines[0]
        theta = theta_lines[0] + (theta - theta_lines[0]) % turn
    i = min(max(np.searchsorted(theta_lines, theta, side="right") - 1, 0), theta_lines.size - 2)
    j = min(max(np.searchsorted(s_lines, s, side="right") - 1, 0), s_lines.size - 2)
    u, v = theta - theta_lines[i], s - s_lines[j]
    for c in range(3):
        C = coefficients[i, j, c]
        # rows: polynomials in s and their derivatives, then Horner in theta
        X = Xt = Xtt = Xs = Xts = Xss = 0.0
        for a in range(3, -1, -1):
            p = ((C[a, 3] * v + C[a, 2]) * v + C[a, 1]) * v + C[a, 0]
            p_s = (3.0 * C[a, 3] * v + 2.0 * C[a, 2]) * v + C[a, 1]
            p_ss = 6.0 * C[a, 3] * v + 2.0 * C[a, 2]
            Xtt = Xtt * u + 2.0 * Xt
            Xt = Xt * u + X
            X = X * u + p
            Xts = Xts * u + Xs
            Xs = Xs * u + p_s
            Xss = Xss * u + p_ss
        D[0, c], D[1, c], D[2, c], D[3, c], D[4, c], D[5, c] = X, Xt, Xs, Xtt, Xts, Xss
