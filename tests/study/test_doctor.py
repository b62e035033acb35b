"""The doctor names each trouble with its cure, survives what it examines, and is well where the tests run."""

import os
import subprocess
from pathlib import Path

import pytest

from softjaw.study import doctor
from softjaw.study.doctor import COMPILED, NOT_IN_TIME, ask, launch_environment, trouble
from softjaw.study.messages import USAGE
from tests.study.launching import launch


@pytest.mark.ranks
def test_all_is_well_on_a_machine_that_was_set_up(capsys):
    assert doctor.doctor() == 0, capsys.readouterr().out
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in lines] == list(doctor.CHECKS)
    assert all(line.startswith("fine") for line in lines)


@pytest.mark.parametrize(("check", "answer", "found", "cure"), [
    ("numpy", (1, "", "ValueError: numpy.dtype size changed"), "dtype size", "numpy>=1.26,<2"),
    ("packages", (1, "", "ModuleNotFoundError: No module named 'skfem'"), "'skfem'", "pip install -e ."),
    ("petsc", (1, "", "ImportError: petsc4py is missing"), "petsc4py is missing", "python3-petsc4py"),
    ("petsc", (1, "", "AssertionError: PETSc was built with complex scalars"), "complex", "python3-petsc4py-real"),
    ("petsc", (1, "", "[0] Could not locate solver type mumps"), "mumps", "configured with MUMPS"),
    ("petsc", (-11, "", ""), "exit code -11", "make setup"),
    ("h5py", (1, "", "3.14.0 on HDF5 1.14.6 without MPI (of pip)"), "without MPI", "pip uninstall h5py"),
    ("h5py", (1, "", "3.7.0 on HDF5 1.10.8 without MPI"), "without MPI", "python3-h5py python3-h5py-mpi"),
    ("mpi", (1, "", "AssertionError: every rank is alone\n-----"), "alone", "MPI library first in PATH"),
    ("mpi", (NOT_IN_TIME, "", ""), "no answer in time", "mpirun -n 2 true"),
    ("mpi", (1, "", "AssertionError: two ranks lost data in one file"), "lost data", "MPI-IO"),
    ("pictures", (-6, "", "bad X server connection"), "bad X server", "libosmesa6"),
])  # fmt: skip
def test_a_trouble_comes_with_its_cure(monkeypatch, check, answer, found, cure):
    monkeypatch.setattr(doctor, "ask", lambda *_, **__: subprocess.CompletedProcess([], *answer))
    text, remedy, code = doctor.CHECKS[check]()
    assert found in text
    assert cure in remedy
    assert "\n" not in text + remedy
    assert code == USAGE


def test_several_threads_per_rank_and_a_cache_folder_that_cannot_be_written_are_troubles(monkeypatch, tmp_path):
    monkeypatch.setenv("OMP_NUM_THREADS", "8")
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))
    _, cure, code = doctor.check_speed()
    assert "export OMP_NUM_THREADS=1; " in cure
    assert "NUMBA_CACHE_DIR" in cure
    assert code == USAGE


@pytest.mark.parametrize(("codes", "expected"), [((), 0), ((5,), 5), ((5, 2), 2), ((2,), 2)])
def test_what_is_missing_outweighs_what_cannot_be_written(monkeypatch, capsys, codes, expected):
    checks = {f"check {i}": lambda code=code: ("bad", "do this", code) for i, code in enumerate(codes)}
    monkeypatch.setattr(doctor, "CHECKS", {"good": lambda: ("good", "", 0), **checks})
    assert doctor.doctor() == expected
    assert capsys.readouterr().out.count("cure: do this") == len(codes)


def test_a_check_that_fails_hides_no_other_and_variables_of_a_surrounding_mpirun_are_left_out(monkeypatch, capsys):
    monkeypatch.setattr(doctor, "CHECKS", {"broken": lambda: 1 / 0, "good": lambda: ("good", "", 0)})
    assert doctor.doctor() == 2
    broken, good = capsys.readouterr().out.splitlines()
    assert "ZeroDivisionError" in broken
    assert good.startswith("fine")
    assert trouble(ask("import os; os.abort()")) == "ended with exit code -6"
    assert trouble(ask("import time; time.sleep(60)", limit=0.5)) == "no answer in time"
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    monkeypatch.setenv("PMIX_RANK", "1")
    monkeypatch.setenv("PATH_TO_KEEP", "yes")
    kept = launch_environment()
    assert kept["PATH_TO_KEEP"] == "yes"
    assert kept["OMP_NUM_THREADS"] == "1"
    assert not {"OMPI_COMM_WORLD_RANK", "PMIX_RANK"} & set(kept)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    doctor.pin_threads()
    assert os.environ["OMP_NUM_THREADS"] == "1"
    assert os.environ["OPENBLAS_NUM_THREADS"] == "4"


def test_a_process_begins_mpi_alone_only_where_nothing_launched_it_and_leaves_no_trace():
    code = "import os; from softjaw.study.doctor import ALONE, begin_mpi; begin_mpi(); from mpi4py import MPI;"
    told = "MPI.COMM_WORLD.rank or print(MPI.COMM_WORLD.size, len(ALONE.keys() & os.environ.keys()))"
    assert ask(code + told).stdout.split() == ["1", "0"]
    assert ask(code + told, prefix=("mpirun", "-n", "2")).stdout.split() == ["2", "0"]


def test_the_doctor_loads_no_mpi_itself_and_every_package_with_compiled_loops_is_looked_at():
    foreign = {"mpi4py", "petsc4py", "h5py", "pyvista", "numpy"}
    assert ask(f"import sys, softjaw.study.doctor; print({foreign} & set(sys.modules))").stdout.strip() == "set()"
    code = (
        "import os, sys, softjaw.study.doctor as e; e.ROOT = e.Path('/dev/null'); e.keep_compiled_loops();"
        "print(os.environ.get('NUMBA_CACHE_DIR', ''), 'numba' in sys.modules)"
    )
    surroundings = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    folder, loaded = launch(0, "-c", code, env={**surroundings, "HOME": "/dev/null"})[1].split()
    assert Path(folder).name.startswith(doctor.PASSING)
    assert not Path(folder).exists()
    assert loaded == "False"
    home = doctor.ROOT / "softjaw"
    users = {p.parent.relative_to(home).as_posix() for name in ("fem", "friction", "lsfit", "scoring", "study")
             for p in (home / name).rglob("*.py") if "njit(cache" in p.read_text()}  # fmt: skip
    assert users == set(COMPILED)
