"""The survey of objects and random scenes: its generator, its classes of reasons, and a small part of it, run."""

from __future__ import annotations

import json
from argparse import Namespace

import numpy as np
import pytest

from softjaw.study.case.build import check_object
from softjaw.study.messages import StudyError
from softjaw.study.scene import parse_scene
from softjaw.study.scene.text import toml_text
from tests.objects.found import LOST, SOLVED, TRIED, UNTRIED, Found, candidate_state
from tests.objects.objects_page import SECONDS, SHARE, page, share
from tests.objects.random_scenes import KINDS, random_scene
from tests.objects.reasons import REASONS, reason_of
from tests.objects.survey import file_name, said, survey_object, survey_random
from tests.objects.user_objects import user_objects

SEED, SCENES = 3, 16
WHOLE = {SOLVED: 11, LOST: 1, "too wide": 4}


def test_random_scenes_are_valid_and_of_every_kind():
    made = [random_scene(SEED, k) for k in range(40)]
    assert {kind for kind, _ in made} == set(KINDS)
    refused = []
    for _, tables in made:
        scene = parse_scene(toml_text(tables))
        assert len(scene.load.normal_force_n) == 3
        try:
            check_object(scene)
        except StudyError as error:
            refused.append(reason_of(error.message).by)
    assert len(refused) < 0.1 * len(made)
    assert set(refused) <= {"scene"}


def test_a_scene_depends_on_seed_and_number_alone():
    assert random_scene(SEED, 5) == random_scene(SEED, 5)
    assert random_scene(SEED, 5) != random_scene(SEED + 1, 5)
    assert random_scene(SEED, 5) != random_scene(SEED, 6)


@pytest.mark.parametrize(
    ("message", "name", "by"),
    [
        ("the foam loses ellipticity: at 3 N the smallest ...", "foam loses ellipticity", "physics"),
        ("not tried, because the load path ended at 3 N: the foam loses ellipticity: at 3 N", "foam loses ellipticity",
         "physics"),
        ("the foam loses ellipticity: at -2.475 N the smallest ...", "a negative force as reason", ""),
        ("stuck at 2 N of 3 N: the contact solve stopped with DIVERGED_MAX_IT", "stuck", ""),
        ("time limit of 60 s", "killed at the time limit", ""),
        ("crash: IndexError: index 3 is out of bounds", "crash", ""),
        ("something new", "other", ""),
    ],
)  # fmt: skip
def test_messages_have_their_class(message, name, by):
    found = reason_of(message)
    assert (found.name, found.by) == (name, by)
    assert len({reason.name for reason in REASONS}) == len(REASONS)


def test_candidates_are_counted_and_shared():
    assert candidate_state(np.array([1, 1, 1])) == 1
    assert candidate_state(np.array([1, 2, 2])) == 2
    assert candidate_state(np.array([1, 0])) == 0
    one = Found("drill", "scan", 100.0, WHOLE, [("3, 5 N", "stuck at 2 N of 5 N: ...")], "3: 0.05")
    two = Found("box", "scan", 10.0, {}, refused="exit code 2: error: no grasp")
    assert share([one, two]) == (11, 13)
    assert one.count(*TRIED) == 12
    assert one.count(UNTRIED) == 0
    text = page([one], [two], SEED)
    assert "| drill | 100 | 12 | 11 | 0.05 |" in text


def test_what_was_found_is_kept(tmp_path):
    one = Found("drill", "scan", 100.0, WHOLE, [("3, 5 N", "stuck")], "3: 0.05")
    one.save(tmp_path / "one.json")
    assert Found.load(tmp_path / "one.json").states == WHOLE
    assert json.loads((tmp_path / "one.json").read_text())["seconds"] == 100.0


def test_a_command_that_hangs_is_stopped(tmp_path):
    assert said(["sleep", "60"], tmp_path, 0.1)[:2] == (None, "")
    code, _, seconds = said(["sh", "-c", "while :; do :; done"], tmp_path, 0.4)
    assert code is None
    assert seconds > 0.05
    assert said(["false"], tmp_path, 10.0)[:2] == (1, "")


@pytest.mark.long
def test_random_scenes_are_solved(tmp_path):
    options = Namespace(seed=SEED, results=tmp_path)
    (tmp_path / "random").mkdir()
    survey_random(list(range(SCENES)), options)
    found = [Found.load(file) for file in sorted((tmp_path / "random").glob("*.json"))]
    solved, tried = share(found)
    excused = sum(reason_of(message).by == "physics" for f in found for message in f.messages)
    assert tried > 0.9 * SCENES
    assert solved + excused == tried
    assert np.median([f.seconds for f in found]) < 5.0


@pytest.mark.long
@pytest.mark.ranks
@pytest.mark.parametrize("start", ["mustard bottle", "mug in one", "bowl 0"])
def test_an_object_is_solved_in_time(start, tmp_path):
    name = next(name for name in user_objects(SEED) if name.startswith(start))
    options = Namespace(results=tmp_path, limit=600.0, mpirun="mpirun -n 2 --oversubscribe")
    found = survey_object(name, *user_objects(SEED)[name], options)
    solved, tried = share([found])
    assert solved >= SHARE * tried
    assert found.seconds < SECONDS
    assert (tmp_path / f"{file_name(name)}.png").exists()
