"""Payload of a parallel gripper: closed forms, directions by brute force, and a squeeze that is not borne."""

from __future__ import annotations

import numpy as np
import pytest

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.bodies import PolytopeBody
from softjaw.scoring.contact import SoftContact, contact_axes
from softjaw.scoring.payload import payload

F, MU, E, D = 5.0, 0.8, 0.006, 0.06
BODY = Ellipsoid(np.array([MU, MU, MU * E]))


def pair(offset=0.0, bodies=(BODY, BODY), tilt=0.0):
    """Contacts at x = -D/2 and D/2 that press towards each other; ``offset`` apart along z, tilted about y [rad]."""
    one = contact_axes([np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0])
    two = contact_axes([-np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0])
    return [
        SoftContact(np.array([-D / 2, 0, offset / 2]), one, bodies[0]),
        SoftContact(np.array([D / 2, 0, -offset / 2]), two, bodies[1]),
    ]


def test_along_the_closing_axis_one_finger_takes_the_whole_drive():
    assert payload(pair(), F, [0, 0, 0], [1, 0, 0]).force == pytest.approx(2 * F, rel=1e-6)
    assert payload(pair(), F, [0, 0, 0], [-1, 0, 0]).force == pytest.approx(2 * F, rel=1e-6)


def test_across_it_friction_of_both_fingers_holds():
    found = payload(pair(), F, [0, 0, 0])
    assert payload(pair(), F, [0, 0, 0], [0, 0, -1]).force == pytest.approx(2 * MU * F, rel=1e-6)
    # a load that pulls along the axis too takes force from one finger; friction has to stay even, or it would turn
    assert found.force == pytest.approx(2 * MU * F / np.hypot(1.0, MU), rel=1e-5)
    assert abs(found.direction[0]) == pytest.approx(MU / np.hypot(1.0, MU), rel=1e-3)


@pytest.mark.parametrize("arm", [0.003, 0.02])
def test_a_load_beside_the_contacts_turns_them(arm):
    """Along y at an arm along z the torque about x is borne as torsion: force and torque share one ellipse."""
    force = 2 * MU * F / np.hypot(1.0, arm / E)
    assert payload(pair(), F, [0, 0, arm], [0, 1, 0]).force == pytest.approx(force, rel=1e-6)
    assert payload(pair(), F, [0, 0, arm]).force <= force


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_couple_of_the_squeeze_uses_up_friction(share):
    """Forces that pass each other by h make a couple F h; friction along z, at the arms D / 2, takes it."""
    found = payload(pair(share * MU * D), F, [0, 0, 0], [0, 1, 0])
    assert found.force == pytest.approx(2 * MU * F * np.sqrt(1 - share**2), rel=1e-5)
    assert found.shortfall == 0


def test_a_squeeze_that_is_not_borne_holds_nothing():
    found = payload(pair(1.05 * MU * D), F, [0, 0, 0])
    assert found.force == 0.0
    assert found.shortfall > 1e-3
    assert payload(pair(1.05 * MU * D), F, [0, 0, 0], [0, 0, -1]).force == 0.0


def test_contacts_that_slip_out_of_a_wedge_hold_nothing():
    assert payload(pair(tilt=0.9 * np.arctan(MU)), F, [0, 0, 0]).force > 0
    assert payload(pair(tilt=1.1 * np.arctan(MU)), F, [0, 0, 0]).force == 0.0


def test_payload_grows_with_the_force_and_does_not_depend_on_the_frame():
    from scipy.spatial.transform import Rotation

    turn, shift = Rotation.random(random_state=3).as_matrix(), np.array([0.1, -0.2, 0.05])
    contacts = pair(0.01)
    moved = [SoftContact(turn @ c.position + shift, c.axes @ turn.T, c.body) for c in contacts]
    com = np.array([0.004, 0.01, -0.02])
    force = payload(contacts, F, com).force
    assert payload(moved, F, turn @ com + shift).force == pytest.approx(force, rel=1e-4)
    assert payload(contacts, 2 * F, com).force == pytest.approx(2 * force, rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_no_direction_of_many_is_worse(seed):
    """Brute force: hulls of the points of both bodies, one linear programme per direction."""
    rng = np.random.default_rng(seed)
    hulls = tuple(PolytopeBody(np.vstack([v, -v])) for v in rng.normal(size=(2, 12, 3)) * [MU, MU, MU * E])
    contacts = pair(0.004, hulls, 0.1)
    com = rng.normal(size=3) * 0.01
    found = payload(contacts, F, com)
    d = rng.normal(size=(60, 3))
    every = [payload(contacts, F, com, direction).force for direction in d]
    assert found.force <= min(every) * (1 + 1e-6)
    assert found.force > 0.8 * min(every)
    assert payload(contacts, F, com, found.direction).force == pytest.approx(found.force, rel=1e-5)
