"""Friction wrenches: the compiled kernel, single patches, what holds for all, six dimensions, and the pure torque."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize
from scipy.special import ellipe

from softjaw.friction import wrench
from softjaw.friction.motion import SLIDE_X, SLIDE_Y, fibonacci_twists
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import friction_limits, friction_support, friction_wrench, pure_torque
from tests import generators as made
from tests.friction.closed_forms import FORMS, mean_distance

SEEDS = range(1, 21)
# The same examples on every rank and every day, and no folder of past failures beside the project.
REPEATABLE = settings(derandomize=True, deadline=None, database=None, max_examples=80)
COMPONENT = st.floats(-1, 1, width=32)
ROUNDING = 1e-13
NAMES = ("S", "F_N", "f_x", "f_y", "tau_z")


@pytest.mark.parametrize("seed", SEEDS)
def test_the_compiled_kernel_is_the_textbook_formula(seed):
    patch = made.lcg_patch(seed, 101)
    twist = np.vstack([np.random.default_rng(seed).normal(size=(20, 6)), np.eye(6)])
    columns = patch.centroid.T.copy(), patch.normal.T.copy(), patch.load
    out = np.empty((len(twist), 7))
    wrench.friction_sums(*columns, twist, out)
    expected = made.friction_sums_reference(*columns, twist)
    np.testing.assert_allclose(out, expected, rtol=0, atol=1e-12 * patch.load.sum())


def test_the_wrench_is_odd_and_deaf_to_speed_a_translation_turns_about_infinity_and_e_n_is_free_of_mu():
    patch, twist = made.lcg_patch(5, 80), np.random.default_rng(0).normal(size=(50, 6))
    W = friction_wrench(patch, twist, 0.4)
    rounding = {"rtol": 0, "atol": 1e-14 * patch.load.sum()}  # of the sum over faces
    np.testing.assert_allclose(friction_wrench(patch, -twist, 0.4), -W, **rounding)
    for speed in (2.0**-900, 2.0**900):
        np.testing.assert_allclose(friction_wrench(patch, speed * twist, 0.4), W, **rounding)
    np.testing.assert_allclose(friction_wrench(patch, 1e-200 * twist, 0.4), W, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(friction_support(patch, 1e3 * twist, 0.4), 1e3 * friction_support(patch, twist, 0.4))
    W = friction_wrench(made.lcg_patch(3, 30), np.random.default_rng(1).normal(size=(9, 6)), 0.5, "pcm")
    np.testing.assert_allclose(W[:, [2, 3, 4]], 0, atol=1e-15)
    # Forces approach with order 2 in the distance, moments with order 1.
    patch = made.cylinder_grid(1.0, np.pi / 3, 2.0, 16, 16)
    exact = friction_wrench(patch, SLIDE_Y, 1.0)[0]
    force, moment = [], []
    for D in (10.0, 20.0, 40.0, 80.0):
        W = friction_wrench(patch, made.cor_twists([[-D, 0.3]]), 1.0)[0]
        force.append(abs(W[1] - exact[1]))
        moment.append(abs(W[5] - exact[5]))
    np.testing.assert_allclose(np.log2(np.divide(force[:-1], force[1:])), 2, atol=0.1)
    np.testing.assert_allclose(np.log2(np.divide(moment[:-1], moment[1:])), 1, atol=0.1)
    patch = made.cylinder_grid(0.02, 0.7, 0.05, 12, 12)
    with_friction, without = friction_limits(patch, 0.8), friction_limits(patch, 0.0)
    assert with_friction.e_n == without.e_n == pytest.approx(with_friction.tau_z / (0.8 * with_friction.S), rel=1e-14)
    assert with_friction.e_n_projected == pytest.approx(with_friction.tau_z / (0.8 * with_friction.F_N), rel=1e-14)
    assert (without.f_x, without.f_y, without.tau_z) == (0, 0, 0)
    assert without.per_unit_force == (0, 0, 0)
    assert math.isnan(wrench.FrictionLimits(1.0, 1.0, 0.1, 1.0, -0.2, 0.1, 0.1).e_n_projected)


def test_the_largest_force_lies_along_the_ridge_of_a_wedge_and_in_every_direction_on_a_cap():
    """Eq. (11): along the ridge a wedge resists with mu S, whichever way it lies; in the planar models all ways."""
    upright = made.wedge(0.6, 0.03, 0.05, 8, 8)
    for angle in (0.0, 0.3, 0.5, math.pi / 4, 2.5):
        c, s = math.cos(angle), math.sin(angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        patch = ContactPatch(upright.centroid @ turn.T, upright.area, upright.normal @ turn.T, upright.pressure)
        limits, planar = friction_limits(patch, 0.7), friction_limits(patch, 0.7, "pcm_projected")
        assert limits.e_n_ratio == pytest.approx(limits.e_n, rel=1e-8)
        assert planar.e_n_ratio == pytest.approx(planar.tau_z / (0.7 * planar.F_N), rel=1e-12)
        assert friction_limits(patch, 0.0).e_n_ratio == pytest.approx(limits.e_n_ratio, rel=1e-12)
    # Eq. (11) on a spherical cap, where it differs from Eq. (12): max f_t = 4 R^2 int E(sin^2 t) sin t dt.
    limits = friction_limits(made.cap_polar(0.02, 1.0, 40, 160), 1.0)
    t = (np.arange(4000) + 0.5) / 4000
    force = 4 * 0.02**2 * np.mean(ellipe(np.sin(t) ** 2) * np.sin(t))
    torque = np.pi * 0.02**3 * (1.0 - np.sin(1.0) * np.cos(1.0))
    assert limits.e_n_ratio == pytest.approx(torque / force, rel=1e-3)
    assert limits.e_n_ratio > 1.1 * limits.e_n


@pytest.mark.parametrize(("call", "match"), [
    (lambda p: friction_wrench(p, [[1, 0, 0, 0]], 0.5), "twist has shape"),
    (lambda p: friction_wrench(p, [[np.inf, 0, 1]], 0.5), r"twist\[0\] is .*omega = 0"),
    (lambda p: friction_wrench(p, SLIDE_X, -0.5), "mu is -0.5"), (lambda p: friction_limits(p, np.nan), "mu is nan"),
    (lambda p: pure_torque(p, -0.5), "mu is -0.5"),
])  # fmt: skip
def test_bad_arguments_are_named(call, match):
    with pytest.raises(ValueError, match=match):
        call(made.lcg_patch(1, 10))


@pytest.mark.parametrize(("alpha", "left"), [(0.0, 1.0), (0.2, 1.0 - np.tan(0.2) / 0.5), (0.6, 0.0)])
def test_what_pressing_a_wedge_has_used_is_not_there_for_holding(alpha, left):
    """Friction alone keeps a wedge of half angle alpha from sliding out of two fingers: it uses F_N tan(alpha)."""
    patch = made.cylinder_grid(1e3, 1e-5, 0.02, 8, 4)  # as good as flat
    limits = friction_limits(patch, 0.5)
    held = limits.less([limits.F_N * np.tan(alpha), 0.0, 0.0])
    assert held.f_x == pytest.approx(left * limits.f_x, rel=1e-9, abs=1e-12)
    assert (held.f_y, held.tau_z, held.e_n) == pytest.approx((limits.f_y, limits.tau_z, limits.e_n), rel=1e-14)
    turned = limits.less([0.0, 0.0, -0.25 * limits.tau_z])
    assert (turned.tau_z, turned.e_n) == pytest.approx((0.75 * limits.tau_z, 0.75 * limits.e_n), rel=1e-14)


@st.composite
def patches(draw):
    """Up to eight faces anywhere, of any tilt, also overhanging ones; some carry nothing."""
    n = draw(st.integers(1, 8))
    r, normal = (draw(arrays(float, (n, 3), elements=COMPONENT)) for _ in range(2))
    normal[np.linalg.norm(normal, axis=1) < 1e-3] = [0, 0, 1]
    load = draw(arrays(float, n, elements=st.floats(0, 2, width=32)))
    load[0] += 1
    return ContactPatch(r, np.ones(n), normal, load)


@REPEATABLE
@given(patches(), arrays(float, (5, 3), elements=COMPONENT))
def test_projected_is_inside_curved_is_inside_flat(patch, twist):
    """Face by face: the shadow of a tilted friction disc is an ellipse with semi-axes 1 and n_z."""
    projected, curved, flat = (friction_support(patch, twist, 0.8, m) for m in ("pcm_projected", "ccm", "pcm"))
    slack = ROUNDING * np.maximum(flat, patch.load.sum())
    assert (projected <= curved + slack).all()
    assert (curved <= flat + slack).all()


@REPEATABLE
@given(patches(), arrays(float, (4, 6), elements=COMPONENT))
def test_friction_dissipates_and_no_other_motion_gets_more_out_of_it(patch, twist):
    """H(t) = w(t) . t >= w(s) . t for all s, in six dimensions as in three."""
    W, H = friction_wrench(patch, twist, 0.6), friction_support(patch, twist, 0.6)
    power = W @ twist.T
    slack = ROUNDING * patch.load.sum()
    np.testing.assert_allclose(np.diag(power), H, rtol=0, atol=slack)
    assert (H >= 0).all()
    assert (power <= H + slack).all()
    assert np.isfinite(W).all()


@pytest.mark.parametrize("model", wrench.MODELS)
@REPEATABLE
@given(patches(), arrays(float, (4, 3), elements=COMPONENT))
def test_the_limit_surface_is_a_sum_of_discs_in_the_planes_of_the_faces(model, patch, twist):
    parts = np.einsum("mc,nkc->mnk", twist, wrench.friction_discs(patch, 0.6, model).reshape(-1, 2, 3))
    size = patch.load.sum() * max(1.0, np.abs(patch.centroid).max()) * max(1.0, np.abs(twist).max())
    H = friction_support(patch, twist, 0.6, model)
    np.testing.assert_allclose(np.linalg.norm(parts, axis=2).sum(axis=1), H, rtol=0, atol=1e-13 * size)


@REPEATABLE
@given(patches())
def test_three_motions_give_the_largest_force_and_torque(patch):
    limits = friction_limits(patch, 0.6)
    W = np.abs(friction_wrench(patch, fibonacci_twists(100, 1.0), 0.6))[:, [0, 1, 5]]
    # a normal may be off an axis by rounding: what it lets through is judged by the load
    slack = 1e-14 * 0.6 * limits.S * np.array([1.0, 1.0, max(1.0, np.abs(patch.centroid).max())])
    assert (W <= np.array([limits.f_x, limits.f_y, limits.tau_z]) * (1 + ROUNDING) + slack).all()
    assert limits.e_n == pytest.approx(limits.tau_z / (0.6 * limits.S), rel=1e-13)


@pytest.mark.parametrize("seed", range(5))
def test_another_reference_point_turns_motions_and_wrenches_by_the_adjoint(seed):
    """About c: ``v' = v + omega x c``, ``tau' = tau - c x f``; forces and dissipated power stay."""
    rng = np.random.default_rng(seed)
    patch, c, twist = made.lcg_patch(seed, 50), rng.normal(size=3), rng.normal(size=(40, 6))
    there = made.moved(patch, np.eye(3), -c)
    twist_there = np.hstack([twist[:, :3] + np.cross(twist[:, 3:], c), twist[:, 3:]])
    W, W_there = friction_wrench(patch, twist, 0.7), friction_wrench(there, twist_there, 0.7)
    np.testing.assert_allclose(W_there[:, :3], W[:, :3], atol=1e-12)
    np.testing.assert_allclose(W_there[:, 3:], W[:, 3:] - np.cross(c, W[:, :3]), atol=1e-12)
    power, power_there = friction_support(patch, twist, 0.7), friction_support(there, twist_there, 0.7)
    np.testing.assert_allclose(power_there, power, rtol=1e-12)


@pytest.mark.parametrize(("patch", "rank"), [
    (made.rect_grid(2, 1, 8, 4), 3), (made.disc_polar(1, 4, 12), 3), (made.cylinder_grid(1, 1, 2, 8, 8), 6),
    (made.cap_polar(1, 1, 6, 12), 6), (made.wedge(0.6, 1, 2, 4, 8), 5),
], ids=["rectangle", "disc", "cylinder", "cap", "wedge"])  # fmt: skip
def test_how_many_motions_a_patch_feels(patch, rank):
    """Lifting and tilting rub nowhere on a plane patch; a wedge does not feel its own turn about the ridge; a smoothly
    curved patch feels all. The wrenches span as many dimensions.
    """
    P = np.eye(3) - patch.normal[:, :, None] * patch.normal[:, None, :]
    turn = np.stack([np.cross(e, patch.centroid) for e in np.eye(3)], axis=2)
    # rows of all faces' slip P (v + omega x r), a matrix that multiplies [v, omega]
    _, values, right = np.linalg.svd(np.concatenate([P, P @ turn], axis=2).reshape(-1, 6), full_matrices=True)
    assert (values > 1e-9 * values[0]).sum() == rank
    unfelt = right[rank:]
    np.testing.assert_allclose(friction_support(patch, unfelt, 1.0) if len(unfelt) else 0.0, 0, atol=1e-12)
    W = friction_wrench(patch, np.random.default_rng(0).normal(size=(60, 6)), 1.0)
    assert np.linalg.matrix_rank(W, tol=1e-9) == rank


def centred(patch):
    return made.moved(patch, np.eye(3), -(patch.load @ patch.centroid) / patch.load.sum())


def test_pure_torque_turns_about_the_support_that_carries_most():
    """Loads 1:1:8 at an equilateral triangle: the median is the heavy support, 2 sqrt(3) is left of the torque."""
    corners = [[1, 0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]]
    patch = made.points_patch(corners, [1.0, 1.0, 8.0])
    assert pure_torque(patch, 0.5) == pytest.approx(0.5 * 2 * math.sqrt(3), rel=1e-9)
    assert pure_torque(centred(patch), 0.5) == pytest.approx(0.5 * 2 * math.sqrt(3), rel=1e-9)
    # ``mu F_2 d`` about the heavier point and ``2 mu d F_1 F_2 / (F_1 + F_2)`` about the centre of pressure.
    for heavy in (0.5, 0.6, 0.9, 0.999):
        patch = centred(made.points_patch([[-0.02, 0], [0.03, 0]], [heavy, 1 - heavy]))
        about_cop = friction_limits(patch, 0.8).tau_z
        assert about_cop == pytest.approx(0.8 * 2 * 0.05 * heavy * (1 - heavy), rel=1e-12)
        assert about_cop / pure_torque(patch, 0.8) == pytest.approx(2 * heavy, rel=1e-8)
    for seed in range(20):
        patch = made.lcg_patch(seed, 12)
        flat = centred(replace(patch, pressure=patch.pressure**8, normal=np.tile([0.0, 0, 1], (12, 1))))
        ratio = friction_limits(flat, 1.0).tau_z / pure_torque(flat, 1.0)
        assert 1 <= ratio <= 2


@pytest.mark.parametrize("corner", [(0.2, 0.6), (0.5, 0.9), (-0.3, 0.8)])
def test_three_equal_supports_turn_about_the_point_of_fermat(corner):
    """Least sum of distances to the corners of a triangle, ``sqrt((a^2 + b^2 + c^2) / 2 + 2 sqrt(3) area)``."""
    r = np.array([[0, 0], [1, 0], corner])
    squares = sum(np.sum((r[i] - r[i - 1]) ** 2) for i in range(3))
    exact = math.sqrt(squares / 2 + 2 * math.sqrt(3) * corner[1] / 2)
    assert pure_torque(made.points_patch(r, [2.0, 2.0, 2.0]), 0.4) == pytest.approx(0.4 * 2 * exact, rel=1e-9)


@pytest.mark.parametrize("model", ["ccm", "pcm", "pcm_projected"])
def test_the_share_does_not_depend_on_units_or_on_friction(model):
    patch = made.lcg_patch(3, 40)
    one = pure_torque(patch, 1.0, model)
    for unit in (1e3, 1e-6, 1e150):
        other = replace(patch, centroid=unit * patch.centroid)
        assert pure_torque(other, 0.3, model) == pytest.approx(0.3 * unit * one, rel=2e-9)


@pytest.mark.parametrize("seed", range(1, 6))
def test_at_pure_torque_the_net_force_vanishes(seed):
    """Smooth case: minimise over the velocity with another method, where the gradient (f_x, f_y) must be zero."""
    patch = made.lcg_patch(seed, 30)

    def torque(v):
        twist = [[*v, 1.0]]
        return friction_support(patch, twist, 1.0)[0], friction_wrench(patch, twist, 1.0)[0, :2]

    found = minimize(torque, [0.0, 0.0], jac=True, method="BFGS", options={"gtol": 1e-12})
    assert pure_torque(patch, 1.0) == pytest.approx(found.fun, rel=2e-9)


def relative_errors(form, n):
    limits = friction_limits(form.patch(n), 1.0, form.model)
    return np.array([abs(getattr(limits, name) / getattr(form, name) - 1) for name in NAMES])


@pytest.mark.parametrize("name", FORMS)
def test_every_limit_converges_to_its_closed_form(name):
    """Order 2 for smooth pressures, 1.5 where they fall like a root at the edge, 1 + 1/k for powers."""
    form = FORMS[name]
    errors = [relative_errors(form, n) for n in (16, 32, 64)]
    assert (errors[-1] < 1.5e-3).all()
    for coarse, fine in pairwise(errors):
        inexact = fine > 1e-9  # what the midpoints integrate exactly is exact on every mesh
        np.testing.assert_allclose(np.log2(coarse[inexact] / fine[inexact]), form.order, atol=0.1)
    assert inexact[4] or name in ("line", "ring")


def test_the_closed_forms_are_those_of_the_books():
    """Values that need no program: Hertz and uniform discs, square, hemisphere (f = S pi / 4), line, ring."""
    assert FORMS["Hertz disc"].tau_z == pytest.approx(2 / 3 * np.pi * 3 * np.pi / 16)
    assert mean_distance(1, 1) == pytest.approx(0.3825978582)
    assert FORMS["hemisphere"].f_x == pytest.approx(np.pi**2 / 2) == pytest.approx(FORMS["hemisphere"].S * np.pi / 4)
    assert FORMS["hemisphere"].tau_z == pytest.approx(np.pi**2 / 2)
