"""Functions of two parameters with their exact first and second derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softjaw.fem.objects.pose import FloatArray

TINY = 1e-100  # stands for zero below a logarithm


class Jet:
    """Function of (theta, s) with its derivatives up to the second: rows ``f, f_t, f_s, f_tt, f_ts, f_ss`` (6, n)."""

    def __init__(self, rows: ArrayLike) -> None:
        self.rows = np.asarray(rows, dtype=float)

    def __add__(self, other: Jet) -> Jet:
        return Jet(self.rows + other.rows)

    def __mul__(self, other: Jet) -> Jet:
        (f, ft, fs, ftt, fts, fss), (g, gt, gs, gtt, gts, gss) = self.rows, other.rows
        return Jet([
            f * g, ft * g + f * gt, fs * g + f * gs,
            ftt * g + 2 * ft * gt + f * gtt, fts * g + ft * gs + fs * gt + f * gts, fss * g + 2 * fs * gs + f * gss,
        ])  # fmt: skip

    def through(self, h: FloatArray, h1: FloatArray, h2: FloatArray) -> Jet:
        """``h(f)`` from the values of ``h`` and its two derivatives at ``f``."""
        _, t, s, tt, ts, ss = self.rows
        return Jet([h, h1 * t, h1 * s, h1 * tt + h2 * t * t, h1 * ts + h2 * t * s, h1 * ss + h2 * s * s])

    def exp(self) -> Jet:
        """``exp(f)``."""
        e = np.exp(self.rows[0])
        return self.through(e, e, e)

    def log(self) -> Jet:
        """``ln(f)``."""
        f = self.rows[0]
        return self.through(np.log(f), 1 / f, -1 / f**2)

    def scaled(self, factor: float) -> Jet:
        """``factor * f``."""
        return Jet(factor * self.rows)


def log_of_size(jet: Jet) -> Jet:
    """``ln |f|``, finite where f vanishes."""
    rows = jet.rows.copy()
    rows[0] = np.where(np.abs(rows[0]) < TINY, TINY, rows[0])
    f = rows[0]
    return Jet(rows).through(np.log(np.abs(f)), 1 / f, -1 / f**2)
