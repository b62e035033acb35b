"""Four Gauss points per element: order 3 instead of 2, on plane and on curved elements."""

from itertools import pairwise

import numpy as np
import pytest

from softjaw.friction.frame import FrameFlag, contact_frame
from softjaw.friction.quadrature import gauss_patch
from softjaw.friction.wrench import friction_limits
from tests.friction.closed_forms import ALPHA, FORMS, mean_distance
from tests.generators import cyl_mesh, grid_mesh, mesh_patch

SIZES = (8, 16, 32)


def orders(errors):
    return [np.log2(np.divide(coarse, fine)) for coarse, fine in pairwise(errors)]


def test_a_rectangle_with_order_three():
    """The torque's error on 32 x 32 elements falls from 3.5e-4 to 1.4e-6."""
    exact = 2 * mean_distance(2, 1)
    meshes = [grid_mesh(n, n, 1, 0.5) for n in SIZES]
    one = [abs(friction_limits(mesh_patch(q), 1.0).tau_z / exact - 1) for q in meshes]
    four = [abs(friction_limits(gauss_patch(q, np.ones(len(q))), 1.0).tau_z / exact - 1) for q in meshes]
    np.testing.assert_allclose(orders(one), 2, atol=0.1)
    np.testing.assert_allclose(orders(four), 3, atol=0.05)
    assert one[-1] > 200 * four[-1]


def test_a_cylinder_with_order_three_given_the_normals_at_the_corners():
    form = FORMS["cylinder"]
    plane, bent = [], []
    for n in SIZES:
        corners = cyl_mesh(1, ALPHA, 2, n, n)
        normals = 3 * (corners - np.array([0, 0, -1])) * [0, 1, 1]
        for errors, corner_normal in ((plane, None), (bent, normals)):
            limits = friction_limits(gauss_patch(corners, np.ones(len(corners)), corner_normal), 1.0)
            errors.append([abs(getattr(limits, name) / getattr(form, name) - 1) for name in ("S", "tau_z")])
    np.testing.assert_allclose(orders(plane), 2, atol=0.1)
    assert np.min(orders(bent)) > 3
    assert np.max(bent[-1]) < 2e-6


def test_a_saddle_under_a_pressure_that_ends_at_its_outline():
    """Against 192 elements per side; bilinear elements with one point each miss 2e-3 where these miss 4e-6."""

    def pressure(r):
        return (1 - r[:, 0] ** 2) * (1 - r[:, 1] ** 2)

    def limits(n):
        q = grid_mesh(n, n, 1, 1, lambda x, y: -(x**2 - y**2) / 2)
        normal = np.stack([q[..., 0], -q[..., 1], np.ones(q.shape[:2])], axis=-1)
        found = friction_limits(gauss_patch(q, lambda r: np.maximum(0, pressure(r)), normal), 1.0)
        return np.array([found.S, found.f_y, found.tau_z])

    exact = limits(192)
    errors = [np.abs(limits(n) / exact - 1) for n in SIZES]
    assert np.min(orders(errors)) > 2.9
    assert np.max(errors[-1]) < 4e-6


def test_pressures_at_corners_are_bilinear_between_them():
    """p = (1 + x)(2 + y) over [-1, 1] x [-.5, .5]: S = 4, whatever the mesh."""
    q = grid_mesh(3, 2, 1, 0.5)
    p = (1 + q[..., 0]) * (2 + q[..., 1])
    at_corners, as_function = (gauss_patch(q, x) for x in (p, lambda r: (1 + r[:, 0]) * (2 + r[:, 1])))
    np.testing.assert_allclose(at_corners.pressure, as_function.pressure, rtol=1e-14)
    assert at_corners.load.sum() == pytest.approx(4, rel=1e-14)


def test_the_faces_are_quarters_of_their_elements():
    q = grid_mesh(3, 2, 1, 0.5)
    patch = gauss_patch(q, np.ones(len(q)))
    np.testing.assert_allclose(mesh_patch(patch.corners).area, patch.area, rtol=1e-14)
    np.testing.assert_allclose(mesh_patch(patch.corners).normal, patch.normal, atol=1e-15)
    reach = np.abs(patch.corners.mean(axis=1) - patch.centroid).max(axis=0)
    assert (reach < [1 / 12, 1 / 16, 1e-15]).all()
    assert contact_frame(patch, [1, 0, 0]).flag == FrameFlag.CLEAN


def test_a_triangle_repeats_its_last_corner():
    """Right triangle with sides 1 under p = x: S = 1/6, first moments 1/12 and 1/24."""
    patch = gauss_patch([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]]], lambda r: r[:, 0])
    np.testing.assert_allclose(patch.load.sum(), 1 / 6, rtol=1e-14)
    np.testing.assert_allclose(patch.load @ patch.centroid, [1 / 12, 1 / 24, 0], rtol=1e-14)


@pytest.mark.parametrize(
    ("corners", "pressure", "match"),
    [
        (np.zeros((2, 3, 3)), [1, 1], r"corners has shape \(2, 3, 3\).*repeat the last corner"),
        (grid_mesh(2, 1, 1, 1), [1, 1, 1], r"pressure has shape \(3,\), expected \(2,\) .*\(2, 4\)"),
    ],
)
def test_wrong_shapes_are_named(corners, pressure, match):
    with pytest.raises(ValueError, match=match):
        gauss_patch(corners, pressure)
