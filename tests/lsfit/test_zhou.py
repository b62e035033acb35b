"""Fits by sums of lengths: optimality, invariance, spans, and refusals of surfaces that run away."""

import numpy as np
import pytest

from softjaw.friction.motion import SLIDE_X, SLIDE_Y
from softjaw.friction.wrench import friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.lsfit.form import exponents
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.samples import normalised_samples, sphere_motions
from softjaw.lsfit.span import FitError, SpanSamples, span_samples, zhou_ellipsoid, zhou_quartic
from softjaw.lsfit.surface import FitFlag
from tests.generators import cylinder_grid, disc_polar, lcg_patch, points_patch, rect_grid
from tests.oracles import least_curvature, samples, six_samples
from tests.scoring.grasps import unit

DISC = disc_polar(1, 40, 96)
FITS = pytest.mark.parametrize("fit", [zhou_ellipsoid, zhou_quartic])


def as_they_are(W, T):
    return SpanSamples(W, T, np.eye(W.shape[1]), FitFlag.CLEAN)


def objective(surface, W, T, lam, beta, gamma):
    """The objective as the publication writes it, with the best rate of each sample."""
    G, quadratic = surface.gradient(W), isinstance(surface, Ellipsoid)
    G = G / 2 if quadratic else G
    rates = np.maximum((G * T).sum(axis=1), 0.0)
    size = np.linalg.norm(surface.A if quadratic else surface.coefficients)
    off = np.abs(surface.value(W) - 1).sum()
    return lam * size + beta * off + gamma * np.linalg.norm(G - rates[:, None] * T, axis=1).sum()


@FITS
@pytest.mark.parametrize("weights", [(1.0, 10.0, 1.0), (0.1, 1.0, 3.0)])
def test_no_neighbour_is_better(fit, weights):
    """The objective is convex: what is best among neighbours, also on the way to other convex forms, is best of all."""
    W, T = samples(lcg_patch(6, 40), 60)
    best = fit(as_they_are(W, T), weights)
    value = objective(best, W, T, *weights)
    for factors in (np.full(3, 1.01), np.full(3, 0.99), *(1 + 0.01 * np.eye(3)), *(1 - 0.01 * np.eye(3))):
        assert objective(best.scaled(factors), W, T, *weights) > value * (1 - 1e-7)
    for seed in range(10):
        F = np.random.default_rng(seed).normal(size=(3, 3))
        if fit is zhou_ellipsoid:
            beside = Ellipsoid.of_matrix(0.99 * best.A + 0.01 * F @ F.T)
        else:
            E = exponents(3, 4)
            fourth = np.zeros(len(E))
            fourth[E.max(axis=1) == 4] = np.abs(F[0])
            beside = Quartic.of_coefficients(0.99 * best.coefficients + 0.01 * fourth)
        assert objective(beside, W, T, *weights) > value * (1 - 1e-7)


def test_an_ellipsoid_is_found_again_and_the_quartic_is_convex_where_the_samples_are_not():
    A = np.array([[2.0, 0.3, -0.2], [0.3, 3.0, 0.5], [-0.2, 0.5, 9.0]])
    true, u = Ellipsoid.of_matrix(A), sphere_motions(80, 3)
    W = u * true.radius(u)[:, None]
    np.testing.assert_allclose(zhou_ellipsoid(span_samples(W, unit(W @ A))).A, A, rtol=1e-6, atol=1e-6)
    # Two points, noisy: the best quartic without the constraint has negative curvature.
    W, T = samples(points_patch([[-1, 0], [1, 0]], [1, 1]), 40)
    W = W * (1 + 0.3 * np.random.default_rng(1).uniform(-1, 1, (40, 1)))
    surface = zhou_quartic(span_samples(W, T))
    assert least_curvature(surface, sphere_motions(2000, 3) * surface.semi_axes) > -1e-6


@FITS
def test_the_fit_is_free_of_units_and_samples_in_a_plane_give_a_flat_surface(fit):
    """Scaled to one, samples in other units are the same samples, and motions change inversely."""
    W, T = samples(lcg_patch(6, 40), 60)
    factors = np.array([1.0, 1.0, 1e3])
    metre, other = fit(span_samples(W, T)), fit(span_samples(W * factors, unit(T / factors)))
    np.testing.assert_allclose(other.semi_axes, metre.semi_axes * factors, rtol=1e-5)
    phi = np.pi * np.arange(12)[:, None] / 12
    twist = np.cos(phi) * SLIDE_X + np.sin(phi) * SLIDE_Y
    surface = fit(span_samples(*normalised_samples(friction_wrench(DISC, twist, 1.0), twist, DISC.load.sum(), 2.0)))
    assert (surface.rank, surface.dimension) == (2, 3)
    assert FitFlag.RANK_DEFICIENT in surface.flag
    np.testing.assert_allclose(surface.semi_axes, [1, 1, 0], atol=0.03)
    assert np.isposinf(surface.value([0.0, 0.0, 1e-3])[0])


@pytest.mark.parametrize(("patch", "rank"), [(rect_grid(2, 1, 6, 6), 3), (cylinder_grid(1, np.pi / 3, 2, 12, 12), 6)])
def test_ellipsoids_of_six_components(patch, rank):
    W, T = six_samples(patch, 128)
    surface = zhou_ellipsoid(span_samples(W, T))
    assert surface.rank == rank
    assert np.abs(surface.radius(W) - 1).mean() < 0.02


@FITS
def test_a_fit_that_collapses_is_refused(fit):
    """Short wrenches with motions against them: gradients that are wrong everywhere cost more than no surface."""
    u = sphere_motions(200, 3)
    with pytest.raises(FitError):
        fit(span_samples(np.vstack([0.02 * u, np.eye(3)]), np.vstack([-u, -np.eye(3)])))
