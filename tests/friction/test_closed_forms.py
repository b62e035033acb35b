"""Maxima of patches with a closed form, and the order in which the meshes approach it (mu = 1, pressure 1)."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipe, ellipeinc

from friction.motion import SLIDE_X, SLIDE_Y
from friction.wrench import friction_limits, friction_wrench
from tests.generators import (
    PRESSURES,
    arc_lengths,
    cap_polar,
    cylinder_grid,
    disc_polar,
    ellcyl_grid,
    points_patch,
    rect_grid,
    wedge,
)

ALPHA = np.pi / 3


def mean_distance(a, b):
    """Mean distance of the points of a rectangle from its centre."""
    A, B = a / 2, b / 2
    D = math.hypot(A, B)
    return D / 3 + A**2 / (6 * B) * math.asinh(B / A) + B**2 / (6 * A) * math.asinh(A / B)


def strip(A, B, h):
    """Integral of ``sqrt(A^2 + B^2 x^2)`` over ``0 < x < h``."""
    return 0.5 * (h * math.hypot(A, B * h) + (A**2 / B * math.asinh(B * h / A) if A > 0 else 0))


def cylinder_torque(a, b, tm, L):
    def across(t):
        G = math.hypot(b * math.cos(t), a * math.sin(t))
        return G * 2 * strip(b * math.sin(abs(t)), b * math.cos(t) / G, L / 2)

    return 2 * quad(across, 0, tm, epsabs=1e-13, epsrel=1e-13)[0]


def pressed(patch, kind, **field):
    return replace(patch, pressure=PRESSURES[kind](patch.centroid, **field))


def cap_force():
    return 4 * quad(lambda t: ellipe(math.sin(t) ** 2) * math.sin(t), 0, ALPHA)[0]


# name: (patch of n faces per side, exact f_x, f_y, tau_z, order of convergence)
FORMS = {
    "rectangle": (lambda n: rect_grid(2, 1, n, n), 2, 2, 2 * mean_distance(2, 1), 2),
    "square": (lambda n: rect_grid(1, 1, n, n), 1, 1, 0.3825978582, 2),
    "uniform disc": (lambda n: disc_polar(1, n, 2 * n), np.pi, np.pi, np.pi * 2 / 3, 2),
    "parabolic disc": (
        lambda n: pressed(disc_polar(1, n, 2 * n), "parab", a=1), np.pi / 2, np.pi / 2, np.pi / 2 * 8 / 15, 2,
    ),
    "Hertz disc": (
        lambda n: pressed(disc_polar(1, n, 2 * n), "hertz", a=1),
        2 / 3 * np.pi, 2 / 3 * np.pi, 2 / 3 * np.pi * 3 * np.pi / 16, 1.5,
    ),
    "Hertz ellipse": (
        lambda n: pressed(disc_polar(2, n, 4 * n, 1), "hertz", a=2, b=1),
        4 / 3 * np.pi, 4 / 3 * np.pi, 4 / 3 * np.pi * 3 * np.pi / 16 * 4 / np.pi * ellipe(0.75), 1.5,
    ),
    "cap": (lambda n: cap_polar(1, ALPHA, n, 4 * n), cap_force(), cap_force(), np.pi * (ALPHA - math.sqrt(3) / 4), 2),
    "cylinder": (
        lambda n: cylinder_grid(1, ALPHA, 2, n, n),
        4 * ALPHA, 4 * math.sin(ALPHA), cylinder_torque(1, 1, ALPHA, 2), 2,
    ),
    "elliptic cylinder": (
        lambda n: ellcyl_grid(2, 1, 1.0, 2, n, n),
        4 * ellipeinc(1.0, 1 - 4.0), 4 * math.sin(1.0), cylinder_torque(2, 1, 1.0, 2), 2,
    ),
    "wedge": (
        lambda n: wedge(0.6, 1, 2, n, 2 * n), 4, 4 * math.cos(0.6), 4 * math.cos(0.6) * mean_distance(2, 2), 2,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FORMS)
def test_maxima_converge_to_the_closed_form(name):
    patch, f_x, f_y, tau_z, order = FORMS[name]
    exact = np.array([f_x, f_y, tau_z])
    errors = []
    for n in (16, 32, 64):
        limits = friction_limits(patch(n), 1.0)
        errors.append(np.abs(np.array([limits.f_x, limits.f_y, limits.tau_z]) / exact - 1))
    assert (errors[-1] < 2e-3).all()
    for coarse, fine in pairwise(errors):
        open_ = fine > 1e-9  # forces of uniform patches are exact on every mesh
        np.testing.assert_allclose(np.log2(coarse[open_] / fine[open_]), order, atol=0.08)
    assert open_[2]


def test_unrolled_arms_are_the_longest():
    """Cylinder with half angle 60 degrees and length 2: e_n = .6930 < .7453 < .7834 in the three models."""
    args = {"R": 1.0, "alpha": ALPHA, "L": 2.0, "nphi": 64, "nx": 64}
    patch = cylinder_grid(**args)
    e_n = [
        friction_limits(patch, 1.0, "curved").e_n,
        friction_limits(patch, 1.0, "flat").e_n,
        friction_limits(patch, 1.0, "unrolled", arc_lengths("cylinder_grid", args)).e_n,
    ]
    assert e_n[2] == pytest.approx(mean_distance(2, 2 * ALPHA), rel=3e-4)
    np.testing.assert_allclose(e_n, [0.6930, 0.7453, 0.7834], atol=2e-4)


def test_line_and_ring():
    line = rect_grid(2.0, 1e-9, 200, 1)
    assert friction_limits(line, 1.0).e_n == pytest.approx(2 / 4, rel=1e-12)
    phi = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = points_patch(3 * np.column_stack([np.cos(phi), np.sin(phi)]), np.ones(12))
    assert friction_limits(ring, 1.0).e_n == pytest.approx(3, rel=1e-14)


@pytest.mark.parametrize("half_angle", [0.1, 0.7, 1.4])
def test_curvature_costs_friction_across_the_arch_and_none_along_it(half_angle):
    """Across: mu p L 2 R sin(t).  Along: mu p L 2 R t.  Their ratio is sin(t) / t."""
    patch = cylinder_grid(0.03, half_angle, 0.01, 400, 1)
    along, across = np.abs(friction_wrench(patch, np.stack([SLIDE_X, SLIDE_Y]), 0.8))
    assert along[0] == pytest.approx(0.8 * patch.load.sum(), rel=1e-12)
    assert across[1] / along[0] == pytest.approx(np.sin(half_angle) / half_angle, rel=1e-5)


@pytest.mark.parametrize(
    ("ratio", "f_y", "tau_z"),
    [
        (2.5, 0.373, 0.196),
        (2.0, 0.201, 0.115),
        (1 / 0.7, 0.062, 0.038),
        (1.0, 0.0154, 0.0096),
        (1 / 1.5, 0.0030, 0.0019),
        (0.5, 0.0009, 0.0006),
        (0.4, 0.0004, 0.0002),
    ],
)
def test_what_a_planar_model_claims_too_much_on_elliptic_cylinders(ratio, f_y, tau_z):
    """Figure 4c in shape, as shares of the planar value: semi-axis 1 along the normal, half width .3, length 1.

    Figures of an independent implementation. On the circle f_y is ``1 - .3 / asin(.3)``.
    """
    b = 1 / ratio
    patch = ellcyl_grid(1.0, b, math.asin(0.3 / b), 1.0, 80, 80)
    curved, flat = friction_limits(patch, 1.0), friction_limits(patch, 1.0, "flat")
    assert flat.f_x == pytest.approx(curved.f_x, rel=1e-12)
    digit = 1e-3 if f_y > 0.05 else 1e-4
    assert 1 - curved.f_y / flat.f_y == pytest.approx(f_y, abs=0.51 * digit)
    assert 1 - curved.tau_z / flat.tau_z == pytest.approx(tau_z, abs=0.51 * digit)
