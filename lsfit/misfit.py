"""How far a limit-surface model is from samples of the true one."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class LimitSurface(Protocol):
    """Level set ``P(w) = 1`` of a homogeneous polynomial."""

    @property
    def degree(self) -> int:
        """Degree of ``P``."""

    def value(self, w: FloatArray) -> FloatArray:
        """``P(w)``, ``(m, 3) -> (m,)``."""

    def gradient(self, w: FloatArray) -> FloatArray:
        """Gradient of ``P``, ``(m, 3) -> (m, 3)``."""


class Misfit(NamedTuple):
    """Mean errors of a model over samples.

    ``E1 = mean |P - 1|`` grows with the degree of the polynomial: models of different degree compare by ``Erad = mean
    |P^(-1/degree) - 1|``, the error of the radius. ``Edir`` is the mean angle between the gradient and the motion
    [deg].
    """

    E1: float
    Erad: float
    Edir: float


def misfit(model: LimitSurface, W: FloatArray, T: FloatArray) -> Misfit:
    """Errors of ``model`` on wrenches ``W (m, 3)`` with unit motions ``T (m, 3)``."""
    P, G = model.value(W), model.gradient(W)
    # The half-angle form keeps its digits where the arc cosine of a number near one loses them.
    u = G / np.linalg.norm(G, axis=1, keepdims=True)
    angle = 2 * np.arctan2(np.linalg.norm(u - T, axis=1), np.linalg.norm(u + T, axis=1))
    return Misfit(
        float(np.abs(P - 1).mean()),
        float(np.abs(P ** (-1 / model.degree) - 1).mean()),
        float(np.degrees(angle).mean()),
    )
