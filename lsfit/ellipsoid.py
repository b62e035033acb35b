"""Ellipsoids as limit surfaces, along the components or in any position, and their fits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from softjaw.lsfit.form import exponents, monomials
from softjaw.lsfit.samples import FLAT_RATIO, pressed, principal_frame
from softjaw.lsfit.sos import least_in_cone, parts, quadratic_map
from softjaw.lsfit.surface import ZERO_SHARE, FitFlag, FloatArray, LimitSurface, rows

MAX_REACH_RATIO = 10.0  # of a fitted surface to the largest sample
WEAK = 1e-10  # share of the largest eigenvalue of normal equations, below which the fit is flagged as underdetermined


@dataclass(frozen=True, eq=False)
class Ellipsoid(LimitSurface):
    """Ellipsoid ``{B y : |y| <= 1}`` in any number of dimensions, image of the unit ball.

    A contact that cannot carry some load has a flat one: a disc, a segment or a point, and `rank` tells which.

    ``B (d, r)``: map with independent columns; flat if ``r < d``; ``flag``: what the reader should know.

    >>> disc = Ellipsoid.of_axes([1.0, 1.0, 0.0])
    >>> disc.rank, disc.volume, disc.holds([0.5, 0.5, 0.0]), disc.holds([0.0, 0.0, 1e-9])
    (2, 0.0, array([ True]), array([False]))
    """

    B: FloatArray
    flag: FitFlag = FitFlag.CLEAN
    degree = 2

    @classmethod
    def of_axes(cls, semi_axes: ArrayLike, flag: FitFlag = FitFlag.CLEAN) -> Ellipsoid:
        """Ellipsoid with semi-axes ``(d,)`` along the components, flat where one is 0."""
        axes = np.array(semi_axes, dtype=float)
        return cls(np.diag(axes)[:, axes > 0], flag)

    @classmethod
    def of_matrix(cls, A: FloatArray) -> Ellipsoid:
        """Ellipsoid ``w' A w <= 1``; ``A (d, d)`` symmetric, and positive definite to `ZERO_SHARE`."""
        # axes of very different length keep their digits if they are made equal first
        size = 1 / np.sqrt(np.diagonal(A))
        return cls(size[:, None] * np.linalg.inv(np.linalg.cholesky(A * np.outer(size, size))).T)

    @property
    def F(self) -> FloatArray:
        """The map ``B``, from the unit ball; surfaces that are no ellipsoids have none."""
        return self.B

    @property
    def A(self) -> FloatArray:
        """Matrix ``(d, d)`` of ``P(w) = w' A w``; the pseudo-inverse of ``B B'`` for a flat body."""
        return self.inverse.T @ self.inverse

    @property
    def shadow_area(self) -> float:
        """Area of the shadow on the plane of the first two components."""
        # the shadow of a ball's image is an ellipse, with the singular values of two rows as axes
        s = np.linalg.svd(self.B[:2], compute_uv=False)
        return math.pi * float(s[0] * s[1]) if len(s) > 1 else 0.0

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, d) -> (m,)``."""
        return np.linalg.norm(rows(t, self.dimension) @ self.B, axis=1)

    @property
    def _volume(self) -> float:
        return math.pi ** (self.rank / 2) / math.gamma(self.rank / 2 + 1)

    def _value(self, Y: FloatArray) -> FloatArray:
        # through the map and not A, as a sum of squares cannot turn negative by rounding
        return (Y**2).sum(axis=1)

    def _gradient(self, Y: FloatArray) -> FloatArray:
        return 2 * Y

    def _farthest(self, T: FloatArray) -> FloatArray:
        length = np.linalg.norm(T, axis=1, keepdims=True)
        return T / np.where(length > 0, length, 1.0)


def three_motion_ellipsoid(f_x: float, f_y: float, tau_z: float, rho: float) -> Ellipsoid:
    """The paper's limit surface: ellipsoid through the largest forces along x and y and the largest torque.

    A force [N] or torque [N m] (by ``rho``, the length of the contact [m]) below `ZERO_SHARE` of the largest force is
    the rounding of a contact that carries none; its semi-axis is 0. The ellipsoid encloses more than the exact limit
    surface: 11 to 13 % more volume for usual patches.
    """
    least = ZERO_SHARE * max(f_x, f_y)
    return Ellipsoid.of_axes([x if x > least * unit else 0.0 for x, unit in ((f_x, 1), (f_y, 1), (tau_z, rho))])


def axis_aligned_ellipsoid(W: ArrayLike) -> Ellipsoid:
    """Ellipsoid ``sum a_i w_i^2`` with the least mean square of ``P(w) - 1``, all ``a_i`` positive.

    ``W (m, 3)`` are normalised wrenches [-]. Components that no sample has get the semi-axis 0. Samples that would make
    it endless (``a_i`` not above 1e-9) give a semi-axis of `MAX_REACH_RATIO` times their largest component, and the
    flag says so.
    """
    W = np.asarray(W, float)[pressed(W)]
    B, _, flag = principal_frame(W)
    reach = np.abs(W).max(axis=0)
    # each component by its own reach: the squares of unequal ones would lose the small ones' digits
    used = reach > FLAT_RATIO * reach.max()
    X, floor = (W[:, used] / reach[used]) ** 2, MAX_REACH_RATIO**-2
    # coefficients are the floor plus what nnls finds: so no axis is longer than MAX_REACH_RATIO allows
    right = 1 - floor * X.sum(axis=1)
    if B.shape[1] < used.sum() or len(W) < used.sum():  # squares may depend on each other: lean towards equal ones
        X, right = np.vstack([X, 1e-5 * np.eye(X.shape[1])]), np.append(right, np.full(X.shape[1], 1e-5))
    a, _ = nnls(X, right)
    flag |= FitFlag.BOUNDED if (a <= 1e-9).any() else FitFlag.CLEAN
    axes = np.zeros(3)
    axes[used] = reach[used] / np.sqrt(a + floor)
    return Ellipsoid.of_axes(axes, flag)


def full_ellipsoid(W: ArrayLike) -> Ellipsoid:
    """Ellipsoid ``w' A w`` with the least mean square of ``P(w) - 1``, in any number of dimensions.

    ``W (m, d)`` are normalised wrenches [-]. It is flat, and flagged, if they lie in a subspace. Where they do not
    determine ``A``, it is the ellipsoid nearest to their principal axes; where they would make it endless, the best one
    that reaches at most `MAX_REACH_RATIO` times as far as they do.
    """
    B, Y, flag = principal_frame(np.asarray(W, float)[pressed(W)])
    A, more = _quadratic_form(Y)
    # A = L L' makes the body |L' y| <= 1, the image of the ball under the inverse of L'
    return Ellipsoid(B @ np.linalg.inv(np.linalg.cholesky(A)).T, flag | more)


def _quadratic_form(Y: FloatArray) -> tuple[FloatArray, FitFlag]:
    """Matrix ``A (r, r)`` of the fit to samples with the mean squares 1, and what to know about it."""
    m, r = Y.shape
    E = exponents(r, 2)
    M = monomials(Y, E)
    # components of mean square 1: |y|^2 / r is 1 on average
    ball = (E == 2).any(axis=1) / r
    N, b = M.T @ M / m, np.full(m, 1 / m) @ M
    a, flag = nearest_solution(N, b, ball)
    place, triangle = parts(quadratic_map, r)
    A = (place @ a).reshape(r, r)
    # this eigenvalue belongs to an axis MAX_REACH_RATIO times as long as the farthest sample
    floor = 1 / (MAX_REACH_RATIO * np.linalg.norm(Y, axis=1).max()) ** 2
    # the linear equations give the best form of all; only one that is open or too long needs the programme
    lowest = np.linalg.eigvalsh(A)[0]
    if lowest >= floor:
        return A, flag if lowest > floor + 1e-9 else flag | FitFlag.BOUNDED
    return (place @ least_in_cone(N, b, triangle, floor)).reshape(r, r), flag | FitFlag.BOUNDED


def nearest_solution(N: FloatArray, b: FloatArray, start: FloatArray) -> tuple[FloatArray, FitFlag]:
    """Solution of the normal equations ``N x = b`` that is nearest to ``start`` if there are many, and a flag.

    Directions below `ZERO_SHARE` are rounding and stay at the start. Between that and `WEAK` they are
    followed, but a part in ``1e-16 / WEAK`` of the solution is rounding there, which the flag says too.
    """
    # unit diagonal: the share of an eigenvalue then says what the data determine, not how long an axis is
    size = 1 / np.sqrt(np.maximum(N.diagonal(), 1e-12 * N.diagonal().max()))
    values, V = np.linalg.eigh(N * np.outer(size, size))
    determined = values > ZERO_SHARE * values[-1]
    V = size[:, None] * V[:, determined]
    # only the difference from the start is solved for, so what data leave open stays there
    x = start + V @ ((V.T @ (b - N @ start)) / values[determined])
    return x, FitFlag.CLEAN if values[0] > WEAK * values[-1] else FitFlag.UNDERDETERMINED
