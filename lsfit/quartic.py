"""Quartics as limit surfaces, and the search for their points with given normals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

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
from softjaw.lsfit.surface import FitError, FitFlag, FloatArray, LimitSurface, supported_shadow


@dataclass(frozen=True, eq=False)
class Quartic(LimitSurface):
    """Image ``{B y : P(y) <= 1}`` of the level set of a homogeneous polynomial ``P(y) = sum_k c_k y^E_k`` of degree 4.

    ``form (k,)``: ``c``, one for each monomial, in the order of `lsfit.form.exponents`; of a closed body; ``B (d, r)``:
    map with independent columns; flat if ``r < d``; ``flag``: what the reader should know.
    """

    form: FloatArray
    B: FloatArray
    flag: FitFlag = FitFlag.CLEAN
    degree = 4

    @classmethod
    def of_coefficients(cls, coefficients: ArrayLike, dimension: int = 3, flag: FitFlag = FitFlag.CLEAN) -> Quartic:
        """The level set of the polynomial of a wrench's components with these `coefficients`."""
        return cls(np.asarray(coefficients, float), np.eye(dimension), flag)

    @cached_property
    def coefficients(self) -> FloatArray:
        """Coefficients ``(k,)`` in a wrench's components; NaN for a flat body, and one that is too thin and tilted."""
        unknown = np.full(len(exponents(self.dimension, 4)), np.nan)
        if self.rank < self.dimension:
            return unknown
        E, reach = exponents(self.rank, 4), np.linalg.norm(self.B, axis=1)
        # rows of one length: what is left of the condition is tilt, which no choice of units undoes
        turn = self.B / reach[:, None]
        # condition of a frame's directions; coefficients lose its fourth power times rounding
        if np.linalg.cond(turn) > 50.0:
            return unknown
        # turned first and stretched last, as a division by units costs a coefficient no digits
        return substitute(self.form, E, np.linalg.inv(turn)) / np.prod(reach**E, axis=1)

    @property
    def frame(self) -> FloatArray:
        """Map ``(d, r)`` from a body that is nearly round onto this one."""
        return self.B @ self._from_round

    @property
    def ellipsoid(self) -> Ellipsoid:
        """An ellipsoid near the body."""
        return Ellipsoid(self.frame, self.flag)

    @cached_property
    def shadow_area(self) -> float:
        """Area of the shadow on the first two components; that of the hull in more than three dimensions."""
        if self.rank < 3:
            # the shadow of a plane body is its linear image
            return abs(float(np.linalg.det(self.B[:2]))) * self._volume if self.rank == 2 else 0.0
        if self.dimension == 3 and np.isfinite(self.coefficients).all():
            return quartic_shadow(self.coefficients, np.linalg.norm(self.frame, axis=1))
        return supported_shadow(self.support, self.dimension)

    @property
    def _volume(self) -> float:
        """To 1e-12 of itself in up to three dimensions and 1e-3 or better beyond."""
        return abs(float(np.linalg.det(self._from_round))) * quartic_volume(self._round, self.rank)

    def _value(self, Y: FloatArray) -> FloatArray:
        return monomials(Y, exponents(self.rank, 4)) @ self.form

    def _gradient(self, Y: FloatArray) -> FloatArray:
        return monomials(Y, exponents(self.rank, 3)) @ (derivative(self.rank, 4) @ self.form).T

    def _farthest(self, T: FloatArray) -> FloatArray:
        T = T @ self._from_round
        length = np.linalg.norm(T, axis=1)
        moving = length > 0
        # unit normals: the tolerances of the search are those of a problem of size one
        T = T[moving] / length[moving, None]
        out = np.zeros((len(moving), self.rank))
        out[moving] = farthest_points(self._tensor, T, self._starts(T)) @ self._from_round.T
        return out

    def _starts(self, T: FloatArray) -> FloatArray:
        """Samples of the surface from which to search, the highest along each row of ``T``."""
        Y = self._surface_points
        along = T @ Y.T
        # the body is even, so samples of half a sphere do: the sign tells the side
        row, column = np.arange(len(along)), np.abs(along).argmax(axis=1)
        return Y[column] * np.sign(along[row, column])[:, None]

    @cached_property
    def _from_round(self) -> FloatArray:
        """Map ``(r, r)`` from a body that is nearly round, as that of a fit is in its own coordinates."""
        return round_frame(self._value, self.rank, 4)

    @cached_property
    def _round(self) -> FloatArray:
        """Coefficients of that body."""
        return substitute(self.form, exponents(self.rank, 4), self._from_round)

    @cached_property
    def _tensor(self) -> FloatArray:
        return hessian_tensor(self._round, self.rank)

    @cached_property
    def _surface_points(self) -> FloatArray:
        n = 30 * self.rank**2
        P = half_sphere_monomials(self.rank, n) @ self._round
        return directions(self.rank, n) * (P**-0.25)[:, None]


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
