"""Published answers of shells: nonlinear tables row by row, the linear course, guards on the number of iterations."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from softjaw.fem.shell.wall_model import LinearShell
from tests.fem.shell import shell_problems
from tests.fem.shell.shell_problems import load_steps, moved_steps

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
    found = np.array([case.read(state.q) for state in load_steps(case.loaded, rows[:, 0])])
    # printed with three digits: half a unit of the last one is theirs
    assert (np.abs(found - rows[:, 1:]) <= table["tol_rel"] * rows[:, 1:] + 0.0005).all()


@pytest.mark.parametrize("name", NONLINEAR)
def test_full_load_in_one_step(name):
    """Guard on the tangent of mixed integration points: the plain one takes hundreds of iterations, or fails."""
    table, case = TABLES[name], NONLINEAR[name]()
    (state,) = load_steps(case.loaded, [1.0])
    assert state.iterations <= 20
    assert case.read(state.q) == pytest.approx(table["table"][-1][1:], rel=table["tol_rel"])


def test_the_plain_tangent_finds_the_same_state():
    case = shell_problems.hemisphere(8)
    ((mixed,), (plain,)) = (list(load_steps(case.loaded._replace(mixed=kind), [0.1])) for kind in (True, False))
    assert mixed.q == pytest.approx(plain.q, abs=1e-9 * np.abs(plain.q).max())
    assert plain.iterations > mixed.iterations


@pytest.mark.long
def test_hinged_roof_past_both_limit_points():
    table = TABLES["hinged_roof_12.7"]
    P, w = np.transpose(table["table"])
    factors = [factor for factor, _ in moved_steps(shell_problems.hinged_roof(12.7), w)]
    assert factors == pytest.approx(P, abs=table["tol_abs_P"])


@pytest.mark.parametrize("name", LINEAR)
@pytest.mark.parametrize("n", [4, 8, 16, pytest.param(32, marks=pytest.mark.long)])
def test_linear_course(name, n):
    case, table = LINEAR[name](n), TABLES["linear"][name]
    q = LinearShell(*case.loaded[:2]).solve(case.loaded.load)
    assert case.read(q)[0] / table["ref"] == pytest.approx(table["measured_Q4"][str(n)][1], abs=2e-4)


@pytest.mark.long
@pytest.mark.parametrize(("problem", "expected"), [
    (shell_problems.pulled_cylinder, [2.768, 4.551, 3.269]), (shell_problems.pinched_half_cylinder, [171.505]),
])  # fmt: skip
def test_other_problems_at_full_load(problem, expected):
    case = problem()
    *_, (_, near) = moved_steps(case, np.linspace(0.0, expected[0], 41)[1:])
    assert case.read(case.loaded.newton(near, 1.0).q) == pytest.approx(expected, rel=0.01)
