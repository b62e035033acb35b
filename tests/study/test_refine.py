"""Refinement of the stations: where the next ones go, what a grown file keeps, and the same bits on any ranks."""

from contextlib import closing
from itertools import combinations
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from softjaw.study.case.result import CaseResult
from softjaw.study.quantities import DONE, MISSING, WIDE
from softjaw.study.result.skeleton import UNFINISHED, rewrite
from softjaw.study.result.store import open_result, torn_rows
from softjaw.study.result.write import ResultWriter
from softjaw.study.run.plan import make_plan
from softjaw.study.run.refine import FINEST_SPACING_SHARE, chances, gained, next_stations, scores_of_poses, with_places
from softjaw.study.run.rounds import FINEST_STEP_SHARE, SAME_POSE_STEPS, apart, next_poses
from softjaw.study.scene import load_scene, parse_scene
from tests.study.formula_results import written
from tests.study.launching import begin, contents, differing, solve, wait_for
from tests.study.scenes import mesh_of, pose_of, text_of

GIVEN = np.linspace(25.0, 175.0, 35)
BEST_WITHIN = 0.02
PAD = (0.05, 0.02, 0.015)
BODY = 'shape = "box"\nsize_mm = [60, 40, 120]\nedge_radius_mm = 6'
VASE = 'shape = "revolution"\nprofile_mm = [[0, 30], [20, 30], [40, 26], [50, 25], [60, 26], [80, 30], [100, 30]]'
PLACES = "stations_mm = [28, 38, 46, 54, 64]\nangles_deg = [0, 90]\nrefine = 12\n"
SAMPLES = "[limit_surface]\nsamples = 80\n"
SCENE = text_of(VASE, PLACES, forces="[1, 2]") + SAMPLES


def tent(x, peak, width):
    return 0.05 + 0.15 * np.maximum(1 - np.abs(x - peak) / width, 0.0)


def rounds_until_known(formula, budget=30):
    """Stations that are added before nothing is expected to be better, by the rule of a study."""
    asked = SimpleNamespace(refine=budget)
    scene = SimpleNamespace(candidates=asked, accuracy=SimpleNamespace(refined_within=BEST_WITHIN))
    asked.station_values_mm = GIVEN.tolist()
    added = []
    while True:
        stations = np.array(sorted([*GIVEN, *(s for some in added for s in some)]))
        values = {"payload/ccm": formula(stations)[:, None, None], "flags/flags": np.zeros((len(stations), 1, 1))}
        result = SimpleNamespace(
            layout=SimpleNamespace(added=tuple(added), shape=(len(stations), 1, 1), inputs=1),
            read=values.get, scene="",
            axes=[SimpleNamespace(values=1e-3 * stations), None, None], status=np.full((len(stations), 1, 1), DONE),
        )  # fmt: skip
        more = next_stations(result, scene, 1)
        if not more:
            return [s for some in added for s in some], formula(stations).max()
        added.append(more)


@pytest.mark.parametrize("peak", [66.75, 67.6, 69.0, 100.0, 171.0])
@pytest.mark.parametrize("width", [4.0, 6.0, 20.0])
def test_the_best_of_a_steep_peak_is_found(peak, width):
    """Half as wide as the stations are apart, and wider."""
    added, best = rounds_until_known(lambda x: tent(x, peak, width))
    assert best > 0.2 * (1 - BEST_WITHIN)
    assert 1 <= len(added) <= 20
    assert np.abs(np.array(added) - peak).max() < 12 + width


def test_nothing_is_added_where_nothing_can_be_gained_a_jump_is_followed_and_a_budget_kept():
    assert rounds_until_known(lambda x: 0.1 + 1e-4 * x)[0] == []
    assert rounds_until_known(lambda x: np.full(x.shape, np.nan))[0] == []
    added, _ = rounds_until_known(lambda x: np.where(x < 90.0, 0.1, 0.2))
    assert len(added) < 16
    assert np.diff(sorted([*GIVEN, *added])).min() > 0.9 * FINEST_SPACING_SHARE * np.diff(GIVEN)[0]
    assert len(rounds_until_known(lambda x: tent(x, 66.75, 4.0), budget=3)[0]) == 3
    stations, score = np.arange(4.0), np.array([1.0, 2.0, 9.0, 1.0]).reshape(1, 4, 1, 1)
    found = chances(stations, score, np.array([True, True, False, False]).reshape(1, 4, 1, 1), 0.1)
    assert found[0] > 0  # judged against 2, not 9
    assert found[2] == 0  # both ends cannot be used


def test_a_grown_file_keeps_every_row(tmp_path):
    scene, path = parse_scene(SCENE), tmp_path / "a.hdf"
    small, big = (make_plan(scene, rounds=rounds) for rounds in ((), ((50.0,), (33.0, 42.0))))
    assert big.header.digest == small.header.digest == scene.digest
    filled(path, small)
    with open_result(path) as before:
        old = {d.path: before.file.values(d.path) for d in before.layout.datasets}
        labels = before.labels
    with h5py.File(path, "r+") as file:
        file["study/e_n/ccm"][1, 0, 0] = 7.0  # torn
    rewrite(path, big.layout, big.header)
    own = [0, 2, 4, 6, 7]
    with open_result(path, unchecked=True) as after:
        assert after.layout.added == ((50.0,), (33.0, 42.0))
        assert after.axes[-3].values == pytest.approx(1e-3 * np.array([28, 33, 38, 42, 46, 50, 54, 64]))
        assert (after.codes[[1, 3, 5]] == MISSING).all()
        assert (after.codes[own] == DONE).all()
        assert (after.labels[[0, 2, 4, 6, 7]] == labels).all()
        for name in ("study/patch/pressure", "study/quality/ccm"):
            found = after.file.values(f"/{name}")
            assert found[own].tobytes() == old[f"/{name}"].tobytes()
    assert torn_rows(path, big.layout) == [2 * 2 * 2]
    assert not list(tmp_path.glob("*.grown*"))


def filled(path, plan):
    def case(index):
        random = np.random.default_rng(index)
        values = {f"maps/{name}": random.random(3) for name in ("quality", "e_n")} | {"maps/flags": 0.0}
        return CaseResult(values, {"pressure": random.random((2, plan.layout.faces))})

    written(path, plan.layout, case, plan.header)


def posed(budget, shape=BODY):
    places = pose_of((0, 0, 8), label="wide") + pose_of((0, 0, -20), (0, 1, 0), (1, 0, 0))
    pad = "[8, 4, 2]\nmax_opening_mm = 65"
    return text_of(shape, f"refine = {budget}\n{places}", forces="[1, 2]", elements=pad) + SAMPLES


def scene_with(budget, shape=BODY):
    return parse_scene(posed(budget, shape))


def turned(axis, degrees):
    return Rotation.from_euler(axis, degrees, degrees=True).as_matrix()


def test_distances_are_counted_in_first_steps_and_a_gain_is_that_of_the_force_where_it_is_largest():
    here = (np.zeros(3), np.eye(3))
    for point, turn, expected in (
        ([0.0125, 0, 0], 0, 1.0),
        ([0, -0.0025, 0], 0, 0.5),
        ([0, 0, 0.3], 0, 0.0),  # the press closes the fingers
        ([0, 0, 0], turned("z", 15), 1.0),
        ([0, 0, 0], turned("z", 180), 0.0),  # the pads look the same
        ([0, 0, 0], turned("x", 180), 0.0),  # fingers swapped
        ([0, 0, 0], turned("x", 5), 1.0),
        ([0, 0, 0], turned("y", -2.5), 0.5),
    ):
        there = (np.array(point), np.eye(3) if np.ndim(turn) == 0 else turn)
        assert apart(here, there, PAD) == pytest.approx(expected, abs=1e-6)
        assert apart(there, here, PAD) == pytest.approx(expected, abs=1e-6)
    values = np.array([[1.0, 2.0], [np.nan, 1.0], [1.1, 2.0]])
    assert gained(values, 2) == pytest.approx(0.1)
    assert gained(values, 3) == pytest.approx(0.0, abs=1e-12)
    assert gained(np.array([[np.nan], [1.0]]), 1) == np.inf


def searched(formula, scene, each=1, state=DONE):
    """Rounds of a search where every pose has the score of a formula of point [mm], approach and long side."""
    rounds, given = [], len(scene.candidates.poses)
    while True:
        poses = with_places(scene.candidates.poses, rounds)
        values = np.array([formula(*(np.array(x) for x in (p.point_mm, p.approach, p.long_side))) for p in poses])
        status = np.full((len(poses), 1, each), DONE)
        status[given:] = state
        layout = SimpleNamespace(added=tuple(rounds), shape=status.shape)
        more = next_poses(SimpleNamespace(layout=layout, status=status), values[:, None], scene, each)
        if not more or len(rounds) > 100:
            return rounds, values
        rounds.append(more)


def hill(point, approach, long_side):
    """A score with its peak 14 mm along the pad and 4 mm across it from a pose of the scene, rolled by 20 degrees."""
    if abs(approach[0]) < 0.7:
        return 0.05
    roll = np.degrees(np.arctan2(long_side[1], long_side[2])) - 20.0
    return 0.1 - 1e-4 * ((point[2] - 22.0) ** 2 + (point[1] - 4.0) ** 2 + (roll / 3.0) ** 2)


def test_the_top_of_a_hill_is_found_no_pose_tried_twice_and_new_ones_stand_in_the_middle_of_the_object():
    scene = scene_with(60)
    rounds, values = searched(hill, scene)
    assert values[:2].max() < 0.075
    assert values.max() > 0.1 * (1 - 0.02)
    shares = [added[0][0] for added in rounds]
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] >= FINEST_STEP_SHARE
    places = [(x[0], 1e-3 * np.array(x[1:4]), np.column_stack([x[7:], np.cross(x[4:7], x[7:]), x[4:7]]))
              for added in rounds for x in added]  # fmt: skip
    for (_, *one), (share, *other) in combinations(places, 2):
        assert apart(one, other, scene.gripper.pad_size) > SAME_POSE_STEPS * share * 0.999
    rounds, _ = searched(lambda point, *_: 0.1 + 1e-3 * point[2], scene_with(40))
    heights = [x[3] for added in rounds for x in added]
    assert 60 < max(heights) < 60 + 25  # beyond the middle of the pad, which is 50 mm long, no further
    level = [x for added in rounds for x in added if abs(x[4]) > 0.9999 and abs(x[3]) < 50]
    assert level
    assert all(abs(x[1]) < 0.5 for x in level)  # between the faces x = -30 and 30 mm


@pytest.mark.long
def test_no_neighbour_is_put_over_a_hole_and_a_search_ends_where_finer_steps_gain_nothing(tmp_path):
    body = trimesh.creation.box((60, 40, 120)).subdivide_to_size(6.0)
    middle = body.triangles_center
    hole = (middle[:, 0] > 29.9) & (np.abs(middle[:, 1]) < 4) & (np.abs(middle[:, 2] - 49) < 5)
    assert 2 <= hole.sum() < 30
    body.update_faces(~hole)
    body.export(tmp_path / "body.stl")
    scene = scene_with(10, mesh_of(tmp_path / "body.stl"))
    rounds, _ = searched(lambda point, approach, _: 0.1 * (approach[0] > 0.9), scene)
    shifts = [x[3] for added in rounds for x in added if x[0] == 1.0]
    assert min(shifts) == pytest.approx(8 - 12.5)
    assert max(shifts) == pytest.approx(8)
    flat = lambda *_: 0.1  # noqa: E731
    rounds, values = searched(flat, scene_with(400))
    assert [min(x[0] for x in added) for added in rounds][-1] == 0.5
    assert len(values) <= 2 + 2 * 10
    assert searched(lambda *_: np.nan, scene_with(400))[0] == []
    assert sum(map(len, searched(hill, scene_with(13), each=2)[0])) == 6
    # What does not fit is not solved, and costs nothing.
    assert len(searched(flat, scene_with(2), state=WIDE)[1]) == len(values)


@pytest.mark.parametrize("hand", ["", 'preset = "franka_hand"\n'])
def test_of_uncertain_inputs_the_scenes_own_say_which_grasps_are_good_at_every_point_of_a_sweep(tmp_path, hand):
    text = posed(12).replace("[gripper]\n", f"[gripper]\n{hand}")
    uncertain = '[uncertainty]\nsamples = 8\nspread = { "friction.mu" = 0.1 }\n'
    plan = make_plan(parse_scene(f"{text}\n{uncertain}[sweep]\n'gripper.shear_modulus_kpa' = [40, 80]\n"))

    def case(index):
        point, sample, pose, _, force = index
        held = 1.0 + point + 0.1 * pose + 0.01 * force + 10.0 * sample
        return CaseResult({"maps/payload": [held] * 3, "maps/flags": 0.0})

    with open_result(written(tmp_path / "a.hdf", plan.layout, case, plan.header)) as result:
        scores = scores_of_poses(result)
    assert scores.shape == (2, 4)
    if not hand:  # of which nothing is known where the pads stand
        assert scores == pytest.approx(np.add.outer([0.0, 0.1], [1.0, 1.01, 2.0, 2.01]))


def test_a_grown_file_of_poses_keeps_rows_labels_and_places_and_samplers_can_be_refined(tmp_path):
    scene, path = scene_with(12), tmp_path / "a.hdf"
    rounds, _ = searched(hill, scene, each=2)
    small, big = make_plan(scene), make_plan(scene, rounds=tuple(rounds))
    assert big.header.digest == small.header.digest == scene.digest
    assert parse_scene(scene.effective_toml()).candidates.refine == scene.candidates.refine
    filled(path, small)
    with open_result(path) as before:
        quality = before.read("quality/ccm")
    rewrite(path, big.layout, big.header)
    with open_result(path) as after:
        assert after.layout.added == tuple(rounds)
        assert after.read("quality/ccm")[:2].tobytes() == quality.tobytes()
        assert (after.codes.reshape(8, 2)[2:] == MISSING).all()
        assert after.labels.ravel()[:2].tolist() == ["wide", "p01"]
        assert after.labels.ravel()[2:].tolist() == [f"p{i:02d}" for i in range(2, 8)]
    with closing(ResultWriter(path, big.layout, None)) as writer:
        writer.write_report("ended")
    for packed, report in ((True, "ended"), (False, UNFINISHED)):  # as before a retry, which may be killed
        rewrite(path, big.layout, big.header, packed=packed)
        with open_result(path) as result:
            assert result.report == report
    assert load_scene("jobs/box-poses.toml", ["candidates.refine=true"]).candidates.refine == 120
    assert load_scene("jobs/smoke.toml", ["candidates.refine=true"]).candidates.refine == 120
    assert load_scene("jobs/smoke.toml", ["candidates.refine=false"]).candidates.refine is None


def added(path):
    if not path.exists():
        return ()
    with open_result(path) as result:
        return result.layout.added


def best(path):
    with open_result(path) as result:
        return np.nanmax(result.read("quality/ccm")[..., -1])


@pytest.mark.long
@pytest.mark.ranks
@pytest.mark.parametrize(("text", "own", "gain"), [(SCENE, 20, 2.0), (posed(12), 4, 1.0)], ids=["stations", "poses"])
def test_a_study_that_grows_has_the_same_bits_on_any_ranks_if_it_is_refined_late_and_after_a_kill(
    tmp_path, text, own, gain
):
    """``own`` cases come first; the best grasp is so many times better than that of these."""
    scene = tmp_path / "scene.toml"
    scene.write_text(text)
    alone, late, killed = (tmp_path / f"{name}.hdf" for name in ("alone", "late", "killed"))
    solve(0, scene, alone)
    assert len(added(alone)) >= 2
    expected = contents(alone)
    for ranks in (2, 3):
        solve(ranks, scene, tmp_path / f"{ranks}.hdf")
        assert differing(tmp_path / f"{ranks}.hdf", expected) == []
    assert "round" not in solve(2, scene, late, "--set", "candidates.refine=false")
    assert best(alone) >= gain * best(late)
    assert f"0 of {own} cases to solve" in solve(2, scene, late)
    assert differing(late, expected) == []
    process = begin(0, "-m", "softjaw", "run", scene, "-o", killed)
    wait_for(lambda: len(added(killed)) == 1)
    process.kill()
    process.communicate(timeout=30)
    solve(2, scene, killed)
    assert differing(killed, expected) == []
