"""Proofs that a quartic is convex: its Gram matrix, and the smallest curvature on the unit sphere."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lsfit.definite import definite_freedom
from lsfit.form import hessian_tensor, substitute
from lsfit.geometry import directions
from lsfit.quartic_surface import Quartic
from lsfit.sos import MARGIN, ball_freedom, gram_matrix
from lsfit.surface import Image

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Certificate:
    """What proves a quartic ``P`` convex.

    Parameters
    ----------
    gram_eigenvalue : float
        Smallest eigenvalue of ``gram``. Not negative: ``P`` is convex.
    gram : (r * r, r * r) array
        ``Q`` with ``z' Hess p(y) z = (z x y)' Q (z x y)`` for ``p(y) = P(B y)`` and the products ``z_i y_j``.
    frame : (d, r) array
        ``B``.
    by : str
        ``least squares`` if the best quartic is convex by itself, else ``semidefinite programme``.
    surface : Quartic or Image
        What is proved convex.
    """

    gram_eigenvalue: float
    gram: FloatArray
    frame: FloatArray
    by: str
    surface: Quartic | Image = field(repr=False)

    @cached_property
    def smallest_eigenvalue(self) -> float:
        """Smallest eigenvalue of the second derivative of ``P`` over unit wrenches (of a flat body, those in its span).

        Searched from many starts; the proof is the Gram matrix.
        """
        # Curvature is at least this. Rounding of very unequal coefficients can hide it from the search.
        bound = self.gram_eigenvalue * np.linalg.norm(self.frame, 2) ** -4
        surface = self.surface
        if isinstance(surface, Quartic):
            return max(smallest_eigenvalue(surface.coefficients, surface.dimension), bound)
        R, inner = np.linalg.qr(surface.B)[1], surface.inner
        assert isinstance(inner, Quartic)
        turned = substitute(inner.coefficients, inner.exponents, np.linalg.inv(R))
        return max(smallest_eigenvalue(turned, inner.dimension), bound)


def certify(v: FloatArray, dimension: int) -> FloatArray | None:
    """Gram matrix of the quartic with coefficients ``v`` if one is positive definite, else None.

    The one nearest to that of a ball is tried first, then the others are searched, until one is found or none can be.
    """
    gram = gram_matrix(v, ball_freedom(dimension), dimension)
    if np.linalg.eigvalsh(gram)[0] >= MARGIN:
        return gram
    change = definite_freedom(gram, dimension, 2 * MARGIN)
    if change is None:
        return None
    gram = gram_matrix(v, change + ball_freedom(dimension), dimension)
    return gram if np.linalg.eigvalsh(gram)[0] >= MARGIN else None


def smallest_eigenvalue(v: FloatArray, dimension: int) -> float:
    """Smallest eigenvalue of the second derivative over the unit sphere.

    ``z' H(u) z`` is the same with ``u`` and ``z`` exchanged, so taking the softest direction in turn can only lower it;
    this starts from the lowest of several hundred directions, and Newton's method finishes.

    Parameters
    ----------
    v : (k,) array
        Coefficients in the order of `lsfit.form.exponents`.
    """
    d = dimension
    Q = hessian_tensor(v, d).reshape(d * d, d * d)
    u = directions(d, 200 if d <= 3 else 1000)
    H = ((u[:, :, None] * u[:, None, :]).reshape(-1, d * d) @ Q).reshape(-1, d, d)
    u = u[np.argsort(lowest_eigenvalues(H))[:4]]
    for _ in range(5):
        H = ((u[:, :, None] * u[:, None, :]).reshape(-1, d * d) @ Q).reshape(-1, d, d)
        values, vectors = np.linalg.eigh(H)
        u, z = vectors[:, :, 0], u
    best = int(np.argmin(values[:, 0]))
    return min(float(values[best, 0]), _polished(Q.reshape(d, d, d, d), z[best], u[best]))


def _polished(Q: FloatArray, u: FloatArray, z: FloatArray) -> float:
    """Smallest eigenvalue at the stationary pair next to ``u`` and ``z``: ``H(u) z = s z``, ``H(z) u = s u``.

    Taking turns gets there slowly where the curvature is flat; Newton's method does not. Every value at a unit ``u`` is
    one that occurs, so a step that goes astray does no harm.
    """
    d = len(u)
    lowest = np.inf
    for _ in range(4):
        mixed = np.einsum("ijkl,j,l->ik", Q, u, z)
        Hu, Hz = np.einsum("ijkl,k,l->ij", Q, u, u), np.einsum("ijkl,k,l->ij", Q, z, z)
        s = float(z @ Hu @ z)
        J = np.zeros((2 * d + 2, 2 * d + 2))
        J[:d, :d], J[:d, d:-2], J[d:-2, :d], J[d:-2, d:-2] = Hz, 2 * mixed, 2 * mixed.T, Hu
        J[: 2 * d, : 2 * d] -= s * np.eye(2 * d)
        J[:d, -2] = J[-2, :d] = u
        J[d:-2, -1] = J[-1, d:-2] = z
        step = np.linalg.lstsq(J, np.concatenate([s * u - Hz @ u, s * z - Hu @ z, [0.0, 0.0]]), rcond=1e-9)[0]
        u, z = u + step[:d], z + step[d:-2]
        u, z = u / np.linalg.norm(u), z / np.linalg.norm(z)
        lowest = min(lowest, float(np.linalg.eigvalsh(np.einsum("ijkl,k,l->ij", Q, u, u))[0]))
        if np.linalg.norm(step[:-2]) < 1e-8:
            break
    return lowest


def lowest_eigenvalues(H: FloatArray) -> FloatArray:
    """Smallest eigenvalues of symmetric matrices, ``(m, d, d) -> (m,)``; in 3-D from the roots of the cubic."""
    if H.shape[1] != 3:
        return np.linalg.eigvalsh(H)[:, 0]
    mean = (H[:, 0, 0] + H[:, 1, 1] + H[:, 2, 2]) / 3
    a, b, c = H[:, 0, 0] - mean, H[:, 1, 1] - mean, H[:, 2, 2] - mean
    f, g, h = H[:, 1, 2], H[:, 0, 2], H[:, 0, 1]
    p = np.sqrt((a * a + b * b + c * c + 2 * (f * f + g * g + h * h)) / 6) + 1e-300
    det = (a * (b * c - f * f) - h * (h * c - f * g) + g * (h * f - b * g)) / (2 * p**3)
    return mean + 2 * p * np.cos((np.arccos(np.clip(det, -1, 1)) + 2 * np.pi) / 3)
