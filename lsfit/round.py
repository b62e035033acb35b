"""Least squares of quartics in coordinates in which the samples lie near the unit ball."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.ellipsoid import full_ellipsoid
from softjaw.lsfit.flag import FitFlag
from softjaw.lsfit.form import exponents, substitute
from softjaw.lsfit.quartic_surface import Quartic
from softjaw.lsfit.samples import checked_motions, principal_frame
from softjaw.lsfit.sums import fill_residuals
from softjaw.lsfit.surface import Image

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

    @cached_property
    def rows(self) -> FloatArray:
        """Residuals per coefficient, ``(k, c m)``: of the wrenches, then of the ``c - 1`` directions across motions."""
        Y, T, _, inverse, _ = self.samples
        E = exponents(Y.shape[1], 4)
        out = np.empty((len(E), 1 if T is None or self.gamma == 0 else T.shape[1], len(Y)))
        arrays = (np.ascontiguousarray(x) for x in (Y, Y if T is None else T, inverse))
        fill_residuals(*arrays, E, float(self.beta), float(self.gamma), out)
        return out.reshape(len(E), -1)

    def objective(self, v: FloatArray) -> float:
        """Mean over the samples of the weighted squares, for coefficients ``v (k,)``."""
        m = len(self.samples.Y)
        found = v @ self.rows
        found[:m] -= math.sqrt(self.beta)
        return float(found @ found) / m

    def normal(self) -> tuple[FloatArray, FloatArray]:
        """Matrix ``N (k, k)`` and right side ``b (k,)`` of the normal equations."""
        R, m = self.rows, len(self.samples.Y)
        return R @ R.T / m, R[:, :m] @ np.full(m, math.sqrt(self.beta) / m)


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
    coefficients = substitute(v, E, np.linalg.inv(turn)) / np.prod(reach**E, axis=1)
    return Quartic(coefficients, E, flag, samples.B if flag == FitFlag.CLEAN else None, reach)
