"""Friction in six dimensions: reference points, what a patch cannot feel, and what three dimensions leave out."""

import math

import numpy as np
import pytest

from softjaw.friction.motion import SLIDE_Y
from softjaw.friction.wrench import friction_support, friction_wrench
from tests.generators import cap_polar, cylinder_grid, disc_polar, lcg_patch, moved, rect_grid, screw_twist, wedge

CYLINDER = cylinder_grid(1.0, math.pi / 3, 2.0, 48, 48)


@pytest.mark.parametrize("seed", range(5))
def test_another_reference_point_turns_motions_and_wrenches_by_the_adjoint(seed):
    """About c: ``v' = v + omega x c``, ``tau' = tau - c x f``; forces and dissipated power stay."""
    rng = np.random.default_rng(seed)
    patch, c, twist = lcg_patch(seed, 50), rng.normal(size=3), rng.normal(size=(40, 6))
    there = moved(patch, np.eye(3), -c)
    twist_there = np.hstack([twist[:, :3] + np.cross(twist[:, 3:], c), twist[:, 3:]])
    W, W_there = friction_wrench(patch, twist, 0.7), friction_wrench(there, twist_there, 0.7)
    np.testing.assert_allclose(W_there[:, :3], W[:, :3], atol=1e-12)
    np.testing.assert_allclose(W_there[:, 3:], W[:, 3:] - np.cross(c, W[:, :3]), atol=1e-12)
    np.testing.assert_allclose(
        friction_support(there, twist_there, 0.7), friction_support(patch, twist, 0.7), rtol=1e-12
    )


@pytest.mark.parametrize("seed", range(5))
def test_a_turned_frame_turns_force_and_torque(seed):
    rng = np.random.default_rng(seed)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R[:, 2] *= np.sign(np.linalg.det(R))
    patch, twist = lcg_patch(seed, 50), rng.normal(size=(40, 6))
    both = np.kron(np.eye(2), R)
    there = friction_wrench(moved(patch, R, [0, 0, 0]), twist @ both.T, 0.7)
    np.testing.assert_allclose(there, friction_wrench(patch, twist, 0.7) @ both.T, atol=1e-12)


def slip_matrix(patch):
    """Rows of all faces' slip ``P (v + omega x r)`` as a matrix that multiplies ``[v, omega]``, ``(3 n, 6)``."""
    P = np.eye(3) - patch.normal[:, :, None] * patch.normal[:, None, :]
    turn = np.stack([np.cross(e, patch.centroid) for e in np.eye(3)], axis=2)
    return np.concatenate([P, P @ turn], axis=2).reshape(-1, 6)


@pytest.mark.parametrize(
    ("patch", "rank"),
    [
        (rect_grid(2, 1, 8, 4), 3),
        (disc_polar(1, 4, 12), 3),
        (cylinder_grid(1, 1, 2, 8, 8), 6),
        (cap_polar(1, 1, 6, 12), 6),
        (wedge(0.6, 1, 2, 4, 8), 5),
    ],
    ids=["rectangle", "disc", "cylinder", "cap", "wedge"],
)
def test_how_many_motions_a_patch_feels(patch, rank):
    """Lifting and tilting rub nowhere on a plane patch; a wedge does not feel its own turn about the ridge; a smoothly
    curved patch feels all. The wrenches span as many dimensions.
    """
    _, values, right = np.linalg.svd(slip_matrix(patch), full_matrices=True)
    assert (values > 1e-9 * values[0]).sum() == rank
    unfelt = right[rank:]
    np.testing.assert_allclose(friction_support(patch, unfelt, 1.0) if len(unfelt) else 0.0, 0, atol=1e-12)
    W = friction_wrench(patch, np.random.default_rng(0).normal(size=(60, 6)), 1.0)
    assert np.linalg.matrix_rank(W, tol=1e-9) == rank


def test_a_sphere_turns_in_itself_about_any_axis_through_its_centre():
    """H of a turn about the centre of a uniform cap of radius 1 equals S times the mean distance from the axis."""
    patch = cap_polar(1, 1.0, 12, 48)
    turns = screw_twist(np.eye(3), [0, 0, -1], 0.0)
    arm = np.linalg.norm(np.cross(np.eye(3)[:, None], patch.centroid - np.array([0, 0, -1])), axis=2)
    np.testing.assert_allclose(friction_support(patch, turns, 1.0), arm @ patch.load, rtol=1e-13)


def test_what_three_dimensions_leave_out_of_a_cylinder():
    """Largest wrench components over mu S with half angle 60 degrees and R = 1, from an independent implementation."""
    most = friction_support(CYLINDER, np.eye(6), 1.0) / CYLINDER.load.sum()
    np.testing.assert_allclose(most, [1, 0.83, 0.48, 0.17, 0.31, 0.69], atol=5e-3)
    across = friction_wrench(CYLINDER, SLIDE_Y, 1.0)[0] / CYLINDER.load.sum()
    assert np.linalg.norm(across[3:]) == pytest.approx(0.173, abs=5e-4)
    roof = wedge(0.8, 1, 2, 8, 16)
    lift = friction_support(roof, np.eye(6)[2], 1.0)[0] / roof.load.sum()
    assert lift == pytest.approx(math.sin(0.8), rel=1e-12)
