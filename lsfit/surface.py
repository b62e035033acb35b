"""What every limit surface offers, and what can be wrong with a fit."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from enum import IntFlag
from functools import cached_property
from typing import Self

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
PLANES = ((0, 1), (0, 2), (1, 2))  # of two of three components
OUT_OF_SPAN = 1e-9  # of a wrench: the part across a flat body from which the body does not carry it


class LimitSurface(ABC):
    """Set ``{B y : P(y) <= 1}`` of a homogeneous, even ``P``; flat where the map ``B (d, r)`` leaves out directions."""

    B: FloatArray
    flag: FitFlag
    degree: int

    @property
    def dimension(self) -> int:
        """Number of components ``d`` of a wrench."""
        return len(self.B)

    @property
    def rank(self) -> int:
        """Dimension of the body; less than `dimension` if it is flat."""
        return self.B.shape[1]

    @property
    def span(self) -> FloatArray:
        """Orthonormal directions ``(d, rank)`` in which the body extends."""
        return np.linalg.qr(self.B)[0]

    @cached_property
    def inverse(self) -> FloatArray:
        """Map ``(r, d)`` from the body back onto ``P(y) <= 1``."""
        return np.linalg.inv(self.B) if self.rank == self.dimension else np.linalg.pinv(self.B)

    @cached_property
    def volume(self) -> float:
        """Volume of the body; 0 if it is flat."""
        return abs(float(np.linalg.det(self.B))) * self._volume if self.rank == self.dimension else 0.0

    @property
    @abstractmethod
    def shadow_area(self) -> float:
        """Area of the body's shadow on the plane of the first two components."""

    @cached_property
    def semi_axes(self) -> FloatArray:
        """Largest reach ``(d,)`` along each component."""
        return self.support(np.eye(self.dimension))

    def value(self, w: ArrayLike) -> FloatArray:
        """``P``, ``(m, d) -> (m,)``; infinite where a flat body does not extend."""
        W = rows(w, self.dimension)
        Y = W @ self.inverse.T
        P = self._value(Y)
        if self.rank < self.dimension:
            P[np.linalg.norm(W - Y @ self.B.T, axis=1) > OUT_OF_SPAN * np.linalg.norm(W, axis=1)] = np.inf
        return P

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient of ``P``, the direction of motion, ``(m, d) -> (m, d)``; within the span of a flat body."""
        return self._gradient(rows(w, self.dimension) @ self.inverse.T) @ self.inverse

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, d) -> (m,)``."""
        T = rows(t, self.dimension)
        return (T * self.support_points(T)).sum(axis=1)

    def support_points(self, t: ArrayLike) -> FloatArray:
        """Points of the surface farthest along ``t``, ``(m, d) -> (m, d)``; 0 for ``t = 0``."""
        return self._farthest(rows(t, self.dimension) @ self.B) @ self.B.T

    def scaled(self, factors: ArrayLike) -> Self:
        """Image of the body under ``w -> factors * w``, for other units, ``(d,)``, factors not zero."""
        return self.mapped(np.diag(np.asarray(factors, float)))

    def mapped(self, A: FloatArray, flag: FitFlag = FitFlag.CLEAN) -> Self:
        """Image of the body under ``w -> A w``, with another flag added."""
        # every surface is a dataclass, which its common base does not say
        return replace(self, B=A @ self.B, flag=self.flag | flag)  # type: ignore[type-var]

    def radius(self, u: ArrayLike) -> FloatArray:
        """Factor that brings ``u`` onto the surface, ``P(u)^(-1 / degree)``, ``(m, d) -> (m,)``."""
        with np.errstate(divide="ignore"):
            return self.value(u) ** (-1 / self.degree)

    def holds(self, w: ArrayLike) -> NDArray[np.bool_]:
        """Whether wrenches lie in the body, surface included, ``(m, d) -> (m,)``."""
        # a relative error of the wrench is `degree` times as large in P
        return self.value(w) <= 1 + self.degree * ZERO_SHARE

    # of the body in coordinates y

    @property
    @abstractmethod
    def _volume(self) -> float: ...

    @abstractmethod
    def _value(self, Y: FloatArray) -> FloatArray: ...

    @abstractmethod
    def _gradient(self, Y: FloatArray) -> FloatArray: ...

    @abstractmethod
    def _farthest(self, T: FloatArray) -> FloatArray: ...


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
    c = np.fft.rfft(support(circle(0, 1, n, dimension))) / n
    order = np.arange(len(c))
    # the transform leaves out the conjugate half, which the first and the last order do not have
    twice = np.where((order == 0) | (2 * order == n), 1.0, 2.0)
    # by Parseval h^2 - h'^2 becomes a factor 1 - k^2, without a difference quotient
    return float(np.pi * (twice * (1 - order**2) * np.abs(c) ** 2).sum())


def circle(i: int, j: int, count: int, dimension: int = 3) -> FloatArray:
    """Directions at equal steps of the full turn in the plane of two components, ``(count, dimension)``."""
    t, phi = np.zeros((count, dimension)), 2 * np.pi * np.arange(count) / count
    t[:, i], t[:, j] = np.cos(phi), np.sin(phi)
    return t


def shadow_outline(
    points: Callable[[FloatArray], FloatArray], i: int, j: int, count: int, rho: float = 1.0
) -> FloatArray:
    """Closed outline ``(count + 1, 2)`` of a body's shadow on the plane of two of three components.

    ``points`` gives those of the body farthest along directions ``(m, 3)``; ``rho`` is its length, torque over force.
    """
    outline = points(circle(i, j, count) / [1.0, 1.0, rho])[:, [i, j]]
    return np.vstack([outline, outline[:1]])
