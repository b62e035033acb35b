"""Homogeneous polynomials in any number of variables, and quartic bodies ``P(w) <= 1``: volume and shadow."""

import math
from collections.abc import Callable
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import roots_gegenbauer

from softjaw.lsfit.surface import FitError, FloatArray

IntArray = NDArray[np.int64]


@lru_cache
def exponents(dimension: int, degree: int) -> IntArray:
    """Exponents of all monomials of one degree, ``(k, d)``, ``k = (d + degree - 1 choose degree)``.

    >>> exponents(2, 2).tolist()
    [[2, 0], [1, 1], [0, 2]]
    """
    variables = combinations_with_replacement(range(dimension), degree)
    E = np.array([np.bincount(chosen, minlength=dimension) for chosen in variables])
    # cached: whoever wrote to it would change every later result
    E.flags.writeable = False
    return E


def places(dimension: int, degree: int) -> dict[tuple[int, ...], int]:
    """Position of every row of `exponents`."""
    return {tuple(row): n for n, row in enumerate(exponents(dimension, degree).tolist())}


def monomials(w: ArrayLike, E: IntArray) -> FloatArray:
    """Monomials ``w^E``, ``(m, d), (k, d) -> (m, k)``."""
    W = np.atleast_2d(np.asarray(w, float)).T
    power = [np.ones_like(W)]
    for _ in range(int(E.max(initial=0))):
        power.append(power[-1] * W)
    table = np.array(power)
    # one row per monomial, so that the products run along contiguous memory
    out = table[E[:, 0], 0]
    for i in range(1, len(W)):
        out *= table[E[:, i], i]
    return out.T


@lru_cache
def derivative(dimension: int, degree: int) -> FloatArray:
    """Matrices of the partial derivatives, ``(d, k', k)``: ``d_i w^E = monomials(w, E') @ derivative[i]``.

    ``E'`` are the exponents of one degree less; a form with coefficients ``c`` has the partial derivative
    ``monomials(w, E') @ (derivative[i] @ c)``.
    """
    E = exponents(dimension, degree)
    place = places(dimension, degree - 1)
    D = np.zeros((dimension, len(place), len(E)))
    for n, row in enumerate(E):
        for i in np.flatnonzero(row):
            D[i, place[tuple(row - np.eye(dimension, dtype=int)[i])], n] = row[i]
    D.flags.writeable = False
    return D


def monomial_gradients(w: ArrayLike, dimension: int, degree: int) -> FloatArray:
    """Gradients of the monomials, ``(m, d) -> (m, k, d)``."""
    low = monomials(w, exponents(dimension, degree - 1))
    return np.stack([low @ part for part in derivative(dimension, degree)], axis=-1)


def substitute(coefficients: ArrayLike, E: IntArray, L: ArrayLike) -> FloatArray:
    """Coefficients of ``w -> P(L w)`` for the form ``P`` with these coefficients; ``E`` holds all of one degree.

    The forms agree on a fixed set of points, more of them than coefficients; so the result is exact but for rounding,
    which grows with the spread of the columns of ``L``.
    """
    points, inverse = _interpolation(E.shape[1], int(E[0].sum()))
    return inverse @ (monomials(points @ np.asarray(L, float).T, E) @ np.asarray(coefficients, float))


@lru_cache
def tensor_places(dimension: int) -> tuple[IntArray, FloatArray]:
    """For each entry of `hessian_tensor`, row by row, the monomial it comes from and its factor, both ``(d^4,)``."""
    place = places(dimension, 4)
    index = np.array(list(np.ndindex((dimension,) * 4)))
    count = (index[:, :, None] == np.arange(dimension)).sum(axis=1).tolist()
    # Taylor: second derivatives of a quartic are quadratic forms of half its fourth derivatives
    factor = [math.prod(map(math.factorial, row)) / 2 for row in count]
    return np.array([place[tuple(row)] for row in count]), np.array(factor)


def hessian_tensor(coefficients: ArrayLike, dimension: int) -> FloatArray:
    """Symmetric ``Q (d, d, d, d)`` of a quartic, whose second derivative is ``H_ij(w) = Q_ijkl w_k w_l``.

    Coefficients in the order of ``exponents(dimension, 4)``.
    """
    place, factor = tensor_places(dimension)
    return (np.asarray(coefficients, float)[place] * factor).reshape((dimension,) * 4)


@lru_cache
def _interpolation(dimension: int, degree: int) -> tuple[FloatArray, FloatArray]:
    E = exponents(dimension, degree)
    # more points than coefficients keep the system well conditioned; the seed repeats every run
    points = np.random.default_rng(len(E)).normal(size=(3 * len(E), dimension))
    # a form grows with a power of the length, which would weigh the points unevenly
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points, np.linalg.pinv(monomials(points, E))


@lru_cache
def directions(dimension: int, count: int) -> FloatArray:
    """Unit vectors of one half of the sphere (opposites count once), ``(count, d)``, evenly spread for ``d <= 3``."""
    if dimension <= 2:
        phi = np.pi * (np.arange(count) + 0.5) / count
        u = np.column_stack([np.cos(phi), np.sin(phi)])[:, :dimension]
    elif dimension == 3:
        i = np.arange(count)
        # equal steps of height cut a sphere into rings of equal area (Archimedes)
        z = (i + 0.5) / count
        # by the golden angle no two turns of the spiral line up
        phi = i * np.pi * (3 - math.sqrt(5))
        u = np.column_stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z])
    else:
        # no spiral fills spheres of more dimensions; the seed makes every run the same
        u = np.random.default_rng(dimension).normal(size=(count, dimension))
    u = u / np.linalg.norm(u, axis=1, keepdims=True)
    u.flags.writeable = False
    return u


@lru_cache
def sphere_rule(dimension: int, n: int) -> tuple[FloatArray, FloatArray]:
    """Points ``(k, d)`` and weights ``(k,)`` that integrate even functions over the unit sphere.

    Gauss rules along each axis times equal steps around the last circle: errors of smooth functions fall faster than
    any power of ``n``.
    """
    if dimension == 1:
        # even functions: one end of the segment represents both
        return np.ones((1, 1)), np.array([2.0])
    if dimension == 2:
        phi = np.pi * (np.arange(n) + 0.5) / n
        return np.column_stack([np.cos(phi), np.sin(phi)]), np.full(n, 2 * np.pi / n)
    # slices of a sphere weigh (1 - z^2)^((d - 3) / 2), for which these rules are made
    z, weight = roots_gegenbauer(n, (dimension - 2) / 2)
    u, inner = sphere_rule(dimension - 1, n)
    heights = np.broadcast_to(z[:, None, None], (n, len(u), 1))
    points = np.concatenate([np.sqrt(1 - z**2)[:, None, None] * u, heights], axis=2)
    return points.reshape(-1, dimension), (weight[:, None] * inner).ravel()


@lru_cache(maxsize=32)
def half_sphere_monomials(dimension: int, count: int) -> FloatArray:
    """Quartic monomials at `directions`, ``(count, k)``."""
    return monomials(directions(dimension, count), exponents(dimension, 4))


@lru_cache(maxsize=32)
def _rule_monomials(dimension: int, n: int) -> FloatArray:
    return monomials(sphere_rule(dimension, n)[0], exponents(dimension, 4))


def quartic_volume(coefficients: FloatArray, dimension: int) -> float:
    """Volume ``1/d int P(u)^(-d / 4) du`` over the unit sphere, for a closed body, round within a factor of a few.

    Rules of growing order are tried until two agree, to 1e-12 in up to three dimensions and to 1e-6 beyond; `FitError`
    if they never agree to 1e-8 (1e-3).
    """
    # beyond three dimensions a rule of order n has some n^(d - 1) points, so fewer digits must do
    orders: tuple[int, ...] = (10, 14, 20, 28, 40, 56, 80, 112, 160)
    aim, limit = 1e-12, 1e-8
    if dimension > 3:
        orders, aim, limit = ((4, 6, 8, 10, 12), 1e-6, 1e-3)
    last, change = math.nan, math.nan
    for n in orders:
        u, weight = sphere_rule(dimension, n)
        M = _rule_monomials(dimension, n) if dimension <= 3 else monomials(u, exponents(dimension, 4))
        P = M @ coefficients
        # Roots are several times as fast as a power.
        V = float(weight @ (1 / np.sqrt(P * np.sqrt(P)) if dimension == 3 else P ** (-dimension / 4))) / dimension
        last, change = V, abs(V - last) / V
        if change <= aim:
            return V
    if change <= limit:
        return last
    raise FitError(f"the volume still changes by {change:.1e} of itself at order {orders[-1]}: the body is too uneven")


def round_frame(value: Callable[[FloatArray], FloatArray], dimension: int, degree: int) -> FloatArray:
    """Map ``L (d, d)`` from a body that is nearly round onto a closed one, ``P <= 1``, by its surface's moments."""
    u = directions(dimension, 40 * dimension**2)
    L = np.eye(dimension)
    # one pass does for bodies that are nearly round, long ones take several; 0.3 is round enough for the rules
    for _ in range(40):
        Y = u * (value(u @ L.T) ** (-1 / degree))[:, None]
        # the second moments of a unit sphere are 1 / d: times d they are the identity
        C = np.linalg.cholesky(dimension * (Y.T @ Y) / len(u))
        if abs(C - np.eye(dimension)).max() < 0.3:
            break
        L = L @ C
    return L


def quartic_shadow(coefficients: FloatArray, reach: FloatArray) -> float:
    """Area of the shadow of a closed quartic body in 3-D on the first two components.

    The shadow of a convex body is the level set of ``min over tau of P(x, y, tau)``, whose area is a periodic integral:
    equal steps converge fastest. ``reach (3,)``, about that along the axes, divides the variables. `FitError`: the area
    is not found to 1e-9.
    """
    c = coefficients * np.prod(reach ** exponents(3, 4), axis=1)
    area, change, n = 0.0, math.inf, 16
    # equal steps converge exponentially for a smooth outline, so two that agree are both right
    while change > 1e-13 * area and n < 4096:
        n, last = 2 * n, area
        # half a turn represents the whole, which cancels the half of 1/2 int r^2; r^2 is 1 / sqrt(P)
        area = np.pi / n * float((1.0 / np.sqrt(_floors(c, _plane_monomials(n)))).sum())
        change = abs(area - last)
    if not change <= 1e-9 * area:
        raise FitError(f"the area of the shadow still changes by {change / area:.1e} of itself: the body is too uneven")
    return area * float(reach[0] * reach[1])


def _floors(c: FloatArray, M: FloatArray) -> FloatArray:
    """``min over tau of P(x, y, tau)`` of a convex quartic for its monomials ``M (n, 15)`` at tau 1, ``(n,)``.

    The derivative along tau is a cubic, ``s^3 + p s + q = 0`` for ``tau = s - a_3 / (4 a_4)``; as the quartic is convex
    ``p`` is not negative but for rounding, and there is one root.
    """
    a = (M * c) @ (exponents(3, 4)[:, 2:] == np.arange(5)).astype(float)
    shift = a[:, 3] / (4 * a[:, 4])
    p = np.maximum(a[:, 2] / (2 * a[:, 4]) - 3 * shift**2, 0)
    q = 2 * shift**3 - a[:, 2] * shift / (2 * a[:, 4]) + a[:, 1] / (4 * a[:, 4])
    # with |q| both terms add and no digits cancel; the sign of the root comes below
    u = np.cbrt(np.abs(q) / 2 + np.sqrt(q**2 / 4 + p**3 / 27))
    tau = -shift - np.sign(q) * (u - p / np.maximum(3 * u, 1e-300))
    return np.asarray(np.polynomial.polynomial.polyval(tau, a.T, tensor=False))


@lru_cache
def _plane_monomials(n: int) -> FloatArray:
    """Quartic monomials of ``(cos phi, sin phi, 1)`` at ``n`` steps of half a turn, ``(n, 15)``."""
    phi = np.pi * np.arange(n) / n
    return monomials(np.column_stack([np.cos(phi), np.sin(phi), np.ones(n)]), exponents(3, 4)).copy()
