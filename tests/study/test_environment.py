"""Where compiled loops are kept when neither the packages nor the user's home can be written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from softjaw.study import doctor
from softjaw.study.doctor import COMPILED, compiled_loops_pass, keep_compiled_loops

CODE = """
import os, sys
from softjaw.study.doctor import keep_compiled_loops
keep_compiled_loops()
print(os.environ.get("NUMBA_CACHE_DIR", ""), "numba" in sys.modules)
"""


@pytest.fixture
def closed(monkeypatch):
    """Make ``_writable`` say no to some folders, and forget the temporary one afterwards."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(doctor.atexit, "register", lambda *_, **__: None)

    def close(*names):
        monkeypatch.setattr(doctor, "_writable", lambda folder: not any(n in str(folder) for n in names))

    yield close
    if compiled_loops_pass():
        Path(os.environ.pop("NUMBA_CACHE_DIR")).rmdir()


@pytest.mark.parametrize("names", [(), ("__pycache__",), ("numba",)])
def test_numba_chooses_for_itself_where_it_can_write(closed, names):
    closed(*names)
    keep_compiled_loops()
    assert "NUMBA_CACHE_DIR" not in os.environ
    assert not compiled_loops_pass()


def test_without_any_place_it_is_a_private_folder_and_doctor_says_so(closed):
    closed("__pycache__", "numba")
    keep_compiled_loops()
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    assert folder.stat().st_mode & 0o777 == 0o700
    assert compiled_loops_pass()
    assert doctor.check_cache().text == "compiled loops cannot be kept, every start compiles anew"


def test_a_choice_of_the_users_is_kept(closed, monkeypatch):
    closed("__pycache__", "numba")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/elsewhere")
    keep_compiled_loops()
    assert os.environ["NUMBA_CACHE_DIR"] == "/elsewhere"


def test_folders_are_judged_without_being_made(tmp_path):
    (tmp_path / "file").write_text("in the way")
    assert doctor._writable(tmp_path / "a" / "b")
    assert not doctor._writable(tmp_path / "file" / "b")
    assert not doctor._writable(Path("/dev/null/here"))
    assert not doctor._writable(None)
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


def test_the_folder_goes_with_the_process_and_numba_is_not_needed():
    def told():
        # a home that cannot be, and packages that numba could not write beside
        code = "import softjaw.study.doctor as e\ne.ROOT = e.Path('/dev/null')\n" + CODE
        surroundings = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
        command = [sys.executable, "-c", code]
        done = subprocess.run(
            command, capture_output=True, text=True, env={**surroundings, "HOME": "/dev/null"}, cwd=doctor.ROOT,
            check=True,
        )  # fmt: skip
        return done.stdout.split()

    folder, loaded = told()
    assert Path(folder).name.startswith(doctor.PASSING)
    assert not Path(folder).exists()
    assert loaded == "False"


def test_every_package_with_compiled_loops_is_looked_at():
    home = doctor.ROOT / "softjaw"
    users = {p.parent.relative_to(home).as_posix() for name in ("fem", "friction", "lsfit", "scoring", "study")
             for p in (home / name).rglob("*.py") if "njit(cache" in p.read_text()}  # fmt: skip
    assert users == set(COMPILED)
