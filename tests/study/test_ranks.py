"""Real runs under mpirun: not a bit of the results depends on the number of ranks, on stops, or on kills."""

import os
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

from softjaw.study.doctor import launch_environment
from softjaw.study.quantities import MISSING
from softjaw.study.result.store import open_result
from softjaw.study.run.plan import make_plan
from softjaw.study.run.shares import shares
from tests.study.launching import ROOT, begin, contents, differing, done, launch, solve, wait_for
from tests.study.scenes import BOX, NO_COUPLING, scene_of
from tests.study.test_walls import CUP

pytestmark = pytest.mark.ranks

# Two stations x three angles: 205 degrees is the image of 25, so there are four load paths of two forces.
ROUNDED = BOX.replace("edge_radius_mm = 4", "edge_radius_mm = 8")
CHANGES = ("limit_surface.samples=80", "accuracy.target=0.03", "accuracy.target_of='e_n'", NO_COUPLING)
PLACES = {"stations": "[0, 30]", "angles": "[0, 5, 185]", "forces": "[1, 3]"}
SCENE = scene_of(ROUNDED, *CHANGES, **PLACES)
CASES = 12
THIN_CUP = CUP.replace("0.6", "0.4")
# The same program with a pause before every case, so that there is time to interrupt it.
SLOWLY = """
import os, sys, time
os.environ["H5PY_ALWAYS_USE_MPI"] = "1"
from softjaw.study import pipeline
solve = pipeline.solve_unit

def slow(unit, wanted):
    for case in solve(unit, wanted):
        time.sleep(0.12)
        yield case

pipeline.solve_unit = slow
from softjaw.study.cli import main
sys.exit(main())
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "box.toml"
    for shape, file in ((ROUNDED, path), (THIN_CUP, path.with_name("cup.toml"))):
        file.write_text(scene_of(shape, *CHANGES, **PLACES).effective_toml())
    return path


@pytest.fixture(scope="module")
def alone(tmp_path_factory, scene):
    path = tmp_path_factory.mktemp("alone") / "alone.hdf"
    solve(0, scene, path)
    return path


def test_two_ranks_divide_the_forces_of_a_candidate():
    """So that what follows compares forces that were solved beside each other with forces that were solved in turn."""
    divided = [own.unit.index for own in shares(make_plan(SCENE).units, np.full(CASES, MISSING), 2)]
    assert len(divided) > len(set(divided)) == 4


@pytest.mark.long
@pytest.mark.parametrize("ranks", [2, 3, 4])
@pytest.mark.parametrize("name", ["box", "cup"])
def test_one_candidate_of_many_forces_is_divided_to_the_same_bits(tmp_path, scene, ranks, name):
    changes = ("candidates.stations_mm=[30]", "candidates.angles_deg=[5]", "load.normal_force_n=[0.5, 1, 2, 3, 4, 6]",
               "effects.friction_pressure_coupling='auto'")  # fmt: skip
    if name == "cup":
        changes += ("accuracy.wall_element_mm=4", "gripper.pad_length_mm=30")
    place = [word for change in changes for word in ("--set", change)]
    whole, path = tmp_path / "whole.hdf", tmp_path / "divided.hdf"
    for where, count in ((whole, 0), (path, ranks)):
        solve(count, scene.with_stem(name), where, *place)
    assert differing(path, contents(whole)) == []


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.long), 2, pytest.param(3, marks=pytest.mark.long)])
def test_any_number_of_ranks_writes_the_same_bits(tmp_path, scene, alone, ranks):
    path = tmp_path / "ranks.hdf"
    solve(ranks, scene, path)
    assert not list(tmp_path.glob("*.lock"))
    assert not list(tmp_path.glob("*.part"))
    expected = contents(alone)
    # all that is compared: maps of every model, both fingers, the checks and every face
    for name in ("e_n/ccm", "quality/pcm", "checks/ellipticity", "patch/pressure",
                 "checksums/rows/study/patch/pressure", "quality_fitted/pcm",
                 "limit_surface/coefficients"):  # fmt: skip
        assert f"study/{name}" in expected
    with open_result(path) as result:
        elements = result.read("pad_elements/pad_elements")
    # the scene's mesh is 8 x 4 x 2, further ones of some cases are 10 x 6 x 3 and 12 x 8 x 4
    assert elements.max() > 8 * 4 * 2
    assert differing(path, expected) == []


@pytest.mark.parametrize(("how", "ranks"), [
    ("SIGUSR1", 0), pytest.param("SIGUSR1", 2, marks=pytest.mark.long),
    pytest.param("SIGKILL", 3, marks=pytest.mark.long),
])  # fmt: skip
def test_a_run_that_is_stopped_or_killed_goes_on_with_other_ranks_to_the_same_bits(tmp_path, scene, alone, how, ranks):
    path = tmp_path / f"{how}.hdf"
    process = begin(0, "-c", SLOWLY, "run", scene, "-o", path)
    wait_for(lambda: done(path) >= 2)
    process.send_signal(getattr(signal, how))
    process.communicate(timeout=60)
    code, before = process.returncode, done(path)
    assert code == (75 if how == "SIGUSR1" else -signal.SIGKILL)
    assert 2 <= before < CASES
    solve(ranks, scene, path)
    assert differing(path, contents(alone)) == []


@pytest.fixture
def nodes():
    """Skip where namespaces cannot be made."""
    if os.geteuid() or not shutil.which("ip"):
        pytest.skip("needs root and iproute2")
    if subprocess.run(["unshare", "--net", "--uts", "true"], check=False, capture_output=True).returncode:
        pytest.skip("this kernel makes no namespaces")


@pytest.mark.long
@pytest.mark.usefixtures("nodes")
def test_two_nodes_write_the_file_of_one_process(tmp_path):
    scene = ROOT / "jobs" / "smoke.toml"
    study = ("-m", "softjaw", "run", scene, "-o")
    words = [ROOT / "tests" / "two_nodes.sh", "2", sys.executable, *study, tmp_path / "two.hdf"]  # ranks of each node
    run = subprocess.run(words, cwd=ROOT, env=launch_environment(), capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    assert launch(0, *study, tmp_path / "one.hdf")[0] == 0
    expected = contents(tmp_path / "one.hdf")
    assert len(expected) > 100
    assert not differing(tmp_path / "two.hdf", expected)
