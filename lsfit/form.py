"""Homogeneous polynomials in any number of variables: their monomials and the derivatives of these."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.sums import fill_monomials

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
        np.add.at(row, list(variables), 1)
    E.flags.writeable = False
    return E


def monomials(w: ArrayLike, E: IntArray) -> FloatArray:
    """Monomials ``w^E``, ``(m, d), (k, d) -> (m, k)``."""
    W = np.ascontiguousarray(np.atleast_2d(np.asarray(w, float)))
    out = np.empty((len(E), len(W)))
    fill_monomials(W, E, out)
    return out.T


def monomial_gradients(w: ArrayLike, E: IntArray) -> FloatArray:
    """Gradients of the monomials, ``(m, d), (k, d) -> (m, k, d)``."""
    return np.stack([E[:, i] * monomials(w, _lower(E, i)) for i in range(E.shape[1])], axis=-1)


def monomial_hessians(w: ArrayLike, E: IntArray) -> FloatArray:
    """Second derivatives of the monomials, ``(m, d), (k, d) -> (m, k, d, d)``."""
    k, d = E.shape
    H = np.empty((len(np.atleast_2d(w)), k, d, d))
    for i in range(d):
        for j in range(i + 1):
            low = _lower(E, i)
            H[:, :, i, j] = H[:, :, j, i] = E[:, i] * low[:, j] * monomials(w, _lower(low, j))
    return H


@lru_cache
def derivative(dimension: int, degree: int) -> FloatArray:
    """Matrices of the partial derivatives, ``(d, k', k)``: ``d_i w^E = monomials(w, E') @ derivative[i]``.

    ``E'`` are the exponents of one degree less; a form with coefficients ``c`` has the partial derivative
    ``monomials(w, E') @ (derivative[i] @ c)``.
    """
    E = exponents(dimension, degree)
    place = {tuple(row): n for n, row in enumerate(exponents(dimension, degree - 1).tolist())}
    D = np.zeros((dimension, len(place), len(E)))
    for n, row in enumerate(E):
        for i in np.flatnonzero(row):
            D[i, place[tuple(row - np.eye(dimension, dtype=int)[i])], n] = row[i]
    D.flags.writeable = False
    return D


def substitute(coefficients: ArrayLike, E: IntArray, L: ArrayLike) -> FloatArray:
    """Coefficients of ``w -> P(L w)`` for the form ``P`` with these coefficients; ``E`` holds all of one degree.

    The forms agree on a fixed set of points, more of them than coefficients; so the result is exact but for rounding,
    which grows with the spread of the columns of ``L``.
    """
    points, inverse = _interpolation(E.shape[1], int(E[0].sum()))
    return inverse @ (monomials(points @ np.asarray(L, float).T, E) @ np.asarray(coefficients, float))


@lru_cache
def _tensor_places(dimension: int) -> tuple[IntArray, FloatArray]:
    place = {tuple(row): n for n, row in enumerate(exponents(dimension, 4).tolist())}
    index = np.array(list(np.ndindex((dimension,) * 4)))
    count = (index[:, :, None] == np.arange(dimension)).sum(axis=1)
    orders = [24 / math.prod(map(math.factorial, row)) for row in count.tolist()]
    return np.array([place[tuple(row)] for row in count.tolist()]), 12 / np.array(orders)


def hessian_tensor(coefficients: ArrayLike, dimension: int) -> FloatArray:
    """Symmetric ``Q (d, d, d, d)`` of a quartic, whose second derivative is ``H_ij(w) = Q_ijkl w_k w_l``.

    Coefficients in the order of ``exponents(dimension, 4)``.
    """
    place, factor = _tensor_places(dimension)
    return (np.asarray(coefficients, float)[place] * factor).reshape((dimension,) * 4)


@lru_cache
def _interpolation(dimension: int, degree: int) -> tuple[FloatArray, FloatArray]:
    E = exponents(dimension, degree)
    points = np.random.default_rng(len(E)).normal(size=(3 * len(E), dimension))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points, np.linalg.pinv(monomials(points, E))


def _lower(E: IntArray, i: int) -> IntArray:
    low = E.copy()
    low[:, i] = np.maximum(low[:, i] - 1, 0)
    return low
