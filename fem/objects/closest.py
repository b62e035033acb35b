"""Closest points on plane curves, compiled: an ellipse and a piecewise cubic."""

import math

import numpy as np
from numba import njit

SMALLEST_STRETCH = 1e-3  # 1 + curvature * g never drops below: beyond it the point has passed the centre of curvature


@njit(cache=True)
def _multiplier(z0, z1, excess):
    """Root T > 0 of (r z0 / (T + r - 1))^2 + (z1 / T)^2 = 1, with r = e0^2 / e1^2 >= 1 and ``excess`` = r - 1.

    T is the Lagrange multiplier of the projection, shifted so that the pole lies at zero and nothing cancels. The left
    side G is convex and decreasing; Newton's method on 1 / sqrt(G), which is nearly linear in T, is kept inside a
    bracket that shrinks by its geometric mean where Newton's step leaves it.
    """
    # G is at least 1 at the lower end and at most 1 at the upper: the root is bracketed from the start
    low, high = z1, math.hypot((1.0 + excess) * z0, z1)
    T = low if low > 0.0 else high
    for _ in range(200):
        p, q = (1.0 + excess) * z0 / (T + excess), z1 / T
        G = p * p + q * q
        if G > 1.0:
            low = T
        else:
            high = T
        slope = p * p / (T + excess) + q * q / T
        new = T + G * (math.sqrt(G) - 1.0) / slope
        if not low < new < high:
            # two roots, because the product of both ends may underflow
            new = math.sqrt(low) * math.sqrt(high) if high > 4.0 * low else 0.5 * (low + high)
        if abs(new - T) <= 4e-16 * T or high - low <= 4e-16 * high:
            return new
        T = new
    return T


@njit(cache=True)
def ellipse_foot(x, y, a, b):
    """Cosine and sine of the eccentric angle of the point of the ellipse that is closest to ``(x, y)``."""
    swap = b > a
    e0, e1 = (b, a) if swap else (a, b)
    y0, y1 = (abs(y), abs(x)) if swap else (abs(x), abs(y))
    z0, z1 = y0 / e0, y1 / e1
    # as a product: the difference of the squares would cancel for a nearly round ellipse
    excess = (e0 - e1) * (e0 + e1) / (e1 * e1)
    if z1 > 0.0:
        T = _multiplier(z0, z1, excess)
        c, s = (1.0 + excess) * z0 / (T + excess), z1 / T
    elif (1.0 + excess) * z0 < excess:  # on the long axis, between the two cusps of the evolute
        c = (1.0 + excess) * z0 / excess
        s = math.sqrt((1.0 - c) * (1.0 + c))
    else:
        c, s = 1.0, 0.0
    # the root is known up to rounding, but the foot has to lie on the ellipse
    length = math.hypot(c, s)
    c, s = c / length, s / length
    c, s = (s, c) if swap else (c, s)
    return math.copysign(c, x), math.copysign(s, y)


@njit(cache=True)
def ellipse_gap(x, a, b):
    """Signed distance ``(n,)`` to the ellipse, normal ``(n, 2)`` and Hessian ``(n, 2, 2)`` at ``x (n, 2 or more)``."""
    n = len(x)
    g, normal, hessian = np.empty(n), np.empty((n, 2)), np.empty((n, 2, 2))
    for i in range(n):
        c, s = ellipse_foot(x[i, 0], x[i, 1], a, b)
        speed = math.hypot(b * c, a * s)
        n_x, n_y = b * c / speed, a * s / speed
        g[i] = (x[i, 0] - a * c) * n_x + (x[i, 1] - b * s) * n_y
        curvature = a * b / speed**3
        k = curvature / max(1.0 + curvature * g[i], SMALLEST_STRETCH)
        normal[i, 0], normal[i, 1] = n_x, n_y
        hessian[i, 0, 0], hessian[i, 1, 1] = k * n_y * n_y, k * n_x * n_x
        hessian[i, 0, 1] = hessian[i, 1, 0] = -k * n_x * n_y
    return g, normal, hessian


@njit(cache=True)
def _nearest_segment(z, r, line):
    """Segment of the polyline ``line (m + 1, 2)`` closest to a point, and the place on it in [0, 1]."""
    best, segment, place = np.inf, 0, 0.0
    for i in range(len(line) - 1):
        d_z, d_r = line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1]
        t = ((z - line[i, 0]) * d_z + (r - line[i, 1]) * d_r) / (d_z * d_z + d_r * d_r)
        t = min(max(t, 0.0), 1.0)
        d = (line[i, 0] + t * d_z - z) ** 2 + (line[i, 1] + t * d_r - r) ** 2
        if d < best:
            best, segment, place = d, i, t
    return segment, place


@njit(cache=True)
def _cubic(s, breaks, coefficients):
    """Point and first two derivatives of the piecewise cubic at ``s``: ``(z, z', z'', r, r', r'')``."""
    k = min(max(np.searchsorted(breaks, s, side="right") - 1, 0), len(breaks) - 2)
    return _jet(coefficients[k, 0], s - breaks[k]) + _jet(coefficients[k, 1], s - breaks[k])


@njit(cache=True)
def _jet(c, h):
    """Value and first two derivatives of a cubic."""
    slope = c[1] + h * (2.0 * c[2] + h * 3.0 * c[3])
    return c[0] + h * (c[1] + h * (c[2] + h * c[3])), slope, 2.0 * c[2] + 6.0 * h * c[3]


@njit(cache=True)
def _foot(z, r, low, high, s, breaks, coefficients):
    """Parameter in ``[low, high]`` of the closest point: Newton's method, bisected where a step leaves the bracket."""
    tolerance = 1e-15 * breaks[-1]
    for _ in range(80):
        c_z, t_z, k_z, c_r, t_r, k_r = _cubic(s, breaks, coefficients)
        f = (c_z - z) * t_z + (c_r - r) * t_r
        slope = t_z * t_z + t_r * t_r + (c_z - z) * k_z + (c_r - r) * k_r
        if f > 0.0:
            high = s
        else:
            low = s
        # without a positive slope Newton's method would go to a farthest point: bisect instead
        new = s - f / slope if slope > 0.0 else low - 1.0
        if not low <= new <= high:
            new = 0.5 * (low + high)
        if abs(new - s) <= tolerance or high - low <= tolerance:
            return new
        s = new
    return s


@njit(cache=True)
def profile_gap(x, breaks, coefficients, line, places):
    """Signed distance ``(n,)`` to the turned profile, normal ``(n, 3)`` and Hessian ``(n, 3, 3)`` at ``x (n, 3)``.

    The closest point lies in the half plane of the point, so this is a distance to the curve (z, r)(s). The Hessian has
    the curvature of the profile along the meridian and n_r / distance to the axis around it.
    """
    n = len(x)
    g, normal, hessian = np.empty(n), np.empty((n, 3)), np.empty((n, 3, 3))
    for i in range(n):
        z, r = x[i, 2], math.hypot(x[i, 0], x[i, 1])
        c, d = (x[i, 0] / r, x[i, 1] / r) if r > 0.0 else (1.0, 0.0)
        k, t = _nearest_segment(z, r, line)
        # a segment more on either side: the foot on the curve may lie beyond that on the polyline
        low, high = places[max(k - 1, 0)], places[min(k + 2, len(places) - 1)]
        s = _foot(z, r, low, high, places[k] + t * (places[k + 1] - places[k]), breaks, coefficients)
        c_z, t_z, k_z, c_r, t_r, k_r = _cubic(s, breaks, coefficients)
        speed = math.hypot(t_z, t_r)
        n_z, n_r = -t_r / speed, t_z / speed
        g[i] = (z - c_z) * n_z + (r - c_r) * n_r
        curvature = (t_r * k_z - t_z * k_r) / speed**3
        along = curvature / max(1.0 + curvature * g[i], SMALLEST_STRETCH)
        # on the axis this is 0 / 0, and both curvatures agree there
        around = n_r / r if r > 1e-9 else along
        e = (c * n_z, d * n_z, -n_r)  # along the meridian, at right angles to the normal
        f = (-d, c, 0.0)
        normal[i, 0], normal[i, 1], normal[i, 2] = c * n_r, d * n_r, n_z
        for p in range(3):
            for q in range(3):
                hessian[i, p, q] = along * e[p] * e[q] + around * f[p] * f[q]
    return g, normal, hessian
