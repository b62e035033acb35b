"""The way to a force on an artificial grasp whose force falls while the fingers close: its first crossing is taken."""

import numpy as np
import pytest

from softjaw.fem.contact.load_stepping import Settings, Stepping, Work
from softjaw.fem.errors import ConvergenceError
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


def test_steps_that_keep_failing_end_the_walk():
    steps = stepping()

    def solve(x, tolerance, iterations=None):
        raise ConvergenceError("no luck")

    steps.solver.solve = solve
    work = Work()
    with pytest.raises(ConvergenceError):
        steps.displacement_control(np.zeros(1), 1.0, work, 0.5 * MM)
    assert work.halvings < 12
