"""The pad for small strains: the condensed solve is the full one of linear material, and the limit of every foam."""

from functools import lru_cache

import numpy as np
import pytest

from softjaw.fem.contact.extract import extract
from softjaw.fem.contact.linear_press import FrontSolver, linear_press
from softjaw.fem.contact.press import Press
from softjaw.fem.contact.problem import ContactProblem, Control
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.materials import material
from softjaw.fem.objects.shapes import EllipticCylinder, Sphere
from softjaw.fem.pad.linear_pad import CondensedPad, departure, linearised
from softjaw.fem.pad.mesh import Pad, PadShape
from softjaw.fem.pad.spring_bed import SpringBed
from softjaw.friction.frame import contact_frame, in_frame
from softjaw.friction.wrench import friction_limits
from tests.fem import reference

G = 0.040e6
SIZE = (0.050, 0.022, 0.015)
FOAM = material("blatz_ko", G)
OVAL = reference.placed(EllipticCylinder(0.025, 0.020, 0.1), reference.facing(0.025))
BALL = reference.placed(Sphere(0.025), reference.facing(0.025))
FORCES = [1.0, 10.0, 20.0]


@lru_cache
def pad_of(elements=(8, 4, 3), symmetry=(True, True), contact="weighted", element="hex8"):
    return Pad(PadShape(SIZE, elements, element=element), FOAM, symmetry, contact)


@lru_cache
def condensed(*arguments, **choices):
    return CondensedPad(linearised(pad_of(*arguments, **choices)))


@pytest.mark.parametrize(
    ("elements", "symmetry", "contact", "element"),
    [
        ((8, 4, 3), (True, True), "weighted", "hex8"),
        ((8, 4, 3), (False, True), "nodal", "hex8"),
        ((5, 3, 2), (False, False), "weighted", "hex8"),
        ((4, 4, 2), (True, True), "weighted", "hex27"),
    ],
)
@pytest.mark.parametrize("gap", [OVAL, BALL], ids=["cylinder", "sphere"])
def test_condensed_and_full_solve_are_the_same(gap, elements, symmetry, contact, element):
    """Same mesh, same linear material: unknowns of the whole pad, not the front's alone, by PETSc and by us."""
    pad = condensed(elements, symmetry, contact, element)
    for one, other in zip(linear_press(pad, gap).ladder(FORCES), Press(pad.pad, gap).ladder(FORCES), strict=True):
        size = np.abs(other.unknowns).max()
        assert np.abs(one.unknowns - other.unknowns).max() < 1e-9 * size
        assert np.abs(one.pressure - other.pressure).max() < 1e-9 * other.pressure.max()
        assert np.abs(one.points.position - other.points.position).max() < 1e-9 * size
        assert one.checks.max_strain == pytest.approx(other.checks.max_strain, rel=1e-8)
        assert one.iterations <= other.iterations + 2


def test_fallback_takes_nodal_gaps_with_the_same_factors():
    press = linear_press(condensed(), OVAL, linearised(pad_of(contact="nodal")))
    press._change(press.fallback)
    (one,), (other,) = press.ladder([3.0]), linear_press(condensed(contact="nodal"), OVAL).ladder([3.0])
    assert one.pad.contact == "nodal"
    np.testing.assert_allclose(one.pressure, other.pressure, rtol=1e-9, atol=1e-9 * other.pressure.max())


def test_without_poisson_a_plane_presses_evenly():
    """Columns side by side: ``p = F / area`` everywhere, and a travel of ``p thickness / E``."""
    pad = Pad(PadShape(SIZE, (8, 4, 3)), material("neo_hookean", G, 0.0))
    (state,) = linear_press(CondensedPad(linearised(pad)), reference.plane).ladder([5.0])
    p = 5.0 / (SIZE[0] * SIZE[1])
    np.testing.assert_allclose(state.pressure, p, rtol=1e-9)
    assert state.travel == pytest.approx(p * SIZE[2] / (2.0 * G), rel=1e-9)


def test_newtons_step_removes_what_is_left_over_to_second_order():
    """Finite differences along the step: the residual shrinks by the step's share, with an error of second order."""
    problem = ContactProblem(condensed().pad, BALL)
    problem.control = Control(force=8.0)
    solver = FrontSolver(problem, condensed())
    x = SpringBed(problem.pad, BALL).guess(0.004)
    at = solver._front(x[condensed().dofs], x[problem.pad.travel_dof], x[solver._pressures])
    problem.travel_step = 1.0  # the guard would shorten the step
    whole = [new - old for new, old in zip(solver._step(at), (at.u, at.travel, at.l), strict=True)]

    def left(share):
        now = solver._front(*(old + share * d for old, d in zip((at.u, at.travel, at.l), whole, strict=True)))
        assert (now.active == at.active).all()
        return np.concatenate([now.off, [now.drive], now.gap[at.active] / problem.area[at.active]])

    errors = [np.abs(left(share) - (1.0 - share) * left(0.0)).max() for share in (1e-2, 1e-3)]
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.1)
    assert errors[1] < 1e-5 * np.abs(left(0.0)).max()


@pytest.mark.parametrize("gap", [reference.plane, OVAL], ids=["plane", "cylinder"])
def test_every_foam_becomes_linear_at_small_forces(gap):
    """With the same nodes in contact pressures of Blatz-Ko foam are off by a share that falls with the force."""
    off = {}
    for force in (0.2, 0.1):
        (linear,), (foam,) = linear_press(condensed(), gap).ladder([force]), Press(pad_of(), gap).ladder([force])
        off[force] = np.abs(linear.pressure - foam.pressure).max() / foam.pressure.max()
        assert 0 < off[force] < departure(FOAM, linear.checks.max_strain)
    assert off[0.2] / off[0.1] == pytest.approx(2.0, rel=0.1)


def test_departure_of_blatz_ko_foam():
    """Confined, ``P = G (1 - l^-3)`` and the modulus is ``3 G``."""
    assert departure(FOAM, 0.1) == pytest.approx((0.9**-3 - 1.0) / 0.3 - 1.0, rel=1e-12)
    assert departure(material("linear", G), 0.5) == 0.0
    assert departure(FOAM, 0.0) == 0.0
    assert departure(FOAM, 1.2) == np.inf


def test_refuses_foam_and_hopeless_forces():
    with pytest.raises(ValueError, match=r"linearised\(pad\)"):
        CondensedPad(pad_of())
    with pytest.raises(CheckError, match="an element is inverted"):
        list(linear_press(condensed(), BALL).ladder([60.0]))
    with pytest.raises(ConvergenceError, match="no first contact"):
        list(linear_press(condensed(), BALL).ladder([2000.0]))


def e_n(state):
    patch = extract(state.pad, state)
    return friction_limits(in_frame(patch, contact_frame(patch, np.array([1.0, 0.0, 0.0]))), 1.0, "curved").e_n


@pytest.mark.long
@pytest.mark.parametrize(
    "law",
    [
        FOAM,
        material("neo_hookean", G, 0.3),
        material("hyperfoam", 0.0, 0.1, [G], [8.0]),
        material("hyperfoam", 0.0, 0.1, [G], [20.0]),
        material("hyperfoam", 0.0, 0.25, [G], [-4.0]),
    ],
    ids=["Blatz-Ko", "neo-Hookean", "alpha 8", "alpha 20", "alpha -4"],
)
def test_error_of_e_n_stays_below_six_tenths_of_the_departure(law):
    """What `study.case.pad_level` chooses by: 7 objects, 4 forces each."""
    pad = Pad(PadShape(SIZE, (16, 8, 5)), law, (True, True))
    front = CondensedPad(linearised(pad))
    gaps = [reference.placed(EllipticCylinder(0.025, b, 0.1), reference.facing(0.025)) for b in (0.01, 0.02, 0.06)]
    gaps += [reference.placed(Sphere(R), reference.facing(R)) for R in (0.025, 0.04, 0.3, 1.0)]
    seen = 0
    for gap in gaps:
        forces = [0.1, 0.3, 1.0, 3.0]
        for linear, foam in zip(linear_press(front, gap).ladder(forces), Press(pad, gap).ladder(forces), strict=True):
            off = abs(e_n(linear) / e_n(foam) - 1.0)
            assert off <= 0.6 * departure(law, linear.checks.max_strain), (linear.force, off)
            seen += 1
    assert seen == 28
