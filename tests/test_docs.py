"""The site of docs/: generated pages hold everything that they are made from, and every link leads somewhere."""

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import softjaw as sj
from docs.generate import PAGES
from softjaw.study.cli import main
from softjaw.study.cli.options import COMMANDS
from softjaw.study.doctor import launch_environment
from softjaw.study.flags import Flag
from softjaw.study.quantities import DONE, EFFECTS, TABLE
from softjaw.study.scene import Scene
from tests.study.launching import ROOT, launch

DOCS = ROOT / "docs"
LINK = re.compile(r"\]\(([^)#\s]*)(#[^)\s]*)?\)")
FOLDER = ROOT / "jobs" / "examples"
SOLVING = {"first_map": 6 * 2, "planner": 12 * 4 * 3, "stiffer_pad": 0, "lift": 1}  # and the cases in their files


@cache
def page(name: str) -> str:
    return PAGES[f"reference/{name}.md"]()


def cells(name: str) -> set[str]:
    return {found.strip("`") for found in re.findall(r"^\| (.+?) \|", page(name), re.M)}


def test_every_key_quantity_flag_and_effect_has_a_row_and_every_command_is_shown():
    schema = Scene.model_json_schema()
    models = [*schema["$defs"].values(), schema]
    keys = {key for model in models for key in model.get("properties", {})} - set(schema["properties"]) - {"shape"}
    assert len(keys) > 60
    assert not keys - cells("scene")
    for section in schema["properties"]:
        assert f"## `[{section}]`" in page("scene")
    assert not {q.name for q in TABLE} - cells("quantities")
    assert not {str(int(flag)) for flag in Flag} - cells("flags")
    assert not set(EFFECTS) - cells("flags")
    for name in (name for group in COMMANDS.values() for name, *_ in group):
        assert f"### softjaw {name}\n" in page("commands")
        assert f"usage: softjaw {name} " in page("commands")


def anchors(text: str) -> set[str]:
    heads = re.findall(r"^#+ (.+)$", text, re.M)
    return {"#" + re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", head.lower()).strip()) for head in heads}


@pytest.mark.parametrize("file", [*sorted(DOCS.glob("*.md")), *sorted(ROOT.glob("C*.md"))], ids=lambda file: file.stem)
def test_links_lead_somewhere(file):
    wrong = []
    for target, anchor in LINK.findall(file.read_text()):
        if "://" in target:
            continue
        found = (file.parent / target).resolve() if target else file
        generated = PAGES.get(target)
        if not generated and not found.is_file():
            wrong.append(target)
        elif anchor and anchor not in anchors(generated() if generated else found.read_text()):
            wrong.append(target + anchor)
    assert not wrong


def test_the_navigation_names_every_page_and_none_that_is_not_there_and_the_tutorial_its_scene():
    listed = re.findall(r"^ +- (\S+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.M)
    assert len(listed) == len(set(listed)) > 30
    assert set(PAGES) < set(listed) <= {file.name for file in DOCS.glob("*.md")} | set(PAGES)
    (shown,) = re.findall(r"^```toml\n(.*?)^```$", (DOCS / "tutorial.md").read_text(), re.M | re.S)
    assert tomllib.loads(shown) == tomllib.loads((ROOT / "jobs" / "flask-mesh.toml").read_text())


@pytest.mark.long
def test_the_site_is_built_and_needs_no_network():
    done = subprocess.run(["make", "docs"], cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    if "could not find a version" in done.stderr.lower():
        pytest.skip("mkdocs-material is not here and cannot be had")
    assert done.returncode == 0, done.stdout + done.stderr
    pages = list((ROOT / "build" / "site").rglob("*.html"))
    assert len(pages) > len(PAGES) + 20
    loaded = re.compile(r"""<(?:script|img|iframe|link)\b[^>]*?(?:src|href)=["']?(?:https?:)?//(?!squidfunk)""")
    assert not [page.name for page in pages if loaded.search(page.read_text())]


MARKDOWN = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXT = "\n".join(page.read_text() for page in MARKDOWN)
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
@pytest.mark.usefixtures("plans_in_no_time")
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
    done = subprocess.run([*shlex.split(command), "-n"], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


def test_every_path_that_it_names_exists():
    assert len(PYTEST) > 3
    named = {word for command in PYTEST for word in shlex.split(command) if word.startswith("tests/")}
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]
    named = set(re.findall(r"(?<=[`(])((?:jobs|tests|docs|study)/[\w./-]+\.\w+)(?=[`)])", TEXT))
    assert len(named) > 5
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]


def picture(folder, name):
    return (folder / "results" / f"{name.replace('_', '-')}.png").stat().st_size


@pytest.fixture
def here(folder):
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    (folder / "jobs").symlink_to(ROOT / "jobs")
    yield folder
    plt.close("all")


def test_all_are_tested_friction_alone_falls_as_the_formula_says_and_a_measured_field_is_judged(here):
    assert {path.stem for path in FOLDER.glob("*.py")} == {*SOLVING, "friction_alone", "measured_pressure", "data_set"}
    across, formula, e_n = np.transpose(runpy.run_path(str(FOLDER / "friction_alone.py"))["curves"])
    assert across == pytest.approx(formula, rel=1e-3)
    assert (np.diff(e_n) < 0).all()
    assert picture(here, "friction_alone") > 10_000
    found = runpy.run_path(str(FOLDER / "measured_pressure.py"))
    assert found["held"].tolist() == [True, False]
    errors = [found["fits"][kind].fit_error.Erad for kind in ("quartic", "full", "three_motions")]
    assert errors == sorted(errors)
    assert found["limits"]["pcm"].e_n > found["limits"]["ccm"].e_n
    assert picture(here, "measured_pressure") > 10_000


@pytest.mark.long
@pytest.mark.parametrize("name", SOLVING)
def test_scripts_that_solve(name, tmp_path):
    if name == "lift":
        pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install mujoco")
    env = {**launch_environment(), "MPLBACKEND": "Agg"}
    code, output, errors = launch(0, FOLDER / f"{name}.py", env=env, cwd=tmp_path, timeout=300)
    assert (code, errors) == (0, "")
    assert picture(tmp_path, name) > 10_000
    if cases := SOLVING[name]:
        ds = sj.open(tmp_path / "results" / f"{name.replace('_', '-')}.hdf")
        assert (ds.status.size, int((ds.status == DONE).sum())) == (cases, cases)
    if name == "lift":
        risen = [float(line.partition("rose by ")[2].split()[0]) for line in output.splitlines() if "rose by" in line]
        assert risen == [pytest.approx(60.0, abs=1.0), pytest.approx(0.0, abs=1.0)]  # mm
    if name == "planner":
        assert int(output.partition(" better grasps are out of reach")[0].rpartition("\n")[2]) > 0


def python_blocks(page):
    return "\n".join(re.findall(r"^```python\n(.*?)^```$", (ROOT / page).read_text(), re.M | re.S))


@pytest.mark.long
def test_the_page_on_python_runs_as_it_stands(here, capsys):
    found = {}
    exec(compile(python_blocks("docs/python.md"), "docs/python.md", "exec"), found)
    assert found["code"] == 0
    assert found["case"].e_n == float(found["ds"]["e_n"].sel(model="ccm", angle=0, normal_force=2).item())
    assert "payload" in capsys.readouterr().out
    text = (ROOT / "docs" / "python.md").read_text()
    assert all(f"`{name}`" in text for name in sj.__all__)
    assert f"gives {len(sj.__all__)} names" in text


@pytest.mark.long
def test_the_block_of_the_readme_runs(here, capsys):
    exec(compile(python_blocks("README.md"), "README.md", "exec"), {})
    assert float(capsys.readouterr().out.split()[0]) > 0
