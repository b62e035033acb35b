"""The batch scripts under a stand-in for Slurm: an mpirun that a signal stops, and a scontrol that notes its words."""

import os
import signal
import subprocess

import pytest

from softjaw.study.cli import main
from softjaw.study.scene.start import HERE
from tests.study.launching import ROOT, wait_for

SHARED = "# ---- the same in all scripts"
SCRIPTS = sorted((ROOT / "jobs" / "slurm").glob("*.sbatch"))
# The first start works until USR1 comes and then has cases missing; the next one finishes.
MPIRUN = """#!/bin/bash
printf '%s\n' "$*" >> calls
[ -n "$FAKE_CODE" ] && exit "$FAKE_CODE"
[ -e stopped ] && exit 0
trap 'touch stopped; sleep 0.2; exit 75' USR1
touch working
while :; do sleep 0.02; done
"""
SCONTROL = '#!/bin/bash\necho "scontrol $*" >> calls\n'


@pytest.fixture
def slurm(tmp_path):
    """A folder with a stand-in for mpirun and scontrol, and the variables of a job in it."""
    for name, text in (("mpirun", MPIRUN), ("scontrol", SCONTROL)):
        program = tmp_path / "bin" / name
        program.parent.mkdir(exist_ok=True)
        program.write_text(text)
        program.chmod(0o755)
    job = {"SLURM_JOB_ID": "4711", "SLURM_NTASKS": "3", "SLURM_ARRAY_TASK_ID": "2"}
    return {**os.environ, **job, "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}"}


def started(script, folder, env, *words, **more):
    words = ["bash", str(script), *words]
    return subprocess.Popen(words, cwd=folder, env={**env, **more}, stdout=subprocess.PIPE, text=True)


def finished(*words, **more):
    process = started(*words, **more)
    output, _ = process.communicate(timeout=30)
    return process.returncode, output


def calls(folder):
    return (folder / "calls").read_text().splitlines()


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_signal_stops_the_run_and_puts_the_job_back_into_the_queue(script, tmp_path, slurm):
    words, more = ["b.toml", "--set", "friction.mu=0.5"], {}
    if script.stem == "array":
        words, more = ["a.toml", "b.toml"], {"OPTIONS": "--set friction.mu=0.5"}
    process = started(script, tmp_path, slurm, *words, **more)
    wait_for((tmp_path / "working").exists)
    process.send_signal(signal.SIGUSR1)
    output, _ = process.communicate(timeout=30)
    assert process.returncode == 75, output
    run = "-n 3 .venv/bin/softjaw run b.toml --set friction.mu=0.5"
    assert calls(tmp_path) == [run, "scontrol requeue 4711"]
    assert finished(script, tmp_path, slurm, *words, SLURM_RESTART_COUNT="1", **more)[0] == 0
    assert calls(tmp_path) == [run, "scontrol requeue 4711", run]


@pytest.mark.parametrize(("job", "code", "back"), [
    ({"FAKE_CODE": "138"}, 75, True),  # a signal that comes before the run has begun
    ({"FAKE_CODE": "75", "SLURM_RESTART_COUNT": "5", "MOST_RESTARTS": "5"}, 75, False),  # one that never ends
    *(({"FAKE_CODE": str(code)}, code, False) for code in (0, 2, 6, 70, 137)),
])  # fmt: skip
def test_only_a_run_that_was_stopped_is_put_back_and_not_for_ever(tmp_path, slurm, job, code, back):
    assert finished(SCRIPTS[-1], tmp_path, slurm, "a.toml", **job)[0] == code
    assert calls(tmp_path)[1:] == ["scontrol requeue 4711"] * back


def test_all_scripts_are_sound_and_share_what_they_do(tmp_path, slurm, monkeypatch, capsys):
    texts = [path.read_text() for path in (*SCRIPTS, HERE / "run.sbatch")]
    assert len(texts) == 4
    assert len({text.partition(SHARED)[2] for text in texts}) == 1
    monkeypatch.chdir(tmp_path)
    assert main(["init", "bottle"]) == 0
    for path in (*SCRIPTS, tmp_path / "bottle.sbatch"):
        assert subprocess.run(["bash", "-n", path], capture_output=True, check=False).stderr == b""
        asked = [line for line in path.read_text().splitlines() if line.startswith("#SBATCH")]
        assert any("--signal=B:USR1@" in line for line in asked)
        assert any("--requeue" in line for line in asked)
        assert any("--cpus-per-task=1" in line for line in asked)
    assert finished(tmp_path / "bottle.sbatch", tmp_path, slurm, FAKE_CODE="0")[0] == 0
    assert calls(tmp_path)[0].startswith("-n 3 /")
    assert calls(tmp_path)[0].endswith("softjaw run bottle.toml")
