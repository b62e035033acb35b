"""C2 cubic splines: through samples on an even grid in space, and through points of a surface ``X(theta, s)``.

In space value, gradient and Hessian of a tricubic B-spline that passes through the samples are known. On a smooth
function its error is of fourth order in the step, that of the gradient of third and that of the Hessian of second
order; an edge is rounded over about one step.

A surface is what a wall's outer face looks like before it is deformed: a tensor grid of exact points, so that position,
normal and curvature are known everywhere between the nodes of a shell mesh, whatever shape the points came from.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline
from scipy.ndimage import spline_filter

from softjaw.fem.objects.gap import Gap
from softjaw.friction.patch import FloatArray


class SplineSurface(NamedTuple):
    """Piecewise bicubic surface; on cell ``(i, j)`` the powers of ``theta - theta_i`` and ``s - s_j``.

    ``theta, s (m + 1,), (k + 1,)``: ascending parameters of the grid lines: angle once about the axis [rad] and a
    length along the outline [m]; ``coefficients (m, k, 3, 4, 4)``: of the powers of ``theta`` and of ``s``, lowest
    first [m].
    """

    theta: FloatArray
    s: FloatArray
    coefficients: FloatArray

    def at(self, theta: FloatArray, s: FloatArray) -> FloatArray:
        """Points and derivatives ``X, X_t, X_s, X_tt, X_ts, X_ss`` at ``n`` pairs of parameters: ``(n, 6, 3)``."""
        D = np.empty((len(theta), 6, 3))
        _evaluate(self.theta, self.s, self.coefficients, theta, s, D)
        return D


def spline_surface(theta: FloatArray, s: FloatArray, points: FloatArray) -> SplineSurface:
    """Surface through ``points (m + 1, k + 1, 3)`` on the grid ``theta (m + 1,)``, ``s (k + 1,)``."""
    X = points.copy()
    # periodic splines want both ends equal
    X[-1] = X[0]
    around = CubicSpline(theta, X, axis=0, bc_type="periodic").c[::-1]  # (4, m, k + 1, 3)
    along = CubicSpline(s, around, axis=2).c[::-1]  # (4, k, 4, m, 3)
    return SplineSurface(theta, s, np.ascontiguousarray(along.transpose(3, 1, 4, 2, 0)))


@njit(cache=True)
def _evaluate(theta_lines, s_lines, coefficients, theta, s, D):
    """`evaluate` at many places."""
    for n in range(theta.size):
        evaluate(theta_lines, s_lines, coefficients, theta[n], s[n], D[n])


@njit(cache=True)
def evaluate(theta_lines, s_lines, coefficients, theta, s, D):
    """Position and derivatives ``D (6, 3)``: ``X, X_t, X_s, X_tt, X_ts, X_ss``, continued beyond the ends."""
    theta = theta_lines[0] + (theta - theta_lines[0]) % (theta_lines[-1] - theta_lines[0])
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


PADDING = 8  # cells of continuation; the filter forgets its end by a factor 0.27 per cell


def grid_coefficients(samples: FloatArray) -> FloatArray:
    """B-spline coefficients of the samples ``(n_0, n_1, n_2)``, padded by ``PADDING`` on every side.

    The samples are continued by reflection in their end points (which keeps the slope), so that the end conditions of
    the filter stay far away from the values that are used.
    """
    extended = np.pad(samples, PADDING, mode="reflect", reflect_type="odd")
    return np.ascontiguousarray(spline_filter(extended, order=3, output=np.float64, mode="mirror"))


def between(samples: FloatArray, parts: int) -> FloatArray:
    """The spline through ``samples`` at their places and at ``parts - 1`` even ones between neighbours."""
    values = grid_coefficients(samples)
    for n in samples.shape:
        # by one axis after the other, which goes to the end each time
        rows, W = np.zeros((parts * (n - 1) + 1, n + 2 * PADDING)), np.empty((3, 4))
        for k in range(len(rows)):
            _weights(k / parts - k // parts, W)
            rows[k, k // parts + PADDING - 1 : k // parts + PADDING + 3] = W[0]
        values = np.tensordot(values, rows, (0, 1))
    return values


@njit(cache=True)
def _weights(t, W):
    """Cubic B-spline weights ``W (3, 4)`` at ``t`` in [0, 1]: values, first and second derivatives."""
    u = 1.0 - t
    W[0] = u**3 / 6, (4 - 6 * t**2 + 3 * t**3) / 6, (4 - 6 * u**2 + 3 * u**3) / 6, t**3 / 6
    W[1] = -(u**2) / 2, t * (3 * t - 4) / 2, -u * (3 * u - 4) / 2, t**2 / 2
    W[2] = u, 3 * t - 2, 3 * u - 2, t


@njit(cache=True)
def _evaluate_grid(c, s, g, gradient, hessian):
    """`evaluate_grid` at ``s (n, 3)`` in steps of the grid from its first sample; derivatives are by these, too."""
    W, along_z, along_yz, D = np.empty((3, 3, 4)), np.empty((4, 3)), np.empty((4, 3, 3)), np.empty((3, 3, 3))
    k = np.empty(3, np.int64)
    for n in range(len(s)):
        for d in range(3):
            # a point on the last sample, or off the grid by rounding, belongs to the nearest cell
            k[d] = min(max(int(np.floor(s[n, d])), 0), c.shape[d] - 2 * PADDING - 2)
            _weights(s[n, d] - k[d], W[d])
        # one axis at a time takes far fewer products than 64 weights for each of the ten values
        first, second, third = k + (PADDING - 1)
        for i in range(4):
            for j in range(4):
                for r in range(3):
                    along_z[j, r] = 0.0
                    for m in range(4):
                        along_z[j, r] += W[2, r, m] * c[first + i, second + j, third + m]
            for q in range(3):
                for r in range(3 - q):
                    along_yz[i, q, r] = 0.0
                    for j in range(4):
                        along_yz[i, q, r] += W[1, q, j] * along_z[j, r]
        for p in range(3):
            for q in range(3 - p):
                for r in range(3 - p - q):
                    D[p, q, r] = 0.0
                    for i in range(4):
                        D[p, q, r] += W[0, p, i] * along_yz[i, q, r]
        g[n] = D[0, 0, 0]
        gradient[n] = D[1, 0, 0], D[0, 1, 0], D[0, 0, 1]
        hessian[n, 0] = D[2, 0, 0], D[1, 1, 0], D[1, 0, 1]
        hessian[n, 1] = D[1, 1, 0], D[0, 2, 0], D[0, 1, 1]
        hessian[n, 2] = D[1, 0, 1], D[0, 1, 1], D[0, 0, 2]


def evaluate_grid(c: FloatArray, lower: FloatArray, step: float, x: FloatArray) -> Gap:
    """Value ``(n,)``, gradient ``(n, 3)`` and Hessian ``(n, 3, 3)`` of the spline at ``x (n, 3)``.

    ``c`` are padded coefficients, ``lower (3,)`` is the place of the first sample. The points must lie on the grid.
    """
    n = len(x)
    g, gradient, hessian = np.empty(n), np.empty((n, 3)), np.empty((n, 3, 3))
    _evaluate_grid(c, (x - lower) / step, g, gradient, hessian)
    return g, gradient / step, hessian / step**2
