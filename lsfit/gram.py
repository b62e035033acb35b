"""Gram matrices of sos-convex quartics in any number of dimensions.

A quartic form ``P`` is sos-convex when ``z' Hess P(w) z = (z x w)' Q (z x w)`` for some positive semidefinite ``Q`` of
size ``d^2`` with ``z x w`` the products ``z_i w_j``. The matrices ``Q`` of one ``P`` form an affine family: the fully
symmetric one, ``Q_(ij)(kl) = d^4 P / dw_i dw_j dw_k dw_l / 2``, plus one free number for every pair ``i < k`` and
``j < l``, because ``z_i w_j z_k w_l = z_i w_l z_k w_j``. Writing ``Q`` with these ``k + f`` unknowns satisfies all
``(d (d + 1) / 2)^2`` equalities by construction: 24 unknowns in three dimensions, 351 in six.

Reference: Ahmadi, Parrilo, "A convex polynomial that is not sos-convex", Mathematical Programming 135 (2012).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.special import factorial

from softjaw.lsfit.geometry import directions

FloatArray = NDArray[np.float64]


def gram_map(exponents: NDArray[np.int64]) -> csr_array:
    """Matrix ``A (d^4, k + f)`` with ``vec(Q) = A [v, free]`` for the coefficients ``v`` of a quartic form.

    Parameters
    ----------
    exponents : (k, d) int array
        Monomials of degree 4, in the order of the coefficients.
    """
    k, d = exponents.shape
    i, j, a, b = np.indices((d, d, d, d)).reshape(4, -1)
    unit = np.eye(d, dtype=int)
    e = unit[i] + unit[j] + unit[a] + unit[b]
    base = 5 ** np.arange(d)
    order = np.argsort(exponents @ base)
    column = order[np.searchsorted((exponents @ base)[order], e @ base)]
    free = (i != a) & (j != b)
    pair = np.zeros((d, d), dtype=int)
    upper = np.triu_indices(d, 1)
    pair[upper] = pair.T[upper] = np.arange(len(upper[0]))
    freedom = (k + pair[i, a] * len(upper[0]) + pair[j, b])[free]
    row = np.arange(d**4)
    value = np.concatenate([factorial(e).prod(axis=1) / 2, (np.sign(a - i) * np.sign(b - j))[free]])
    shape = (d**4, k + len(upper[0]) ** 2)
    return csr_array((value, (np.r_[row, row[free]], np.r_[column, freedom])), shape=shape)


def ball_gram(exponents: NDArray[np.int64]) -> FloatArray:
    """Unknowns ``[v, free]`` of ``P = |w|^4`` with a positive definite Gram matrix, ``(k + f,)``."""
    d = exponents.shape[1]
    even = (exponents % 2 == 0).all(axis=1)
    v = np.where(even, 2 / factorial(exponents // 2).prod(axis=1), 0.0)
    pairs = d * (d - 1) // 2
    # Half of what the symmetric choice puts on swapped pairs moves to the diagonal blocks, which makes it definite.
    return np.concatenate([v, 2 * np.eye(pairs).ravel()])


def quadratic_map(exponents: NDArray[np.int64]) -> csr_array:
    """Matrix ``A (d^2, k)`` with ``vec(M) = A v`` for the symmetric matrix ``M`` of a quadratic form."""
    k, d = exponents.shape
    number = np.zeros((d, d), dtype=int)
    for n, e in enumerate(exponents):
        i, j = np.repeat(np.arange(d), e)
        number[i, j] = number[j, i] = n
    value = np.where(np.eye(d, dtype=bool), 1.0, 0.5).ravel()
    return csr_array((value, (np.arange(d * d), number.ravel())), shape=(d * d, k))


def upper_triangle(A: csr_array) -> csr_array:
    """Rows of the upper triangle, column by column, the rest of it times ``sqrt 2``: the cone's order in Clarabel."""
    n = round(np.sqrt(A.shape[0]))
    column, row = np.tril_indices(n)
    return csr_array(diags_array(np.where(row == column, 1.0, np.sqrt(2))) @ A[row * n + column])


class GramCertificate(NamedTuple):
    """Proof that a quartic is convex: ``z' Hess P(w) z = (z x w)' Q (z x w)`` with ``Q`` positive semidefinite.

    Parameters
    ----------
    Q : (d^2, d^2) array
        Gram matrix in the coordinates of the fit.
    smallest, largest : float
        Its extreme eigenvalues.
    residual : float
        Largest difference between coefficients of the two sides, relative to ``largest``.
    smallest_curvature : float
        Smallest eigenvalue of the Hessian over sampled directions of the unit sphere, a check by other means.
    gap : float
        How far the objective may be from the smallest one, relative.
    """

    Q: FloatArray
    smallest: float
    largest: float
    residual: float
    smallest_curvature: float
    gap: float

    @property
    def proves_convexity(self) -> bool:
        """Whether ``smallest`` exceeds what rounding and the residual can take from any eigenvalue."""
        return self.smallest > len(self.Q) * (self.residual + 4 * np.finfo(float).eps) * self.largest


def gram_certificate(Q: FloatArray, tensor: FloatArray, gap: float) -> GramCertificate:
    """Certificate of a Gram matrix for the quartic with second derivatives ``H_ij = tensor_ijkl w_k w_l``."""
    d = len(tensor)
    # Only the sum over the swap of z_i and z_k reaches the form; for a symmetric Q it is symmetric in j and l too.
    form = Q.reshape(d, d, d, d)
    seen = (form + form.transpose(2, 1, 0, 3)).transpose(0, 2, 1, 3) / 2
    values = np.linalg.eigvalsh(Q)
    u = directions(d, 500)
    curvature = np.linalg.eigvalsh(np.einsum("ijkl,mk,ml->mij", tensor, u, u, optimize=True))
    residual = float(np.abs(seen - tensor).max() / np.abs(values).max())
    return GramCertificate(Q, float(values[0]), float(values[-1]), residual, float(curvature.min()), gap)
