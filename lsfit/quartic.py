"""Fits of quartic limit surfaces: least squares, and the best convex quartic with the proof that it is convex."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsfit.certificate import Certificate, certify, smallest_eigenvalue
from lsfit.ellipsoid import FAR, full_ellipsoid, nearest_solution
from lsfit.flag import FitError, FitFlag
from lsfit.form import derivative, exponents, monomials, substitute
from lsfit.geometry import directions
from lsfit.quartic_surface import Quartic
from lsfit.samples import checked_motions, principal_frame
from lsfit.sos import MARGIN, convex_least_squares
from lsfit.surface import Image

__all__ = ["Quartic", "QuarticFit", "convex_quartic", "least_squares_quartic"]

FloatArray = NDArray[np.float64]
TILT = 1e3  # spread of a frame's directions from which coefficients in the wrench's own components lose digits


@dataclass(frozen=True, eq=False)
class QuarticFit:
    """A convex quartic limit surface, and what is known about it.

    Parameters
    ----------
    surface : Quartic or Image
        The surface; an `Image` of a quartic if the samples are flat, or thin across the axes.
    certificate : Certificate
        Proof that the quartic is convex.
    objective : float
        ``mean (beta (P - 1)^2 + gamma |(I - t t') grad P|^2)`` over the samples.
    least_objective : float
        The same for the best quartic, convex or not; equal if that one is convex.
    flag : FitFlag
        What the reader should know.
    """

    surface: Quartic | Image
    certificate: Certificate
    objective: float
    least_objective: float
    flag: FitFlag

    @property
    def rank(self) -> int:
        """Dimension of the body."""
        return self.surface.rank


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
    d, k = samples.inverse.shape[1], M.shape[1]
    D = np.einsum("ri,rck->cik", samples.inverse, derivative(r, 4)).reshape(-1, d * k)
    G = (monomials(samples.Y, exponents(r, 3)) @ D).reshape(m, d, k)
    G -= T[:, :, None] * (T[:, None, :] @ G)
    G *= np.sqrt(gamma) * T.any(axis=1)[:, None, None]
    return Residuals(np.vstack([M, G.reshape(m * d, k)]), np.concatenate([right, np.zeros(m * d)]), m)


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


def least_squares_quartic(
    W: ArrayLike, T: ArrayLike | None = None, beta: float = 1.0, gamma: float = 1.0
) -> Quartic | Image:
    """Quartic with the least ``mean (beta (P - 1)^2 + gamma |(I - t t') grad P|^2)``, which may fail to be convex.

    Parameters
    ----------
    W : (m, d) array
        Normalised wrenches [-].
    T : (m, d) array
        Unit motions; needed unless ``gamma`` is 0 [-].
    beta, gamma : float
        Weights of wrenches and of motions. The gradient of ``P`` is four times as long as the wrench: with 1 and 1
        the directions weigh more; with ``gamma = 0`` the errors of `lsfit.misfit` in the radius are least.

    Raises
    ------
    ValueError
        If a sample is not finite, or all wrenches are zero.
    """
    samples = round_samples(W, T)
    v, flag = nearest_solution(*residuals(samples, beta, gamma).normal(), ball_coefficients(samples.B.shape[1]))
    return placed(v, samples, samples.flag | flag)


def convex_quartic(W: ArrayLike, T: ArrayLike | None = None, beta: float = 1.0, gamma: float = 1.0) -> QuarticFit:
    """Convex quartic with the least ``mean (beta (P - 1)^2 + gamma |(I - t t') grad P|^2)``, with its certificate.

    The quartic of the linear equations is taken if a positive definite Gram matrix proves it convex. Only otherwise
    the semidefinite programme is solved, which asks for eigenvalues of at least `lsfit.sos.MARGIN`, so that rounding
    cannot undo the proof. A body that would reach more than `lsfit.ellipsoid.FAR` times as far as the ellipsoid of the
    samples is bounded there by a larger margin, and flagged.

    Parameters
    ----------
    W, T, beta, gamma
        As for `least_squares_quartic`.

    Raises
    ------
    ValueError
        If a sample is not finite, or all wrenches are zero.
    FitError
        If the programme is not solved, or its result fails the certificate.
    """
    samples = round_samples(W, T)
    r = samples.B.shape[1]
    problem = residuals(samples, beta, gamma)
    N, b = problem.normal()
    ball = ball_coefficients(r)
    v, flag = nearest_solution(N, b, ball)
    least, loose = problem.objective(v), bool(flag)
    by, gram = "least squares", certify(v, r)
    if gram is None:
        by = "semidefinite programme"
        v, gram = convex_least_squares(N, b, ball, r, loose)
    u = directions(r, 200)
    if (monomials(u, exponents(r, 4)) @ v).min() < FAR**-4:
        by, flag = "semidefinite programme", flag | FitFlag.BOUNDED
        v, gram = convex_least_squares(N, b, ball, r, loose, 12 * FAR**-4)
    surface = placed(v, samples, samples.flag | flag)
    low = float(np.linalg.eigvalsh(gram)[0])
    if low < MARGIN / 4:
        raise FitError(f"the Gram matrix of the convex quartic has the eigenvalue {low:.2e}: report these samples")
    # Curvature at unit wrenches is at least this. Rounding of very unequal coefficients can hide it from the search.
    bound = low * np.linalg.norm(samples.B, 2) ** -4
    certificate = Certificate(max(_smallest(surface), bound), low, gram, samples.B, by)
    return QuarticFit(surface, certificate, problem.objective(v), least, surface.flag)


def _smallest(surface: Quartic | Image) -> float:
    if isinstance(surface, Quartic):
        return smallest_eigenvalue(surface.coefficients, surface.dimension)
    R = np.linalg.qr(surface.B)[1]
    inner = surface.inner
    assert isinstance(inner, Quartic)
    return smallest_eigenvalue(substitute(inner.coefficients, inner.exponents, np.linalg.inv(R)), inner.dimension)
