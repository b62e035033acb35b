"""Samples of a limit surface, wrenches and the motions normal to it, free of units; how far a model is from them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from softjaw.lsfit.surface import OUT_OF_SPAN, ZERO_SHARE, FitFlag, FloatArray, LimitSurface

THIN_RATIO = 1e-3  # of principal lengths of samples: below it they carry the flag THIN
FLAT_RATIO = 1e-9  # of principal lengths: below it samples are flat


def normalised_samples(wrench: ArrayLike, twist: ArrayLike, force: float, rho: float) -> tuple[FloatArray, FloatArray]:
    """Wrenches ``(f, tau / rho) / force`` and unit motions ``(v, rho omega) / |.|``, ``(m, d)`` each [-].

    With ``rho`` in proportion to the patch, equal patches of any size and unit give equal samples. ``wrench``:
    ``[f, tau]`` about the origin ``(m, 6)``, or the components of it that the motions have ``(m, d)`` [N, N m];
    ``twist (m, d)``: ``[v_x, v_y, omega_z]``, or ``[v, omega]`` of the origin [m/s, rad/s]; ``force``: ``mu S`` [N];
    ``rho``: length of the contact [m].
    """
    w, t = np.atleast_2d(np.asarray(wrench, float)), np.atleast_2d(np.asarray(twist, float))
    planar = t.shape[1] == 3
    w = w[:, [0, 1, 5]] if planar and w.shape[1] == 6 else w
    size = np.array([1.0, 1.0, rho] if planar else [1.0, 1.0, 1.0, rho, rho, rho])
    # a torque is divided by rho and a rotation multiplied by it: powers keep their value
    T = t * size
    return w / force / size, T / np.sqrt(np.einsum("md,md->m", T, T))[:, None]


def sphere_motions(count: int, dimension: int = 6) -> FloatArray:
    """Unit motions spread evenly over the sphere, ``(count, dimension)``, the same in every run.

    The additive recurrence by powers of the generalised golden ratio fills the unit cube evenly; the normal quantile
    of each number makes it evenly spread over directions.
    """
    # fixed-point iteration for the root of x^(d + 1) = x + 1
    root = 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (dimension + 1))
    u = (0.5 + np.outer(np.arange(1, count + 1), root ** -np.arange(1.0, dimension + 1))) % 1
    # independent normal numbers have a density that depends on the length alone: no direction is favoured
    x = ndtri(u)
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def sample_rank(W: ArrayLike) -> int:
    """Dimension of the space that wrenches ``(m, d)`` span; `FLAT_RATIO` of the largest singular value is none."""
    values = np.linalg.svd(np.asarray(W, float), compute_uv=False)
    return int((values > FLAT_RATIO * values.max(initial=0.0)).sum())


def pressed(W: ArrayLike) -> NDArray[np.bool_]:
    """Which wrenches ``(m, d)`` are not zero, or the rounding of that (`ZERO_SHARE`): the others fit no surface."""
    W = np.asarray(W, float)
    squares = np.einsum("md,md->m", W, W)
    return np.asarray(squares > ZERO_SHARE**2 * squares.max())


def principal_frame(W: FloatArray) -> tuple[FloatArray, FloatArray, FitFlag]:
    """Coordinates ``w = B y`` in the span of the samples, in which their components have the mean square 1.

    Returns the map ``B (d, r)`` onto the span, whose rank is `sample_rank`, the samples ``Y (m, r)``, and whether they
    are flat or thin.
    """
    # of W itself: the product W'W squares the ratio of long and short directions, and loses the short
    U, values, V = np.linalg.svd(W, full_matrices=False)
    r = int((values > FLAT_RATIO * values[0]).sum())
    flag = FitFlag.CLEAN if r == W.shape[1] else FitFlag.RANK_DEFICIENT
    flag |= FitFlag.THIN if values[r - 1] < THIN_RATIO * values[0] else FitFlag.CLEAN
    # columns of U have the length 1: times sqrt(m) their mean square is 1
    size = np.sqrt(len(W))
    V[np.abs(V) < 1e-15] = 0.0  # components that no sample has stay exactly zero
    return V[:r].T * (values[:r] / size), U[:, :r] * size, flag


class FitErrors(NamedTuple):
    """Mean errors of a model over samples.

    ``E1 = mean |P - 1|`` grows with the degree of the polynomial: models of different degree compare by ``Erad = mean
    |P^(-1/degree) - 1|``, the error of the radius. ``Edir`` is the mean angle between the gradient and the motion
    [deg]; results of a study and of ``softjaw.fit_ellipsoid`` have it in rad.
    """

    E1: float
    Erad: float
    Edir: float


def fit_error(model: LimitSurface, W: ArrayLike, T: ArrayLike) -> FitErrors:
    """Errors of ``model`` on wrenches ``W (m, d)`` with unit motions ``T (m, d)``.

    Samples without a wrench say nothing about a surface and are left out. A flat model has the radius 0 (``Erad`` 1,
    ``E1`` infinite) for wrenches out of its span, and is normal to every motion out of it: its angle is the one
    between the motion and the nearest of its normals. Where the polynomial is not above `ZERO_SHARE` the radius is
    infinite.
    """
    W, motions = (np.asarray(X, float)[pressed(W)] for X in (W, T))
    errors = np.abs(model.value(W) - 1), np.abs(radii(model, W) - 1)
    angles = np.degrees(_angles(model.gradient(W), motions, model.span))
    return FitErrors(*(float(error.mean()) for error in (*errors, angles)))


def overclaim(model: LimitSurface, W: ArrayLike) -> float:
    """Largest share by which ``model`` claims more than wrenches ``W (m, d)`` of a true surface, along them.

    0 where it claims nowhere more, infinite where it has no end. Samples without a wrench are left out.
    """
    return max(float(radii(model, np.asarray(W, float)[pressed(W)]).max()) - 1.0, 0.0)


def radii(model: LimitSurface, W: FloatArray) -> FloatArray:
    """Factors that bring normalised wrenches ``(m, d)`` onto a surface; infinite where ``P`` is not above rounding."""
    P = model.value(W)
    with np.errstate(divide="ignore"):
        return np.where(P > ZERO_SHARE, P, 0.0) ** (-1 / model.degree)


def _angles(G: FloatArray, T: FloatArray, span: FloatArray) -> FloatArray:
    """Angles ``(m,)`` between motions and all that is normal to a surface: gradients plus what leaves its span."""
    u = _unit(G)
    if span.shape[1] < len(span):
        across = T - T @ span @ span.T
        # no normal of a flat body points against the gradient
        u = _unit(across + np.maximum(((T - across) * u).sum(axis=1, keepdims=True), 0.0) * u)
    # The half-angle form keeps its digits where the arc cosine of a number near one loses them; it is a right angle for
    # a motion against the gradient, which has no part along a normal.
    return 2 * np.arctan2(np.linalg.norm(u - T, axis=1), np.linalg.norm(u + T, axis=1))


def _unit(v: FloatArray) -> FloatArray:
    """Rows of length 1, those of rounding 0."""
    length = np.linalg.norm(v, axis=1, keepdims=True)
    return v * (length > OUT_OF_SPAN) / np.where(length > 0, length, 1.0)
