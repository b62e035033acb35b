"""Candidates of meshes and their cases: poses, mirror images of the other finger, and whether a gripper fits."""

import gc
import weakref

import numpy as np
import pytest
import trimesh

from softjaw.study import pipeline
from softjaw.study.case import solver
from softjaw.study.case.build import build_object
from softjaw.study.case.candidates import candidates, decided
from softjaw.study.case.fit import extremes
from softjaw.study.case.geometry import approach
from softjaw.study.case.model import image_signs, quadrants
from softjaw.study.case.pressing import OnRigid
from softjaw.study.quantities import COLLIDES, MISSING, WIDE
from softjaw.study.result.read import open as open_dataset
from softjaw.study.result.skeleton import create
from softjaw.study.run.plan import make_plan
from softjaw.study.scene import Scene, parse_scene
from tests.study.scenes import NO_COUPLING, OVAL, mesh_of, pose_of, scene_of, text_of, units_of

TURN = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # the object's z is the file's x
SHIFT = np.array([120.0, -45.0, 30.0])  # mm
GRID = "stations_mm = [40]\nangles_deg = [0]\n"
PAD = (0.05, 0.022, 0.015)
ELLIPSE = OVAL.replace("120", "80")
TWO_PLACES = text_of(ELLIPSE, "stations_mm = [-5, 10]\nangles_deg = [0, 90]\n", forces="[1, 2]")
POSES = text_of(ELLIPSE, pose_of() + pose_of(approach=(0, 1, 0)), forces="[1, 2]")


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
    np.testing.assert_array_equal(attributes["object_rotation"].reshape(3, 3), TURN)
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


def states(text, *changes):
    return [unit.state for unit in decided(units_of(parse_scene(text, overrides=changes)))]


def test_extremes_of_triangles_are_at_their_corners_and_where_they_leave_the_rectangle():
    slope = np.array([[-1.0, -1.0, -1.0], [3.0, -1.0, 3.0], [-1.0, 3.0, -1.0]])  # z = x
    assert extremes(slope, np.array([[0, 1, 2]]), (1.0, 0.5)) == pytest.approx((-0.5, 0.5))
    tip = np.array([[0.01, 0.02, -7.0], [9.0, 0.0, 0.0], [-9.0, 9.0, 0.0], [-9.0, -9.0, 0.0]])
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]])
    assert extremes(tip, fan, (0.1, 0.1))[0] == pytest.approx(-7.0)  # no grid would meet it
    assert extremes(tip, fan, (0.001, 0.001))[0] > -7.0
    assert extremes(tip + np.array([50.0, 0.0, 0.0]), fan, (0.1, 0.1)) == (np.inf, -np.inf)


@pytest.mark.parametrize("shift", [0.0, 0.025, 0.035])
def test_the_opening_round_a_ball_is_its_chord(shift):
    radius = 0.04
    ball = trimesh.creation.icosphere(5, radius)
    low, high = extremes(np.asarray(ball.vertices) + np.array([shift, 0, 0]), np.asarray(ball.faces), PAD[:2])
    off = max(shift - PAD[0] / 2, 0.0)
    assert high - low == pytest.approx(2 * np.sqrt(radius**2 - off**2), rel=1e-3)


@pytest.mark.parametrize("radius", [4.0, 10.0])
@pytest.mark.parametrize("off", [0.0, 0.55, 1.3])
def test_a_ball_that_is_met_between_the_points_of_the_face_is_met_at_its_diameter(radius, off):
    tables = {
        "object": {"shape": "sphere", "radius_mm": radius}, "load": {"normal_force_n": [0.3]},
        "gripper": {"pad_length_mm": 100, "pad_width_mm": 40}, "accuracy": {"meshes": 1},
        "candidates": {"poses": [{"point_mm": [0, off, 0.7 * off], "approach": [1, 0, 0], "long_side": [0, 0, 1]}]},
    }  # fmt: skip
    scene = Scene.of_tables(tables)
    [grasp] = candidates(scene)
    first, second = (approach(build_object(scene.object), pose, scene.gripper).pose for pose in grasp.poses)
    opening = (second.origin - first.origin) @ first.rotation[:, 2]
    assert opening == pytest.approx(2e-3 * radius, abs=6e-6)  # 0.53 mm short by the points alone


@pytest.mark.parametrize("scene", [TWO_PLACES, POSES])
def test_candidates_of_every_kind_are_too_wide_where_they_are(scene):
    per = 2 if scene == TWO_PLACES else 1
    assert states(scene) == [MISSING] * 2 * per
    assert states(scene, "gripper.max_opening_mm=45") == [WIDE, MISSING] * per
    assert states(scene, "gripper.max_opening_mm=39") == [WIDE, WIDE] * per


def test_what_rounding_decides_is_solved_and_a_finger_that_is_larger_than_the_pad_runs_into_a_step():
    assert states(POSES, "gripper.max_opening_mm=40") == [WIDE, MISSING]
    assert states(POSES, "gripper.max_opening_mm=39.999999999") == [WIDE, MISSING]
    scene = parse_scene(POSES, overrides=["gripper.max_opening_mm=45", "sweep.object.semi_axis_a_mm=[21, 25]"])
    found = make_plan(scene).units
    assert [unit.state for unit in found] == [MISSING, MISSING, WIDE, MISSING]
    assert [row for unit in found if unit.state for rows in unit.rows for row in rows] == [4, 5]
    # A pad on the waist of a dumb-bell whose heads stand 20 mm above it.
    waist = [[z, 20] for z in range(30, 80, 10)]
    outline = [[0, 40], [10, 40], [20, 40], [25, 30], *waist, [75, 30], [80, 40], [90, 40], [100, 40]]
    text = text_of(f'shape = "revolution"\nprofile_mm = {outline}', stations="[50]", forces="[1]")
    finger = "gripper.finger_size_mm=[70, 22]"

    def state(thickness, *more):
        return states(text, "gripper.pad_length_mm=20", f"gripper.pad_thickness_mm={thickness}", *more)

    assert state(15) == [MISSING]
    assert state(15, finger) == [COLLIDES]
    assert state(25, finger) == [MISSING]
