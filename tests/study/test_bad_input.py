"""Bad input through the program itself: one clear sentence, the right exit code, nothing started, nothing left."""

import shutil
import subprocess
import sys

import numpy as np
import pytest
import trimesh

from softjaw.study.cli import main
from softjaw.study.doctor import launch_environment
from softjaw.study.quantities import DONE, FAILED
from softjaw.study.result.store import open_result
from tests.study.launching import ROOT, softjaw
from tests.study.scenes import BALL, QUICK, mesh_of, text_of

SCENE = text_of(BALL, elements="[4, 4, 2]")
MESH = text_of(mesh_of("body.stl"), stations="[50]", elements="[4, 4, 2]")
FLASK = ROOT / "jobs" / "objects" / "flask.stl"


@pytest.fixture
def folder(tmp_path):
    """A folder with a scene of a ball and one of a mesh that is the shipped flask."""
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "mesh.toml").write_text(MESH)
    shutil.copy(FLASK, tmp_path / "body.stl")
    return tmp_path


def run(ranks, folder, *words, scene="scene.toml"):
    return softjaw(ranks, "run", folder / scene, "-o", folder / "out.hdf", *words)


def refused(answer, folder, code, *words, sentences=1):
    """Assert so many sentences on stderr, this exit code, nothing on stdout, no file and no traceback."""
    found, output, errors = answer
    assert found == code, errors
    assert errors.count("error: ") == sentences, errors
    assert "Traceback" not in errors
    for word in words:
        assert word in errors, errors
    assert output == ""
    assert not list(folder.glob("out.hdf*"))


def test_a_wrong_scene_starts_nothing(folder):
    """All errors at once, out of the program; tests/study/scene has each of them."""
    text = SCENE
    for old, new in (
        ("radius_mm = 30", "colour = 3"), ("[4, 4, 2]", "[4, 4, 2]\npad_thickness_mm = 0.01"),
        ("stations_mm = [0]", 'stations_mm = "top"'), ("normal_force_n = [2]", "normal_force_n = [-2]"),
    ):  # fmt: skip
        text = text.replace(old, new)
    (folder / "scene.toml").write_text(text)
    keys = ("object.colour", "object.radius_mm", "pad_thickness_mm", "stations_mm", "normal_force_n")
    refused(run(0, folder), folder, 2, *keys, sentences=len(keys))


@pytest.mark.parametrize(("scale", "key"), [
    (1e3 * 200 / 120, "object.mesh"), (1e-3, "object.mesh"), (0.3, "candidates"), (None, "object.mesh"),
], ids=["200 m", "metres", "too short", "missing"])  # fmt: skip
def test_a_mesh_that_is_no_object_is_refused_by_check(folder, scale, key, capsys):
    path = folder / "body.stl"
    if scale is None:
        path.unlink()
    else:
        trimesh.load(path).apply_scale(scale).export(path)
    code = main(["check", str(folder / "mesh.toml")])
    told = capsys.readouterr()
    refused((code, told.out, told.err), folder, 2, key)


def every_rank(folder, *words):
    """Exit codes of two ranks, each told by a shell of its own, and standard error."""
    scene, out = str(folder / "scene.toml"), str(folder / "out.hdf")
    program = [sys.executable, "-m", "softjaw", "run", scene, "-o", out, *words]
    done = subprocess.run(
        ["timeout", "-k", "5", "60", "mpirun", "-n", "2", "--oversubscribe", "sh", "-c", '"$@"; echo "code $?"', "sh",
         *program],
        env=launch_environment(), cwd=ROOT, capture_output=True, text=True, timeout=70, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    return [int(line[5:]) for line in done.stdout.splitlines() if line.startswith("code ")], done.stderr


@pytest.mark.ranks
@pytest.mark.parametrize(("words", "code"), [(("--set", "friction.mu=-1"), 2), ((), 3)], ids=["scene", "file"])
def test_all_ranks_leave_a_wrong_scene_or_a_file_of_others_with_the_same_code(folder, words, code):
    (folder / "out.hdf").write_text("my notes")
    codes, errors = every_rank(folder, *words)
    assert codes == [code, code]
    assert errors.count("error: ") == 1
    assert (folder / "out.hdf").read_text() == "my notes"


def test_cases_that_cannot_be_solved_fail_with_their_reasons_and_the_others_go_on(folder):
    """A small ball sinks into the pad for ever; beside the middle a ball has one plane of symmetry, not two."""
    study = (
        "sweep.object.radius_mm=[5, 30]", 'effects.model_size="quarter"', "candidates.stations_mm=[0, 3]",
        "load.normal_force_n=[2, 20, 30]", "gripper.elements=[8, 4, 2]", *QUICK,
    )  # fmt: skip
    code, _, errors = run(0, folder, *[word for value in study for word in ("--set", value)])
    assert code == 6, errors
    assert "Traceback" not in errors
    with open_result(folder / "out.hdf") as result:
        status, quality, messages = (x[:, :, 0] for x in (result.status, result.read("quality/ccm"), result.messages))
    # radius, station, force: the small ball in the middle has the first force, the large one all
    done = [[[True, False, False], [False] * 3], [[True] * 3, [False] * 3]]
    assert (status == DONE).tolist() == done
    assert np.isfinite(quality).tolist() == done
    assert all(messages[status == FAILED])
