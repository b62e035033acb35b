"""The exact limit surface, from its samples or from the friction that gives them; no model is fitted."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from softjaw.lsfit.form import directions
from softjaw.lsfit.samples import pressed, sample_rank
from softjaw.lsfit.surface import ZERO_SHARE, FloatArray, rows, supported_shadow


def hull_volume(W: ArrayLike) -> float:
    """Volume of the hull of the wrenches ``W (m, 3)`` and their opposites; 0 if they lie in a plane (`ZERO_SHARE`)."""
    points = np.asarray(W, float)
    _, values, V = np.linalg.svd(points, full_matrices=False)
    # Qhull fails on points of a plane instead of finding no volume
    if len(points) < 3 or values[2] <= ZERO_SHARE * values[0]:
        return 0.0
    # the volume scales with the lengths, so it loses nothing by making them equal
    even = points @ V.T / values  # a hull of very unequal lengths loses facets
    return float(ConvexHull(np.vstack([even, -even])).volume * values.prod())


@dataclass(frozen=True, eq=False)
class ExactSurface:
    """Limit surface of a contact as friction gives it: every wrench is the one for its motion.

    The support of the body in the direction of a motion is the power ``w(t) . t`` of the wrench, exact to rounding;
    its volume follows from ``count`` wrenches.

    ``wrench`` gives wrenches ``(m, 3)`` for motions ``(m, 3)`` of any length but zero, in one set of units; ``rho`` is
    the length of the contact by which the motions of samples are spread evenly, 1 for normalised wrenches.
    """

    wrench: Callable[[FloatArray], FloatArray]
    rho: float = 1.0
    count: int = 8000
    sampled = True  # the volume is not exact

    def samples(self, count: int | None = None) -> FloatArray:
        """Wrenches for evenly spread motions of one sense of rotation, ``(count, 3)``."""
        # omega is divided by rho: the motions are spread evenly in (v, rho omega)
        return np.asarray(self.wrench(directions(3, count or self.count) / [1.0, 1.0, self.rho]), float)

    @cached_property
    def rank(self) -> int:
        """Dimension of the body."""
        # torques by rho: the rank must not depend on the unit of length
        return sample_rank(self._hull_samples / [1.0, 1.0, self.rho])

    @cached_property
    def volume(self) -> float:
        """Volume of the body, extrapolated from hulls of ``count`` and a quarter as many samples."""
        if self.rank < 3:
            return 0.0
        coarse, fine = self.samples(self.count // 4), self._hull_samples
        inner, gain = hull_volume(fine), self.count / len(coarse)
        # Richardson: hulls of samples miss a volume in proportion to 1 / m, which cancels in this combination
        return inner + (inner - hull_volume(coarse)) / (gain - 1)

    @cached_property
    def shadow_area(self) -> float:
        """Area of the shadow on the plane of the forces, from the supports of 4096 translations.

        It is exact but for kinks, as few faces with tilted normals have, which leave some 1e-7.
        """
        return supported_shadow(self.support, 3, 4096)

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, 3) -> (m,)``; exact."""
        T = rows(t, 3)
        return (self.support_points(T) * T).sum(axis=1)

    def support_points(self, t: ArrayLike) -> FloatArray:
        """Wrenches of motions, the farthest along them, ``(m, 3) -> (m, 3)``; 0 without a motion."""
        T = rows(t, 3)
        points, moving = np.zeros(T.shape), T.any(axis=1)
        points[moving] = self.wrench(T[moving])
        return points

    @cached_property
    def semi_axes(self) -> FloatArray:
        """Largest reach ``(3,)`` along each component."""
        return self.support(np.eye(3))

    @cached_property
    def _hull_samples(self) -> FloatArray:
        W = self.samples()
        return W[pressed(W)]
