"""Richardson extrapolation of several cases at once, with the order that the finest three levels show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

FloatArray = NDArray[np.float64]
ALIKE = 0.75  # share of the change in which both steps must go the same way
LOWEST, HIGHEST = 0.5, 6.0  # orders that are believed
NOISE = 1e-9  # relative changes below this tell nothing
SAFETY = 0.25  # of the correction by an observed order, which may be off by so much: Roache's factor of 1.25
ASSUMED = 1.5  # order with which the last step is taken to shrink where none is seen: that of a contact's edge


@dataclass(frozen=True)
class Limit:
    """Where a ladder of levels leads.

    Attributes
    ----------
    value : (cases,) array
        The limit: extrapolated where the order was seen, else the finest level.
    uncertainty : (cases,) array
        How far the finest level is from its limit, or from the level before it where no order was seen (absolute).
    doubt : (cases,) array
        How far ``value`` itself may be off (absolute); NaN where a single level tells nothing, 0 where the last of
        discrete levels is exact by definition.
    order : float
        Observed order; NaN where none was seen.
    remark : str
        Why no order was seen; empty where one was.
    """

    value: FloatArray
    uncertainty: FloatArray
    doubt: FloatArray
    order: float
    remark: str


def limit(size: ArrayLike, values: ArrayLike, formal: float = np.nan) -> Limit:
    """Limit of values at falling sizes, Roache's generalised Richardson extrapolation.

    Parameters
    ----------
    size : (levels,) array
        What the error is a power of, falling; NaN where no order is expected.
    values : (levels, cases) array
        NaN where a case has no value at a level.
    formal : float
        Highest order that is used: a larger observed one is not believed to go on.

    Examples
    --------
    >>> found = limit([4, 2, 1], [[1.16], [1.04], [1.01]], formal=2.0)
    >>> round(found.order, 6), found.value.round(6).tolist()
    (2.0, [1.0])
    """
    h, f = np.asarray(size, float), np.asarray(values, float)
    finest = f[-1].copy()
    step = np.abs(f[-1] - f[-2]) if len(f) > 1 else np.full(finest.shape, np.nan)
    if not np.isfinite(h).all():
        return Limit(finest, step, np.zeros(finest.shape), np.nan, "no order is expected")
    order, remark = observed_order(h[-3:], f[-3:]) if len(h) > 2 else (np.nan, "fewer than three levels")
    used = ASSUMED if remark else order if np.isnan(formal) else min(order, formal)
    correction, before = (_correction(h[k - 2 : k or None], f[k - 2 : k or None], used) for k in (0, -1))
    if remark:
        shrunk = np.abs(before) * (h[-1] / h[-2]) ** used if len(h) > 1 else before
        return Limit(finest, step, np.fmax(np.abs(correction), shrunk), np.nan, remark)
    known = np.isfinite(correction)
    value = np.where(known, finest + np.where(known, correction, 0.0), finest)
    doubt = np.fmax(SAFETY * np.abs(correction), np.abs(value - (f[-2] + before)))
    return Limit(value, np.where(known, np.abs(value - finest), step), doubt, order, "")


def _correction(h: FloatArray, f: FloatArray, order: float) -> FloatArray:
    """From the finer of two levels to their limit; NaN where there are fewer."""
    if len(h) < 2:
        return np.full(f.shape[-1:], np.nan)
    return (f[-1] - f[-2]) / ((h[-2] / h[-1]) ** order - 1.0)


def observed_order(h: FloatArray, f: FloatArray) -> tuple[float, str]:
    """Order ``p`` of ``f = f* + c h^p`` over all cases, and why it is not believed (empty if it is).

    Parameters
    ----------
    h : (3,) array
        Falling sizes, in any ratio.
    f : (3, cases) array
    """
    f = f[:, np.isfinite(f).all(axis=0) & (np.abs(f[-1]) > 0)]
    if not f.size:
        return np.nan, "no case was solved on the three finest levels"
    coarse, fine = (f[0] - f[1]) / f[-1], (f[1] - f[2]) / f[-1]
    if np.abs(coarse).max() < NOISE or np.abs(fine).max() < NOISE:
        return np.nan, "the finest levels do not differ"
    change = np.abs(coarse) + np.abs(fine)
    alike = change[coarse * fine > 0].sum() / change.sum()
    if alike < ALIKE:
        return np.nan, f"the last two steps go the same way for only {alike:.0%} of the change"
    ratio = float(np.linalg.norm(coarse) / np.linalg.norm(fine))

    def excess(p: float) -> float:
        return (h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p) - ratio

    if excess(LOWEST) > 0:
        return np.nan, f"the last two steps shrink too little for an order of {LOWEST:g}"
    if excess(HIGHEST) < 0:
        return np.nan, f"the last step is {ratio:.3g} times smaller than the one before, more than any order gives"
    return float(brentq(excess, LOWEST, HIGHEST, xtol=1e-10)), ""
