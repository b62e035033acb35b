"""The tests in stages: ``python -m tests.stages test`` or ``test-long``, with names of stages to run only those.

The last lines report what passed, the time of each stage, what was left out, and the command for it. Exit code: 0 when
all stages passed, 1 when one failed, 2 when a tool was missing for one.
"""

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path

from softjaw.study.doctor import launch_environment
from tests.blas import NEEDS, usable

ROOT = Path(__file__).parents[1]
NUMERICAL = ("tests/friction", "tests/lsfit", "tests/scoring", "tests/fem", "tests/test_stages.py")
CANNOT_RUN = 77  # exit code of a program that lacks something, as in automake
SIDE_BY_SIDE = ("-n", "2", "--dist", "loadfile")
MINUTE = 60


@dataclass(frozen=True)
class Stage:
    """One run of pytest or of another program; ``needs`` are programs without which it cannot run."""

    name: str
    words: tuple[str, ...]
    minutes: float
    needs: tuple[str, ...] = ()
    variables: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """How a stage ended; ``passed`` is None where it could not run."""

    stage: Stage
    passed: bool | None
    text: str
    seconds: float = 0.0


def workers() -> tuple[str, ...]:
    several = len(os.sched_getaffinity(0)) > 1 and importlib.util.find_spec("xdist") is not None
    return SIDE_BY_SIDE if several else ()


def tests(mark: str, *words: str) -> tuple[str, ...]:
    return (sys.executable, "-m", "pytest", "-q", "-m", mark, *words)


def naming(text: str, pattern: str = "test_*.py") -> list[str]:
    """Files of tests with a text in them: collecting all takes a sixth of a short stage."""
    files = sorted((ROOT / "tests").rglob(pattern))
    return [str(file.relative_to(ROOT)) for file in files if text in file.read_text()]


def fast() -> list[Stage]:
    """What ``make test`` runs."""
    return [
        Stage("serial", tests("not long and not ranks", *workers()), 20),
        Stage("ranks", tests("ranks and not long", *workers(), *naming("mark.ranks")), 10, ("mpirun",)),
    ]


def thorough() -> list[Stage]:
    """What ``make test-long`` runs."""
    decisions = naming("", "test_*decisions.py")
    kernels = [
        Stage(f"kernel-{kernel}", tests("not long and not ranks", *workers(), *NUMERICAL), 20,
              variables={"OPENBLAS_CORETYPE": kernel})
        for kernel in usable()
    ]  # fmt: skip
    return [
        Stage("long", tests("long and not ranks", "--durations", "20", *workers()), 180),
        Stage("long-ranks", tests("long and ranks", "--durations", "10"), 60, ("mpirun",)),
        Stage("decisions", tests("not ranks", *workers(), *decisions), 60, variables={"TURNS": "200"}),
        *kernels,
        Stage("slurm", ("tests/slurm/cluster.sh", "results/slurm/cluster", sys.executable, "-m",
                        "tests.slurm.time_limit"), 60, ("mpirun",)),
    ]  # fmt: skip


def counted(report: Path) -> str:
    if not report.exists():
        return ""
    suite = next(ElementTree.parse(report).iter("testsuite"))
    total, skipped, failed, errors = (int(suite.get(key, 0)) for key in ("tests", "skipped", "failures", "errors"))
    parts = {"passed": total - skipped - failed - errors, "skipped": skipped, "failed": failed + errors}
    return ", ".join(f"{count} {word}" for word, count in parts.items() if count)


def run(stage: Stage) -> Outcome:
    if missing := [name for name in stage.needs if shutil.which(name) is None]:
        return Outcome(stage, None, f"not installed: {', '.join(missing)}")
    settings = [f"{name}={value}" for name, value in stage.variables.items()]
    print(f"\n== {stage.name}: {' '.join([*settings, *stage.words])}", flush=True)
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        words = [*stage.words, f"--junitxml={report}"] if "pytest" in stage.words else list(stage.words)
        environment = {**launch_environment(), **stage.variables}
        with subprocess.Popen(words, cwd=ROOT, env=environment, start_new_session=True) as process:
            try:
                code = process.wait(stage.minutes * MINUTE)
                text = counted(report) or f"exit code {code}"
            except BaseException as error:  # at Ctrl-C too nothing goes on in the background
                os.killpg(process.pid, signal.SIGTERM)
                if not isinstance(error, subprocess.TimeoutExpired):
                    raise
                code, text = 124, f"stopped after {stage.minutes:g} minutes"
    passed = None if code == CANNOT_RUN else code == 0
    return Outcome(stage, passed, text, time.monotonic() - begun)


def report(command: str, outcomes: list[Outcome]) -> int:
    print()
    for outcome in outcomes:
        word = {True: "passed", False: "FAILED", None: "LEFT OUT"}[outcome.passed]
        print(f"{word:9} {outcome.stage.name:16} {outcome.seconds:6.0f} s  {outcome.text}")
    if not workers():
        print("one core or no pytest-xdist: the files of tests ran one after the other")
    if command == "test":
        print("left out: long tests, kernels of the BLAS, Slurm; run 'make test-long'")
    elif unusable := sorted(set(NEEDS) - set(usable())):
        print(f"left out: kernels of the BLAS that this CPU cannot run: {', '.join(unusable)}")
    missing = [outcome for outcome in outcomes if outcome.passed is None]
    for outcome in missing:
        again = f"make {command} STAGES={outcome.stage.name}"
        print(f"incomplete: '{outcome.stage.name}' did not run ({outcome.text}); see above, then run '{again}'")
    if any(outcome.passed is False for outcome in outcomes):
        return 1
    return 2 if missing else 0


def main(command: str, *names: str) -> int:
    stages = {"test": fast, "test-long": thorough}[command]()
    if unknown := set(names) - {stage.name for stage in stages}:
        print(f"unknown stages: {', '.join(sorted(unknown))}; there are {', '.join(s.name for s in stages)}")
        return 2
    return report(command, [run(stage) for stage in stages if not names or stage.name in names])


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
