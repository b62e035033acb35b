"""Bad input through the program itself: one clear sentence, the right exit code, nothing started, nothing left."""

import subprocess
import sys

import numpy as np
import pytest

from softjaw.study.doctor import launch_environment
from softjaw.study.quantities import DONE, FAILED
from softjaw.study.result.store import open_result
from tests.study.launching import ROOT, softjaw
from tests.study.scenes import BALL, QUICK, text_of


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "scene.toml").write_text(text_of(BALL, elements="[4, 4, 2]"))
    return tmp_path


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
@pytest.mark.parametrize(("words", "code", "sentences"), [
    (("--set", "friction.mu=-1", "--set", "object.colour=3"), 2, 2), ((), 3, 1),
], ids=["scene", "file"])  # fmt: skip
def test_all_ranks_leave_a_wrong_scene_or_a_file_of_others_with_the_same_code(folder, words, code, sentences):
    (folder / "out.hdf").write_text("my notes")
    codes, errors = every_rank(folder, *words)
    assert codes == [code, code]
    assert errors.count("error: ") == sentences
    assert (folder / "out.hdf").read_text() == "my notes"


def test_cases_that_cannot_be_solved_fail_with_their_reasons_and_the_others_go_on(folder):
    """A small ball sinks into the pad for ever; beside the middle a ball has one plane of symmetry, not two."""
    study = (
        "sweep.object.radius_mm=[5, 30]", 'effects.model_size="quarter"', "candidates.stations_mm=[0, 3]",
        "load.normal_force_n=[2, 20, 30]", "gripper.elements=[8, 4, 2]", *QUICK,
    )  # fmt: skip
    changes = [word for value in study for word in ("--set", value)]
    code, _, errors = softjaw(0, "run", folder / "scene.toml", "-o", folder / "out.hdf", *changes)
    assert code == 6, errors
    assert "Traceback" not in errors
    with open_result(folder / "out.hdf") as result:
        status, quality, messages = (x[:, :, 0] for x in (result.status, result.read("quality/ccm"), result.messages))
    # radius, station, force: the small ball in the middle has the first force, the large one all
    done = [[[True, False, False], [False] * 3], [[True] * 3, [False] * 3]]
    assert (status == DONE).tolist() == done
    assert np.isfinite(quality).tolist() == done
    assert all(messages[status == FAILED])
