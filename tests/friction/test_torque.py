"""Largest torque without net force: closed forms, published shares of the torque about the origin, other minimisers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from softjaw.friction.wrench import friction_limits, friction_support, friction_wrench, pure_torque
from tests.generators import lcg_patch, moved, points_patch

TRIANGLE = [[1, 0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]]


def centred(patch):
    return moved(patch, np.eye(3), -(patch.load @ patch.centroid) / patch.load.sum())


def test_pure_torque_is_smaller_where_one_support_carries_most():
    """Loads 1:1:8 at an equilateral triangle: the median is the heavy support, 2 sqrt(3) is left of the torque."""
    patch = points_patch(TRIANGLE, [1.0, 1.0, 8.0])
    assert pure_torque(patch, 0.5) == pytest.approx(0.5 * 2 * math.sqrt(3), rel=1e-9)
    assert pure_torque(centred(patch), 0.5) == pytest.approx(0.5 * 2 * math.sqrt(3), rel=1e-9)


@pytest.mark.parametrize("corner", [(0.2, 0.6), (0.5, 0.9), (-0.3, 0.8)])
def test_three_equal_supports_turn_about_the_point_of_fermat(corner):
    """Least sum of distances to the corners of a triangle, ``sqrt((a^2 + b^2 + c^2) / 2 + 2 sqrt(3) area)``."""
    r = np.array([[0, 0], [1, 0], corner])
    squares = sum(np.sum((r[i] - r[i - 1]) ** 2) for i in range(3))
    exact = math.sqrt(squares / 2 + 2 * math.sqrt(3) * corner[1] / 2)
    assert pure_torque(points_patch(r, [2.0, 2.0, 2.0]), 0.4) == pytest.approx(0.4 * 2 * exact, rel=1e-9)


def test_of_two_points_the_pure_torque_turns_about_the_heavier_one():
    """``mu F_2 d`` about the heavier point and ``2 mu d F_1 F_2 / (F_1 + F_2)`` about the centre of pressure."""
    for heavy in (0.5, 0.6, 0.9, 0.999):
        patch = centred(points_patch([[-0.02, 0], [0.03, 0]], [heavy, 1 - heavy]))
        about_cop = friction_limits(patch, 0.8).tau_z
        assert about_cop == pytest.approx(0.8 * 2 * 0.05 * heavy * (1 - heavy), rel=1e-12)
        assert about_cop / pure_torque(patch, 0.8) == pytest.approx(2 * heavy, rel=1e-8)
    for seed in range(20):
        patch = lcg_patch(seed, 12)
        flat = centred(replace(patch, pressure=patch.pressure**8, normal=np.tile([0.0, 0, 1], (12, 1))))
        ratio = friction_limits(flat, 1.0).tau_z / pure_torque(flat, 1.0)
        assert 1 <= ratio <= 2


@pytest.mark.parametrize("model", ["ccm", "pcm", "pcm_projected"])
def test_the_share_does_not_depend_on_units_or_on_friction(model):
    patch = lcg_patch(3, 40)
    one = pure_torque(patch, 1.0, model)
    for unit in (1e3, 1e-6, 1e150):
        other = replace(patch, centroid=unit * patch.centroid)
        assert pure_torque(other, 0.3, model) == pytest.approx(0.3 * unit * one, rel=2e-9)


@pytest.mark.parametrize("seed", range(1, 6))
def test_at_pure_torque_the_net_force_vanishes(seed):
    """Smooth case: minimise over the velocity with another method, where the gradient (f_x, f_y) must be zero."""
    patch = lcg_patch(seed, 30)

    def torque(v):
        twist = [[*v, 1.0]]
        return friction_support(patch, twist, 1.0)[0], friction_wrench(patch, twist, 1.0)[0, :2]

    found = minimize(torque, [0.0, 0.0], jac=True, method="BFGS", options={"gtol": 1e-12})
    assert pure_torque(patch, 1.0) == pytest.approx(found.fun, rel=2e-9)


def test_a_negative_friction_coefficient_is_refused():
    with pytest.raises(ValueError, match=r"mu is -0\.5"):
        pure_torque(lcg_patch(1, 10), -0.5)
