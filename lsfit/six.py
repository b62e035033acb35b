"""Limit surfaces of all six wrench components.

The friction of a patch moves all six components of the wrench ``[f, tau]`` when its motions are all six of ``[v,
omega]``; the moments are taken about the origin of the contact frame, by ``l = r - O``. Everything here works in any
number of dimensions and within the span of the samples: a plane patch has rank 3, a cylinder or a cap 6.

In six dimensions the least-squares quartic is not convex. The convex one solves a semidefinite programme with 351
unknowns and a Gram matrix of size 36, in a fifth of a second.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.ellipsoid import full_ellipsoid, nearest_solution
from softjaw.lsfit.fit_error import FitErrors, fit_error
from softjaw.lsfit.flag import FitError
from softjaw.lsfit.form import exponents, monomial_gradients, monomials
from softjaw.lsfit.gram import GramCertificate, ball_gram, gram_certificate, gram_map
from softjaw.lsfit.interior import least_quadratic
from softjaw.lsfit.quartic_surface import Quartic
from softjaw.lsfit.round import ball_coefficients
from softjaw.lsfit.span import Scaling, SpanSamples, placed, refuse_runaway, span_samples
from softjaw.lsfit.surface import LimitSurface

FloatArray = NDArray[np.float64]


class SpanFit(NamedTuple):
    """A fitted surface in the coordinates of the wrenches, and its errors in the scaled ones.

    ``rank`` is the dimension of the samples' span. Below that of the wrenches the surface is flat and flagged, its
    support along the missing directions is 0. ``errors`` compare directions in the coordinates of the fit, where the
    axes have a like length; in the others a soft axis decides every angle. ``certificate`` is for convex quartics.
    """

    surface: LimitSurface
    errors: FitErrors
    rank: int
    certificate: GramCertificate | None = None


def six_samples(
    wrench: ArrayLike, twist: ArrayLike, force: float, rho: float, point: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[FloatArray, FloatArray]:
    """Wrenches ``(f, tau / rho) / force`` and unit motions ``(v, rho omega) / |.|`` of a reference point.

    Parameters
    ----------
    wrench, twist : (m, 6) array
        ``[f, tau]`` about, and ``[v, omega]`` of, the origin [N, N m; m/s, rad/s].
    force : float
        ``mu S`` [N].
    rho : float
        Length of the contact [m].
    point : (3,) array
        Reference point in the contact frame, such as the centre of pressure [m]; the power of no sample changes.

    Returns
    -------
    W, T : (m, 6) array
        Wrenches and unit motions [-].
    """
    if not (force > 0 and rho > 0):
        raise ValueError(f"force is {force} and rho is {rho}: samples are normalised by a positive force and length")
    w, t = np.atleast_2d(np.asarray(wrench, float)).copy(), np.atleast_2d(np.asarray(twist, float)).copy()
    if w.shape != t.shape or w.shape[1] != 6:
        raise ValueError(f"wrench has shape {w.shape} and twist {t.shape}: expected (m, 6) for both")
    p = np.asarray(point, float)
    w[:, 3:] -= np.cross(p, w[:, :3])
    t[:, :3] += np.cross(t[:, 3:], p)
    length = np.array([1.0, 1.0, 1.0, rho, rho, rho])
    T = t * length
    size = np.linalg.norm(T, axis=1, keepdims=True)
    if (size == 0).any():
        raise ValueError(f"twist[{int(np.argmin(size))}] is zero: a sample needs a direction of motion")
    return w / force / length, T / size


def span_ellipsoid(W: ArrayLike, T: ArrayLike, scaling: Scaling = "maxima") -> SpanFit:
    """Ellipsoid of least squares ``min sum (w' A w - 1)^2``, 21 coefficients in six dimensions.

    The scaling has a part in the errors only; where samples leave the ellipsoid open, see `full_ellipsoid`.
    """
    samples = span_samples(W, T, scaling)
    return _fit(full_ellipsoid(samples.Y), samples, check=False)


def span_quartic(
    W: ArrayLike, T: ArrayLike, gamma: float = 0.0, ridge: float = 0.0, scaling: Scaling = "maxima"
) -> SpanFit:
    """Quartic of least squares, 126 coefficients in six dimensions, which is not always convex.

    For comparison: in six dimensions it is not convex for usual patches, so it is no limit surface and its body may be
    endless; see `convex_span_quartic`. Samples that do not determine it, as fewer than 126 do not, give the one of all
    best quartics that is nearest to a ball in the scaled coordinates, and a flag.
    """
    samples = span_samples(W, T, scaling)
    v, flag = nearest_solution(*_normal_equations(samples, gamma, ridge), ball_coefficients(samples.rank))
    return _fit(Quartic(v, exponents(samples.rank, 4), flag), samples, check=False)


def convex_span_quartic(
    W: ArrayLike, T: ArrayLike, gamma: float = 0.01, ridge: float = 0.0, scaling: Scaling = "maxima"
) -> SpanFit:
    """Sos-convex quartic, ``min sum (P - 1)^2 + gamma sum |(I - t t') grad P|^2 + ridge |v|^2``.

    Parameters
    ----------
    W, T : (m, d) array
        Normalised wrenches and unit motions [-]; at least 1000 for six dimensions, as 126 coefficients follow the
        noise of few.
    gamma : float
        Weight of the motions. Gradients grow with the surface's smallness, so a weight of 1 shifts it outwards by some
        percent in six dimensions; 0.01 gives the same directions without that.
    ridge : float
        Weight of the squared coefficients.
    scaling : str
        Coordinates of the fit, see `span_samples`.

    Raises
    ------
    CollapsedFitError
        If the surface runs away from the samples.
    FitError
        If the solver does not converge, or the Gram matrix proves nothing.
    """
    samples = span_samples(W, T, scaling)
    E = exponents(samples.rank, 4)
    H, g = _normal_equations(samples, gamma, ridge)
    A, k, start = gram_map(E), len(E), ball_gram(E)
    n = A.shape[1]
    start *= (g @ start[:k]) / (start[:k] @ H @ start[:k])
    best = least_quadratic(np.pad(H, (0, n - k)), np.pad(g, (0, n - k)), A, start)
    surface = Quartic(best.x[:k], E, nearest_solution(H, g, ball_coefficients(samples.rank))[1])
    certificate = gram_certificate(best.X, surface.tensor, best.gap / (1 + abs(best.objective)))
    if not certificate.proves_convexity:
        raise FitError(
            f"the Gram matrix has the eigenvalues {certificate.smallest:.1e} to {certificate.largest:.1e}, which "
            'proves nothing: choose the scaling "whitened", or add a ridge'
        )
    return _fit(surface, samples)._replace(certificate=certificate)


def _normal_equations(samples: SpanSamples, gamma: float, ridge: float) -> tuple[FloatArray, FloatArray]:
    """``H (k, k)`` and ``g (k,)`` of the objective ``v' H v - 2 g' v + m``."""
    if not (gamma >= 0 and ridge >= 0):
        raise ValueError(f"gamma is {gamma} and ridge is {ridge}: weights must not be negative")
    E = exponents(samples.rank, 4)
    M = monomials(samples.Y, E)
    H = M.T @ M + ridge * np.eye(len(E))
    if gamma > 0:
        G, T = monomial_gradients(samples.Y, E), samples.T
        along = np.einsum("mkd,md->mk", G, T)
        across = (G - along[:, :, None] * T[:, None, :]).transpose(0, 2, 1).reshape(-1, len(E))
        H += gamma * across.T @ across
    return H, M.sum(axis=0)


def _fit(surface: LimitSurface, samples: SpanSamples, check: bool = True) -> SpanFit:
    if check:
        refuse_runaway(surface, samples.Y)
    with np.errstate(invalid="ignore"):
        errors = fit_error(surface, samples.Y, samples.T)
    return SpanFit(placed(surface, samples), errors, samples.rank)
