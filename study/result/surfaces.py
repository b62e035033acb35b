"""The fitted limit surface of a finger, from the coefficients or the matrix that a file holds of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from softjaw.lsfit.surface import LimitSurface


def fitted_surface(coefficients: NDArray[np.float64], matrix: NDArray[np.float64]) -> LimitSurface | None:
    """The quartic or the ellipsoid in ``(f_x, f_y, tau_z / rho) / (mu S)``; None where neither was fitted.

    Parameters
    ----------
    coefficients : (15,) array
        As in ``limit_surface/coefficients``; NaN where an ellipsoid was fitted [-].
    matrix : (3, 3) array
        As in ``limit_surface/matrix``; NaN where a quartic was fitted [-].
    """
    # compiled loops, which a look-up does without until a surface is asked for
    from softjaw.lsfit.ellipsoid import TiltedEllipsoid
    from softjaw.lsfit.form import exponents
    from softjaw.lsfit.quartic import Quartic

    if np.isfinite(coefficients).all():
        return Quartic(coefficients, exponents(3, 4))
    return TiltedEllipsoid(matrix) if np.isfinite(matrix).all() else None
