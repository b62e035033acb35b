"""Quartics as limit surfaces, and the search for their points with given normals."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.ellipsoid import TiltedEllipsoid
from softjaw.lsfit.form import (
    derivative,
    directions,
    exponents,
    half_sphere_monomials,
    hessian_tensor,
    monomials,
    places,
    quartic_shadow,
    quartic_volume,
    round_frame,
    substitute,
)
from softjaw.lsfit.lowest import refuse_open
from softjaw.lsfit.surface import FitError, FitFlag, LimitSurface, checked_factors, rows, supported_shadow

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Quartic(LimitSurface):
    """Level set ``P(w) = sum_k c_k w^E_k = 1`` of a homogeneous polynomial of degree 4.

    Parameters
    ----------
    coefficients : (k,) array
        ``c``, one for each monomial.
    exponents : (k, d) array
        ``E``, each row with the sum 4.
    flag : FitFlag
        What the reader should know.
    ball_map : (d, d) array, optional
        Map from a ball onto an ellipsoid near the body, where one is known.
    units : (d,) array, optional
        Sizes of the components in which all coefficients are equally exact, 1 if not given. Measures of the body ask
        whether it is closed, and what is rounding is judged in these units (or in those of ``ball_map``).
    """

    coefficients: FloatArray
    exponents: NDArray[np.int64]
    flag: FitFlag = FitFlag.CLEAN
    ball_map: FloatArray | None = field(default=None, repr=False)
    units: FloatArray | None = field(default=None, repr=False)
    degree = 4

    def __post_init__(self) -> None:
        """Bring the monomials into the order of `lsfit.form.exponents`, and refuse what is no quartic."""
        c, E = np.array(self.coefficients, float), np.asarray(self.exponents, dtype=np.int64)
        if E.ndim != 2 or len(E) == 0 or (E < 0).any() or (E.sum(axis=1) != 4).any():
            raise ValueError("exponents: expected rows of whole numbers (k, d), none negative, each with the sum 4")
        if c.shape != (len(E),) or not np.isfinite(c).all():
            raise ValueError(
                f"coefficients has shape {c.shape}: expected {len(E)} finite numbers, one for each monomial"
            )
        order = exponents(E.shape[1], 4)
        # fits pass the cached array itself, which is in order
        if E is not order:
            place = places(E.shape[1], 4)
            sorted_c = np.zeros(len(order))
            # a monomial may be listed twice; an assignment would keep its last coefficient only
            np.add.at(sorted_c, [place[tuple(row)] for row in E.tolist()], c)
            c = sorted_c
        c.flags.writeable = False
        object.__setattr__(self, "coefficients", c)
        object.__setattr__(self, "exponents", order)

    @property
    def dimension(self) -> int:
        """Number of components of a wrench."""
        return self.exponents.shape[1]

    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, d) -> (m,)``."""
        return monomials(rows(w, self.dimension), self.exponents) @ self.coefficients

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient of ``P``, ``(m, d) -> (m, d)``."""
        cubic = monomials(rows(w, self.dimension), exponents(self.dimension, 3))
        return cubic @ (derivative(self.dimension, 4) @ self.coefficients).T

    def hessian(self, w: ArrayLike) -> FloatArray:
        """Second derivatives of ``P``, ``(m, d) -> (m, d, d)``."""
        W, d = rows(w, self.dimension), self.dimension
        return ((W[:, :, None] * W[:, None, :]).reshape(-1, d * d) @ self.tensor.reshape(d * d, d * d)).reshape(
            -1, d, d
        )

    @cached_property
    def tensor(self) -> FloatArray:
        """Symmetric ``Q (d, d, d, d)`` with the second derivatives ``H_ij(w) = Q_ijkl w_k w_l``."""
        return hessian_tensor(self.coefficients, self.dimension)

    @cached_property
    def frame(self) -> FloatArray:
        """Map ``L (d, d)`` from a body that is nearly round onto this one.

        Raises
        ------
        OpenBodyError, UndecidedError
            If the level set is not closed, or not known to be.
        """
        # a fit knows the frame in which its coefficients are exact; it judges better than the components do
        if self.ball_map is not None:
            refuse_open(substitute(self.coefficients, self.exponents, self.ball_map), self.dimension, self.ball_map)
            return self.ball_map
        units = np.ones(self.dimension) if self.units is None else self.units
        even = Quartic(self.coefficients * np.prod(units**self.exponents, axis=1), self.exponents)
        refuse_open(even.coefficients, self.dimension, np.diag(units))
        return units[:, None] * round_frame(even.value, self.dimension, 4)

    @property
    def ellipsoid(self) -> TiltedEllipsoid:
        """An ellipsoid near the body."""
        return TiltedEllipsoid.of_ball(self.frame, self.flag)

    @cached_property
    def volume(self) -> float:
        """Volume of the body, to 1e-12 of itself in up to three dimensions and 1e-3 or better beyond."""
        V = quartic_volume(self._round.coefficients, self.dimension)
        return abs(float(np.linalg.det(self.frame))) * V

    @cached_property
    def shadow_area(self) -> float:
        """Area of the shadow on the plane of the first two components; that of the hull in more than three dimensions.

        Raises
        ------
        OpenBodyError, UndecidedError
            If the level set is not closed, or not known to be.
        """
        if self.dimension == 3:
            return quartic_shadow(self.coefficients, np.linalg.norm(self.frame, axis=1))
        if self.dimension == 2:
            return self.volume
        return supported_shadow(self.support, self.dimension) if self.dimension > 1 else 0.0

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, d) -> (m,)``; to 1e-12 of itself.

        The body has to be convex.

        Raises
        ------
        OpenBodyError, UndecidedError
            If the level set is not closed, or not known to be.
        FitError
            If a search stops short.
        """
        T = rows(t, self.dimension)
        return (T * self.support_points(T)).sum(axis=1)

    def support_points(self, t: ArrayLike) -> FloatArray:
        """Points of the surface farthest along ``t``, ``(m, d) -> (m, d)``; 0 for ``t = 0``."""
        T = rows(t, self.dimension) @ self.frame
        length = np.linalg.norm(T, axis=1)
        moving = length > 0
        # unit normals: the tolerances of the search are those of a problem of size one
        T = T[moving] / length[moving, None]
        start, points = self._starts(T), np.empty_like(T)
        failed = support_points(self._round.tensor, T, start, points)
        if failed:
            raise FitError(f"{failed} of {len(T)} supports did not converge: scale the quartic to reaches of about one")
        out = np.zeros((len(moving), self.dimension))
        out[moving] = points @ self.frame.T
        return out

    def _starts(self, T: FloatArray) -> FloatArray:
        """Samples of the surface from which to search, the highest along each row of ``T``."""
        Y, starts = self._surface_points, np.empty_like(T)
        # bounds the memory of the product with all samples
        for part in range(0, len(T), 10_000):
            along = T[part : part + 10_000] @ Y.T
            # the body is even, so samples of half a sphere do: the sign tells the side
            row, column = np.arange(len(along)), np.abs(along).argmax(axis=1)
            starts[part : part + 10_000] = Y[column] * np.sign(along[row, column])[:, None]
        return starts

    def scaled(self, factors: ArrayLike) -> Quartic:
        """Image of the body under ``w -> factors * w``, ``(d,)``, factors not zero."""
        f = checked_factors(factors, self.dimension)
        ball_map = None if self.ball_map is None else f[:, None] * self.ball_map
        units = np.abs(f) if self.units is None else np.abs(f) * self.units
        return Quartic(
            self.coefficients / np.prod(f**self.exponents, axis=1), self.exponents, self.flag, ball_map, units
        )

    @cached_property
    def _round(self) -> Quartic:
        return Quartic(substitute(self.coefficients, self.exponents, self.frame), self.exponents)

    @cached_property
    def _surface_points(self) -> FloatArray:
        n = 30 * self.dimension**2
        P = half_sphere_monomials(self.dimension, n) @ self._round.coefficients
        return directions(self.dimension, n) * (P**-0.25)[:, None]


@njit(cache=True)
def support_points(tensor, T, start, out):  # pragma: no cover - compiled
    """Points ``out (m, d)`` of a closed quartic surface farthest along ``T (m, d)``, by Newton's method.

    ``P(w) - t . w`` is smallest on the ray through the point of the surface that is wanted. Steps
    are halved until the function falls; where the second derivative is singular it is shifted.

    Parameters
    ----------
    tensor : (d, d, d, d) array
        ``Q``, symmetric: the second derivative is ``H_ij = Q_ijkl w_k w_l``, the gradient ``H w / 3``.
    T : (m, d) array
        Unit normals.
    start : (m, d) array
        Points near the ones wanted, of any length; the lowest valley near them is found.

    Returns
    -------
    int
        How many of the searches did not converge.
    """
    m, d = T.shape
    H, g, s, y, A = np.empty((d, d)), np.empty(d), np.empty(d), np.empty(d), np.empty((d, d))
    failed = 0
    for n in range(m):
        t = T[n]
        w = start[n].copy()
        P = _second(tensor, w, H, g)
        # along a ray P - t . w is least where 4 P s^3 = t . w; the floor keeps starts across t from collapsing to 0
        along = max(np.dot(t, w), 1e-3 * np.sqrt(np.dot(w, w)))
        w *= (along / (4 * P)) ** (1 / 3)
        P = _second(tensor, w, H, g)
        converged = False
        for _ in range(200):
            size, shift = 0.0, 1e-13
            for i in range(d):
                size += abs(H[i, i])
            while True:
                for i in range(d):
                    s[i] = t[i] - g[i]
                    for j in range(d):
                        A[i, j] = H[i, j]
                    A[i, i] += shift * size
                if _solve(A, s):
                    break
                shift = max(10.0 * shift, 1e-3)
            fall = 0.0
            for i in range(d):
                fall += s[i] * (t[i] - g[i])
            phi = P - np.dot(t, w)
            if converged:
                break
            converged = fall <= 1e-12 * abs(phi)  # one more step squares what is left
            length, new = 1.0, phi
            for _ in range(60):
                y[:] = w + length * s
                P = _second(tensor, y, H, g)
                new = P - np.dot(t, y)
                # the last step changes phi by less than its rounding: a test of descent would judge noise
                if new <= phi - 1e-4 * length * fall or converged:
                    break
                length *= 0.5
            w[:] = y
        if not converged:
            failed += 1
        # the minimum lies on the ray through the point wanted, not on the surface
        out[n] = w / P**0.25
    return failed


@njit(cache=True)
def _second(tensor, w, H, g):  # pragma: no cover - compiled
    """Second derivative and gradient at ``w``, written to ``H`` and ``g``; the value is returned."""
    d = len(w)
    # Euler: a form of degree 4 has the gradient H w / 3 and the value g . w / 4
    P = 0.0
    for i in range(d):
        g[i] = 0.0
        for j in range(d):
            h = 0.0
            for k in range(d):
                for m in range(d):
                    h += tensor[i, j, k, m] * w[k] * w[m]
            H[i, j] = h
            g[i] += h * w[j] / 3
        P += g[i] * w[i] / 4
    return P


@njit(cache=True)
def _solve(A, b):  # pragma: no cover - compiled
    """Solve ``A x = b`` in place by Gauss elimination; False where the symmetric matrix is not positive definite."""
    d = len(b)
    for k in range(d):
        # the pivots of a symmetric matrix are positive just where it is positive definite
        if not A[k, k] > 0.0:
            return False
        for i in range(k + 1, d):
            f = A[i, k] / A[k, k]
            for j in range(k, d):
                A[i, j] -= f * A[k, j]
            b[i] -= f * b[k]
    for k in range(d - 1, -1, -1):
        for j in range(k + 1, d):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]
    return True
