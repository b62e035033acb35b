"""Two fingers on a thin wall, with and without friction that acts back: tangent, balance, limits, other figures."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.fem.contact.load_stepping import Work
from softjaw.fem.contact.path import OnPath
from softjaw.fem.contact.press import Press
from softjaw.fem.contact.problem import Control
from softjaw.fem.errors import ConvergenceError
from softjaw.fem.shell.grip import Grip
from softjaw.fem.shell.wall_material import WallMaterial
from softjaw.fem.shell.wall_mesh import MeshSize, body_mesh, interpolated
from tests.fem.grips import check_tangent, dense, e_n, gap_at, grip, pose, stirred, thin

FORCES, MU = (0.5, 2.0), 0.4
FORCE = Control(force=2.0)
WALL, RIM = {"z": 0.075}, {"z": 0.198, "radius": 0.013}  # pads in the middle, and over the rim of the neck
FINE = MeshSize(0.00085, 0.0025, 0.005)
# An independent prototype with another element library: force [N] and e_n [mm] by thickness and closing [mm].
PROTOTYPE = {
    0.3: {1: (0.860, 8.13), 2: (1.927, 8.88), 3: (2.632, 10.30), 4: (2.875, 11.45), 5: (3.263, 11.69)},
    0.4: {1: (1.050, 8.07), 2: (2.537, 8.66), 3: (4.246, 9.23), 4: (5.730, 9.86), 5: (6.125, 10.84)},
}
ROUGH = MeshSize(0.004, 0.008, 0.016)
SYMMETRIES = [(True, True), (True, False), (False, True), (False, False)]


@cache
def states(allowed=(True, True), level="nonlinear", thickness=4e-4, z=0.075, support="standing", theta=0.0, mu=None):
    body = thin(thickness, support=support)
    return tuple(grip(body, z, allowed=allowed, level=level, theta=theta, mu=mu).load_path(FORCES))


@pytest.mark.parametrize(("allowed", "level", "control", "place"), [
    ((True, True), "nonlinear", FORCE, WALL), ((True, True), "linear", FORCE, WALL),
    ((False, False), "nonlinear", FORCE, WALL), ((True, True), "nonlinear", Control(closing=1e-3), WALL),
    ((True, True), "nonlinear", FORCE, RIM),
])  # fmt: skip
def test_the_tangent_is_the_derivative_of_the_residual(allowed, level, control, place):
    problem = grip(thin(), elements=(4, 2, 2), allowed=allowed, level=level, **place).problem
    problem.control = control
    faced = problem.fingers[0].faced / problem.fingers[0].pad.face_area
    assert ((faced > 0.0) & (faced < 1.0)).any() == (place == RIM)
    check_tangent(problem, stirred(problem, np.random.default_rng(1)), 1e-9, 1e-8)


def test_one_pad_may_meet_nodes_of_the_wall_while_the_other_meets_none():
    problem = grip(thin(), elements=(4, 2, 2), allowed=(False, False)).problem
    x, other = stirred(problem, np.random.default_rng(1)), problem.fingers[1]
    x[other.unknowns] *= -1.0  # off the wall
    x[other.pressures] = 0.0
    K, wall = dense(problem, x), slice(0, problem.model.size)
    assert [K[f.unknowns, wall].any() for f in problem.fingers] == [True, False]


@pytest.mark.long
@pytest.mark.parametrize("mu", [None, MU])
def test_quarter_half_and_full_give_the_same(mu):
    for allowed in ((True, False), (False, True), (False, False)):
        for a, b in zip(states(mu=mu), states(allowed, mu=mu), strict=True):
            assert len(b.fingers) == (1 if allowed[0] else 2)
            for finger in b.fingers:
                assert finger.closing == pytest.approx(a.fingers[0].closing, rel=1e-7)
                # whether a point at the edge of the contact held on before is decided by rounding, on either mesh
                assert e_n(finger) == pytest.approx(e_n(a.fingers[0]), rel=1e-4 if mu else 1e-6)


@pytest.mark.parametrize("support", ["standing", pytest.param("free", marks=pytest.mark.long)])
def test_fingers_object_and_support_are_in_balance(support):
    # near the shoulder the wall leans, and the pads push the can down
    for state in states((False, False), z=0.142, support=support):
        forces = np.array([f.points.force for f in state.fingers])
        assert forces[:, 2] == pytest.approx(state.force, rel=1e-8)
        along_axis = forces[:, 0].sum()  # the pads' long side points up
        assert abs(along_axis) > 1e-3 * state.force
        np.testing.assert_allclose(state.wall.load.sum(axis=0), [0.0, 0.0, along_axis], atol=1e-7)


@pytest.mark.parametrize(("allowed", "level", "control"), [
    ((True, True), "nonlinear", FORCE), ((True, False), "linear", FORCE),
    pytest.param((False, False), "nonlinear", Control(closing=1.5e-3), marks=pytest.mark.long),
])  # fmt: skip
def test_so_is_that_of_a_grasp_with_friction(allowed, level, control):
    """From a state with a history: some points stick, some slip, some are open."""
    problem = grip(thin(), elements=(4, 2, 2), allowed=allowed, level=level, mu=0.2).problem
    rng = np.random.default_rng(1)
    x = stirred(problem, rng)
    problem.accept(x)
    for size in (3e-6, 1e-6):
        x = x + size * rng.normal(size=problem.size) * np.isin(np.arange(problem.size), problem.friction.moved)
        if size == 3e-6:
            problem.accept(x)
    problem.control = control
    for k, c in enumerate(problem.evaluate(x)):
        f = problem.fingers[k]
        size, most = np.linalg.norm(problem.traction(k, x, c)[0], axis=1), 0.2 * problem.point_pressure(f, c)
        slips = np.isclose(size, most, rtol=1e-9) & (size > 0)
        assert slips.any()
        assert ((size > 0) & ~slips).any()
    check_tangent(problem, x, 1e-10, 1e-7)


@pytest.mark.long
def test_where_gaps_have_no_state_the_path_goes_on_with_the_next_kind_and_without_friction_nothing_changes(monkeypatch):
    expected = [s.fingers[0].closing for s in grip(thin(), elements=(4, 2, 2)).load_path(FORCES)]
    problem, level, failed = grip(thin(), elements=(4, 2, 2)).problem, Grip._level, []

    def fails_once(self, here, force, work):
        if force > FORCES[0] and not failed:
            failed.append(force)
            raise ConvergenceError("cycles")
        return level(self, here, force, work)

    monkeypatch.setattr(Grip, "_level", fails_once)
    found = [s.fingers[0].closing for s in Grip([lambda: problem] * 2).load_path(FORCES)]
    assert (found, failed) == (pytest.approx(expected, rel=1e-8), [FORCES[1]])
    for a, b in zip(states(mu=0.0), states(), strict=True):
        assert a.fingers[0].closing == pytest.approx(b.fingers[0].closing, rel=1e-8)
        assert e_n(a.fingers[0]) == pytest.approx(e_n(b.fingers[0]), rel=1e-6)


@pytest.mark.parametrize("level", ["nonlinear", pytest.param("linear", marks=pytest.mark.long)])
def test_coulombs_law_and_balance_hold(level):
    """``|t| <= mu p`` across the normal, and what the pads press and rub with is what the wall bears."""
    for state in states(level=level, mu=MU):
        points = state.fingers[0].points
        size = np.linalg.norm(points.friction, axis=-1)
        assert (size <= MU * points.load * (1 + 1e-9)).all()
        assert np.abs(np.einsum("fqi,fqi->fq", points.friction, points.normal)).max() < 1e-9 * points.load.max()
        assert size.sum() > 0.05 * points.load.sum()
        rubbed = state.pose.rotation @ points.force
        np.testing.assert_allclose(rubbed, state.wall.load.sum(axis=0), atol=1e-9 * state.force)


@pytest.mark.parametrize("mu", [None, pytest.param(MU, marks=pytest.mark.long)])
def test_a_very_stiff_wall_is_a_rigid_object(mu):
    soft = list(grip(thin(1.4e-3, WallMaterial(4e11, 0.38), "clamped"), mu=mu).load_path(FORCES))
    press = Press(soft[0].fingers[0].pad, gap_at(pose(0.0, 0.075)), mu=mu)
    for a, b in zip(soft, press.load_path(FORCES), strict=True):
        assert a.fingers[0].closing == pytest.approx(b.closing, rel=1e-4)
        assert e_n(a.fingers[0]) == pytest.approx(e_n(b), rel=1e-4)
        np.testing.assert_allclose(a.fingers[0].pressure, b.pressure, atol=1e-3 * b.pressure.max())
    press.destroy()


@pytest.mark.long
@pytest.mark.parametrize("thickness", [0.3, 0.4])
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
            finger = held._pressed(OnPath(x, F), work)
            assert 1e3 * e_n(finger) == pytest.approx(expected[1], rel=0.01)
    assert work.halvings == 0


def pressed(coarser=False, allowed=(True, True), thickness=4e-4, z=0.142):
    mesh, elements = (ROUGH.halved(), (4, 2, 1)) if coarser else (ROUGH, (6, 4, 2))
    return grip(thin(thickness), z, elements, allowed, mesh=mesh)


@cache
def starts(allowed=(True, True), **where):
    return tuple(pressed(True, allowed, **where).load_path(FORCES))


@cache
def ladder():
    return tuple(pressed().load_path(FORCES))


def apart(found, expected):
    one, other = (np.concatenate([s.wall.q, *(f.unknowns for f in s.fingers)]) for s in (found, expected))
    return np.abs(one - other).max() / expected.fingers[0].closing


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_a_wall_is_interpolated_onto_the_same_mesh_and_onto_another(symmetry):
    """A squeeze to an oval, leaning more and more along the wall; directors turn with it and keep their length."""
    surface = thin().surface

    def state(mesh):
        theta, s = (np.broadcast_to(g, mesh.number.shape) for g in (mesh.theta[:, None], mesh.s))
        u, turned = np.empty((2, len(mesh.X), 3))
        part = 0.05 * np.sin(2.0 * s / mesh.s[-1])
        u[mesh.number] = 0.03 * np.stack([-part * np.cos(theta), part * np.sin(theta), part**2], -1)
        axis = part * np.sin(2 * theta)
        x, y, z = (mesh.D[mesh.number][..., i] for i in range(3))
        c, t = np.cos(axis), np.sin(axis)
        turned[mesh.number] = np.stack([c * x - t * y, t * x + c * y, z], -1)
        return np.hstack([u, turned - mesh.D]).ravel()

    one, other = (
        body_mesh(surface, 4e-4, MeshSize(heights=(0.05, 0.1), around=h, along=2 * h, coarse=3 * h), planes)
        for h, planes in ((0.003, symmetry), (0.002, (False, True)))
    )
    assert interpolated(one, state(one), one) == pytest.approx(state(one), abs=1e-17)
    assert interpolated(one, state(one), other) == pytest.approx(state(other), abs=2e-6)


def test_every_force_by_itself_leads_to_the_state_of_the_load_path():
    fine = pressed()
    for start, expected in zip(starts(), ladder(), strict=True):
        found = fine.at(start.force, [start])
        assert (found.fingers[0].work.steps, found.fingers[0].work.halvings) == (1, 0)
        assert found.fingers[0].work.iterations <= 7
        assert apart(found, expected) < 1e-8
        assert found.wall.opening == pytest.approx(expected.wall.opening, rel=1e-8)


@pytest.mark.parametrize(
    "start", ["none", "lower", *(pytest.param(own, marks=pytest.mark.long) for own in ("jumped", "far off"))]
)
def test_a_start_that_does_not_serve_is_replaced_by_one_below_or_by_first_contact(start):
    low, good = starts()
    far = good.unknowns + np.eye(good.pad.size)[good.pad.closing_dof] * 9e-3
    given = {
        "none": [], "lower": [low],
        "jumped": [good._replace(path_dependent=True), low],
        "far off": [good._replace(unknowns=far, wall=good.wall._replace(q=0 * low.wall.q))],
    }  # fmt: skip
    found = pressed().at(2.0, given[start])
    assert found.fingers[0].work.steps > 1
    assert apart(found, ladder()[1]) < 1e-8
    assert not found.path_dependent


@pytest.mark.parametrize(("closing", "shut", "expected"), [(-2e-6, 1e-4, False), (1e-6, 1e-4, False), (1e-6, 0.1, 1)])
def test_a_first_touch_that_is_off_by_micrometres_is_no_snap_in(closing, shut, expected):
    grip_ = SimpleNamespace(problem=SimpleNamespace(closing=lambda x: closing), _shut=lambda x: shut)
    assert Grip._gives_way(grip_, np.zeros(1), 3e-3, 1e-3) == expected


@pytest.mark.long
def test_a_wall_that_gives_way_is_found_where_its_own_load_path_leads():
    """The finer mesh gives way earlier than the coarser one, and levels between start on the other side of that."""
    forces, where = (0.5, 1.5, 2.5, 3.0), {"thickness": 3e-4, "z": 0.075}
    coarse, expected = (list(pressed(coarser, **where).load_path(forces)) for coarser in (True, False))
    fine = pressed(**where)
    assert expected[-1].wall.snapped
    for k, own in enumerate(expected):
        found = fine.at(own.force, coarse[k::-1][:3])
        assert apart(found, own) < 1e-8
        assert found.path_dependent == own.path_dependent
