"""What every limit surface offers, surfaces placed by a linear map, and what can be wrong with a fit."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntFlag
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


class FitError(ArithmeticError):
    """A fit, or a measure of a fitted body, that could not be completed."""


class FitFlag(IntFlag):
    """What the reader of a fitted limit surface should know; flags add up."""

    CLEAN = 0
    RANK_DEFICIENT = 1  # the samples lie in a subspace: the body is flat and carries no load out of it
    UNDERDETERMINED = 2  # fewer independent data than coefficients: of equally good fits the nearest to an ellipsoid
    BOUNDED = 4  # the data alone would give an endless body: its reach was limited to a multiple of the data's
    THIN = 8  # the samples are a thousand times shorter along one direction: rho does not suit the contact


ZERO_SHARE = 1e-12  # of the largest number of its kind: what is smaller is the rounding of zero
OUT_OF_SPAN = 1e-9  # of a wrench: the part across a flat body from which the body does not carry it


class LimitSurface(ABC):
    """Level set ``P(w) = 1`` of a positive homogeneous function, symmetric about the origin, in ``d`` dimensions."""

    flag: FitFlag

    @property
    @abstractmethod
    def degree(self) -> int:
        """Degree of ``P``."""

    @property
    @abstractmethod
    def dimension(self) -> int:
        """Number of components ``d`` of a wrench."""

    @property
    def span(self) -> FloatArray:
        """Orthonormal directions ``(d, rank)`` in which the body extends; all of them unless it is flat."""
        return np.eye(self.dimension)

    @property
    def rank(self) -> int:
        """Dimension of the body; less than `dimension` if it is flat."""
        return self.span.shape[1]

    @property
    @abstractmethod
    def volume(self) -> float:
        """Volume of the body; 0 if it is flat."""

    @property
    @abstractmethod
    def shadow_area(self) -> float:
        """Area of the body's shadow on the plane of the first two components."""

    @cached_property
    def semi_axes(self) -> FloatArray:
        """Largest reach ``(d,)`` along each component."""
        return self.support(np.eye(self.dimension))

    @abstractmethod
    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, d) -> (m,)``; infinite where a flat body does not extend."""

    @abstractmethod
    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient of ``P``, the direction of motion, ``(m, d) -> (m, d)``; within the span of a flat body."""

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, d) -> (m,)``."""
        T = rows(t, self.dimension)
        return (T * self.support_points(T)).sum(axis=1)

    @abstractmethod
    def support_points(self, t: ArrayLike) -> FloatArray:
        """Points of the surface farthest along ``t``, ``(m, d) -> (m, d)``; 0 for ``t = 0``."""

    @abstractmethod
    def scaled(self, factors: ArrayLike) -> LimitSurface:
        """Image of the body under ``w -> factors * w``, for other units, ``(d,)``, factors not zero."""

    def radius(self, u: ArrayLike) -> FloatArray:
        """Factor that brings ``u`` onto the surface, ``P(u)^(-1 / degree)``, ``(m, d) -> (m,)``."""
        with np.errstate(divide="ignore"):
            return self.value(u) ** (-1 / self.degree)

    def holds(self, w: ArrayLike) -> NDArray[np.bool_]:
        """Whether wrenches lie in the body, surface included, ``(m, d) -> (m,)``."""
        # a relative error of the wrench is `degree` times as large in P
        return self.value(w) <= 1 + self.degree * ZERO_SHARE


def mapped_value(P: FloatArray, Y: FloatArray, B: FloatArray, W: FloatArray) -> FloatArray:
    """Values ``P (m,)`` at ``y``, made infinite where ``w`` is not ``B y``: across a flat body."""
    if B.shape[1] < B.shape[0]:
        P[np.linalg.norm(W - Y @ B.T, axis=1) > OUT_OF_SPAN * np.linalg.norm(W, axis=1)] = np.inf
    return P


def rows(w: ArrayLike, dimension: int) -> FloatArray:
    """Vectors as the rows of a matrix ``(m, d)``; one vector is a matrix of one row."""
    W = np.atleast_2d(np.asarray(w, float))
    if W.ndim != 2 or W.shape[1] != dimension:
        raise ValueError(f"vectors of shape {np.shape(w)}: expected ({dimension},) or (m, {dimension})")
    return W


def supported_shadow(support: Callable[[FloatArray], FloatArray], dimension: int, n: int = 1024) -> float:
    """Area of a body's shadow on its first two components, ``1/2 int (h^2 - h'^2) dphi``.

    ``support`` takes vectors ``(m, d)``; ``h`` are its values at ``n`` equal steps of the full turn, an even number.
    """
    t, phi = np.zeros((n, dimension)), 2 * np.pi * np.arange(n) / n
    t[:, 0], t[:, 1] = np.cos(phi), np.sin(phi)
    c = np.fft.rfft(support(t)) / n
    order = np.arange(len(c))
    # the transform leaves out the conjugate half, which the first and the last order do not have
    twice = np.where((order == 0) | (2 * order == n), 1.0, 2.0)
    # by Parseval h^2 - h'^2 becomes a factor 1 - k^2, without a difference quotient
    return float(np.pi * (twice * (1 - order**2) * np.abs(c) ** 2).sum())


@dataclass(frozen=True, eq=False)
class Image(LimitSurface):
    """The surface ``{B y : P(y) = 1}`` of another one of full rank, ``inner``; flat if ``B (d, r)`` has ``r < d``.

    The columns of ``B`` are independent.
    """

    inner: LimitSurface
    B: FloatArray
    flag: FitFlag = FitFlag.CLEAN

    @property
    def degree(self) -> int:
        """Degree of ``P``."""
        return self.inner.degree

    @property
    def dimension(self) -> int:
        """Number of components of a wrench."""
        return len(self.B)

    @property
    def span(self) -> FloatArray:
        """Orthonormal directions ``(d, rank)`` in which the body extends."""
        return np.linalg.qr(self.B)[0]

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
            # the shadow of a plane body is its linear image
            return abs(float(np.linalg.det(self.B[:2]))) * self.inner.volume
        return supported_shadow(self.support, self.dimension)

    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, d) -> (m,)``; infinite where the body does not extend."""
        W = rows(w, self.dimension)
        Y = self._inner(W)
        return mapped_value(self.inner.value(Y), Y, self.B, W)

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient of ``P`` within the span, ``(m, d) -> (m, d)``."""
        return self.inner.gradient(self._inner(rows(w, self.dimension))) @ np.linalg.pinv(self.B)

    def support_points(self, t: ArrayLike) -> FloatArray:
        """Points of the surface farthest along ``t``, ``(m, d) -> (m, d)``."""
        return self.inner.support_points(rows(t, self.dimension) @ self.B) @ self.B.T

    def scaled(self, factors: ArrayLike) -> Image:
        """Image of the body under ``w -> factors * w``, ``(d,)``, factors not zero."""
        return Image(self.inner, np.asarray(factors, float)[:, None] * self.B, self.flag)

    def _inner(self, W: FloatArray) -> FloatArray:
        return W @ np.linalg.pinv(self.B).T
