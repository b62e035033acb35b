"""Smoothing of noisy samples: a low pass of sixth order, along a line by a C2 spline and round a ring by its waves.

A wave of length ``l`` keeps the share ``1 / (1 + (wavelength / l)^6)`` of its height: one of twice the wavelength
98 %, half of it 2 %.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from softjaw.fem.objects.pose import FloatArray

KNOTS = 4  # per wavelength


def smooth_spline(x: FloatArray, y: FloatArray, wavelength: float, ends: tuple[float, float]) -> BSpline:
    """C2 cubic spline on ``ends`` near the samples ``y (n, ...)`` at ``x (n,)``, given at roughly even steps.

    It minimises ``sum (y - f)^2 + (wavelength / 2 pi)^6 integral f'''^2 dx / step``, so parabolas stay as they are and
    gaps in the samples are bridged; the third derivative is measured by differences of the coefficients (P-spline).
    """
    pieces = max(4, int(np.ceil((ends[1] - ends[0]) * KNOTS / wavelength)))
    width = (ends[1] - ends[0]) / pieces
    knots = ends[0] + width * np.arange(-3, pieces + 4)
    knots[[3, -4]] = ends
    B = csc_array(BSpline.design_matrix(np.clip(x, *ends), knots, 3))
    n = B.shape[1]
    D = diags_array([-1.0, 3.0, -3.0, 1.0], offsets=[0, 1, 2, 3], shape=(n - 3, n))
    step = float(np.median(np.diff(x)))
    weight = width / step * (wavelength / (2 * np.pi * width)) ** 6
    right = B.T @ np.reshape(y, (len(x), -1))
    c = splu(csc_array(B.T @ B + weight * (D.T @ D))).solve(np.ascontiguousarray(right))
    return BSpline(knots, c.reshape(n, *np.shape(y)[1:]), 3, extrapolate=True)


def smooth_rings(values: FloatArray, waves: FloatArray, count: int) -> FloatArray:
    """Rings ``(k, count)`` without the waves of ``values (k, n)`` that fit in more than ``waves (k,)`` times."""
    order = np.arange(count // 2)  # what the new ring cannot show is left out, so it does not come back as long waves
    share = 1.0 / (1.0 + (order / waves[:, None]) ** 6)
    spectrum = np.fft.rfft(values, axis=1)[:, : count // 2] * share
    return np.fft.irfft(spectrum, n=count, axis=1) * (count / values.shape[1])
