"""Who may import whom, read from the sources: study -> fem -> friction, inside study only downward, and one door to
each foreign library.

Everything is imported as ``softjaw.*``: under a second name a module would be loaded, and compiled, twice.
"""

import ast
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OWN = ("study", "fem", "friction", "lsfit", "scoring")  # folders at the top, each linked into softjaw/
NUMERICS = {"numpy", "scipy", "numba"}
SHOWN = {"matplotlib", "pyvista", "vtkmodules", "plotly", "jinja2"}
ALLOWED = {
    "friction": {"softjaw.friction"} | NUMERICS,
    "lsfit": {"softjaw.lsfit", "clarabel"} | NUMERICS,
    "scoring": {"softjaw.scoring", "clarabel"} | NUMERICS,
    "fem": {"softjaw.fem", "softjaw.friction", "skfem", "petsc4py", "pyvista", "trimesh", "vtkmodules"} | NUMERICS,
    "study": {"h5py", "jinja2", "matplotlib", "mpi4py", "plotly", "pydantic", "pydantic_core", "pyvista", "rich"}
    | {"vtkmodules", "xarray", "threadpoolctl", "trimesh", "(computed)"}
    | NUMERICS,
}
ALLOWED["study"] |= {f"softjaw.{name}" for name in OWN}
PICTURES = {
    "fem/objects/triangles.py",
    "study/show/view/solids.py",
}
DOORS = {
    "petsc4py": {"fem/petsc.py"},
    "(computed)": {"study/cli/__init__.py"},
    "h5py": {
        "study/result/skeleton.py",
        "study/result/write.py",
        "study/result/hdf5.py",
        "study/result/index.py",
    },
    "pyvista": PICTURES | {"study/patch/vtk_faces.py"},
    "vtkmodules": PICTURES | {"study/patch/vtk_faces.py"},
}
# Folders of study, and modules directly in it, the lowest first: each imports only what stands before it, so that there
# is no circle either. The first row knows nothing of a study, and pictures is how all of them are drawn; cli joins
# everything, and imports what a command needs when it runs.
ORDER = (
    "messages", "units", "flags", "quantities", "table", "pictures", "templates", "page", "grippers",
    "scene", "case", "pipeline", "result", "one_case", "ranking", "run", "accuracy", "lookup", "export", "patch",
    "show", "doctor", "launch", "solve", "cli",
)  # fmt: skip
SOURCES = sorted(path.relative_to(ROOT).as_posix() for folder in OWN for path in (ROOT / folder).rglob("*.py"))
USERS = [path.relative_to(ROOT).as_posix() for folder in ("tests", "jobs") for path in (ROOT / folder).rglob("*.py")]


@cache
def nodes(source: str) -> list[ast.AST]:
    return list(ast.walk(ast.parse(source)))


def imported(source: str) -> set[str]:
    """Top-level names of everything a source imports, also inside functions and behind TYPE_CHECKING."""
    names = set()
    for node in nodes(source):
        if isinstance(node, ast.Import):
            names |= {_top(alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module == "softjaw":
            names |= {_top(f"softjaw.{alias.name}") for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add("(relative)" if node.level else _top(str(node.module)))
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("importlib.import_module", "__import__"):
            first = node.args[0]
            names.add(_top(first.value) if isinstance(first, ast.Constant) else "(computed)")
    return names


def _top(module: str) -> str:
    """Top-level name of a foreign module, ``softjaw.fem`` for one of our own, ``(bare) fem`` where that is left out."""
    first, *rest = module.split(".")
    if first in OWN:
        return f"(bare) {first}"
    return f"softjaw.{rest[0]}" if first == "softjaw" and rest else first


def forbidden_imports(path: str, source: str) -> set[str]:
    """Names that a file at this path must not import."""
    foreign = imported(source) - sys.stdlib_module_names
    allowed = ALLOWED[path.split("/")[0]]
    return {name for name in foreign if name not in allowed or path not in DOORS.get(name, {path})}


def modules_of_study(source: str) -> set[str]:
    """What a source imports of study, as far as it can be a module: ``show.data`` and ``show.data.Data``."""
    names = set()
    for node in nodes(source):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("importlib.import_module", "__import__"):
            names.add(getattr(node.args[0], "value", "softjaw.study"))  # a computed name may be any of them
    inside = {name for name in names if f"{name}.".startswith("softjaw.study.")}
    return {name.removeprefix("softjaw.study").removeprefix(".") for name in inside}


def arrows_up(path: str, source: str) -> set[str]:
    """What a file of study at this path imports from its own level of `ORDER` upward, its own folder left out."""
    own = path.split("/")[1].removesuffix(".py")
    allowed = ORDER[: ORDER.index(own) + 1]
    return {name for name in modules_of_study(source) if name.split(".")[0] not in allowed}


def outside_world(source: str) -> set[str]:
    """What a source takes from or gives to the user's session: printing, arguments, environment, working directory."""
    used = {ast.unparse(node) for node in nodes(source) if isinstance(node, ast.Name | ast.Attribute)}
    return used & {"print", "input", "sys.argv", "sys.stdout", "os.environ", "os.getenv", "os.getcwd", "Path.cwd"}


def test_every_file_imports_only_what_its_folder_may():
    sources = {path: (ROOT / path).read_text(encoding="utf-8") for path in SOURCES}
    assert {path.split("/")[0] for path in sources} == set(OWN)
    found = {path: forbidden_imports(path, source) for path, source in sources.items()}
    assert {path: names for path, names in found.items() if names} == {}
    bare = {path: {name for name in imported((ROOT / path).read_text()) if name.startswith("(bare)")} for path in USERS}
    assert {path: names for path, names in bare.items() if names} == {}


def test_study_imports_downward_only():
    """Also inside functions and behind TYPE_CHECKING."""
    paths = [path for path in SOURCES if path.startswith("study/") and path != "study/__init__.py"]
    assert {path.split("/")[1].removesuffix(".py") for path in paths} <= set(ORDER)
    found = {path: arrows_up(path, (ROOT / path).read_text(encoding="utf-8")) for path in paths}
    assert {path: names for path, names in found.items() if names} == {}
    assert not (ROOT / "study/__init__.py").read_text(encoding="utf-8")  # or every module would import what it does


@pytest.mark.parametrize(
    ("path", "source", "names"),
    [
        ("study/case/build.py", "def f():\n    from softjaw.study.show import data", {"show.data"}),
        ("study/case/build.py", "if TYPE_CHECKING:\n    import softjaw.study.run.plan as p", {"run.plan"}),
        ("study/flags.py", "from softjaw.study.quantities import MODELS", {"quantities.MODELS"}),
        ("study/case/build.py", "from softjaw.study.case.model import Finger\nfrom softjaw.fem import run", set()),
    ],
)
def test_an_import_upward_is_noticed(path, source, names):
    assert arrows_up(path, source) == names


def test_only_study_talks_to_the_session_it_runs_in():
    """The other packages take what they need as arguments, and return what there is to say."""
    found = {path: outside_world((ROOT / path).read_text()) for path in SOURCES if not path.startswith("study/")}
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    ("path", "source", "name"),
    [
        ("friction/frame.py", "from softjaw.lsfit.ellipsoid import Ellipsoid", "softjaw.lsfit"),
        ("scoring/quality.py", "from softjaw import friction", "softjaw.friction"),
        ("fem/contact/press.py", "def f():\n    from mpi4py import MPI", "mpi4py"),
        ("study/report.py", "if TYPE_CHECKING:\n    import pyvista as pv", "pyvista"),
        ("study/run/session.py", "__import__(name)", "(computed)"),
        ("friction/frame.py", "from ..fem import pose", "(relative)"),
    ],
)
def test_a_forbidden_import_is_noticed(path, source, name):
    assert forbidden_imports(path, source) == {name}
