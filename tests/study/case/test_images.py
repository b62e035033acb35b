"""Fingers before which the object looks the same, or like its mirror image: solved once, as if solved twice."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from softjaw.study.case.build import build_object
from softjaw.study.case.candidates import candidates
from softjaw.study.case.model import approach, image_signs
from softjaw.study.case.pressing import OnRigid
from softjaw.study.scene import parse_scene

SCENE = """
[object]
shape = "mesh"
mesh = "{mesh}"
unit = "m"
[gripper]
elements = [6, 4, 2]
[candidates]
poses = [{{ point_mm = [0, 0, 4], approach = [1, 0, 0], long_side = [0, 0, 1] }}]
[load]
normal_force_n = [4]
[effects]
friction_pressure_coupling = "none"
"""


@pytest.fixture(scope="module")
def lopsided(tmp_path_factory):
    """A lopsided ball: before one finger it is the mirror image of what is before the other, in single precision."""
    path = tmp_path_factory.mktemp("mesh") / "ball.stl"
    mesh = trimesh.creation.icosphere(4, 0.03)
    x, y, z = mesh.vertices.T
    mesh.vertices = np.column_stack([x, y * (1 + 4 * y), z * (1 + 3 * z)])
    mesh.export(path)
    return parse_scene(SCENE.format(mesh=path))


def test_the_other_finger_is_the_mirror_image(lopsided):
    """Beyond the mesh's own asymmetry of facets it is x of the object that changes its sign: y of the pad."""
    poses = candidates(lopsided)[0].poses
    _, other = fingers = [approach(build_object(lopsided.object), pose, lopsided.gripper) for pose in poses]
    assert image_signs(*fingers, lopsided.gripper.pad_size) == (1, -1)
    both = OnRigid(lopsided, fingers, poses, coarser=False)
    assert len(both.parts) == 1
    _, other = both.contacts([next(part.load_path([4.0])) for part in both.parts])
    alone = OnRigid(lopsided, fingers[::-1], poses[::-1], coarser=False)
    solved, _ = alone.contacts([next(part.load_path([4.0])) for part in alone.parts])
    for name in ("f_x", "f_y", "tau_z", "e_n"):
        assert getattr(other.limits["ccm"], name) == pytest.approx(getattr(solved.limits["ccm"], name), rel=1e-4)
    np.testing.assert_allclose(other.origin, solved.origin, atol=1e-6)
    np.testing.assert_allclose(other.normal, solved.normal, atol=1e-4)
    np.testing.assert_allclose(other.pressure_wrench, solved.pressure_wrench, atol=1e-4)
