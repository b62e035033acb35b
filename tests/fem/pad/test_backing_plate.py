"""Backing plates: rigid ones that may tilt, elastic ones; beams in closed form, limits, symmetry, tangents."""

import numpy as np
import pytest

from softjaw.fem.contact.press import Press
from softjaw.fem.contact.problem import Control, SpringBed
from softjaw.fem.contact.rigid import RigidProblem
from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.shapes import EllipticCylinder
from softjaw.fem.pad.backing_plate import back_stiffness, relative_compliance
from softjaw.fem.pad.shape import BackingPlate, TiltingMount
from tests.fem import reference
from tests.fem.reference import BALL, FOAM, OVAL, SIZE, pad_of

GLUE = 1e4 * FOAM.young_modulus / SIZE[2]
CYLINDER = EllipticCylinder(0.025, 0.025, 0.2)
PLASTIC = BackingPlate(0.001, 2e9, 0.35, (0.02, 0.011))
X, Y = tuple(np.linspace(-0.025, 0.025, 21)), tuple(np.linspace(-0.011, 0.011, 5))
WHOLE = (False, False)


def beside(shift):
    facing = reference.facing(0.025)
    return reference.placed(CYLINDER, Pose(facing.rotation, facing.origin + shift * facing.rotation[:, 1]))


def pressed(gap, stiffness, force=4.0, symmetry=(False, False)):
    mount = None if stiffness is None else TiltingMount(stiffness, GLUE)
    pad = reference.pad_of((8, 6, 3), symmetry, "blended", back=mount)
    [state] = Press(pad, gap).load_path([force])
    return pad, state


def tilt(pad, state):
    """Angles about x and y of the pad's back [rad], and its height at the middle [m]."""
    back = np.abs(pad.nodes[:, 2] + SIZE[2]) < 1e-9
    x, y, _ = pad.nodes[back].T
    z = pad.displacement(state.unknowns)[back, 2]
    return np.linalg.lstsq(np.stack([y, -x, np.ones_like(x)], axis=1), z, rcond=None)[0]


def moment(points, middle):
    """Moment about x of the contact's forces on the pad, about the middle of its back [N m]."""
    arm = points.position - [0.0, 0.0, middle - SIZE[2]]
    return np.cross(arm, points.load[..., None] * points.normal).sum(axis=(0, 1))[0]


@pytest.mark.parametrize("stiffness", [0.5, 5.0])
def test_the_mount_bears_the_moment_of_the_contact(stiffness):
    """``k theta`` is the moment of the contact's forces about the middle of the back."""
    pad, state = pressed(beside(0.003), stiffness)
    theta, none, middle = tilt(pad, state)
    assert stiffness * theta == pytest.approx(moment(state.points, middle), rel=0.02)
    assert abs(theta) > 1e-4
    assert abs(none) < 1e-6


def test_a_stiff_mount_is_a_rigid_plate_a_soft_one_bears_no_moment_and_a_pad_pressed_in_its_middle_stays():
    rigid, stiff, soft = (pressed(beside(0.003), k) for k in (None, 1e4, 1e-3))
    assert stiff[1].closing == pytest.approx(rigid[1].closing, rel=1e-3)
    assert stiff[1].pressure == pytest.approx(rigid[1].pressure, abs=2e-3 * rigid[1].pressure.max())
    assert abs(tilt(*stiff)[0]) < 1e-5
    # a mount that bears no moment leaves none to the contact
    left, before = (moment(state.points, tilt(pad, state)[2]) for pad, state in (soft, rigid))
    assert abs(left) < 0.15 * abs(before)
    assert tilt(*soft)[0] * before > 0
    whole, half = (pressed(beside(0.0), 0.5, symmetry=own) for own in ((False, False), (True, False)))
    assert np.abs(tilt(*whole)[:2]).max() < 1e-9
    assert half[1].closing == pytest.approx(whole[1].closing, rel=1e-9)
    aside = [pressed(beside(0.002), 0.5, symmetry=own) for own in ((False, False), (True, False))]
    assert tilt(*aside[1])[0] == pytest.approx(tilt(*aside[0])[0], rel=1e-6)  # fitted to other nodes
    assert aside[1][1].closing == pytest.approx(aside[0][1].closing, rel=1e-9)


def wings(modulus):
    """Held across its whole width in the middle: two cantilevers of 20 mm; without Poisson they are beams."""
    return BackingPlate(0.001, modulus, 0.0, (0.010, 0.022))


def test_wings_bend_as_beams_a_plate_by_its_mean_deflection_and_one_no_larger_than_its_support_is_rigid():
    """``w = F L^3 / (3 E I)`` under a force at the end of a wing; the held part does not move."""
    E, L, b, t = 70e9, 0.020, 0.022, 0.001
    back = back_stiffness(X, Y, WHOLE, wings(E))
    force = np.zeros((len(X), len(Y), 3))
    force[0, :, 2] = np.array([0.125, 0.25, 0.25, 0.25, 0.125])
    u = np.zeros_like(force)
    u[back.free] = np.linalg.solve(back.K[:-1, :-1], force[back.free])
    assert u[0, :, 2].mean() == pytest.approx(L**3 / (3 * E * b * t**3 / 12), rel=0.005)
    assert not back.free[8:13].any()
    assert back.free[:8].all()
    # ``p L^5 / (20 E I)`` for the area under each wing's line, over the whole length and the foam's ``T / E``.
    E, L, t = 5e9, 0.020, 0.001
    mean = 2 * L**5 / (20 * E * t**3 / 12) / SIZE[0]
    assert relative_compliance(X, Y, WHOLE, wings(E), 0.015 / 1e5) == pytest.approx(mean / (0.015 / 1e5), rel=0.01)
    half, quarter = X[10:], Y[2:]
    whole = relative_compliance(X, Y, WHOLE, PLASTIC, 1e-7)
    assert relative_compliance(half, quarter, (True, True), PLASTIC, 1e-7) == pytest.approx(whole, rel=1e-9)
    K = back_stiffness(X, Y, WHOLE, PLASTIC).K
    approach = np.append(np.tile([0.0, 0.0, 1.0], (len(K) - 1) // 3), 1.0)
    assert np.abs(K @ approach).max() < 1e-9 * np.abs(K).max()
    np.testing.assert_allclose(K, K.T, atol=1e-14 * np.abs(K).max())  # sums of elements in any order
    values = np.linalg.eigvalsh(K)
    assert abs(values[0]) < 1e-12 * values[-1]  # the approach itself
    assert values[1] > 0
    # what is held ends where the finger does, wherever the lines of the pad's mesh lie
    meshes = ((40, 22), (14, 8), (12, 10), (7, 5))
    lines = ([tuple(np.linspace(-s / 2, s / 2, n + 1)) for s, n in zip(SIZE[:2], n_m, strict=True)] for n_m in meshes)
    fine, *coarse = (relative_compliance(*xy, WHOLE, PLASTIC._replace(support=(0.02, 0.01)), 1e-7) for xy in lines)
    assert coarse == pytest.approx([fine] * 3, rel=0.06)
    # The finger holds all of it: nothing bends, and the pad is that on a rigid backing plate.
    held, half = BackingPlate(0.001, 2e9, 0.35, (0.050, 0.022)), BackingPlate(0.001, 2e9, 0.35, (0.050, 0.020))
    assert relative_compliance(X, Y, WHOLE, held, 1e-7) == pytest.approx(0.0, abs=1e-12)
    assert relative_compliance(X[10:], Y[2:], (True, True), held, 1e-7) == pytest.approx(0.0, abs=1e-12)
    assert relative_compliance(X, Y, WHOLE, half, 1e-7) > 0.0
    (rigid,), (one,) = (Press(pad_of(back=sheet), OVAL).load_path([5.0]) for sheet in (None, held))
    assert one.pressure == pytest.approx(rigid.pressure, abs=1e-9 * rigid.pressure.max())


@pytest.mark.parametrize("gap", [OVAL, BALL], ids=["cylinder", "sphere"])
def test_quarter_and_full_pads_on_a_sheet_are_the_same(gap):
    full, quarter = pad_of(symmetry=WHOLE, back=PLASTIC), pad_of(back=PLASTIC)
    where = {tuple(np.round(x * 1e9).astype(int)): i for i, x in enumerate(full.nodes[full.contact_nodes])}
    same = [where[tuple(np.round(x * 1e9).astype(int))] for x in quarter.nodes[quarter.contact_nodes]]
    for one, other in zip(*(Press(pad, gap).load_path([2.0, 8.0]) for pad in (quarter, full)), strict=True):
        assert one.closing == pytest.approx(other.closing, rel=1e-9)
        assert np.abs(one.pressure - other.pressure[same]).max() < 1e-9 * other.pressure.max()


@pytest.mark.parametrize(("control", "back", "symmetry", "gap", "start"), [
    (Control(force=3.0), PLASTIC, (True, False), BALL, 0.003),
    (Control(closing=0.002), PLASTIC, (True, False), BALL, 0.003),
    (Control(force=2.0), TiltingMount(0.5, GLUE), WHOLE, beside(0.002), 0.002),
], ids=["force", "closing", "mount"])  # fmt: skip
def test_tangent_by_finite_differences(control, back, symmetry, gap, start):
    pad = pad_of((4, 2, 2), symmetry, back=back)
    problem = RigidProblem(pad, gap)
    problem.control = control
    x = SpringBed(pad, gap).guess(start)
    d = np.random.default_rng(1).normal(size=pad.size) * 1e-4
    assert reference.tangent_error(problem, x, d, 1e-3) < 1e-6


@pytest.mark.long
@pytest.mark.parametrize("gap", [OVAL, BALL, reference.plane], ids=["cylinder", "sphere", "plane"])
def test_what_a_rigid_sheet_neglects_stays_below_eight_tenths_of_its_relative_compliance(gap):
    """What `study.case.effects` chooses by, up to 13 N."""
    forces = [1.0, 5.0, 13.0]
    rigid = [reference.e_n(state) for state in Press(pad_of((16, 8, 5)), gap).load_path(forces)]
    lines = (tuple(np.linspace(0.0, side / 2, n // 2 + 1)) for side, n in zip(SIZE, (16, 8), strict=False))
    x, y = lines
    for modulus in (3e10, 5e9):
        sheet = BackingPlate(0.001, modulus, 0.3, (0.02, 0.01))
        compliance = relative_compliance(x, y, (True, True), sheet, SIZE[2] / FOAM.young_modulus)
        bending = Press(pad_of((16, 8, 5), back=sheet), gap).load_path(forces)
        for expected, state in zip(rigid, bending, strict=True):
            assert abs(reference.e_n(state) / expected - 1.0) <= 0.8 * compliance
