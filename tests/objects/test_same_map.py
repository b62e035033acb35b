"""A body, and the same triangles as users' files have them: one map, to half a per cent."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import softjaw as sj
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


def soup(body: trimesh.Trimesh) -> trimesh.Trimesh:
    """Triangles that share no corner, every second one turned."""
    faces = body.faces.copy()
    faces[::2] = faces[::2, ::-1]
    return trimesh.Trimesh(body.vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3), process=False)


def doubled(body: trimesh.Trimesh) -> trimesh.Trimesh:
    """Every triangle twice, once the other way round."""
    return trimesh.Trimesh(body.vertices, np.concatenate([body.faces, body.faces[:, ::-1]]), process=False)


def with_inner_wall(body: trimesh.Trimesh) -> trimesh.Trimesh:
    """A wall 1.5 mm inside the outer one."""
    inner = trimesh.Trimesh(body.vertices - 0.0015 * body.vertex_normals, body.faces[:, ::-1], process=False)
    return trimesh.util.concatenate([body, inner])


def with_holes(body: trimesh.Trimesh) -> trimesh.Trimesh:
    """Three per cent of the triangles are missing, away from the pads."""
    x, y, z = body.triangles_center.T
    away = np.flatnonzero((np.abs(y) > np.abs(x)) | (z < 0.02) | (z > 0.09))
    gone = np.random.default_rng(1).choice(away, int(0.03 * len(body.faces)), replace=False)
    return trimesh.Trimesh(body.vertices, np.delete(body.faces, gone, axis=0), process=False)


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
@pytest.mark.parametrize("kind", [soup, doubled, with_inner_wall, with_holes, lambda _: slabs(5)],
                         ids=["soup", "doubled", "inner wall", "holes", "slabs"])  # fmt: skip
def test_the_map_does_not_depend_on_how_the_triangles_are_given(kind, sound, tmp_path):
    np.testing.assert_allclose(values(tmp_path, "other", kind(outline_body())), sound, rtol=5e-3)
