"""Grasp wrench space of two antipodal contacts: closed forms against hulls and searches that know nothing of them."""

import itertools
import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from softjaw.scoring.closed_form import epsilon_l1, epsilon_linf, volume_l1, volume_linf
from softjaw.scoring.contact import PolytopeBody, fibonacci_vertices
from softjaw.scoring.quality import ScoreFlag, score
from tests.scoring.grasps import A, B, unit


def wrenches(contact_wrench, side, d, rho):
    """6-D wrenches of ``(f_x, f_y, tau)`` with a unit normal force, at the contact ``side`` (-1, 1) of the x axis.

    The contact's x is the space's z on both sides, and its y completes a right-handed frame.
    """
    f_x, f_y, tau = np.asarray(contact_wrench).T
    N = np.array([-side, 0.0, 0.0])
    x = np.array([0.0, 0.0, 1.0])
    f = N + np.outer(f_x, x) + np.outer(f_y, np.cross(N, x))
    return np.hstack([f, (np.cross([side * d / 2, 0, 0], f) + np.outer(tau, N)) / rho])


def sizes_of(vertices):
    hull = PolytopeBody(vertices)
    return hull.volume, hull.shadow_area


@pytest.mark.parametrize("d", [0.4, 1.3])
@pytest.mark.parametrize(
    "vertices", [lambda axes: fibonacci_vertices(axes, 8), lambda axes: fibonacci_vertices(axes, 11)]
)
def test_the_volume_of_polytopes_is_that_of_their_hull_in_six_dimensions(vertices, d):
    rho = 0.7
    P, Q = vertices(A), vertices(B)
    K1, K2 = (np.vstack([np.zeros(6), wrenches(v, side, d, rho)]) for v, side in ((P, -1), (Q, 1)))
    linf = np.array([a + b for a, b in itertools.product(K1, K2)])
    (V1, A1), (V2, A2) = sizes_of(P), sizes_of(Q)
    sizes = V1 / rho, A1, V2 / rho, A2, d / rho
    assert volume_linf(*sizes) == pytest.approx(ConvexHull(linf).volume, rel=1e-9)
    assert volume_l1(*sizes) == pytest.approx(ConvexHull(np.vstack([K1, K2])).volume, rel=1e-9)


def test_equal_ellipsoids():
    """14/9 pi^2 d^2 f_x^2 f_y^2 tau / rho^3."""
    f_x, f_y, tau = A
    found = score(A, A, distance=1.3, object_length=0.7, contact_length=0.7)
    assert found.quality == pytest.approx(
        14 / 9 * math.pi**2 * (1.3 / 0.7) ** 2 * f_x**2 * f_y**2 * tau / 0.7, rel=1e-14
    )
    assert found.quality / found.quality_l1 == pytest.approx(17.5, rel=1e-14)


def support(u, contacts, arms, join):
    """Support of the grasp wrench space for ``(m, 6)`` wrenches; contacts on the x axis, their x is the space's z."""
    along = []
    for (f_x, f_y, tau), arm, sign in zip(contacts, arms, (1, -1), strict=True):
        # A force (f_y, f_z) at x = arm has the torque (0, -arm f_z, arm f_y).
        felt = [f_x * (u[:, 2] - arm * u[:, 4]), f_y * (u[:, 1] + arm * u[:, 5]), tau * u[:, 3]]
        along.append(np.maximum(0, sign * u[:, 0] + np.linalg.norm(felt, axis=0)))
    return join(along)


LINF, L1 = (epsilon_linf, lambda h: h[0] + h[1]), (epsilon_l1, lambda h: np.maximum(h[0], h[1]))


@pytest.mark.parametrize(("epsilon", "join"), [LINF, L1])
@pytest.mark.parametrize("seed", range(20))
def test_epsilon_is_the_least_support_of_the_grasp_wrench_space(epsilon, join, seed):
    """Random unequal contacts, centre of mass anywhere on their line: reached, and nowhere undercut.

    The wrenches the derivation names are felt by one contact only, or are the torque about the line. A random search,
    and one that closes in on the weakest wrench it found, end near epsilon or in another valley, never below.
    """
    rng = np.random.default_rng(seed)
    contacts = rng.uniform(0.05, 1.5, size=(2, 3)) * [1, 1, rng.choice([0.3, 2.0])]
    middle, D = rng.uniform(-0.6, 0.6), rng.uniform(0.2, 2.0)
    arms = middle - D / 2, middle + D / 2
    exact = epsilon(*contacts, *arms)
    named = [[0, 0, 0, 1, 0, 0], *([0, 0, a, 0, 1, 0] for a in arms), *([0, a, 0, 0, 0, -1] for a in arms)]
    angle = np.linspace(-np.pi / 2, np.pi / 2, 20001)[:, None]
    reached = min(
        support(np.cos(angle) * w + np.sin(angle) * np.eye(6)[0], contacts, arms, join).min()
        for w in unit(np.array(named, dtype=float))
    )
    assert exact * (1 - 1e-12) <= reached <= exact + 2e-4
    found = unit(rng.normal(size=(50000, 6)))
    for spread in 0.5 ** np.arange(1, 30):
        best = found[support(found, contacts, arms, join).argsort()[:20]]
        found = unit(np.vstack([best, np.repeat(best, 100, axis=0) + spread * rng.normal(size=(2000, 6))]))
    assert exact * (1 - 1e-12) <= support(found, contacts, arms, join).min() <= 1.25 * exact


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


def test_the_score_has_no_unit():
    metre = score((0.8, 0.7, 0.012), (0.8, 0.6, 0.01), 0.06, 0.2, 0.05)
    milli = score((0.8, 0.7, 12.0), (0.8, 0.6, 10.0), 60.0, 200.0, 50.0)
    np.testing.assert_allclose(
        [milli.quality, milli.quality_l1, milli.epsilon, milli.epsilon_l1],
        [metre.quality, metre.quality_l1, metre.epsilon, metre.epsilon_l1],
        rtol=1e-13,
    )


def test_linearised_surfaces_are_inscribed_and_flat_ones_have_no_volume():
    np.testing.assert_allclose(((fibonacci_vertices(A, 20) / A) ** 2).sum(axis=1), 1, rtol=1e-14)
    volumes = [sizes_of(fibonacci_vertices(A, m)) for m in (100, 400, 1600)]
    exact = np.array([4 / 3 * math.pi * np.prod(A), math.pi * A[0] * A[1]])
    missing = 1 - np.array(volumes) / exact
    np.testing.assert_allclose(np.log2(missing[:-1, 0] / missing[1:, 0]), 2, atol=0.1)
    assert sizes_of(fibonacci_vertices(A, 20) * [1, 1, 0])[0] == 0
    assert sizes_of(fibonacci_vertices(A, 20) * [1, 0, 1]) == (0, 0)
