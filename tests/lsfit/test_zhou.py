"""Fits by sums of lengths: optimality, invariance, spans, and refusals of surfaces that run away."""

from dataclasses import replace

import numpy as np
import pytest

from softjaw.friction.motion import SLIDE_X, SLIDE_Y
from softjaw.friction.wrench import friction_wrench
from softjaw.lsfit.ellipsoid import TiltedEllipsoid
from softjaw.lsfit.samples import fit_error, normalised_samples, six_samples, sphere_motions
from softjaw.lsfit.span import CollapsedFitError, zhou_ellipsoid, zhou_quartic
from softjaw.lsfit.surface import FitFlag
from tests.generators import cylinder_grid, disc_polar, lcg_patch, points_patch, rect_grid
from tests.oracles import samples

DISC = disc_polar(1, 40, 96)
FITS = pytest.mark.parametrize("fit", [zhou_ellipsoid, zhou_quartic])


def objective(surface, rates, W, T, weights):
    """The objective as the publication writes it, for a surface in the coordinates of the wrenches."""
    G = surface.gradient(W)
    if isinstance(surface, TiltedEllipsoid):
        size, G = np.linalg.norm(surface.A), G / 2
    else:
        size = np.linalg.norm(surface.coefficients)
    off = np.abs(surface.value(W) - 1).sum()
    return np.dot(weights, [size, off, np.linalg.norm(G - rates[:, None] * T, axis=1).sum()])


@pytest.mark.parametrize(
    ("fit", "value", "E1", "Edir"),
    [
        (zhou_quartic, 77.85994575252231, 0.014323128478641332, 0.5232225550749485),
        (zhou_ellipsoid, 38.603816546861694, 0.01571060245314559, 5.092930192019943),
    ],
)
def test_a_uniform_disc(fit, value, E1, Edir):
    """Figures of an independent implementation with a modelling language."""
    W, T = samples(DISC, 100)
    found = fit(W, T, even=False)
    errors = fit_error(found.surface, W, T)
    assert found.objective == pytest.approx(value, rel=1e-5)
    assert (errors.E1, errors.Edir) == pytest.approx((E1, Edir), rel=1e-3)


@FITS
@pytest.mark.parametrize("weights", [(1.0, 10.0, 1.0), (0.1, 1.0, 3.0)])
def test_the_objective_is_that_of_the_surface_and_neighbours_are_worse(fit, weights):
    W, T = samples(lcg_patch(6, 40), 60)
    best = fit(W, T, *weights, even=False)
    value = objective(best.surface, best.rates, W, T, weights)
    assert value == pytest.approx(best.objective, rel=1e-6)
    for factors in (np.full(3, 1.01), np.full(3, 0.99), *(1 + 0.01 * np.eye(3)), *(1 - 0.01 * np.eye(3))):
        assert objective(best.surface.scaled(factors), best.rates, W, T, weights) > value * (1 - 1e-7)
    for s in (best.rates * 1.01, best.rates * 0.99):
        assert objective(best.surface, s, W, T, weights) > value * (1 - 1e-7)


def test_an_ellipsoid_is_found_again():
    A = np.array([[2.0, 0.3, -0.2], [0.3, 3.0, 0.5], [-0.2, 0.5, 9.0]])
    true, u = TiltedEllipsoid(A), sphere_motions(80, 3)
    W = u * true.radius(u)[:, None]
    T = W @ A / np.linalg.norm(W @ A, axis=1, keepdims=True)
    found = zhou_ellipsoid(W, T, even=False)
    np.testing.assert_allclose(found.surface.A, A, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.rates, np.linalg.norm(W @ A, axis=1), rtol=1e-6)
    assert found.objective == pytest.approx(np.linalg.norm(A), rel=1e-6)


def test_the_quartic_is_convex_where_the_samples_are_not():
    """Two points, noisy: the best quartic without the constraint has negative curvature."""
    W, T = samples(points_patch([[-1, 0], [1, 0]], [1, 1]), 40)
    W = W * (1 + 0.3 * np.random.default_rng(1).uniform(-1, 1, (40, 1)))
    surface = zhou_quartic(W, T, beta=1.0).surface
    u = sphere_motions(2000, 3) * surface.semi_axes
    assert np.linalg.eigvalsh(surface.hessian(u)).min() > -1e-6


@FITS
def test_component_scaling_makes_the_fit_free_of_units(fit):
    """Scaled to one, samples in other units are the same samples, and motions change inversely."""
    W, T = samples(lcg_patch(6, 40), 60)
    factors = np.array([1.0, 1.0, 1e3])
    S = T / factors
    one, other = fit(W, T), fit(W * factors, S / np.linalg.norm(S, axis=1, keepdims=True))
    assert other.objective == pytest.approx(one.objective, rel=1e-6)
    np.testing.assert_allclose(other.surface.semi_axes, one.surface.semi_axes * factors, rtol=1e-5)


# Spans ---------------------------------------------------------------------------------------------------------------


@FITS
def test_samples_in_a_plane_give_a_flat_surface(fit):
    """Translations alone say nothing of torques: the semi-axis there is 0, not infinite."""
    phi = np.pi * np.arange(12)[:, None] / 12
    twist = np.cos(phi) * SLIDE_X + np.sin(phi) * SLIDE_Y
    W, T = normalised_samples(friction_wrench(DISC, twist, 1.0), twist, DISC.load.sum(), 2.0)
    found = fit(W, T)
    assert (found.surface.rank, found.surface.dimension) == (2, 3)
    assert FitFlag.RANK_DEFICIENT in found.surface.flag
    np.testing.assert_allclose(found.surface.semi_axes, [1, 1, 0], atol=0.03)
    assert found.surface.value([0.0, 0.0, 1e-3])[0] == np.inf


@FITS
def test_a_single_sample_gives_a_segment(fit):
    found = fit([[3.0, 4.0, 0.0]], [[1.0, 0.0, 0.0]], 0.01, 1.0, 1.0)
    assert found.surface.rank == 1
    np.testing.assert_allclose(found.surface.support([[0.6, 0.8, 0.0], [0.8, -0.6, 0.0]]), [5, 0], atol=1e-5)


@pytest.mark.parametrize(("patch", "rank"), [(rect_grid(2, 1, 6, 6), 3), (cylinder_grid(1, np.pi / 3, 2, 12, 12), 6)])
def test_ellipsoids_of_six_components(patch, rank):
    motion = sphere_motions(128)
    twist = motion / [1, 1, 1, 2, 2, 2]
    W, T = six_samples(friction_wrench(patch, twist, 1.0), twist, patch.load.sum(), 2.0)
    found = zhou_ellipsoid(W, T)
    assert found.surface.rank == rank
    radius = found.surface.radius(W)
    assert np.abs(radius - 1).mean() < 0.02


# Refusals ------------------------------------------------------------------------------------------------------------


@FITS
def test_a_fit_that_collapses_is_refused(fit):
    """A strong regulariser drives the coefficients to zero: P never comes near 1 on the samples."""
    W, T = samples(DISC, 20)
    with pytest.raises(CollapsedFitError):
        fit(W, T, lam=1e4, even=False)


def test_a_programme_that_is_almost_solved_is_judged_by_what_it_reached():
    """A pressure far from the origin, where the published weights are close to a collapse."""
    patch = rect_grid(2, 1, 12, 12)
    x, y = patch.centroid[:, :2].T
    patch = replace(patch, pressure=np.exp(-(((x - 0.5) / 0.2) ** 2 + ((y - 0.2) / 0.2) ** 2) / 2))
    W, T = samples(patch, 200)
    best = zhou_quartic(W, T, beta=1.0)
    scaled = np.abs(W).max(axis=0)
    S = T * scaled / np.linalg.norm(T * scaled, axis=1, keepdims=True)
    value = objective(best.surface.scaled(1 / scaled), best.rates, W / scaled, S, (1.0, 1.0, 1.0))
    assert best.objective == pytest.approx(value, rel=1e-6)
    assert fit_error(best.surface, W, T).Erad < 0.01


@FITS
def test_a_component_too_small_for_the_regulariser_is_refused_and_scaled_it_fits(fit):
    """Without scaling, a small torque is cheaper to ignore: the surface is endless along it."""
    W, T = samples(DISC, 60)
    small = np.array([1.0, 1.0, 1e-3])
    S = T / small
    S /= np.linalg.norm(S, axis=1, keepdims=True)
    with pytest.raises(CollapsedFitError):
        fit(W * small, S, beta=1.0, even=False)
    small_one, large = fit(W * small, S, beta=1.0), fit(W, T, beta=1.0)
    assert small_one.surface.semi_axes[2] == pytest.approx(1e-3 * large.surface.semi_axes[2], rel=1e-4)


@FITS
@pytest.mark.parametrize("weights", [{"lam": -1}, {"beta": np.nan}])
def test_weights_are_not_negative(fit, weights):
    with pytest.raises(ValueError, match="lam, beta, gamma"):
        fit(*samples(DISC, 20), **weights)
