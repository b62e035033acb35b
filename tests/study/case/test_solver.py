"""One solver of a candidate: every state and every failure is solved once, whoever asks for it."""

from collections import Counter

import numpy as np
import pytest

from softjaw.fem.contact.press import Press
from softjaw.fem.errors import ConvergenceError
from softjaw.study.case.solver import COARSE, FINE, CandidateSolver, Levels
from tests.study.test_levels import unit_of

PLAIN = Levels("rigid", "rigid", "none")


@pytest.fixture
def counted(monkeypatch):
    """How often a state is solved: by its force on the fine mesh, and by ``"path"`` for each load path."""
    count, at, load_path = Counter(), Press.at, Press.load_path

    def counting_at(press, force, starts=()):
        count[force] += 1
        if force == 2.0:
            raise ConvergenceError("no state")
        return at(press, force, starts)

    def counting_path(press, forces):
        count["path"] += 1
        return load_path(press, forces)

    monkeypatch.setattr(Press, "at", counting_at)
    monkeypatch.setattr(Press, "load_path", counting_path)
    return count


def test_a_state_or_its_failure_is_solved_once(counted):
    unit = unit_of()
    solver = CandidateSolver(unit.scene, unit.candidate.poses)
    for _ in range(2):
        case = solver.case(0, PLAIN)
        assert (case.fine, case.coarse) == (solver.solve(0, FINE, PLAIN), solver.solve(0, COARSE, PLAIN))
    failures = []
    for _ in range(2):
        with pytest.raises(ConvergenceError) as raised:
            solver.case(1, PLAIN)
        failures.append(raised.value)
    assert failures[0] is failures[1]
    # two fingers that are no images of each other
    assert counted == {1.0: 2, 2.0: 2, "path": 2}
    # other levels have load paths and states of their own
    coupled = solver.solve(0, COARSE, PLAIN._replace(friction_pressure_coupling="tangential"))
    assert coupled.contacts[0].limits["ccm"].e_n != case.coarse.contacts[0].limits["ccm"].e_n
    assert counted == {1.0: 4, 2.0: 2, "path": 2}
    solver.put_away()


def test_a_fine_state_starts_from_the_three_nearest_coarse_ones(monkeypatch):
    given, at = [], Press.at

    def watched(press, force, starts):
        given.append([state.force for state in starts])
        return at(press, force, starts)

    monkeypatch.setattr(Press, "at", watched)
    unit = unit_of("load.normal_force_n=[1, 1.5, 2, 3]")
    solver = CandidateSolver(unit.scene, unit.candidate.poses)
    solver.solve(3, FINE, PLAIN)
    solver.solve(0, FINE, PLAIN)
    # a finer mesh starts from the state on the mesh before it
    finer = solver.solve(0, FINE + 1, PLAIN)
    assert given == [[3.0, 2.0, 1.5]] * 2 + [[1.0]] * 4
    assert finer.contacts[0].state.pad.shape.elements == (10, 6, 3)
    solver.put_away()


def test_a_solver_that_was_put_away_goes_on_with_the_next_force_of_its_path():
    unit = unit_of("load.normal_force_n=[1, 3]")
    kept, new = (CandidateSolver(unit.scene, unit.candidate.poses) for _ in range(2))
    kept.solve(0, COARSE, PLAIN)
    kept.put_away()
    later, alone = (solver.solve(1, COARSE, PLAIN).states[0] for solver in (kept, new))
    assert later.force == 3.0
    np.testing.assert_array_equal(later.points.load, alone.points.load)
