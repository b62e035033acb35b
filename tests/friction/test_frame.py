"""Contact frames: iteration for origin and normal, its exceptions, and what is flagged."""

from dataclasses import replace

import numpy as np
import pytest

from softjaw.friction.frame import FrameFlag, contact_frame, contact_length, in_frame
from tests.friction.test_decisions import strip
from tests.generators import cyl_mesh, cylinder_grid, disc_polar, grid_mesh, lcg, mesh_patch, rect_grid

X = [1.0, 0.0, 0.0]


def test_the_patch_in_its_frame_has_its_pressure_on_the_normal_and_a_cycle_ends_with_the_mean_normal():
    patch = mesh_patch(cyl_mesh(1, 1.0, 2, 16, 16), lambda r: 1 + 0.8 * r[:, 1])
    local = in_frame(patch, contact_frame(patch, X))
    cop = local.load @ local.centroid / local.load.sum()
    np.testing.assert_allclose(cop[:2], 0, atol=1e-14)
    np.testing.assert_allclose(local.corners.mean(axis=1), local.centroid, atol=1e-14)
    frame = contact_frame(cylinder_grid(1, 1, 2, 17, 17), X)
    assert frame.flag == FrameFlag.NO_CORNERS
    np.testing.assert_allclose(frame.origin, 0, atol=1e-15)
    np.testing.assert_allclose(frame.axes, np.eye(3), atol=1e-15)
    # A roof between two raised shelves, pressed above its ridge: each side's normal leads to the other side.
    roof = [strip(-1, -0.5, 0, 0), strip(0, 0, 1, -0.5)]
    shelves = [strip(-3, 1, -2, 1), strip(2, 1, 3, 1)]
    patch = replace(mesh_patch(roof + shelves), pressure=np.array([1.0, 1.01, 1.0, 1.0]))
    frame = contact_frame(patch, X)
    assert frame.flag == FrameFlag.CYCLE
    np.testing.assert_allclose(frame.axes[2], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(frame.origin[:2], frame.centre_of_pressure[:2], atol=1e-15)
    assert frame.origin[2] == pytest.approx(-0.5 * frame.origin[0], rel=1e-12)


def test_random_bumps_always_give_a_frame():
    """300 meshes: nearly all settle at once, a few per cent alternate between faces, and none ends without a frame.

    An independent implementation had 232 of its 300 meshes settled after two passes, and 13 that alternated.
    """
    passes, cycles = [], 0
    for seed in range(300):
        draw = lcg(seed)
        height = np.array([[0.3 * next(draw) for _ in range(7)] for _ in range(7)])
        pressure = np.array([next(draw) for _ in range(36)])
        corners = grid_mesh(6, 6, 1, 1)
        i, j = np.moveaxis(np.rint((corners[..., :2] + 1) * 3).astype(int), -1, 0)
        corners[..., 2] = height[i, j]
        frame = contact_frame(mesh_patch(corners, lambda r, pressure=pressure: pressure), X)
        arm = frame.axes @ (frame.centre_of_pressure - frame.origin)
        np.testing.assert_allclose(frame.axes @ frame.axes.T, np.eye(3), atol=1e-14)
        assert np.abs(arm[:2]).max() < 1e-12
        assert not frame.flag & ~FrameFlag.CYCLE
        passes.append(frame.iterations)
        cycles += bool(frame.flag & FrameFlag.CYCLE)
    assert max(passes) <= 5
    assert np.mean(np.array(passes) <= 2) > 0.75
    assert 5 <= cycles <= 20


def test_flipped_normals_are_found_without_corners_too_and_the_contact_length_is_the_longer_side():
    patch = mesh_patch(cyl_mesh(1, 0.6, 2, 12, 12))
    sign = np.where(np.arange(len(patch.load)) % 5 == 0, -1, 1)[:, None]
    flipped = replace(patch, normal=sign * patch.normal)
    assert contact_frame(replace(flipped, corners=None), X).flag & FrameFlag.ORIENTATION
    rewound = mesh_patch(np.where(sign[:, None] > 0, patch.corners, patch.corners[:, ::-1]))
    assert contact_frame(rewound, X).flag & FrameFlag.ORIENTATION
    assert contact_length(mesh_patch(grid_mesh(4, 4, 1.0, 0.6))) == pytest.approx(2.0)
    assert contact_length(rect_grid(0.6, 2.0, 3, 10)) == pytest.approx(2.0)
    assert contact_length(disc_polar(1, 60, 120)) == pytest.approx(2.0, rel=0.02)
