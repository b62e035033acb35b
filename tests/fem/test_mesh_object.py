"""Meshes as objects: files and their damage, the frame, convergence to the analytic shapes."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.gap import NoContactError, Pose, first_touch
from softjaw.fem.objects.mesh_file import read_triangles, stated_unit
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.triangles import cleaned
from tests.fem.reference import slopes
from tests.fuzz.readers import model_3mf, packed

FLASK = Path(__file__).parents[2] / "jobs" / "objects" / "flask.stl"
RADIUS = 0.03
# looking along -x, turned about the approach so that no grid line is parallel to an axis of the object
TILT = np.array([[0, np.sin(0.3), np.cos(0.3)], [0, np.cos(0.3), -np.sin(0.3)], [-1, 0, 0]]).T
BLOCK = 0.01 * np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2))])
RING = [(0, 1, 2, 3), (3, 4, 5, 0)]  # of an L-shaped block; the six corners at once are not convex
SIDES = [(k, (k + 1) % 6, 6 + (k + 1) % 6, 6 + k) for k in range(6)]
DAMAGED = {  # what tests/fuzz does not make of sound files
    "junk.stl": b"hello", "empty.stl": b"", "a.step": b"ISO-10303-21;", "c.ply": b"ply\nformat ascii 1.0\n",
    "b.obj": b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "c.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n",
}  # fmt: skip


def ball(level, radii=(RADIUS, RADIUS, RADIUS), centre=(0, 0, 0)):
    mesh = trimesh.creation.icosphere(level)
    return mesh.vertices * radii + centre, np.asarray(mesh.faces)


def box_points(lower, upper, n=400):
    return np.random.default_rng(3).uniform(lower, upper, (n, 3))


@pytest.fixture(scope="module")
def flask():
    return MeshObject.from_file(FLASK, "mm", grid_step=0.8e-3)


def test_a_region_is_twice_differentiable_and_points_outside_it_keep_the_sign_and_grow(flask):
    region = flask.near(Pose(TILT, np.array([0.032, 0, 0.05])), [-0.016, -0.010, -0.006], [0.016, 0.010, 0.006])
    y, h = box_points(region.lower + 1e-4, region.upper - 1e-4, 100), 1e-6
    x = region.pose.to_object(y)
    _, normal, H = region.gap(x)
    assert np.abs(slopes(lambda x: region.gap(x)[0], x, h) - normal).max() < 1e-6
    assert np.abs(slopes(lambda x: region.gap(x)[1], x, h) - H).max() < 1e-3 * np.abs(H).max()
    assert np.abs(np.linalg.norm(normal, axis=1) - 1)[np.abs(region.gap(x)[0]) < 2e-3].max() < 0.03
    # Both errors stay below the distance over which the spline rounds an edge: step x turn of the facets.
    assert region.grid_step == pytest.approx(0.8e-3)
    x = region.pose.to_object(box_points(region.lower, region.upper))
    g = region.sheet.signed(x)[0]
    near = np.abs(g) < 1e-3
    assert np.abs(region.gap(x)[0] - g)[near].max() < 0.1e-3
    assert np.abs(flask.gap(x)[0] - g)[near].max() < 0.1e-3  # the facets' own sagitta
    # Outside the box the distance to the sheet is taken; far out along the approach it grows like the way.
    z = -np.array([0.007, 0.02, 0.1, 1.0])
    far = region.pose.to_object(np.stack([0 * z, 0 * z, z], axis=1))
    assert (np.diff(region.gap(far)[0]) > 0).all()
    x = box_points(*(flask.bounds + np.array([[-0.02], [0.02]])), n=300)
    inside = flask.gap(x)[0] < 0
    g = region.gap(x)[0]
    clear = np.abs(g) > 0.1e-3
    assert (g < 0)[clear & inside].all()
    # a straight line along the approach from x on to the finger stays free
    way = x[:, None] - np.linspace(0, 0.2, 400)[:, None] * region.pose.rotation[:, 2]
    free = flask.gap(way.reshape(-1, 3))[0].reshape(len(x), -1).min(axis=1) > 1e-3
    assert free.sum() > 50
    assert (g > 0)[clear & free].all()
    for value in region.gap(np.concatenate([x, flask.points[:50], far])):
        assert np.isfinite(value).all()


def test_the_distance_to_triangles_has_a_unit_gradient_and_the_shipped_flask_is_sound(flask):
    x = box_points(*(flask.bounds + np.array([[-0.02], [0.02]])), n=200)
    g, normal, _ = flask.gap(x)
    D = slopes(lambda x: flask.gap(x)[0], x, 1e-7)
    assert np.mean(np.abs(D - normal).max(axis=1) > 1e-5) < 0.01  # the medial axis has two normals
    on = flask.points[flask.triangles[::97]].mean(axis=1)
    g, normal, _ = flask.gap(on)
    assert np.abs(g).max() < 1e-15
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-12
    assert (flask.gap(on + 1e-5 * normal)[0] > 0).all()
    assert flask.notes == ()
    assert 2000 <= len(flask.triangles) <= 4000
    lower, upper = flask.bounds
    assert lower[2] == 0
    assert upper[2] == pytest.approx(0.12, abs=1e-6)
    assert (lower + upper)[:2] == pytest.approx(0, abs=1e-15)
    points, triangles = flask.surface()
    assert trimesh.Trimesh(points, triangles, process=False).volume > 0
    pose = Pose(TILT, np.array([0.2, 0, 0.05]))
    grid = np.stack(np.meshgrid(np.linspace(-0.02, 0.02, 9), np.linspace(-0.01, 0.01, 5), [0.0]), -1).reshape(-1, 3)
    d = flask.first_touch(pose, grid, 0.4)
    assert d == pytest.approx(first_touch(flask, pose, grid, 0.4), abs=1e-9)
    x = pose.to_object(grid) + d * pose.rotation[:, 2]
    assert np.abs(flask.gap(x)[0].min()) < 1e-10
    with pytest.raises(NoContactError):
        flask.first_touch(Pose(TILT, np.array([0.2, 0, 0.25])), grid, 0.4)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_chosen_axis_becomes_z_without_mirroring(tmp_path, axis):
    points, triangles = ball(2, (0.01, 0.02, 0.03), centre=(0.1, 0.2, 0.3))
    trimesh.Trimesh(points, triangles, process=False).export(tmp_path / "a.stl")
    mesh = MeshObject.from_file(tmp_path / "a.stl", "m", axis=axis)
    size = np.ptp(mesh.bounds, axis=0)
    assert size[2] == pytest.approx({"x": 0.02, "y": 0.04, "z": 0.06}[axis], rel=0.05)
    assert mesh.bounds[0, 2] == 0
    assert trimesh.Trimesh(mesh.points, mesh.triangles, process=False).volume > 0
    assert mesh.notes == ()


def off(path, points, faces):
    rows = [*(" ".join(map(repr, map(float, x))) for x in points), *(" ".join(map(str, (len(f), *f))) for f in faces)]
    path.write_text("\n".join(["OFF", f"{len(points)} {len(faces)} 0", *rows, ""]))


def obj(path, points, faces):
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    rows += [f"f {' '.join(str(k + 1) for k in f)}" for f in faces]
    path.write_text("\n".join([*rows, ""]))


@pytest.mark.parametrize("written", [off, obj])
def test_faces_of_four_corners_are_cut_where_they_are_convex(tmp_path, written):
    path = tmp_path / f"block.{written.__name__}"
    written(path, BLOCK, [*SIDES, *(f[::-1] for f in RING), *(tuple(6 + k for k in f) for f in RING)])
    points, triangles = read_triangles(path)
    np.testing.assert_array_equal(points, BLOCK)
    points, triangles, *_ = cleaned(points, triangles)
    assert trimesh.Trimesh(points, triangles, process=False).volume == pytest.approx(3e-6, rel=1e-12)


def test_faces_that_are_not_convex_are_refused_and_the_unit_is_applied(tmp_path):
    """A fan from the corner beside the notch leaves the face and lies on itself."""
    path = tmp_path / "block.obj"
    obj(path, BLOCK, [*SIDES, (1, 0, 5, 4, 3, 2), (7, 8, 9, 10, 11, 6)])
    with pytest.raises(MeshError, match="block"):
        read_triangles(path)
    points, triangles = ball(1)
    for unit, factor in (("m", 1), ("mm", 1e-3), ("inch", 0.0254), ("cm", 0.01)):
        x, *_ = cleaned(points / factor, triangles, unit)
        assert np.ptp(x[:, 2]) == pytest.approx(np.ptp(points[:, 2]), rel=1e-12)


def test_comments_tabs_and_indents_of_text_are_no_damage_and_a_unit_that_contradicts_the_file_is_a_note(tmp_path):
    path = tmp_path / "block.obj"
    obj(path, BLOCK, SIDES)
    points, triangles = read_triangles(path)
    path.write_text(path.read_text().replace("f ", "  f\t").replace("\n", " # of 1\n"))
    np.testing.assert_array_equal(read_triangles(path)[0], points)
    np.testing.assert_array_equal(read_triangles(path)[1], triangles)
    for said, unit in (("inch", "inch"), ("inch", "mm"), ("mm", "mm")):
        path = tmp_path / f"{said}{unit}.3mf"
        path.write_bytes(packed(model_3mf().replace(b' unit="millimeter"', b"" if said == "mm" else b' unit="inch"')))
        assert stated_unit(path) == said
        notes = MeshObject.from_file(path, unit).notes
        assert sum(f"file says {said}" in note for note in notes) == (said != unit)


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_are_refused_with_their_name(tmp_path, name):
    (tmp_path / name).write_bytes(DAMAGED[name])
    with pytest.raises(MeshError, match=name):
        MeshObject.from_file(tmp_path / name, "m")


@pytest.mark.parametrize(("path", "unit", "told"), [(FLASK, "m", "120 m"), ("none.stl", "mm", "none.stl")])
def test_a_wrong_unit_and_a_missing_file_are_refused(path, unit, told):
    with pytest.raises(MeshError, match=told):
        MeshObject.from_file(path, unit)


def test_a_file_that_is_too_large_and_a_region_of_too_many_samples_are_refused(monkeypatch, flask):
    monkeypatch.setattr("softjaw.fem.objects.mesh_file.LARGEST_FILE", 1000)
    with pytest.raises(MeshError):
        MeshObject.from_file(FLASK, "mm")
    with pytest.raises(ValueError, match="grid_step"):
        MeshObject(flask.points, flask.triangles, 1e-5).near(Pose(TILT, np.zeros(3)), [0, 0, 0], [0.01] * 3)
