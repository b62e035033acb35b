"""No decision hangs on rounding: turned samples and bodies, and changes of a few units in the last place."""

import collections

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softjaw.friction.wrench import friction_limits
from softjaw.lsfit import ellipsoid
from softjaw.lsfit.body import hull_volume
from softjaw.lsfit.ellipsoid import MAX_REACH_RATIO, Ellipsoid, full_ellipsoid
from softjaw.lsfit.form import directions, exponents, substitute
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import fit_error, sample_rank
from softjaw.lsfit.surface import FitError, FitFlag
from tests.generators import cylinder_grid, disc_polar, lcg_patch, points_patch
from tests.oracles import least_squares_quartic, samples, six_samples, wrenches_alone
from tests.scoring.grasps import unit
from tests.turns import TURNS, shaken


def turn(rng, d=3):
    return Rotation.random(random_state=rng).as_matrix() if d == 3 else np.linalg.qr(rng.normal(size=(d, d)))[0]


def turned(rng, W, T=None):
    R = turn(rng)
    return (shaken(rng, W @ R.T),) if T is None else (shaken(rng, W @ R.T), unit(shaken(rng, T @ R.T)))


def outcomes(decide, times=TURNS):
    rng, found = np.random.default_rng(0), collections.Counter()
    for _ in range(times):
        try:
            found[decide(rng)] += 1
        except (FitError, ValueError) as error:
            found[type(error)] += 1
    return found


def powers(**coefficients):
    """Quartic of x, y, z (and u, v) with coefficients such as ``xxyy=2``."""
    names, d = "xyzuv", 1 + max("xyzuv".index(c) for name in coefficients for c in name)
    E, v = exponents(d, 4), np.zeros(len(exponents(d, 4)))
    for name, value in coefficients.items():
        v[(E == [name.count(c) for c in names[:d]]).all(axis=1)] = value
    return v


BALL = powers(xxxx=1, yyyy=1, zzzz=1, xxyy=2, xxzz=2, yyzz=2)
LCG, DISC = samples(lcg_patch(3, 50), 100), samples(disc_polar(1, 20, 48), 100)
ONE, TWO = (samples(points_patch(*points), 100) for points in (([[0, 0]], [2.0]), ([[-1, 0], [1, 0]], [1, 1])))
FIVE, TEN = (tuple(x[:: 100 // n][:n] for x in LCG) for n in (5, 10))
HYPERBOLOID = np.array(
    [[np.hypot(1, z) * np.cos(p), np.hypot(1, z) * np.sin(p), z] for p in np.arange(12.0) for z in (-0.5, 0, 0.5)]
)
ENDLESS = np.array([[np.cos(p), np.sin(p), z] for p in np.arange(12.0) for z in (-0.5, 0.1, 0.5)])
CLEAN, FLAT, FEW = FitFlag.CLEAN, FitFlag.RANK_DEFICIENT, FitFlag.UNDERDETERMINED
FITTED, PROGRAMME = "least squares", "semidefinite programme"


@pytest.mark.parametrize(("data", "rank"), [(LCG, 3), (ONE, 2), ((LCG[0] * [1, 1, 1e-6],), 3), ((LCG[0][:1],), 1)])
def test_the_rank_of_samples(data, rank):
    """Margin 1e-9 of the largest singular value; hulls are flat from 1e-12."""

    def decide(rng):
        W = turned(rng, data[0])[0]
        return sample_rank(W), full_ellipsoid(W).rank, bool(hull_volume(W) > 0)

    assert outcomes(decide) == {(rank, rank, rank == 3): TURNS}


@pytest.mark.parametrize(("data", "gamma", "outcome"), [
    (LCG, 0.01, (CLEAN, 3, FITTED)), (DISC, 0.0, (CLEAN, 3, FITTED)), (TWO, 0.0, (CLEAN, 3, PROGRAMME)),
    (ONE, 0.01, (FLAT, 2, FITTED)), (TEN, 0.0, (FEW, 3, FITTED)), (FIVE, 0.0, (FEW, 3, FITTED)),
])  # fmt: skip
def test_the_flags_of_a_convex_quartic(data, gamma, outcome):
    """Rank, sufficiency of the data (1e-12 and 1e-10 of the normal equations), and whether the programme was needed."""

    def decide(rng):
        surface, certificate = convex_quartic(*turned(rng, *data), gamma)
        return surface.flag, surface.rank, certificate

    assert outcomes(decide) == {outcome: TURNS}


@pytest.mark.parametrize("data", [HYPERBOLOID, ENDLESS])
def test_an_ellipsoid_that_the_samples_leave_open_is_flagged(data):
    """The margin is that of the bound: samples of a cylinder would have the coefficient 0 along it, exactly."""
    assert outcomes(lambda rng: full_ellipsoid(turned(rng, data)[0]).flag) == {FitFlag.BOUNDED: TURNS}
    assert outcomes(lambda rng: ellipsoid.axis_aligned_ellipsoid(shaken(rng, data)).flag) == {FitFlag.BOUNDED: TURNS}
    found = outcomes(lambda rng: wrenches_alone(turned(rng, data)[0])[0].flag & FitFlag.BOUNDED, 3)
    assert found == {FitFlag.BOUNDED: 3}
    for surface in (full_ellipsoid(data), ellipsoid.axis_aligned_ellipsoid(data)):
        assert MAX_REACH_RATIO * 0.5 * 0.99 < surface.semi_axes[2] < MAX_REACH_RATIO * 2
    assert wrenches_alone(data)[0].semi_axes[2] < 2 * MAX_REACH_RATIO


def test_an_axis_that_no_load_reaches_is_zero():
    """Margin 1e-12 of the largest force: a face on end carries nothing along its normal but rounding."""

    def decide(rng):
        phi = rng.uniform(-np.pi, np.pi)
        normal = [np.cos(phi) * np.cos(np.pi / 2), np.cos(np.pi / 2) * np.sin(phi), 1.0]
        face = points_patch(rng.normal(size=(1, 2)), [2.0], np.roll([normal], rng.integers(2), axis=1))
        limits = friction_limits(face, shaken(rng, 0.5))
        return ellipsoid.three_motion_ellipsoid(limits.f_x, limits.f_y, 1e-17, shaken(rng, 0.01)).rank

    assert set(outcomes(decide)) == {1, 2}
    three = ellipsoid.three_motion_ellipsoid
    assert outcomes(lambda rng: three(1.0, shaken(rng, 6e-17), 1e-18, 0.01).rank) == {1: TURNS}
    assert outcomes(lambda rng: three(1.0, shaken(rng, 1e-9), 1e-9, 0.01).rank) == {3: TURNS}


@pytest.mark.parametrize("K", [30, 60, 100])
def test_a_quartic_of_fewer_samples_than_coefficients_is_one_and_flagged(K):
    """Of all best quartics the nearest to a ball: null directions lie at 1e-16, the others above 1e-8, the margin is
    1e-12. Without a margin its coefficients changed by some per cent."""
    W, _ = six_samples(cylinder_grid(1, np.pi / 3, 2, 12, 12), K)
    first = least_squares_quartic(W)
    fits = []

    def decide(rng):
        fits.append(least_squares_quartic(shaken(rng, W)))
        return fits[-1].flag

    assert FEW in first.flag
    assert outcomes(decide, 20) == {first.flag: 20}
    size = np.abs(first.coefficients).max()
    assert max(np.abs(s.coefficients - first.coefficients).max() for s in fits) < 1e-7 * size


def test_loads_in_the_plane_of_a_flat_body_are_in_it_and_a_full_body_has_no_outside_across():
    """Margin 1e-9 of the load; one a thousandth across is out."""
    w = 0.4 * directions(2, 20)

    def decide(rng):
        R = turn(rng)
        B = R[:, :2] * [1.0, 0.5]
        bodies = Quartic(np.array([1.0, 0, 2, 0, 1]), B), Ellipsoid(B)
        inside = shaken(rng, w @ B.T)
        off = inside + 1e-3 * R[:, 2]
        return tuple((bool(body.holds(inside).all()), bool(body.holds(off).any())) for body in bodies)

    assert outcomes(decide) == {((True, False), (True, False)): TURNS}
    flat = Ellipsoid.of_axes([1.0, 0.5, 0.0])

    def with_noise(rng):
        return bool(flat.holds(np.column_stack([0.4 * w, 1e-17 * rng.normal(size=20)])).all())

    assert outcomes(with_noise) == {True: TURNS}
    # However thin: a map of condition 1e9 leaves more rounding than the margin of a flat body.
    rng = np.random.default_rng(0)
    for _ in range(20):
        B = turn(rng) * [1.0, 1.0, 1e-9] @ turn(rng)
        assert np.isfinite(Quartic(BALL, B).value(directions(3, 50) @ B.T)).all()


def test_a_wrench_that_is_the_rounding_of_none_is_left_out_and_a_polynomial_zero_at_a_sample_is_endless():
    """Margin 1e-12 of the largest: one such sample had a radius of 1e17."""
    surface = convex_quartic(*ONE)[0]
    whole = fit_error(surface, *ONE)

    def decide(rng):
        W = np.vstack([ONE[0], 1e-17 * rng.integers(0, 2) * rng.normal(size=(1, 3))])
        # a copy without the sample lies elsewhere in memory, where products may end in other bits
        return fit_error(surface, W, np.vstack([ONE[1], [[0, 0, 1]]])) == pytest.approx(whole, rel=1e-12)

    assert outcomes(decide) == {True: TURNS}

    # Margin 1e-9 of the part along a normal; what is left of none has any direction.
    def decide(rng):
        B = turn(rng)[:, :2]
        return round(fit_error(Ellipsoid(B), [B[:, 0]], [-B[:, 0]]).Edir, 6)

    assert outcomes(decide) == {90.0: TURNS}
    # Margin 1e-12, a radius of 1000.
    cylinder, E = powers(xxxx=1, xxyy=2, yyyy=1, zzzz=0), exponents(3, 4)

    def decide(rng):
        R = turn(rng)
        surface = Quartic.of_coefficients(shaken(rng, substitute(cylinder, E, R.T)))
        return fit_error(surface, [R[:, 2]], [R[:, 0]]).Erad

    assert outcomes(decide) == {np.inf: TURNS}
