"""Least squares of quartics in coordinates in which the samples lie near the unit ball."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsfit.ellipsoid import full_ellipsoid
from lsfit.flag import FitFlag
from lsfit.form import IntArray, exponents, substitute
from lsfit.quartic_surface import Quartic
from lsfit.samples import checked_motions, principal_frame
from lsfit.sums import mean_square, normal_equations
from lsfit.surface import Image

FloatArray = NDArray[np.float64]
TILT = 50.0  # spread of a frame's directions from which coefficients lose digits: its fourth power times rounding


class RoundSamples(NamedTuple):
    """Samples in coordinates ``w = B y`` in which their ellipsoid is the unit ball.

    ``Y (m, r)`` are wrenches, ``T (m, d)`` unit motions within the span or zero where a motion has no part in it,
    ``B (d, r)`` the map and ``inverse (r, d)`` its pseudo-inverse.
    """

    Y: FloatArray
    T: FloatArray | None
    B: FloatArray
    inverse: FloatArray
    flag: FitFlag


def round_samples(W: ArrayLike, T: ArrayLike | None) -> RoundSamples:
    """Samples in the frame of their ellipsoid, in which forms of degree 4 have coefficients of one size."""
    W, T = checked_motions(W, T)
    ball = full_ellipsoid(W)
    B, inverse = ball.F, ball.inverse
    assert B is not None
    if ball.flag & FitFlag.BOUNDED:  # the samples' own lengths are a better scale than an ellipsoid far outside them
        B = principal_frame(W)[0] * np.sqrt(ball.rank)
        inverse = np.linalg.pinv(B)
    if T is not None and ball.rank < ball.dimension:
        T = T @ ball.span @ ball.span.T
        length = np.linalg.norm(T, axis=1, keepdims=True)
        T = np.where(length > 1e-9, T / np.maximum(length, 1e-9), 0.0)
    return RoundSamples(W @ inverse.T, T, B, inverse, ball.flag & ~FitFlag.UNDERDETERMINED)


@dataclass(frozen=True, eq=False)
class Residuals:
    """Least squares of ``sqrt(beta) (P - 1)`` and ``sqrt(gamma) (I - t t') grad P`` over the samples.

    Gradients are in the wrench's components, coefficients in the coordinates of the samples.
    """

    samples: RoundSamples
    beta: float
    gamma: float

    def __post_init__(self) -> None:
        """Refuse to weigh motions that are not there."""
        if self.gamma != 0 and self.samples.T is None:
            raise ValueError(f"gamma is {self.gamma:g}, which weighs the directions of motion: give T, or gamma = 0")

    def objective(self, v: FloatArray) -> float:
        """Mean over the samples of the weighted squares, for coefficients ``v (k,)``."""
        return float(mean_square(*self._data, v))

    def normal(self) -> tuple[FloatArray, FloatArray]:
        """Matrix ``N (k, k)`` and right side ``b (k,)`` of the normal equations."""
        Y, *_, E, _, _ = self._data
        N, b = np.zeros((len(E), len(E))), np.zeros(len(E))
        normal_equations(*self._data, N, b)
        return N / len(Y), b / len(Y)

    @property
    def _data(self) -> tuple[FloatArray, FloatArray, FloatArray, IntArray, float, float]:
        Y, T, _, inverse, _ = self.samples
        E = exponents(Y.shape[1], 4)
        arrays = (np.ascontiguousarray(x) for x in (Y, Y if T is None else T, inverse))
        return (*arrays, E, float(self.beta), float(self.gamma))  # type: ignore[return-value]


@lru_cache
def ball_coefficients(dimension: int) -> FloatArray:
    """Coefficients of ``|y|^4``."""
    squares = exponents(dimension, 2)
    v = np.zeros(len(exponents(dimension, 4)))
    place = {tuple(row): n for n, row in enumerate(exponents(dimension, 4).tolist())}
    for i in np.flatnonzero((squares == 2).any(axis=1)):
        for j in np.flatnonzero((squares == 2).any(axis=1)):
            v[place[tuple((squares[i] + squares[j]).tolist())]] += 1.0
    return v


def placed(v: FloatArray, samples: RoundSamples, flag: FitFlag) -> Quartic | Image:
    """Quartic with coefficients ``v`` of the round frame, in the wrench's components."""
    d, r = samples.B.shape
    E = exponents(r, 4)
    if r < d:
        return Image(Quartic(v, E), samples.B, flag)
    reach = np.linalg.norm(samples.B, axis=1)
    turn = samples.B / reach[:, None]
    if np.linalg.cond(turn) > TILT:
        return Image(Quartic(v, E), samples.B, flag)
    return Quartic(substitute(v, E, np.linalg.inv(turn)) / np.prod(reach**E, axis=1), E, flag)
