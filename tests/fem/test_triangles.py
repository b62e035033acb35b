"""Triangles of any kind: what is mended, which are neighbours, volume, and the same surface met from the same body."""

import numpy as np
import pytest
import trimesh

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.mesh_holes import solid
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.smooth_triangles import smooth_triangles
from softjaw.fem.objects.triangles import cleaned, neighbours
from tests.fem.test_facing_surface import BOX, in_box, side
from tests.objects.bad_meshes import doubled, lined, soup, turned
from tests.objects.bodies import outline_body, slabs

BALL = trimesh.creation.icosphere(2, 0.03)


def joined(*meshes):
    mesh = trimesh.util.concatenate(meshes)
    return np.array(mesh.vertices), np.array(mesh.faces)


@pytest.mark.parametrize("mesh", [
    (BALL.vertices, BALL.faces[:0]), (np.full((3, 3), np.nan), [[0, 1, 2]]), (BALL.vertices * 1e3, BALL.faces),
    (BALL.vertices * 1e-3, BALL.faces), (BALL.vertices * 0, BALL.faces),
])  # fmt: skip
def test_only_what_makes_no_object_is_refused(mesh):
    with pytest.raises(MeshError):
        cleaned(*mesh)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_triangles_without_finite_coordinates_are_left_out(value):
    points = np.array(BALL.vertices)
    points[7] = value
    points, triangles, notes, *_ = cleaned(points, np.array(BALL.faces))
    assert np.isfinite(points).all()
    assert 310 <= len(triangles) <= 320
    assert notes


def test_triangles_are_turned_outwards_specks_dropped_separate_parts_kept_and_one_side_stays_as_it_is():
    some = np.where(np.arange(len(BALL.faces))[:, None] < 5, BALL.faces[:, ::-1], BALL.faces)
    for faces in (BALL.faces[:, ::-1], some):
        mesh = cleaned(np.array(BALL.vertices), faces)
        assert trimesh.Trimesh(mesh.points, mesh.triangles, process=False).volume > 0
        assert mesh.closed
        assert len(mesh.notes) == 1
    inner, speck = BALL.copy().apply_scale(0.93), trimesh.creation.icosphere(0, 2e-4).apply_translation([0.05, 0, 0])
    assert len(cleaned(*joined(BALL, inner, speck)).triangles) == 320
    assert len(cleaned(*joined(BALL, BALL.copy().apply_translation([0.07, 0, 0]))).triangles) == 640
    inner.vertices[0] *= 1.3  # comes through the outer one
    assert len(cleaned(*joined(BALL, inner)).triangles) == 320
    # A Klein bottle: a torus grid glued with a flip.
    n = 12
    index = lambda i, j: (i % n) * n + (j if i < n else -j) % n  # noqa: E731
    quads = [[index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)] for i in range(n) for j in range(n)]
    quads = np.array(quads)
    points = np.random.default_rng(0).uniform(0, 0.1, (n * n, 3))
    mesh = cleaned(points, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]))
    assert not mesh.closed
    assert len(mesh.triangles) == 2 * n * n
    assert np.isfinite(smooth_triangles(mesh.points, mesh.triangles).inner).all()
    # A wall of two coplanar triangles with a shelf on either side, of any winding.
    x = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0.2], [0.2, -1, 0]], float)
    joint = neighbours(x, np.array([[0, 1, 2], [0, 1, 3], [1, 0, 4], [0, 1, 5]]))
    edge = int(np.flatnonzero((joint.edges == [0, 1]).all(axis=1))[0])
    assert sorted(joint.sides[edge] // 3) == [0, 1]
    assert joint.at_edge[edge] == 4
    assert not joint.paired[np.arange(len(joint.edges)) != edge].any()


def test_solids_that_touch_along_one_edge_are_closed_and_keep_their_insides():
    """Faces of both lie in one plane, one on either side of the edge."""
    first, second = trimesh.creation.box([0.02, 0.02, 0.06]), trimesh.creation.box([0.02, 0.02, 0.06])
    both = trimesh.util.concatenate([first, second.apply_translation([0.02, 0.02, 0])])
    both.merge_vertices()
    assert len(both.vertices) == 14
    for faces in (both.faces, both.faces[:, ::-1]):
        mesh = cleaned(np.array(both.vertices), np.array(faces))
        assert mesh.closed
        solid = trimesh.Trimesh(mesh.points, mesh.triangles, process=False)
        assert solid.volume == pytest.approx(2 * 0.02 * 0.02 * 0.06)
        assert solid.center_mass == pytest.approx([0.01, 0.01, 0], abs=1e-12)


def with_holes(mesh):
    """A tenth of the triangles is missing, on the far side of the finger."""
    far = np.flatnonzero(mesh.triangles_center[:, 0] < -0.01)
    gone = np.random.default_rng(1).choice(far, len(mesh.faces) // 10, replace=False)
    return trimesh.Trimesh(mesh.vertices, np.delete(mesh.faces, gone, 0), process=False)


KINDS = {f.__name__: f for f in (turned, soup, doubled, lined, with_holes)} | {"slabs": lambda body: slabs(5)}


@pytest.mark.parametrize("kind", ["soup", "lined", *(pytest.param(kind, marks=pytest.mark.long)
                                  for kind in ("turned", "doubled", "with_holes", "slabs"))])  # fmt: skip
def test_a_body_is_the_same_to_a_finger_however_its_triangles_are_given(kind):
    body = outline_body()
    mesh = KINDS[kind](body)
    clean = cleaned(np.array(mesh.vertices), np.array(mesh.faces))
    torn = MeshObject(clean.points, clean.triangles, lids=clean.lids, closed=clean.closed)
    sound = MeshObject(np.array(body.vertices), np.array(body.faces))
    pose = side(0.055, radius=0.035)
    face = np.column_stack([*(v.ravel() for v in np.meshgrid(np.linspace(-0.012, 0.012, 9), [-0.008, 0, 0.008])),
                            np.zeros(27)])  # fmt: skip
    assert torn.first_touch(pose, face, 0.1) == pytest.approx(sound.first_touch(pose, face, 0.1), abs=2e-6)
    x = pose.to_object(in_box())
    g, expected = (obj.near(pose, *BOX, 0.002).gap(x)[0] for obj in (torn, sound))
    close = np.abs(expected) < 1e-3
    assert close.sum() > 20
    assert np.abs(g - expected)[close].max() < (4e-5 if kind == "slabs" else 1e-12)
    assert np.linalg.norm(torn.solid[1] - sound.solid[1]) < max(2e-4, 2 * torn.solid[2])


def test_parts_that_cross_are_one_volume():
    """Two cubes that share a quarter, of which the winding numbers along lines count each point once."""
    cube = trimesh.creation.box((0.04, 0.04, 0.04))
    points, triangles = joined(cube, cube.copy().apply_translation([0.02, 0.02, 0.0]))
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    for R in (np.eye(3), turn * np.linalg.det(turn)):
        volume, place, error = MeshObject(points @ R.T, triangles).solid
        assert error < 6e-6
        assert volume == pytest.approx(1.75 * 0.04**3, rel=1e-2)
        np.testing.assert_allclose(place, R @ [0.01, 0.01, 0.0], atol=3e-6)


@pytest.mark.parametrize("roll", [0.0, 0.5])
def test_the_centroid_of_an_open_box_is_within_its_stated_error(roll):
    box = trimesh.creation.box((0.17, 0.11, 0.07)).subdivide().subdivide()
    box.apply_transform(trimesh.transformations.rotation_matrix(roll, [1, 2, 3], [0.1, 0.0, 0.0]))
    points, triangles = np.array(box.vertices), np.array(box.faces)
    for torn in (3, 70, 150):
        volume, place, error = solid(points, np.delete(triangles, torn, axis=0), closed=False)
        assert np.linalg.norm(place - box.center_mass) < error < 1e-4
        assert volume == pytest.approx(box.volume, rel=1e-2)
    ends = np.abs(trimesh.creation.box((0.17, 0.11, 0.07)).subdivide().subdivide().face_normals[:, 2]) > 0.9
    _, place, error = solid(points, triangles[~ends], closed=False)  # open at two opposite ends
    assert np.linalg.norm(place - box.center_mass) < error < (2e-2 if roll else 5e-4)


@pytest.mark.long
def test_a_mesh_of_very_many_triangles_is_decimated():
    fine = trimesh.creation.icosphere(8, 0.03)  # 1.3 million
    mesh = cleaned(np.array(fine.vertices), np.array(fine.faces))
    assert len(mesh.triangles) <= 210_000
    assert np.abs(np.linalg.norm(mesh.points, axis=1) - 0.03).max() < 2e-5
    assert mesh.closed
