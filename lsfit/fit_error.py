"""How far a limit-surface model is from samples of the true one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.samples import checked_motions
from softjaw.lsfit.surface import OUT_OF_SPAN, ZERO_SHARE, LimitSurface

FloatArray = NDArray[np.float64]


class FitErrors(NamedTuple):
    """Mean errors of a model over samples.

    ``E1 = mean |P - 1|`` grows with the degree of the polynomial: models of different degree compare by ``Erad = mean
    |P^(-1/degree) - 1|``, the error of the radius. ``Edir`` is the mean angle between the gradient and the motion
    [deg].
    """

    E1: float
    Erad: float
    Edir: float


def fit_error(model: LimitSurface, W: ArrayLike, T: ArrayLike) -> FitErrors:
    """Errors of ``model`` on wrenches ``W (m, d)`` with unit motions ``T (m, d)``.

    Samples without a wrench say nothing about a surface and are left out. A flat model has the radius 0 (``Erad`` 1,
    ``E1`` infinite) for wrenches out of its span, and is normal to every motion out of it: its angle is the one
    between the motion and the nearest of its normals. Where the polynomial is not above `ZERO_SHARE` the radius is
    infinite.

    Raises
    ------
    ValueError
        If a sample is not finite, a motion has not the length 1, or all wrenches are zero.
    """
    W, motions = checked_motions(W, T)
    assert motions is not None
    P, G = model.value(W), model.gradient(W)
    # the usual case is one compiled loop; a flat model has no angle of its own to most motions
    if model.rank == model.dimension:
        E1, Erad, angle = mean_errors(P, np.ascontiguousarray(G), np.ascontiguousarray(motions), model.degree)
        return FitErrors(E1, Erad, math.degrees(angle))
    with np.errstate(divide="ignore"):
        radius = np.where(P > ZERO_SHARE, P, 0.0) ** (-1 / model.degree)
    return FitErrors(
        float(np.abs(P - 1).mean()),
        float(np.abs(radius - 1).mean()),
        float(np.degrees(_angles(G, motions, model.span)).mean()),
    )


def overclaim(model: LimitSurface, W: ArrayLike) -> float:
    """Largest share by which ``model`` claims more than wrenches ``W (m, d)`` of a true surface, along them.

    0 where it claims nowhere more, infinite where it has no end. Samples without a wrench are left out.
    """
    W, _ = checked_motions(W, None)
    P = model.value(W)
    with np.errstate(divide="ignore"):
        radius = np.where(P > ZERO_SHARE, P, 0.0) ** (-1 / model.degree)
    return max(float(radius.max()) - 1.0, 0.0)


def _angles(G: FloatArray, T: FloatArray, span: FloatArray) -> FloatArray:
    """Angles ``(m,)`` between motions and all that is normal to a flat surface: gradients plus what leaves its span."""
    length = np.linalg.norm(G, axis=1, keepdims=True)
    u = G / np.where(length > 0, length, 1.0)
    across = T - T @ span @ span.T
    # no normal of a flat body points against the gradient
    ahead = np.maximum(((T - across) * u).sum(axis=1, keepdims=True), 0.0)
    u = across + ahead * u
    size = np.linalg.norm(u, axis=1, keepdims=True)
    u /= np.where(size > OUT_OF_SPAN, size, 1.0)
    # The half-angle form keeps its digits where the arc cosine of a number near one loses them. A motion against the
    # gradient is a right angle away from all that is normal to the span.
    angle = 2 * np.arctan2(np.linalg.norm(u - T, axis=1), np.linalg.norm(u + T, axis=1))
    return np.where(size[:, 0] > OUT_OF_SPAN, angle, np.pi / 2)


@njit(cache=True)
def mean_errors(P, G, T, degree):  # pragma: no cover - compiled
    """Means of ``|P - 1|``, ``|P^(-1/degree) - 1|`` and the angle [rad] between the rows of ``G`` and ``T (m, d)``."""
    m, d = G.shape
    value = radius = angle = 0.0
    for n in range(m):
        value += abs(P[n] - 1.0)
        if P[n] > ZERO_SHARE:
            radius += abs((1.0 / math.sqrt(math.sqrt(P[n])) if degree == 4 else P[n] ** (-1.0 / degree)) - 1.0)
        else:
            radius += np.inf
        length = 0.0
        for i in range(d):
            length += G[n, i] ** 2
        length = math.sqrt(length) if length > 0.0 else 1.0
        less = more = 0.0
        for i in range(d):
            u = G[n, i] / length
            less += (u - T[n, i]) ** 2
            more += (u + T[n, i]) ** 2
        # The half-angle form keeps its digits where the arc cosine of a number near one loses them.
        angle += 2.0 * math.atan2(math.sqrt(less), math.sqrt(more))
    return value / m, radius / m, angle / m
