"""The limit surface of a finger, from the numbers that a file holds of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softjaw.lsfit.ellipsoid import Ellipsoid, TiltedEllipsoid
from softjaw.lsfit.form import exponents
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.surface import LimitSurface

FloatArray = NDArray[np.float64]


def fitted_surface(coefficients: FloatArray, matrix: FloatArray) -> LimitSurface | None:
    """The quartic or the ellipsoid in ``(f_x, f_y, tau_z / rho) / (mu S)``; None where neither was fitted.

    Parameters
    ----------
    coefficients : (15,) array
        As in ``limit_surface/coefficients``; NaN where an ellipsoid was fitted [-].
    matrix : (3, 3) array
        As in ``limit_surface/matrix``; NaN where a quartic was fitted [-].
    """
    if np.isfinite(coefficients).all():
        return Quartic(coefficients, exponents(3, 4))
    return TiltedEllipsoid(matrix) if np.isfinite(matrix).all() else None


def finger_surface(fingers: Callable[..., FloatArray], finger: int, model: str, fitted: bool) -> LimitSurface:
    """Limit surface of finger 1 or 2 in ``(f_x, f_y, tau_z)`` [N, N, N m].

    Parameters
    ----------
    fingers : callable
        Gives a quantity of both fingers ``(2, ...)`` by its name and a friction model.
    finger : 1 or 2
    model : str
        Friction model.
    fitted : bool
        Whether the fitted surface is asked for; else the ellipsoid from three motions.

    Raises
    ------
    ValueError
        Another number of a finger; no fitted surface.
    """
    if finger not in (1, 2):
        raise ValueError(f"finger is {finger!r}: expected 1 or 2")
    i = finger - 1
    if not fitted:
        return Ellipsoid(fingers("limit_surface/semi_axes", model)[i] * fingers("S")[i])
    P, A = (fingers(f"limit_surface/{name}", model)[i] for name in ("coefficients", "matrix"))
    if (surface := fitted_surface(P, A)) is None:
        raise ValueError("no surface was fitted, or the cases around have no fitted one of one kind: take fitted=False")
    # The largest force of the planar model is mu S.
    return surface.scaled(fingers("f_x_max", "pcm")[i] * np.array([1.0, 1.0, fingers("limit_surface/rho")[i]]))
