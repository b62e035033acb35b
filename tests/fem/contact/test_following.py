"""The path of equilibria: its tangent, stability, jumps, and states that do not depend on the forces asked before."""

import contextlib

import numpy as np
import pytest

from softjaw.fem.contact.load_stepping import Stepping, Work
from softjaw.fem.contact.press import Press
from softjaw.fem.contact.problem import Control
from softjaw.fem.errors import ConvergenceError, NotReachedError
from softjaw.fem.materials import material
from softjaw.fem.objects.shapes import EllipticCylinder, Sphere
from tests.fem import reference
from tests.fem.falling_force import MM, Crossings, Curve, crossings, force

NEO = material("neo_hookean", 0.040e6, 0.25)
ROUND = reference.placed(EllipticCylinder(0.025, 0.025, 0.2), reference.facing(0.025))
BALL = reference.placed(Sphere(0.02), reference.facing(0.02))


def press_of(law=NEO, gap=ROUND, symmetry=(True, True), elements=(12, 6, 4), **choices):
    pad, nodal = (reference.pad_of(elements, symmetry, contact, law=law) for contact in ("weighted", "nodal"))
    return Press(pad, gap, fallbacks=(nodal,), **choices)


def last(press, forces):
    *_, state = press.load_path([float(f) for f in forces])
    return state


@pytest.mark.parametrize("forces", [[500], [5, 500], [3, 77, 201, 500]], ids=str)
def test_a_state_does_not_depend_on_the_list_of_forces(forces):
    """Neo-Hookean foam at 500 N: [5, 500] gave e_n = 15.14 mm and p_max = 2566 kPa, seven forces 14.79 mm and 2848."""
    state = last(press_of(), forces)
    assert not state.path_dependent
    assert state.closing == pytest.approx(13.85589900e-3, rel=1e-7)
    assert reference.e_n(state) == pytest.approx(14.84071815e-3, rel=1e-7)
    assert state.pressure.max() == pytest.approx(2816.678244e3, rel=1e-7)


def test_a_long_step_leads_to_an_unstable_state_and_the_path_to_a_stable_one():
    """Stable: the tangent on displacements that keep the nodes in contact on the object is positive definite."""
    unstable = {}
    for follows in (False, True):
        press = press_of()
        if not follows:
            press._stepping.followed = None
        state = last(press, [5, 500])
        values, active = press.problem.symmetric_tangent(state.unknowns)
        K, n = reference.dense(press.problem, values=values), press.pad.closing_dof + 1
        np.testing.assert_allclose(K, K.T, atol=1e-12 * np.abs(K).max())
        B = K[n:, :n][np.abs(K[n:, :n]).any(axis=1)]
        assert len(B) == active == np.count_nonzero(state.pressure > 0)
        _, _, V = np.linalg.svd(B)
        free = V[active:] @ K[:n, :n] @ V[active:].T
        negative = int((np.linalg.eigvalsh(free) < 0).sum())
        assert press.solver.negative_eigenvalues(values) == active + negative
        unstable[follows] = negative
    assert unstable == {False: 1, True: 0}


@pytest.mark.parametrize("symmetry", [(True, True), (False, True)])
@pytest.mark.parametrize("control", ["force", "closing"])
def test_tangent_of_the_path_by_finite_differences(symmetry, control):
    """Of states at forces 1 % lower and higher, whose nodes in contact are the same."""
    press = press_of(symmetry=symmetry)
    low, state, high = press.load_path([19.8, 20.0, 20.2])
    wanted = Control(closing=state.closing) if control == "closing" else Control(force=20.0)
    x = press._stepping.solve(state.unknowns * (1 + 1e-9), wanted, Work())
    tangent = press.problem.path_tangent(x, press.solver.answer)
    np.testing.assert_allclose(tangent, (high.unknowns - low.unknowns) / 0.4, atol=2e-3 * np.abs(tangent).max())


class StrainedCurve(Curve):
    """Strained by ``strain(x)``."""

    complementarity, closing_dof = False, 0
    thickness = 5 * MM

    def __init__(self, strain=lambda x: 0.0):
        self.strain = strain

    def path_tangent(self, x, answer):
        slope = np.polyval([3.0, -9.0, 6.0], x[0] / MM)
        return np.array([MM / slope]) if slope > 0 else None

    def keep(self, x, first):
        return True

    def shorten(self, x, step):
        return 1.0

    def largest_strain(self, x):
        return self.strain(x[0] / MM)

    def symmetric_tangent(self, x):
        return x, int(self.path_tangent(x, None) is not None)


def following(problem):
    return Stepping(problem, Crossings(problem), followed=problem)


@pytest.mark.parametrize("forces", [[3.0], [2.4, 3.0], [0.3, 1.1, 2.49, 2.51, 3.0]])
def test_a_jump_is_noted_however_the_force_is_reached(forces):
    steps = following(StrainedCurve())
    x, reached = np.array([0.01 * MM]), force(0.01)
    for goal in forces:
        x, reached = steps.step_to(x, reached, goal, Work()), goal
        assert force(x[0] / MM) == pytest.approx(goal)
        assert steps.jumped == (goal > 2.5)


def test_a_jump_is_an_error_where_there_is_another_way():
    steps = following(StrainedCurve())
    with pytest.raises(ConvergenceError):
        steps.step_to(np.array([0.01 * MM]), force(0.01), 3.0, Work(), by_displacement=False)
    x = steps.step_to(np.array([0.01 * MM]), force(0.01), 2.4, Work(), by_displacement=False)
    assert x[0] < MM
    assert not steps.jumped


@pytest.mark.parametrize("by_displacement", [True, False])
def test_where_no_state_is_found_under_force_the_path_goes_on_by_displacement_if_it_may(by_displacement):
    steps, closings = following(StrainedCurve()), []
    solve = steps.solver.solve

    def fails(x, *limits):
        control = steps.problem.control
        closings.append(control.closing)
        if control.force and control.force > 2.0 and not any(closings):
            raise ConvergenceError("cycles")
        return solve(x, *limits)

    steps.solver.solve = fails
    with contextlib.nullcontext() if by_displacement else pytest.raises(ConvergenceError, match="cycles"):
        x = steps.step_to(np.array([0.01 * MM]), force(0.01), 2.2, Work(), by_displacement=by_displacement)
        assert x[0] / MM == pytest.approx(crossings(2.2)[0])
    assert any(closings) == by_displacement


def test_a_fold_of_the_foam_is_a_jump_an_unstable_start_is_noted_and_a_maximum_of_the_force_named():
    """The strain grows by 0.8 at once; a growth of 0.8 along with the force is no fold."""
    sudden = following(StrainedCurve(lambda x: 0.8 if force(x) > 1.5 else 0.0))
    steady = following(StrainedCurve(lambda x: 0.8 * force(x) / 2.4))
    for steps in (sudden, steady):
        steps.step_to(np.array([0.01 * MM]), force(0.01), 2.4, Work())
    assert sudden.jumped
    assert not steady.jumped
    steps = following(StrainedCurve(lambda x: 0.6))
    steps.problem.symmetric_tangent = lambda x: (x, 0)
    steps.step_to(np.array([0.01 * MM]), force(0.01), 1.0, Work())
    assert steps.jumped
    # The force has a maximum of 2.5 N at 1 mm; the object's nearest point is 2.1 mm from the backing plate.
    steps = following(StrainedCurve())
    steps.deepest = 2.1 * MM
    with pytest.raises(NotReachedError, match=r"2\.(49\d*|5) N"):
        steps.displacement_control(np.array([0.5 * MM]), 3.0, Work(), 0.02 * MM)
    with pytest.raises(ConvergenceError):
        steps.solve(np.array([0.5 * MM]), Control(closing=2.2 * MM), Work())


def stalling(end, **choices):
    """A press whose solves under a force do not end; ``end`` gives iterate and residual from those that would."""
    press = press_of(**choices)
    proper = press.solver.solve

    def stalls(x, tolerance, *limits):
        force = press.problem.control.force
        if force is None:
            return proper(x, tolerance, *limits)
        error = ConvergenceError("alternates")
        error.end = end(lambda: proper(x, tolerance, *limits)[0], force * press.pad.share)
        raise error

    press.solver.solve, press._others, press._fallbacks = stalls, (), ()
    return press


@pytest.mark.parametrize(("scatter", "passes"), [(1e-7, True), (1e-2, False)])
def test_a_state_whose_nodes_alternate_passes_where_it_is_near_enough(scatter, passes):
    """An iterate beside the state, as a solve that does not end leaves it; the residual is told, and noted."""
    known = last(press_of(), [5])
    press = stalling(lambda *_: (known.unknowns * (1 + scatter), 1e-5))
    if passes:
        state = last(press, [5])
        assert state.closing == pytest.approx(known.closing, rel=1e-6)
        assert len(state.notes) == 1
    else:
        with pytest.raises(ConvergenceError):
            last(press, [5])


@pytest.mark.parametrize(("off", "passes"), [(5e-4, True), (2e-3, False)])
def test_with_friction_a_state_on_the_way_may_be_off_by_more_than_the_last_one(off, passes):
    """At an edge a point may have no place between stick and slip: solves stall there and would beyond for ever."""
    press = stalling(lambda solved, force: (solved(), off * force), mu=0.6)
    with pytest.raises(ConvergenceError):
        last(press, [5])
    assert bool(press._path) == passes
