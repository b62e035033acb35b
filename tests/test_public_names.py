"""``import softjaw``: its names, what it needs, and the example of each."""

import ast
import doctest
import importlib
import inspect
import json
import os

import pytest

import softjaw as sj
from softjaw.study.messages import StudyError
from tests.study.formula_results import grid_axes, make
from tests.study.launching import ROOT, launch

STUB = ast.parse((ROOT / "softjaw" / "__init__.pyi").read_text(encoding="utf-8"))
EXAMPLES = ("Scene.from_file", "Scene.from_dict", "Scene.with_values", "press", "open", "GraspMap", "ContactPatch",
            "read_pressure", "friction_limits", "friction_wrench", "fit_ellipsoid", "fit_quartic",
            "grasp_quality")  # fmt: skip
BLOCKED = """
import json, sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("mpi4py", "petsc4py"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Missing())
sys.path.insert(0, sys.argv[1])
import softjaw as sj
early = {"numpy", "scipy", "numba", "pydantic", "h5py"} & set(sys.modules)
assert all(getattr(sj, name).__doc__ for name in sj.__all__)
scene = sj.Scene.from_file(sys.argv[1] + "/jobs/smoke.toml")
ds = sj.open(sys.argv[2])
assert len(sj.read_patch(sys.argv[2], station=0)) == 0  # it holds none
point = sj.GraspMap(sys.argv[2]).best()[0]
patch = sj.read_pressure(sys.argv[1] + "/jobs/cylinder-pressure.csv")
limits = sj.friction_limits(patch, mu=0.8)["ccm"]
found = [sj.friction_wrench(patch, [0, 0, 1], 0.8)[0, 5] / limits.tau_z, sj.fit_ellipsoid(patch, 0.8).fit_error.Erad,
         sj.fit_quartic(patch, 0.8).fit_error.Erad, sj.grasp_quality(patch, mu=0.8, distance=0.06).quality]
refused = []
for call in (lambda: sj.press(scene, 0.0, 0.0, 1.0), lambda: sj.run(scene, sys.argv[2])):
    try:
        call()
    except ImportError as error:
        refused.append(str(error))
print(json.dumps([sorted(early), found, point.e_n, float(ds.e_n.max()), refused]))
"""
PACKAGES = ("friction", "lsfit", "scoring", "fem", "study")
FILES = [path.relative_to(ROOT) for folder in PACKAGES for path in sorted((ROOT / folder).rglob("*.py"))]
WITH_EXAMPLES = [path for path in FILES if ">>>" in (ROOT / path).read_text(encoding="utf-8")]
USER = """
import softjaw as sj

scene = sj.Scene.from_file("bottle.toml").with_values(**{"gripper.shear_modulus_kpa": 60})
case = sj.press(scene, station=0.067, angle=0.0, force=5.0)
force: tuple[float, ...] = scene.load.normal_force_n
e_n: float = case.limits["ccm"].e_n
error: dict[str, float] = case.errors
point: float = sj.GraspMap("a.hdf").best(5, by="payload")[0].place[0, 0]
code: int = sj.run(scene, "a.hdf")
quality: float = sj.grasp_quality(case.patch, mu=0.8, distance=0.1).quality
sj.press("x", force=1)
sj.fit_quartic(case.patch, mu="0.8")
"""


def test_every_name_is_there_for_people_and_for_type_checkers():
    typed = {alias.name: node.module for node in STUB.body for alias in node.names}
    assert set(sj.__all__) <= set(typed) & set(dir(sj))
    functions = [name for name in sj.__all__ if inspect.isfunction(getattr(sj, name))]
    assert {name: getattr(sj, name).__module__ for name in functions} == {name: typed[name] for name in functions}
    with pytest.raises(AttributeError, match="prss"):
        _ = sj.prss


@pytest.mark.parametrize("name", sj.__all__)
def test_every_name_says_what_it_takes_gives_and_refuses(name):
    what = getattr(sj, name)
    text = inspect.getdoc(what)
    if inspect.isfunction(what):
        assert all(f"{part}\n---" in text for part in ("Parameters", "Returns", "Raises", "Examples")), name
        signature = inspect.signature(what)
        assert signature.return_annotation is not inspect.Signature.empty
        assert all(p.annotation is not p.empty for p in signature.parameters.values())


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_of_a_name_is_true(name, tmp_path, monkeypatch):
    (tmp_path / "jobs").symlink_to(ROOT / "jobs")
    (tmp_path / "results").mkdir()
    if name in ("open", "GraspMap"):
        make(tmp_path / "results" / "smoke.hdf", axes=grid_axes([0.0], [0.0, 1.5], [1.0, 2.0]))
    monkeypatch.chdir(tmp_path)
    what = sj
    for part in name.split("."):
        what = getattr(what, part)
    names = {public: getattr(sj, public) for public in sj.__all__}
    [example] = doctest.DocTestFinder(recurse=False).find(what, name, module=False, globs=names)
    assert example.examples
    assert doctest.DocTestRunner().run(example).failed == 0


@pytest.mark.parametrize("path", WITH_EXAMPLES, ids=str)
def test_the_examples_of_a_module_are_true(path):
    """Those of the public names are run above, where the files are that they read."""
    module = importlib.import_module(".".join(("softjaw", *path.with_suffix("").parts)).removesuffix(".__init__"))
    for example in doctest.DocTestFinder().find(module):
        if example.examples and example.name.rpartition(".")[2] not in EXAMPLES:
            assert doctest.DocTestRunner().run(example).failed == 0, example.name


@pytest.mark.long
def test_all_but_solving_works_anywhere_without_petsc_and_mpi(tmp_path):
    path = make(tmp_path / "a.hdf")
    outside = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PMI_", "H5PY_"))}
    code, output, errors = launch(0, "-W", "ignore", "-c", BLOCKED, ROOT, path, cwd="/", env=outside)
    assert code == 0, errors
    early, (turned, ellipsoid, quartic, quality), e_n, largest, refused = json.loads(output)
    assert early == []
    assert turned == pytest.approx(1.0)
    assert quartic < ellipsoid < 0.04
    assert quality == pytest.approx(1.459, abs=1e-3)
    assert 0 < e_n <= largest
    assert [text.partition(" ")[0] for text in refused] == ["press", "run"]
    assert all("doctor" in text for text in refused)


def test_a_run_takes_a_scene_and_a_file_with_its_ending(tmp_path):
    with pytest.raises(StudyError, match=r"\.hdf"):
        sj.run(sj.Scene.from_file(ROOT / "jobs" / "smoke.toml"), tmp_path / "a.h5")
    with pytest.raises(TypeError, match="Scene"):
        sj.run("smoke.toml", tmp_path / "a.hdf")


@pytest.mark.long
def test_a_type_checker_knows_them(tmp_path):
    (tmp_path / "user.py").write_text(USER)
    words = ("-m", "mypy", "--config-file", ROOT / "pyproject.toml", "user.py")
    _, output, _ = launch(0, *words, cwd=tmp_path, env={**os.environ, "MYPYPATH": str(ROOT)})
    wrong = [line.partition(": ")[0] for line in output.splitlines() if line.startswith("user.py")]
    assert wrong == ["user.py:12", "user.py:13"], output
    assert (ROOT / "softjaw" / "py.typed").exists()
