"""The complementarity problem: its tangent, its residual in states with a closed form, its sparsity."""

import numpy as np
import pytest

from softjaw.fem.contact.problem import Control
from softjaw.fem.contact.rigid import RigidProblem
from softjaw.fem.materials import material
from softjaw.fem.objects.shapes import EllipticCylinder, Sphere
from softjaw.fem.pad.shape import BackingPlate
from tests.fem import reference

G = 0.020e6
SIZE = (0.02, 0.012, 0.008)
PLATE = BackingPlate(0.002, 1e6, 0.3, (0.005, 0.003))
OBJECTS = {
    "sphere": reference.placed(Sphere(0.012), reference.facing(0.012)),
    "elliptic cylinder": reference.placed(EllipticCylinder(0.012, 0.005, 0.1), reference.facing(0.012)),
    "plane": reference.plane,
}


def problem_of(gap, contact="weighted", element="hex8", symmetry=(True, False), law="blatz_ko", plate=None):
    own = {"law": material(law, G), "size": SIZE, "grading": (2.0, 1.0, 1.5), "back": plate}
    return RigidProblem(reference.pad_of((4, 4, 2), symmetry, contact, element, **own), gap)


def contacting_state(problem, closing=1.2e-3):
    """A pad pressed into the object, out of balance, half of its contact face active, no node near the switch."""
    pad, rng = problem.pad, np.random.default_rng(4)
    x = np.zeros(problem.size)
    u = np.zeros_like(pad.nodes)
    u[:, 2] = closing
    u += 1e-4 * rng.uniform(-1, 1, u.shape)
    own = (pad.dofs >= 0) & (pad.dofs < pad.closing_dof)
    x[pad.dofs[own]] = u[own]
    x[pad.closing_dof] = closing
    x[pad.closing_dof + 1 :] = np.abs(1e-3 * rng.uniform(0.2, 1, len(pad.node_area)))
    return x


@pytest.mark.parametrize("control", [Control(force=2.0), Control(closing=1e-3)], ids=["force", "closing"])
@pytest.mark.parametrize("complementarity", [False, True], ids=["active set", "bounds"])
@pytest.mark.parametrize("contact", ["weighted", "blended", "nodal"])
@pytest.mark.parametrize("name", OBJECTS)
def test_tangent_is_the_derivative_of_the_residual(name, contact, complementarity, control):
    problem = problem_of(OBJECTS[name], contact)
    problem.control, problem.complementarity = control, complementarity
    x = contacting_state(problem)
    active = problem.evaluate(x)[0].active
    assert active.any()
    if name != "plane":
        assert not active.all()
    for direction in np.random.default_rng(6).uniform(-1, 1, (4, problem.size)):
        assert reference.tangent_error(problem, x, direction, 1e-7) < 1e-8


@pytest.mark.parametrize("law", ["blatz_ko", "neo_hookean", "linear"])
def test_tangent_of_triquadratic_elements(law):
    problem = problem_of(OBJECTS["sphere"], element="hex27", law=law)
    problem.control = Control(force=2.0)
    direction = np.random.default_rng(6).uniform(-1, 1, problem.size)
    assert reference.tangent_error(problem, contacting_state(problem), direction, 3e-8) < 1e-7


@pytest.mark.parametrize("plate", [None, PLATE], ids=["rigid plate", "elastic plate"])
@pytest.mark.parametrize("control", [Control(force=2.0), Control(closing=1e-3)], ids=["force", "closing"])
@pytest.mark.parametrize("contact", ["weighted", "nodal"])
def test_the_condensed_tangent_is_symmetric_and_gives_the_same_step(contact, control, plate):
    """From a state with pressure on idle nodes and a closing that is not yet the wanted one."""
    problem = problem_of(OBJECTS["sphere"], contact, plate=plate)
    problem.control = control
    x = contacting_state(problem)
    K, R = reference.dense(problem, x), problem.residual(x)
    problem.condensed = True
    S = reference.dense(problem, x)
    assert R[problem.finger.pressures][~problem._tangent_set].any()
    assert np.abs(K - K.T).max() > 1e-3 * np.abs(K).max()
    assert np.abs(S - S.T).max() < 1e-14 * np.abs(S).max()
    step = np.linalg.solve(K, R)
    np.testing.assert_allclose(np.linalg.solve(S, problem.right_side(R)), step, atol=1e-9 * np.abs(step).max())


@pytest.mark.parametrize("symmetry", [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("element", ["hex8", "hex27"])
def test_a_confined_pad_pressed_flat(element, symmetry):
    """``F = diag(1, 1, l)`` has the nominal stress ``P33 = G (1 - l^-3)``."""
    problem = problem_of(reference.plane, element=element, symmetry=symmetry)
    pad, squeeze = problem.pad, 2e-3
    stretch = 1 - squeeze / SIZE[2]
    pressure = -G * (1 - stretch**-3)
    problem.control = Control(force=pressure * SIZE[0] * SIZE[1])
    x = np.zeros(problem.size)
    vertical = pad.dofs[:, 2]
    x[vertical] = -squeeze * pad.nodes[:, 2] / SIZE[2]
    x[pad.closing_dof + 1 :] = pressure / problem.finger.kappa
    R = problem.residual(x)
    scale = problem.control.force
    assert abs(R[pad.closing_dof]) < 1e-13 * scale
    assert np.abs(R[pad.closing_dof + 1 :]).max() < 1e-13 * scale
    assert np.abs(R[vertical]).max() < 1e-13 * scale
    assert problem.normal_force(x) == pytest.approx(scale, rel=1e-13)
    nodal, gap, points = problem.contact_state(x)
    assert nodal == pytest.approx(pressure, rel=1e-13)
    assert np.abs(gap).max() < 1e-15
    assert points.force / pad.share == pytest.approx([0, 0, scale], rel=1e-13, abs=1e-12)
    det, strain, _ = problem.foam.strains(x, np.eye(3))
    assert det == pytest.approx(stretch, rel=1e-13)
    assert strain == pytest.approx(1 - stretch, rel=1e-12)


def test_a_row_switches_between_pressure_and_gap_and_steps_are_shortened_by_closing_and_by_squeezing():
    """``A l - max(0, A l - G)`` is ``A l`` where the pad is off the object, and the weighted gap where it presses."""
    problem = problem_of(reference.plane)
    pad = problem.pad
    for closing in (-1e-3, 1e-3):
        x = np.zeros(problem.size)
        x[pad.dofs[:, 2]] = closing
        pressures = slice(pad.closing_dof + 1, None)
        x[pressures] = 0.3e-3
        expected = pad.node_area * (0.3e-3 if closing < 0 else -closing)
        assert problem.residual(x)[pressures] == pytest.approx(problem.finger.kappa * expected, rel=1e-12)
    x = np.zeros(problem.size)
    x[pad.dofs[pad.contact_nodes, 2]] = -1.5 * SIZE[2]
    assert np.isnan(problem.residual(x)).all()
    x, step = np.zeros((2, problem.size))
    assert problem.shorten(x, step) == 1
    step[pad.dofs[:, 2]] = -SIZE[2]  # the whole pad moves: no element is squeezed, but the closing is too long
    assert problem.shorten(x, step) == pytest.approx(0.1)
    step[:] = 0
    step[pad.dofs[pad.contact_nodes, 2]] = SIZE[2]  # x - step: the contact face is pushed through the plate
    factor = problem.shorten(x, step)
    assert 0.05 < problem.foam.strains(x - factor * step, np.eye(3))[0] < 1
    assert problem.foam.strains(x - 2 * factor * step, np.eye(3))[0] < 0.05
