"""Ellipsoids in any position, as limit surfaces."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.flag import FitFlag
from softjaw.lsfit.surface import OUT_OF_SPAN, LevelSet, checked_factors, rows

FloatArray = NDArray[np.float64]

DEFINITE = 1e-12
"""Smallest eigenvalue of a positive definite matrix once its diagonal is 1; rounding makes up to some 1e-15 of 0."""


@dataclass(frozen=True, eq=False)
class TiltedEllipsoid(LevelSet):
    """Ellipsoid ``P(w) = w' A w <= 1`` in any number of dimensions.

    Parameters
    ----------
    A : (d, d) array
        Symmetric and positive definite, to a margin of `DEFINITE`; for a flat ellipsoid the pseudo-inverse of ``F F'``.
    F : (d, r) array, optional
        Image of the unit ball: the body is ``{F y : |y| <= 1}``. Needed only for a flat ellipsoid, ``r < d``.
    flag : FitFlag
        What the reader should know.

    Examples
    --------
    >>> TiltedEllipsoid([[1.0, 0.0], [0.0, 4.0]]).semi_axes
    array([1. , 0.5])
    """

    A: FloatArray
    F: FloatArray | None = None
    flag: FitFlag = FitFlag.CLEAN
    inverse: FloatArray = field(init=False, repr=False)
    degree = 2

    def __post_init__(self) -> None:
        """Refuse what is no ellipsoid."""
        A = np.array(self.A, float)
        if A.ndim != 2 or A.shape[0] != A.shape[1] or not np.isfinite(A).all():
            raise ValueError(f"A has shape {A.shape}: expected finite numbers in a square matrix")
        if abs(A - A.T).max() > 1e-9 * abs(A).max():
            raise ValueError("A is not symmetric: give (A + A') / 2, which has the same quadratic form")
        F = _ball_map(A) if self.F is None else np.array(self.F, float)
        inverse = _inverse(F)
        for name, array in (("A", (A + A.T) / 2), ("F", F), ("inverse", inverse)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def of_ball(cls, F: ArrayLike, flag: FitFlag = FitFlag.CLEAN) -> TiltedEllipsoid:
        """Image ``{F y : |y| <= 1}`` of the unit ball, ``F (d, r)`` with independent columns; flat if ``r < d``."""
        inverse = _inverse(np.asarray(F, float))
        return cls(inverse.T @ inverse, np.asarray(F, float), flag)

    @property
    def dimension(self) -> int:  # type: ignore[override]
        """Number of components of a wrench."""
        return len(self.A)

    @property
    def rank(self) -> int:
        """Dimension of the body."""
        return self._map.shape[1]

    @property
    def span(self) -> FloatArray:
        """Orthonormal directions ``(d, rank)`` in which the body extends."""
        return np.linalg.qr(self._map)[0]

    @property
    def semi_axes(self) -> FloatArray:
        """Largest reach ``(d,)`` along each component."""
        return self.support(np.eye(self.dimension))

    @property
    def volume(self) -> float:
        """Volume of the body; 0 if it is flat."""
        if self.rank < self.dimension:
            return 0.0
        ball = math.pi ** (self.dimension / 2) / math.gamma(self.dimension / 2 + 1)
        return ball * abs(float(np.linalg.det(self._map)))

    @property
    def shadow_area(self) -> float:
        """Area of the shadow on the plane of the first two components."""
        s = np.linalg.svd(self._map[:2], compute_uv=False)
        return math.pi * float(s[0] * s[1]) if len(s) > 1 else 0.0

    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, d) -> (m,)``; infinite where a flat body does not extend."""
        W = rows(w, self.dimension)
        Y = W @ self.inverse.T
        P = (Y**2).sum(axis=1)
        if self.rank < self.dimension:
            away = np.linalg.norm(W - Y @ self._map.T, axis=1)
            P[away > OUT_OF_SPAN * np.linalg.norm(W, axis=1)] = np.inf
        return P

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient ``2 A w``, the direction of motion, ``(m, d) -> (m, d)``."""
        return 2 * rows(w, self.dimension) @ self.inverse.T @ self.inverse

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, d) -> (m,)``."""
        return np.linalg.norm(rows(t, self.dimension) @ self._map, axis=1)

    def scaled(self, factors: ArrayLike) -> TiltedEllipsoid:
        """Image of the body under ``w -> factors * w``, ``(d,)``, factors not zero."""
        return TiltedEllipsoid.of_ball(checked_factors(factors, self.dimension)[:, None] * self._map, self.flag)

    @property
    def _map(self) -> FloatArray:
        F = self.F
        assert F is not None  # __post_init__ filled it in
        return F


def _inverse(F: FloatArray) -> FloatArray:
    return np.linalg.inv(F) if F.shape[0] == F.shape[1] else np.linalg.pinv(F)


def _ball_map(A: FloatArray) -> FloatArray:
    # Axes of very different length keep their digits if they are made equal first.
    diagonal = A.diagonal()
    if (diagonal <= 0).any():
        raise ValueError(f"A has the diagonal {diagonal.tolist()}: an ellipsoid needs a positive definite matrix")
    size = 1 / np.sqrt(diagonal)
    even = A * np.outer(size, size)
    lowest = float(np.linalg.eigvalsh(even)[0])
    if lowest < -DEFINITE:
        raise ValueError(
            f"A has the eigenvalues {np.linalg.eigvalsh(A).tolist()}: an ellipsoid needs them all positive"
        )
    if lowest < DEFINITE:
        raise ValueError(
            f"A has the eigenvalue {lowest:.1e} once its diagonal is 1, less than rounding can tell from zero: whether "
            "the ellipsoid is closed is undecided; give its semi-axes (TiltedEllipsoid.of_ball)"
        )
    return size[:, None] * np.linalg.inv(np.linalg.cholesky(even)).T
