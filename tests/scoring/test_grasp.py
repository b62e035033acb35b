"""Scores of contacts anywhere: the right method for each grasp, and one answer from all of them."""

import math

import numpy as np
import pytest

from softjaw.scoring.closed_form import epsilon_l1, epsilon_linf
from softjaw.scoring.contact import PolytopeBody, SoftContact, fibonacci_vertices, joint_support
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.quality import ScoreFlag, grasp_score, score
from tests.scoring import grasps
from tests.scoring.test_decisions import LENGTHS, A, pair

B = (0.5, 0.9, 0.025)


def test_facing_contacts_score_as_in_closed_form_turned_ones_are_searched_and_tilted_ones_go_on_from_them():
    exact, values = score(A, B, 0.06, *LENGTHS), grasp_score(pair(A, B), *LENGTHS)
    assert values.method == "antipodal"
    names = ("quality", "quality_l1", "epsilon", "epsilon_l1")
    np.testing.assert_allclose([getattr(values, n) for n in names], [getattr(exact, n) for n in names], rtol=1e-12)
    beside = grasp_score(pair(A, B), *LENGTHS, centre_of_mass=(0.01, 0, 0))
    a, b = (np.divide(axes, [1, 1, LENGTHS[1]]) for axes in (A, B))
    closed = [epsilon(a, b, -0.04 / LENGTHS[0], 0.02 / LENGTHS[0]) for epsilon in (epsilon_linf, epsilon_l1)]
    np.testing.assert_allclose([beside.epsilon, beside.epsilon_l1], closed, rtol=1e-12)
    one, two = pair(A, B)
    x, y, N = two.axes
    turned, back = (SoftContact(two.position, np.array([x + s * y, y - s * x, 2**0.5 * N]) / 2**0.5, two.body)
                    for s in (1, -1))  # fmt: skip
    scores = []
    for contacts, com in (((one, turned), (0, 0, 0)), ((one, back), (0, 0, 0)), ((one, two), (0, 0.02, 0.01))):
        found = grasp_score(contacts, *LENGTHS, centre_of_mass=com)
        assert (found.quality, found.method) == (pytest.approx(exact.quality, rel=1e-12), "antipodal")
        assert 0 < found.epsilon < 1
        scores.append(found.epsilon)
    assert scores[0] == pytest.approx(scores[1], rel=1e-4)  # mirror images; to the tolerance of the search
    inside, outside = (grasp_score(pair(A, B, angle), *LENGTHS, with_epsilon=False) for angle in (0.9e-4, 1.1e-4))
    assert (inside.method, outside.method) == ("antipodal", "pose")
    for found in (inside, outside):
        assert found.quality == pytest.approx(exact.quality, rel=2e-7)
        assert found.quality_l1 == pytest.approx(exact.quality_l1, rel=2e-7)
        assert math.isnan(found.epsilon)
    far = grasp_score(pair(A, B, 0.3), *LENGTHS, with_epsilon=False)
    assert (far.quality, far.quality_l1, far.error) == pose_volume(*pair(A, B, 0.3), *LENGTHS)
    one, _ = pair(fibonacci_vertices(A, 50), B, 0.2)
    C = one.wrench_map(*LENGTHS, centre_of_mass=(0.1, 0.2, 0.3))
    wrenches = np.vstack([np.zeros(6), np.column_stack([np.ones(50), one.body.vertices]) @ C.T])
    u = np.random.default_rng(0).normal(size=(30, 6))
    np.testing.assert_allclose(joint_support(C[None], [one.body], u, "l1"), (u @ wrenches.T).max(axis=1), rtol=1e-12)


def test_equal_contacts_have_closed_forms_one_without_torque_scores_nothing_linear_surfaces_are_inscribed():
    """14/9 pi^2 d^2 f_x^2 f_y^2 tau / rho^3."""
    f_x, f_y, tau = grasps.A
    found = score(grasps.A, grasps.A, distance=1.3, object_length=0.7, contact_length=0.7)
    expected = 14 / 9 * math.pi**2 * (1.3 / 0.7) ** 2 * f_x**2 * f_y**2 * tau / 0.7
    assert found.quality == pytest.approx(expected, rel=1e-14)
    assert found.quality / found.quality_l1 == pytest.approx(17.5, rel=1e-14)
    # min(1, 2 t / sqrt(1 + t^2), 2 f L / sqrt(1 + L^2 + 4 f^2 L^2)) with the centre of mass in the middle.
    for f_x, f_y, t, L in [(0.8, 0.6, 0.1, 0.5), (0.3, 0.6, 0.9, 0.1), (0.9, 0.2, 0.9, 0.7), (5, 5, 5, 5)]:
        forms = [2 * t / math.hypot(1, t)] + [2 * f * L / math.sqrt(1 + L**2 + 4 * f**2 * L**2) for f in (f_x, f_y)]
        assert epsilon_linf((f_x, f_y, t), (f_x, f_y, t), -L, L) == pytest.approx(min(1, *forms), rel=1e-14)
    found = score((1, 1, 0), (1, 1, 0), 0.06, 0.06, 0.05)
    assert (found.quality, found.quality_l1, found.epsilon, found.epsilon_l1) == (0, 0, 0, 0)
    assert found.flag == ScoreFlag.NO_TORQUE
    assert score((1, 1, 0), (1, 1, 0.01), 0.06, 0.06, 0.05).flag == ScoreFlag.NO_TORQUE
    slippery = score((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.06, 0.06, 0.05)
    assert (slippery.quality, slippery.epsilon) == (0, 0)
    assert slippery.flag == ScoreFlag.NO_TORQUE | ScoreFlag.NO_FORCE
    np.testing.assert_allclose(((fibonacci_vertices(grasps.A, 20) / grasps.A) ** 2).sum(axis=1), 1, rtol=1e-14)
    volumes = np.array([PolytopeBody(fibonacci_vertices(grasps.A, m)).volume for m in (100, 400, 1600)])
    missing = 1 - volumes / (4 / 3 * math.pi * np.prod(grasps.A))
    np.testing.assert_allclose(np.log2(missing[:-1] / missing[1:]), 2, atol=0.1)
    flat, upright = (PolytopeBody(fibonacci_vertices(grasps.A, 20) * kept) for kept in ([1, 1, 0], [1, 0, 1]))
    assert (flat.volume, upright.volume, upright.shadow_area) == (0, 0, 0)
