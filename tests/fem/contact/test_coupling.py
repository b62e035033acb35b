"""Friction that acts back on the contact: limits, Coulomb's law, tangent, and independence of the steps."""

import numpy as np
import pytest

from softjaw.fem.contact import friction as coupling
from softjaw.fem.contact.friction import load_steps
from softjaw.fem.contact.press import Press
from softjaw.fem.contact.problem import Control, SpringBed
from softjaw.fem.contact.rigid import RigidProblem
from softjaw.fem.materials import material
from tests.fem import reference
from tests.fem.reference import BALL, OVAL, pad_of


def press(gap, mu, pad=None):
    return Press(pad or pad_of(), gap, mu=mu)


@pytest.mark.parametrize("stride", [1, 2])
def test_the_path_leads_through_the_same_forces_to_every_force(stride):
    path = load_steps(0.0, 1e3, 100.0, stride)[:-1]
    for force in (1e-3, 0.02, 5.0, path[3], path[3] * (1 + 1e-12), 70.0):
        steps = load_steps(0.0, force, 100.0, stride)
        assert steps == [f for f in path if f < force * (1 - 1e-9)] + [force]
        for reached in steps[:-1]:
            assert load_steps(reached, force, 100.0, stride) == [f for f in steps if f > reached]


def test_without_friction_nothing_changes_a_pad_that_does_not_spread_rubs_nowhere_and_a_rough_plane_holds_the_front():
    coupled, plain = press(BALL, 0.0).load_path([2.0, 5.0]), Press(pad_of(), BALL).load_path([2.0, 5.0])
    for one, other in zip(coupled, plain, strict=True):
        assert one.closing == pytest.approx(other.closing, rel=1e-9)
        assert np.abs(one.pressure - other.pressure).max() < 1e-8 * other.pressure.max()
    pad = pad_of(law=material("neo_hookean", 0.04e6, 0.0))
    (rough,) = press(reference.plane, 0.8, pad).load_path([5.0])
    (smooth,) = Press(pad, reference.plane).load_path([5.0])
    assert rough.closing == pytest.approx(smooth.closing, rel=1e-9)
    assert np.abs(rough.points.friction).max() < 1e-9 * rough.points.load.max()
    # At a large friction coefficient nothing slips; what is left of the spreading is the give of the stick.
    (rough,) = press(reference.plane, 50.0).load_path([5.0])
    (smooth,) = Press(pad_of(), reference.plane).load_path([5.0])
    home = pad_of().nodes[pad_of().contact_nodes][:, :2]
    spread = [np.abs(state.contact_face[:, :2] - home).max() for state in (rough, smooth)]
    assert spread[0] < 0.08 * spread[1]
    assert rough.closing < 0.98 * smooth.closing  # a held pad is stiffer


@pytest.mark.parametrize("mu", [0.1, 0.8])
def test_coulombs_law_and_balance_hold(mu):
    """``|t| <= mu p``, across the normal, against the way that the pad spreads; the checks of each state passed."""
    (state,) = press(OVAL, mu, pad_of((6, 4, 2), (False, False))).load_path([3.0])
    force, normal, load = state.points.friction, state.points.normal, state.points.load
    size = np.linalg.norm(force, axis=-1)
    assert (size <= mu * load * (1 + 1e-9)).all()
    assert np.abs(np.einsum("fqi,fqi->fq", force, normal)).max() < 1e-6 * load.max()
    slipping = (size > mu * load * (1 - 1e-6)) & (load > 0)
    assert slipping.any()
    assert (np.mean(slipping[load > 0]) > 0.5) == (mu == 0.1)  # with 0.8 most of it sticks
    assert (force[..., 0] * state.points.position[..., 0])[load > 0].sum() < 0
    assert state.checks.force_balance < 1e-8


def test_friction_goes_with_the_force_where_the_gradient_of_the_gap_is_no_unit_vector():
    """As at the ridges of a mesh, where the gap is interpolated."""
    gaps = OVAL, lambda x: tuple(1.2 * each for each in OVAL(x))
    states = [next(iter(press(gap, 0.4).load_path([3.0]))) for gap in gaps]
    for name in ("load", "friction", "normal"):
        one, other = (getattr(state.points, name) for state in states)
        assert np.abs(one - other).max() < 1e-6 * np.abs(one).max(), name


def test_judging_slip_by_what_was_before_changes_iterations_and_no_state(monkeypatch):
    """The first steps of a solve are those of another system, the residual that ends it is not."""
    (judged,) = press(OVAL, 0.4, pad_of((8, 6, 3), (False, False))).load_path([3.0])
    monkeypatch.setattr(coupling, "SHARES", ())
    (plain,) = press(OVAL, 0.4, pad_of((8, 6, 3), (False, False))).load_path([3.0])
    assert judged.work.iterations != plain.work.iterations
    assert judged.work.iterations < 1.2 * plain.work.iterations
    assert judged.closing == pytest.approx(plain.closing, rel=1e-8)
    assert np.abs(judged.pressure - plain.pressure).max() < 1e-5 * plain.pressure.max()


def steeper(x):
    """Of the ball, with a gradient that is up to a fifth longer than a unit vector, as that of a sampled distance."""
    g, n, H = BALL(x)
    factor, along = 1 + 40.0 * g + 5.0 * x[:, 0], np.array([5.0, 0.0, 0.0])
    slope = 40.0 * n + along
    gradient = factor[:, None] * n + g[:, None] * slope
    both = n[:, :, None] * slope[:, None, :]
    hessian = factor[:, None, None] * H + both + both.transpose(0, 2, 1) + 40.0 * g[:, None, None] * H
    return factor * g, gradient, hessian


@pytest.mark.parametrize("gap", [BALL, steeper])
@pytest.mark.parametrize("control", [Control(force=3.0), Control(closing=0.003)], ids=["force", "closing"])
def test_tangent_by_finite_differences(control, gap):
    """From a state with a history: some points stick, some slip, some are open."""
    pad = pad_of((6, 4, 2), (True, False))
    problem = RigidProblem(pad, gap, 0.2)
    problem.control = control
    bed = SpringBed(pad, BALL)
    rng = np.random.default_rng(3)
    before, x = bed.guess(0.0020), bed.guess(0.0021)
    x[: pad.closing_dof] += 3e-6 * rng.normal(size=pad.closing_dof)
    problem.accept(before)
    problem.accept(before + 0.5 * (x - before))
    size = np.linalg.norm((contact := problem.evaluate(x)[0]).traction, axis=-1)
    slips = np.isclose(size, 0.2 * problem.point_pressure(problem.finger, contact), rtol=1e-9) & (size > 0)
    assert slips.any()
    assert ((size > 0) & ~slips).any()
    assert reference.tangent_error(problem, x, rng.normal(size=pad.size) * 1e-8, 1e-2) < 1e-5


@pytest.mark.parametrize("gap", [OVAL, BALL], ids=["cylinder", "sphere"])
def test_a_force_has_one_state_whatever_other_forces_are_asked_for(gap):
    [alone] = press(gap, 0.4).load_path([4.0])
    _, _, among, _ = press(gap, 0.4).load_path([0.05, 1.0, 4.0, 9.0])
    downward = press(gap, 0.4)
    downward.at(9.0)
    for other in (among, downward.at(4.0)):
        assert other.unknowns.tobytes() == alone.unknowns.tobytes()
        assert other.points.friction.tobytes() == alone.points.friction.tobytes()


def test_newton_steps_to_and_fro_are_damped_and_others_are_not():
    problem = RigidProblem(pad_of(), BALL, 0.4)
    x, step = np.zeros(problem.size), np.full(problem.size, 1e-7)
    assert problem.shorten(x, step) == 1.0
    x = x - step
    for factor, direction in ((0.5, -1.0), (0.25, 1.0), (0.125, -1.0), (0.125, 1.0), (0.25, 0.1)):
        assert problem.shorten(x, direction * step) == factor
        x = x - factor * direction * step
    assert problem.shorten(x + 1.0, -step) == 1.0  # another solve has begun


@pytest.mark.long
def test_finer_steps_and_a_stiffer_stick_change_little(monkeypatch):
    (state,) = press(BALL, 0.4).load_path([6.0])
    for name, value in (("POWER", 2), ("STICK", 150.0)):
        with monkeypatch.context() as changed:
            changed.setattr(coupling, name, value)
            (finer,) = press(BALL, 0.4).load_path([6.0])
        # the steps leave some 0.3 %, which the stated error of a case holds
        assert finer.closing == pytest.approx(state.closing, rel=5e-3)
        assert finer.points.load.sum() == pytest.approx(state.points.load.sum(), rel=5e-3)
