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


def test_specks_are_dropped_separate_parts_kept_and_one_side_stays_as_it_is():
    inner, speck = BALL.copy().apply_scale(0.93), trimesh.creation.icosphere(0, 2e-4).apply_translation([0.05, 0, 0])
    assert len(cleaned(*joined(BALL, inner, speck)).triangles) == 320
    assert len(cleaned(*joined(BALL, BALL.copy().apply_translation([0.07, 0, 0]))).triangles) == 640
    inner.vertices[0] *= 1.0005 / 0.93  # comes through the outer one, by less than anybody would feel
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


@pytest.mark.parametrize("sections", [8, 32])
def test_a_body_that_comes_out_of_another_is_kept_however_many_of_its_corners_lie_inside(sections):
    block = trimesh.creation.box((0.06, 0.06, 0.06))
    cone = trimesh.creation.cone(0.01, 0.04, sections=sections).apply_translation([0, 0, 0.028])
    points = np.array([[0.012, z] for z in np.linspace(0.01, 0.0, 10)] + [[0.045, 0.005], [0.012, 0.01]])
    for body in (cone, trimesh.creation.revolve(points, sections=sections)):
        mesh = cleaned(*joined(block, body))
        extent = np.ptp(np.concatenate([block.vertices, body.vertices]), axis=0)
        assert len(mesh.triangles) == len(block.faces) + len(body.faces)
        assert np.allclose(np.ptp(mesh.points, axis=0), extent)


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


def brick(*size, at=(0, 0, 0)):
    return trimesh.creation.box(size).apply_translation(at)


def mug():
    cup = trimesh.creation.revolve([[0, 0], [40, 0], [40, 90], [36, 90], [36, 5], [0, 5]], sections=64)
    upright = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])
    return cup, trimesh.creation.torus(25, 5).apply_transform(upright).apply_translation([45, 0, 45])


def spoon():
    """An ellipsoid, a flat handle and a disc at its end."""
    bowl = trimesh.creation.icosphere(3).apply_scale([0.9, 0.6, 0.25])
    parts = bowl, brick(5, 0.4, 0.12, at=(3.2, 0, 0.1)), trimesh.creation.cylinder(0.3, 0.15, sections=24)
    parts[2].apply_translation([5.7, 0, 0.1])
    return [part.apply_scale(25.4) for part in parts]


HEAD = brick(30, 30, 30, at=(115, 0, 0))
BODIES = {  # parts [mm], volume [cm^3] and centroid [mm]; mug and spoon: 2048 lines per side agree to these digits
    "cubes": ([brick(40, 40, 40), brick(40, 40, 40, at=(20, 20, 0))], 112, [10, 10, 0]),
    "hammer that touches": ([brick(200, 10, 2), HEAD], 31, [3105 / 31, 0, 0]),
    "hammer": ([brick(200, 10, 2, at=(5, 0, 0)), HEAD], 30.9, [(20 - 10.25 + 3105) / 30.9, 0, 0]),
    "L with common edges": ([brick(60, 40, 5), brick(5, 40, 60, at=(-27.5, 0, 27.5))], 23, [-13.152174, 0, 330 / 23]),
    "bars that share an edge": ([brick(20, 20, 60), brick(20, 20, 60, at=(20, 20, 0))], 48, [10, 10, 0]),
    "halves of a plate": ([brick(110, 10, 2, at=(-45, 0, 0)), brick(110, 10, 2, at=(45, 0, 0))], 4, [0, 0, 0]),
    "mug": (mug(), 117.668, [4.4477, 0, 37.6589]),
    "spoon": (spoon(), 13.5175, [28.6484, 0, 0.8165]),
}  # fmt: skip


@pytest.mark.parametrize("name", BODIES)
def test_parts_that_cross_or_touch_are_one_volume_and_its_centroid_is_within_its_stated_error(name):
    parts, volume, centre = BODIES[name]
    points, triangles = joined(*parts)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    for R in (np.eye(3), turn * np.linalg.det(turn)):
        clean = cleaned(points @ R.T, triangles, "mm")
        assert clean.closed
        found, place, error = MeshObject(clean.points, clean.triangles, closed=clean.closed).solid
        assert found == pytest.approx(volume * 1e-6, rel=2e-3)
        assert 1e3 * np.linalg.norm(place - R @ centre / 1e3) < 1e3 * error + 1e-4  # mm, digits of the figures above
        assert error < 5e-5


def test_a_wall_inside_where_two_bodies_share_triangles_does_not_move_the_centroid():
    """Lines through the wall do not come back to zero; the others are exact."""
    one = brick(40, 40, 40).subdivide()
    other = one.copy().apply_transform(np.diag([-1, 1, 1, 1])).apply_translation([40, 0, 0])
    clean = cleaned(*joined(one, other), "mm")
    volume, place, error = MeshObject(clean.points, clean.triangles, closed=clean.closed).solid
    assert volume == pytest.approx(128e-6, rel=1e-3)
    assert np.linalg.norm(place - [0.02, 0.0, 0.0]) < error < 1e-4


@pytest.mark.parametrize("move", ["sheets", "triangles"])
def test_sheets_and_triangles_that_lie_side_by_side_are_one_body_and_those_farther_apart_are_not(move):
    box = brick(50, 60, 120).subdivide().subdivide()
    sheet = np.abs(box.face_normals).argmax(axis=1) + 3 * (box.face_normals.sum(axis=1) > 0)
    by = np.random.default_rng(4).uniform(-1, 1, (6 if move == "sheets" else len(box.faces), 1, 3))
    corners = box.triangles + 5e-3 * (by[sheet] if move == "sheets" else by)  # mm
    for times, closed in ((1.0, True), (50.0, False)):
        clean = cleaned((box.triangles + times * (corners - box.triangles)).reshape(-1, 3),
                        np.arange(3 * len(box.faces)).reshape(-1, 3), "mm")  # fmt: skip
        assert clean.closed == closed
        if closed:
            assert len(clean.triangles) == len(box.faces)
            volume, place, _ = solid(clean.points, clean.triangles, clean.closed)
            assert volume == pytest.approx(360e-6, rel=1e-3)
            assert np.linalg.norm(place) < 1e-5


@pytest.mark.parametrize("roll", [0.0, 0.5])
def test_the_centroid_of_an_open_body_is_within_its_stated_error(roll):
    box = trimesh.creation.box((0.17, 0.11, 0.07)).subdivide().subdivide()
    ends = np.abs(box.face_normals[:, 2]) > 0.9  # open at two opposite ends
    ball, top = BALL.copy(), BALL.triangles_center[:, 2] > 0.024
    prism = trimesh.creation.cylinder(0.03, 0.1, sections=3)  # a tube of one band of triangles
    caps = np.abs(prism.face_normals[:, 2]) > 0.9
    boxes = (box, 3, 1e-4), (box, 150, 1e-4), (box, ends, 2e-3)
    for body, torn, most in (*boxes, (ball, 7, 1e-5), (ball, top, 2e-3), (prism, caps, 2e-3)):
        turn = trimesh.transformations.rotation_matrix(roll, [1, 2, 3], [0.1, 0.0, 0.0])
        mesh = body.copy().apply_transform(turn)
        volume, place, error = solid(np.array(mesh.vertices), np.delete(mesh.faces, torn, axis=0), closed=False)
        assert np.linalg.norm(place - mesh.center_mass) < error < most
        assert volume == pytest.approx(mesh.volume, rel=5e-2 if torn is top else 1e-9)


@pytest.mark.long
def test_a_mesh_of_very_many_triangles_is_decimated():
    fine = trimesh.creation.icosphere(8, 0.03)  # 1.3 million
    mesh = cleaned(np.array(fine.vertices), np.array(fine.faces))
    assert len(mesh.triangles) <= 210_000
    assert np.abs(np.linalg.norm(mesh.points, axis=1) - 0.03).max() < 2e-5
    assert mesh.closed
    flat = trimesh.creation.cylinder(0.03, 0.1, sections=300)  # wide flat faces, whose edges cost nothing
    while len(flat.faces) < 600_000:
        flat = flat.subdivide()
    mesh = cleaned(np.array(flat.vertices), np.array(flat.faces))
    assert len(mesh.triangles) <= 210_000
    assert mesh.closed
    assert solid(mesh.points, mesh.triangles, True)[0] == pytest.approx(flat.volume, rel=1e-5)
