"""Gaps measured between Gauss points and nodes: their errors of e_n are a small part of those of either kind."""

from pathlib import Path

import numpy as np
import pytest

from softjaw.fem.contact.press import Press
from softjaw.fem.pad.mesh import RULES, Pad
from softjaw.fem.pad.shape import PadShape
from softjaw.study.case.build import build_object
from softjaw.study.case.model import approach
from softjaw.study.case.poses import axis_poses
from softjaw.study.scene import parse_scene
from tests.fem import reference
from tests.fem.reference import FOAM

BOTTLE = Path(__file__).parents[3] / "jobs" / "bottle-rigid.toml"
FORCES = (1.0, 2.0, 4.0, 7.0, 13.0)
# e_n [mm] at 1, 2, 4, 7, 13 N with hex27, 16 x 24 x 4 elements, twice as thick at the back as at the contact face
KNOWN = {40.0: (4.2641, 5.0145, 5.8450, 6.5922, 7.5044), 148.5: (3.3351, 3.9995, 4.6951, 5.2494, 5.8079)}


def errors(station, rule):
    """Relative errors of e_n of the usual mesh ``(forces,)``."""
    scene = parse_scene(BOTTLE.read_text(), BOTTLE, [])
    finger = approach(build_object(scene.object), axis_poses(1e-3 * station, 0.0, 0.0)[0], scene.gripper)
    pad = Pad(PadShape(scene.gripper.pad_size, (20, 10, 6)), FOAM, (False, True), rule)
    return np.array([1e3 * reference.e_n(s) for s in Press(pad, finger.gap).load_path(FORCES)]) / KNOWN[station] - 1


@pytest.mark.long
@pytest.mark.parametrize("station", KNOWN)
def test_errors_of_both_kinds_cancel(station):
    weighted, blended, nodal = (errors(station, rule) for rule in RULES)
    assert (weighted < -0.004).all()
    assert (nodal > 0.004).all()
    assert np.abs(blended).max() < 0.005


def test_pressures_at_nodes_are_those_of_a_smooth_pressure():
    """Forces ``int N_i p`` of p = cos(2 x), in closed form, to fourth order; to second with Gauss points or nodes."""

    def wrong(rule, n):
        pad = Pad(PadShape((2.0, 1.0, 1.0), (n, 1, 1)), FOAM, contact=rule)
        p = np.cos(2 * pad.nodes[pad.face_nodes, 0])
        forces = np.bincount(pad.face_nodes.ravel(), ((pad.face_area * (p @ pad.face_N.T)) @ pad.face_N).ravel())
        h, x = 2.0 / n, pad.nodes[pad.contact_nodes, 0]
        exact = 0.5 * h * np.cos(2 * x) * (np.sin(h) / h) ** 2
        return np.abs(forces[pad.contact_nodes] - exact)[np.abs(x) < 0.99].max() / h

    for rule, order in (("weighted", 2), ("nodal", 2), ("blended", 4)):
        assert np.log2(wrong(rule, 16) / wrong(rule, 32)) == pytest.approx(order, abs=0.1)
