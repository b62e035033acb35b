"""Two fingers on a thin wall: exact tangent, symmetry, balance, rigid and linear limits, and a prototype's figures."""

from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp

from softjaw.fem.contact.load_stepping import Work
from softjaw.fem.contact.path import OnPath
from softjaw.fem.contact.press import Press
from softjaw.fem.contact.problem import Control
from softjaw.fem.shell.thin_walled import WallMesh
from softjaw.fem.shell.wall_material import WallMaterial
from tests.fem.grips import e_n, gap_at, grip, pose, stirred, thin

FORCES = (0.5, 2.0)
FINE = WallMesh(0.00085, 0.0025, 0.005)


@cache
def states(allowed=(True, True), level="nonlinear", thickness=4e-4, z=0.075, support="standing", theta=0.0):
    """Ladder over FORCES."""
    body = thin(thickness, support=support)
    return tuple(grip(body, z, allowed=allowed, level=level, theta=theta).load_path(FORCES))


@pytest.mark.parametrize(
    ("allowed", "level", "control"),
    [
        ((True, True), "nonlinear", Control(force=2.0)),
        ((True, True), "linear", Control(force=2.0)),
        ((False, False), "nonlinear", Control(force=2.0)),
        ((False, False), "nonlinear", Control(closing=1e-3)),
    ],
)
def test_the_tangent_is_the_derivative_of_the_residual(allowed, level, control):
    problem = grip(thin(), elements=(4, 2, 2), allowed=allowed, level=level).problem
    rng = np.random.default_rng(1)
    x = stirred(problem, rng)
    problem.control = control
    problem.tangent(x)
    pattern = problem.pattern
    K = sp.csr_matrix((pattern.values.copy(), pattern.column, pattern.start), shape=(problem.size,) * 2)
    parts = [slice(0, problem.model.size), *(f.unknowns for f in problem.fingers)]
    for moved in parts:
        step = np.zeros(problem.size)
        step[moved] = rng.normal(size=step[moved].size)
        found = (problem.residual(x + 1e-9 * step) - problem.residual(x - 1e-9 * step)) / 2e-9
        expected = K @ step
        for rows in parts:
            # differences of large forces: what rounding leaves, relative to the largest entry of the whole column
            assert np.abs(found - expected)[rows].max() <= 1e-8 * np.abs(found).max() + 1e-3


@pytest.mark.long
def test_quarter_half_and_full_give_the_same():
    reference = states()
    for allowed in ((True, False), (False, True), (False, False)):
        for a, b in zip(reference, states(allowed), strict=True):
            assert len(b.fingers) == (1 if allowed[0] else 2)
            for finger in b.fingers:
                assert finger.closing == pytest.approx(a.fingers[0].closing, rel=1e-7)
                assert e_n(finger) == pytest.approx(e_n(a.fingers[0]), rel=1e-6)
            np.testing.assert_allclose(b.wall.reaction, a.wall.reaction, atol=1e-7)


def test_a_body_of_revolution_is_the_same_from_every_side():
    for a, b in zip(states(), states(theta=0.7), strict=True):
        assert b.fingers[0].closing == pytest.approx(a.fingers[0].closing, rel=1e-7)


@pytest.mark.parametrize("support", ["standing", "free"])
def test_fingers_object_and_support_are_in_balance(support):
    # near the shoulder the wall leans, and the pads push the can down
    for state in states((False, False), z=0.142, support=support):
        one, two = (f.points.force for f in state.fingers)
        assert one[2] == pytest.approx(state.force, rel=1e-8)
        assert two[2] == pytest.approx(state.force, rel=1e-8)
        along_axis = one[0] + two[0]  # the pads' long side points up
        assert state.wall.reaction[2] == pytest.approx(-along_axis, rel=1e-9)
        assert abs(state.wall.reaction[2]) > 1e-3 * state.force
        np.testing.assert_allclose(state.wall.reaction[:2], 0.0, atol=1e-7)
        np.testing.assert_allclose(state.wall.load.sum(axis=0), -state.wall.reaction, atol=1e-12)


def test_a_very_stiff_wall_is_a_rigid_object():
    stiff = thin(1.4e-3, WallMaterial(4e11, 0.38), "clamped")
    soft = list(grip(stiff).load_path(FORCES))
    pad = soft[0].fingers[0].pad
    press = Press(pad, gap_at(pose(0.0, 0.075)))
    for a, b in zip(soft, press.load_path(FORCES), strict=True):
        assert a.fingers[0].closing == pytest.approx(b.closing, rel=1e-4)
        assert e_n(a.fingers[0]) == pytest.approx(e_n(b), rel=1e-4)
        np.testing.assert_allclose(a.fingers[0].pressure, b.pressure, atol=1e-3 * b.pressure.max())
    press.destroy()


def test_linear_and_nonlinear_walls_agree_while_the_indentation_is_small():
    for a, b in zip(states(thickness=8e-4), states(thickness=8e-4, level="linear"), strict=True):
        deepest = np.linalg.norm(a.wall.q.reshape(-1, 6)[:, :3], axis=1).max()
        assert deepest < 0.3 * 8e-4
        assert e_n(b.fingers[0]) == pytest.approx(e_n(a.fingers[0]), rel=0.01)
        assert b.fingers[0].closing == pytest.approx(a.fingers[0].closing, rel=0.01)


def test_a_thin_wall_gives_way_and_the_contact_spreads():
    thick, thin_ = states(thickness=8e-4)[-1], states(thickness=3e-4)[-1]
    assert thin_.fingers[0].closing > 1.2 * thick.fingers[0].closing
    assert e_n(thin_.fingers[0]) > e_n(thick.fingers[0])


# An independent prototype with another element library: force [N] and e_n [mm] by thickness and closing [mm].
PROTOTYPE = {
    0.3: {1: (0.860, 8.13), 2: (1.927, 8.88), 3: (2.632, 10.30), 4: (2.875, 11.45), 5: (3.263, 11.69)},
    0.4: {1: (1.050, 8.07), 2: (2.537, 8.66), 3: (4.246, 9.23), 4: (5.730, 9.86), 5: (6.125, 10.84)},
    0.5: {1: (1.153, 8.05), 2: (2.864, 8.61), 3: (4.986, 9.08), 4: (7.375, 9.46), 5: (9.788, 9.82)},
}


@pytest.mark.long
@pytest.mark.parametrize("thickness", PROTOTYPE)
def test_through_the_snap_in_as_an_independent_prototype(thickness):
    held = grip(thin(thickness * 1e-3), elements=(15, 10, 10), mesh=FINE)
    work, step = Work(), held._stepping
    x, _ = step.first(5e-4, 0.5, work)
    for closing in np.arange(1, 11) * 5e-4:
        x = step.solve(x, Control(closing=closing), work)
        expected = PROTOTYPE[thickness].get(round(closing * 1e3, 6))
        if expected:
            F = held.problem.normal_force(x)
            assert F == pytest.approx(expected[0], rel=0.035)
            finger = held._pressed(OnPath(x, F), work, held.solver.seconds)
            assert 1e3 * e_n(finger) == pytest.approx(expected[1], rel=0.01)
    assert work.halvings == 0
