"""Press: two solvers, symmetry, path, units and repeats give one answer, and wrong answers are refused."""

from functools import cache, partial

import numpy as np
import pytest

from softjaw.fem.contact.press import Press
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.materials import material
from softjaw.fem.objects.shapes import EllipticCylinder
from softjaw.fem.petsc import PETSc
from tests.fem import reference
from tests.fem.reference import BALL, OVAL, SIZE

G = 0.040e6
FORCES = [1.0, 3.0, 10.0, 20.0]
VI = {"contact_snes_type": "vinewtonrsls"}
pad_of = partial(reference.pad_of, (12, 6, 4))


@cache
def solved(gap=OVAL, forces=tuple(FORCES)):
    return tuple(Press(pad_of(), gap).load_path(forces))


def relative(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


@pytest.mark.parametrize("contact", ["weighted", "blended", "nodal"])
@pytest.mark.parametrize("element", ["hex8", "hex27"])
@pytest.mark.parametrize("gap", [OVAL, BALL], ids=["cylinder", "sphere"])
def test_active_set_and_bounds_agree(gap, element, contact):
    pad = reference.pad_of((8, 4, 2) if element == "hex27" else (12, 6, 4), contact=contact, element=element)
    for one, other in zip(Press(pad, gap).load_path(FORCES), Press(pad, gap, VI).load_path(FORCES), strict=True):
        assert one.closing == pytest.approx(other.closing, rel=3e-9)
        assert relative(one.pressure, other.pressure) < 3e-9
        assert relative(one.unknowns, other.unknowns) < 3e-9


def test_units_do_not_matter():
    """The same pad in mm, N and MPa."""
    mm = pad_of(size=tuple(1e3 * s for s in SIZE), law=material("blatz_ko", G * 1e-6))
    gap = reference.placed(EllipticCylinder(25.0, 20.0, 100.0), reference.facing(25.0))
    for si, other in zip(solved(), Press(mm, gap).load_path(FORCES), strict=True):
        assert other.closing * 1e-3 == pytest.approx(si.closing, rel=1e-9)
        assert relative(other.pressure * 1e6, si.pressure) < 1e-9
        assert other.work.iterations == si.work.iterations


def test_a_uniform_column_has_the_state_of_its_law_also_where_no_newton_step_is_needed():
    """Hyperfoam of one term without lateral strain between flat faces: nominal stress 2 mu (1/l - l^3) / 4.

    The coarser mesh's state is that of the finer one already, so nothing is factorised before it is judged.
    """
    law = material("hyperfoam", poisson_ratio=0.0, shear_moduli=[20e3], exponents=[4.0])
    coarse, fine = (Press(reference.pad_of(n, law=law), reference.plane) for n in ((6, 4, 2), (12, 6, 4)))
    for force in (5.0, 30.0):
        state = fine.at(force, [coarse.at(force)])
        stretch = 1.0 - state.closing / SIZE[2]
        assert 1e4 * (1.0 / stretch - stretch**3) == pytest.approx(force / (SIZE[0] * SIZE[1]), rel=1e-6)


def pulls(press, x):
    """A node pulls, its neighbours press more: the forces still balance."""
    p, area = x[press.pad.closing_dof + 1 :], press.pad.node_area
    i, j = np.argsort(p)[-2:]
    p[j] += 1.1 * p[i] * area[i] / area[j]
    p[i] *= -0.1


def penetrates(press, x):
    x[press.pad.dofs[press.pad.contact_nodes[0], 2]] += 1e-7


def lifts(press, x):
    x[press.pad.dofs[press.pad.contact_nodes[0], 2]] -= 1e-6


def is_unbalanced(press, x):
    x[press.pad.closing_dof + 1 :] *= 1 + 1e-7


def inner_dof(pad):
    inside = (pad.nodes[:, 2] < -1e-6) & (pad.dofs[:, 2] < pad.closing_dof)
    return pad.dofs[np.flatnonzero(inside)[0], 2]


def is_unbalanced_inside(press, x):
    x[inner_dof(press.pad)] += 1e-8


def is_inverted(press, x):
    x[inner_dof(press.pad)] += 0.02


@pytest.mark.parametrize(("tamper", "law"), [
    (pulls, "tension in the contact"), (penetrates, "the pad penetrates"), (lifts, "pressure and gap"),
    (is_unbalanced, "the force balance is off"), (is_inverted, "an element is inverted"),
    (is_unbalanced_inside, "a node is out of balance"),
])  # fmt: skip
def test_wrong_states_are_refused_whatever_the_solver_says(tamper, law):
    press = Press(pad_of(), reference.plane)
    solve = press.solver.solve

    def wrong(x, tolerance, *limits):
        x, done = solve(x, tolerance, *limits)
        if press.problem.control.force is not None:
            tamper(press, x)
        return x, done

    press.solver.solve = wrong
    with pytest.raises(CheckError, match=law):
        list(press.load_path([5.0]))


def test_checks_of_a_right_state_are_small_and_a_step_that_fails_is_cut_to_the_same_answer():
    for pressed in solved():
        checks = pressed.checks
        assert max(checks.force_balance, checks.adhesion, checks.penetration, checks.complementarity) < 1e-11
        assert 0 < checks.min_det_f < 1
        assert 0 < checks.max_strain < 0.5
        assert 0 < checks.ellipticity < 1
    # Three iterations per step do not reach 20 N at once.
    pad = pad_of()
    (free,) = solved(forces=(20.0,))
    first, last = Press(pad, OVAL).load_path([1.0, 20.0])
    short = Press(pad, OVAL)
    ladder = short.load_path([1.0, 20.0])
    next(ladder)
    solve = short.solver.solve
    short.solver.solve = lambda x, tolerance, *limits: solve(x, tolerance, 3)
    pressed = next(ladder)
    assert pressed.work.halvings > 0
    assert pressed.work.steps > last.work.steps
    for state in (last, pressed):
        assert state.closing == pytest.approx(free.closing, rel=1e-9)
        assert relative(state.pressure, free.pressure) < 1e-9
    assert first.work.halvings == last.work.halvings == 0


@pytest.mark.parametrize(("options", "mu", "count"), [
    ({}, None, "MatCholFctrNum"), ({"contact_pc_type": "lu"}, None, "MatLUFactorNum"), (VI, None, "MatLUFactorNum"),
    ({}, 0.5, "MatLUFactorNum"),
], ids=["symmetric", "on demand", "bounds", "friction"])  # fmt: skip
def test_symmetric_tangents_have_symmetric_factors(options, mu, count):
    set_before = dict(PETSc.Options().getAll())
    press = Press(pad_of(), OVAL, options, mu=mu)
    before = factorisations()
    list(press.load_path([1.0]))
    assert {name for name, number in factorisations().items() if number > before[name]} == {count}
    assert dict(PETSc.Options().getAll()) == set_before  # options are taken back


def factorisations():
    return {name: PETSc.Log.Event(name).getPerfInfo()["count"] for name in ("MatLUFactorNum", "MatCholFctrNum")}


def test_the_ladder_goes_on_with_the_fallback_where_the_pad_has_no_solution():
    pad, nodal = pad_of(), pad_of(contact="nodal")
    press = Press(pad, OVAL, fallbacks=(nodal,))
    ladder = press.load_path(FORCES)
    assert next(ladder).pad is pad

    def fails(*_):
        raise ConvergenceError("cycles")

    press.solver.solve = fails
    rest = list(ladder)
    alone = list(Press(nodal, OVAL).load_path(FORCES))[1:]
    for pressed, expected in zip(rest, alone, strict=True):
        assert pressed.pad is nodal
        assert pressed.closing == pytest.approx(expected.closing, rel=1e-9)
        assert relative(pressed.pressure, expected.pressure) < 1e-9
    assert rest[0].work.halvings > 0
