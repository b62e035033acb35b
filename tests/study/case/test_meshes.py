"""Whole cases of meshes: poses in the frame of the file, mirror images, facets, triangles as users have them."""

import numpy as np
import pytest
import trimesh

from softjaw.study import pipeline
from softjaw.study.case.build import build_object
from softjaw.study.case.candidates import candidates
from softjaw.study.case.model import approach, image_signs
from softjaw.study.case.pressing import OnRigid
from softjaw.study.result.read import open as open_dataset
from softjaw.study.result.skeleton import create
from softjaw.study.run.plan import make_plan
from tests.study.scenes import BALL, NO_COUPLING, mesh_of, pose_of, results_of, scene_of, units_of

TURN = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # the object's z is the file's x
SHIFT = np.array([120.0, -45.0, 30.0])  # mm
GRID = "stations_mm = [40]\nangles_deg = [0]\n"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("meshes")
    body = trimesh.creation.cylinder(radius=20, height=90, sections=48)
    body.vertices *= [1.0, 0.8, 1.0]
    body.apply_translation([0, 0, 45])
    body.export(folder / "upright.stl")
    moved = body.copy()
    moved.vertices = body.vertices @ TURN.T + SHIFT
    moved.export(folder / "moved.stl")
    return folder


def scene(files, name, where=GRID):
    shape = mesh_of(files / f"{name}.stl") + f'\naxis = "{"xz"[name == "upright"]}"'
    return scene_of(shape, NO_COUPLING, where=where, elements="[4, 4, 2]")


def solved(made):
    [unit] = units_of(made)
    [(_, result)] = pipeline.solve_unit(unit)
    return pipeline.image(result, unit, 0).values


def explicit(turn, shift):
    return pose_of(turn @ [0.0, 0, 40] + shift, turn @ [-1.0, 0, 0], turn @ [0.0, 0, 1])


def test_a_mesh_that_was_moved_in_its_file_has_its_grasps_moved(files):
    upright, moved = (solved(scene(files, name)) for name in ("upright", "moved"))
    assert moved["maps/quality"] == pytest.approx(upright["maps/quality"], rel=1e-5)  # STL has single precision
    assert moved["maps/payload"] == pytest.approx(upright["maps/payload"], rel=2e-3)
    np.testing.assert_allclose(moved["fingers/pose_rotation"], TURN @ upright["fingers/pose_rotation"], atol=1e-6)
    there = upright["fingers/pose_origin"] @ TURN.T + 1e-3 * SHIFT
    np.testing.assert_allclose(moved["fingers/pose_origin"], there, atol=1e-7)
    np.testing.assert_allclose(upright["fingers/pose_origin"], [[0.02, 0, 0.04], [-0.02, 0, 0.04]], atol=2e-5)


def test_poses_of_a_scene_are_read_in_the_frame_of_the_file(files):
    grid = solved(scene(files, "moved"))
    posed = solved(scene(files, "moved", explicit(TURN, SHIFT)))
    assert posed["maps/e_n"] == pytest.approx(grid["maps/e_n"], rel=1e-6)
    np.testing.assert_allclose(posed["fingers/pose_origin"], grid["fingers/pose_origin"], atol=1e-7)


def test_the_file_states_the_frame_in_which_stations_count(files, tmp_path):
    plan = make_plan(scene(files, "moved"))
    create(tmp_path / "a.hdf", plan.layout, plan.header)
    attributes = open_dataset(tmp_path / "a.hdf").attrs
    np.testing.assert_array_equal(attributes["object_rotation"], TURN)
    np.testing.assert_allclose(attributes["object_origin"], 1e-3 * SHIFT, atol=1e-6)


PAD = ("gripper.pad_length_mm=30", "gripper.pad_width_mm=20", "gripper.pad_thickness_mm=12")


def mesh(body, folder, name):
    body.export(folder / f"{name}.stl")
    return mesh_of(folder / f"{name}.stl")


def solved_shape(shape, elements=(10, 6, 4), station=0.0, angle=0.0):
    place = {"stations": f"[{station}]", "angles": f"[{angle}]", "elements": list(elements)}
    [result] = results_of(scene_of(shape, *PAD, **place))
    return result


@pytest.mark.long
def test_a_mirrored_mesh_gives_mirrored_results(tmp_path):
    body = trimesh.creation.icosphere(3, 30)
    body.vertices *= [0.7, 0.9, 1.3]
    body.vertices += 0.0015 * body.vertices[:, [1, 2, 0]] * body.vertices[:, [2, 0, 1]]
    # STL files hold numbers of single precision: both meshes have the same
    body.vertices = body.vertices.astype(np.float32)
    other = trimesh.Trimesh(body.vertices * [1, -1, 1], body.faces[:, ::-1], process=False)
    one, two = (
        solved_shape(mesh(own, tmp_path, name), station=35, angle=sign * 20)
        for own, name, sign in ((body, "one", 1), (other, "two", -1))
    )
    names = [name for name in one.values if name in ("maps/quality", "maps/e_n") or "overestimate" in name]
    assert len(names) > 3
    for name in names:
        assert np.asarray(two.values[name]) == pytest.approx(np.asarray(one.values[name]), rel=1e-6), name


@pytest.mark.long
def test_a_ball_of_facets_is_the_ball(tmp_path):
    facets = trimesh.creation.uv_sphere(30, count=[25, 48])
    ball = solved_shape(BALL, (20, 14, 6))
    found = solved_shape(mesh(facets, tmp_path, "ball"), (20, 14, 6), station=30)
    assert found.values["maps/quality"] == pytest.approx(ball.values["maps/quality"], rel=5e-3)


@pytest.fixture(scope="module")
def lopsided(tmp_path_factory):
    """A lopsided ball: before one finger it is the mirror image of what is before the other, in single precision."""
    path = tmp_path_factory.mktemp("mesh") / "ball.stl"
    mesh = trimesh.creation.icosphere(4, 0.03)
    x, y, z = mesh.vertices.T
    mesh.vertices = np.column_stack([x, y * (1 + 4 * y), z * (1 + 3 * z)])
    mesh.export(path)
    return scene_of(mesh_of(path, "m"), NO_COUPLING, where=pose_of((0, 0, 4)), forces="[4]", elements="[6, 4, 2]")


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
