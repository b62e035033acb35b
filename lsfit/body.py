"""Volume and shadow of the exact limit surface, from its samples; no model is fitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

from lsfit.geometry import shadow_area

__all__ = ["body_volume", "hull_volume", "shadow_area"]

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
