"""The way to a force on an artificial grasp whose force falls while the fingers close: its first crossing is taken."""

from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.fem.contact.load_stepping import Settings, Stepping, Work
from softjaw.fem.contact.path import OnPath
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.shell.grip import Grip
from tests.fem.falling_force import MM, Curve, crossings


class Jumping:
    """Under force control finds the last crossing, as Newton's method may, unless it starts close to another."""

    def __init__(self, problem, close=0.05):
        self.problem, self.close = problem, close

    def solve(self, x, tolerance, iterations=None):
        control = self.problem.control
        if control.force is None:
            return np.array([control.closing]), 1
        places = crossings(control.force)
        near = places[np.abs(places - x[0] / MM) < self.close]
        return np.array([(near[0] if len(near) else places[-1]) * MM]), 1


def stepping(**choices):
    problem = Curve()
    return Stepping(problem, Jumping(problem, **choices), Settings())


@pytest.mark.parametrize("wanted", [0.3, 1.9, 2.1, 2.4, 2.45, 3.5])
def test_a_walk_lands_on_the_first_crossing(wanted):
    forces = []
    x = stepping().displacement_control(np.zeros(1), wanted, Work(), 0.5 * MM, forces)
    assert x[0] / MM == pytest.approx(crossings(wanted)[0], abs=1e-9)
    assert (np.diff(forces) < 0).any() == (wanted > 2.5)


def test_a_landing_far_from_its_bracket_is_refused_and_tried_from_closer():
    work = Work()
    x = stepping(close=0.003).displacement_control(np.zeros(1), 2.2, work, 0.5 * MM)
    assert x[0] / MM == pytest.approx(crossings(2.2)[0], abs=1e-9)
    assert work.steps > 8  # brackets were halved


def test_a_force_that_is_never_reached_is_an_error():
    flat = stepping()
    flat.problem.normal_force = lambda x: 1.0 - np.exp(-x[0] / MM)
    with pytest.raises(ConvergenceError):
        flat.displacement_control(np.zeros(1), 2.0, Work(), 0.5 * MM)


def test_what_watches_the_way_can_end_it():
    steps, seen = stepping(), []

    def watch(x, F):
        seen.append(F)
        if x[0] > 1.2 * MM:
            raise RuntimeError("enough")

    steps.watch = watch
    with pytest.raises(RuntimeError, match="enough"):
        steps.displacement_control(np.zeros(1), 4.0, Work(), 0.5 * MM)
    assert len(seen) >= 3


def climbing(**choices):
    """A grip that has only its way up."""
    grip = Grip.__new__(Grip)
    grip._stepping = stepping(**choices)
    grip.problem, grip._crept, grip._last, grip._shut = grip._stepping.problem, False, None, lambda x: 0.0
    return grip


@pytest.mark.parametrize(("reached", "goal", "falls"), [(1.0, 2.2, False), (2.0, 3.0, True)])
def test_a_jump_under_force_control_is_walked_instead(reached, goal, falls):
    """Beyond the limit the force has fallen on the way."""
    start = np.array([crossings(reached)[0] * MM])
    x, fell = climbing()._step_to(start, reached, goal, 0.2 * MM, Work())
    assert x[0] / MM == pytest.approx(crossings(goal)[0], abs=1e-9)
    assert fell == falls


@pytest.mark.parametrize("slope", [1e-9, -1e-9])
def test_a_first_force_above_the_limit_does_not_jump_there_unseen(slope):
    grip = climbing()
    first = np.array([0.1 * MM])
    grip._stepping.first = lambda closing, F, work: (first, grip.problem.normal_force(first))
    grip._stepping.problem.closing = lambda x: float(x[0])
    grip._compliance = lambda: slope
    found = grip._step_on(None, 6.0, Work())
    assert found.x[0] / MM == pytest.approx(crossings(6.0)[0], abs=1e-9)
    assert found.jumped
    assert found.snapped


def test_steps_that_keep_failing_end_the_walk():
    steps = stepping()

    def solve(x, tolerance, iterations=None):
        raise ConvergenceError("no luck")

    steps.solver.solve = solve
    work = Work()
    with pytest.raises(ConvergenceError):
        steps.displacement_control(np.zeros(1), 1.0, work, 0.5 * MM)
    assert work.halvings < 12


@pytest.mark.parametrize(
    ("slope", "shut", "jumps", "snaps"),
    [(1e-9, 0.25, False, False), (-1e-9, 0.0, True, True), (1e-9, 0.35, False, True)],
)
def test_more_force_that_would_open_the_fingers_and_far_more_closing_than_in_proportion(slope, shut, jumps, snaps):
    """In proportion to the force 0.1 at 1 N becomes 0.22 at 2.2 N; twice that growth is 0.34."""
    grip, start = climbing(), np.array([crossings(1.0)[0] * MM])
    grip._compliance, grip._shut = (lambda: slope), (lambda x: 0.1 if x is start else shut)
    state = grip._step_on(OnPath(start, 1.0, compliance=0.2 * MM), 2.2, Work())
    assert state.snapped == snaps
    assert state.jumped == jumps or shut > 0.0


@pytest.mark.parametrize(("ends", "code"), [((3.74, 3.72), CheckError), ((3.74, 2.9), ConvergenceError)])
def test_a_path_that_ends_at_one_force_with_either_kind_of_gaps_is_ended_by_the_wall(ends, code):
    grip, left = climbing(), iter(ends)
    grip.opening, grip._others = SimpleNamespace(last=(0.82, 3.7)), (lambda: grip.problem,)
    grip._switch = lambda problem: None

    def level(here, F, work):
        grip._peak = next(left)
        grip.opening.last = (0.96 if code is ConvergenceError else 0.82), grip._peak
        raise ConvergenceError("no further")

    grip._level = level
    with pytest.raises(code):
        grip._next(None, 5.0, Work())
