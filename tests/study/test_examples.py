"""The examples in the help of every command, run as they stand on what a small study made."""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys

import pytest

from softjaw.study.cli import program
from softjaw.study.doctor import launch_environment
from tests.study.launching import ROOT, launch

pytestmark = pytest.mark.long
SOLVING = ("cost",)  # minutes, and tested elsewhere; that their examples are well formed is tested in test_cli
PARSERS = next(a for a in program()._actions if isinstance(a, argparse._SubParsersAction)).choices
EXAMPLES = [
    line.strip()
    for name, made in PARSERS.items()
    if name not in SOLVING
    for line in str(made.epilog).partition("\n\n")[0].splitlines()[1:]
]


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A finished study of seconds, which stands in for all results that the examples name."""
    path = tmp_path_factory.mktemp("solved") / "smoke.hdf"
    code, output, errors = launch(0, "-m", "softjaw", "run", ROOT / "jobs" / "smoke.toml", "-o", path)
    assert code == 0, output + errors
    return path


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_does_what_it_says(example, solved, tmp_path):
    (tmp_path / "jobs").symlink_to(ROOT / "jobs")
    (tmp_path / "results").mkdir()
    made = re.findall(r"(?:-o|>|--screenshot) (\S+)", example)
    for name in set(re.findall(r"results/\S+\.hdf", example)) - set(made):
        shutil.copy(solved, tmp_path / name)
    command = example.replace("mpirun -n 8 ", "").replace("softjaw ", f"{sys.executable} -m softjaw ", 1)
    done = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, env={**launch_environment(), "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, timeout=300, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    for name in made:
        found = tmp_path / (f"{name}.toml" if command.split()[3] == "init" else name)
        assert found.stat().st_size > 100, name
