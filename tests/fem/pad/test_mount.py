"""A rigid backing plate that may tilt: equilibrium of its moments, limits, symmetry."""

import numpy as np
import pytest

from softjaw.fem.contact.press import Press
from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.shapes import EllipticCylinder
from softjaw.fem.pad.shape import TiltingMount
from tests.fem import reference
from tests.fem.reference import FOAM, SIZE

GLUE = 1e4 * FOAM.young_modulus / SIZE[2]
CYLINDER = EllipticCylinder(0.025, 0.025, 0.2)


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
