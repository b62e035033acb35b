"""The best convex quartic as limit surface, with the proof that it is convex.

All is done in coordinates in which the samples lie near the unit ball, so that coefficients are of one size and
margins mean the same for every contact.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softjaw.lsfit.ellipsoid import MAX_REACH_RATIO, full_ellipsoid, nearest_solution
from softjaw.lsfit.form import exponents, monomial_gradients, monomials
from softjaw.lsfit.lowest import lies_above
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.samples import pressed, principal_frame
from softjaw.lsfit.sos import MIN_EIGENVALUE, ball_gram, convex_least_squares, gram_matrix, smallest
from softjaw.lsfit.surface import FitError, FitFlag, FloatArray


def convex_quartic(W: ArrayLike, T: ArrayLike, gamma: float = 0.01) -> tuple[Quartic, str]:
    """Convex quartic with the least ``mean ((P - 1)^2 + gamma |(I - t t') grad P|^2)``, and what proves it convex.

    The quartic of the linear equations is taken if a positive definite Gram matrix proves it convex (the proof is then
    ``least squares``). Only otherwise the semidefinite programme is solved (``semidefinite programme``), which asks for
    eigenvalues of at least `MIN_EIGENVALUE`, so that rounding cannot undo the proof. A body that would reach more than
    `MAX_REACH_RATIO` times as far as the ellipsoid of the samples is bounded there by a larger margin, and flagged.

    ``W, T (m, d)``: normalised wrenches and unit motions [-]; the surface is in the coordinates of the wrenches, flat
    and flagged if they are. ``gamma``: weight of the motions. A little bends the surface the right way between samples;
    with 1 the directions are bought with radii that are off by some per cent.

    Raises `FitError`: if the programme is not solved, or its result fails the certificate.
    """
    samples = round_samples(W, T)
    r = samples.B.shape[1]
    N, b = normal_equations(samples, gamma)
    ball = ball_gram(r)
    v, flag = nearest_solution(N, b, ball[: len(b)])
    # free numbers of the ball prove many quartics near it, without a programme
    loose, free, by = bool(flag), ball[len(b) :], "least squares"
    gram = gram_matrix(v, free, r)
    if smallest(gram) < MIN_EIGENVALUE:
        bound, free = convex_least_squares(N, b, r, loose)
        # Where convexity does not bind, the programme ends in the middle of the matrices that prove its result, and
        # the same free numbers prove the quartic of the linear equations, which has more digits.
        gram = gram_matrix(v, free, r)
        if smallest(gram) < MIN_EIGENVALUE:
            v, by, gram = bound, "semidefinite programme", gram_matrix(bound, free, r)
    # P below this on the unit sphere is a reach beyond MAX_REACH_RATIO, which no sample supports
    least = MAX_REACH_RATIO**-4
    # y' Hess P y = 12 P: a Gram matrix with so large an eigenvalue bounds the reach
    if smallest(gram) < 12 * least and not lies_above(v, r, least):
        by, flag = "semidefinite programme", flag | FitFlag.BOUNDED
        v, free = convex_least_squares(N, b, r, loose, 12 * least)
        gram = gram_matrix(v, free, r)
    low = smallest(gram)
    # the programme promises half of the margin; the rest is room for rounding on the way
    if low < MIN_EIGENVALUE / 4:
        raise FitError(f"the Gram matrix of the convex quartic has the eigenvalue {low:.2e}: report these samples")
    return Quartic(v, samples.B, samples.flag | flag), by


class RoundSamples(NamedTuple):
    """Samples in coordinates ``w = B y`` in which their ellipsoid is the unit ball.

    ``Y (m, r)`` are wrenches, ``T (m, d)`` unit motions within the span or zero where a motion has no part in it,
    ``B (d, r)`` the map and ``inverse (r, d)`` its pseudo-inverse.
    """

    Y: FloatArray
    T: FloatArray
    B: FloatArray
    inverse: FloatArray
    flag: FitFlag


def round_samples(W: ArrayLike, T: ArrayLike) -> RoundSamples:
    """Samples in the frame of their ellipsoid, in which forms of degree 4 have coefficients of one size."""
    W, T = (np.asarray(X, float)[pressed(W)] for X in (W, T))
    ball = full_ellipsoid(W)
    B, inverse = ball.B, ball.inverse
    if ball.flag & FitFlag.BOUNDED:  # the samples' own lengths are a better scale than an ellipsoid far outside them
        B = principal_frame(W)[0] * np.sqrt(ball.rank)
        inverse = np.linalg.pinv(B)
    # across its span a flat body carries nothing: only the part of a motion within has a normal to it
    if ball.rank < ball.dimension:
        T = T @ ball.span @ ball.span.T
        length = np.linalg.norm(T, axis=1, keepdims=True)
        # what rounding leaves of a motion across the span has no direction: zero takes it out of the fit
        T = np.where(length > 1e-9, T / np.maximum(length, 1e-9), 0.0)
    # whether a quartic is determined is asked of its own equations
    return RoundSamples(W @ inverse.T, T, B, inverse, ball.flag & ~FitFlag.UNDERDETERMINED)


def normal_equations(samples: RoundSamples, gamma: float) -> tuple[FloatArray, FloatArray]:
    """Matrix ``N (k, k)`` and right side ``b (k,)`` of the least squares.

    Gradients are in the wrench's components, coefficients in the coordinates of the samples.
    """
    Y, T, _, inverse, _ = samples
    M, G = monomials(Y, exponents(Y.shape[1], 4)), monomial_gradients(Y, Y.shape[1], 4) @ inverse
    # slopes across the motion are to vanish; a motion of zeros does not count
    across = (G - (G @ T[:, :, None]) * T[:, None]) * T.any(axis=1)[:, None, None]
    R = np.concatenate([M, np.sqrt(gamma) * across.transpose(0, 2, 1).reshape(-1, M.shape[1])])
    # only the residual of P has a target, 1
    return R.T @ R / len(Y), M.mean(axis=0)
