"""The scripts in jobs/examples: each runs from any folder, draws its picture, and finds what it says."""

import re
import runpy

import numpy as np
import pytest

import softjaw as sj
from softjaw.study.doctor import launch_environment
from softjaw.study.quantities import DONE
from tests.study.launching import ROOT, launch

FOLDER = ROOT / "jobs" / "examples"
SOLVING = {"first_map": 6 * 2, "planner": 12 * 4 * 3, "stiffer_pad": 0, "lift": 1}  # and the cases in their files


def picture(folder, name):
    return (folder / "results" / f"{name.replace('_', '-')}.png").stat().st_size


@pytest.fixture
def here(tmp_path, monkeypatch):
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
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


def blocks(page):
    return "\n".join(re.findall(r"^```python\n(.*?)^```$", (ROOT / page).read_text(), re.M | re.S))


@pytest.mark.long
def test_the_page_on_python_runs_as_it_stands(here, capsys):
    (here / "jobs").symlink_to(ROOT / "jobs")
    found = {}
    exec(compile(blocks("docs/python.md"), "docs/python.md", "exec"), found)
    assert found["code"] == 0
    assert found["case"].e_n == float(found["ds"]["e_n"].sel(model="ccm", angle=0, normal_force=2).item())
    assert "payload" in capsys.readouterr().out
    text = (ROOT / "docs" / "python.md").read_text()
    assert all(f"`{name}`" in text for name in sj.__all__)
    assert f"gives {len(sj.__all__)} names" in text


@pytest.mark.long
def test_the_block_of_the_readme_runs(here, capsys):
    (here / "jobs").symlink_to(ROOT / "jobs")
    exec(compile(blocks("README.md"), "README.md", "exec"), {})
    assert float(capsys.readouterr().out.split()[0]) > 0
