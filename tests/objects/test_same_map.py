"""A body, and the same triangles as users' files have them: one map, to half a per cent."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import softjaw as sj
from tests.fem.test_triangles import KINDS
from tests.objects.bodies import outline_body, slabs

SCENE = """
[object]
shape = "mesh"
mesh = "{name}.stl"
unit = "m"
[gripper]
elements = [16, 8, 5]
[candidates]
poses = [{{ point_mm = [0, 0, 55], approach = [-1, 0, 0], long_side = [0, 0, 1] }}]
[load]
normal_force_n = [5]
"""


def values(folder, name: str, mesh: trimesh.Trimesh) -> np.ndarray:
    """e_n [m], quality and payload [kg] of one grasp."""
    mesh.export(folder / f"{name}.stl")
    (folder / f"{name}.toml").write_text(SCENE.format(name=name))
    case = sj.press(sj.Scene.from_file(folder / f"{name}.toml"), candidate=0, force=5.0)
    return np.array([case.e_n, case.quality, case.payload])


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return values(tmp_path_factory.mktemp("sound"), "closed", outline_body())


@pytest.mark.long
@pytest.mark.parametrize("kind", [*KINDS, "slabs"])
def test_the_map_does_not_depend_on_how_the_triangles_are_given(kind, sound, tmp_path):
    body = outline_body()
    mesh = slabs(5) if kind == "slabs" else trimesh.Trimesh(*KINDS[kind](body.vertices, body.faces), process=False)
    np.testing.assert_allclose(values(tmp_path, "other", mesh), sound, rtol=5e-3)
