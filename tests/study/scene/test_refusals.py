"""What would fail every case is refused before anything is solved, and what is seldom meant gets a warning."""

import pytest

from softjaw.study.case.build import check_object, shapes_of, warnings
from softjaw.study.case.candidates import check_candidates
from softjaw.study.cli import main
from softjaw.study.cli.quick import petsc_overrides
from softjaw.study.launch import prepare
from softjaw.study.messages import StudyError
from softjaw.study.scene import load_scene
from tests.study.launching import ROOT, refusal, softjaw
from tests.study.scenes import BALL, mesh_of, pose_of, scene_of, text_of

BOTTLE = 'shape = "revolution"\nprofile_mm = [[0, 30], [50, 30], [100, 29], [200, 20]]'
CYLINDER = 'shape = "elliptic_cylinder"\nsemi_axis_a_mm = 20\nsemi_axis_b_mm = 30\nlength_mm = 200'
BOX = 'shape = "box"\nsize_mm = [60, 40, 120]\nedge_radius_mm = 6'
FLASK = mesh_of(ROOT / "jobs" / "objects" / "flask.stl")


def at(stations, body=BOTTLE, *overrides):
    return scene_of(body, *overrides, where=f"stations_mm = {stations}\n", forces="[1]")


@pytest.mark.parametrize("command", ["check", "plan"])
def test_an_outline_that_makes_no_body_is_refused(tmp_path, capsys, command):
    scene = tmp_path / "scene.toml"
    text = BOTTLE.replace("[[0, 30], [50, 30], [100, 29], [200, 20]]", "[[0, 30], [50, 30], [50, 10], [100, 10]]")
    scene.write_text(text_of(text, stations="[50]"))
    assert main([command, str(scene)]) == 2
    assert capsys.readouterr().err.startswith("error: object.profile_mm: ")


DOMED = 'shape = "revolution"\nprofile_mm = [[0, 0], [4, 18], [12, 28], [40, 30], [120, 30]]'
NECKED = 'shape = "revolution"\nprofile_mm = [[0, 30], [40, 28], [80, 18], [120, 7], [150, 4], [160, 4], [170, 4]]'
SQUARE = 'shape = "sections"' + "".join(
    f"\n[[object.sections]]\nz_mm = {z}\na_mm = 35\nexponent = 20" for z in (0, 40, 80, 120)
)
OVAL = SQUARE.replace("a_mm = 35\nexponent = 20", "a_mm = 40\nb_mm = 12.5\nexponent = 3")


def test_every_object_of_a_sweep_is_judged():
    swept = at([60], NECKED, "sweep.object.wall_mm=[1, 5]", "sweep.friction.mu=[0.5, 0.8]")
    assert [shape.wall_mm for shape in shapes_of(swept)] == [1, 5]
    with pytest.raises(StudyError, match=r"only 4 mm"):
        check_object(swept)
    check_object(at([60], NECKED, "object.wall_mm=1"))


@pytest.mark.parametrize(("body", "key", "expected"), [
    ((DOMED, "object.wall_mm=0.5", "object.base_wall_mm=1"), "base_wall_mm", "a flat bottom"),
    ((NECKED, "object.wall_mm=5"), "wall_mm", "section's radius of curvature is only 4 mm"),
    ((SQUARE, "object.wall_mm=4"), "wall_mm", "section's radius of curvature is only 2.5"),
    ((OVAL, "object.wall_mm=0.7"), "wall_mm", "the wall folds near z = -"),
    ((FLASK, "object.wall_mm=30"), "wall_mm", "a tenth of the mesh's smallest extent"),
])  # fmt: skip
def test_walls_that_their_bodies_cannot_have_are_refused(body, key, expected):
    with pytest.raises(StudyError, match=rf"^object.{key}: .*{expected}"):
        check_object(at([60], *body))


@pytest.mark.parametrize(("body", "wall"), [(DOMED, 0.5), (NECKED, 2), (SQUARE, 2)])
def test_walls_that_their_bodies_can_have_are_not(body, wall):
    check_object(at([60], body, f"object.wall_mm={wall}"))


@pytest.mark.parametrize("body", [BALL, CYLINDER, BOX])
def test_a_pad_that_passes_the_object_is_named_by_its_number(body):
    """The second stands at the corner of the box round the ball."""
    scene = scene_of(body, where=pose_of() + pose_of((0, 48, 46) if body == BALL else (0, 90, 0)))
    with pytest.raises(StudyError, match=r"^candidates.poses\[1\]"):
        check_candidates(scene)


def test_a_pad_that_just_meets_the_object_is_not_refused():
    """A pad 22 mm wide reaches a face at 20 mm from 31 mm off the middle."""
    check_candidates(scene_of(BOX, where=pose_of((0.3, 30.9, 0))))
    with pytest.raises(StudyError):
        check_candidates(scene_of(BOX, where=pose_of((0.3, 31.1, 0))))


@pytest.mark.ranks
@pytest.mark.long
def test_a_run_refuses_poses_off_the_object_by_their_labels(tmp_path):
    text = text_of(BALL, pose_of(label="near") + pose_of((0, 38, 50), label="far"))
    (tmp_path / "scene.toml").write_text(text)
    code, output, errors = softjaw(2, "run", tmp_path / "scene.toml", "-o", tmp_path / "out.hdf")
    assert (code, output) == (2, "")
    assert errors.count("error: candidates.poses[1].point_mm: ") == 1  # mpirun adds lines of its own
    assert not list(tmp_path.glob("out.hdf*"))


@pytest.mark.parametrize("options", ["-contact_snes_type foo", "-contact_snes_rtol abc", "-contact_snes_typ newtonls"])
def test_options_that_no_solver_understands_stop_a_run_before_it_starts(options):
    scene = load_scene(ROOT / "jobs" / "smoke.toml", petsc_overrides(options.split()))
    with refusal(2, match=options.split()[0][1:]):
        prepare(scene, "smoke.toml", [])


@pytest.mark.parametrize("command", ["plan", "run"])
def test_a_result_file_is_named_with_its_ending(tmp_path, command):
    smoke = str(ROOT / "jobs" / "smoke.toml")
    for name in ("noext", "a.h5", "."):
        assert main([command, smoke, "-o", str(tmp_path / name)]) == 2
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("body", "inside", "outside"), [
    (BOTTLE, "[25, 175]", "[20, 100]"), (CYLINDER, "[-75, 75]", "[0, 80]"), (BOX, "[-35, 35]", "[-40]"),
    (FLASK, "[25, 95]", "[10]"),
])  # fmt: skip
def test_pads_that_leave_the_object_along_its_axis_get_a_warning(body, inside, outside):
    assert warnings(at(inside, body)) == ()
    assert len(warnings(at(outside, body))) == 1
    across = warnings(at(outside, body, "candidates.roll_deg=90"))
    assert len(across) == (body == FLASK)  # 22 mm wide: 11 mm to each side


def test_a_swept_pad_that_leaves_the_object_and_stations_in_metres_get_a_warning():
    assert warnings(at([0], CYLINDER, "sweep.object.length_mm=[40, 200]"))
    metres = ("candidates.stations=7", "candidates.stations_mm=[0.025, 0.175]")
    assert len(warnings(at([100], BOTTLE, *metres))) > len(warnings(at([100, 101], BOTTLE))) == 0
    assert len(warnings(at([0.1], BOTTLE))) == 1  # the pad leaves the bottle
    swings = at([100], BOTTLE.replace("[100, 29], [200, 20]", "[80, 20], [200, 20]"))
    assert len(warnings(swings)) == 1  # 2 points do not make a straight wall: its radius is 33 mm
    points = "[[0, 24], [3, 27], [70, 33], [200, 60]]"  # 5 mm off where a cup has radius 29, but nowhere beyond its rim
    assert len(warnings(at([100], f'shape = "revolution"\nprofile_mm = {points}'))) == 1
