"""Who may import whom: study -> fem -> friction, inside study only downward, and one door to each foreign library.

Everything is imported as ``softjaw.*``: under a second name a module would be loaded, and compiled, twice.
"""

import ast
import re
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OWN = ("study", "fem", "friction", "lsfit", "scoring")  # folders at the top, each linked into softjaw/
NUMERICS = {"numpy", "scipy", "numba"}
ALLOWED = {
    "friction": {"softjaw.friction"} | NUMERICS,
    "lsfit": {"softjaw.lsfit", "clarabel"} | NUMERICS,
    "scoring": {"softjaw.scoring", "clarabel"} | NUMERICS,
    "fem": {"softjaw.fem", "softjaw.friction", "skfem", "petsc4py", "pyvista", "trimesh", "vtkmodules"} | NUMERICS,
    "study": {"h5py", "jinja2", "matplotlib", "mpi4py", "plotly", "pydantic", "pydantic_core", "pyvista", "rich"}
    | {"vtkmodules", "xarray", "threadpoolctl", "trimesh", "(computed)", *(f"softjaw.{name}" for name in OWN)}
    | NUMERICS,
}
PICTURES = {"fem/objects/triangles.py", "study/show/view/solids.py"}
DOORS = {
    "petsc4py": {"fem/petsc.py"},
    "(computed)": {"study/cli/__init__.py"},
    "h5py": {f"study/result/{name}.py" for name in ("skeleton", "write", "hdf5", "index")},
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


@cache
def modules(source: str) -> set[str]:
    """All that a source imports, also inside functions and behind TYPE_CHECKING, as far as it can be a module."""
    names = set()
    for node in nodes(source):
        match node:
            case ast.Import(aliases):
                names |= {alias.name for alias in aliases}
            case ast.ImportFrom(module, aliases, level):
                names |= {"(relative)"} if level else {f"{module}.{alias.name}" for alias in aliases}
            case ast.Call(ast.Attribute(ast.Name("importlib"), "import_module") | ast.Name("__import__"), [first, *_]):
                names.add(first.value if isinstance(first, ast.Constant) else "(computed)")
    return names


def top(module: str) -> str:
    """Top-level name of a foreign module, ``softjaw.fem`` for one of our own, ``(bare) fem`` where that is left out."""
    first, *rest = module.split(".")
    if first in OWN:
        return f"(bare) {first}"
    return f"softjaw.{rest[0]}" if first == "softjaw" and rest else first


def forbidden(path: str, source: str) -> set[str]:
    """Names that a file at this path must not import: of other packages, or in study from its own level upward."""
    folder, *inner = path.split("/")
    foreign = set(map(top, modules(source))) - sys.stdlib_module_names
    wrong = {name for name in foreign if name not in ALLOWED[folder] or path not in DOORS.get(name, {path})}
    if folder == "study" and inner != ["__init__.py"]:
        lower = ORDER[: ORDER.index(inner[0].removesuffix(".py")) + 1]
        wrong |= {m for m in modules(source) if m.startswith("softjaw.study.") and m.split(".")[2] not in lower}
    return wrong


def outside_world(source: str) -> set[str]:
    """What a source takes from or gives to the user's session: printing, arguments, environment, working directory."""
    names = {"print", "input", "sys.argv", "sys.stdout", "os.environ", "os.getenv", "os.getcwd", "Path.cwd"}
    short = {name.rpartition(".")[2] for name in names}
    used = (n for n in nodes(source) if getattr(n, "id", getattr(n, "attr", "")) in short)
    return names & set(map(ast.unparse, used))


def test_every_file_imports_only_what_its_folder_may_and_only_study_talks_to_the_session():
    wrong = {path: forbidden(path, (ROOT / path).read_text(encoding="utf-8")) for path in SOURCES}
    bare = re.compile(rf"^ *(?:from|import) (?:{'|'.join(OWN)})\b", re.M)
    wrong |= {path: set(bare.findall((ROOT / path).read_text())) for path in USERS}
    assert {path: names for path, names in wrong.items() if names} == {}
    assert not (ROOT / "study/__init__.py").read_text(encoding="utf-8")  # or every module would import what it does
    # The other packages take what they need as arguments, and return what there is to say.
    used = {path: outside_world((ROOT / path).read_text()) for path in SOURCES if not path.startswith("study/")}
    assert {path: names for path, names in used.items() if names} == {}


@pytest.mark.parametrize(("path", "source", "name"), [
    ("friction/frame.py", "from softjaw.lsfit.ellipsoid import Ellipsoid", "softjaw.lsfit"),
    ("fem/contact/press.py", "def f():\n    from mpi4py import MPI", "mpi4py"),
    ("study/run/session.py", "__import__(name)", "(computed)"),
    ("friction/frame.py", "from ..fem import pose", "(relative)"),
    ("study/case/build.py", "if TYPE_CHECKING:\n    import softjaw.study.run.plan as p", "softjaw.study.run.plan"),
])  # fmt: skip
def test_a_forbidden_import_is_noticed(path, source, name):
    assert forbidden(path, source) == {name}
