"""Fits within the span of the samples, with axes of a like length: limit surfaces of all six wrench components.

The friction of a patch moves all six components of the wrench ``[f, tau]`` when its motions are all six of ``[v,
omega]``; the moments are taken about the origin of the contact frame, by ``l = r - O``. Everything here works in any
number of dimensions: a plane patch has rank 3 among the six components, a cylinder or a cap 6.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.ellipsoid import TiltedEllipsoid, full_ellipsoid
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import FLAT_RATIO, THIN_RATIO, FitErrors, fit_error
from softjaw.lsfit.surface import FitFlag, Image

FloatArray = NDArray[np.float64]
Fitted = TiltedEllipsoid | Quartic | Image


class SpanSamples(NamedTuple):
    """Samples in coordinates ``y`` of their span, ``w = B y``.

    ``Y (m, r)`` are the wrenches and ``T (m, r)`` the unit motions, which change by ``B'`` so that powers stay the
    same; ``B (d, r)`` has as many columns as the span has dimensions. ``flag`` tells whether the samples are flat, or
    thin with all components made one size.
    """

    Y: FloatArray
    T: FloatArray
    B: FloatArray
    flag: FitFlag

    @property
    def rank(self) -> int:
        """Dimension of the span."""
        return self.B.shape[1]


def span_samples(W: ArrayLike, T: ArrayLike, even: bool = True) -> SpanSamples:
    """Samples within their span, scaled.

    A plane patch gives wrenches of rank 3 among the six components, a curved one of rank 6. Motions that meet no
    friction (no component above ``tolerance`` of its largest) are left out.

    Parameters
    ----------
    W, T : (m, d) array
        Normalised wrenches and unit motions [-].
    even : bool
        Whether every component is divided by its largest magnitude (as in the published fits in six dimensions), or
        every principal direction if the samples do not span all components that they use; else lengths are kept.

    Raises
    ------
    ValueError
        If shapes differ, a value is not finite, or all wrenches are zero.
    """
    wrenches, motions = np.atleast_2d(np.asarray(W, float)), np.atleast_2d(np.asarray(T, float))
    if wrenches.shape != motions.shape or not (np.isfinite(wrenches).all() and np.isfinite(motions).all()):
        raise ValueError(
            f"wrenches {wrenches.shape} and motions {motions.shape} must be finite and of one shape (m, d)"
        )
    largest = np.abs(wrenches).max(axis=0, initial=0.0)
    if not largest.any():
        raise ValueError("all wrenches are zero: a contact without friction has no limit surface to fit")
    B, flag = _map(wrenches, largest, even)
    # a motion that meets no friction has a wrench of rounding, whose direction means nothing
    used = largest > FLAT_RATIO * largest.max()
    moving = (np.abs(wrenches[:, used]) > FLAT_RATIO * largest[used]).any(axis=1)
    Y, slip = wrenches[moving] @ np.linalg.pinv(B).T, motions[moving] @ B
    return SpanSamples(Y, slip / np.linalg.norm(slip, axis=1, keepdims=True), B, flag)


def _map(W: FloatArray, largest: FloatArray, even: bool) -> tuple[FloatArray, FitFlag]:
    """Columns ``B (d, r)`` of the coordinates, and whether the samples are flat or thin."""
    used = np.flatnonzero(largest > FLAT_RATIO * largest.max())
    scale = largest[used]
    # Rank is a property of the samples, not of the unit of a torque: judge it with all components of one size.
    _, values, V = np.linalg.svd(W[:, used] / scale, full_matrices=False)
    r = int((values > FLAT_RATIO * values[0]).sum())
    flag = FitFlag.RANK_DEFICIENT if r < W.shape[1] else FitFlag.CLEAN
    flag |= FitFlag.THIN if values[r - 1] < THIN_RATIO * values[0] else FitFlag.CLEAN
    B = np.zeros((W.shape[1], r))
    # a diagonal map keeps the surface a quartic of the components, which files and look-ups can hold
    if r == len(used):
        B[used] = np.diag(scale if even else np.ones(r))
        return B, flag
    B[used] = scale[:, None] * V[:r].T
    if even:
        return B * np.abs(W[:, used] / scale @ V[:r].T).max(axis=0), flag
    # an orthonormal frame of the span changes no length
    return np.linalg.qr(B)[0], flag


class SpanFit(NamedTuple):
    """A fitted surface in the coordinates of the wrenches, and its errors in the scaled ones.

    ``rank`` is the dimension of the samples' span. Below that of the wrenches the surface is flat and flagged, its
    support along the missing directions is 0. ``errors`` compare directions in the coordinates of the fit, where the
    axes have a like length; in the others a soft axis decides every angle. A
    quartic is convex by its Gram matrix, whose smallest eigenvalue is given.
    """

    surface: Fitted
    errors: FitErrors
    rank: int
    gram_eigenvalue: float = math.nan


def span_ellipsoid(W: ArrayLike, T: ArrayLike) -> SpanFit:
    """Ellipsoid of least squares ``min sum (w' A w - 1)^2``, 21 coefficients in six dimensions.

    The scaling has a part in the errors only; where samples leave the ellipsoid open, see `full_ellipsoid`.
    """
    samples = span_samples(W, T)
    surface = full_ellipsoid(samples.Y)
    return SpanFit(placed(surface, samples), fit_error(surface, samples.Y, samples.T), samples.rank)


def span_quartic(W: ArrayLike, T: ArrayLike, gamma: float = 0.01) -> SpanFit:
    """Convex quartic with the least ``mean ((P - 1)^2 + gamma |(I - t t') grad P|^2)`` in the scaled coordinates.

    Parameters
    ----------
    W, T : (m, d) array
        Normalised wrenches and unit motions [-]; at least 1000 for six dimensions, as 126 coefficients follow the
        noise of few.
    gamma : float
        Weight of the motions. Gradients grow with the surface's smallness, so a weight of 1 shifts it outwards by some
        percent in six dimensions; 0.01 gives the same directions without that.
    """
    samples = span_samples(W, T)
    fit = convex_quartic(samples.Y, samples.T, gamma=gamma)
    errors = fit_error(fit.surface, samples.Y, samples.T)
    return SpanFit(placed(fit.surface, samples), errors, samples.rank, fit.gram_eigenvalue)


def placed(surface: Fitted, samples: SpanSamples) -> Fitted:
    """Surface of span coordinates in the coordinates of the wrenches; flagged and flat if the samples are."""
    d, r = samples.B.shape
    flag = surface.flag | samples.flag
    if isinstance(surface, TiltedEllipsoid):
        # maps of the ball compose; the matrix A would be formed and taken apart again
        return TiltedEllipsoid.of_ball(samples.B @ surface.F, flag)
    if isinstance(surface, Image):
        return Image(surface.inner, samples.B @ surface.B, flag)
    # a diagonal map only scales coefficients; any other mixes them, which costs digits
    if r == d and np.array_equal(samples.B, np.diag(np.diag(samples.B))):
        return replace(surface.scaled(np.diag(samples.B)), flag=flag)
    return Image(surface, samples.B, flag)
