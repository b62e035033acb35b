"""Places that cannot be written: every command that writes says so in one sentence and ends with the same code."""

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from softjaw.study.cli import main
from softjaw.study.doctor import launch_environment
from softjaw.study.messages import CANNOT_WRITE, StudyError, beside, make_folders, write_file
from softjaw.study.run import session
from softjaw.study.show.report import writing as report
from tests.study.launching import ROOT
from tests.study.view_files import make

PRESSURE, SMOKE = (str(ROOT / "jobs" / name) for name in ("cylinder-pressure.csv", "smoke.toml"))
COMMANDS = {
    "run": ("run", SMOKE, "-o", "PLACE/x.hdf"),
    "report": ("report", "FILE", "-o", "PLACE/x.html"),
    "view: page": ("view", "FILE", "--html", "PLACE/x.html"),
    "view: picture": ("view", "FILE", "--screenshot", "PLACE/x.png"),
    "export: vtk": ("export", "FILE", "--format", "vtk", "-o", "PLACE/x.vtm"),
    "export": ("export", "FILE", "--csv", "-o", "PLACE/x.csv"),
    "init": ("init", "bottle", "-o", "PLACE/x"),
    "patch": ("patch", PRESSURE, "-o", "PLACE/x.png"),
}


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
    "command", ["show", "schema", *(pytest.param(n, marks=pytest.mark.long) for n in ("status", "export", "compare"))]
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
    with pytest.raises(StudyError) as refused:
        write_file(tmp_path / "a" / "b", "", folders=True)
    assert refused.value.code == CANNOT_WRITE


def test_a_file_that_is_complete_and_cannot_be_packed_is_left_as_it_is(monkeypatch, capsys):
    def full(*_, **__):
        raise StudyError(CANNOT_WRITE, "no space")

    monkeypatch.setattr(session, "rewrite", full)
    session.pack(session.Work(lambda *_: ()), Path("x.hdf"), SimpleNamespace(layout=None, header=None))
    assert "x.hdf" in capsys.readouterr().err
