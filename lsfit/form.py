"""Homogeneous polynomials in any number of variables: their monomials and the derivatives of these."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@lru_cache
def exponents(dimension: int, degree: int) -> IntArray:
    """Exponents of all monomials of one degree, ``(k, d)``, ``k = (d + degree - 1 choose degree)``.

    Examples
    --------
    >>> exponents(2, 2).tolist()
    [[2, 0], [1, 1], [0, 2]]
    """
    E = np.zeros((math.comb(dimension + degree - 1, degree), dimension), dtype=np.int64)
    for row, variables in zip(E, combinations_with_replacement(range(dimension), degree), strict=True):
        # a variable may occur several times, which plain indexed addition would count once
        np.add.at(row, list(variables), 1)
    # cached: whoever wrote to it would change every later result
    E.flags.writeable = False
    return E


def places(dimension: int, degree: int) -> dict[tuple[int, ...], int]:
    """Position of every row of `exponents`."""
    return {tuple(row): n for n, row in enumerate(exponents(dimension, degree).tolist())}


def monomials(w: ArrayLike, E: IntArray) -> FloatArray:
    """Monomials ``w^E``, ``(m, d), (k, d) -> (m, k)``."""
    # numba compiles a version of its own for every memory layout
    W = np.ascontiguousarray(np.atleast_2d(np.asarray(w, float)))
    # one row per monomial, so that the products run along contiguous memory
    out = np.empty((len(E), len(W)))
    fill_monomials(W, E, out)
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


@njit(cache=True)
def fill_monomials(w, E, out):  # pragma: no cover - compiled
    """Write the monomials ``w^E``, ``(m, d), (k, d) -> out (k, m)``."""
    power = powers(w, E)
    for j in range(len(E)):
        out[j] = power[0, E[j, 0]]
        for i in range(1, w.shape[1]):
            out[j] *= power[i, E[j, i]]


@njit(cache=True)
def powers(w, E):  # pragma: no cover - compiled
    """Powers of the components ``(d, degree + 1, m)``."""
    m, d = w.shape
    power = np.empty((d, 1 + (E.max() if E.size else 0), m))
    for i in range(d):
        power[i, 0] = 1.0
        for e in range(1, power.shape[1]):
            for n in range(m):
                power[i, e, n] = power[i, e - 1, n] * w[n, i]
    return power
