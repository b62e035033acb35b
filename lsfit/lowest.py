"""Smallest value of a quartic form on the unit sphere, and whether its level set is closed.

It is searched from many starts and polished. On any great circle a quartic form is a trigonometric polynomial of
degree 4: where it is at most ``M`` its second derivative is at most ``16 M`` (Bernstein). From a minimum it therefore
rises by at most ``8 M h^2`` within the angle ``h``, which bounds what samples no farther apart can have missed.
"""

import math
from functools import lru_cache

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

from softjaw.lsfit.form import derivative, directions, exponents, half_sphere_monomials, monomials
from softjaw.lsfit.surface import ZERO_SHARE, FloatArray


def lies_above(v: FloatArray, dimension: int, level: float) -> bool:
    """Whether a quartic form with coefficients ``v (k,)`` exceeds ``level >= 0`` all over the unit sphere.

    Samples settle it if what they can have missed does not matter; otherwise the smallest value is searched.
    """
    return _bound(v, dimension) > level or smallest_value(v, dimension)[0] > level


def _bound(v: FloatArray, dimension: int) -> float:
    """Lower bound of the form on the unit sphere."""
    P = half_sphere_monomials(dimension, _count(dimension)) @ v
    low = float(P.min())
    # Bernstein's bound takes the largest magnitude, which may belong to a negative value
    return low - _missed(dimension) * max(float(P.max()), -low)


def smallest_value(v: FloatArray, dimension: int) -> tuple[float, FloatArray]:
    """Smallest value on the unit sphere of the quartic form with coefficients ``v (k,)``, and where, ``(d,)``."""
    n, E, third = _count(dimension), exponents(dimension, 4), exponents(dimension, 3)
    D, P = derivative(dimension, 4) @ v, half_sphere_monomials(dimension, n) @ v
    size = np.abs(P).max()

    def along(w: FloatArray) -> tuple[float, FloatArray]:
        """Value in the direction of ``w``, of any length, and its gradient."""
        u, length = w / np.linalg.norm(w), np.linalg.norm(w)
        value = float(monomials(u, E)[0] @ v) / size
        return value, (D @ monomials(u, third)[0] / size - 4 * value * u) / length

    # many starts, or a narrow valley is missed
    starts = directions(dimension, n)[np.argsort(P)[:20]]
    ends = [minimize(along, u, jac=True, method="BFGS", options={"gtol": ZERO_SHARE}).x for u in starts]
    at = np.array(ends) / np.linalg.norm(ends, axis=1, keepdims=True)
    values = monomials(at, E) @ v
    best = int(np.argmin(values))
    return float(values[best]), at[best]


def _count(dimension: int) -> int:
    """Number of directions in which the value is sampled."""
    return 400 if dimension <= 3 else 2000


@lru_cache
def _missed(dimension: int) -> float:
    """How far the smallest value can be below that of the samples, as a share of the largest magnitude of these."""
    if dimension > 3:
        return np.inf
    if dimension == 1:
        return 0.0
    u = directions(dimension, _count(dimension))
    # The farthest direction from all samples is a normal of their hull.
    h = math.acos(-ConvexHull(np.vstack([u, -u])).equations[:, -1].max())
    rise = 8 * h**2
    # the rise is a share of the true magnitude, of which samples may miss as much
    return rise / (1 - rise)
