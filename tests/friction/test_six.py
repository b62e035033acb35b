"""Friction in six dimensions: reference points, what a patch cannot feel, and what three dimensions leave out."""


import numpy as np
import pytest

from softjaw.friction.wrench import friction_support, friction_wrench
from tests.generators import cap_polar, cylinder_grid, disc_polar, lcg_patch, moved, rect_grid, wedge


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


def slip_matrix(patch):
    """Rows of all faces' slip ``P (v + omega x r)`` as a matrix that multiplies ``[v, omega]``, ``(3 n, 6)``."""
    P = np.eye(3) - patch.normal[:, :, None] * patch.normal[:, None, :]
    turn = np.stack([np.cross(e, patch.centroid) for e in np.eye(3)], axis=2)
    return np.concatenate([P, P @ turn], axis=2).reshape(-1, 6)


@pytest.mark.parametrize(("patch", "rank"), [
    (rect_grid(2, 1, 8, 4), 3), (disc_polar(1, 4, 12), 3), (cylinder_grid(1, 1, 2, 8, 8), 6),
    (cap_polar(1, 1, 6, 12), 6), (wedge(0.6, 1, 2, 4, 8), 5),
], ids=["rectangle", "disc", "cylinder", "cap", "wedge"])  # fmt: skip
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
