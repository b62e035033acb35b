"""Least squares of quartics in coordinates in which the samples lie near the unit ball."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsfit.ellipsoid import full_ellipsoid
from lsfit.flag import FitFlag
from lsfit.form import derivative, exponents, monomials, substitute
from lsfit.quartic_surface import Quartic
from lsfit.samples import checked_motions, principal_frame
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


class Residuals(NamedTuple):
    """Rows of the least-squares problem: the mean of ``|rows v - right|^2`` over ``count`` samples is the objective."""

    rows: FloatArray
    right: FloatArray
    count: int

    def objective(self, v: FloatArray) -> float:
        """Mean over the samples of the weighted squares."""
        return float(((self.rows @ v - self.right) ** 2).sum()) / self.count

    def normal(self) -> tuple[FloatArray, FloatArray]:
        """Matrix ``N (k, k)`` and right side ``b (k,)`` of the normal equations."""
        return self.rows.T @ self.rows / self.count, self.rows.T @ self.right / self.count


def residuals(samples: RoundSamples, beta: float, gamma: float) -> Residuals:
    """Rows ``sqrt(beta) (P - 1)`` and ``sqrt(gamma) (I - t t') grad P``, gradients in the wrench's components."""
    m, r = samples.Y.shape
    M = np.sqrt(beta) * monomials(samples.Y, exponents(r, 4))
    right = np.full(m, np.sqrt(beta))
    if gamma == 0:
        return Residuals(M, right, m)
    T = samples.T
    if T is None:
        raise ValueError(f"gamma is {gamma:g}, which weighs the directions of motion: give T, or gamma = 0")
    d, k = T.shape[1], M.shape[1]
    D = np.sqrt(gamma) * np.tensordot(samples.inverse, derivative(r, 4), axes=(0, 0))
    G = monomials(samples.Y, exponents(r, 3)) @ D  # (d, m, k): one block for each component
    across = T.T[:, :, None]
    G -= across * (across * G).sum(axis=0)
    if not (moving := T.any(axis=1)).all():
        G[:, ~moving] = 0.0
    return Residuals(np.vstack([M, G.reshape(d * m, k)]), np.concatenate([right, np.zeros(d * m)]), m)


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
