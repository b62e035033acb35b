"""Tricubic B-spline through samples on an even grid: value, gradient and Hessian, twice continuously differentiable.

The spline passes through the samples. On a smooth function its error is of fourth order in the step, that of the
gradient of third and that of the Hessian of second order; an edge is rounded over about one step.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.ndimage import spline_filter

from softjaw.fem.objects.gap import FloatArray

PADDING = 8  # cells of continuation; the filter forgets its end by a factor 0.27 per cell


def coefficients(samples: FloatArray) -> FloatArray:
    """B-spline coefficients of the samples ``(n_0, n_1, n_2)``, padded by ``PADDING`` on every side.

    The samples are continued by reflection in their end points (which keeps the slope), so that the end conditions of
    the filter stay far away from the values that are used.
    """
    extended = np.pad(samples, PADDING, mode="reflect", reflect_type="odd")
    return np.ascontiguousarray(spline_filter(extended, order=3, output=np.float64, mode="mirror"))


@njit(cache=True)
def _weights(t, w):
    """Cubic B-spline weights ``w (3, 4)`` at ``t`` in [0, 1]: values, first and second derivatives."""
    u = 1.0 - t
    w[0, 0], w[0, 1] = u * u * u / 6.0, (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0
    w[0, 2], w[0, 3] = (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0, t * t * t / 6.0
    w[1, 0], w[1, 1] = -u * u / 2.0, t * (3.0 * t - 4.0) / 2.0
    w[1, 2], w[1, 3] = -u * (3.0 * u - 4.0) / 2.0, t * t / 2.0
    w[2, 0], w[2, 1], w[2, 2], w[2, 3] = u, 3.0 * t - 2.0, 3.0 * u - 2.0, t


@njit(cache=True)
def evaluate(c, lower, step, x):
    """Value ``(n,)``, gradient ``(n, 3)`` and Hessian ``(n, 3, 3)`` of the spline at ``x (n, 3)``.

    ``c`` are padded coefficients, ``lower (3,)`` is the place of the first sample. The points must lie on the grid.
    """
    n = len(x)
    g, gradient, hessian = np.empty(n), np.empty((n, 3)), np.empty((n, 3, 3))
    w = np.empty((3, 3, 4))
    base = np.empty(3, np.int64)
    for i in range(n):
        for d in range(3):
            s = (x[i, d] - lower[d]) / step
            # a point on the last sample, or off the grid by rounding, belongs to the nearest cell
            k = min(max(int(np.floor(s)), 0), c.shape[d] - 2 * PADDING - 2)
            base[d] = k + PADDING - 1
            _weights(s - k, w[d])
        # one axis at a time takes far fewer products than 64 weights for each of the ten values
        v = v_x = v_y = v_z = v_xx = v_yy = v_zz = v_xy = v_xz = v_yz = 0.0
        for a in range(4):
            p = p_y = p_z = p_yy = p_zz = p_yz = 0.0
            for b in range(4):
                q = q_z = q_zz = 0.0
                for e in range(4):
                    f = c[base[0] + a, base[1] + b, base[2] + e]
                    q += w[2, 0, e] * f
                    q_z += w[2, 1, e] * f
                    q_zz += w[2, 2, e] * f
                p += w[1, 0, b] * q
                p_y += w[1, 1, b] * q
                p_yy += w[1, 2, b] * q
                p_z += w[1, 0, b] * q_z
                p_yz += w[1, 1, b] * q_z
                p_zz += w[1, 0, b] * q_zz
            v += w[0, 0, a] * p
            v_x += w[0, 1, a] * p
            v_xx += w[0, 2, a] * p
            v_y += w[0, 0, a] * p_y
            v_xy += w[0, 1, a] * p_y
            v_z += w[0, 0, a] * p_z
            v_xz += w[0, 1, a] * p_z
            v_yy += w[0, 0, a] * p_yy
            v_yz += w[0, 0, a] * p_yz
            v_zz += w[0, 0, a] * p_zz
        g[i] = v
        gradient[i] = v_x / step, v_y / step, v_z / step
        hessian[i, 0], hessian[i, 1], hessian[i, 2] = (v_xx, v_xy, v_xz), (v_xy, v_yy, v_yz), (v_xz, v_yz, v_zz)
        hessian[i] /= step * step
    return g, gradient, hessian
