"""Proofs that a quartic is convex: its Gram matrix, and the smallest curvature on the unit sphere."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softjaw.lsfit.definite import definite_freedom
from softjaw.lsfit.form import substitute
from softjaw.lsfit.lowest import smallest_eigenvalue
from softjaw.lsfit.quartic_surface import Quartic
from softjaw.lsfit.sos import MARGIN, ball_freedom, gram_matrix
from softjaw.lsfit.surface import Image

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

        Searched from every direction that is softer than its neighbours; the proof is the Gram matrix.
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
