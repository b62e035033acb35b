"""Homogeneous forms and all limit surfaces: derivatives, smallest values, closed forms and properties."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from softjaw.friction.motion import fibonacci_twists
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.lsfit.form import exponents, hessian_tensor, monomial_gradients, monomials, quartic_volume, substitute
from softjaw.lsfit.lowest import lies_above, smallest_value
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.samples import fit_error, overclaim
from softjaw.lsfit.sos import ball_gram
from softjaw.lsfit.surface import FitFlag, supported_shadow
from tests.scoring.grasps import unit

RANDOM = np.random.default_rng(3)


@pytest.mark.parametrize("d", [1, 2, 3, 6])
def test_monomials_are_products_of_powers_with_substitution_and_derivatives(d):
    E, w = exponents(d, 4), RANDOM.normal(size=(7, d))
    np.testing.assert_allclose(monomials(w, E), np.prod(w[:, None] ** E, axis=2), rtol=1e-13)
    w, L = RANDOM.normal(size=(5, d)), RANDOM.normal(size=(d, d))
    c = RANDOM.normal(size=len(E))
    np.testing.assert_allclose(monomials(w, E) @ substitute(c, E, L), monomials(w @ L.T, E) @ c, rtol=1e-8, atol=1e-10)
    w, step = RANDOM.normal(size=(4, d)), 1e-5
    G, c = monomial_gradients(w, d, 4), RANDOM.normal(size=len(E))
    H = np.einsum("ijkl,mk,ml->mij", hessian_tensor(c, d), w, w)
    for i, e in enumerate(step * np.eye(d)):
        slope = (monomials(w + e, E) - monomials(w - e, E)) / (2 * step)
        np.testing.assert_allclose(G[:, :, i], slope, rtol=1e-7, atol=1e-7)
        slope = (monomial_gradients(w + e, d, 4) - monomial_gradients(w - e, d, 4)) / (2 * step)
        np.testing.assert_allclose(H[:, i], np.einsum("mkj,k->mj", slope, c), rtol=1e-6, atol=1e-5)


def coefficients(P, d):
    w = np.random.default_rng(0).normal(size=(4 * len(exponents(d, 4)), d))
    return np.linalg.lstsq(monomials(w, exponents(d, 4)), P(w), rcond=None)[0]


def random_form(rng, d, kind):
    E = exponents(d, 4)
    if kind == 0:
        return rng.normal(size=len(E))
    if kind == 1:
        A = rng.normal(size=(d + 2, d)) * np.geomspace(1, 10 ** rng.uniform(0, 1.5), d)
        return coefficients(lambda w: ((w @ A.T) ** 4).sum(axis=1), d)
    a = rng.normal(size=len(exponents(d, 2)))
    return coefficients(lambda w: (monomials(w, exponents(d, 2)) @ a) ** 2 + 1e-3 * (w**4).sum(axis=1), d)


@pytest.mark.parametrize(("d", "count"), [
    (1, 3), (2, 3), (3, 3), *(pytest.param(*own, marks=pytest.mark.long) for own in ((2, 12), (4, 3), (3, 60), (6, 2))),
])  # fmt: skip
def test_no_direction_has_a_smaller_value(d, count):
    rng, E = np.random.default_rng(d), exponents(d, 4)
    for k in range(count):
        v = random_form(rng, d, k % 3)
        value, at = smallest_value(v, d)
        assert monomials(at, E)[0] @ v == pytest.approx(value, abs=1e-14 * np.abs(v).max())
        u = unit(rng.normal(size=(20_000, d)))
        P = monomials(u, E) @ v

        def along(x, v=v):
            return float(monomials(unit(x), E)[0] @ v)

        options = {"xatol": 1e-9, "fatol": 1e-15, "maxiter": 400 * d}
        best = min(minimize(along, u[i], method="Nelder-Mead", options=options).fun for i in np.argsort(P)[:2])
        assert value <= best + 1e-12 * np.abs(P).max()


@pytest.mark.parametrize("d", [1, 2, 3, pytest.param(6, marks=pytest.mark.long)])
def test_a_level_is_passed_from_one_side_only(d):
    rng = np.random.default_rng(d)
    for kind in (1, 2):
        v = random_form(rng, d, kind)
        value = smallest_value(v, d)[0]
        assert value > 0
        assert lies_above(v, d, value * (1 - 1e-6))
        assert not lies_above(v, d, value * (1 + 1e-6))
    assert not lies_above(-ball_gram(d)[: len(exponents(d, 4))], d, 0.0)


AXES = np.array([1.0, 0.7, 0.1])
E = exponents(3, 4)


def tilted_matrix(seed=1):
    F = np.random.default_rng(seed).normal(size=(3, 3))
    return F @ F.T + 0.05 * np.eye(3)


def squared(A):
    return Quartic.of_coefficients(coefficients(lambda w: np.einsum("mi,ij,mj->m", w, A, w) ** 2, len(A)), len(A))


def fourth_powers(axes=AXES):
    """``sum (w_i / a_i)^4``: flat where it meets the axes, so that its second derivative is singular there."""
    each = [(4 * np.eye(3)[i] == E).all(axis=1) / axes[i] ** 4 for i in range(3)]
    return Quartic.of_coefficients(np.sum(each, axis=0))


def rounded_box():
    return Quartic.of_coefficients(fourth_powers().coefficients + squared(tilted_matrix()).coefficients)


SURFACES = {
    "ellipsoid": Ellipsoid.of_axes(AXES), "tilted": Ellipsoid.of_matrix(tilted_matrix()),
    "squared": squared(tilted_matrix()), "fourth powers": fourth_powers(), "rounded box": rounded_box(),
    "image": rounded_box().mapped(np.random.default_rng(5).normal(size=(3, 3))),
}  # fmt: skip
FLAT = {
    "ellipsoid": Ellipsoid.of_axes([1.0, 0.0, 0.2]),
    "tilted": Ellipsoid(np.array([[1.0, 0.0], [0.2, 0.0], [0.0, 0.3]])),
    "quartic": squared(np.diag([1.0, 2.0])).mapped(np.array([[1.0, 0.3], [0.5, 1.0], [0.1, 0.0]])),
}
every = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
every_flat = pytest.mark.parametrize("surface", FLAT.values(), ids=FLAT)


@every
def test_points_on_the_surface_are_on_it_and_the_gradient_is_the_derivative_of_the_value(surface):
    u = np.random.default_rng(0).normal(size=(40, 3))
    w = u * surface.radius(u)[:, None]
    np.testing.assert_allclose(surface.value(w), 1, rtol=1e-12)
    assert surface.holds(w).all()
    assert surface.holds((1 - 1e-9) * w).all()
    assert not surface.holds((1 + 1e-9) * w).any()
    u = np.random.default_rng(1).normal(size=(20, 3))
    w, h = u * surface.radius(u)[:, None], 1e-6
    slope = np.stack([(surface.value(w + e) - surface.value(w - e)) / (2 * h) for e in h * np.eye(3)], axis=1)
    np.testing.assert_allclose(surface.gradient(w), slope, rtol=1e-6, atol=1e-6 * np.abs(slope).max())


@every
def test_the_support_is_what_the_point_with_that_normal_gives(surface):
    u = np.random.default_rng(2).normal(size=(60, 3))
    w = u * surface.radius(u)[:, None]
    t = surface.gradient(w)
    # Homogeneous: w . grad P = degree at the surface, where the gradient is the outward normal.
    np.testing.assert_allclose(surface.support(t), surface.degree, rtol=1e-11)
    t = np.random.default_rng(3).normal(size=(30, 3))
    assert ((t @ w.T).max(axis=1) <= surface.support(t) * (1 + 1e-12)).all()
    np.testing.assert_allclose(surface.support(-2 * t), 2 * surface.support(t), rtol=1e-12)
    assert surface.support([[0.0, 0.0, 0.0]])[0] == 0


@every
def test_another_unit_changes_nothing_but_the_numbers_and_supports_have_the_same_shadow(surface):
    factors = np.array([3.0, 3.0, 0.02])
    t = np.random.default_rng(6).normal(size=(10, 3))
    other = surface.scaled(factors)
    np.testing.assert_allclose(other.support(t), surface.support(t * factors), rtol=1e-11)
    np.testing.assert_allclose(other.value(t * factors), surface.value(t), rtol=1e-11)
    assert other.volume == pytest.approx(surface.volume * factors.prod(), rel=1e-10)
    assert other.shadow_area == pytest.approx(surface.shadow_area * 9, rel=1e-10)
    np.testing.assert_allclose(other.semi_axes, factors * surface.semi_axes, rtol=1e-11)
    if surface is not SURFACES["fourth powers"]:  # its support has kinks in the curvature
        assert supported_shadow(surface.support, 3, 4096) == pytest.approx(surface.shadow_area, rel=1e-8)


def test_an_ellipsoid_is_the_same_in_every_form_and_fourth_powers_have_a_closed_form():
    A = tilted_matrix()
    t, inverse = np.random.default_rng(8).normal(size=(100, 3)), np.linalg.inv(A)
    for surface in (Ellipsoid.of_matrix(A), squared(A)):
        np.testing.assert_allclose(surface.support(t), np.sqrt(np.einsum("mi,ij,mj->m", t, inverse, t)), rtol=1e-11)
        assert surface.volume == pytest.approx(4 / 3 * math.pi / math.sqrt(np.linalg.det(A)), rel=1e-12)
        assert surface.shadow_area == pytest.approx(math.pi * math.sqrt(np.linalg.det(inverse[:2, :2])), rel=1e-12)
        np.testing.assert_allclose(surface.semi_axes, np.sqrt(inverse.diagonal()), rtol=1e-11)
    along = Ellipsoid.of_matrix(np.diag(AXES**-2))
    np.testing.assert_allclose(along.support(t), Ellipsoid.of_axes(AXES).support(t), rtol=1e-13)
    # Support: the dual norm, of power 4/3; volume ``8 gamma(5/4)^3 / gamma(7/4)``, ``4 gamma(5/4)^2 / gamma(3/2)``.
    surface = fourth_powers()
    t = np.vstack([np.random.default_rng(9).normal(size=(100, 3)), np.eye(3), [[1, 1, 0], [1, 0, 10], [1, 1e-8, 0]]])
    np.testing.assert_allclose(surface.support(t), (np.abs(t * AXES) ** (4 / 3)).sum(axis=1) ** 0.75, rtol=1e-11)
    volume = 8 * math.gamma(1.25) ** 3 / math.gamma(1.75) * AXES.prod()
    assert surface.volume == pytest.approx(volume, rel=1e-12)
    assert surface.shadow_area == pytest.approx(4 * math.gamma(1.25) ** 2 / math.gamma(1.5) * 0.7, rel=1e-11)
    for spread in (1e-2, 1e-4):  # thin bodies keep their digits
        thin = fourth_powers(np.array([1.0, 1.0, spread]))
        assert thin.semi_axes == pytest.approx([1.0, 1.0, spread], rel=1e-11)
        assert thin.volume == pytest.approx(volume / AXES.prod() * spread, rel=1e-11)


@pytest.mark.parametrize(("d", "rel"), [(1, 1e-14), (2, 1e-12), (4, 1e-6), (5, 1e-4)])
def test_volumes_in_other_dimensions(d, rel):
    """``prod 2 gamma(5/4) / gamma(1 + d/4)`` for the sum of fourth powers."""
    volume = quartic_volume((exponents(d, 4).max(axis=1) == 4).astype(float), d)
    assert volume == pytest.approx((2 * math.gamma(1.25)) ** d / math.gamma(1 + d / 4), rel=rel)


@every_flat
def test_flat_bodies_carry_nothing_across_and_are_nowhere_infinite(surface):
    assert (surface.rank, surface.volume) == (2, 0)
    across = np.linalg.svd(surface.span.T)[2][2]
    assert surface.support(across)[0] == pytest.approx(0, abs=1e-15)
    t = np.random.default_rng(10).normal(size=(30, 3))
    assert np.isfinite(surface.support(t)).all()
    assert np.isfinite(surface.gradient(t)).all()
    inside = t @ surface.span @ surface.span.T
    w = inside * surface.radius(inside)[:, None]
    np.testing.assert_allclose(surface.value(w), 1, rtol=1e-10)
    assert not surface.holds(0.1 * w + 1e-6 * across).any()
    assert surface.holds(0.1 * w).all()
    # a segment has corners
    assert surface.shadow_area == pytest.approx(supported_shadow(surface.support, 3, 4096), abs=2e-3)


@every_flat
def test_errors_of_flat_bodies_are_numbers(surface):
    """Any motion across is normal to a flat body; the angle counts only the part within."""
    u = np.random.default_rng(11).normal(size=(40, 3)) @ surface.span @ surface.span.T
    w = u * surface.radius(u)[:, None]
    t = surface.gradient(w)
    t = t / np.linalg.norm(t, axis=1, keepdims=True) + np.linalg.svd(surface.span.T)[2][2]
    errors = fit_error(surface, w, t / np.linalg.norm(t, axis=1, keepdims=True))
    np.testing.assert_allclose(errors, 0, atol=1e-8)
    off = fit_error(surface, w + np.array([0.1, 0.2, 0.3]), t / np.linalg.norm(t, axis=1, keepdims=True))
    assert not np.isnan(off).any()
    assert off.Erad == pytest.approx(1)


def test_a_thin_body_is_measured_in_its_units_and_a_swollen_ellipsoid_has_its_errors_and_overclaims():
    """A thousandth in one direction, mixed with the others: only there have coefficients such digits."""
    thin = rounded_box().scaled([1.0, 1.0, 1e-5])
    again = Quartic.of_coefficients(thin.coefficients)
    for surface, size in ((thin, 1e-5), (again, 1e-5), (again.scaled([1e-3, 1e4, 1.0]), 1e-4)):
        assert surface.volume == pytest.approx(size * rounded_box().volume, rel=1e-11)
    with pytest.raises(ValueError, match="vectors of shape"):
        fourth_powers().value([1.0, 2.0])
    for surface in (
        Ellipsoid.of_axes(AXES, FitFlag.BOUNDED), Ellipsoid(np.eye(3), FitFlag.BOUNDED),
        Quartic.of_coefficients(fourth_powers().coefficients, flag=FitFlag.BOUNDED),
        fourth_powers().mapped(np.eye(3), FitFlag.BOUNDED),
    ):
        assert surface.scaled([1.0, 1.0, 2.0]).flag == FitFlag.BOUNDED
    # Radii too large by 10 %: P = 1 / 1.21 on the true surface, and P^(-1/2) = 1.1.
    T = fibonacci_twists(200, 1.0)
    W = T * AXES**2 / np.linalg.norm(T * AXES, axis=1, keepdims=True)
    errors = fit_error(Ellipsoid.of_axes(1.1 * AXES), W, T)
    np.testing.assert_allclose(errors, [1 - 1 / 1.21, 0.1, 0], atol=1e-12)
    longer = Ellipsoid.of_axes(AXES * [1.0, 1.0, 1.2])
    assert overclaim(Ellipsoid.of_axes(1.1 * AXES), W) == pytest.approx(0.1, rel=1e-9)
    assert overclaim(Ellipsoid.of_axes(0.9 * AXES), W) == pytest.approx(0.0, abs=1e-12)
    assert overclaim(longer, [[0, 0, AXES[2]], [AXES[0], 0, 0]]) == pytest.approx(0.2)
