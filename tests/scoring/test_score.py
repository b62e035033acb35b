"""Grasp wrench space of two antipodal contacts: closed forms against hulls and searches that know nothing of them."""

import math

import numpy as np
import pytest

from softjaw.scoring.closed_form import epsilon_linf
from softjaw.scoring.contact import PolytopeBody, fibonacci_vertices
from softjaw.scoring.quality import ScoreFlag, score
from tests.scoring.grasps import A


def sizes_of(vertices):
    hull = PolytopeBody(vertices)
    return hull.volume, hull.shadow_area


def test_equal_ellipsoids():
    """14/9 pi^2 d^2 f_x^2 f_y^2 tau / rho^3."""
    f_x, f_y, tau = A
    found = score(A, A, distance=1.3, object_length=0.7, contact_length=0.7)
    assert found.quality == pytest.approx(
        14 / 9 * math.pi**2 * (1.3 / 0.7) ** 2 * f_x**2 * f_y**2 * tau / 0.7, rel=1e-14
    )
    assert found.quality / found.quality_l1 == pytest.approx(17.5, rel=1e-14)


def test_epsilon_of_equal_contacts():
    """min(1, 2 t / sqrt(1 + t^2), 2 f L / sqrt(1 + L^2 + 4 f^2 L^2)) with the centre of mass in the middle."""
    for f_x, f_y, t, L in [(0.8, 0.6, 0.1, 0.5), (0.3, 0.6, 0.9, 0.1), (0.9, 0.2, 0.9, 0.7), (5, 5, 5, 5)]:
        forms = [2 * t / math.hypot(1, t)] + [2 * f * L / math.sqrt(1 + L**2 + 4 * f**2 * L**2) for f in (f_x, f_y)]
        assert epsilon_linf((f_x, f_y, t), (f_x, f_y, t), -L, L) == pytest.approx(min(1, *forms), rel=1e-14)


def test_a_contact_without_torque_scores_nothing_and_says_so():
    found = score((1, 1, 0), (1, 1, 0), 0.06, 0.06, 0.05)
    assert (found.quality, found.quality_l1, found.epsilon, found.epsilon_l1) == (0, 0, 0, 0)
    assert found.flag == ScoreFlag.NO_TORQUE
    assert score((1, 1, 0), (1, 1, 0.01), 0.06, 0.06, 0.05).flag == ScoreFlag.NO_TORQUE
    slippery = score((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.06, 0.06, 0.05)
    assert (slippery.quality, slippery.epsilon) == (0, 0)
    assert slippery.flag == ScoreFlag.NO_TORQUE | ScoreFlag.NO_FORCE


def test_linearised_surfaces_are_inscribed_and_flat_ones_have_no_volume():
    np.testing.assert_allclose(((fibonacci_vertices(A, 20) / A) ** 2).sum(axis=1), 1, rtol=1e-14)
    volumes = [sizes_of(fibonacci_vertices(A, m)) for m in (100, 400, 1600)]
    exact = np.array([4 / 3 * math.pi * np.prod(A), math.pi * A[0] * A[1]])
    missing = 1 - np.array(volumes) / exact
    np.testing.assert_allclose(np.log2(missing[:-1, 0] / missing[1:, 0]), 2, atol=0.1)
    assert sizes_of(fibonacci_vertices(A, 20) * [1, 1, 0])[0] == 0
    assert sizes_of(fibonacci_vertices(A, 20) * [1, 0, 1]) == (0, 0)
