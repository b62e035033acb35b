"""Limit surfaces of a case from what its file holds: the exact one through the stored faces, and the fitted ones."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import friction_wrench
from softjaw.lsfit.body import ExactSurface
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.lsfit.surface import LimitSurface
from softjaw.study.case.limit_surface import fitted_surface
from softjaw.study.quantities import MODELS
from softjaw.study.ranking import largest
from softjaw.study.result.layout import DONE
from softjaw.study.show.grasps import Index, field

AXES = (0, 1, 5)  # of the six components, those of a limit surface
SHOWN = np.array([1.0, 1.0, 1e3])  # from SI to
COMPONENTS = (("f_x", "N"), ("f_y", "N"), ("tau_z", "N mm"))
NAMES = tuple(f"{name} [{unit}]" for name, unit in COMPONENTS)
ROWS, COLUMNS = 25, 49  # directions from pole to pole, and round


class StoredSurface(NamedTuple):
    """One finger at one case and in one friction model; surfaces are in ``(f_x, f_y, tau_z / rho) / (mu S)``.

    ``unit (3,)`` brings these to N, N, N mm; ``exact``, which friction gives, is None where the file holds no patch,
    ``chosen`` where no surface was fitted.
    """

    unit: np.ndarray
    ellipsoid: Ellipsoid
    chosen: LimitSurface | None
    exact: ExactSurface | None


def sphere(rows: int, columns: int) -> np.ndarray:
    """Directions ``(rows, columns, 3)`` on latitudes from pole to pole, and longitudes."""
    t, phi = np.meshgrid(np.linspace(0, np.pi, rows), np.linspace(0, 2 * np.pi, columns), indexing="ij")
    return np.stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.cos(t)], axis=-1)


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
    fits = (field(ds, f"limit_surface_{name}") for name in ("coefficients", "matrix"))
    chosen = fitted_surface(*(np.full(1, np.nan) if fit is None else fit[index][finger, m] for fit in fits))
    if not faces:
        return StoredSurface(unit, ellipsoid, chosen, None)
    origin, R = (ds[f"finger_frame_{name}"].values[index][finger] for name in ("origin", "axes"))
    x, area, normal, p = (faces[name][finger] for name in ("centroid", "area", "normal", "pressure"))
    patch = ContactPatch((x - origin) @ R.T, area, normal @ R.T, p)
    return StoredSurface(unit, ellipsoid, chosen, exact_surface(patch, model, float(rho)))


def exact_surface(patch: ContactPatch, model: Any, rho: float) -> ExactSurface:
    """The limit surface itself of a patch in its contact frame, for motions ``(v_x, v_y, rho omega)``."""
    lengths = np.array([1.0, 1.0, rho])
    mu = 1.0 / float((patch.pressure * patch.area).sum())
    return ExactSurface(lambda t: friction_wrench(patch, t / lengths, mu, model)[:, AXES] / lengths)
