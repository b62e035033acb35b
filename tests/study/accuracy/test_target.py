"""A target for e_n: it is kept on the probes and on cases that were not looked at, or it is said that it is not."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.study.accuracy.choose import choose, reference
from softjaw.study.accuracy.convergence import error_tables, extrapolate
from softjaw.study.accuracy.cost_study import Measured, new_study, plain
from softjaw.study.accuracy.measure import measure_once
from softjaw.study.accuracy.parameters import Level, with_level
from softjaw.study.accuracy.target import mesh_errors, quick_choice, quick_probes
from softjaw.study.case.candidates import units
from softjaw.study.case.probes import Probe, demanding
from softjaw.study.scene import load_scene
from tests.study.accuracy.test_cost import COARSE, CYLINDER, formula_study, scene

COARSE_FLAG, NOT_ANTIPODAL = 4096, 256
SIZES = [1.0, 0.7, 0.5, 0.35, 0.25]


def levels(count=5):
    return [Level(f"mesh {i}", (("gripper.elements", [2 + 2 * i, 4, 4]),), SIZES[i]) for i in range(count)]


def measured(e_n, flags=None, label="probe"):
    """What was measured of one probe on one mesh; one e_n and one flag for each force."""
    values = np.tile(np.asarray(e_n, float)[:, None], 4)
    forces = np.arange(1.0, len(values) + 1)
    return Measured("", "", label, forces, values, 1.0, flags=np.array(flags or 0, float))


# --- what a limit is worth ------------------------------------------------------------------------------------------


def test_the_doubt_of_a_limit_holds_the_truth_where_the_order_is_seen():
    h, scale = np.array([2.0, 1.4, 1.0]), np.array([0.1, -0.02, 0.3])
    found = extrapolate(h, 1.0 + scale * h[:, None] ** 2, formal=2.0)
    assert found.error_estimate == pytest.approx(0.25 * np.abs(scale))  # Roache's factor of safety, 1.25
    steep = extrapolate(h, 1.0 + scale * h[:, None] ** 4, formal=2.0)
    assert (np.abs(steep.value - 1.0) <= steep.error_estimate).all()


@pytest.mark.parametrize("seed", range(20))
def test_one_lucky_step_does_not_make_a_limit_certain(seed):
    """Errors that fall with the order 1.5 and have any sign, of which the last two are the same by chance."""
    random = np.random.default_rng(seed)
    h = np.array([2.0, 1.4, 1.0])
    values = 1.0 + 0.03 * h**1.5 * random.choice([-1.0, 1.0], 3)
    values[2] = values[1] * (1 + 1e-7)
    found = extrapolate(h, values[:, None], formal=2.0)
    assert math.isnan(found.order)
    if abs(values[0] - values[1]) > 0.03:
        assert found.error_estimate[0] >= abs(values[2] - 1.0) / 3  # the step before is not forgotten
    assert found.error_estimate[0] >= 0.5 * abs(values[0] - values[1]) * 0.7**1.5


def test_levels_without_a_size_end_in_what_is_exact():
    assert extrapolate([math.nan, math.nan], [[1.1], [1.0]]).error_estimate == 0.0


# --- which mesh is taken ----------------------------------------------------------------------------------------------


def test_the_doubt_of_the_reference_counts():
    """The last two meshes agree by chance: nothing shows that the error of the first of them is 1 % and not more."""
    found = [[measured([v])] for v in (1.04, 1.0101, 1.01)]
    judged = mesh_errors(levels(3), found, 0.01)
    assert judged.chosen is None
    assert judged.error[1, 0] > 0.01


def test_a_mesh_that_is_good_by_chance_is_not_taken():
    """Errors of 0.1, 3, 0.75 and 0.19 %: the coarsest is right for no reason that the finer ones share."""
    found = [[measured([1.0 + e])] for e in (0.001, 0.03, 0.0147, 0.0072, 0.0035)]
    judged = mesh_errors(levels(), found, 0.01)
    assert judged.error[0, 0] == judged.error[1, 0] > 0.01
    assert judged.chosen == 3
    assert mesh_errors(levels(3), found[:3], 0.01).best == 2  # and not the coarsest where none is good


@pytest.mark.parametrize("flag", [COARSE_FLAG, NOT_ANTIPODAL, 8])
def test_a_mesh_with_a_flag_that_the_finest_has_not_is_not_taken(flag):
    values = [1.0 + 0.004 * h**2 for h in SIZES]
    free = mesh_errors(levels(), [[measured([v])] for v in values], 0.01)
    assert free.chosen == 0
    flags = [flag, flag, 0, 0, 0]
    judged = mesh_errors(levels(), [[measured([v], [f])] for v, f in zip(values, flags, strict=True)], 0.01)
    assert judged.chosen == 2
    assert not mesh_errors(levels(2), [[measured([v])] for v in values[:2]], 0.01).known
    assert judged.known


def test_a_case_that_is_coarse_on_the_finest_mesh_leaves_the_target_open():
    values = [[1.0 + 0.004 * h**2, 1.0 + h] for h in SIZES]
    judged = mesh_errors(levels(), [[measured(v, [0, COARSE_FLAG])] for v in values], 0.01)
    assert judged.chosen == 0
    assert not judged.known
    assert "probe, 2 N" in judged.note


def test_the_hardest_contact_is_a_probe():
    """On the bottle at 1 N a pad at 64.7 mm just reaches the middle of the waist, and 20 x 10 x 6 misses 7 % of e_n.

    At the other stations it misses less than 1 %.
    """
    bottle = load_scene("jobs/bottle-rigid.toml", ["candidates.stations_mm=[25, 64.7, 69.1, 104.4, 113.2, 130.9]"])
    chosen = demanding(units(bottle, lambda point: point.axis_symmetry))
    assert chosen[0].candidate.station == pytest.approx(0.0647)
    assert len({unit.index for unit in chosen}) == 2


@pytest.mark.parametrize("forces", [[2], [2, 8], [1, 2, 4, 8, 12]])
@pytest.mark.parametrize("stations", [[0], list(range(-20, 21, 4))])
def test_cases_held_out_are_none_of_the_probes(stations, forces):
    text = CYLINDER.replace("stations_mm = [0]", f"stations_mm = {stations}").replace("[2, 8]", str(forces))
    found, others, cases = quick_probes(scene(text))
    assert cases == 2 * len(stations) * len(forces)
    on_probes = {(p.unit.index, f) for p in found for f in p.forces}
    held_out = {(p.unit.index, f) for p in others for f in p.forces}
    highest = {(p.unit.index, forces[-1]) for p in others}  # which effects are chosen by
    assert len(held_out - highest | (held_out - on_probes)) >= min(5, cases - len(on_probes))
    assert not (held_out - highest) & on_probes


def made_up(e_n_of, flags_of=lambda point, label: 0):
    """A climb of meshes on made-up numbers: how it chooses for a target on one probe and one case held out."""
    own = scene(overrides=["accuracy.e_n=0.01"])
    found, others = ([SimpleNamespace(label=name, forces=(1.0, 2.0))] for name in ("probe", "other"))

    def solve(setting, probe, level):
        point = with_level(plain(own), level)
        values = np.full((2, 4), e_n_of(point, probe.label))
        flags = np.full(2, float(flags_of(point, probe.label)))
        return Measured(setting, level.name, probe.label, np.array([1.0, 2.0]), values, 1.0, flags=flags)

    study = new_study(own, found, "", "")
    return quick_choice(own, study, found, others, 100, list, solve), study


def size(point):
    return math.prod(point.gripper.elements) ** (-1 / 3)


def test_a_mesh_that_misses_a_case_held_out_is_refined():
    """Errors of h^2 on the probe, twice as large elsewhere: the mesh that is chosen keeps both."""
    choice, _ = made_up(lambda point, label: 0.01 * (1 + (1 if label == "probe" else 2) * size(point) ** 2))
    alone, _ = made_up(lambda point, label: 0.01 * (1 + size(point) ** 2))
    assert choice.met
    assert alone.met
    assert 2 * math.prod(choice.values["gripper.elements"]) ** (-2 / 3) <= 0.01
    assert math.prod(choice.values["gripper.elements"]) > math.prod(alone.values["gripper.elements"])
    assert choice.measured < choice.held_out <= 0.01


def test_what_no_mesh_keeps_is_said_with_the_best_that_was_reached():
    choice, study = made_up(lambda point, label: 0.01 * (1 + (0.1 if label == "probe" else 3) * size(point)))
    assert not choice.met
    assert choice.values["gripper.elements"] == max(
        (json.loads(s)["gripper.elements"] for s, _ in study.measured if "elements" in s), key=math.prod
    )
    assert choice.held_out > 0.01 >= choice.measured
    assert "other, " in choice.note


def test_flagged_meshes_are_passed_over_however_small_their_error():
    choice, _ = made_up(
        lambda point, label: 0.01 * (1 + 0.01 * size(point) ** 2),
        lambda point, label: NOT_ANTIPODAL * (math.prod(point.gripper.elements) < 1000),
    )
    assert choice.met
    assert math.prod(choice.values["gripper.elements"]) >= 1000


# --- a choice from a study --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_measured_times_do_not_change_the_choice(seed):
    """The same study with every time wrong by a factor of up to three chooses the same."""
    what, study, probes, solve, _ = formula_study(scene(overrides=COARSE))
    first = choose(what, study, 0.01, {}, probes, (), solve)
    random = np.random.default_rng(seed)
    what, study, probes, solve, _ = formula_study(scene(overrides=COARSE))
    for key, m in study.measured.items():
        study.measured[key] = replace(m, seconds=m.seconds * 3 ** random.uniform(-1, 1))
    again = choose(what, study, 0.01, {}, probes, (), solve)
    assert first.met
    assert again.values == first.values


def test_a_choice_from_a_study_counts_flags_doubts_and_cases_held_out():
    what, study, probes, solve, _ = formula_study(scene(overrides=COARSE))
    plain_choice = choose(what, study, 0.02, {}, probes, (), solve)
    goal = reference(study, error_tables(what, study))
    assert (goal.estimate > 0).all()
    assert goal.error(study.of(study.base)) > goal.estimate.max()

    setting = next(key for key, _ in study.measured if all(str(v) in key for v in plain_choice.values.values()))
    for key in [key for key in study.measured if key[0] == setting]:
        study.measured[key] = replace(study.measured[key], flags=np.array([0.0, NOT_ANTIPODAL]))
    assert choose(what, study, 0.02, {}, probes, (), solve).values != plain_choice.values

    what, study, probes, solve, _ = formula_study(scene(overrides=COARSE))

    def harder(setting, probe, level):
        found = solve(setting, probe, level)
        far = 4.0 if probe.label == "other" else 1.0
        return replace(found, values=0.01 + far * (found.values - 0.01))

    other = [SimpleNamespace(label="other", forces=(1.0, 2.0))]
    choice = choose(what, study, 0.02, {}, probes, other, harder)
    assert choice.met
    assert choice.held_out <= 0.02
    assert choice.values != plain_choice.values


# --- scenes, solved ---------------------------------------------------------------------------------------------------

BARREL = """
[object]
shape = "revolution"
profile_mm = [[0, 24], [25, 27.5], [50, 29], [75, 27.5], [100, 24]]
[candidates]
stations_mm = [35, 40, 45, 50, 55]
angles_deg = [0]
[load]
normal_force_n = [3, 6, 10]
"""
ROUND = CYLINDER.replace("[2, 8]", "[2, 3, 4, 6, 8]")
WAIST = """
[object]
shape = "revolution"
profile_mm = [[0, 33], [40, 33], [60, 30.5], [80, 29.5], [100, 30.5], [120, 33], [160, 33]]
[candidates]
stations_mm = [66, 73, 80]
angles_deg = [0]
[load]
normal_force_n = [1, 3, 9]
"""
FINER = {"gripper.elements": [20, 10, 6], "gripper.element": "hex27"}


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "target"),
    [(ROUND, 0.01), (BARREL, 0.01), (BARREL, 0.02), (WAIST, 0.02)],
    ids=["cylinder 1 %", "barrel 1 %", "barrel 2 %", "waist 2 %"],
)
def test_a_target_is_kept_on_five_cases_held_out_or_it_is_said_that_it_is_not(text, target):
    """Five cases that no probe has, at random, on the mesh that was chosen and on a much finer one."""
    own = scene(text, [f"accuracy.e_n={target}"])
    found, others, cases = quick_probes(own)
    study = new_study(own, found, "", "")
    choice = quick_choice(own, study, found, others, cases, list)
    assert quick_choice(own, study, found, others, cases, list).values == choice.values
    assert choice.values
    if choice.met:
        assert choice.measured <= target
        assert not choice.held_out > target
    else:
        assert choice.predicted > target or "flagged" in choice.note
    taken = {(p.unit.index, f) for p in found for f in p.forces}
    every = [(unit, f) for unit in units(own, lambda point: point.axis_symmetry) for f in own.load.normal_force]
    left = [(unit, f) for unit, f in every if (unit.index, f) not in taken]
    worst = 0.0
    for i in np.random.default_rng(7).permutation(len(left))[:5]:
        unit, force = left[i]
        probe = Probe(unit.candidate.label, unit, tuple(dict.fromkeys((force, own.load.normal_force[-1]))))
        pair = [measure_once("", probe, Level("", tuple(v.items()))).values[0, 0] for v in (choice.values, FINER)]
        worst = max(worst, abs(pair[0] / pair[1] - 1.0))
    errors = f"probes {choice.measured:.2%}, held out {choice.held_out:.2%}, these five {worst:.2%}"
    print(f"{choice.values}: {errors}; met: {choice.met}")
    assert worst <= target or not choice.met
