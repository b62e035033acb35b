"""Does a study that Slurm's time limit kills end with the same numbers as one that nothing interrupts?

    tests/slurm/cluster.sh LOGS python -m tests.slurm.time_limit

The shipped batch script is submitted with time enough, with a limit that it hears of before, so that it stops in order
and goes back into the queue, and with one that Slurm enforces without a word, after which it is submitted once more.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from tests.study.launching import ROOT, contents, differing

SCRIPT = ROOT / "jobs" / "slurm" / "one-node.sbatch"
SCENE = ROOT / "tests" / "slurm" / "bottle.toml"
RANKS = 2
HOUR = 3600.0
ENDED = ("COMPLETED", "FAILED", "TIMEOUT", "CANCELLED", "NODE_FAIL", "OUT_OF_MEMORY")


def slurm(*words: str) -> str:
    return subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout.strip()


def job_field(job: str, name: str) -> str:
    words = dict(word.partition("=")[::2] for word in slurm("scontrol", "show", "job", job).split())
    return words[name]


def submitted(folder: Path, *options: str) -> str:
    """Submit the script for a copy of the scene in a folder; the job's number."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(SCENE, folder)
    words = ("sbatch", "--parsable", f"--ntasks={RANKS}", f"--chdir={folder}", *options, str(SCRIPT), SCENE.name)
    return slurm(*words)


def ended(job: str) -> str:
    deadline = time.monotonic() + HOUR
    while (state := job_field(job, "JobState")) not in ENDED:
        if time.monotonic() > deadline:
            raise TimeoutError(f"job {job} is {state} after an hour")
        time.sleep(2)
        if state == "PENDING" and job_field(job, "Reason") == "BeginTime":
            # Slurm lets a job wait two minutes before it starts again. Some of that is needed: within a second of the
            # end of the last start its new credential is refused, and the job fails.
            time.sleep(5)
            slurm("scontrol", "update", f"JobId={job}", "StartTime=now")
    return state


def report(name: str, job: str) -> None:
    state, starts, code = job_field(job, "JobState"), int(job_field(job, "Restarts")) + 1, job_field(job, "ExitCode")
    print(f"{name:<10} job {job}: {state}, {starts} start(s), exit code {code}", flush=True)


def main() -> int:
    top = ROOT / "results" / "slurm"
    os.environ["SOFTJAW"] = str(ROOT / ".venv" / "bin" / "softjaw")
    os.environ["MOST_RESTARTS"] = "100"  # on a busy machine a start may end before it has solved much
    file = Path("results") / f"{SCENE.stem}.hdf"
    for name in ("whole", "stopped", "killed"):
        shutil.rmtree(top / name, ignore_errors=True)
    jobs, states = {}, []
    for name, folder, *options in (
        ("whole", "whole", "--time=60"), ("stopped", "stopped", "--time=3", "--signal=B:USR1@100"),
        ("killed", "killed", "--time=1", "--signal=B:CONT@1"), ("again", "killed", "--time=60"),
    ):  # fmt: skip
        jobs[name] = submitted(top / folder, *options)
        states.append(ended(jobs[name]))
        report(name, jobs[name])
    expected = contents(top / "whole" / file)
    unlike = {name: differing(top / name / file, expected) for name in ("stopped", "killed")}
    for name, found in unlike.items():
        equal = f"{len(expected) - len(found)} of {len(expected)} datasets"
        print(f"{name}: {equal} equal those of the whole run, byte for byte")
        print("".join(f"  differs: {dataset}\n" for dataset in found), end="")
    restarts = int(job_field(jobs["stopped"], "Restarts"))
    as_meant = states == ["COMPLETED", "COMPLETED", "TIMEOUT", "COMPLETED"] and restarts > 0
    return int(any(unlike.values()) or not as_meant)


if __name__ == "__main__":
    sys.exit(main())
