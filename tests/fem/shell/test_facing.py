"""What points face on a deformed wall, against circles that stay circles and against finite differences."""

import numpy as np
import pytest

from softjaw.fem.objects.splines import spline_surface
from softjaw.fem.shell.facing import FAR, Wall, face

R, LENGTH, STEP = 0.03, 0.1, 1e-7


@pytest.fixture(scope="module")
def wall():
    theta, s = np.linspace(0, 2 * np.pi, 97), np.linspace(0, LENGTH, 31)
    T, S = np.meshgrid(theta, s, indexing="ij")
    surface = spline_surface(theta, s, np.stack([R * np.cos(T), R * np.sin(T), S], axis=-1))
    number = np.arange(40 * 21, dtype=np.int32).reshape(40, 21)
    lines = np.linspace(0, 2 * np.pi, 41), np.linspace(0, LENGTH, 21)
    return Wall(surface, *lines, np.vstack([number, number[:1]]), np.full(40 * 21, 2e-4))


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(3)
    r, theta, z = R + rng.uniform(-5e-4, 3e-3, 60), rng.uniform(0, 2 * np.pi, 60), rng.uniform(0.01, 0.09, 60)
    return np.column_stack([r * np.cos(theta), r * np.sin(theta), z])


def nodes(wall):
    T, S = np.meshgrid(wall.theta[:-1], wall.s, indexing="ij")
    X = wall.surface.at(T.ravel(), S.ravel())[:, 0]
    return X, X * [1 / R, 1 / R, 0]


def still(wall):
    return np.zeros((840, 3)), np.zeros((840, 3))


def test_a_cylinder_is_faced_along_its_radius_also_where_it_swells_or_moves_and_nothing_beyond_its_ends(wall, points):
    found = face(wall, points, wall.places(points), *still(wall))
    r = np.hypot(points[:, 0], points[:, 1])
    radial = np.column_stack([points[:, :2] / r[:, None], 0 * r])
    np.testing.assert_allclose(found.gap, r - R, atol=2e-9)
    np.testing.assert_allclose(found.normal, radial, atol=5e-6)
    # gradient and Hessian of the distance from a cylinder
    np.testing.assert_allclose(found.e, radial, atol=5e-6)
    around = np.column_stack([-radial[:, 1], radial[:, 0], 0 * r])
    np.testing.assert_allclose(found.H, around[:, :, None] * around[:, None, :] / r[:, None, None], atol=2e-2)
    _, normal = nodes(wall)
    grown = face(wall, points, wall.places(points), 1e-3 * normal, np.zeros_like(normal))
    # displacements are interpolated bilinearly: the arc between two nodes is flatter by 1 - cos(half the step)
    np.testing.assert_allclose(found.gap - grown.gap, 1e-3, atol=1e-3 * (1 - np.cos(np.pi / 40)) + 1e-8)
    move = np.array([2e-3, -1e-3, 3e-3])
    there = face(wall, points + move, wall.places(points), np.tile(move, (840, 1)), np.zeros((840, 3)))
    np.testing.assert_allclose(there.gap, found.gap, atol=1e-12)
    np.testing.assert_allclose(there.normal, found.normal, atol=1e-9)
    beyond = np.array([[R + 1e-3, 0, -0.004], [R + 1e-3, 0, LENGTH + 0.004], [0, R + 1e-3, 0.5 * LENGTH]])
    gap = face(wall, beyond, wall.places(beyond), *still(wall)).gap
    assert (gap[:2] == FAR).all()
    assert gap[2] == pytest.approx(1e-3, abs=1e-8)


def test_derivatives_agree_with_finite_differences(wall, points):
    rng = np.random.default_rng(5)
    X, normal = nodes(wall)
    indentation = -1.5e-3 * np.exp(-((X[:, 0] - R) ** 2 + (X[:, 2] - 0.05) ** 2) / 0.02**2)
    v, w = normal * indentation[:, None], 2e-4 * rng.normal(size=X.shape) * 0.1
    places = wall.places(points)
    at = face(wall, points, places, v, w)
    dx, dv, dw = rng.normal(size=points.shape), rng.normal(size=v.shape), 0.01 * rng.normal(size=w.shape)

    def difference(what, direction):
        def value(sign):
            h = sign * STEP
            step = {"x": (h * dx, 0, 0), "v": (0, h * dv, 0), "w": (0, 0, h * dw)}[direction]
            return face(wall, points + step[0], places.copy(), v + step[1], w + step[2])

        one, two = value(1), value(-1)
        same = (one.nodes == two.nodes).all(axis=1)
        assert same.sum() > 50
        return (what(one) - what(two))[same] / (2 * STEP), same

    share = lambda f: f.N[:, :, None] * f.normal[:, None, :]  # noqa: E731
    moved = {
        "x": dx,
        "v": -np.einsum("na,nai->ni", at.N, dv[at.nodes]),
        "w": -at.gap[:, None] * np.einsum("nij,na,naj->ni", at.G, at.N, dw[at.nodes]),
    }
    turned = np.einsum("nij,na,naj->ni", at.G, at.N, dw[at.nodes])
    for direction, change in moved.items():
        own = turned if direction == "w" else 0.0
        found, same = difference(lambda f: f.gap, direction)
        np.testing.assert_allclose(found, (at.e * change).sum(axis=1)[same], atol=1e-5)
        found, same = difference(share, direction)
        dn = np.einsum("nij,nj->ni", at.H, change) + own
        slide = np.einsum("nai,ni->na", at.S, change)
        expected = slide[:, :, None] * at.normal[:, None, :] + at.N[:, :, None] * dn[:, None, :]
        np.testing.assert_allclose(found, expected[same], atol=1e-4 * np.abs(expected).max())
