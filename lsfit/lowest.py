"""Smallest value of a quartic form on the unit sphere, and whether its level set is closed.

It is searched from many starts and polished. On any great circle a quartic form is a trigonometric polynomial of
degree 4: where it is at most ``M`` its second derivative is at most ``16 M`` (Bernstein). From a minimum it therefore
rises by at most ``8 M h^2`` within the angle ``h``, which bounds what samples no farther apart can have missed.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

from softjaw.lsfit.form import derivative, directions, exponents, half_sphere_monomials, hessian_tensor, monomials
from softjaw.lsfit.surface import ZERO_SHARE

FloatArray = NDArray[np.float64]


def lies_above(v: FloatArray, dimension: int, level: float) -> bool:
    """Whether a quartic form with coefficients ``v (k,)`` exceeds ``level >= 0`` all over the unit sphere.

    Samples settle it if what they can have missed does not matter, as they are or where the form is 1 along every axis;
    otherwise the smallest value is searched.
    """
    if _bound(v, dimension) > level:
        return True
    E = exponents(dimension, 4)
    # a long thin body has a small value along one axis by its shape alone: made as long as wide it is judged fairly
    along = v[E.max(axis=1) == 4]
    # the values on the axes are values on the sphere: one that is too small settles it
    if not along.min() > level:
        return False
    size = along**-0.25
    even = _bound(v * np.prod(size**E, axis=1), dimension)
    # a unit vector is at least 1 / max(size) long in even variables, and P grows with the fourth power
    return bool(even > level * size.max() ** 4) or smallest_value(v, dimension)[0] > level


def _bound(v: FloatArray, dimension: int) -> float:
    """Lower bound of the form on the unit sphere."""
    P = half_sphere_monomials(dimension, _count(dimension)) @ v
    low = float(P.min())
    # Bernstein's bound takes the largest magnitude, which may belong to a negative value
    return low - _missed(dimension) * max(float(P.max()), -low)


def smallest_value(v: FloatArray, dimension: int) -> tuple[float, FloatArray]:
    """Smallest value on the unit sphere of the quartic form with coefficients ``v (k,)``, and where, ``(d,)``."""
    n = _count(dimension)
    P = half_sphere_monomials(dimension, n) @ v
    u = directions(dimension, n)[
        _lowest(P, dimension) | (P <= np.partition(P, 40)[40])
    ]  # and the 40 lowest, or a narrow valley is missed
    D, E, third = derivative(dimension, 4), exponents(dimension, 4), exponents(dimension, 3)
    Q = hessian_tensor(v, dimension).reshape(dimension**2, dimension**2)
    value, size, trust = monomials(u, E) @ v, np.abs(P).max(), np.full(len(u), 0.3)
    for _ in range(60):
        g = monomials(u, third) @ (D @ v).T
        # only the slope along the sphere counts; across it Euler's identity fixes it to 4 P
        slope = g - (g * u).sum(axis=1, keepdims=True) * u
        if ((np.abs(slope).max(axis=1) <= ZERO_SHARE * size) | (trust < 1e-9)).all():
            break
        new = _descended(u, slope, value, Q, trust)
        reached = monomials(new, E) @ v
        # steps that do not descend are not taken, so no search ends above its start
        lower = reached < value
        u, value = np.where(lower[:, None], new, u), np.where(lower, reached, value)
        # a step that rises is cut hard, one that falls may grow: as trust regions do
        trust = np.where(lower, np.minimum(2 * trust, 0.3), 0.2 * trust)
    best = int(np.argmin(value))
    return float(value[best]), u[best]


def _descended(u: FloatArray, slope: FloatArray, value: FloatArray, Q: FloatArray, longest: FloatArray) -> FloatArray:
    """Newton step ``(m, d)`` on the sphere, against the slope where the curvature has the wrong sign."""
    d = u.shape[1]
    H = ((u[:, :, None] * u[:, None, :]).reshape(-1, d * d) @ Q).reshape(-1, d, d)
    across = np.eye(d) - u[:, :, None] * u[:, None, :]
    # curvature along the sphere: that of P less its slope across, 4 P
    curvature, axes = np.linalg.eigh(across @ (H - 4 * value[:, None, None] * np.eye(d)) @ across)
    # magnitudes make the step descend at saddles too; the floor bounds it where the form is flat
    size = np.maximum(np.abs(curvature), 1e-8 * np.abs(Q).max() + 1e-300)
    step = np.einsum("mij,mj,mkj,mk->mi", axes, 1 / size, axes, -slope)
    # without curvature across the sphere the rounding of that part is blown up, and has to go
    step -= (step * u).sum(axis=1, keepdims=True) * u
    length = np.linalg.norm(step, axis=1)
    new = u + step * np.minimum(1, longest / np.maximum(length, 1e-300))[:, None]
    return new / np.linalg.norm(new, axis=1, keepdims=True)


def _count(dimension: int) -> int:
    """Number of directions in which the value is sampled."""
    return 400 if dimension <= 3 else 2000


def _lowest(value: FloatArray, dimension: int) -> NDArray[np.bool_]:
    """Which of the sampled directions have no lower neighbour, ``(n,)``."""
    return value <= value[neighbours(dimension, len(value))].min(axis=1)


@lru_cache
def neighbours(dimension: int, count: int) -> NDArray[np.intp]:
    """Nearest of the other `directions`, opposites being the same, ``(count, k)``."""
    u = directions(dimension, count)
    # the nearest point is the direction itself
    return cKDTree(np.vstack([u, -u])).query(u, 9 if dimension <= 3 else 11)[1][:, 1:] % count


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
