"""Bodies of stacked sections as rigid objects: equal to bodies of revolution and elliptic cylinders where they are."""

import numpy as np
import pytest

from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.outer_surface import Section, of_sections
from softjaw.fem.objects.shapes import EllipticCylinder, Revolution
from softjaw.fem.objects.splines import spline_surface
from softjaw.fem.objects.stacked import Stacked, wall_surface

PROFILE = [
    (0.0, 0.03), (0.005, 0.033), (0.03, 0.034), (0.06, 0.034), (0.09, 0.034), (0.12, 0.03), (0.15, 0.014),
    (0.18, 0.013),
]  # fmt: skip
HERE = Pose(np.eye(3), np.zeros(3))


def off_the_wall(body, n=400, far=0.003, heights=(0.012, 0.17)):
    rng = np.random.default_rng(2)
    theta, z = rng.uniform(0, 2 * np.pi, n), rng.uniform(*heights, n)
    x = np.column_stack([0.03 * np.cos(theta), 0.03 * np.sin(theta), z])
    for _ in range(3):
        g, normal, _ = body.gap(x)
        x = x - g[:, None] * normal
    return x + normal * rng.uniform(-far, far, n)[:, None]


def same(found, expected):
    for one, other, atol in zip(found, expected, (1e-9, 5e-6, 0.05), strict=True):
        np.testing.assert_allclose(one, other, atol=atol)


def test_circles_make_the_body_of_revolution_ellipses_the_cylinder_and_splines_converge_with_the_fourth_order():
    rigid, stacked = Revolution(np.array(PROFILE)), Stacked(of_sections([Section(z, r) for z, r in PROFILE]))
    x = off_the_wall(rigid)
    for body in (stacked, stacked.near(HERE, np.zeros(3), np.zeros(3))):
        same(body.gap(x), rigid.gap(x))
    np.testing.assert_allclose(stacked.bounds, rigid.bounds, atol=1e-5)
    assert stacked.outer.round
    a, b = 0.03, 0.024
    oval = Stacked(of_sections([Section(z, a, b) for z in (0.0, 0.05, 0.1, 0.15)]))
    rng = np.random.default_rng(4)
    theta = rng.uniform(0, 2 * np.pi, 300)
    x = np.column_stack([(a + 0.002) * np.cos(theta), (b + 0.002) * np.sin(theta), rng.uniform(0.02, 0.13, 300)])
    same(oval.gap(x), EllipticCylinder(a, b, 1.0).gap(x))
    assert (oval.outer.round, oval.outer.symmetric) == (False, (True, True))
    low, high = stacked.bounds[:, 2]
    points = np.array([[0.2, 0, 0.06], [0, 0, low - 0.01], [0, 0, high + 0.02], [0, 0, 0.06]])
    g, normal, _ = stacked.gap(points)
    np.testing.assert_allclose(g[:3], [0.2 - 0.034, 0.01, 0.02], atol=1e-4)
    assert g[3] == pytest.approx(-0.034, abs=1e-4)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)

    def worst(m):
        theta, s = np.linspace(0, 2 * np.pi, m + 1), np.linspace(0, 0.15, m + 1)

        def point(t, z):
            return np.stack([(0.035 + 0.002 * np.sin(60 * z)) * np.cos(t), 0.03 * np.sin(t), z + 0 * t], axis=-1)

        surface = spline_surface(theta, s, point(*np.meshgrid(theta, s, indexing="ij")))
        rng = np.random.default_rng(0)
        t, z = rng.uniform(-7, 9, 200), rng.uniform(0.02, 0.13, 200)
        return np.abs(surface.at(t, z)[:, 0] - point(t, z)).max()

    assert min(worst(24) / worst(48), worst(48) / worst(96)) > 12
    # Ends of the wall that fall on breaks of its outline but for rounding.
    outer, breaks = stacked.outer, stacked.outer.curve.breaks
    low, *_, high = breaks[(breaks > outer.wall[0]) & (breaks < outer.wall[1])]
    surface = wall_surface(outer, np.nextafter(low, 0.0), np.nextafter(high, 1.0))
    assert np.diff(surface.s).min() > 1e-9
