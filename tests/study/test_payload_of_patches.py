"""Payload of solved patches against brute force: no direction of very many is worse than the worst that was found."""

from __future__ import annotations

import numpy as np
import pytest

from softjaw.fem.objects.gap import Pose
from softjaw.friction.patch import ContactPatch
from softjaw.scoring.bodies import PolytopeBody
from softjaw.scoring.payload import GRAVITY, payload
from softjaw.study.case.contact import Contact
from softjaw.study.case.limit_surface import sampled_wrenches
from tests.study.test_pipeline import BOX, CONE, MU, OVAL, solved

SHAPES = [(CONE, "[60]", "[0]"), (BOX, "[20]", "[7]"), (OVAL, "[10]", "[30]")]


def grasp(shape, station, angle):
    """Contacts of a case as payloads take them, their pressure, and the mass that the case says is held."""
    [(_, [result])] = solved(shape, "task.centre_of_mass_mm=[0, 0, 0]", stations=station, angles=angle, forces="[4]")
    values, patch, contacts = result.values, result.patch, []
    for f in range(2):
        faces = ContactPatch(patch["centroid"][f], patch["area"][f], patch["normal"][f], patch["pressure"][f])
        pose = Pose(np.array(values["fingers/pose_rotation"][f]), np.array(values["fingers/pose_origin"][f]))
        contacts.append(Contact(faces, MU, pose))
    wrenches = [MU * sampled_wrenches(c, "ccm", 500)[1][:500, [0, 1, 5]] for c in contacts]
    soft = [c.soft(PolytopeBody(np.vstack([w, -w]))) for c, w in zip(contacts, wrenches, strict=True)]
    return soft, [c.pressure_wrench for c in contacts], values["maps/payload"][0] * GRAVITY


@pytest.mark.parametrize(
    "directions", [pytest.param(100, id="some"), pytest.param(100_000, marks=pytest.mark.long, id="very many")]
)
@pytest.mark.parametrize(("shape", "station", "angle"), SHAPES, ids=["cone", "box", "oval"])
def test_no_direction_is_worse_than_the_worst(shape, station, angle, directions):
    soft, pressure, force = grasp(shape, station, angle)
    found = payload(soft, pressure, np.zeros(3))
    # stored faces have no corners, so the contact frame of a coarse patch may begin elsewhere
    assert found.force == pytest.approx(force, rel=5e-2)
    rng = np.random.default_rng(0)
    tries = rng.normal(size=(directions, 3))
    held = np.array([payload(soft, pressure, np.zeros(3), d).force for d in tries])
    assert found.borne == (force > 0)
    assert found.force <= held.min() * (1 + 1e-6)
    assert payload(soft, pressure, np.zeros(3), found.direction).force == pytest.approx(found.upper, rel=2e-3)
    if directions > 1000 and found.borne:
        assert held.min() <= found.upper * 1.01
