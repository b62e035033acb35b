"""The exact limit surface, from its samples or from the friction that gives them; no model is fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

from lsfit.flag import FitFlag
from lsfit.geometry import directions, shadow_area
from lsfit.samples import checked_wrenches, sample_rank
from lsfit.surface import LevelSet, checked_factors, rows

__all__ = ["ExactSurface", "body_volume", "hull_volume", "shadow_area"]

FloatArray = NDArray[np.float64]


def hull_volume(W: ArrayLike) -> float:
    """Volume of the hull of the wrenches ``W (m, 3)`` and their opposites; 0 if they lie in a plane."""
    points = np.asarray(W, float)
    values = np.linalg.svd(points, compute_uv=False)
    if len(points) < 3 or values[2] <= 1e-12 * values[0]:
        return 0.0
    return float(ConvexHull(np.vstack([points, -points])).volume)


def body_volume(coarse: ArrayLike, fine: ArrayLike) -> float:
    """Volume of the limit surface, extrapolated from two sets of evenly spread samples.

    Hulls of samples lie inside the body and miss a volume in proportion to ``1 / m``.

    Parameters
    ----------
    coarse, fine : (m, 3) array
        Wrenches for Fibonacci motions, the second set larger than the first (2000 and 8000 leave some 3e-6).
    """
    gain = len(np.asarray(fine)) / len(np.asarray(coarse))
    if gain <= 1:
        raise ValueError(f"the fine set is {gain:.2f} times as large as the coarse one: it must be larger")
    V = hull_volume(fine)
    return V + (V - hull_volume(coarse)) / (gain - 1)


@dataclass(frozen=True, eq=False)
class ExactSurface(LevelSet):
    """Limit surface of a contact as friction gives it: every wrench is the one for its motion.

    The support of the body in the direction of a motion is the power ``w(t) . t`` of the wrench, exact to rounding.
    What needs the surface between motions (`value`, `gradient`, `holds`) takes the hull of ``count`` wrenches and their
    opposites, which lies inside and misses in proportion to ``1 / count``.

    Parameters
    ----------
    wrench : function
        Wrenches ``(m, 3)`` for motions ``(m, 3)`` of any length but zero, in one set of units.
    rho : float
        Length of the contact by which the motions of the samples are spread evenly; 1 for normalised wrenches.
    count : int
        Number of samples for hulls.
    flag : FitFlag
        What the reader should know.
    """

    wrench: Callable[[FloatArray], FloatArray]
    rho: float = 1.0
    count: int = 8000
    flag: FitFlag = FitFlag.CLEAN
    degree = 1
    dimension = 3

    def samples(self, count: int | None = None) -> FloatArray:
        """Wrenches for evenly spread motions of one sense of rotation, ``(count, 3)``."""
        return np.asarray(self.wrench(directions(3, count or self.count) / [1.0, 1.0, self.rho]), float)

    @cached_property
    def rank(self) -> int:
        """Dimension of the body."""
        return sample_rank(self._hull_samples / [1.0, 1.0, self.rho])

    @cached_property
    def span(self) -> FloatArray:
        """Orthonormal directions ``(3, rank)`` in which the body extends."""
        return np.linalg.svd(self._hull_samples)[2][: self.rank].T

    @cached_property
    def volume(self) -> float:
        """Volume of the body, extrapolated from hulls of ``count`` and a quarter as many samples."""
        return self._volumes[1]

    @property
    def volume_error(self) -> float:
        """Estimate of the error of `volume`: what the last refinement by four changed, over four."""
        return abs(self._volumes[1] - self._volumes[0]) / 4

    @cached_property
    def shadow_area(self) -> float:
        """Area of the shadow on the plane of the forces, from the supports of translations.

        The number of translations doubles until the area changes by less than 1e-12 of itself, up to 4096; kinks, as
        few faces with tilted normals have, leave some 1e-7.
        """
        area = last = np.inf
        for n in (64, 128, 256, 512, 1024, 2048, 4096):
            phi = 2 * np.pi * np.arange(n) / n
            last, area = area, shadow_area(self.support(np.column_stack([np.cos(phi), np.sin(phi), 0 * phi])))
            if abs(area - last) <= 1e-12 * area:
                break
        return area

    @property
    def semi_axes(self) -> FloatArray:
        """Largest reach ``(3,)`` along each component."""
        return self.support(np.eye(3))

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, 3) -> (m,)``; exact."""
        T = rows(t, 3)
        moving = T.any(axis=1)
        h = np.zeros(len(T))
        h[moving] = (np.asarray(self.wrench(T[moving])) * T[moving]).sum(axis=1)
        return h

    def value(self, w: ArrayLike) -> FloatArray:
        """Smallest factor of the sampled hull that holds ``w``, ``(m, 3) -> (m,)``; infinite out of a flat body."""
        return self._largest(w)[0]

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Direction of motion at ``w``: the normal of the face of the sampled hull over it, ``(m, 3) -> (m, 3)``."""
        return self._facets[self._largest(w)[1]]

    def scaled(self, factors: ArrayLike) -> ExactSurface:
        """Image of the body under ``w -> factors * w``, ``(3,)``, factors not zero."""
        f = checked_factors(factors, 3)
        force = float(np.sqrt(abs(f[0] * f[1])))
        return ExactSurface(
            lambda t: f * np.asarray(self.wrench(t * f)), self.rho * abs(float(f[2])) / force, self.count, self.flag
        )

    @cached_property
    def _hull_samples(self) -> FloatArray:
        return checked_wrenches(self.samples(), 3)

    @cached_property
    def _volumes(self) -> tuple[float, float]:
        if self.rank < 3:
            return 0.0, 0.0
        W = [self.samples(n) for n in (self.count // 16, self.count // 4)]
        return body_volume(*W), body_volume(W[1], self._hull_samples)

    @cached_property
    def _facets(self) -> FloatArray:
        """Normals divided by distances, ``(k, 3)``: the hull is where all products with them are at most 1."""
        B = self.span
        if self.rank == 1:
            return B.T / np.abs(self._hull_samples @ B).max()
        Y = self._hull_samples @ B
        size = np.abs(Y).max(axis=0)  # a hull of very unequal lengths loses facets
        hull = ConvexHull(np.vstack([Y, -Y]) / size)
        return hull.equations[:, :-1] / -hull.equations[:, -1:] / size @ B.T

    def _largest(self, w: ArrayLike) -> tuple[FloatArray, NDArray[np.int64]]:
        W = rows(w, 3)
        P, at = np.empty(len(W)), np.empty(len(W), dtype=np.int64)
        for part in range(0, len(W), 200):
            product = W[part : part + 200] @ self._facets.T
            product = np.abs(product) if self.rank == 1 else product
            at[part : part + 200] = product.argmax(axis=1)
            P[part : part + 200] = product.max(axis=1)
        away = W - W @ self.span @ self.span.T
        P[np.linalg.norm(away, axis=1) > 1e-9 * np.linalg.norm(W, axis=1)] = np.inf
        return P, at
