"""The survey of bad meshes, scans and random scenes: what it makes, the parts that take seconds, and stated errors."""

from argparse import Namespace

import numpy as np
import pytest
import trimesh

from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.study.case.fit import Jaws
from softjaw.study.case.geometry import ROUNDED_OFF, approach
from softjaw.study.case.sampler import antipodal_grasps
from softjaw.study.case.task import Task
from softjaw.study.scene import parse_scene
from softjaw.study.scene.text import toml_text
from tests.objects.bad_meshes import bad_meshes
from tests.objects.bodies import SCANS, hollow_bottle, hollow_bowl, mug, punctured, scan, spoiled
from tests.objects.coverage import rows
from tests.objects.random_scenes import KINDS, random_scene
from tests.objects.solve import Outcome, objects, solved, start_inside
from tests.objects.survey import GOAL, TOUCH, by_physics, survey

SEED = 3
LOW_POLY = [name for name, (kind, _) in bad_meshes(SEED).items() if kind == "low poly"]
JAWS = Jaws((0.05, 0.022, 0.015), stiffness=8e6, mu=0.8, force=5.0, max_opening=0.085)
MADE = {
    "bottle": lambda: hollow_bottle(0.2, 0.033, 0.014, 0.003),
    "bowl": lambda: hollow_bowl(0.06, 0.004, 0.05),
    "mug": mug,
    "banana with holes": lambda: punctured(scan("banana"), 3),
    "spoiled drill": lambda: spoiled(scan("drill")),
    **{path.stem[8:]: (lambda name=path.stem: scan(name)) for path in sorted(SCANS.glob("*.stl"))},
}


def test_random_scenes_are_valid_bad_meshes_sixty_and_only_a_pad_behind_the_surface_starts_inside():
    made = [random_scene(SEED, k) for k in range(40)]
    assert {kind for kind, _ in made} == set(KINDS)
    assert all(len(parse_scene(toml_text(tables)).load.normal_force_n) == 3 for _, tables in made)
    assert random_scene(SEED, 5) == made[5]
    assert random_scene(SEED + 1, 5) != made[5]
    kinds = [kind for kind, _ in bad_meshes(SEED).values()]
    assert sum(kinds.count(kind) >= 6 for kind in set(kinds)) >= 10
    assert len([kind for kind in kinds if "scan" not in kind]) >= 60
    assert all(len(bad_meshes(SEED)[name][1]().faces) <= 500 for name in LOW_POLY)
    body = trimesh.creation.box((0.04, 0.04, 0.04))
    mesh = MeshObject(np.array(body.vertices), np.array(body.faces, dtype=np.int64))
    for depth in (-0.003, 0.0, 0.002):
        pose = Pose(np.eye(3), np.array([0.0, 0.0, -0.02 + depth]))
        assert start_inside(mesh, pose, (0.03, 0.02, 0.01)) == pytest.approx(depth, abs=1e-12)
    # A cone between the points of the face that are looked at, and a roof whose ridge the smooth surface rounds.
    cone = trimesh.creation.cone(0.004, 0.01, sections=5)
    cone.apply_translation([0.0006, 0.0005, 0.0])
    base = trimesh.creation.box((0.06, 0.04, 0.03))
    base.apply_translation([0.0, 0.0, -0.015])
    roof = trimesh.convex.convex_hull([[x, y, 0.0] for x in (-0.03, 0.03) for y in (-0.02, 0.02)] + [
        [x, 0.0003, 0.02] for x in (-0.0301, 0.0301)])  # fmt: skip
    gripper = parse_scene(toml_text(random_scene(SEED, 0)[1])).gripper
    down = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 1.0]))
    for body in (trimesh.util.concatenate([base, cone]), roof):
        mesh = MeshObject(np.array(body.vertices), np.array(body.faces, dtype=np.int64), crease_angle=0.0)
        assert start_inside(mesh, approach(mesh, down, gripper).pose, gripper.pad_size) < ROUNDED_OFF + 1e-9


@pytest.mark.long
def test_low_poly_meshes_are_solved_and_no_pad_starts_inside(tmp_path):
    outcomes = [solved(name, SEED, tmp_path) for name in LOW_POLY]
    assert [o.name for o in outcomes if o.refused or o.inside > TOUCH] == []
    assert sum(o.solved for o in outcomes) >= GOAL * sum(o.cases for o in outcomes)


@pytest.mark.long
def test_random_scenes_are_solved(tmp_path):
    names = [name for name in objects(SEED) if name.startswith("scene")][:8]
    survey(names, Namespace(seed=SEED, results=tmp_path))
    outcomes = [Outcome.load(file) for file in tmp_path.glob("*.json")]
    assert len(outcomes) == len(names)
    excused = sum(by_physics(message) for o in outcomes for _, message in o.failures)
    assert sum(o.solved for o in outcomes) + excused >= GOAL * sum(o.cases for o in outcomes)


@pytest.mark.long
def test_nine_of_ten_errors_are_inside_the_stated_ones_and_these_are_not_far_too_large():
    """Ten scenes leave 0.95 uncertain by some hundredths."""
    found = [row for k in range(200, 210) for row in rows(8, k)]
    true, stated = np.array([row[-2:] for row in found], float).T
    known = np.isfinite(stated)
    assert known.mean() > 0.9
    assert (true[known] <= stated[known]).mean() >= 0.9
    assert stated[known].mean() < 6.0 * true[known].mean()  # 2 to 4 on 144 scenes, ten swing


SHORT = "mug", "banana with holes"


@pytest.mark.parametrize("name", [*SHORT, *(pytest.param(n, marks=pytest.mark.long) for n in MADE if n not in SHORT)])
def test_it_loads_and_can_be_grasped(name, tmp_path):
    path = tmp_path / "body.stl"
    MADE[name]().export(path)
    obj = MeshObject.from_file(str(path), "m")
    grasps = [g for g in antipodal_grasps(obj.surface(), JAWS, Task(obj.solid[1]), 4, samples=40) if not g.state]
    assert len(grasps) >= 3
    assert all(g.opening <= JAWS.max_opening for g in grasps)
    lower, upper = obj.bounds
    assert all(((g.point > lower - 0.01) & (g.point < upper + 0.01)).all() for g in grasps)
    assert obj.notes or name != "banana with holes"
