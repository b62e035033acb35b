"""Largest torque without net force: closed forms, published shares of the torque about the origin, other minimisers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from softjaw.friction.motion import TURN_Z
from softjaw.friction.patch import ContactPatch, NoContactError
from softjaw.friction.torque import pure_torque
from softjaw.friction.wrench import friction_limits, friction_support, friction_wrench
from tests.generators import build, cylinder_grid, lcg_patch, moved, points_patch, rect_grid

TRIANGLE = [[1, 0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]]


def centred(patch):
    """Patch about its centre of pressure."""
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
    """``mu F_2 d`` about the heavier point and ``2 mu d F_1 F_2 / (F_1 + F_2)`` about the centre of pressure.

    Their ratio, twice the heavier point's share of the load, is at most 2; no plane patch has more about its centre of
    pressure, for the distances to it add up to at most twice those to the median.
    """
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


# A pad over a waist, which bears on its two ends: of each end load [N], place and length along the pad, width [mm], as
# rectangles with the second moments of the solved pressures; and tau_z_max / tau_pure of the solved patches. These are
# stations 64.7 mm at 1 and 2 N and 69.1 mm at 1 N of jobs/bottle-rigid.toml.
TWO_ENDS = [
    ((0.886, -6.267, 5.519, 10.746), (0.135, 41.279, 2.030, 6.465), 1.2786),
    ((1.616, -9.610, 9.078, 11.810), (0.425, 36.507, 5.651, 8.589), 1.2416),
    ((0.275, -35.097, 2.574, 8.213), (0.745, 12.959, 4.977, 10.005), 1.2837),
]


def two_ends(*ends):
    """Uniformly loaded rectangles ``(load, place, length, width)`` in a row along x."""
    parts = [rect_grid(length, width, 24, 24) for _, _, length, width in ends]
    places, loads = [place for _, place, *_ in ends], [load for load, *_ in ends]
    pressure = np.repeat([load / part.area.sum() for load, part in zip(loads, parts, strict=True)], 24**2)
    r = [np.add(part.centroid, [place, 0, 0]) for place, part in zip(places, parts, strict=True)]
    return replace(stacked(*parts), centroid=np.concatenate(r), pressure=pressure)


def stacked(*parts):
    names = ("centroid", "area", "normal", "pressure")
    return ContactPatch(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@pytest.mark.parametrize(("one", "two", "solved"), TWO_ENDS)
def test_a_pad_that_bears_on_two_ends_unequally_has_more_torque_about_its_centre_than_without_force(one, two, solved):
    """More than 10 % is right there: the centre of pressure lies between the ends, the median on the heavier one.

    The torque about the centre of pressure comes with a net force of up to the difference of the loads. Equal ends at
    the same places have none of this.
    """
    patch = centred(two_ends(one, two))
    about_cop = friction_limits(patch, 0.8).tau_z
    assert about_cop / pure_torque(patch, 0.8) == pytest.approx(solved, rel=2e-3)
    force = np.linalg.norm(friction_wrench(patch, TURN_Z, 0.8)[0, :2])
    assert 0.8 * abs(one[0] - two[0]) * 0.8 < force < 0.8 * abs(one[0] - two[0])
    alike = centred(two_ends((1.0, *one[1:]), (1.0, *two[1:])))
    assert friction_limits(alike, 0.8).tau_z / pure_torque(alike, 0.8) < 1.005


def rectangle(field):
    return build({"gen": "rect_grid", "args": {"a": 2, "b": 1, "nx": 80, "ny": 40}, "pressure": field})


def l_shape():
    patch = rect_grid(2, 2, 40, 40)
    return replace(patch, pressure=1.0 - (patch.centroid[:, :2] > 0).all(axis=1))


SHARES = {
    "off-centre Gaussian": (rectangle({"kind": "gauss", "x0": 0.5, "y0": 0.2, "sx": 0.4, "sy": 0.3}), 0.9979),
    "linear gradient": (rectangle({"kind": "lin", "gx": 0.9}), 0.9951),
    "L-shape": (l_shape(), 0.9988),
}


@pytest.mark.parametrize("name", SHARES)
def test_share_of_the_torque_about_the_centre_of_pressure(name):
    """Figures of an independent implementation."""
    patch, share = SHARES[name]
    about_cop = centred(patch)
    ratio = pure_torque(about_cop, 1.0) / friction_limits(about_cop, 1.0).tau_z
    assert ratio == pytest.approx(share, abs=0.5e-4)


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


@pytest.mark.parametrize("patch", [rect_grid(2, 1, 8, 4), cylinder_grid(1, 1, 2, 8, 8), points_patch([[0, 0]], [1])])
def test_pure_torque_of_a_symmetric_patch_is_its_torque(patch):
    assert pure_torque(patch, 1.0) == pytest.approx(friction_support(patch, TURN_Z, 1.0)[0], rel=1e-9, abs=1e-15)


def test_what_has_no_pure_torque_is_an_error():
    with pytest.raises(NoContactError):
        pure_torque(points_patch([[0.3, 0.1]], [1.0], [[0, 1, 0]]), 0.5)
    with pytest.raises(ValueError, match=r"mu is -0\.5"):
        pure_torque(lcg_patch(1, 10), -0.5)
