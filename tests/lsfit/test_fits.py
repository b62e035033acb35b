"""Fits of ellipsoids and quartics to friction of known patches, and to data that does not determine them."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from softjaw.friction.wrench import friction_limits
from softjaw.lsfit import sos
from softjaw.lsfit.ellipsoid import Ellipsoid, axis_aligned_ellipsoid, full_ellipsoid
from softjaw.lsfit.form import directions
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import fit_error
from softjaw.lsfit.surface import FitError, FitFlag
from tests.generators import build, cylinder_grid, disc_polar, heightfield, lcg_patch, points_patch, rect_grid
from tests.generators import lcg_noise as noise
from tests.oracles import body_volume, least_squares_quartic, samples, smallest_curvature, wrenches_alone

HERTZ = {"gen": "disc_polar", "args": {"R": 1.0, "nr": 40, "nt": 96}, "pressure": {"kind": "hertz", "a": 1.0}}
GAUSS = {
    "gen": "rect_grid", "args": {"a": 2.0, "b": 1.0, "nx": 80, "ny": 40}, "shift_to_cop_xy": True,
    "pressure": {"kind": "gauss", "x0": 0.5, "y0": 0.2, "sx": 0.4, "sy": 0.3},
}  # fmt: skip
TWO_POINTS = points_patch([[-1, 0], [1, 0]], [1, 1])
# Patch, rho, errors (E1, Erad, Edir) of the three-motion and full ellipsoid and the quartic, smallest eigenvalue, and
# the three volumes over the exact one, as an independent implementation found them for 500 motions.
PATCHES = {
    "Hertz": (build(HERTZ), 2, ".0208/.0110/8.27 .0156/.0078/6.54 .0045/.0011/1.09", 4.0, "1.110/1.027/1.000"),
    "6:1": (rect_grid(6, 1, 120, 20), 6, ".0129/.0067/9.71 .0149/.0076/9.77 .0084/.0021/5.66", 3.9,
            "1.091/1.071/1.011"),
    "two points": (TWO_POINTS, 2, ".0179/.0095/11.1 .0196/.0101/11.0 .0125/.0031/6.34", -2.2, "1.333/1.289/1.120"),
    "cylinder 85": (cylinder_grid(1, np.radians(85), 2, 48, 48), 2,
                    ".0342/.0178/11.2 .0287/.0148/10.4 .0163/.0041/3.66", 2.1, "1.113/1.075/1.006"),
    "saddle": (heightfield(1, 1, 1, -1, 48, 48), 2, ".0302/.0160/8.06 .0201/.0102/6.63 .0087/.0022/2.04", 5.9,
               "1.124/1.034/1.003"),
    "Gauss": (build(GAUSS), 2, ".0093/.0048/7.88 .0076/.0038/6.70 .0044/.0011/2.68", 4.0, "1.085/1.020/1.001"),
}  # fmt: skip


def objective(surface, W, T=None, gamma=0.0):
    value = ((surface.value(W) - 1) ** 2).mean()
    if T is None or gamma == 0:
        return value
    G = surface.gradient(W)
    return value + gamma * ((G - (G * T).sum(axis=1, keepdims=True) * T) ** 2).sum(axis=1).mean()


def numbers(text):
    return np.array([[float(x) for x in group.split("/")] for group in text.split()])


@pytest.mark.parametrize("name", PATCHES)
def test_errors_and_volumes_of_known_patches(name):
    patch, rho, errors, eigenvalue, ratios = PATCHES[name]
    W, T = samples(patch, 500, rho)
    limits = np.array(friction_limits(patch, 1.0).per_unit_force) / [1, 1, rho]
    models = Ellipsoid.of_axes(limits), full_ellipsoid(W), least_squares_quartic(W)
    off = np.array([fit_error(model, W, T) for model in models]) - numbers(errors)
    np.testing.assert_allclose(off, 0, atol=0.06)
    np.testing.assert_allclose(off[:, :2], 0, atol=6e-5)
    assert smallest_curvature(models[2].coefficients, 3) == pytest.approx(eigenvalue, abs=0.06)
    V = body_volume(samples(patch, 1000, rho)[0], samples(patch, 4000, rho)[0])
    np.testing.assert_allclose(np.array([m.volume for m in models]) / V, numbers(ratios)[0], atol=1.1e-3)


@pytest.mark.parametrize("name", PATCHES)
def test_only_two_points_need_the_programme(name):
    patch, rho, *_ = PATCHES[name]
    W, T = samples(patch, 500, rho)
    (surface, certificate), free = wrenches_alone(W), least_squares_quartic(W)
    assert (surface.flag, surface.rank) == (FitFlag.CLEAN, 3)
    if name == "two points":
        assert certificate == "semidefinite programme"
        np.testing.assert_allclose(fit_error(surface, W, T), [0.0129, 0.0033, 6.62], atol=6e-3)
        np.testing.assert_allclose(fit_error(surface, W, T)[:2], [0.0129, 0.0033], atol=6e-5)
        assert objective(surface, W) > objective(free, W)
    else:
        assert certificate == "least squares"
        # the condition of the equations, some 1e3, times rounding
        np.testing.assert_allclose(surface.coefficients, free.coefficients, rtol=1e-10, atol=1e-10)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6), faces=st.sampled_from([2, 3, 5, 30]), K=st.sampled_from([4, 8, 20, 60, 200]),
    amplitude=st.sampled_from([0.0, 0.2, 0.6]), gamma=st.sampled_from([0.0, 0.01, 1.0]),
)  # fmt: skip
def test_every_fit_is_finite_and_every_convex_one_is_convex(seed, faces, K, amplitude, gamma):
    W, T = samples(lcg_patch(seed, faces), K)
    W = W * noise(len(W), amplitude, seed)[:, None]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        convex = convex_quartic(W, T, gamma)[0]
        surfaces = convex, full_ellipsoid(W), axis_aligned_ellipsoid(W)
        sizes = [(*s.semi_axes, s.volume, s.shadow_area, *fit_error(s, W, T)[1:]) for s in surfaces]
    assert np.isfinite(sizes).all()
    a, b = (u * convex.radius(u)[:, None] for u in np.random.default_rng(seed).normal(size=(2, 300, 3)))
    assert convex.holds((a + b) / 2).all()
    if convex.rank == 3:
        least = objective(least_squares_quartic(W, T, gamma), W, T, gamma)
        assert objective(convex, W, T, gamma) >= least * (1 - 1e-6) - 1e-12


@pytest.mark.long
def test_every_convex_quartic_in_three_variables_has_a_gram_matrix():
    """Convex is sos-convex there: a curvature of 0.02 at least is enough for a proof, one of -0.02 forbids it."""
    random, ball, freedom = np.random.default_rng(4), *np.split(sos.ball_gram(3), [15])
    assert smallest_curvature(ball, 3) == pytest.approx(4, rel=1e-12)
    searched = 0
    for _ in range(10):
        v = random.normal(size=15)
        # The smallest curvature is concave in the share of the ball: 4 at 1, below zero at 0.
        for curvature in (0.02, -0.02):
            share = brentq(lambda x, v=v, c=curvature: smallest_curvature(x * ball + (1 - x) * v, 3) - c, 0, 1)
            mixed = share * ball + (1 - share) * v
            _, free = sos.convex_least_squares(np.eye(15), mixed, 3, loose=False)
            assert (sos.smallest(sos.gram_matrix(mixed, free, 3)) >= sos.MIN_EIGENVALUE) == (curvature > 0)
            searched += curvature > 0 and sos.smallest(sos.gram_matrix(mixed, freedom, 3)) < sos.MIN_EIGENVALUE
    assert searched > 0  # the free numbers of a ball were not enough


def test_ellipsoids_are_recovered_wherever_they_lie_also_in_a_plane_and_motions_improve_directions():
    """Affine images of samples give the affine image of the fit, if wrenches alone count."""
    random = np.random.default_rng(1)
    for _ in range(10):
        L = random.normal(size=(3, 3))
        u = directions(3, 50)
        inverse = np.linalg.inv(L)
        np.testing.assert_allclose(full_ellipsoid(u @ L.T).A, inverse.T @ inverse, rtol=1e-9)
        W = samples(lcg_patch(7, 30), 100)[0]
        one, other = full_ellipsoid(W), full_ellipsoid(W @ L.T)
        np.testing.assert_allclose(other.support(u), one.support(u @ L), rtol=1e-9)
        one, other = wrenches_alone(W)[0], wrenches_alone(W @ L.T)[0]
        np.testing.assert_allclose(other.support(u), one.support(u @ L), rtol=1e-7)
    W, T = samples(PATCHES["Gauss"][0], 60)
    far, near = (convex_quartic(W, T, gamma=g)[0] for g in (0.0, 1.0))
    test = samples(PATCHES["Gauss"][0], 333)
    assert fit_error(near, *test).Edir < fit_error(far, *test).Edir
    assert fit_error(near, *test).Erad > fit_error(far, *test).Erad
    B = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0][:, :2]
    W = directions(2, 40) * [1.0, 0.5] @ B.T
    for surface in (full_ellipsoid(W), wrenches_alone(W)[0]):
        assert surface.flag == FitFlag.RANK_DEFICIENT
        np.testing.assert_allclose(surface.value(W), 1, rtol=1e-12)
        assert surface.support(np.cross(*B.T))[0] == pytest.approx(0, abs=1e-15)
        np.testing.assert_allclose(surface.support(B.T), [1.0, 0.5], rtol=1e-3)
    aligned = axis_aligned_ellipsoid(W)
    assert aligned.flag & FitFlag.RANK_DEFICIENT
    assert (aligned.semi_axes < 5).all()


@pytest.mark.parametrize(("R", "flag"), [(1e-6, FitFlag.RANK_DEFICIENT), (1e-3, FitFlag.THIN)])
def test_a_rho_far_from_the_size_of_the_patch_is_flagged(R, flag):
    W, T = samples(disc_polar(R, 20, 48), 300, rho=1.0)
    for surface in (full_ellipsoid(W), axis_aligned_ellipsoid(W), convex_quartic(W, T)[0]):
        assert surface.flag & flag
        assert 0 <= surface.semi_axes[2] <= R
    W, T = samples(disc_polar(R, 20, 48), 300, rho=2 * R)
    np.testing.assert_allclose(full_ellipsoid(W).A, full_ellipsoid(samples(disc_polar(1, 20, 48), 300)[0]).A, rtol=1e-9)


@pytest.mark.parametrize("K", [1, 2, 3, 5, 10])
def test_few_samples_are_flagged_and_stay_bounded(K):
    W, T = (x[:: 300 // K][:K] for x in samples(lcg_patch(9, 30), 300))
    convex = wrenches_alone(W)[0]
    assert convex.flag & (FitFlag.UNDERDETERMINED | FitFlag.RANK_DEFICIENT)
    for surface in (convex, full_ellipsoid(W), axis_aligned_ellipsoid(W)):
        assert (surface.semi_axes < 30 * np.abs(W).max()).all()
        assert np.isfinite(fit_error(surface, W, T)).all()


def test_a_programme_that_is_not_solved_is_an_error():
    """``x >= 1`` and the slope to minus infinity: there is no least value."""
    _, triangle = sos.parts(sos.quadratic_map, 2)
    with pytest.raises(FitError):
        sos.least_in_cone(np.zeros((3, 3)), np.ones(3), triangle, 1.0)


@pytest.mark.parametrize("d", [1, 2, 4])
def test_quartics_of_other_dimensions_are_certified(d):
    W = directions(d, 60)
    W = W * (1 + 0.3 * np.sin(5 * W).sum(axis=1, keepdims=True)) * np.arange(1, d + 1)
    surface = wrenches_alone(W)[0]
    a, b = (u * surface.radius(u)[:, None] for u in np.random.default_rng(d).normal(size=(2, 300, d)))
    assert surface.holds((a + b) / 2).all()
