"""Fits of quartic limit surfaces: least squares, and the best convex quartic with the proof that it is convex."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.certificate import Certificate, certify
from softjaw.lsfit.ellipsoid import FAR, nearest_solution
from softjaw.lsfit.flag import FitError, FitFlag
from softjaw.lsfit.lowest import lies_above
from softjaw.lsfit.quartic_surface import Quartic
from softjaw.lsfit.round import Residuals, ball_coefficients, placed, round_samples
from softjaw.lsfit.sos import MARGIN, convex_least_squares
from softjaw.lsfit.surface import Image

__all__ = ["Quartic", "QuarticFit", "convex_quartic", "least_squares_quartic"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class QuarticFit:
    """A convex quartic limit surface, and what is known about it.

    Parameters
    ----------
    surface : Quartic or Image
        The surface; an `Image` of a quartic if the samples are flat, or thin across the axes.
    certificate : Certificate
        Proof that the quartic is convex.
    flag : FitFlag
        What the reader should know.
    residuals : Residuals
        What was minimised.
    found, least : (k,) array
        Coefficients of the quartic, and of the best one, convex or not, in the coordinates of the residuals.
    """

    surface: Quartic | Image
    certificate: Certificate
    flag: FitFlag
    residuals: Residuals = field(repr=False)
    found: FloatArray = field(repr=False)
    least: FloatArray = field(repr=False)

    @cached_property
    def objective(self) -> float:
        """``mean (beta (P - 1)^2 + gamma |(I - t t') grad P|^2)`` over the samples."""
        return self.residuals.objective(self.found)

    @cached_property
    def least_objective(self) -> float:
        """The same for the best quartic, convex or not; equal if that one is convex."""
        return self.residuals.objective(self.least)

    @property
    def rank(self) -> int:
        """Dimension of the body."""
        return self.surface.rank


def least_squares_quartic(
    W: ArrayLike, T: ArrayLike | None = None, beta: float = 1.0, gamma: float = 0.01
) -> Quartic | Image:
    """Quartic with the least ``mean (beta (P - 1)^2 + gamma |(I - t t') grad P|^2)``, which may fail to be convex.

    Parameters
    ----------
    W : (m, d) array
        Normalised wrenches [-].
    T : (m, d) array
        Unit motions; needed unless ``gamma`` is 0 [-].
    beta, gamma : float
        Weights of wrenches and of motions. A little weight on the motions bends the surface the right way between
        samples; with 1 and 1 the directions are bought with radii that are off by some per cent.

    Raises
    ------
    ValueError
        If a sample is not finite, or all wrenches are zero.
    """
    samples = round_samples(W, T)
    v, flag = nearest_solution(*Residuals(samples, beta, gamma).normal(), ball_coefficients(samples.B.shape[1]))
    return placed(v, samples, samples.flag | flag)


def convex_quartic(W: ArrayLike, T: ArrayLike | None = None, beta: float = 1.0, gamma: float = 0.01) -> QuarticFit:
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
    problem = Residuals(samples, beta, gamma)
    N, b = problem.normal()
    ball = ball_coefficients(r)
    least, flag = nearest_solution(N, b, ball)
    v, loose = least, bool(flag)
    by, gram = "least squares", certify(v, r)
    if gram is None:
        by = "semidefinite programme"
        v, gram = convex_least_squares(N, b, ball, r, loose)
    if not lies_above(v, r, FAR**-4):
        by, flag = "semidefinite programme", flag | FitFlag.BOUNDED
        v, gram = convex_least_squares(N, b, ball, r, loose, 12 * FAR**-4)
    surface = placed(v, samples, samples.flag | flag)
    low = float(np.linalg.eigvalsh(gram)[0])
    if low < MARGIN / 4:
        raise FitError(f"the Gram matrix of the convex quartic has the eigenvalue {low:.2e}: report these samples")
    certificate = Certificate(low, gram, samples.B, by, surface)
    return QuarticFit(surface, certificate, surface.flag, problem, v, least)
