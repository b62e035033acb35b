"""What accuracy costs: the sweep that tells it, errors and times that its file gives, and the command."""

import numpy as np
import pytest

import softjaw
from softjaw.study.accuracy.cost import cost_scene, mesh_sweep, settings_in
from softjaw.study.case.candidates import axes
from softjaw.study.cli import main
from softjaw.study.messages import DONE
from softjaw.study.scene import Scene, SceneError, parse_scene
from tests.study.launching import ROOT
from tests.study.scenes import BALL, text_of, units_of

SCENE = text_of(BALL, stations="[-10, -5, 0, 5, 10]", angles="[0, 90]", forces="[1, 2, 3, 4, 5]")
SCENE += '[effects]\nfriction_pressure_coupling = "none"\nsheet = "rigid"\n'


def test_a_few_cases_are_solved_on_meshes_of_both_kinds_of_walls_too_without_what_makes_a_study_long():
    scene = cost_scene(parse_scene(SCENE))
    assert scene.sweep == {
        "gripper.elements": ((4, 2, 2), (6, 2, 2), (8, 4, 2), (12, 6, 3)), "gripper.element": ("hex8", "hex27"),
    }  # fmt: skip
    assert scene.candidates.station_values_mm == (-10, 0, 10)
    assert scene.candidates.angles_deg == (0,)
    assert scene.load.normal_force_n == (1, 3, 5)
    assert (scene.run.patches, scene.cases) == ("none", 8 * 9)
    made = units_of(scene)
    assert {(u.scene.gripper.elements, u.scene.gripper.element) for u in made} == {
        (n, kind) for n in scene.sweep["gripper.elements"] for kind in scene.sweep["gripper.element"]
    }
    assert parse_scene(scene.effective_toml()) == scene
    bottle = Scene.from_file(ROOT / "jobs" / "bottle.toml")
    assert mesh_sweep(bottle)["accuracy.wall_element_mm"] == pytest.approx([3, 1.5, 1.05])
    coarse = bottle.with_values({"accuracy.wall_element_mm": 10.0})
    assert mesh_sweep(coarse)["accuracy.wall_element_mm"] == pytest.approx([10, 7])
    assert "gripper.element" in mesh_sweep(bottle.with_values({"effects.object": "rigid"}))
    assert cost_scene(bottle).cases == 4 * 3 * 9
    scene = Scene.from_file(ROOT / "jobs" / "box-poses.toml", ["accuracy.target=0.01", "candidates.refine=true"])
    cost = cost_scene(scene)
    assert (cost.accuracy.target, cost.candidates.refine) == (None, None)
    assert 1 < len(cost.candidates.poses) <= 3
    assert set(cost.candidates.poses) <= set(scene.candidates.poses)
    scene = cost_scene(parse_scene(SCENE, "x.toml", ["sweep.accuracy.contact=['weighted', 'nodal']"]))
    assert scene.sweep == {"accuracy.contact": ("weighted", "nodal")}


@pytest.mark.parametrize(
    "value", ["[[8, 4, 2], 3]", "[[8, 4, 2], [8, 4, 2]]", "[[8, 4], [6, 4, 2]]", "[[8, 4, 2], [0, 4, 2]]"]
)
def test_lists_are_swept_where_each_is_one_that_the_key_takes(value):
    with pytest.raises(SceneError, match=r"gripper\.elements"):
        parse_scene(SCENE, "x.toml", ['run.patches="none"', f"sweep.gripper.elements={value}"])


def test_meshes_are_swept_only_where_no_faces_are_stored():
    both = ["sweep.gripper.elements=[[4, 2, 2], [8, 4, 2]]"]
    with pytest.raises(SceneError, match="patches"):
        parse_scene(SCENE, "x.toml", both)
    scene = parse_scene(SCENE, "x.toml", [*both, 'run.patches="none"'])
    assert axes(scene)[0].options == ("4 x 2 x 2", "8 x 4 x 2")


def test_errors_are_distances_from_the_last_or_smallest_point_and_failed_cases_count_and_leave_the_others(tmp_path):
    short = ("candidates.stations_mm=[0, 10]", "load.normal_force_n=[2]", "gripper.elements=[6, 4, 2]")
    scene, file = tmp_path / "ball.toml", tmp_path / "c.hdf"
    scene.write_text(SCENE)
    words = [word for change in short for word in ("--set", change)]
    assert main(["cost", str(scene), "-o", str(file), *words]) == DONE
    ds = softjaw.open(file)
    settings = settings_in(ds)
    assert [(s.values["gripper.elements"], s.values["gripper.element"]) for s in settings] == [
        (n, kind) for n in ("4 x 2 x 2", "6 x 4 x 2", "8 x 6 x 3") for kind in ("hex8", "hex27")
    ]
    assert [s.given for s in settings] == [i == 2 for i in range(6)]
    assert [s.reference for s in settings] == [i == 5 for i in range(6)]
    assert settings[-1].worst == pytest.approx(dict.fromkeys(("payload", "quality", "e_n"), 0.0), abs=1e-12)
    e_n = ds.e_n.sel(model="ccm")
    error = np.abs(e_n / e_n.isel(elements=-1, element=-1) - 1).isel(elements=1, element=0).values
    assert settings[2].worst["e_n"] == pytest.approx(error.max())
    seconds = ds.work_seconds_total.isel(elements=1, element=0).values
    assert settings[2].seconds == pytest.approx(seconds.mean())
    # of triquadratic elements the finer mesh is nearer to the finest
    assert settings[1].worst["e_n"] > settings[3].worst["e_n"] > 0
    dented = settings_in(ds.assign(indentation=e_n))  # which of all numbers the size of a wall's elements moves most
    assert [s.worst["indentation"] for s in dented] == [s.worst["e_n"] for s in settings]
    ds = ds.isel(element=slice(0, 1))
    ds.elements.attrs |= {"long_name": "accuracy.wall_element_mm", "options": ()}
    text = ds.attrs["scene"].replace('"gripper.elements"', '"accuracy.wall_element_mm"')
    start = text.index('"accuracy.wall_element_mm"')
    end = text.index('"gripper.element"', start)
    scene = text[:start] + '"accuracy.wall_element_mm" = [1.0, 1.5, 2.0]\n' + text[end:]
    found = settings_in(ds.assign_attrs(scene=scene.replace('["hex8", "hex27"]', '["hex8"]')))
    assert [s.reference for s in found] == [True, False, False]
    assert [s.given for s in found] == [False, True, False]
    ds = softjaw.open(file).copy(deep=True)
    assert np.isnan(settings_in(ds.assign(payload=0.0 * ds.payload))[0].worst["payload"])  # of nothing
    for name in ("e_n", "payload", "quality", "work_seconds_total"):
        ds[name].values[0, 0, 0, 0, 0] = np.nan
    failed, *others = settings_in(ds)
    assert failed.failed == 1
    assert np.isfinite([*failed.worst.values(), failed.seconds]).all()
    assert not any(s.failed for s in others)
    ds.e_n.values[1, 1] = np.nan
    assert np.isnan(settings_in(ds)[3].worst["e_n"])
