"""Refinement of poses: which neighbours are tried, when the search ends, and the same bits on any ranks."""

from __future__ import annotations

import subprocess
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from softjaw.study.doctor import launch_environment
from softjaw.study.quantities import DONE, WIDE
from softjaw.study.result.layout import MISSING, layout_from_options
from softjaw.study.result.skeleton import rewrite
from softjaw.study.result.store import open_result
from softjaw.study.run.pattern import FINEST_STEP_SHARE, SAME_POSE_STEPS, apart, gained, next_poses, with_places
from softjaw.study.run.plan import make_plan
from softjaw.study.scene import load_scene, parse_scene
from tests.study.launching import ROOT, command, contents, differing, wait_for
from tests.study.test_refine import filled, refined, same_bits

PAD = (0.05, 0.02, 0.015)
SCENE = """
[object]
shape = "box"
size_mm = [60, 40, 120]
edge_radius_mm = 6
[gripper]
elements = [8, 4, 2]
max_opening_mm = 65
[candidates]
refine = BUDGET
refine_within = 0.02
[[candidates.poses]]
label = "wide"
point_mm = [0, 0, 8]
approach = [1, 0, 0]
long_side = [0, 0, 1]
[[candidates.poses]]
point_mm = [0, 0, -20]
approach = [0, 1, 0]
long_side = [1, 0, 0]
[load]
normal_force_n = [1, 2]
[limit_surface]
samples = 80
wrench_samples = ["wide"]
"""


def scene_with(budget, best_within=0.02):
    return parse_scene(SCENE.replace("BUDGET", str(budget)).replace("0.02", str(best_within), 1))


def turned(axis, degrees):
    """Rotation about an axis of the pad."""
    c, s, (i, j) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), ((axis + 1) % 3, (axis + 2) % 3)
    R = np.eye(3)
    R[i, i], R[j, j], R[i, j], R[j, i] = c, c, -s, s
    return R


def test_distances_are_counted_in_first_steps():
    here = (np.zeros(3), np.eye(3))
    for point, turn, expected in (
        ([0.0125, 0, 0], 0, 1.0),
        ([0, -0.0025, 0], 0, 0.5),
        ([0, 0, 0.3], 0, 0.0),  # the press closes the fingers
        ([0, 0, 0], turned(2, 15), 1.0),
        ([0, 0, 0], turned(2, 180), 0.0),  # the pads look the same
        ([0, 0, 0], turned(0, 180), 0.0),  # fingers swapped
        ([0, 0, 0], turned(0, 5), 1.0),
        ([0, 0, 0], turned(1, -2.5), 0.5),
    ):
        there = (np.array(point), np.eye(3) if np.ndim(turn) == 0 else turn)
        assert apart(here, there, PAD) == pytest.approx(expected, abs=1e-6)
        assert apart(there, here, PAD) == pytest.approx(expected, abs=1e-6)


def test_a_gain_is_that_of_the_force_where_it_is_largest():
    values = np.array([[1.0, 2.0], [np.nan, 1.0], [1.1, 2.0]])
    assert gained(values, 2) == pytest.approx(0.1)
    assert gained(values, 3) == 0.0
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


def test_the_top_of_a_hill_is_found_and_no_pose_is_tried_twice():
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


def test_new_poses_stand_in_the_middle_of_the_object_and_none_passes_it():
    rounds, _ = searched(lambda point, *_: 0.1 + 1e-3 * point[2], scene_with(40))
    heights = [x[3] for added in rounds for x in added]
    assert 60 < max(heights) < 60 + 25  # beyond the middle of the pad, which is 50 mm long, no further
    level = [x for added in rounds for x in added if abs(x[4]) > 0.9999 and abs(x[3]) < 50]
    assert level
    assert all(abs(x[1]) < 0.5 for x in level)  # between the faces x = -30 and 30 mm


def test_no_neighbour_is_put_over_a_hole_of_a_mesh(tmp_path):
    body = trimesh.creation.box((60, 40, 120)).subdivide_to_size(6.0)
    middle = body.triangles_center
    hole = (middle[:, 0] > 29.9) & (np.abs(middle[:, 1]) < 4) & (np.abs(middle[:, 2] - 49) < 5)
    assert 2 <= hole.sum() < 30
    body.update_faces(~hole)
    body.export(tmp_path / "body.stl")
    shape = f'shape = "mesh"\nmesh = "{tmp_path}/body.stl"\nunit = "mm"\n'
    text = SCENE.replace("BUDGET", "10").replace('shape = "box"\nsize_mm = [60, 40, 120]\nedge_radius_mm = 6\n', shape)
    rounds, _ = searched(lambda point, approach, _: 0.1 * (approach[0] > 0.9), parse_scene(text))
    shifts = [x[3] for added in rounds for x in added if x[0] == 1.0]
    assert min(shifts) == pytest.approx(8 - 12.5)
    assert max(shifts) == pytest.approx(8)


def test_a_search_ends_where_finer_steps_gain_nothing_or_the_budget_is_spent():
    flat = lambda *_: 0.1  # noqa: E731
    rounds, values = searched(flat, scene_with(400))
    assert [min(x[0] for x in added) for added in rounds][-1] == 0.5
    assert len(values) <= 2 + 2 * 10
    assert searched(lambda *_: np.nan, scene_with(400))[0] == []
    assert sum(map(len, searched(hill, scene_with(13), each=2)[0])) == 6
    # What does not fit is not solved, and costs nothing.
    assert len(searched(flat, scene_with(2), state=WIDE)[1]) == len(values)


def test_a_grown_file_of_poses_keeps_rows_labels_and_places(tmp_path):
    scene, path = scene_with(12), tmp_path / "a.hdf"
    rounds, _ = searched(hill, scene, each=2)
    small, big = make_plan(scene), make_plan(scene, rounds=tuple(rounds))
    assert big.header.digest == small.header.digest == scene.digest
    assert parse_scene(scene.effective_toml()).candidates.refine == scene.candidates.refine
    assert small.layout.sampled == big.layout.sampled == (0,)
    filled(path, small)
    with open_result(path) as before:
        quality = before.read("quality/ccm")
    rewrite(path, big.layout, big.header)
    with open_result(path) as after:
        assert after.layout.added == tuple(rounds)
        assert after.read("quality/ccm")[:2].tobytes() == quality.tobytes()
        assert (after.codes.reshape(8, 2)[2:] == MISSING).all()
        assert after.labels.ravel()[:2].tolist() == ["wide", "pose 1"]
        assert all(str(label).startswith("round ") for label in after.labels.ravel()[2:])
        text = big.layout.options().replace(str(list(rounds[0][0])), "[1.0, 2.0]")
        with pytest.raises(ValueError, match="2 numbers"):
            layout_from_options(after.axes, text)


def test_scenes_of_poses_and_samplers_can_be_refined():
    assert load_scene("jobs/box-poses.toml", ["candidates.refine=true"]).candidates.refine == 120
    assert load_scene("jobs/smoke.toml", ["candidates.refine=true"]).candidates.refine == 120
    assert load_scene("jobs/smoke.toml", ["candidates.refine=false"]).candidates.refine is None


@pytest.mark.long
@pytest.mark.ranks
def test_refined_poses_have_the_same_bits_on_any_number_of_ranks_and_after_a_kill(tmp_path):
    scene = tmp_path / "box.toml"

    def added(path):
        if not path.exists():
            return ()
        with open_result(path) as result:
            return result.layout.added

    def compare():
        scene.write_text(SCENE.replace("BUDGET", "12"))
        alone, _ = refined(scene, "alone.hdf", 0)
        assert len(added(alone)) >= 2
        expected = contents(alone)
        same_bits(scene, expected, 4)
        killed = tmp_path / "killed.hdf"
        process = subprocess.Popen(
            command(0, "-m", "softjaw", "run", scene, "-o", killed), env=launch_environment(), cwd=ROOT,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        wait_for(lambda: len(added(killed)) == 1)
        process.kill()
        process.wait(timeout=30)
        assert len(added(killed)) >= 1
        refined(scene, "killed.hdf", 2)
        assert differing(killed, expected) == []

    compare()
