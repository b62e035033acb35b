"""Limit surfaces of one contact: wrenches of many motions, the surface that the scene chose, and how far it is off.

All surfaces are fitted in ``(f_x, f_y, tau_z / rho) / (mu S)``. The wrenches are in proportion to mu, so they are taken
for mu = 1: a contact without friction has a limit surface too, of size 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import FrictionLimits, friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid, axis_aligned_ellipsoid, full_ellipsoid, three_motion_ellipsoid
from softjaw.lsfit.flag import FitError
from softjaw.lsfit.misfit import Misfit, misfit
from softjaw.lsfit.quartic import Quartic, convex_quartic
from softjaw.lsfit.samples import normalised_samples
from softjaw.lsfit.six import six_samples, span_ellipsoid
from softjaw.lsfit.span import CollapsedFitError, sphere_motions
from softjaw.lsfit.surface import LimitSurface
from softjaw.lsfit.tilted import TiltedEllipsoid
from softjaw.lsfit.zhou import SIX_WEIGHTS, zhou_ellipsoid, zhou_quartic
from softjaw.study.flags import Flag
from softjaw.study.scene import Scene
from softjaw.study.scene.score_sections import LimitSurface as Choice

FloatArray = NDArray[np.float64]
INDEPENDENT = 377  # motions that a fit is judged by and does not see
SIX_MOTIONS = 2048  # motions that a 6-D ellipsoid is fitted to
ZHOU = SIX_WEIGHTS  # for three components too: all weights 1 fit no better, and collapse for some patches
STANDS_IN, ELLIPSOID, AS_FITTED, PROGRAMME = range(4)  # certificates, as study.quantities says


class Bound(NamedTuple):
    """Limit surface of a contact in one friction model, with what it was fitted to.

    ``wrench (samples, 6)`` are the wrenches of the fitted motions for mu = 1 [N, N m]; ``own`` is the misfit on those
    motions, ``misfit`` and ``ellipsoid_misfit`` are those of the surface and of the ellipsoid from three motions on
    others.
    """

    rho: float
    ellipsoid: Ellipsoid
    surface: LimitSurface
    certificate: int
    wrench: FloatArray
    own: Misfit
    misfit: Misfit
    ellipsoid_misfit: Misfit


def bound(patch: ContactPatch, rho: float, limits: FrictionLimits, model: str, choice: Choice) -> Bound:
    """Fit the surface that a scene asks for to a contact's wrenches.

    Parameters
    ----------
    patch : ContactPatch
        ``n`` faces in the contact frame.
    rho : float
        Length of the contact [m].
    limits : FrictionLimits
        Largest friction for mu = 1.
    model : str
        Friction model.
    choice : LimitSurface
        Section ``[limit_surface]`` of the scene.
    """
    k = choice.samples
    twist = _motions(k) / [1.0, 1.0, rho]
    wrench = friction_wrench(patch, twist, 1.0, model)
    W, T = normalised_samples(wrench, twist, limits.S, rho)
    f_x, f_y, tau_z = limits.per_unit_force
    ellipsoid = three_motion_ellipsoid(f_x, f_y, tau_z / rho, 1.0)
    surface, certificate = fitted(ellipsoid, W[:k], T[:k], choice.model, choice.objective)
    judged = [_misfit(s, W[part], T[part]) for s, part in ((surface, slice(k)), (surface, slice(k, None)))]
    again = judged[1] if surface is ellipsoid else _misfit(ellipsoid, W[k:], T[k:])
    return Bound(rho, ellipsoid, surface, certificate, wrench[:k], *judged, again)


def judging_twists(fitted_to: int, rho: float) -> FloatArray:
    """Motions that are not among those of a fit to ``fitted_to`` motions, evenly spread too."""
    return fibonacci_twists(INDEPENDENT + (fitted_to == INDEPENDENT), rho)


@lru_cache(maxsize=8)
def _motions(fitted_to: int) -> FloatArray:
    """Motions of the fit and those that it is judged by, for a contact of length 1."""
    return np.vstack([fibonacci_twists(fitted_to, 1.0), judging_twists(fitted_to, 1.0)])


def fitted(ellipsoid: Ellipsoid, W: FloatArray, T: FloatArray, model: str, objective: str) -> tuple[LimitSurface, int]:
    """Surface of a model fitted to normalised samples ``W, T (m, 3)``, and how it is known to be convex."""
    try:
        match model, objective:
            case "three_motions", _:
                return ellipsoid, ELLIPSOID
            case "axis_aligned", _:
                return axis_aligned_ellipsoid(W), ELLIPSOID
            case "full", "least_squares":
                return full_ellipsoid(W), ELLIPSOID
            case "full", _:
                return zhou_ellipsoid(W, T, ZHOU).surface, ELLIPSOID
            case _, "least_squares":
                fit = convex_quartic(W, T)
                return fit.surface, AS_FITTED if fit.certificate.by == "least squares" else PROGRAMME
        return zhou_quartic(W, T, ZHOU).surface, PROGRAMME
    except (FitError, CollapsedFitError):
        return ellipsoid, STANDS_IN


def fit_flag(bounds: Sequence[Mapping[str, Bound]]) -> Flag:
    """`Flag.NO_FIT` if the ellipsoid from three motions stands in for any surface that was asked for, else 0."""
    return Flag.NO_FIT * any(b.certificate == STANDS_IN for own in bounds for b in own.values())


def matrix(surface: LimitSurface) -> FloatArray:
    """Matrix ``A (3, 3)`` of an ellipsoid ``w A w = 1``; NaN for other surfaces, and for flat ones."""
    if isinstance(surface, Ellipsoid) and surface.rank == 3:
        return np.diag(surface.semi_axes**-2.0)
    return surface.A if isinstance(surface, TiltedEllipsoid) else np.full((3, 3), np.nan)


def coefficients(surface: LimitSurface) -> FloatArray:
    """Coefficients ``(15,)`` of a quartic, in the order of `lsfit.form.exponents`; NaN for other surfaces."""
    return surface.coefficients if isinstance(surface, Quartic) else np.full(15, np.nan)


def dropped_share(wrench: FloatArray, rho: float) -> float:
    """Mean share of a wrench that its three components f_z, tau_x and tau_y make up, of ``wrench (m, 6)``."""
    w = wrench / [1, 1, 1, rho, rho, rho]
    return float((np.linalg.norm(w[:, 2:5], axis=1) / np.linalg.norm(w, axis=1)).mean())


def _misfit(surface: LimitSurface, W: FloatArray, T: FloatArray) -> Misfit:
    """Misfit with the angle in rad; NaN where a flat body has no value at the samples."""
    with np.errstate(divide="ignore", invalid="ignore"):
        E1, radius, angle = misfit(surface, W, T)
    found = (E1, radius, np.radians(angle))
    return Misfit(*found) if np.isfinite(found).all() else Misfit(np.nan, np.nan, np.nan)


def surface_values(scene: Scene, contacts: Sequence[Any], bounds: Sequence[dict[str, Bound]]) -> dict[str, Any]:
    """What is stored of both fingers' surfaces, keyed as in ``study.quantities``."""
    every = [[b for b in own.values()] for own in bounds]
    per_model = {
        "matrix": lambda b: matrix(b.surface),
        "coefficients": lambda b: coefficients(b.surface),
        "certificate": lambda b: b.certificate,
        "fit_flag": lambda b: int(getattr(b.surface, "flag", 0)),
        "misfit": lambda b: b.misfit,
        "misfit_own": lambda b: b.own,
        "misfit_ellipsoid": lambda b: b.ellipsoid_misfit,
    }
    found = {f"limit_surface/{name}": [[of(b) for b in own] for own in every] for name, of in per_model.items()}
    curved = [own["curved"] for own in bounds]
    if scene.effects.wrench == "6-D":
        found |= six_values(contacts)
    if scene.sampled:
        found["wrenches/wrench"] = [[scene.friction.mu * b.wrench[:, [0, 1, 5]] for b in own] for own in every]
    return found | {
        "limit_surface/rho": [b.rho for b in curved],
        "maps/misfit": np.max([b.misfit.Erad for b in curved]),
        "maps/misfit_ellipsoid": np.max([b.ellipsoid_misfit.Erad for b in curved]),
    }


def six_values(contacts: Sequence[Any]) -> dict[str, Any]:
    """The 6-D ellipsoids of both fingers in the curved model, keyed as in ``study.quantities``."""
    found = [six_ellipsoid(c.local, c.rho, c.unit_limits["curved"].S) for c in contacts]
    names = ("matrix_6d", "rank_6d", "misfit_6d")
    return {f"limit_surface/{name}": list(part) for name, part in zip(names, zip(*found, strict=True), strict=True)}


def six_ellipsoid(patch: ContactPatch, rho: float, S: float) -> tuple[FloatArray, int, Misfit]:
    """Ellipsoid of all six components: matrix ``(6, 6)`` on the directions that the contact resists, rank, misfit.

    A plane contact resists three directions only; a fit that the wrenches do not hold is NaN.
    """
    motion = sphere_motions(SIX_MOTIONS, 6)
    twist = motion / [1, 1, 1, rho, rho, rho]
    W, T = six_samples(friction_wrench(patch, twist, 1.0), twist, S, rho)
    nothing = Misfit(np.nan, np.nan, np.nan)
    try:
        fit = span_ellipsoid(W, T)
    except CollapsedFitError:
        return np.full((6, 6), np.nan), 0, nothing
    surface = fit.surface
    if isinstance(surface, TiltedEllipsoid):
        return surface.A, fit.rank, Misfit(*fit.errors[:2], float(np.radians(fit.errors.Edir)))
    inverse = np.linalg.pinv(surface.B)
    A = inverse.T @ surface.inner.A @ inverse
    return A, fit.rank, Misfit(*fit.errors[:2], float(np.radians(fit.errors.Edir)))
