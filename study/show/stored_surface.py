"""Limit surfaces of a case from what its file holds: the exact one through the stored patch, and the fitted ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid, TiltedEllipsoid
from softjaw.lsfit.form import exponents
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.surface import LimitSurface
from softjaw.study.quantities import MODELS
from softjaw.study.result.layout import DONE
from softjaw.study.show.data import Data

AXES = (0, 1, 5)  # of the six components, those of a limit surface


@dataclass(frozen=True)
class StoredSurface:
    """One finger at one case and in one friction model; surfaces are in ``(f_x, f_y, tau_z / rho) / (mu S)``.

    ``unit (3,)`` brings these to N, N, N m; ``patch`` is None where the file holds none, ``chosen`` where no surface
    was fitted.
    """

    unit: np.ndarray
    rho: float
    ellipsoid: LimitSurface
    chosen: LimitSurface | None
    patch: ContactPatch | None
    model: str

    def wrenches(self, twist: np.ndarray) -> np.ndarray | None:
        """Exact wrenches ``(m, 3)`` [-] for motions ``(v_x, v_y, rho omega)``; None without a patch."""
        if self.patch is None:
            return None
        return friction_wrench(self.patch, twist / [1, 1, self.rho], 1.0, self.model)[:, AXES] / self._force

    def samples(self, count: int) -> np.ndarray | None:
        """Exact wrenches of evenly spread motions and of their opposites ``(2 count, 3)`` [-]."""
        found = self.wrenches(fibonacci_twists(count, 1.0))
        return None if found is None else np.vstack([found, -found])

    def outline(self, i: int, j: int, count: int = 90) -> np.ndarray | None:
        """Exact outline of the body's shadow on the plane of two components ``(count, 2)`` [-]."""
        found = self.wrenches(circle(i, j, count))
        return None if found is None else found[:, [i, j]]

    @property
    def _force(self) -> np.ndarray:
        assert self.patch is not None
        S = float((self.patch.pressure * self.patch.area).sum())
        return S * np.array([1.0, 1.0, self.rho])


def circle(i: int, j: int, count: int) -> np.ndarray:
    """Directions at equal steps in the plane of two of three components, ``(count, 3)``."""
    phi = 2 * np.pi * np.arange(count) / count
    t = np.zeros((count, 3))
    t[:, i], t[:, j] = np.cos(phi), np.sin(phi)
    return t


def shadow_outline(surface: LimitSurface, i: int, j: int, count: int = 360) -> np.ndarray:
    """Outline of a body's shadow on the plane of two components ``(count, 2)``, from its support function.

    Where the outward normal is ``(cos phi, sin phi)`` stands the point ``h (cos, sin) + h' (-sin, cos)``.
    """
    t = circle(i, j, count)[:, [i, j]]
    h = surface.support(circle(i, j, count))
    slope = np.fft.irfft(1j * np.arange(count // 2 + 1) * np.fft.rfft(h), count)
    return h[:, None] * t + slope[:, None] * np.column_stack([-t[:, 1], t[:, 0]])


def stored_surface(data: Data, index: tuple[int, ...], finger: int, model: str) -> StoredSurface | None:
    """The limit surfaces of a case, or None where the file does not hold what is needed."""
    m = MODELS.index(model)
    names = ("limit_surface/semi_axes", "limit_surface/rho", "fingers/S", "fingers/f_x_max")
    found = [data.values(name) for name in names]
    if data.status[index] != DONE or any(f is None or not np.isfinite(f[index][finger]).all() for f in found):
        return None
    semi_axes, rho, S, f_x = (f[index][finger] for f in found if f is not None)
    if not (S > 0 and rho > 0 and f_x[MODELS.index("pcm")] > 0 and semi_axes[m].min() >= 0):
        return None
    mu = float(f_x[MODELS.index("pcm")] / S)
    unit = mu * S * np.array([1.0, 1.0, rho])
    ellipsoid = Ellipsoid(semi_axes[m] / mu / [1, 1, rho])
    chosen, patch = _chosen(data, index, finger, m), _patch(data, index, finger)
    return StoredSurface(unit, float(rho), ellipsoid, chosen, patch, model)


def _chosen(data: Data, index: tuple[int, ...], finger: int, m: int) -> LimitSurface | None:
    quartic, matrix = data.values("limit_surface/coefficients"), data.values("limit_surface/matrix")
    if quartic is not None and np.isfinite(quartic[index][finger, m]).all():
        return Quartic(quartic[index][finger, m], exponents(3, 4))
    if matrix is not None and np.isfinite(matrix[index][finger, m]).all():
        return TiltedEllipsoid(matrix[index][finger, m])
    return None


def _patch(data: Data, index: tuple[int, ...], finger: int) -> ContactPatch | None:
    origin, axes = data.values("fingers/frame_origin"), data.values("fingers/frame_axes")
    if not data.result.layout.patches or origin is None or axes is None:
        return None
    stored = {name: values[finger] for name, values in data.result.patch(data.result.row(*index)).items()}
    if not all(np.isfinite(values).all() for values in stored.values()):
        return None
    R = axes[index][finger]
    return ContactPatch(
        (stored["centroid"] - origin[index][finger]) @ R.T, stored["area"], stored["normal"] @ R.T, stored["pressure"]
    )
