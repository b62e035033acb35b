"""One force by itself, from the state of a coarser mesh: the state of the load path, whatever was solved before."""

from functools import cache

import numpy as np
import pytest

from softjaw.fem.assembly import Pattern
from softjaw.fem.contact.press import Press
from softjaw.fem.errors import ConvergenceError
from softjaw.fem.pad.interpolation import interpolated
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.pad.shape import PadShape
from softjaw.fem.petsc import NonlinearSolver, unknown_options
from tests.fem.contact.test_press import relative
from tests.fem.reference import BALL, FOAM, OVAL, pad_of

FORCES = [1.0, 3.0, 10.0]


def pair(element, symmetry=(True, True), grading=(1.0, 1.0, 1.0)):
    """A pad and the one half as fine; its width has an odd number of elements, so it is no half across."""
    contact = "nodal" if element == "hex8" else "weighted"
    pad = pad_of({"hex8": (12, 6, 4), "hex27": (8, 4, 2)}[element], symmetry, contact, element, grading=grading)
    coarse = pad.shape.halved()
    even = [n % 2 == 0 for n in coarse.elements]
    return pad, Pad(coarse, FOAM, (symmetry[0] and even[0], symmetry[1] and even[1]), contact)


@cache
def coarse_states(gap=OVAL, element="hex8", forces=tuple(FORCES)):
    return list(Press(pair(element)[1], gap).load_path(forces))


@cache
def fine_state(gap, force):
    [state] = Press(pair("hex8")[0], gap).load_path([force])
    return state


@pytest.mark.parametrize("gap", [OVAL, BALL], ids=["cylinder", "sphere"])
@pytest.mark.parametrize("element", ["hex8", "hex27"])
def test_every_force_by_itself_leads_to_the_state_of_the_load_path(gap, element):
    pad, _ = pair(element)
    press = Press(pad, gap)
    for start, expected in zip(coarse_states(gap, element), Press(pad, gap).load_path(FORCES), strict=True):
        found = press.at(start.force, [start])
        assert (found.work.steps, found.work.halvings, found.notes) == (1, 0, ())
        assert found.work.iterations <= 7
        assert relative(found.unknowns, expected.unknowns) < 1e-9
        assert relative(found.pressure, expected.pressure) < 1e-9
        assert found.checks.max_strain == pytest.approx(expected.checks.max_strain, rel=1e-9)


@pytest.mark.parametrize("start", ["none", "jumped", "far off", "broken"])
def test_a_start_that_does_not_serve_is_replaced_by_a_walk_from_first_contact(start):
    pad, coarse = pair("hex8")
    [good] = coarse_states(BALL, forces=(3.0,))
    far = good._replace(unknowns=good.unknowns + np.eye(coarse.size)[coarse.closing_dof] * 4e-3)
    given = {
        "none": [], "jumped": [good._replace(path_dependent=True)], "far off": [far],
        "broken": [good._replace(unknowns=np.full(coarse.size, np.nan))],
    }  # fmt: skip
    expected = fine_state(BALL, 3.0)
    found = Press(pad, BALL).at(3.0, given[start])
    assert found.work.steps > 1
    assert relative(found.unknowns, expected.unknowns) < 1e-9
    assert not found.path_dependent


def test_a_force_without_a_state_fails_alone_and_within_its_iterations():
    """Far beyond what the foam bears; the force before and after it are solved as ever."""
    pad = pad_of((6, 4, 2), contact="nodal")
    press = Press(pad, BALL)
    [start] = Press(pad, BALL).load_path([3.0])
    before = press.at(3.0, [start]).unknowns
    with pytest.raises(ConvergenceError):
        press.at(3000.0, [])
    assert press.solver.iterations_left >= -25
    assert press.MOST_ITERATIONS - press.solver.iterations_left > 25
    assert press.at(3.0, [start]).unknowns.tobytes() == before.tobytes()


class CubeRoot:
    """Newton's method on ``x^(1/3)`` goes from x to -2 x, so the residual grows by 2^(1/3) in every iteration."""

    size, non_negative, complementarity = 1, slice(0, 0), False

    def __init__(self):
        self.pattern, self.asked = Pattern(1, np.zeros(1, np.int32), np.zeros(1, np.int32)), 0

    def residual(self, x):
        return np.cbrt(x)

    def tangent(self, x):
        self.asked += 1
        self.pattern.values[:] = 1.0 / (3.0 * np.cbrt(x) ** 2)

    def shorten(self, x, step):
        return 1.0


@pytest.mark.parametrize(("patient", "iterations"), [(False, 10), (True, 25)])
def test_a_solve_whose_residual_does_not_fall_is_given_up(patient, iterations):
    problem = CubeRoot()
    solver = NonlinearSolver(problem)
    solver.patient = patient
    with pytest.raises(ConvergenceError):
        solver.solve(np.ones(1), 1e-10)
    assert problem.asked == iterations
    solver.iterations_left = 3
    with pytest.raises(ConvergenceError):  # the next solve is judged by its own
        solver.solve(np.ones(1), 1e-10)
    assert problem.asked == 2 * iterations
    solver.destroy()


def test_an_ordering_that_ends_the_process_at_full_matrices_is_judged_on_a_sparse_one():
    options = {"contact_mat_mumps_icntl_7": 4, "contact_mat_mumps_icntl": 4}
    assert unknown_options(options) == ["contact_mat_mumps_icntl"]


@pytest.mark.parametrize("element", ["hex8", "hex27"])
@pytest.mark.parametrize("symmetry", [(True, True), (True, False), (False, False)])
def test_fields_of_the_elements_degree_are_interpolated_exactly(element, symmetry):
    """Displacements odd across a plane of symmetry, pressures even; also from a quarter to the whole."""
    p = 1 if element == "hex8" else 2

    def state(pad):
        x, y, z = pad.nodes.T
        # |x| is a field of trilinear elements on both sides of the plane x = 0
        u = np.column_stack([x * (1 + z**p), y * (2 + np.abs(x)), (1 + np.abs(y) ** p) * (z + np.abs(x) ** p)])
        found = np.zeros(pad.size)
        found[pad.dofs[pad.dofs >= 0]] = u[pad.dofs >= 0]
        found[pad.closing_dof] = 0.5
        face = np.abs(pad.nodes[pad.contact_nodes])
        found[pad.closing_dof + 1 :] = 1 + face[:, 0] ** p * face[:, 1] + face[:, 1] ** p
        return found

    fine = Pad(PadShape((4, 2, 1), (8, 8, 3), (1.5, 2.0, 2.0), element), FOAM, symmetry, "weighted")
    quarter = Pad(PadShape((4, 2, 1), (4, 4, 2), (1.0, 1.5, 1.0), element), FOAM, (True, True), "weighted")
    expected, found = state(fine), interpolated(quarter, state(quarter), fine)
    inner = np.setdiff1d(np.arange(fine.closing_dof), fine.dofs[fine.nodes[:, 2] < -0.5].ravel())
    assert found[inner] == pytest.approx(expected[inner], abs=1e-12)
    assert found[fine.closing_dof :] == pytest.approx(expected[fine.closing_dof :], abs=1e-12)
    assert interpolated(fine, expected, fine) == pytest.approx(expected, abs=1e-12)


def test_pressures_are_never_interpolated_below_zero():
    pad, coarse = pair("hex27")
    x = np.zeros(coarse.size)
    x[coarse.closing_dof + 1 :: 5] = 1.0  # quadratic functions swing between 1 and 0
    pressure = interpolated(coarse, x, pad)[pad.closing_dof + 1 :]
    assert pressure.min() >= 0.0
    assert pressure.max() >= 1.0 - 1e-12
