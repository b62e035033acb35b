"""Whole cases of meshes: poses in the frame of the file, and the mirror image of the other finger."""

import gc
import weakref

import numpy as np
import pytest
import trimesh

from softjaw.study import pipeline
from softjaw.study.case import solver
from softjaw.study.case.candidates import candidates
from softjaw.study.case.model import image_signs, quadrants
from softjaw.study.case.pressing import OnRigid
from softjaw.study.result.read import open as open_dataset
from softjaw.study.result.skeleton import create
from softjaw.study.run.plan import make_plan
from tests.study.scenes import NO_COUPLING, mesh_of, pose_of, scene_of, units_of

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


def test_a_mesh_that_was_moved_in_its_file_has_its_grasps_moved_and_states_the_frame_of_its_stations(files, tmp_path):
    upright, moved = (solved(scene(files, name)) for name in ("upright", "moved"))
    assert moved["maps/quality"] == pytest.approx(upright["maps/quality"], rel=1e-5)  # STL has single precision
    assert moved["maps/payload"] == pytest.approx(upright["maps/payload"], rel=2e-3)
    np.testing.assert_allclose(moved["fingers/pose_rotation"], TURN @ upright["fingers/pose_rotation"], atol=1e-6)
    there = upright["fingers/pose_origin"] @ TURN.T + 1e-3 * SHIFT
    np.testing.assert_allclose(moved["fingers/pose_origin"], there, atol=1e-7)
    np.testing.assert_allclose(upright["fingers/pose_origin"], [[0.02, 0, 0.04], [-0.02, 0, 0.04]], atol=2e-5)
    pose = pose_of(TURN @ [0.0, 0, 40] + SHIFT, TURN @ [-1.0, 0, 0], TURN @ [0.0, 0, 1])
    posed = solved(scene(files, "moved", pose))
    assert posed["maps/e_n"] == pytest.approx(moved["maps/e_n"], rel=1e-6)
    np.testing.assert_allclose(posed["fingers/pose_origin"], moved["fingers/pose_origin"], atol=1e-7)
    plan = make_plan(scene(files, "moved"))
    create(tmp_path / "a.hdf", plan.layout, plan.header)
    attributes = open_dataset(tmp_path / "a.hdf").attrs
    np.testing.assert_array_equal(attributes["object_rotation"], TURN)
    np.testing.assert_allclose(attributes["object_origin"], 1e-3 * SHIFT, atol=1e-6)


def test_the_other_finger_is_the_mirror_image(tmp_path):
    """Of a lopsided ball in single precision it is x of the object that changes its sign: y of the pad."""
    mesh = trimesh.creation.icosphere(4, 0.03)
    x, y, z = mesh.vertices.T
    mesh.vertices = np.column_stack([x, y * (1 + 4 * y), z * (1 + 3 * z)])
    mesh.export(path := tmp_path / "ball.stl")
    lopsided = scene_of(mesh_of(path, "m"), NO_COUPLING, where=pose_of((0, 0, 4)), forces="[4]", elements="[6, 4, 2]")
    poses = candidates(lopsided)[0].poses
    _, other = fingers = solver.fingers_of(lopsided, poses)
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


def test_solutions_that_are_kept_hold_no_surface_of_a_mesh(files, monkeypatch):
    """Megabytes each, given back without waiting for the collector of rings of objects."""
    made, fingers_of = [], solver.fingers_of
    monkeypatch.setattr(solver, "fingers_of", lambda *of: made.append(fingers_of(*of)) or made[-1])
    gc.disable()
    try:
        solved(scene(files, "upright"))
        quadrants.cache_clear()
        surfaces = [weakref.ref(finger.surface) for fingers in made for finger in fingers]
        made.clear()
        assert [surface() for surface in surfaces] == 4 * [None]
    finally:
        gc.enable()
