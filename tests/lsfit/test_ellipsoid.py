"""Ellipsoids as limit surfaces, and the exact body they stand for."""

import numpy as np
import pytest

from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.wrench import friction_limits, friction_wrench
from softjaw.lsfit.body import hull_volume
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.lsfit.fit_error import fit_error, overclaim
from softjaw.lsfit.samples import normalised_samples, sample_rank
from tests.generators import lcg_patch
from tests.oracles import body_volume

AXES = np.array([0.8, 0.6, 0.15])


def on_the_surface(K=200):
    """Wrenches of the ellipsoid with `AXES` and the unit normals there."""
    t = fibonacci_twists(K, 1.0)
    return t * AXES**2 / np.linalg.norm(t * AXES, axis=1, keepdims=True), t


def test_an_ellipsoid_fits_itself():
    W, T = on_the_surface()
    ellipsoid = Ellipsoid(AXES)
    np.testing.assert_allclose(ellipsoid.value(W), 1, rtol=1e-14)
    np.testing.assert_allclose(fit_error(ellipsoid, W, T), 0, atol=1e-13)
    np.testing.assert_allclose(ellipsoid.support(T), (W * T).sum(axis=1), rtol=1e-14)
    assert all(ellipsoid.holds(w) for w in W * (1 - 1e-9))
    assert not any(ellipsoid.holds(w) for w in W * (1 + 1e-9))


def test_errors_of_a_swollen_ellipsoid():
    """Radii too large by 10 %: P = 1 / 1.21 on the true surface, and P^(-1/2) = 1.1."""
    W, T = on_the_surface()
    errors = fit_error(Ellipsoid(1.1 * AXES), W, T)
    np.testing.assert_allclose(errors, [1 - 1 / 1.21, 0.1, 0], atol=1e-12)


def test_only_what_is_claimed_too_much_is_an_overclaim():
    W, _ = on_the_surface()
    assert overclaim(Ellipsoid(1.1 * AXES), W) == pytest.approx(0.1, rel=1e-9)
    assert overclaim(Ellipsoid(0.9 * AXES), W) == 0.0
    assert overclaim(Ellipsoid(AXES * [1.0, 1.0, 1.2]), [[0, 0, AXES[2]], [AXES[0], 0, 0]]) == pytest.approx(0.2)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_axis_that_carries_nothing_is_zero_and_never_infinite(axis):
    axes = AXES.copy()
    axes[axis] = 0
    flat = Ellipsoid(axes)
    assert (flat.rank, flat.volume) == (2, 0)
    inside, outside = 0.1 * axes, 0.1 * axes + 1e-9 * np.eye(3)[axis]
    assert flat.holds(inside)
    assert not flat.holds(outside)
    assert np.isfinite(flat.support(np.eye(3))).all()
    assert np.isfinite(flat.gradient(inside)).all()


@pytest.mark.parametrize("axes", [[1, 1], [1, 1, -1], [1, np.nan, 1], [1, 1, np.inf]])
def test_semi_axes_are_lengths(axes):
    with pytest.raises(ValueError, match="semi_axes is"):
        Ellipsoid(axes)


def samples(patch, K, rho=2.0):
    twist, S = fibonacci_twists(K, rho), friction_limits(patch, 1.0).S
    return normalised_samples(friction_wrench(patch, twist, 1.0), twist, S, rho)


def test_every_wrench_is_inside_the_box_of_the_maxima():
    patch = lcg_patch(6, 50)
    W, T = samples(patch, 300)
    limits = np.array(friction_limits(patch, 1.0).per_unit_force) / [1, 1, 2]
    assert (np.abs(W) <= limits * (1 + 1e-13)).all()
    assert ((W * T).sum(axis=1) > 0).all()


def test_hulls_approach_the_body_with_order_one_in_the_samples():
    body = Ellipsoid(AXES)
    missing = [1 - hull_volume(on_the_surface(K)[0]) / body.volume for K in (500, 1000, 2000, 4000)]
    np.testing.assert_allclose(np.log2(np.divide(missing[:-1], missing[1:])), 1, atol=0.05)
    assert body_volume(on_the_surface(2000)[0], on_the_surface(8000)[0]) == pytest.approx(body.volume, rel=5e-6)
    assert hull_volume(on_the_surface()[0] * [1, 1, 0]) == 0


def test_rank_of_samples_and_bad_scales():
    assert sample_rank(on_the_surface()[0]) == 3
    assert sample_rank(on_the_surface()[0] * [1, 0, 1]) == 2
    assert sample_rank(np.zeros((4, 3))) == 0
    with pytest.raises(ValueError, match="positive force and length"):
        normalised_samples(np.eye(3), np.eye(3), 0.0, 1.0)
    with pytest.raises(ValueError, match=r"twist\[1\] is zero"):
        normalised_samples(np.eye(3)[:2], [[1, 0, 0], [0, 0, 0]], 1.0, 1.0)
