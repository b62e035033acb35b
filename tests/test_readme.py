"""Every command of the README does what the README says."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from study.environment import launch_environment, mpirun

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
BLOCKS = [block.strip().splitlines() for block in re.findall(r"^```\n(.*?)^```$", README, re.M | re.S)]
SOFTJAW = [[line for line in block if "softjaw " in line] for block in BLOCKS if not block[0].startswith("conda")]
FIRST = "mpirun -n 2 softjaw run jobs/smoke.toml"


def slow(block: list[str]) -> bool:
    """Whether a block solves something, except for the first that a reader tries."""
    return any("softjaw run " in line and FIRST not in line for line in block)


pytestmark = pytest.mark.launches


def words(line: str) -> list[str]:
    """The command with this interpreter's softjaw and an mpirun that this machine accepts."""
    given = shlex.split(line)
    if given[0] == "mpirun":
        given = [*mpirun(int(given[2])), *given[3:]]
    at = given.index("softjaw")
    return [*given[:at], sys.executable, "-m", "study", *given[at + 1 :]]


def run_in(folder: Path, block: list[str]) -> None:
    """Run the lines of a block one after the other, each to exit code 0."""
    (folder / "jobs").symlink_to(ROOT / "jobs")
    for line in block:
        done = subprocess.run(
            words(line), cwd=folder, env={**launch_environment(), "PYTHONPATH": str(ROOT)}, stdin=subprocess.DEVNULL,
            capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        for made in re.findall(r"-o (\S+)", line):
            assert (folder / made).stat().st_size > 1000


@pytest.mark.parametrize("block", [b for b in SOFTJAW if b and not slow(b)], ids=lambda b: b[0][:60])
def test_commands_of_a_block(block, tmp_path):
    if any("results/smoke.hdf" in line for line in block) and not any(" run " in line for line in block):
        pytest.fail("a block must make the file that it shows")
    run_in(tmp_path, block)


@pytest.mark.long
@pytest.mark.parametrize("block", [b for b in SOFTJAW if slow(b)], ids=lambda b: b[0][:60])
def test_commands_that_take_longer(block, tmp_path):
    run_in(tmp_path, block)


MADE = sorted(set(re.findall(r"^make [a-z].*?(?=  +#|$)|(?<=`)make [^`]+(?=`)", README, re.M)))


@pytest.mark.parametrize("command", MADE)
def test_make_knows_the_target(command):
    done = subprocess.run(
        [*shlex.split(command), "-n"], cwd=ROOT, env=dict(os.environ), capture_output=True, text=True, timeout=60,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


# One process looks for all of them: it imports everything once.
COLLECT = """
import shlex, sys, pytest
for command in sys.argv[1:]:
    code = pytest.main(["--collect-only", "-q", *shlex.split(command)[1:]])
    if code:
        sys.exit(f"{command}: {code!r}")
"""


PYTEST = sorted(set(re.findall(r"(?<=`)pytest [^`]+(?=`)", README)))


def test_the_test_files_that_it_names_exist():
    assert len(PYTEST) > 3
    named = {word for command in PYTEST for word in shlex.split(command) if word.startswith("tests/")}
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]


@pytest.mark.long
def test_pytest_finds_the_tests():
    done = subprocess.run(
        [sys.executable, "-c", COLLECT, *PYTEST], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_path_that_it_names_exists():
    named = set(re.findall(r"(?<=[`(])((?:jobs|tests|docs|study)/[\w./-]+\.\w+)(?=[`)])", README))
    assert len(named) > 5
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]
