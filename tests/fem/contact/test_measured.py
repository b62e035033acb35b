"""The pad from its measured face: the solid it is taken for, and the smoothing."""

from functools import partial

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from softjaw.fem.contact.measured import lifted_gap, press_measured
from softjaw.fem.objects.gap import NoContactError
from softjaw.fem.objects.measured_face import measured_face
from tests.fem import reference
from tests.fem.reference import slopes

NOISE = 1e-4
pad_of = partial(reference.pad_of, symmetry=(False, False), contact="blended")


def waves(n=4000, seed=0, x_too=True):
    height = lambda x, y: -1e-3 + 12.0 * y**2 + (8.0 * x**2 - 60.0 * x * y**2 if x_too else 0.0)  # noqa: E731
    x, y = (np.random.default_rng(seed).random((n, 2)) - 0.5).T * np.array([[0.05], [0.022]])
    return np.column_stack([x, y, height(x, y)]), height


def test_gap_is_the_distance_to_the_face_with_its_derivatives():
    points, height = waves()
    face = measured_face(points, 2.2e-3)
    X = np.random.default_rng(1).uniform([-0.028, -0.012, -4e-3], [0.028, 0.012, 1e-3], (60, 3))
    g, normal, hessian = face.gap(X)
    assert np.linalg.norm(normal, axis=1) == pytest.approx(np.ones(60), rel=1e-12)
    assert (normal[:, 2] < 0).all()
    foot = X - g[:, None] * normal
    assert face.height(*foot.T[:2])[0] == pytest.approx(foot[:, 2], abs=1e-10)
    inside = (np.abs(X[:, 0]) < 0.024) & (np.abs(X[:, 1]) < 0.010)
    assert height(*foot[inside].T[:2]) == pytest.approx(foot[inside, 2], abs=2e-8)
    assert slopes(lambda x: face.gap(x)[0], X, 1e-6) == pytest.approx(normal, abs=1e-8)
    # where the face is continued straight its second derivatives end
    far = np.abs(np.abs(foot[:, :2]) - np.abs(points[:, :2]).max(axis=0)).min(axis=1) > 1e-5
    assert slopes(lambda x: face.gap(x)[1], X, 1e-6)[far] == pytest.approx(hessian[far], abs=1e-3)


@pytest.mark.parametrize("contour", [True, False])
def test_smoothing_finds_the_noise_and_a_face_far_closer_than_it(contour):
    points, height = waves(600, x_too=not contour)
    points[:, 2] += NOISE * np.random.default_rng(2).normal(size=600)
    face = measured_face(points[:, 1:] if contour else points, 2.2e-3)
    x, y = (np.random.default_rng(3).random((500, 2)) - 0.5).T * np.array([[0.04], [0.018]])
    off = face.height(x, y)[0] - height(x, y)
    assert face.noise == pytest.approx(NOISE, rel=0.1)
    assert np.sqrt(np.mean(off**2)) < 0.3 * NOISE
    assert np.abs(off).max() < 3.0 * face.doubt


@pytest.mark.parametrize("points", [
    np.zeros((4, 2)), np.zeros((20, 3)), np.stack([np.linspace(-1, 1, 5), np.zeros(5)], -1),
])  # fmt: skip
def test_points_that_are_no_face_are_refused(points):
    with pytest.raises(ValueError, match=r"points|expected"):
        measured_face(points, 2e-3)


def test_a_face_that_is_pressed_in_nowhere_is_not_judged_and_a_lifted_one_has_its_derivatives():
    y = np.linspace(-0.011, 0.011, 41)
    with pytest.raises(NoContactError):
        press_measured(measured_face(np.column_stack([y, 1e-4 + y**2]), 2e-3), pad_of((4, 4, 2)))
    y = np.random.default_rng(5).uniform(-0.011, 0.011, 60)
    z = -2e-5 + 0.05 * y**2 + NOISE * np.random.default_rng(6).normal(size=60)
    face = measured_face(np.column_stack([y, z]), 2e-3)
    assert not press_measured(face, pad_of((4, 4, 2)))[1]
    x, y = np.linspace(-0.04, 0.04, 21), np.linspace(-0.02, 0.02, 21)
    lift = RectBivariateSpline(x, y, 1e-4 * np.sin(100.0 * x)[:, None] * np.cos(150.0 * y))
    gap = partial(lifted_gap, measured_face(waves()[0], 2.2e-3), lift)
    X = np.random.default_rng(1).uniform([-0.02, -0.009, -3e-3], [0.02, 0.009, 0.0], (30, 3))
    _, gradient, hessian = gap(X)
    assert slopes(lambda x: gap(x)[0], X, 1e-6) == pytest.approx(gradient, abs=1e-8)
    assert slopes(lambda x: gap(x)[1], X, 1e-6) == pytest.approx(hessian, abs=1e-3)
