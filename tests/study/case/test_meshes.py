"""Meshes through whole cases: poses are those of the mesh's own file, mirrored meshes mirror, facets are the body."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from softjaw.study import pipeline
from softjaw.study.case.candidates import units
from softjaw.study.result.read import open as open_dataset
from softjaw.study.result.skeleton import create
from softjaw.study.run.plan import make_plan
from softjaw.study.scene import parse_scene

TURN = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # the object's z is the file's x
SHIFT = np.array([120.0, -45.0, 30.0])  # mm
SCENE = """
[object]
shape = "mesh"
mesh = "{mesh}"
unit = "mm"
axis = "{axis}"
[gripper]
elements = [4, 4, 2]
{candidates}
[load]
normal_force_n = [2]
[effects]
friction_pressure_coupling = "none"
"""
GRID = "[candidates]\nstations_mm = [40]\nangles_deg = [0]"
POSE = "[[candidates.poses]]\npoint_mm = {point}\napproach = {approach}\nlong_side = {long_side}"


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


def scene(files, name, candidates=GRID):
    return parse_scene(SCENE.format(mesh=files / f"{name}.stl", axis="xz"[name == "upright"], candidates=candidates))


def solved(found):
    [unit] = units(found, lambda point: 1)
    [(_, result)] = pipeline.solve_unit(unit)
    return pipeline.image(result, unit, 0).values


def explicit(turn, shift):
    point, approach, long_side = turn @ [0.0, 0, 40] + shift, turn @ [-1.0, 0, 0], turn @ [0.0, 0, 1]
    return POSE.format(point=point.tolist(), approach=approach.tolist(), long_side=long_side.tolist())


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


# --- facets -----------------------------------------------------------------------------------------------------------


FACETS = """
[object]
{}
[gripper]
pad_length_mm = 30
pad_width_mm = 20
pad_thickness_mm = 12
shear_modulus_kpa = 40
elements = {}
[friction]
mu = 0.8
[candidates]
stations_mm = [{}]
angles_deg = [{}]
[load]
normal_force_n = [2]
"""


def mesh(body, folder, name):
    body.export(folder / f"{name}.stl")
    return f'shape = "mesh"\nmesh = "{folder / name}.stl"\nunit = "mm"'


def solved_shape(shape, elements=(10, 6, 4), station=0.0, angle=0.0):
    scene = parse_scene(FACETS.format(shape, list(elements), station, angle))
    (unit,) = units(scene, lambda point: point.axis_symmetry)
    ((_, result),) = pipeline.solve_unit(unit)
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
    ball = solved_shape('shape = "sphere"\nradius_mm = 30', (20, 14, 6))
    found = solved_shape(mesh(facets, tmp_path, "ball"), (20, 14, 6), station=30)
    assert found.values["maps/quality"] == pytest.approx(ball.values["maps/quality"], rel=5e-3)
