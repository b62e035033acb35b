"""Every command of the README and of docs/ does what it says."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from softjaw.study.cli import main
from softjaw.study.doctor import launch_environment

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXT = "\n".join(page.read_text() for page in PAGES)
FENCED = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.M | re.S)
BLOCKS = [block.strip().splitlines() for language, block in FENCED if language != "python"]
TYPED = re.compile(r"^(mkdir|cat|python) |softjaw ")
TYPED_IN = [[line for line in block if TYPED.search(line)] for block in BLOCKS if not block[0].startswith("conda")]
SOFTJAW = [list(block) for block in dict.fromkeys(map(tuple, TYPED_IN))]
FIRST = "mpirun -n 2 softjaw run jobs/smoke.toml"
SOLVES = re.compile(r"softjaw cost ")
PLAIN = re.compile(r"(mpirun -n 2 )?softjaw run jobs/smoke.toml -o \S+")
SOLVED: dict[str, bytes] = {}  # what a run has made
LONG_RUNS = ("results/bottle.hdf",)  # files of runs of many minutes; a small one of the same name stands for them
MADE = sorted(set(re.findall(r"^make [a-z].*?(?=  +#|$)|(?<=`)make [^`]+(?=`)", TEXT, re.M)))
PYTEST = sorted(set(re.findall(r"(?<=`)pytest [^`]+(?=`)", TEXT)))


def slow(block: list[str]) -> bool:
    """Whether a block solves something, except for the first that a reader tries."""
    return any(("softjaw run " in line and FIRST not in line) or SOLVES.search(line) for line in block)


def shell(line: str, folder: Path) -> None:
    programs = folder / "bin"
    programs.mkdir(exist_ok=True)
    (programs / "softjaw").write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m softjaw "$@"\n')
    (programs / "python").write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} "$@"\n')
    for program in programs.iterdir():
        program.chmod(0o755)
    path = f"{programs}:{os.environ['PATH']}"
    env = {**launch_environment(), "PYTHONPATH": str(ROOT), "PATH": path, "HOME": str(folder)}
    done = subprocess.run(
        ["bash", "-c", line], cwd=folder, env=env, stdin=subprocess.DEVNULL, capture_output=True,
        text=True, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


def run_in(folder: Path, block: list[str]) -> None:
    """Type the lines of a block one after the other, each to exit code 0; a run that was typed before only once.

    What starts no ranks is called in this process: a start costs more than most commands.
    """
    (folder / "jobs").symlink_to(ROOT / "jobs")
    instead = [f"softjaw run jobs/smoke.toml -o {file}" for file in LONG_RUNS if file in "".join(block)]
    for line in [*instead, *block]:
        made = re.findall(r"-o (\S+\.\w+)", line)
        if line in SOLVED:
            (folder / made[0]).parent.mkdir(exist_ok=True)
            (folder / made[0]).write_bytes(SOLVED[line])
        elif line.startswith("softjaw ") and not re.search(r"[|>$;&]| -- ", line):
            assert main(shlex.split(line, comments=True)[1:]) == 0, line
        else:
            shell(line, folder)
        for objects in folder.glob("results/meshes/*.csv"):  # a few stand for all
            objects.write_text("".join(objects.read_text().splitlines(keepends=True)[:4]))
        for file in made:
            assert (folder / file).stat().st_size > 300
        if PLAIN.fullmatch(line):
            SOLVED[line] = (folder / made[0]).read_bytes()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def blocks(of_many_minutes: bool) -> list:
    """Blocks that are slow, or those that are not; marked where ranks are started."""
    return [
        pytest.param(block, id=block[0][:60], marks=[pytest.mark.ranks] if "mpirun" in " ".join(block) else [])
        for block in SOFTJAW
        if block and slow(block) == of_many_minutes
    ]


@pytest.mark.parametrize("block", blocks(False))
def test_commands_of_a_block(block, folder):
    if any("results/smoke.hdf" in line for line in block) and not any(" run " in line for line in block):
        pytest.fail("a block must make the file that it shows")
    run_in(folder, block)


@pytest.mark.long
@pytest.mark.parametrize("block", blocks(True))
def test_commands_that_take_longer(block, folder):
    if shutil.which(program := block[0].split()[0]) is None and program not in ("python", "softjaw"):
        pytest.skip(f"{program} is not installed")
    run_in(folder, block)


@pytest.mark.parametrize("command", MADE)
def test_make_knows_the_target(command):
    done = subprocess.run(
        [*shlex.split(command), "-n"], cwd=ROOT, env=dict(os.environ), capture_output=True, text=True, timeout=60,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_every_path_that_it_names_exists():
    assert len(PYTEST) > 3
    named = {word for command in PYTEST for word in shlex.split(command) if word.startswith("tests/")}
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]
    named = set(re.findall(r"(?<=[`(])((?:jobs|tests|docs|study)/[\w./-]+\.\w+)(?=[`)])", TEXT))
    assert len(named) > 5
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]
