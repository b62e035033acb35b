"""The shipped scenes: each passes ``check``, and each is solved to the end on a coarse mesh."""

import numpy as np
import pytest

from softjaw.study.cli import main
from softjaw.study.result.layout import DONE
from softjaw.study.result.store import open_result
from tests.study.launching import ROOT, solve

JOBS = {path.stem: path for path in sorted((ROOT / "jobs").glob("*.toml"))}
COARSE = ("--set", "gripper.elements=[8, 4, 2]")
# What makes one quick load path of each scene, and the dents that its largest force may leave in a thin wall [mm].
ONE = {
    "bottle-rigid": (("candidates.stations=2", "candidates.stations_mm=[60, 75]", "candidates.angles_deg=[0]",
                      "candidates.refine=false"), None),
    "box-poses": ((), None),
    "flask-mesh": (("candidates.stations_mm=[30]", "candidates.angles_deg=[0]"), None),
    "bottle": (("candidates.stations_mm=[112]", "candidates.angles_deg=[0]", "load.normal_force_n=[1, 8]"), (2.0, 3.0)),
    "cup": (("candidates.stations_mm=[55]", "load.normal_force_n=[0.5, 2]"), (1.0, 4.0)),
    "fig5-candidate": ((), (0.6, 1.2)),
    "fig7-force-study": (("load.normal_force_n=[1, 4]",), (0.8, 1.6)),
    "fig4-curvature": (("gripper.elements=[8, 20, 4]", 'effects.friction_pressure_coupling="none"'), None),
    "snap-in": (("load.normal_force_n=[1, 2]",), (0.7, 1.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(set(JOBS) - {"sampled"}))  # which tests/test_docs.py checks
def test_every_shipped_scene_passes_check(name, capsys):
    assert main(["check", str(JOBS[name])]) == 0
    told = capsys.readouterr()
    assert "no errors" in told.out
    assert told.err == ""


@pytest.mark.long  # tests/study/test_walls.py presses thin walls in the fast stage
@pytest.mark.parametrize("name", ONE)
def test_a_coarse_variant_of_every_scene_is_solved(tmp_path, name):
    path, (overrides, indentations) = tmp_path / f"{name}.hdf", ONE[name]
    coarse_wall = ("accuracy.wall_element_mm=4", "accuracy.meshes=1") if indentations else ()
    words = [word for value in (*coarse_wall, *overrides) for word in ("--set", value)]
    assert ", 0 failed, 0 not computed" in solve(0, JOBS[name], path, *COARSE, *words)
    with open_result(path) as result:
        assert (result.status == DONE).all()
        assert result.read("checks/force_balance").max() < 1e-8
        F_N, S = (result.read(f"{quantity}/{quantity}") for quantity in ("F_N", "S"))
        assert (S >= F_N * (1 - 1e-12)).all()
        assert result.read("checks/min_det_f").min() > 0
        if not indentations:
            assert (result.read("quality/ccm") > 0).all()
            assert (result.read("quality/ccm") <= result.read("quality/pcm") * (1 + 1e-9)).all()
        else:
            indentation = 1e3 * result.read("indentation/indentation")
            assert (np.diff(indentation, axis=-1) > 0).all()  # every newton more dents the wall deeper
            assert indentations[0] < indentation.max() < indentations[1]
            assert (result.read("wall_stress/wall_stress") > 0).all()
        if name == "fig4-curvature":  # curvature costs, and against what to draw it
            curvature_costs(result)


def curvature_costs(result):
    b = result.axes[0].values
    assert result.read("derived/b_over_a") == pytest.approx(b / 0.025, rel=1e-12)
    curvature = result.read("derived/apex_curvature")
    assert curvature == pytest.approx(0.025 / b**2, rel=1e-12)
    order = np.argsort(curvature)
    for name in ("curvature_loss", "f_y_overestimate", "tau_z_overestimate"):
        lost = result.read(f"{name}/{name}")[order, 0, 0, :]
        assert (lost > 0).all(), name
        assert (np.diff(lost, axis=0) > 0).all(), name
    # along the cylinder sliding is in every face's plane: the paper's planar model is exact there
    assert result.read("f_x_overestimate/f_x_overestimate") == pytest.approx(0.0, abs=1e-9)
    for name in ("f_x", "tau_z"):
        claimed = result.read(f"{name}_overestimate_pcm_projected/{name}_overestimate_pcm_projected")
        assert (claimed <= 1e-12).all(), name
    for name in ("e_n", "tau_z_max", "f_y_overestimate"):
        assert np.isfinite(result.read(f"{name}/error")).all()
