"""The command line: answers, exit codes, and how little ``--help``, ``check``, ``plan`` and ``status`` load."""

import argparse
import csv
import io
import os
import shlex
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.study.cli import main, program
from softjaw.study.cli.quick import petsc_overrides
from softjaw.study.doctor import launch_environment
from softjaw.study.messages import CANNOT_WRITE, OTHER_FILE, StudyError, beside, make_folders, write_file
from softjaw.study.run import session
from softjaw.study.show.report import writing as report
from tests.study.launching import ROOT, answer, launch, refusal
from tests.study.launching import study as run_fake
from tests.study.scenes import BALL, text_of
from tests.study.view_files import make

PARSERS = next(a for a in program()._actions if isinstance(a, argparse._SubParsersAction)).choices
HEAVY = ("mpi4py", "petsc4py", "numba", "skfem", "pyvista", "matplotlib", "scipy")
OUTLINE = "jobs/bottle-rigid.toml"  # a body of revolution: its outline is drawn to be judged
QUICK = ("--help", "init --help", "check SCENE", f"check {OUTLINE}", "status FILE", "show FILE",
         "patch jobs/cylinder-pressure.csv --surface full")  # fmt: skip
EXAMPLES = [
    line.strip()
    for made in PARSERS.values()
    for line in str(made.epilog).splitlines()
    if line.startswith("  ") and "softjaw " in line
]
PRESSURE, SMOKE = (str(ROOT / "jobs" / name) for name in ("cylinder-pressure.csv", "smoke.toml"))
COMMANDS = {
    "run": ("run", SMOKE, "-o", "PLACE/x.hdf"), "report": ("report", "FILE", "-o", "PLACE/x.html"),
    "view: page": ("view", "FILE", "--html", "PLACE/x.html"),
    "view: picture": ("view", "FILE", "--screenshot", "PLACE/x.png"),
    "export: vtk": ("export", "FILE", "--format", "vtk", "-o", "PLACE/x.vtm"),
    "export": ("export", "FILE", "--csv", "-o", "PLACE/x.csv"),
    "init": ("init", "bottle", "-o", "PLACE/x"), "patch": ("patch", PRESSURE, "-o", "PLACE/x.png"),
}  # fmt: skip


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "ball.toml"
    path.write_text(text_of(BALL, stations="[-5, 0, 5]", angles="[0, 90]", forces="[1, 2]"))
    return path


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    path = tmp_path_factory.mktemp("finished") / "done.hdf"
    code, output, _ = run_fake(0, path, "--fail", 9)
    assert (code, "best 9 places" in output) == (6, True)
    return path


@pytest.mark.parametrize("words", [
    "chek", "check", "plan x.toml -n 0", "show f --json --csv", "show f --top -1", "watch f --every 0",
    "report f -o x.pdf",
    *(f"show f --force {force}" for force in ("-3", "0", "nan", "inf", "ten")),
])  # fmt: skip
def test_bad_usage_is_code_2_and_names_the_option(words, capsys):
    assert main(words.split()) == 2
    said = capsys.readouterr().err
    assert "error" in said
    assert all(word in said for word in words.split()[2:] if word in ("--every", "--force", "-o"))


def test_petsc_options_belong_to_run_and_have_a_prefix(scene, capsys):
    found = petsc_overrides(["-contact_ksp_rtol", "-1", "-contact_view"])
    assert found == ["petsc.contact_ksp_rtol=-1", "petsc.contact_view=true"]
    assert main(["check", str(scene), "--", "-contact_snes_monitor"]) == 2
    for words in (["-snes_monitor"], ["1e-3"], ["-contact_snes_rtol", "1", "2"]):
        with pytest.raises(StudyError, match="PETSC_OPTIONS"):
            petsc_overrides(words)


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_are_words_that_the_program_takes_and_name_files_that_exist(example):
    given = shlex.split(example.partition("softjaw ")[2].partition(" > ")[0], comments=True)
    words, petsc = (given[: given.index("--")], given[given.index("--") + 1 :]) if "--" in given else (given, [])
    program().parse_args(words)
    petsc_overrides(petsc)
    for before, word in zip(["", *words], words, strict=False):
        if word.startswith("jobs/"):
            assert (ROOT / word).exists(), word
        elif word.startswith("results/") and word.endswith(".hdf") and before != "-o" and words[0] != "compare":
            assert (ROOT / "jobs" / Path(word).with_suffix(".toml").name).exists(), word  # what a shipped scene makes


def test_status_tells_programs_the_state_of_every_case(finished, capsys):
    told = answer("status", finished)
    assert [told[key] for key in ("complete", "failed", "not_computed", "running")] == [35, 1, 0, None]
    assert [case for case in told["cases"] if case["state"] == "failed"] == [
        {"row": 9, "state": "failed", "station": 0.02, "angle": np.pi / 2, "normal_force": 1.0,
         "message": "no contact at this force"}
    ]  # fmt: skip
    assert len(told["notes"]) == 2  # the failed case and the note of four others
    assert [s["reason"] for s in told["sessions"]] == ["complete"]
    assert main(["status", str(finished), "--csv"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [row["state"] for row in rows].count("complete") == 35
    assert rows[9].items() >= {"row": "9", "state": "failed", "message": "no contact at this force"}.items()


def loaded(*words):
    code, _, errors = launch(0, "-X", "importtime", "-m", "softjaw", *words)
    lines = [line.rpartition("|")[2].strip() for line in errors.splitlines() if line.startswith("import time:")]
    return {line.partition(".")[0] for line in lines}, code


@pytest.mark.parametrize("command", QUICK)
def test_quick_answers_load_neither_mpi_nor_petsc(command, scene, finished):
    files = {"SCENE": scene, "FILE": finished}
    modules, code = loaded(*(files.get(word, word) for word in command.split()))
    assert code == 0
    heavy = ("mpi4py", "petsc4py", "h5py", "pyvista") if command.startswith("patch") else HEAVY
    assert modules.isdisjoint(heavy)
    assert command != "status FILE" or modules.isdisjoint(("xarray", "pandas"))
    assert ("numpy" in modules) == (not command.endswith("--help"))


def test_without_petsc_a_run_says_what_is_missing(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    monkeypatch.delitem(sys.modules, "softjaw.study.cli.running", raising=False)
    assert main(["run", str(scene), "-o", str(tmp_path / "a.hdf")]) == 2
    assert "mpi4py" in capsys.readouterr().err


def test_bad_usage_is_told_by_the_first_rank_only(monkeypatch, capsys):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    assert main(["rum"]) == 2
    assert capsys.readouterr().err == ""


@pytest.mark.long
def test_a_run_outlives_the_reader_of_its_output(tmp_path):
    small = "--set gripper.elements=[4,4,2] --set candidates.angles_deg=[0] --set accuracy.meshes=1"
    run = f"{sys.executable} -m softjaw run {ROOT}/jobs/smoke.toml -o smoke.hdf {small}"
    done = subprocess.run(
        ["bash", "-c", f"{run} | head -n 1; exit ${{PIPESTATUS[0]}}"], cwd=tmp_path, timeout=120, check=False,
        env={**launch_environment(), "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


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


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return make(tmp_path_factory.mktemp("file") / "a.hdf")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    path = tmp_path_factory.mktemp("place") / "file"
    path.write_text("")
    return path


def refused(code, errors, place):
    assert code == CANNOT_WRITE, errors
    assert "Traceback" not in errors
    assert errors.count("error: ") == 1
    assert str(place) in errors


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_that_writes_says_what_it_cannot_write(file, place, command, capfd, monkeypatch):
    monkeypatch.setattr(report, "build", lambda *_: "<p>page</p>")
    code = main([word.replace("FILE", str(file)).replace("PLACE", str(place)) for word in COMMANDS[command]])
    refused(code, capfd.readouterr().err, place)
    assert list(file.parent.iterdir()) == [file]


@pytest.mark.parametrize(
    "command", ["schema", *(pytest.param(n, marks=pytest.mark.long) for n in ("show", "status", "export", "compare"))]
)
def test_an_output_that_cannot_be_written_has_the_same_code(file, command):
    words = {"export": (file, "--csv"), "schema": (), "compare": (file, file)}.get(command, (file,))
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([sys.executable, "-m", "softjaw", command, *words], stdout=full, stderr=subprocess.PIPE,
                              text=True, cwd=ROOT, env=launch_environment())  # fmt: skip
    assert done.returncode == CANNOT_WRITE, done.stderr
    assert done.stderr.startswith("error: ")
    assert len(done.stderr.splitlines()) == 1


def test_a_file_is_whole_or_not_there_a_device_is_written_to_and_a_file_in_the_way_of_a_folder_named(tmp_path):
    path = tmp_path / "a.txt"
    write_file(path, "old")
    with suppress(ZeroDivisionError), beside(path) as part:
        part.write_text(f"half {1 / 0}")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    assert write_file(tmp_path / "b" / "c.txt", b"new", folders=True).read_bytes() == b"new"
    assert write_file(Path("/dev/null"), "gone") == Path("/dev/null")
    assert Path("/dev/null").is_char_device()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE) as reader:
        write_file(pipe, "through")
        assert reader.communicate(timeout=30)[0] == b"through"
    assert pipe.is_fifo()
    (tmp_path / "a").write_text("")
    for folder in (tmp_path / "a", tmp_path / "a" / "b"):
        with pytest.raises(NotADirectoryError):
            make_folders(folder)
    with refusal(CANNOT_WRITE):
        write_file(tmp_path / "a" / "b", "", folders=True)


def test_a_file_that_is_complete_and_cannot_be_packed_is_left_as_it_is_unless_it_is_damaged(monkeypatch, capsys):
    def pack(code):
        def failing(*_, **__):
            raise StudyError(code, "no space")

        monkeypatch.setattr(session, "rewrite", failing)
        session.pack(session.Work(lambda *_: ()), Path("x.hdf"), SimpleNamespace(layout=None, header=None))

    pack(CANNOT_WRITE)
    assert "x.hdf" in capsys.readouterr().err
    with pytest.raises(StudyError):
        pack(OTHER_FILE)
