"""One case in memory is the case that a run stores; what names no case is refused."""

import contextlib
import io

import numpy as np
import pytest
import trimesh
from mpi4py import MPI
from threadpoolctl import threadpool_limits

import softjaw as sj
from softjaw.fem.petsc import PETSc
from softjaw.study import pipeline
from softjaw.study.case.candidates import candidates
from softjaw.study.case.model import check_petsc
from softjaw.study.one_case import CaseError, _asked
from softjaw.study.quantities import BY_KEY, MODELS
from softjaw.study.result.store import open_result
from softjaw.study.result.write import rounded
from tests.study.launching import ROOT

JOBS = ROOT / "jobs"
COARSE = "gripper.elements=[8, 4, 2]"
SMOKE = sj.Scene.from_file(JOBS / "smoke.toml", [COARSE])
BOXES = sj.Scene.from_file(JOBS / "box-poses.toml", [COARSE])
FLASK = sj.Scene.from_file(JOBS / "flask-mesh.toml", [COARSE])
POSE = {"point_mm": np.array([0, 0, 500]), "approach": [1, 0, 0], "long_side": np.array([0, 0, 1])}
ROTATED = np.array([[0.0, 0, 1, 0.1], [0, -1, 0, 0], [1, 0, 0, 0.2], [0, 0, 0, 1]])


def run(scene, path):
    with contextlib.redirect_stdout(io.StringIO()):
        assert sj.run(scene, path, comm=MPI.COMM_SELF) == 0
    return path


def assert_stored(case, path, index):
    """All values of a case but its work stand in the file, bit for bit, and so do its patches and its message."""
    with open_result(path) as result:
        for key, value in case.result.values.items():
            if not key.startswith("work/"):  # an image costs nothing
                many = key.startswith("maps/") and BY_KEY[key].by_model
                kept = [result.read(part)[index] for part in ([f"{key}/{m}" for m in MODELS] if many else [key])]
                kept = np.array(kept if many else kept[0], float)
                assert np.array_equal(kept, np.asarray(value, float), equal_nan=True), key
        row = np.ravel_multi_index(index, result.layout.shape)
        for name, faces in result.patch(int(row)).items():
            assert np.array_equal(faces, rounded(np.asarray(case.result.patch[name], faces.dtype))), name
        assert result.messages[index] == case.notes


def test_a_case_is_that_of_a_run_bit_for_bit_also_an_image_by_symmetry_and_with_a_kept_solver(tmp_path, monkeypatch):
    """Of a scene with two meshes, an image by symmetry, and two forces."""
    scene = SMOKE.with_values(**{"accuracy.meshes": 2, "candidates.angles_deg": [0, 180]})
    path, case = run(scene, tmp_path / "two.hdf"), sj.press(scene, station=0.0, angle=0.0, force=2.0)
    assert_stored(case, path, (0, 0, 1))
    ds = sj.open(path).isel(station=0, angle=0, normal_force=1)
    assert case.limits["pcm"].e_n == ds.e_n.sel(model="pcm")
    assert case.errors["e_n"] == pytest.approx(float(ds.e_n_error * ds.e_n.sel(model="ccm")), rel=1e-12)
    assert set(case.errors) >= {"e_n", "quality", "payload", "f_x_overestimate"}
    assert case.contacts[0].tau_pure == ds.finger_tau_pure.values[0]
    point = sj.GraspMap(path).at(0.0, 0.0, 2.0)
    for fitted in (True, False):
        mine, its = (one.limit_surface(2, "pcm", fitted).semi_axes for one in (case, point))
        assert mine == pytest.approx(its, rel=1e-12)
    image = sj.press(scene, station=0.0, angle=np.pi, force=1)
    assert image.angle == pytest.approx(np.pi)
    assert_stored(image, path, (0, 1, 0))
    monkeypatch.setattr(pipeline, "MOST_SOLVERS", 0)
    kept, new = (sj.press(scene, station=0.0, angle=0.0, force=2.0) for _ in range(2))
    for key, value in case.result.values.items():
        if not key.startswith("work/"):
            assert np.array_equal(kept.result.values[key], value, equal_nan=True), key
            assert np.array_equal(new.result.values[key], value, equal_nan=True), key


@pytest.mark.long
def test_the_threads_of_a_script_change_no_bit():
    scene, pressed = sj.Scene.from_file(JOBS / "smoke.toml"), []  # whose payload differs by 1e-4 with two threads
    for threads in (1, 2):
        with threadpool_limits(threads):
            pressed.append(sj.press(scene, 0.0, np.pi / 2, 2.0))
    one, two = (case.result.values for case in pressed)
    for key in one:
        assert key.startswith("work/") or np.array_equal(one[key], two[key], equal_nan=True), key


@pytest.mark.long
@pytest.mark.parametrize(("scene", "asked", "index"), [
    (SMOKE, {"station": 0.0, "angle": 0.0, "force": 2}, (0, 0, 1)),  # one mesh: a load path
    (BOXES, {"candidate": 1, "force": 5}, (1, 0, 1)),
    (FLASK.with_values(**{"candidates.stations_mm": [30], "candidates.angles_deg": [0]}),
     {"station": 0.03, "force": 5}, (0, 0, 1)),
    (sj.Scene.from_file(JOBS / "sampled.toml", [COARSE, "candidates.sampled=2"]),
     {"candidate": 0, "force": 5}, (0, 0, 1)),  # others, and smaller forces, have coarser meshes in a run
    (sj.Scene.from_file(JOBS / "cup.toml", [
        COARSE, "candidates.stations_mm=[55]", "load.normal_force_n=[0.5, 2]", "accuracy.wall_element_mm=4",
        "accuracy.meshes=1",
    ]), {"station": 0.055, "force": 2}, (0, 0, 1)),
], ids=["one mesh", "poses", "mesh", "sampled", "wall"])  # fmt: skip
def test_cases_of_every_kind_of_scene_are_those_of_a_run(scene, asked, index, tmp_path):
    assert_stored(sj.press(scene, **asked), run(scene, tmp_path / "a.hdf"), index)


@pytest.mark.long
def test_what_the_scene_lacks_is_added_to_it(tmp_path):
    case = sj.press(SMOKE, station=0.01, angle=0.5, force=1.5)
    added = {"candidates.stations_mm": [0, 10], "candidates.angles_deg": [0, np.degrees(0.5), 90]}
    path = run(SMOKE.with_values(**added, **{"load.normal_force_n": [1, 1.5, 2]}), tmp_path / "a.hdf")
    assert_stored(case, path, (1, 1, 1))
    across = sj.press(SMOKE, pose={"point_mm": [0, 0, 0], "approach": [-1, 0, 0], "long_side": [0, 0, 1]}, force=1)
    assert across.e_n == pytest.approx(sj.press(SMOKE, 0.0, 0.0, 1).e_n, rel=1e-9)
    matrix = np.array([[0, 0, -1, 0], [0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1.0]])
    for pose in (matrix, across.pose):
        assert sj.press(SMOKE, pose=pose, force=1).e_n == pytest.approx(across.e_n, rel=1e-9)


def test_a_mesh_that_another_one_has_taken_the_place_of_is_read_again(tmp_path):
    """By a scene that was made before, too."""
    path = tmp_path / "ball.stl"
    trimesh.creation.icosphere(3, 20.0).export(path)
    pose = {"point_mm": [0, 0, 0], "approach": [1, 0, 0], "long_side": [0, 0, 1]}
    scene = sj.Scene.from_dict({
        "object": {"shape": "mesh", "mesh": str(path), "unit": "mm"}, "gripper": {"elements": [8, 4, 2]},
        "candidates": {"poses": [pose]}, "load": {"normal_force_n": [2]}, "accuracy": {"meshes": 1},
    })  # fmt: skip
    for radius in (20.0, 26.0):
        trimesh.creation.icosphere(3, radius).export(path)
        assert sj.press(scene, candidate=0, force=2.0).value("opening") == pytest.approx(2e-3 * radius, rel=1e-3)
    ds = sj.open(run(scene, tmp_path / "ball.hdf"))
    assert float(ds.opening.max()) == pytest.approx(2e-3 * radius, rel=1e-3)


def test_poses_are_turned_and_shifted_as_the_scene_says_but_not_where_a_pad_stands_already():
    moves = {"candidates.roll_deg": 30, "candidates.shift_mm": 8}
    scene = BOXES.with_values(**moves)
    here = candidates(scene)[1].poses[0]
    for given in ({"candidate": 1}, {"pose": scene.effective()["candidates"]["poses"][1]}):
        asked, number = _asked(scene, None, None, given.get("candidate"), given.get("pose"))
        there = candidates(asked)[number].poses[0]
        assert np.allclose([*there.rotation, there.origin], [*here.rotation, here.origin], atol=1e-12)
    case = sj.press(scene, candidate=1, force=5)
    again = sj.press(scene, pose=case.pose, force=5)
    assert again.pose[0] == pytest.approx(case.pose[0], abs=1e-9)
    assert again.e_n == pytest.approx(case.e_n, rel=1e-6)


@pytest.mark.parametrize(("scene", "asked", "error", "words"), [
    ("smoke.toml", {}, TypeError, "expected a Scene"),
    (SMOKE, {"station": 0.5, "angle": 0}, ValueError, r"candidates\.stations_mm.*500"),
    (SMOKE, {"station": "0"}, TypeError, r"station is '0'.*\[m\]"),
    (SMOKE, {"station": np.nan}, ValueError, r"station is nan.*\[m\]"),
    (SMOKE, {"station": 0, "angle": [0.0, 1.0]}, TypeError, r"angle is .*\[rad\]"),
    (SMOKE, {"station": 0}, ValueError, "angle is missing"), (SMOKE, {}, ValueError, "station .*candidate and pose"),
    (SMOKE, {"station": 0, "candidate": 1}, ValueError, "station and candidate"),
    (SMOKE, {"candidate": 0}, ValueError, "give station and angle"),
    (SMOKE, {"station": 0, "angle": 0, "force": -1}, ValueError, r"load\.normal_force_n.*-1"),
    (SMOKE, {"pose": np.eye(3)}, TypeError, r"\(4, 4\)"), (SMOKE, {"pose": "x"}, TypeError, r"\(4, 4\)"),
    (SMOKE, {"pose": np.ones((4, 4))}, ValueError, "last row"), (SMOKE, {"pose": ROTATED.T}, ValueError, "transposed"),
    (SMOKE, {"pose": ROTATED * [1, -1, 1, 1]}, ValueError, "approach"),
    (SMOKE, {"pose": ([0, 0, 0], [0, 0, 0, 1])}, TypeError, "rotations and origins"),
    (SMOKE, {"pose": POSE}, ValueError, r"poses\[0\]\.point_mm"),
    (SMOKE, {"pose": {"point_mm": [0, 0, 0]}}, ValueError, r"approach: found nothing"),
    (BOXES, {"station": 0.0, "angle": 0.0}, ValueError, "candidate=0"),
    (BOXES, {"candidate": 3}, ValueError, "candidate is 3.*0 to 2"),
    (FLASK, {"station": 5.0, "angle": 0}, ValueError, "5000 mm.*0 to 120 mm"),
    (SMOKE.with_values(**{"gripper.max_opening_mm": 20.0}), {"station": 0, "angle": 0}, CaseError, "to 20 mm"),
    (sj.Scene.from_file(JOBS / "smoke.toml", ["sweep.friction.mu=[0.3, 0.8]"]),
     {"station": 0, "angle": 0}, ValueError, r"sweep of friction\.mu.*with_values"),
    (SMOKE.with_values(**{"petsc.contact_snes_tpye": "x"}), {"station": 0, "angle": 0}, sj.StudyError, "tpye"),
    (SMOKE.with_values(**{"petsc.contact_snes_max_it": 1}), {"station": 0, "angle": 0}, CaseError, "MAX_IT"),
])  # fmt: skip
def test_what_names_no_case_is_refused(scene, asked, error, words):
    with pytest.raises(error, match=words):
        sj.press(scene, **{"force": 1.0, **asked})


def test_options_of_the_solver_that_no_result_would_tell_of_are_refused():
    database = PETSc.Options()
    database.setValue("contact_snes_max_it", 1)
    try:
        with pytest.raises(sj.StudyError, match="contact_snes_max_it"):
            check_petsc({})
    finally:
        database.delValue("contact_snes_max_it")
    check_petsc({})
