"""Friction that acts back on a thin wall: tangent, Coulomb's law, balance, and the limits without friction or give."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp

from softjaw.fem.contact.press import Press
from softjaw.fem.contact.problem import Control
from softjaw.fem.shell.thin_walled import WallMesh
from softjaw.fem.shell.wall_material import wall_material
from tests.fem.grips import e_n, gap_at, grip, pose, stirred, thin

MU = 0.4


@cache
def states(mu=MU, level="nonlinear", thickness=4e-4, allowed=(True, True), forces=(0.5, 2.0)):
    return tuple(grip(thin(thickness), level=level, allowed=allowed, mu=mu).load_path(forces))


@pytest.mark.parametrize(
    ("allowed", "level", "control"),
    [
        ((True, True), "nonlinear", Control(force=2.0)),
        ((True, False), "linear", Control(force=2.0)),
        ((False, False), "nonlinear", Control(closing=1.5e-3)),
    ],
)
def test_tangent_by_finite_differences(allowed, level, control):
    """From a state with a history: some points stick, some slip, some are open."""
    problem = grip(thin(), elements=(4, 2, 2), allowed=allowed, level=level, mu=0.2).problem
    rng = np.random.default_rng(1)
    x = stirred(problem, rng)
    problem.accept(x)
    for size in (3e-6, 1e-6):
        x = x + size * rng.normal(size=problem.size) * np.isin(np.arange(problem.size), problem.friction.damping.moved)
        if size == 3e-6:
            problem.accept(x)
    problem.control = control
    problem.tangent(x)
    pattern = problem.pattern
    K = sp.csr_matrix((pattern.values.copy(), pattern.column, pattern.start), shape=(problem.size,) * 2)
    for k, c in enumerate(problem.evaluate(x)):
        f = problem.fingers[k]
        size, most = np.linalg.norm(problem.traction(k, x, c)[0], axis=1), 0.2 * problem.point_pressure(f, c)
        slips = np.isclose(size, most, rtol=1e-9) & (size > 0)
        assert slips.any()
        assert ((size > 0) & ~slips).any()
    parts = [slice(0, problem.model.size), *(f.unknowns for f in problem.fingers)]
    for moved in parts:
        step = np.zeros(problem.size)
        step[moved] = rng.normal(size=step[moved].size)
        found = (problem.residual(x + 1e-10 * step) - problem.residual(x - 1e-10 * step)) / 2e-10
        for rows in parts:
            assert np.abs(found - K @ step)[rows].max() <= 1e-7 * np.abs(found).max() + 1e-3


def test_without_friction_nothing_changes():
    for one, other in zip(states(0.0), grip(thin()).load_path((0.5, 2.0)), strict=True):
        assert one.fingers[0].closing == pytest.approx(other.fingers[0].closing, rel=1e-8)
        assert e_n(one.fingers[0]) == pytest.approx(e_n(other.fingers[0]), rel=1e-6)


@pytest.mark.parametrize("level", ["nonlinear", "linear"])
def test_coulombs_law_and_balance_hold(level):
    """``|t| <= mu p`` across the normal, and what the pads press and rub with is what the wall bears."""
    for state in states(level=level):
        points = state.fingers[0].points
        size = np.linalg.norm(points.friction, axis=-1)
        assert (size <= MU * points.load * (1 + 1e-9)).all()
        assert np.abs(np.einsum("fqi,fqi->fq", points.friction, points.normal)).max() < 1e-9 * points.load.max()
        assert size.sum() > 0.05 * points.load.sum()
        rubbed = state.pose.rotation @ points.force
        np.testing.assert_allclose(rubbed, state.wall.load.sum(axis=0), atol=1e-9 * state.force)


@pytest.mark.long
def test_quarter_half_and_full_give_the_same():
    for allowed in ((True, False), (False, False)):
        for a, b in zip(states(), states(allowed=allowed), strict=True):
            for finger in b.fingers:
                assert finger.closing == pytest.approx(a.fingers[0].closing, rel=1e-7)
                assert e_n(finger) == pytest.approx(e_n(a.fingers[0]), rel=1e-6)


@pytest.mark.long
def test_a_wall_that_hardly_gives_way_is_a_rigid_object():
    problem = grip(thin(), mu=MU).problem
    gap = gap_at(pose(0.0, 0.075))
    press = Press(problem.fingers[0].pad, gap, mu=MU)
    rigid = list(press.load_path((0.5, 2.0)))
    stiff = thin(1e-3, replace(wall_material("pet"), young_modulus=3e10))
    for one, other, smooth in zip(
        grip(stiff, mu=MU).load_path((0.5, 2.0)), rigid, grip(stiff).load_path((0.5, 2.0)), strict=True
    ):
        assert one.fingers[0].closing == pytest.approx(other.closing, rel=5e-3)
        # friction changes e_n by much more than the wall still does
        assert abs(e_n(other) / e_n(smooth.fingers[0]) - 1.0) > 0.02
        assert e_n(one.fingers[0]) == pytest.approx(e_n(other), rel=5e-4)


@pytest.mark.long
def test_a_level_from_the_coarse_load_path_is_that_of_the_fine_one():
    coarse = tuple(grip(thin(), elements=(6, 4, 2), mu=MU).load_path((0.5, 2.0)))
    fine = {"elements": (12, 8, 4), "mesh": WallMesh(0.0015, 0.0025, 0.010)}
    path, smooth = (tuple(grip(thin(), mu=mu, **fine).load_path((0.5, 2.0))) for mu in (MU, None))
    held = grip(thin(), mu=MU, **fine)
    for k in (1, 0):
        changed = abs(e_n(path[k].fingers[0]) / e_n(smooth[k].fingers[0]) - 1.0)
        level = held.at(path[k].force, coarse[k::-1])
        assert level.fingers[0].checks.force_balance < 1e-8
        assert level.fingers[0].iterations < 0.5 * path[0].fingers[0].iterations
        assert e_n(level.fingers[0]) == pytest.approx(e_n(path[k].fingers[0]), rel=0.1 * changed)


def test_what_a_step_in_vain_went_through_is_forgotten():
    problem = grip(thin(), elements=(4, 2, 2), mu=MU).problem
    first, in_vain, second = (stirred(problem, np.random.default_rng(seed)) for seed in range(3))
    problem.accept(first)
    memory = problem.friction.memory
    problem.accept(in_vain)
    problem.friction.memory = memory
    problem.accept(second)
    problem.accept(second)
    (before,) = problem.history(second)
    np.testing.assert_array_equal(before, first)
