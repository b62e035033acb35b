"""Quartics as limit surfaces, and the search for their points with given normals."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.lsfit.form import (
    derivative,
    directions,
    exponents,
    half_sphere_monomials,
    hessian_tensor,
    monomials,
    quartic_shadow,
    quartic_volume,
    round_frame,
    substitute,
)
from softjaw.lsfit.surface import FitError, FitFlag, LimitSurface, rows, supported_shadow

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Quartic(LimitSurface):
    """Level set ``P(w) = sum_k c_k w^E_k = 1`` of a homogeneous polynomial of degree 4.

    Parameters
    ----------
    coefficients : (k,) array
        ``c``, one for each monomial, in the order of `lsfit.form.exponents`.
    dimension : int
        Number of components of a wrench.
    flag : FitFlag
        What the reader should know.
    ball_map : (d, d) array, optional
        Map from a ball onto an ellipsoid near the body, where one is known.
    units : (d,) array, optional
        Sizes of the components in which all coefficients are equally exact, 1 if not given.
    """

    coefficients: FloatArray
    dimension: int = 3
    flag: FitFlag = FitFlag.CLEAN
    ball_map: FloatArray | None = field(default=None, repr=False)
    units: FloatArray | None = field(default=None, repr=False)
    degree = 4

    @property
    def exponents(self) -> NDArray[np.int64]:
        """Exponents of the monomials ``(k, d)``."""
        return exponents(self.dimension, 4)

    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, d) -> (m,)``."""
        return monomials(rows(w, self.dimension), self.exponents) @ self.coefficients

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient of ``P``, ``(m, d) -> (m, d)``."""
        cubic = monomials(rows(w, self.dimension), exponents(self.dimension, 3))
        return cubic @ (derivative(self.dimension, 4) @ self.coefficients).T

    @cached_property
    def frame(self) -> FloatArray:
        """Map ``L (d, d)`` from a body that is nearly round onto this one, which has to be closed."""
        # a fit knows the frame in which its coefficients are exact
        if self.ball_map is not None:
            return self.ball_map
        units = np.ones(self.dimension) if self.units is None else self.units
        even = Quartic(self.coefficients * np.prod(units**self.exponents, axis=1), self.dimension)
        return units[:, None] * round_frame(even.value, self.dimension, 4)

    @property
    def ellipsoid(self) -> Ellipsoid:
        """An ellipsoid near the body."""
        return Ellipsoid(self.frame, self.flag)

    @cached_property
    def volume(self) -> float:
        """Volume of the body, to 1e-12 of itself in up to three dimensions and 1e-3 or better beyond."""
        V = quartic_volume(self._round.coefficients, self.dimension)
        return abs(float(np.linalg.det(self.frame))) * V

    @cached_property
    def shadow_area(self) -> float:
        """Area of the shadow on the first two components; that of the hull in more than three dimensions."""
        if self.dimension == 3:
            return quartic_shadow(self.coefficients, np.linalg.norm(self.frame, axis=1))
        if self.dimension == 2:
            return self.volume
        return supported_shadow(self.support, self.dimension) if self.dimension > 1 else 0.0

    def support_points(self, t: ArrayLike) -> FloatArray:
        """Points of the surface farthest along ``t``, ``(m, d) -> (m, d)``; 0 for ``t = 0``. It has to be convex."""
        T = rows(t, self.dimension) @ self.frame
        length = np.linalg.norm(T, axis=1)
        moving = length > 0
        # unit normals: the tolerances of the search are those of a problem of size one
        T = T[moving] / length[moving, None]
        out = np.zeros((len(moving), self.dimension))
        out[moving] = farthest_points(self._tensor, T, self._starts(T)) @ self.frame.T
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
        f = np.asarray(factors, float)
        ball_map = None if self.ball_map is None else f[:, None] * self.ball_map
        units = np.abs(f) if self.units is None else np.abs(f) * self.units
        return Quartic(
            self.coefficients / np.prod(f**self.exponents, axis=1), self.dimension, self.flag, ball_map, units
        )

    @cached_property
    def _round(self) -> Quartic:
        return Quartic(substitute(self.coefficients, self.exponents, self.frame), self.dimension)

    @cached_property
    def _tensor(self) -> FloatArray:
        return hessian_tensor(self._round.coefficients, self.dimension)

    @cached_property
    def _surface_points(self) -> FloatArray:
        n = 30 * self.dimension**2
        P = half_sphere_monomials(self.dimension, n) @ self._round.coefficients
        return directions(self.dimension, n) * (P**-0.25)[:, None]


def farthest_points(tensor: FloatArray, T: FloatArray, w: FloatArray) -> FloatArray:
    """Points ``(m, d)`` of a closed convex quartic surface farthest along unit normals ``T``, by Newton's method.

    ``P(w) - t . w`` is smallest on the ray through the point of the surface that is wanted. Steps are halved until the
    function falls; where the second derivative, ``H_ij = Q_ijkl w_k w_l`` of the symmetric ``tensor``, is singular it
    is shifted. ``w (m, d)`` are points near the ones wanted, of any length. `FitError`: a search does not converge.
    """
    P = _second(tensor, w)[2]
    # along a ray P - t . w is least where 4 P s^3 = t . w; the floor keeps starts across t from collapsing to 0
    along = np.maximum((T * w).sum(axis=1), 1e-3 * np.linalg.norm(w, axis=1))
    w = w * np.cbrt(along / (4 * P))[:, None]
    for _ in range(200):
        H, g, P = _second(tensor, w)
        values, V = np.linalg.eigh(H)
        values = np.maximum(values, 1e-13 * np.einsum("mii->m", H)[:, None])
        s = np.einsum("mij,mj->mi", V, np.einsum("mij,mi->mj", V, T - g) / values)
        fall, phi = (s * (T - g)).sum(axis=1), P - (T * w).sum(axis=1)
        done = fall <= 1e-12 * np.abs(phi)  # this step squares what is left
        length = np.ones(len(w))
        for _ in range(60):
            y = w + length[:, None] * s
            # the last step changes phi by less than its rounding: a test of descent would judge noise
            good = (_second(tensor, y)[2] - (T * y).sum(axis=1) <= phi - 1e-4 * length * fall) | done
            if good.all():
                break
            length[~good] *= 0.5
        w = y
        if done.all():
            # the minimum lies on the ray through the point wanted, not on the surface
            return w / (_second(tensor, w)[2] ** 0.25)[:, None]
    raise FitError(f"{(~done).sum()} of {len(T)} supports did not converge: scale the quartic to reaches of about one")


def _second(tensor: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Second derivative ``(m, d, d)``, gradient ``(m, d)`` and value ``(m,)`` at ``w (m, d)``."""
    d = w.shape[1]
    H = ((w[:, :, None] * w[:, None, :]).reshape(-1, d * d) @ tensor.reshape(d * d, d * d)).reshape(-1, d, d)
    # Euler: a form of degree 4 has the gradient H w / 3 and the value g . w / 4
    g = np.einsum("mij,mj->mi", H, w) / 3
    return H, g, (g * w).sum(axis=1) / 4
