"""Surfaces in the span of their samples: of all six components, and by sums of lengths as Zhou et al. fit them."""

import numpy as np
import pytest

from softjaw.friction.motion import SLIDE_X, SLIDE_Y
from softjaw.friction.wrench import friction_support, friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid, full_ellipsoid
from softjaw.lsfit.form import exponents, hessian_tensor, monomials
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import fit_error, normalised_samples, sample_rank, sphere_motions
from softjaw.lsfit.sos import ball_gram, gram_map
from softjaw.lsfit.span import SpanSamples, span_ellipsoid, span_quartic, span_samples, zhou_ellipsoid, zhou_quartic
from softjaw.lsfit.surface import FitError, FitFlag
from tests import oracles
from tests.generators import cap_polar, cylinder_grid, disc_polar, heightfield, lcg_patch, points_patch, rect_grid
from tests.oracles import samples, six_samples
from tests.scoring.grasps import unit

DISC = disc_polar(1, 40, 96)
FITS = pytest.mark.parametrize("fit", [zhou_ellipsoid, zhou_quartic])


@pytest.mark.parametrize(("d", "unknowns"), [(2, 6), (3, 24), (6, 351)])
def test_a_gram_matrix_gives_the_second_derivatives_whatever_its_free_numbers(d, unknowns):
    rng, E = np.random.default_rng(d), exponents(d, 4)
    A = gram_map(d)
    assert A.shape == (d**4, unknowns)
    x, w, z = rng.normal(size=unknowns), rng.normal(size=d), rng.normal(size=d)
    Q = (A @ x).reshape(d * d, d * d)
    curvature = np.einsum("ijkl,i,j,k,l", hessian_tensor(x[: len(E)], d), z, z, w, w)
    assert np.kron(z, w) @ Q @ np.kron(z, w) == pytest.approx(curvature, rel=1e-12)
    np.testing.assert_allclose(Q, Q.T, atol=1e-14 * np.abs(Q).max())


@pytest.mark.parametrize("d", [1, 2, 3, 6])
def test_the_start_is_the_ball_with_a_definite_matrix(d):
    E, w = exponents(d, 4), np.random.default_rng(0).normal(size=(5, d))
    x = ball_gram(d)
    np.testing.assert_allclose(monomials(w, E) @ x[: len(E)], (w**2).sum(axis=1) ** 2, rtol=1e-12)
    assert np.linalg.eigvalsh((gram_map(d) @ x).reshape(d * d, d * d))[0] > 1.99


def test_a_nearly_flat_patch_ends_where_rounding_lets_it_and_motions_cover_the_sphere_evenly():
    """Torques follow from forces within a thousandth: the axes of the components suit badly."""
    W, T = six_samples(cylinder_grid(1, 0.05, 2, 12, 12), 30)
    surface = span_quartic(W, T)
    assert surface.rank == 6
    assert fit_error(surface, W, T).Erad < 2e-3
    u = sphere_motions(4000)
    np.testing.assert_allclose(np.linalg.norm(u, axis=1), 1, rtol=1e-14)
    np.testing.assert_allclose(u.T @ u / len(u), np.eye(6) / 6, atol=5e-3)
    np.testing.assert_allclose(u.mean(axis=0), 0, atol=5e-3)


def plane_samples(c, K=60):
    """Points and normals of ``x^4 + c x^2 y^2 + y^4 = 1``, which is convex for ``0 <= c <= 6``."""
    surface = Quartic.of_coefficients([1, 0, c, 0, 1], 2)
    phi = np.pi * (np.arange(K) + 0.5) / K
    u = np.column_stack([np.cos(phi), np.sin(phi)])
    W = u * surface.radius(u)[:, None]
    T = surface.gradient(W)
    return W, T / np.linalg.norm(T, axis=1, keepdims=True)


@pytest.mark.parametrize("c", [0.5, 3.0, 5.5])
def test_a_convex_quartic_is_found_again(c):
    W, T = plane_samples(c)
    surface, _ = convex_quartic(W, T, gamma=1.0)
    np.testing.assert_allclose(surface.coefficients, [1, 0, c, 0, 1], atol=1e-4)
    np.testing.assert_allclose(fit_error(surface, W, T), 0, atol=1e-3)


def test_a_quartic_that_is_not_convex_becomes_one_that_hardly_is():
    W, T = plane_samples(9.0)
    free, surface = oracles.least_squares_quartic(W), oracles.wrenches_alone(W)[0]
    assert fit_error(free, W, T).E1 < 1e-12
    assert oracles.least_curvature(free, W) < -1
    assert oracles.least_curvature(surface, W) > 0
    assert oracles.smallest_curvature(surface.coefficients, 2) == pytest.approx(0, abs=0.05)
    assert fit_error(surface, W, T).E1 > 1e-2


@pytest.mark.parametrize(("patch", "rank"), [
    (points_patch([[0, 0]], [1]), 2), (rect_grid(2, 1, 6, 6), 3),
    (points_patch([[-1, 0, 0.4], [1, 0, 0.4], [0, 1, 0.4]], [1, 2, 1]), 3), (cylinder_grid(1, 1.0, 2, 6, 6), 6),
    (cap_polar(1, 1.0, 6, 12), 6),
])  # fmt: skip
def test_rank_of_plane_and_curved_patches(patch, rank):
    W, T = six_samples(patch, 200)
    (surface, _), inside = span_ellipsoid(W, T), span_samples(W, T)
    assert inside.rank == surface.rank == rank == sample_rank(W)
    assert (FitFlag.RANK_DEFICIENT in surface.flag) == (rank < 6)
    np.testing.assert_allclose(inside.Y @ inside.B.T, W, atol=1e-13)
    np.testing.assert_allclose(surface.support(np.linalg.svd(W)[2][rank:]), 0, atol=1e-7)
    assert np.isfinite(surface.semi_axes).all()


def test_a_plane_patch_has_the_ellipsoid_of_three_components_and_a_flat_quartic():
    W, T = six_samples(rect_grid(2, 1, 6, 6), 300)
    three = full_ellipsoid(W[:, [0, 1, 5]])
    flat = span_ellipsoid(W, T)[0]
    np.testing.assert_allclose(flat.A[np.ix_([0, 1, 5], [0, 1, 5])], three.A, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(flat.semi_axes, [*three.semi_axes[:2], 0, 0, 0, three.semi_axes[2]], atol=1e-9)
    W, T = W[:60], T[:60]
    V, S = np.vstack([W, 0 * W[:1]]), np.vstack([T, np.eye(6)[2]])
    # one row more: the same numbers, but the sums of a singular value decomposition may end in other bits
    np.testing.assert_allclose(np.abs(span_samples(V, S).Y), np.abs(span_samples(W, T).Y), atol=1e-12)
    W, T = six_samples(points_patch([[-1, 0, 0.4], [1, 0, 0.4], [0, 1, 0.4]], [1, 2, 1]), 200)
    surface = span_quartic(W, T)
    missing = np.linalg.svd(W)[2][3:]
    assert (surface.rank, surface.dimension) == (3, 6)
    assert FitFlag.RANK_DEFICIENT in surface.flag
    assert fit_error(surface, W, T).Erad < 0.02
    np.testing.assert_allclose(surface.support(missing), 0, atol=1e-12)
    assert np.isposinf(surface.value(W[:3] + 1e-3 * missing[:1])).all()
    np.testing.assert_allclose(surface.radius(missing), 0, atol=1e-12)
    assert surface.holds(0.9 * W).all()


@pytest.mark.parametrize(("patch", "ellipsoid", "quartic"), [
    (cylinder_grid(1, np.pi / 3, 2, 24, 24), (0.0198, 0.0100), (0.0097, 0.0024)),
    (cap_polar(1, np.pi / 3, 12, 24), (0.0191, 0.0097), (0.0048, 0.0012)),
    (heightfield(1, 1, 0.8, -0.8, 20, 20), (0.0195, 0.0098), (0.0097, 0.0024)),
])  # fmt: skip
def test_errors_of_fits_to_curved_patches(patch, ellipsoid, quartic):
    """Figures of an independent implementation for other motions (and another saddle), hence the tolerance."""
    W, T = six_samples(patch, 1024)
    assert span_ellipsoid(W, T)[1][:2] == pytest.approx(ellipsoid, rel=0.12)
    assert fit_error(oracles.least_squares_quartic(W), W, T)[:2] == pytest.approx(quartic, rel=0.15)


def test_directions_are_judged_with_axes_of_like_length_and_what_nothing_holds_is_bounded_and_flagged():
    """31.9 and 10.7 degrees, by an independent implementation and other motions."""
    patch = cylinder_grid(1, np.pi / 3, 2, 24, 24)
    cylinder = six_samples(patch, 512)
    convex = span_quartic(*cylinder)
    assert fit_error(full_ellipsoid(cylinder[0]), *cylinder).Edir == pytest.approx(31.9, rel=0.1)
    assert span_ellipsoid(*cylinder)[1].Edir == pytest.approx(10.7, rel=0.1)
    motion = np.random.default_rng(1).normal(size=(200, 6))
    H = friction_support(patch, motion / oracles.SIX, 0.5) / (0.5 * patch.load.sum())
    np.testing.assert_allclose(convex.support(motion), H, rtol=0.08)
    assert np.abs(convex.support(motion) / H - 1).mean() < 0.015
    # All samples on two parallel lines: the best quartic is ``f_x^4``, endless along the lines.
    y = np.linspace(-1, 1, 20)
    W, T = np.column_stack([np.ones(20), y]), np.column_stack([np.ones(20), 0 * y])
    for bounded in (span_ellipsoid(W, T)[0], span_quartic(W, T)):
        assert FitFlag.BOUNDED in bounded.flag
        assert bounded.semi_axes.max() < 15


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
    assert oracles.least_curvature(surface, sphere_motions(2000, 3) * surface.semi_axes) > -1e-6


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
