"""Coordinates in which limit surfaces are fitted: within the span of the samples, with all axes of a like length."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from softjaw.lsfit.flag import FitError, FitFlag
from softjaw.lsfit.lowest import lies_above, smallest_value
from softjaw.lsfit.quartic_surface import Quartic
from softjaw.lsfit.samples import FLAT, THIN
from softjaw.lsfit.surface import Image, LimitSurface
from softjaw.lsfit.tilted import TiltedEllipsoid

FloatArray = NDArray[np.float64]
Scaling = Literal["maxima", "whitened", "none"]

FAR = 10.0
"""Reach of a surface beyond its farthest sample from which it counts as endless."""


class CollapsedFitError(FitError):
    """The fitted surface does not pass near the samples, or nothing holds it in some direction."""


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


def span_samples(W: ArrayLike, T: ArrayLike, scaling: Scaling = "maxima", tolerance: float = FLAT) -> SpanSamples:
    """Samples within their span, scaled.

    A plane patch gives wrenches of rank 3 among the six components, a curved one of rank 6. Motions that meet no
    friction (no component above ``tolerance`` of its largest) are left out.

    Parameters
    ----------
    W, T : (m, d) array
        Normalised wrenches and unit motions [-].
    scaling : str
        ``maxima`` divides every component by its largest magnitude (the published fits in six dimensions do), or every
        principal direction if the samples do not span all components that they use; ``whitened`` makes the mean square
        the same in all directions; ``none`` keeps the lengths.
    tolerance : float
        Components, and singular values of the scaled samples, below this share of the largest count as zero.

    Raises
    ------
    ValueError
        If shapes differ, a value is not finite, all wrenches are zero, or the scaling has an unknown name.
    """
    W, T = np.atleast_2d(np.asarray(W, float)), np.atleast_2d(np.asarray(T, float))
    if scaling not in get_args(Scaling):
        raise ValueError(f"scaling is {scaling!r}: choose one of {', '.join(get_args(Scaling))}")
    if W.shape != T.shape or not (np.isfinite(W).all() and np.isfinite(T).all()):
        raise ValueError(f"wrenches {W.shape} and motions {T.shape} must be finite and of one shape (m, d)")
    largest = np.abs(W).max(axis=0, initial=0.0)
    if not largest.any():
        raise ValueError("all wrenches are zero: a contact without friction has no limit surface to fit")
    B, flag = _map(W, largest, scaling, tolerance)
    used = largest > tolerance * largest.max()
    moving = (np.abs(W[:, used]) > tolerance * largest[used]).any(axis=1)
    Y, slip = W[moving] @ np.linalg.pinv(B).T, T[moving] @ B
    return SpanSamples(Y, slip / np.linalg.norm(slip, axis=1, keepdims=True), B, flag)


def _map(W: FloatArray, largest: FloatArray, scaling: Scaling, tolerance: float) -> tuple[FloatArray, FitFlag]:
    """Columns ``B (d, r)`` of the coordinates, and whether the samples are flat or thin."""
    used = np.flatnonzero(largest > tolerance * largest.max())
    scale = largest[used]
    # Rank is a property of the samples, not of the unit of a torque: judge it with all components of one size.
    _, values, V = np.linalg.svd(W[:, used] / scale, full_matrices=False)
    r = int((values > tolerance * values[0]).sum())
    flag = FitFlag.RANK_DEFICIENT if r < W.shape[1] else FitFlag.CLEAN
    flag |= FitFlag.THIN if values[r - 1] < THIN * values[0] else FitFlag.CLEAN
    B = np.zeros((W.shape[1], r))
    if r == len(used) and scaling != "whitened":
        B[used] = np.diag(scale if scaling == "maxima" else np.ones(r))
        return B, flag
    B[used] = scale[:, None] * V[:r].T
    if scaling == "none":
        return np.linalg.qr(B)[0], flag
    if scaling == "maxima":
        return B * np.abs(W[:, used] / scale @ V[:r].T).max(axis=0), flag
    return B * (values[:r] / np.sqrt(len(W))), flag


def placed(surface: LimitSurface, samples: SpanSamples) -> LimitSurface:
    """Surface of span coordinates in the coordinates of the wrenches; flagged and flat if the samples are."""
    d, r = samples.B.shape
    flag = surface.flag | samples.flag
    if isinstance(surface, TiltedEllipsoid):
        return TiltedEllipsoid.of_ball(samples.B @ surface.F, flag)
    if r == d and np.array_equal(samples.B, np.diag(np.diag(samples.B))):
        return replace(surface.scaled(np.diag(samples.B)), flag=flag)
    return Image(surface, samples.B, flag)


def refuse_runaway(surface: Quartic | TiltedEllipsoid, Y: FloatArray) -> None:
    """Raise `CollapsedFitError` if ``surface`` lies twice as far out as the samples ``Y``, or is nearly endless."""
    with np.errstate(divide="ignore"):
        median = float(np.median(np.maximum(surface.value(Y), 0.0)) ** (-1 / surface.degree))
    if median > 2:
        raise CollapsedFitError(
            f"the surface lies {median:.3g} times as far out as half of the samples: the regulariser outweighs the "
            f"{len(Y)} samples; lower lam, raise beta, or give more samples"
        )
    least = (FAR * np.linalg.norm(Y, axis=1).max()) ** -surface.degree
    if isinstance(surface, Quartic):
        if lies_above(surface.coefficients, surface.dimension, least):
            return
        P, u = smallest_value(surface.coefficients, surface.dimension)
    else:
        values, V = np.linalg.eigh(surface.A)
        P, u = float(values[0]), V[:, 0]
    if P < least:
        reach = FAR * (least / max(P, 1e-300)) ** (1 / surface.degree)
        raise CollapsedFitError(
            f"the surface reaches {reach:.3g} times as far as the samples along {np.round(u, 3).tolist()} (scaled "
            "coordinates), where no sample holds it: sample more motions, or spread them over all directions"
        )


def sphere_motions(count: int, dimension: int = 6) -> FloatArray:
    """Unit motions spread evenly over the sphere, ``(count, dimension)``, the same in every run.

    The additive recurrence by powers of the generalised golden ratio fills the unit cube evenly; the normal quantile
    of each number makes it evenly spread over directions.
    """
    root = 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (dimension + 1))
    u = (0.5 + np.outer(np.arange(1, count + 1), root ** -np.arange(1.0, dimension + 1))) % 1
    x = ndtri(u)
    return x / np.linalg.norm(x, axis=1, keepdims=True)
