"""Quartics as limit surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsfit.form import derivative, exponents, monomials
from lsfit.surface import FitFlag, LevelSet, rows

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Quartic(LevelSet):
    """Level set ``P(w) = sum_k c_k w^E_k = 1`` of a homogeneous polynomial of degree 4.

    Parameters
    ----------
    coefficients : (k,) array
        ``c``, one for each monomial.
    exponents : (k, d) array
        ``E``, each row with the sum 4.
    flag : FitFlag
        What the reader should know.
    """

    coefficients: FloatArray
    exponents: NDArray[np.int64]
    flag: FitFlag = FitFlag.CLEAN
    degree = 4

    @property
    def dimension(self) -> int:  # type: ignore[override]
        """Number of components of a wrench."""
        return self.exponents.shape[1]

    @property
    def rank(self) -> int:
        """Dimension of the body."""
        return self.dimension

    @property
    def span(self) -> FloatArray:
        """Orthonormal directions ``(d, rank)`` in which the body extends: all."""
        return np.eye(self.dimension)

    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, d) -> (m,)``."""
        return monomials(rows(w, self.dimension), self.exponents) @ self.coefficients

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient of ``P``, ``(m, d) -> (m, d)``."""
        cubic = monomials(rows(w, self.dimension), exponents(self.dimension, 3))
        return cubic @ (derivative(self.dimension, 4) @ self.coefficients).T

    def hessian(self, w: ArrayLike) -> FloatArray:
        """Second derivatives of ``P``, ``(m, d) -> (m, d, d)``."""
        D3, D4 = derivative(self.dimension, 3), derivative(self.dimension, 4)
        square = monomials(rows(w, self.dimension), exponents(self.dimension, 2))
        return np.einsum("mk,ijk->mij", square, np.einsum("ikl,jl->ijk", D3, D4 @ self.coefficients))
