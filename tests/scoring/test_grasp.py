"""Scores of contacts anywhere: the right method for each grasp, and one answer from all of them."""

import math

import numpy as np
import pytest

from softjaw.scoring.closed_form import epsilon_l1, epsilon_linf
from softjaw.scoring.contact import SoftContact, fibonacci_vertices, joint_support
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.quality import grasp_score, score
from tests.scoring import grasps

A, B = (0.8, 0.6, 0.015), (0.5, 0.9, 0.025)
LENGTHS = 0.2, 0.05


def facing(angle=0.0, bodies=(A, B), d=0.06):
    return grasps.facing(*bodies, d, angle)


def test_facing_contacts_score_as_in_closed_form():
    exact, values = score(A, B, 0.06, *LENGTHS), grasp_score(facing(), *LENGTHS)
    assert values.method == "antipodal"
    names = ("quality", "quality_l1", "epsilon", "epsilon_l1")
    np.testing.assert_allclose([getattr(values, n) for n in names], [getattr(exact, n) for n in names], rtol=1e-12)
    beside = grasp_score(facing(), *LENGTHS, centre_of_mass=(0.01, 0, 0))
    a, b = (np.divide(axes, [1, 1, LENGTHS[1]]) for axes in (A, B))
    closed = [epsilon(a, b, -0.04 / LENGTHS[0], 0.02 / LENGTHS[0]) for epsilon in (epsilon_linf, epsilon_l1)]
    np.testing.assert_allclose([beside.epsilon, beside.epsilon_l1], closed, rtol=1e-12)


def test_epsilon_off_the_line_and_of_turned_contacts_is_searched():
    one, two = facing()
    x, y, N = two.axes
    turned, back = (SoftContact(two.position, np.array([x + s * y, y - s * x, 2**0.5 * N]) / 2**0.5, two.body)
                    for s in (1, -1))  # fmt: skip
    exact, scores = grasp_score([one, two], *LENGTHS), []
    for contacts, com in (((one, turned), (0, 0, 0)), ((one, back), (0, 0, 0)), ((one, two), (0, 0.02, 0.01))):
        found = grasp_score(contacts, *LENGTHS, centre_of_mass=com)
        assert (found.quality, found.method) == (pytest.approx(exact.quality, rel=1e-12), "antipodal")
        assert 0 < found.epsilon < 1
        scores.append(found.epsilon)
    assert scores[0] == pytest.approx(scores[1], rel=1e-4)  # mirror images; to the tolerance of the search


def test_tilted_contacts_go_on_from_facing_ones():
    exact = grasp_score(facing(), *LENGTHS)
    inside, outside = (grasp_score(facing(angle), *LENGTHS, with_epsilon=False) for angle in (0.9e-4, 1.1e-4))
    assert (inside.method, outside.method) == ("antipodal", "pose")
    for found in (inside, outside):
        assert found.quality == pytest.approx(exact.quality, rel=2e-7)
        assert found.quality_l1 == pytest.approx(exact.quality_l1, rel=2e-7)
        assert math.isnan(found.epsilon)
    far = grasp_score(facing(0.3), *LENGTHS, with_epsilon=False)
    assert (far.quality, far.quality_l1, far.error) == pose_volume(*facing(0.3), *LENGTHS)


def test_the_support_of_a_contact_is_that_of_its_wrenches():
    one, _ = facing(0.2, bodies=(fibonacci_vertices(A, 50), B))
    C = one.wrench_map(*LENGTHS, centre_of_mass=(0.1, 0.2, 0.3))
    wrenches = np.vstack([np.zeros(6), np.column_stack([np.ones(50), one.body.vertices]) @ C.T])
    u = np.random.default_rng(0).normal(size=(30, 6))
    np.testing.assert_allclose(joint_support(C[None], [one.body], u, "l1"), (u @ wrenches.T).max(axis=1), rtol=1e-12)
