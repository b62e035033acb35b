"""Published answers of shells: nonlinear tables row by row, the linear course, guards on the number of iterations."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from softjaw.fem.shell.wall_model import LinearShell
from tests.fem.shell import shell_problems
from tests.fem.shell.shell_problems import follow, load_steps

TABLES = json.loads((Path(__file__).parents[2] / "data" / "shell_tables.json").read_text(encoding="utf-8"))
NONLINEAR = {
    "cantilever_end_shear": shell_problems.cantilever, "slit_annular_plate": shell_problems.annulus,
    "hemisphere_18deg_hole": shell_problems.hemisphere,
}  # fmt: skip
LINEAR = {
    "scordelis_lo": shell_problems.scordelis_lo, "pinched_cylinder": shell_problems.pinched_cylinder,
    "hemisphere": partial(shell_problems.hemisphere, P=2.0),
}  # fmt: skip


@pytest.mark.parametrize("name", [
    "cantilever_end_shear", "hemisphere_18deg_hole", pytest.param("slit_annular_plate", marks=pytest.mark.long),
])  # fmt: skip
def test_nonlinear_table(name):
    table, case = TABLES[name], NONLINEAR[name]()
    rows = np.array(table["table"])
    states = list(load_steps(case.loaded, rows[:, 0]))
    found = np.array([case.read(state.q) for state in states])
    # printed with three digits: half a unit of the last one is theirs
    assert (np.abs(found - rows[:, 1:]) <= table["tol_rel"] * rows[:, 1:] + 0.0005).all()
    assert sum(state.halvings for state in states) == 0


@pytest.mark.parametrize("name", NONLINEAR)
def test_full_load_in_one_step(name):
    """Guard on the tangent of mixed integration points: the plain one takes hundreds of iterations, or fails."""
    table, case = TABLES[name], NONLINEAR[name]()
    (state,) = load_steps(case.loaded, [1.0])
    assert (state.iterations, state.halvings) <= (20, 0)
    assert case.read(state.q) == pytest.approx(table["table"][-1][1:], rel=table["tol_rel"])


def test_the_plain_tangent_finds_the_same_state():
    case = shell_problems.hemisphere(8)
    ((mixed,), (plain,)) = (list(load_steps(case.loaded._replace(mixed=kind), [0.1])) for kind in (True, False))
    assert mixed.q == pytest.approx(plain.q, abs=1e-9 * np.abs(plain.q).max())
    assert plain.iterations > mixed.iterations


def path_of(case, largest_factor):
    """Displacements and load factors along the path up to this factor."""
    path = [(0.0, 0.0)]
    for state in follow(case.loaded, 0.05, longest=10.0):
        path.append((case.read(state.q)[0], state.factor))
        if state.factor > largest_factor:
            return np.array(path).T


@pytest.mark.long
def test_hinged_roof_past_both_limit_points():
    table = TABLES["hinged_roof_12.7"]
    w, P = path_of(shell_problems.hinged_roof(12.7), 1.0)
    rows = np.array(table["table"])
    assert np.abs(np.interp(rows[:, 1], w, P) - rows[:, 0]).max() < table["tol_abs_P"]


@pytest.mark.parametrize("name", LINEAR)
@pytest.mark.parametrize("n", [4, 8, 16, pytest.param(32, marks=pytest.mark.long)])
def test_linear_course(name, n):
    case, table = LINEAR[name](n), TABLES["linear"][name]
    q = LinearShell(*case.loaded[:2]).solve(case.loaded.load)
    assert case.read(q)[0] / table["ref"] == pytest.approx(table["measured_Q4"][str(n)][1], abs=2e-4)


@pytest.mark.long
@pytest.mark.parametrize(("problem", "levels", "expected"), [
    (shell_problems.pulled_cylinder, [1.0], [2.768, 4.551, 3.269]),
    (shell_problems.pinched_half_cylinder, np.linspace(0.05, 1, 20), [171.505]),
])  # fmt: skip
def test_other_problems_at_full_load(problem, levels, expected):
    case = problem()
    *_, last = load_steps(case.loaded, levels)
    assert case.read(last.q) == pytest.approx(expected, rel=0.01)
