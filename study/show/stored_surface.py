"""Limit surfaces of a case from what its file holds: the exact one through the stored faces, and the fitted ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.lsfit.surface import LimitSurface
from softjaw.study.case.limit_surface import fitted_surface
from softjaw.study.quantities import MODELS
from softjaw.study.ranking import largest
from softjaw.study.result.layout import DONE
from softjaw.study.show.grasps import Index, field

AXES = (0, 1, 5)  # of the six components, those of a limit surface
PLANES = ((0, 1), (0, 2), (1, 2))
SHOWN = np.array([1.0, 1.0, 1e3])  # from SI to
COMPONENTS = (("f_x", "N"), ("f_y", "N"), ("tau_z", "N mm"))
NAMES = tuple(f"{name} [{unit}]" for name, unit in COMPONENTS)
ROWS, COLUMNS = 25, 49  # directions from pole to pole, and round


@dataclass(frozen=True)
class StoredSurface:
    """One finger at one case and in one friction model; surfaces are in ``(f_x, f_y, tau_z / rho) / (mu S)``.

    ``unit (3,)`` brings these to N, N, N mm; ``patch`` is None where the file holds none, ``chosen`` where no surface
    was fitted.
    """

    unit: np.ndarray
    rho: float
    ellipsoid: Ellipsoid
    chosen: LimitSurface | None
    patch: ContactPatch | None
    model: Any  # one of `softjaw.study.quantities.MODELS`

    def wrenches(self, twist: np.ndarray) -> Any:
        """Exact wrenches ``(m, 3)`` [-] for motions ``(v_x, v_y, rho omega)``; None without a patch."""
        if self.patch is None:
            return None
        S = float((self.patch.pressure * self.patch.area).sum())
        wrench = friction_wrench(self.patch, twist / [1, 1, self.rho], 1.0, self.model)[:, AXES]
        return wrench / (S * np.array([1.0, 1.0, self.rho]))

    def outline(self, i: int, j: int, count: int = 90) -> Any:
        """Exact outline of the body's shadow on the plane of two components ``(count, 2)`` [-]."""
        wrenches = self.wrenches(circle(i, j, count))
        return None if wrenches is None else wrenches[:, [i, j]]


def circle(i: int, j: int, count: int) -> np.ndarray:
    """Directions at equal steps in the plane of two of three components, ``(count, 3)``."""
    phi = 2 * np.pi * np.arange(count) / count
    return np.outer(np.cos(phi), np.eye(3)[i]) + np.outer(np.sin(phi), np.eye(3)[j])


def sphere(rows: int, columns: int) -> np.ndarray:
    """Directions ``(rows, columns, 3)`` on latitudes from pole to pole, and longitudes."""
    t, phi = np.meshgrid(np.linspace(0, np.pi, rows), np.linspace(0, 2 * np.pi, columns), indexing="ij")
    return np.stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.cos(t)], axis=-1)


def shadow_outline(surface: LimitSurface, i: int, j: int, count: int = 360) -> np.ndarray:
    """Outline of a body's shadow on the plane of two components ``(count, 2)``, from its support function.

    Where the outward normal is ``(cos phi, sin phi)`` lies the point ``h (cos, sin) + h' (-sin, cos)``.
    """
    t = circle(i, j, count)[:, [i, j]]
    h = surface.support(circle(i, j, count))
    # The support function is periodic, so its derivative by Fourier series is as exact as its values.
    slope = np.fft.irfft(1j * np.arange(count // 2 + 1) * np.fft.rfft(h), count)
    return h[:, None] * t + slope[:, None] * np.column_stack([-t[:, 1], t[:, 0]])


def body(surface: StoredSurface) -> np.ndarray | None:
    """Points ``(ROWS, COLUMNS, 3)`` of a limit surface [N, N, N mm], row by latitude; None where it is unbounded."""
    u = sphere(ROWS, COLUMNS)
    radius = (surface.chosen or surface.ellipsoid).radius(u.reshape(-1, 3)).reshape(ROWS, COLUMNS, 1)
    return u * radius * surface.unit if np.isfinite(radius).all() else None


def weaker(ds: xr.Dataset, index: Index) -> int:
    """The finger that carries the smaller torque."""
    torques = field(ds, "finger_tau_z_max")
    # Where the torques tie, the same finger is shown on every machine.
    return 0 if torques is None else largest(-np.nan_to_num(torques[index][:, 0]))


def stored_surface(
    ds: xr.Dataset, index: Index, finger: int, model: str, faces: dict[str, np.ndarray] | None = None
) -> StoredSurface | None:
    """The limit surfaces of a case, or None where the file does not hold what is needed.

    ``faces`` are the stored contact faces of both fingers, from which the exact wrenches follow.
    """
    m = MODELS.index(model)
    names = ("limit_surface_semi_axes", "limit_surface_rho", "finger_S", "finger_f_x_max")
    fields = [field(ds, name) for name in names]
    if ds.status.values[index] != DONE or any(f is None or not np.isfinite(f[index][finger]).all() for f in fields):
        return None
    semi_axes, rho, S, f_x = (f[index][finger] for f in fields)
    planar = f_x[MODELS.index("pcm")]
    # A contact without friction or load has nothing to be divided by.
    if not (S > 0 and rho > 0 and planar > 0 and semi_axes[m].min() >= 0):
        return None
    # From the file itself: a sweep may change mu from case to case.
    mu = float(planar / S)
    ellipsoid = Ellipsoid.of_axes(semi_axes[m] / mu / [1, 1, rho])
    unit = planar * np.array([1.0, 1.0, rho]) * SHOWN
    patch = _patch(ds, index, finger, faces or {})
    fits = (field(ds, f"limit_surface_{name}") for name in ("coefficients", "matrix"))
    chosen = fitted_surface(*(np.full(1, np.nan) if fit is None else fit[index][finger, m] for fit in fits))
    return StoredSurface(unit, float(rho), ellipsoid, chosen, patch, model)


def _patch(ds: xr.Dataset, index: Index, finger: int, faces: dict[str, np.ndarray]) -> ContactPatch | None:
    if not faces:
        return None
    origin, R = (ds[f"finger_frame_{name}"].values[index][finger] for name in ("origin", "axes"))
    x, area, normal, p = (faces[name][finger] for name in ("centroid", "area", "normal", "pressure"))
    return ContactPatch((x - origin) @ R.T, area, normal @ R.T, p)
