"""Limit surfaces of one contact: wrenches of many motions, the surface that the scene chose, and how far it is off.

All surfaces are fitted in ``(f_x, f_y, tau_z / rho) / (mu S)``. The wrenches are in proportion to mu, so they are taken
for mu = 1: a contact without friction has a limit surface too, of size 0.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.patch import ContactPatch, FloatArray
from softjaw.friction.wrench import friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid, axis_aligned_ellipsoid, full_ellipsoid, three_motion_ellipsoid
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import FitErrors, fit_error, normalised_samples, overclaim, sphere_motions
from softjaw.lsfit.span import span_ellipsoid, span_quartic, span_samples, zhou_ellipsoid, zhou_quartic
from softjaw.lsfit.surface import FitError, LimitSurface
from softjaw.study.case.contact import Contact
from softjaw.study.flags import Flag
from softjaw.study.scene.sections import LimitSurfaceKeys as Choice

INDEPENDENT = 377  # motions that a fit is judged by and does not see
SIX_MOTIONS = 2048  # motions that a 6-D ellipsoid is fitted to
# attributes of a fit that are stored for each friction model
PER_MODEL = ("matrix", "coefficients", "certificate", "fit_flag", "fit_error", "fit_error_own", "fit_error_ellipsoid")
STANDS_IN, ELLIPSOID, AS_FITTED, PROGRAMME = range(4)  # certificates, as study.quantities says


class SurfaceFit(NamedTuple):
    """Limit surface of a contact in one friction model, with what it was fitted to.

    ``wrench (samples, 6)`` are the wrenches of the fitted motions for mu = 1 [N, N m]; ``fit_error_own`` is the fit
    error on those motions, ``fit_error`` and ``fit_error_ellipsoid`` are those of the surface and of the ellipsoid from
    three motions on others, ``overclaim`` and ``overclaim_ellipsoid`` the largest shares by which they claim too much.
    """

    rho: float
    surface: LimitSurface
    certificate: int
    wrench: FloatArray
    fit_error_own: FitErrors
    fit_error: FitErrors
    fit_error_ellipsoid: FitErrors
    overclaim: float
    overclaim_ellipsoid: float

    def body(self, mu: float) -> LimitSurface:
        """The surface in ``(f_x, f_y, tau_z)`` per unit of S [-, -, m]."""
        return self.surface.scaled(mu * np.array([1.0, 1.0, self.rho]))

    @property
    def matrix(self) -> FloatArray:
        """Matrix ``A (3, 3)`` of an ellipsoid ``w A w = 1``; NaN for other surfaces, and for flat ones."""
        surface = self.surface
        return surface.A if isinstance(surface, Ellipsoid) and surface.rank == 3 else np.full((3, 3), np.nan)

    @property
    def coefficients(self) -> FloatArray:
        """Coefficients ``(15,)`` of a quartic, in the order of `lsfit.form.exponents`; NaN for other surfaces."""
        return self.surface.coefficients if isinstance(self.surface, Quartic) else np.full(15, np.nan)

    @property
    def fit_flag(self) -> int:
        """How the surface was fitted, `lsfit.ellipsoid.FitFlag`; 0 for a quartic."""
        return int(getattr(self.surface, "flag", 0))


def fit_surface(contact: Contact, model: str, choice: Choice) -> SurfaceFit:
    """Fit the surface that a scene's section ``[limit_surface]`` asks for to a contact's wrenches."""
    return fit_surfaces(contact, model, [choice.model], choice.objective, choice.samples)[choice.model]


def fit_surfaces(
    contact: Contact, model: str, kinds: Sequence[str], objective: str, samples: int
) -> dict[str, SurfaceFit]:
    """Fit limit surfaces to the wrenches of a contact in one friction model.

    ``kinds``: as a scene names them in ``limit_surface.model``. ``objective``: ``least_squares`` or ``zhou``.
    ``samples``: motions that are fitted to; `INDEPENDENT` others judge the fits.
    """
    rho, limits = contact.rho, contact.unit_limits[model]
    twist = fit_motions(samples) / [1.0, 1.0, rho]
    wrench = friction_wrench(contact.local, twist, 1.0, model)
    W, T = normalised_samples(wrench, twist, limits.S, rho)
    f_x, f_y, tau_z = limits.per_unit_force
    ellipsoid = three_motion_ellipsoid(f_x, f_y, tau_z / rho, 1.0)
    # a fit is judged by motions that it was not made from
    training, validation = (W[:samples], T[:samples]), (W[samples:], T[samples:])
    reference, too_much = _fit_error(ellipsoid, *validation), overclaim(ellipsoid, validation[0])
    surfaces = {}
    for kind in kinds:
        surface, certificate = fitted(ellipsoid, *training, kind, objective)
        errors = _fit_error(surface, *training), _fit_error(surface, *validation), reference
        claims = overclaim(surface, validation[0]), too_much
        surfaces[kind] = SurfaceFit(rho, surface, certificate, wrench[:samples], *errors, *claims)
    return surfaces


@lru_cache(maxsize=8)
def fit_motions(fitted_to: int) -> FloatArray:
    """Motions of the fit and those, evenly spread too, that it is judged by, for a contact of length 1."""
    # As many motions as the fit has would be the same ones, and it would judge itself.
    judging = INDEPENDENT + (fitted_to == INDEPENDENT)
    return np.vstack([fibonacci_twists(fitted_to, 1.0), fibonacci_twists(judging, 1.0)])


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
                return zhou_ellipsoid(span_samples(W, T)), ELLIPSOID
            case _, "least_squares":
                surface, certificate = convex_quartic(W, T)
                return surface, AS_FITTED if certificate == "least squares" else PROGRAMME
        return zhou_quartic(span_samples(W, T)), PROGRAMME
    # A surface that stands in keeps the case valid; the certificate and a flag tell.
    except FitError:
        return ellipsoid, STANDS_IN


def fit_flag(fits: Sequence[Mapping[str, SurfaceFit]]) -> int:
    """`Flag.NO_FIT` if the ellipsoid from three motions stands in for any surface that was asked for, else 0."""
    return Flag.NO_FIT * any(b.certificate == STANDS_IN for finger in fits for b in finger.values())


def _fit_error(surface: LimitSurface, W: FloatArray, T: FloatArray) -> FitErrors:
    """Fit error with the angle in rad; NaN where a flat body has no value at the samples."""
    with np.errstate(divide="ignore", invalid="ignore"):
        E1, radius, angle = fit_error(surface, W, T)
    errors = (E1, radius, np.radians(angle))
    # All or nothing: an angle without a radius would be read as a good fit.
    return FitErrors(*errors) if np.isfinite(errors).all() else FitErrors(np.nan, np.nan, np.nan)


def surface_values(contacts: Sequence[Contact], fits: Sequence[Mapping[str, SurfaceFit]], six: bool) -> dict[str, Any]:
    """What is stored of both fingers' surfaces, keyed as in ``study.quantities``."""
    curved = [finger["ccm"] for finger in fits]
    values: dict[str, Any] = {"limit_surface/rho": [fit.rho for fit in curved]}
    for name in PER_MODEL:
        values[f"limit_surface/{name}"] = [[getattr(fit, name) for fit in finger.values()] for finger in fits]
    if six:
        sixes = [six_ellipsoid(c.local, c.rho, c.unit_limits["ccm"].S) for c in contacts]
        for name, part in zip(("matrix_6d", "rank_6d", "fit_error_6d"), zip(*sixes, strict=True), strict=True):
            values[f"limit_surface/{name}"] = list(part)
    for kind in ("", "_ellipsoid"):
        values[f"maps/fit_error{kind}"] = np.max([getattr(b, f"fit_error{kind}").Erad for b in curved])
        values[f"maps/overclaim{kind}"] = np.max([getattr(b, f"overclaim{kind}") for b in curved])
    return values


def six_ellipsoid(patch: ContactPatch, rho: float, S: float) -> tuple[FloatArray, int, FitErrors]:
    """Ellipsoid of all six components: matrix ``(6, 6)`` on the directions that the contact resists, rank, fit error.

    A plane contact resists three directions only; a fit that the wrenches do not hold is NaN.
    """
    W, T = _six_samples(patch, rho, S, "ccm", SIX_MOTIONS)
    try:
        surface, errors = span_ellipsoid(W, T)
    except FitError:
        return np.full((6, 6), np.nan), 0, FitErrors(np.nan, np.nan, np.nan)
    assert isinstance(surface, Ellipsoid)
    return surface.A, surface.rank, errors._replace(Edir=float(np.radians(errors.Edir)))


def six_quartic(contact: Contact, model: str, samples: int) -> tuple[LimitSurface, FitErrors, float]:
    """Convex quartic of all six components ``(f, tau)`` [N, N m], with its fit error and overclaim on other motions."""
    S = contact.unit_limits[model].S
    W, T = _six_samples(contact.local, contact.rho, S, model, samples + INDEPENDENT)
    surface, unseen = span_quartic(W[:samples], T[:samples]), (W[samples:], T[samples:])
    size = contact.mu * S * np.repeat([1.0, contact.rho], 3)
    return surface.scaled(size), _fit_error(surface, *unseen), overclaim(surface, unseen[0])


def _six_samples(patch: ContactPatch, rho: float, S: float, model: str, count: int) -> tuple[FloatArray, FloatArray]:
    """Normalised wrenches and unit motions ``(count, 6)`` of evenly spread motions of a patch."""
    twist = sphere_motions(count, 6) / np.repeat([1.0, rho], 3)
    return normalised_samples(friction_wrench(patch, twist, 1.0, model), twist, S, rho)


# --- from the numbers of a result file --------------------------------------------------------------------------------


def fitted_surface(coefficients: FloatArray, matrix: FloatArray) -> LimitSurface | None:
    """The quartic ``(15,)`` or the ellipsoid ``(3, 3)`` in ``(f_x, f_y, tau_z / rho) / (mu S)``; None for NaN."""
    if np.isfinite(coefficients).all():
        return Quartic.of_coefficients(coefficients)
    return Ellipsoid.of_matrix(matrix) if np.isfinite(matrix).all() else None


def finger_surface(fingers: Callable[..., FloatArray], finger: int, model: str, fitted: bool) -> LimitSurface:
    """Limit surface of finger 1 or 2 in ``(f_x, f_y, tau_z)`` [N, N, N m]; else than ``fitted`` from three motions.

    ``fingers`` gives a quantity of both ``(2, ...)`` by its name and a friction model.
    """
    if finger not in (1, 2):
        raise ValueError(f"finger is {finger!r}: expected 1 or 2")
    i = finger - 1
    if not fitted:
        return Ellipsoid.of_axes(fingers("limit_surface/semi_axes", model)[i] * fingers("S")[i])
    P, A = (fingers(f"limit_surface/{name}", model)[i] for name in ("coefficients", "matrix"))
    if (surface := fitted_surface(P, A)) is None:
        raise ValueError("no surface was fitted, or the cases around have no fitted one of one kind: take fitted=False")
    # The largest force of the planar model is mu S.
    return surface.scaled(fingers("f_x_max", "pcm")[i] * np.array([1.0, 1.0, fingers("limit_surface/rho")[i]]))
