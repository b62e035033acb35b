"""Ellipsoids as limit surfaces."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """Axis-aligned ellipsoid ``P(w) = sum (w_i / e_i)^2 <= 1``.

    A contact that cannot carry a load along an axis has the semi-axis 0 there: the body is a disc, a segment or a
    point, and `rank` tells which. No semi-axis is ever infinite.

    Parameters
    ----------
    semi_axes : (3,) array
        Largest ``(f_x, f_y, tau_z)``, in units of the caller's choice.

    Examples
    --------
    >>> disc = Ellipsoid([1.0, 1.0, 0.0])
    >>> disc.rank, disc.volume, disc.holds([0.5, 0.5, 0.0]), disc.holds([0.0, 0.0, 1e-9])
    (2, 0.0, True, False)
    """

    semi_axes: FloatArray
    degree = 2

    def __post_init__(self) -> None:
        """Refuse what is no length."""
        axes = np.array(self.semi_axes, dtype=float)
        if axes.shape != (3,) or not np.isfinite(axes).all() or (axes < 0).any():
            raise ValueError(f"semi_axes is {axes.tolist()}: expected three finite numbers that are not negative")
        axes.flags.writeable = False
        object.__setattr__(self, "semi_axes", axes)

    @property
    def rank(self) -> int:
        """Number of semi-axes that are not zero; 3 for a body with a volume."""
        return int((self.semi_axes > 0).sum())

    @property
    def volume(self) -> float:
        """Volume ``4/3 pi e_1 e_2 e_3``."""
        return 4 / 3 * math.pi * float(self.semi_axes.prod())

    @property
    def shadow_area(self) -> float:
        """Area ``pi e_1 e_2`` of the shadow on the plane of the forces."""
        return math.pi * float(self.semi_axes[0] * self.semi_axes[1])

    def value(self, w: ArrayLike) -> FloatArray:
        """``P(w)``, ``(m, 3) -> (m,)``; infinite for loads along an axis that carries none."""
        return np.atleast_1d((self._over_axes(w) ** 2).sum(axis=-1))

    def gradient(self, w: ArrayLike) -> FloatArray:
        """Gradient ``2 w_i / e_i^2``, the direction of motion at ``w``, ``(m, 3) -> (m, 3)``."""
        with np.errstate(divide="ignore"):
            inverse = np.where(self.semi_axes > 0, 1 / self.semi_axes, 0.0)
        return 2 * np.atleast_2d(self._over_axes(w)) * inverse

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, 3) -> (m,)``."""
        return np.linalg.norm(np.atleast_2d(np.asarray(t, float)) * self.semi_axes, axis=1)

    def holds(self, w: ArrayLike) -> bool:
        """Whether the wrench ``w (3,)`` lies in the body, surface included."""
        return bool(self.value(w)[0] <= 1 + 1e-12)

    def _over_axes(self, w: ArrayLike) -> FloatArray:
        w = np.asarray(w, float)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where((self.semi_axes == 0) & (w == 0), 0.0, w / self.semi_axes)


def three_motion_ellipsoid(f_x: float, f_y: float, tau_z: float, rho: float) -> Ellipsoid:
    """The paper's limit surface: ellipsoid through the largest forces along x and y and the largest torque.

    Parameters
    ----------
    f_x, f_y : float
        Largest forces [N].
    tau_z : float
        Largest torque [N m].
    rho : float
        Length of the contact, by which a torque counts as zero [m].

    Notes
    -----
    A torque below ``1e-12 rho max(f)`` is the rounding of a contact that carries none; its semi-axis is 0. The
    ellipsoid encloses more than the exact limit surface: 11 to 13 % more volume for usual patches.
    """
    return Ellipsoid(np.array([f_x, f_y, tau_z if tau_z > 1e-12 * rho * max(f_x, f_y) else 0.0]))
