"""Bad input through the program itself: one clear sentence, the right exit code, nothing started, nothing left."""

import subprocess
import sys

import pytest

from softjaw.study.doctor import launch_environment
from tests.study.launching import ROOT
from tests.study.scenes import BALL, text_of


@pytest.mark.ranks
@pytest.mark.parametrize(("words", "code", "sentences"), [
    (("--set", "friction.mu=-1", "--set", "object.colour=3"), 2, 2), ((), 3, 1),
], ids=["scene", "file"])  # fmt: skip
def test_all_ranks_leave_a_wrong_scene_or_a_file_of_others_with_the_same_code(tmp_path, words, code, sentences):
    scene, out = tmp_path / "scene.toml", tmp_path / "out.hdf"
    scene.write_text(text_of(BALL, elements="[4, 4, 2]"))
    out.write_text("my notes")
    shell = ["mpirun", "-n", "2", "--oversubscribe", "sh", "-c", '"$@"; echo "code $?"', "sh"]  # of each rank
    done = subprocess.run(
        ["timeout", "-k", "5", "60", *shell, sys.executable, "-m", "softjaw", "run", scene, "-o", out, *words],
        env=launch_environment(), cwd=ROOT, capture_output=True, text=True, timeout=70, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert [int(line[5:]) for line in done.stdout.splitlines() if line.startswith("code ")] == [code, code]
    assert done.stderr.count("error: ") == sentences
    assert out.read_text() == "my notes"
