"""Who may import whom, read from the sources: study -> fem -> friction, and one door to each foreign library."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OWN = ("study", "fem", "friction", "lsfit", "scoring")
NUMERICS = {"numpy", "scipy", "numba"}
ALLOWED = {
    "friction": {"friction"} | NUMERICS,
    "lsfit": {"lsfit", "clarabel"} | NUMERICS,
    "scoring": {"scoring"} | NUMERICS,
    "fem": {"fem", "friction", "skfem", "petsc4py", "pyvista", "vtkmodules"} | NUMERICS,
    "study": {*OWN, "pydantic", "matplotlib", "shtab", "mpi4py", "h5py", "pyvista", "vtkmodules"} | NUMERICS,
}
PICTURES = {
    "fem/mesh_object.py",
    "study/figures/rendering.py",
    "study/view/drawing.py",
    "study/view/sides.py",
    "study/view/window.py",
}
DOORS = {
    "petsc4py": {"fem/petsc.py"},
    "shtab": {"study/completion.py"},
    "h5py": {
        "study/storage/store.py",
        "study/storage/skeleton.py",
        "study/storage/result_writer.py",
        "study/storage/guarded.py",
        "study/storage/vtkhdf.py",
        "study/cost/file.py",
    },
    "pyvista": PICTURES,
    "vtkmodules": PICTURES | {"study/patch/vtk_file.py"},
}
SOURCES = sorted(path.relative_to(ROOT).as_posix() for folder in OWN for path in (ROOT / folder).rglob("*.py"))


def imported(source: str) -> set[str]:
    """Top-level names of everything a source imports, also inside functions and behind TYPE_CHECKING."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add("(relative)" if node.level else str(node.module).split(".")[0])
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("importlib.import_module", "__import__"):
            first = node.args[0]
            names.add(first.value.split(".")[0] if isinstance(first, ast.Constant) else "(computed)")
    return names


def forbidden_imports(path: str, source: str) -> set[str]:
    """Names that a file at this path must not import."""
    foreign = imported(source) - sys.stdlib_module_names
    allowed = ALLOWED[path.split("/")[0]]
    return {name for name in foreign if name not in allowed or path not in DOORS.get(name, {path})}


def outside_world(source: str) -> set[str]:
    """What a source takes from or gives to the user's session: printing, arguments, environment, working directory."""
    used = {ast.unparse(node) for node in ast.walk(ast.parse(source)) if isinstance(node, (ast.Name, ast.Attribute))}
    return used & {"print", "input", "sys.argv", "sys.stdout", "os.environ", "os.getenv", "os.getcwd", "Path.cwd"}


def test_there_are_sources_in_every_folder():
    assert {path.split("/")[0] for path in SOURCES} == set(OWN)


@pytest.mark.parametrize("path", SOURCES)
def test_a_file_imports_only_what_its_folder_may(path):
    names = forbidden_imports(path, (ROOT / path).read_text(encoding="utf-8"))
    assert not names, f"{path} must not import {', '.join(sorted(names))}"


@pytest.mark.parametrize("path", [path for path in SOURCES if not path.startswith("study/")])
def test_only_study_talks_to_the_session_it_runs_in(path):
    names = outside_world((ROOT / path).read_text(encoding="utf-8"))
    assert not names, f"{path} must not use {', '.join(sorted(names))}; pass the value in, or return it to study"


@pytest.mark.parametrize(
    ("path", "source", "name"),
    [
        ("friction/frame.py", "from lsfit.ellipsoid import Ellipsoid", "lsfit"),
        ("scoring/quality.py", "import friction.patch as p", "friction"),
        ("fem/press.py", "import study.scene", "study"),
        ("fem/press.py", "def f():\n    from mpi4py import MPI", "mpi4py"),
        ("fem/contact.py", "from petsc4py import PETSc", "petsc4py"),
        ("study/execution/run.py", "import h5py", "h5py"),
        ("study/report.py", "if TYPE_CHECKING:\n    import pyvista as pv", "pyvista"),
        ("study/execution/run.py", "import importlib\nimportlib.import_module('petsc4py.PETSc')", "petsc4py"),
        ("study/execution/run.py", "__import__(name)", "(computed)"),
        ("friction/frame.py", "from ..fem import pose", "(relative)"),
        ("lsfit/ellipsoid.py", "import cvxpy", "cvxpy"),
    ],
)
def test_a_forbidden_import_is_noticed(path, source, name):
    assert forbidden_imports(path, source) == {name}


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("fem/petsc.py", "import petsc4py\nfrom petsc4py import PETSc"),
        ("study/storage/store.py", "import h5py, numpy as np\nfrom mpi4py import MPI"),
        ("friction/frame.py", "from friction.patch import ContactPatch\nfrom numba import njit\nimport math"),
    ],
)
def test_the_doors_are_open(path, source):
    assert forbidden_imports(path, source) == set()


def test_printing_and_reading_the_environment_are_noticed():
    assert outside_world("import os\nprint(os.environ['HOME'])") == {"print", "os.environ"}
