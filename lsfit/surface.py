"""What every limit surface offers, and surfaces placed by a linear map: flat ones among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.flag import FitError, FitFlag
from softjaw.lsfit.geometry import supported_shadow

__all__ = ["FitError", "FitFlag", "Image", "LevelSet", "LimitSurface"]

FloatArray = NDArray[np.float64]
ON_THE_SURFACE = 1e-12  # relative; what rounding may add to P on the surface itself
OUT_OF_SPAN = 1e-9  # of a wrench: the part across a flat body from which the body does not carry it


class LimitSurface(Protocol):
    """Level set ``P(w) = 1`` of a positive homogeneous function, symmetric about the origin, in ``d`` dimensions."""

    @property
    def flag(self) -> FitFlag:
        """What the reader of a fit should know."""

    @property
    def degree(self) -> int:
        """Degree of ``P``."""

    @property
    def dimension(self) -> int:
        """Number of components ``d`` of a wrench."""

    @property
    def rank(self) -> int:
        """Dimension of the body; less than `dimension` if it is flat."""

    @property
    def span(self) -> FloatArray:
        """Orthonormal directions ``(d, rank)`` in which the body extends."""

    @property
    def volume(self) -> float:
        """Volume of the body; 0 if it is flat."""

    @property
    def shadow_area(self) -> float:
        """Area of the body's shadow on the plane of the first two components."""

    @property
    def semi_axes(self) -> FloatArray:
        """Largest reach ``(d,)`` along each component."""

    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, d) -> (m,)``; infinite where a flat body does not extend."""

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient of ``P``, the direction of motion, ``(m, d) -> (m, d)``; within the span of a flat body."""

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, d) -> (m,)``."""

    def radius(self, u: ArrayLike) -> FloatArray:
        """Factor that brings ``u`` onto the surface, ``P(u)^(-1 / degree)``, ``(m, d) -> (m,)``."""

    def holds(self, w: ArrayLike) -> NDArray[np.bool_]:
        """Whether wrenches lie in the body, surface included, ``(m, d) -> (m,)``."""

    def scaled(self, factors: ArrayLike) -> LimitSurface:
        """Image of the body under ``w -> factors * w``, for other units, ``(d,)``."""


def rows(w: ArrayLike, dimension: int) -> FloatArray:
    """Vectors as the rows of a matrix ``(m, d)``; one vector is a matrix of one row."""
    W = np.atleast_2d(np.asarray(w, float))
    if W.ndim != 2 or W.shape[1] != dimension:
        raise ValueError(f"vectors of shape {np.shape(w)}: expected ({dimension},) or (m, {dimension})")
    return W


def checked_factors(factors: ArrayLike, dimension: int) -> FloatArray:
    """Factors of a change of units, ``(d,)``, refused if they do not keep the body's rank."""
    f = np.asarray(factors, float)
    if f.shape != (dimension,) or not np.isfinite(f).all() or (f == 0).any():
        raise ValueError(f"factors is {f.tolist()}: expected {dimension} finite numbers, none of them zero")
    return f


class LevelSet:
    """What follows from ``value``, ``support`` and ``degree`` alike for every surface."""

    degree: int
    dimension: int

    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, d) -> (m,)``."""
        raise NotImplementedError

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, d) -> (m,)``."""
        raise NotImplementedError

    def radius(self, u: ArrayLike) -> FloatArray:
        """Factor that brings ``u`` onto the surface, ``P(u)^(-1 / degree)``, ``(m, d) -> (m,)``."""
        with np.errstate(divide="ignore"):
            return self.value(u) ** (-1 / self.degree)

    def holds(self, w: ArrayLike) -> NDArray[np.bool_]:
        """Whether wrenches lie in the body, surface included, ``(m, d) -> (m,)``."""
        return self.value(w) <= 1 + self.degree * ON_THE_SURFACE


@dataclass(frozen=True, eq=False)
class Image(LevelSet):
    """The surface ``{B y : P(y) = 1}`` of another one; flat if ``B`` has fewer columns than rows.

    Parameters
    ----------
    inner : LimitSurface
        Surface in ``r`` dimensions, of full rank.
    B : (d, r) array
        Linear map with independent columns.
    flag : FitFlag
        What the reader should know.
    """

    inner: LimitSurface
    B: FloatArray
    flag: FitFlag = FitFlag.CLEAN

    def __post_init__(self) -> None:
        """Refuse a map that does not fit the surface, or that flattens it further."""
        B = np.array(self.B, float)
        if B.ndim != 2 or B.shape[1] != self.inner.dimension or not np.isfinite(B).all():
            raise ValueError(f"B has shape {B.shape}: expected finite numbers (d, {self.inner.dimension})")
        if np.linalg.matrix_rank(B / np.abs(B).max(axis=0), 1e-13) < B.shape[1]:
            raise ValueError("the columns of B depend on each other: give a map onto the body's own span")
        B.flags.writeable = False
        object.__setattr__(self, "B", B)

    @property
    def degree(self) -> int:  # type: ignore[override]
        """Degree of ``P``."""
        return self.inner.degree

    @property
    def dimension(self) -> int:  # type: ignore[override]
        """Number of components of a wrench."""
        return len(self.B)

    @property
    def rank(self) -> int:
        """Dimension of the body."""
        return self.B.shape[1]

    @property
    def span(self) -> FloatArray:
        """Orthonormal directions ``(d, rank)`` in which the body extends."""
        return np.linalg.qr(self.B)[0]

    @property
    def semi_axes(self) -> FloatArray:
        """Largest reach ``(d,)`` along each component."""
        return self.support(np.eye(self.dimension))

    @property
    def volume(self) -> float:
        """Volume of the body; 0 if it is flat."""
        return abs(float(np.linalg.det(self.B))) * self.inner.volume if self.rank == self.dimension else 0.0

    @property
    def shadow_area(self) -> float:
        """Area of the shadow on the first two components."""
        if self.rank == 1:
            return 0.0
        if self.rank == 2:
            return abs(float(np.linalg.det(self.B[:2]))) * self.inner.volume
        return supported_shadow(self.support, self.dimension)

    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, d) -> (m,)``; infinite where the body does not extend."""
        W = rows(w, self.dimension)
        Y = self._inner(W)
        P = self.inner.value(Y)
        if self.rank < self.dimension:
            P[np.linalg.norm(W - Y @ self.B.T, axis=1) > OUT_OF_SPAN * np.linalg.norm(W, axis=1)] = np.inf
        return P

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient of ``P`` within the span, ``(m, d) -> (m, d)``."""
        return self.inner.gradient(self._inner(rows(w, self.dimension))) @ np.linalg.pinv(self.B)

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, d) -> (m,)``."""
        return self.inner.support(rows(t, self.dimension) @ self.B)

    def scaled(self, factors: ArrayLike) -> Image:
        """Image of the body under ``w -> factors * w``, ``(d,)``, factors not zero."""
        return Image(self.inner, checked_factors(factors, self.dimension)[:, None] * self.B, self.flag)

    def _inner(self, W: FloatArray) -> FloatArray:
        return W @ np.linalg.pinv(self.B).T
