"""What check, plan, show and the report say of a thin wall: a can that was pressed, and files made up from it."""

import numpy as np
import pytest
import xarray as xr

from softjaw.study import pipeline
from softjaw.study.case.effects import EffectChoice
from softjaw.study.case.solver import FINE, CandidateSolver
from softjaw.study.flags import Flag
from softjaw.study.quantities import DONE, FAILED
from softjaw.study.ranking import judge, judged, least_force, ranking, shown_level
from softjaw.study.result import derived
from softjaw.study.result.read import open, read_field
from softjaw.study.result.write import ResultWriter
from softjaw.study.run.plan import make_plan, memory, wall_unknowns
from softjaw.study.scene import parse_scene
from softjaw.study.show.best_grasps import answer, best, safe_range
from softjaw.study.show.grasps import at, field
from softjaw.study.show.object_surface import undeformed
from softjaw.study.show.report import curves, maps, tables, writing
from softjaw.study.show.view.model import View, view_of
from tests.study.formula_results import written
from tests.study.scenes import text_of

CAN = """shape = "revolution"
profile_mm = [[0, 30], [40, 30], [70, 30], [100, 30]]
wall_mm = 0.35
wall_material = "PP"
support = "standing"
mass_g = 60
allowed_dent_mm = 1.5"""
SCENE = text_of(CAN, stations="[30, 50]", forces="[1, 3]", elements="[4, 4, 2]")
SCENE += "[task]\nweight_direction = [0, 0, -1]\nsafety = 1\n[accuracy]\nwall_element_mm = 6\n"


def write(path, scene, results):
    plan = make_plan(scene, "can.toml")
    rows = iter(range(plan.layout.rows))
    written(path, plan.layout, lambda _: results.get(next(rows), "the wall gave way"), plan.header)
    writer = ResultWriter(path, plan.layout, None)
    derived.finalise(writer, scene)
    writer.close()
    return path


@pytest.fixture(scope="module")
def solved():
    scene, results = parse_scene(SCENE), {}
    for unit in make_plan(scene).units:
        for k, result in pipeline.solve_unit(unit):
            results |= {rows[k]: pipeline.image(result, unit, c) for c, rows in enumerate(unit.rows)}
    return scene, results


@pytest.fixture(scope="module")
def can(tmp_path_factory, solved):
    return write(tmp_path_factory.mktemp("can") / "can.hdf", *solved)


def test_the_size_of_a_shell_is_that_of_its_mesh_and_show_has_indentations_stress_and_the_window(solved, can):
    scene = solved[0].with_values({"accuracy.wall_element_mm": 4.0})
    size = wall_unknowns(scene)
    for roll in (0.0, 90.0, 30.0):
        turned = scene.with_values({"candidates.roll_deg": roll})
        solver = CandidateSolver(turned, make_plan(turned).units[1].candidate.poses)  # the middle station
        shell = solver.pressing(FINE, EffectChoice(solver).levels).shell
        assert wall_unknowns(turned) == pytest.approx(6 * shell.nodes, rel=0.04)  # the axis is one node
        solver.put_away()
    fine = scene.with_values({"accuracy.wall_element_mm": 1.5})
    assert wall_unknowns(fine) > 2.5 * size
    assert memory(fine) > memory(scene)
    assert memory(scene) > memory(scene.with_values({"effects.object": "rigid"}))
    ds = open(can)
    table, strong, low, high = best(ds), best(ds, force=3.0), ds.force_low.values, ds.force_high.values
    assert table.facts["force"] == 1.0
    names = [c.name for c in table.columns if c.display]
    assert {"payload", "indentation", "wall_stress", "safe_forces"} <= set(names)
    assert table.rows[0]["safe_forces"] == f"{low[0, 0]:.3g}..{high[0, 0]:.3g}"
    assert (table.rows[0]["force_low"], table.rows[0]["force_high"]) == (low[0, 0], high[0, 0])
    # 3 N dents both stations deeper than 1.5 mm
    assert [row["notes"] for row in strong.rows] == [Flag.TOO_STRONG.word] * 2
    assert [row["flags"] & (Flag.TOO_WEAK | Flag.TOO_STRONG) for row in strong.rows] == [0, 0]  # as in the file


def test_what_an_unfinished_run_has_solved_is_judged_by_its_wall(solved, tmp_path, can):
    """Of the second station 3 N are still to come: nothing is known beyond 1 N, which dents it less than is allowed."""
    writer = ResultWriter(write(tmp_path / "a.hdf", *solved), make_plan(solved[0], "can.toml").layout, None)
    writer.forget(3)
    writer.close()
    ds, whole = open(tmp_path / "a.hdf"), open(can)
    assert ds.force_high.values[0, 0] == whole.force_high.values[0, 0] < 3
    assert np.isnan(ds.force_high.values[1, 0])
    assert ds.force_low.values[0, 0] == whole.force_low.values[0, 0]
    # below the first force the second one tells the law; it is still to come
    assert ds.force_low.values[1, 0] == pytest.approx(whole.force_low.values[1, 0], rel=0.1)
    assert judged(ds)[0, 0, 1] & Flag.TOO_STRONG
    assert 0 < ds.force_high_error.values[0, 0] < 1
    assert any("1 cases" in note for note in best(ds).notes)


@pytest.mark.parametrize("flag", [Flag.SLIDES_OUT, Flag.YIELDS])
def test_grasps_that_slide_out_or_yield_come_last(can, flag):
    ds = open(can)
    first = best(ds, force=1.0).rows[0]["station"]
    ds["flags"].loc[{"station": first, "normal_force": 1.0}] |= int(flag)
    table = best(ds, force=1.0)
    assert table.rows[0]["station"] != first
    assert any(flag.word in row["notes"] for row in table.rows)


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_no_force_is_safe_where_the_hand_presses_harder_than_the_wall_bears(can, tmp_path, share):
    ds, hand = open(can), tmp_path / "hand.toml"
    low, high = ds.force_low.values[0, 0], ds.force_high.values[0, 0]
    assert low < 0.9 * high
    hand.write_text(f"[hand]\nforce_n = [{share * high}, 100]\n")
    ds.attrs["scene"] = ds.attrs["scene"].replace("[gripper]", f'[gripper]\npreset = "{hand}"')
    assert least_force(ds) == share * high
    assert safe_range(ds, (0, 0, 0)) == (f"{share * high:.3g}..{high:.3g}" if share < 1 else "none")
    assert (answer(judge(ds), (0, 0, 0))["force"][0] == "none is safe") == (share > 1)


def test_cases_outside_their_window_are_judged_by_the_force():
    """A weight held from 2 N on and a wall that bears 3 N leave 2 and 3 N of 1, 2, 3 and 4 N."""
    over = ("angle", "normal_force")
    ds = xr.Dataset({"flags": (over, np.zeros((1, 4), np.int64)), "normal_force": [1.0, 2, 3, 4]})
    assert judged(ds).tolist() == [[0, 0, 0, 0]]
    ds["safety_factor"] = ((*over, "model"), np.array([[[0.5], [1.0], [1.5], [2.0]]]))
    ds = ds.assign(force_low=("angle", [2.0]), force_high=("angle", [3.0])).assign_coords(model=["ccm"])
    flags = judged(ds)
    assert flags.tolist() == [[Flag.TOO_WEAK, 0, 0, Flag.TOO_STRONG]]
    ds = ds.drop_vars("force_low").assign(status=(over, np.full((1, 4), DONE)))
    assert shown_level(ds, flags)[0] == 2
    assert shown_level(ds, flags | Flag.TOO_WEAK)[0] == 2
    assert shown_level(ds, np.full((1, 4), Flag.TOO_STRONG))[0] == 3
    collide = np.array([[0, 0, Flag.COLLISION, Flag.COLLISION]])  # beside an object that is small
    assert shown_level(ds, collide) == (1, "the highest at which a grasp can be used")
    assert ranking(np.array([4.0, 1, 2, 5]), flags[0]).tolist() == [2, 1, 3, 0]


def test_the_report_answers_at_a_force_that_the_wall_bears_and_shows_the_wall_as_it_is_deformed(can, solved):
    """3 N indentation the can by more than is allowed; at 1 N both stations are safe."""
    data, scene = judge(open(can)), solved[0]
    high = data.force_high.values[0, 0]
    assert data.normal_force.values[data.attrs["best"][-1]] == 1.0
    assert safe_range(data, (0, 0, 0)).endswith(f"{high:.3g}")
    words, *figures = writing.wall(View(data), data.attrs["best"])
    (over_force,) = maps.maps(data, data.attrs["best"])
    assert "0.35 mm PP" in words["text"]
    assert len(figures) == 2  # sections of the wall, force over indentation
    *buttons, level = over_force["figure"].layout.updatemenus[0].buttons
    borne = buttons[maps._names(data).index("force_high")]
    assert borne.args[0]["z"][0][0][0] == borne.args[0]["z"][0][1][0] == pytest.approx(high)
    assert level.args[0]["z"][0] == [[2.0, 2.0]] * 2  # nonlinear shell at both forces
    # The can's radius is 30 mm; its wall comes nearer to the axis by the indentation, less the motion as a whole.
    place = read_field(can, "wall/place").values[0, 0, 1].reshape(48, 40, 3)
    indentation = at(data, "indentation", (0, 0, 1))
    section = curves.wall_section(View(data), (0, 0, 1))["figure"].data
    view, index = view_of(data, 0, (None, None), 3.0)
    before = undeformed(scene.object, 0.0)
    radius, wall_of = (np.hypot(x[..., 0], x[..., 1]) for x in (before, place))
    assert (radius - wall_of)[:, 20:].max() == pytest.approx(indentation, rel=0.1)
    lines = [np.stack([line.x, line.y]) for line in section]  # before: along and across the axis; after: the same
    assert np.hypot(*lines[1]) == pytest.approx(30.0, abs=0.05)
    assert (lines[0][1, 0], lines[0][1, -1]) == (pytest.approx(-30.0, abs=1e-6), pytest.approx(30.0, abs=1e-6))
    assert 30.0 - lines[3][1, 0] > 1.0
    moved = np.hypot(*view.moved(index)[:, :2].T) - np.hypot(*view.surface.points[:, :2].T)
    assert -moved.min() == pytest.approx(indentation, rel=0.2)


def test_failed_candidates_are_shown_as_failed(tmp_path, solved):
    scene, results = solved
    path = write(tmp_path / "half.hdf", scene, {row: results[row] for row in (0, 1)})
    data = judge(open(path))
    assert np.isfinite(field(data, "force_high")[:, 0, 0]).tolist() == [True, False]
    assert safe_range(data, (1, 0, 0)) == "-"
    (block,) = tables.reasons(data, FAILED)
    assert block["texts"][0].startswith("2 x failed: the wall gave way")
