"""What accuracy costs: extrapolation, baseline, parameters, file, choice, on formulas; the command in long tests."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.fem.objects.shapes import EllipticCylinder, Plane
from softjaw.study.accuracy.choose import choose, reference
from softjaw.study.accuracy.combinations import combinations, explicit
from softjaw.study.accuracy.convergence import error_tables, extrapolate, pareto_front
from softjaw.study.accuracy.cost import refuse_ranks
from softjaw.study.accuracy.cost_page import cost_page, sentences
from softjaw.study.accuracy.cost_study import Measured, costs, load, new_study, plain, save, setting_of
from softjaw.study.accuracy.measure import Measuring, measure
from softjaw.study.accuracy.parameters import Level, Skipped, contact_parameters, refusal, weight, with_level
from softjaw.study.accuracy.target import quick_choice, refinement_series, with_choice
from softjaw.study.case import model
from softjaw.study.case.candidates import axis_poses
from softjaw.study.case.probes import probes, stiffness, winkler_pad
from softjaw.study.cli import main
from softjaw.study.messages import DONE, OTHER_FILE, USAGE, StudyError
from softjaw.study.result.store import open_result
from softjaw.study.scene import parse_scene
from tests.study.launching import launch

CYLINDER = """
[object]
shape = "elliptic_cylinder"
semi_axis_a_mm = 25
semi_axis_b_mm = 20
length_mm = 80
[candidates]
stations_mm = [0]
angles_deg = [0, 90]
[load]
normal_force_n = [2, 8]
"""
BOTTLE = """
[object]
shape = "revolution"
profile_mm = [[0, 30], [10, 30], [20, 30], [80, 30], [90, 30], [100, 30]]
wall_mm = {wall}
wall_material = "PET"
open_top = true
[gripper]
pad_length_mm = 30
[candidates]
stations_mm = [50]
angles_deg = [0]
[load]
normal_force_n = [2, 6]
"""
COARSE = ["gripper.elements=[12,6,4]"]
COARSE_WALL = ["accuracy.wall_around_mm=3", "accuracy.wall_along_mm=5", "accuracy.wall_coarse_mm=10"]


def scene(text=CYLINDER, overrides=()):
    return parse_scene(text, overrides=overrides)


# --- extrapolation ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [0.8, 1.5, 2.0, 2.9])
def test_any_ratio_of_sizes_gives_the_order_and_the_limit(order):
    h, scale = np.array([3.0, 2.1, 1.0]), np.array([0.1, -0.02, 0.3])
    exact = np.array([1.0, 2.0, 0.5])
    found = extrapolate(h, exact + scale * h[:, None] ** order, formal=3.0)
    assert found.order == pytest.approx(order, rel=1e-8)
    assert found.value == pytest.approx(exact, rel=1e-9)
    assert found.distance == pytest.approx(np.abs(scale), rel=1e-7)


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ([1.0, 1.2, 1.1], "same way"),
        ([1.3, 1.2, 1.1], "shrink too little"),
        ([2.0, 1.000001, 1.0], "more than any order"),
        ([1.0, 1.0, 1.0], "do not differ"),
        ([1.0, math.nan, 1.0], "no case"),
    ],
)
def test_an_order_that_is_not_there_is_not_seen(values, why):
    found = extrapolate([4.0, 2.0, 1.0], np.array(values)[:, None], formal=2.0)
    assert math.isnan(found.order)
    assert why in found.note
    assert found.value == values[-1]  # the finest level, not a guess


def test_an_order_above_the_formal_one_is_not_trusted():
    h = np.array([4.0, 2.0, 1.0])
    found = extrapolate(h, (1.0 + 0.01 * h**4)[:, None], formal=2.0)
    assert found.order == pytest.approx(4.0)
    assert found.distance[0] == pytest.approx(0.01 * 15 / 3)  # the last step over 2^2 - 1


def test_the_front_is_what_nothing_beats():
    random = np.random.default_rng(3)
    t, e = random.random((2, 50))
    kept = pareto_front(t, e)
    for i in range(50):
        beaten = any(t[k] <= t[i] and e[k] <= e[i] and (t[k], e[k]) != (t[i], e[i]) for k in range(50))
        assert (i in kept) != beaten


# --- Winkler baseline ---------------------------------------------------------------------------------------------


def finger_on(obj, gripper):
    return model.approach(obj, axis_poses(0.0, 0.0, 0.0)[0], gripper)


def test_springs_on_a_plane_carry_alike():
    """Uniform pressure, closing displacement F t / (E_oed A); E_oed is 3 G for nu = 1/4."""
    gripper = scene().gripper
    pad = winkler_pad(gripper, finger_on(Plane(0.02), gripper))
    area = gripper.pad_length * gripper.pad_width
    assert pad.closing(5.0) == pytest.approx(5.0 * gripper.pad_thickness / (3 * gripper.shear_modulus * area), rel=1e-9)
    assert pad.patch(5.0).pressure == pytest.approx(5.0 / area, rel=1e-6)


def test_springs_on_a_cylinder_reach_the_half_width_of_the_closed_form():
    """p = k (d - y^2 / 2R): F = 2/3 k L a^3 / R for narrow contacts, order 2 in the spacing of the springs."""
    gripper, R, force = scene().gripper, 0.2, 1.0
    finger = finger_on(EllipticCylinder(R, R, 1.0), gripper)
    k, L = stiffness(gripper), gripper.pad_length
    a = (1.5 * force * R / (k * L)) ** (1 / 3)
    assert a < gripper.pad_width / 2
    closing = [winkler_pad(gripper, finger, (4, n)).closing(force) for n in (40, 160)]
    errors = np.abs(np.array(closing) / (a**2 / (2 * R)) - 1)
    assert errors[0] < 0.02
    assert errors[1] < 1.5e-3
    patch = winkler_pad(gripper, finger, (4, 160)).patch(force)
    assert patch.load.sum() == pytest.approx(force, rel=1e-12)
    assert (patch.normal == [0, 0, 1]).all()


# --- parameters -----------------------------------------------------------------------------------------------------


def test_every_level_is_a_scene_and_refused_ones_say_why():
    own = scene(BOTTLE.format(wall=0.4), COARSE_WALL)
    parameters, _ = contact_parameters(own)
    names = [p.name for p in parameters]
    assert {"pad mesh, hex8", "pad mesh, hex27", "wall mesh", "solver tolerance", "effect: object"} <= set(names)
    for parameter in parameters:
        digests = [with_level(own, level).digest for level in parameter.levels]
        assert len(set(digests)) == len(digests) or parameter.name == "load steps"
    pad = parameters[0]
    assert len(pad.levels) >= 4
    assert with_level(own, pad.levels[pad.own]).digest == own.digest
    assert all(np.diff([level.size for level in pad.levels]) < 0)
    assert [level.name for level in parameters[names.index("effect: object")].levels][-1] == "nonlinear shell"
    assert "wall mesh" not in [p.name for p in contact_parameters(scene())[0]]


def test_a_level_that_the_scene_refuses_is_skipped_with_its_reason():
    assert not refusal(scene(), Level("good", (("gripper.elements", [8, 4, 2]),)))
    assert "gripper.elements" in refusal(scene(), Level("odd", (("gripper.elements", [7, 4, 2]),)))


# --- file and choice ----------------------------------------------------------------------------------------------


def e_n_of(point):
    """A made-up e_n: 10 mm and the squares of the sizes of elements; nothing else but a rigid wall has an effect."""
    finer = 1.0 if point.gripper.element == "hex8" else 0.5
    h = finer * math.prod(point.gripper.elements) ** (-1 / 3)
    wall = point.accuracy.wall_around_mm if getattr(point.object, "wall", None) else 0.0
    rigid = 0.08 if point.effects.object == "rigid" and wall else 0.0
    return 0.01 * (1.0 + h**2 + 0.001 * wall**2 + rigid)


def formula_study(own):
    """A study of the formula on two probes, and how it solves what it lacks."""
    own = plain(own)
    probes = [SimpleNamespace(label=f"probe {i}", forces=(1.0, 2.0)) for i in range(2)]
    what = costs(own, with_evaluation=False)
    study = new_study(own, probes, "formula", "formula.toml")
    study.calibration = 0.2
    calls = []

    def solve(setting, probe, level):
        calls.append(setting)
        point = with_level(own, level)
        values = np.full((2, 4), e_n_of(point))
        return Measured(setting, level.name, probe.label, np.array(probe.forces), values, 1e-9 * weight(point))

    for task in what.tasks:
        for probe in probes:
            study.add(solve(task.setting, probe, task.level))
    calls.clear()
    return what, study, probes, solve, calls


def test_a_study_comes_back_from_its_file(tmp_path):
    _, study, *_ = formula_study(scene(overrides=COARSE))
    study.skipped.append(Skipped("pad mesh, hex8", "huge", "would take 3 h; raise --time-limit"))
    save(tmp_path / "cost.hdf", study)
    back = load(tmp_path / "cost.hdf")
    assert (back.digest, back.candidates, back.skipped) == (study.digest, study.candidates, study.skipped)
    assert back.measured.keys() == study.measured.keys()
    for key, one in study.measured.items():
        other = back.measured[key]
        assert np.array_equal(one.values, other.values)
        assert (one.seconds, one.message, one.repeats) == (other.seconds, other.message, other.repeats)
    assert not list(tmp_path.glob("*.part"))


def test_another_file_is_refused(tmp_path):
    (tmp_path / "text.hdf").write_text("no HDF5")
    for name in ("text.hdf", "missing.hdf"):
        with pytest.raises(StudyError, match=name) as caught:
            load(tmp_path / name)
        assert caught.value.code == OTHER_FILE


def test_errors_and_orders_are_those_of_the_formula():
    what, study, *_ = formula_study(scene(overrides=COARSE))
    table = next(t for t in error_tables(what, study) if t.name == "pad mesh, hex8")
    assert table.limits[0].order == pytest.approx(2.0, abs=1e-6)
    assert table.orders[0] == (pytest.approx(2.0, abs=0.1), pytest.approx(0.0, abs=0.1))
    h = np.array([level.size for level in table.parameter.levels])
    assert [level.worst[0] for level in table.levels] == pytest.approx(list(h**2), rel=1e-6)
    assert table.levels[table.own].level.name == "12 x 6 x 4"


@pytest.mark.parametrize(
    ("text", "target"),
    [
        (CYLINDER, 0.05),
        (CYLINDER, 0.02),
        (CYLINDER, 0.004),
        pytest.param(BOTTLE.format(wall=0.4), 0.02, marks=pytest.mark.long),
    ],
)
def test_the_choice_meets_the_target_at_the_least_cost(text, target):
    what, study, probes, solve, _ = formula_study(scene(text, [*COARSE, *(COARSE_WALL if "wall" in text else [])]))
    choice = choose(what, study, target, {}, probes, (), solve)
    exact = 0.01

    def error(level):
        return e_n_of(with_level(what.scene, level)) / exact - 1

    made = combinations(error_tables(what, study), float(np.mean([m.seconds for m in study.of(study.base)])), {})
    good = [c for c in made if error(c.level) <= target]
    assert good, "the series of this test has to reach the target"
    assert error(next(c.level for c in made if dict(c.level.values) == choice.values)) <= target * (1 + 1e-6)
    assert choice.met
    assert choice.seconds <= 1.5 * min(c.seconds for c in good)


def test_what_the_scene_gives_itself_stays():
    own = scene(overrides=[*COARSE, "gripper.element=hex8", "accuracy.e_n=0.01"])
    what, study, probes, solve, _ = formula_study(own)
    given = explicit(own)
    assert given["gripper.elements"] == (12, 6, 4)
    assert "effects.sheet" not in given
    choice = choose(what, study, 0.01, given, probes, (), solve)
    assert choice.values.get("gripper.elements", [12, 6, 4]) == [12, 6, 4]
    assert not choice.met
    assert "no measured setting meets the target" in choice.note


def test_a_second_choice_solves_nothing_and_chooses_the_same():
    own = scene(BOTTLE.format(wall=0.4), [*COARSE, *COARSE_WALL])
    what, study, probes, solve, calls = formula_study(own)
    first = choose(what, study, 0.02, {}, probes, (), solve)
    assert calls  # combinations that were not of any series
    calls.clear()
    assert repr(choose(what, study, 0.02, {}, probes, (), solve)) == repr(first)
    assert not calls


def test_a_run_without_a_study_climbs_no_further_than_needed():
    own = scene(overrides=["accuracy.e_n=0.02"])
    _, study, probes, solve, calls = formula_study(own)
    study.measured.clear()
    saved = []
    choice = quick_choice(own, study, probes, (), 1000, lambda: saved.append(1), solve)
    names = [level.name for level in refinement_series(own)]
    chosen = names.index(" x ".join(map(str, choice.values["gripper.elements"])))
    assert e_n_of(own.with_values(choice.values)) / 0.01 - 1 <= 0.02
    assert len(calls) / 2 <= max(3, chosen + 2)  # on two probes: the chosen mesh and one finer
    assert len(saved) == len(calls)
    calls.clear()
    assert quick_choice(own, study, probes, (), 1000, list, solve).values == choice.values
    assert not calls


def test_a_given_mesh_leaves_nothing_to_choose():
    own = scene(overrides=[*COARSE, "accuracy.e_n=0.02"])
    _, study, probes, solve, _ = formula_study(own)
    choice = quick_choice(own, study, probes, (), 10, list, solve)
    assert choice.values == {}
    assert not choice.met
    assert with_choice(own, choice).digest == own.digest


@pytest.mark.long
def test_words_tell_price_and_need():
    what, study, *_ = formula_study(scene(BOTTLE.format(wall=0.4), [*COARSE, *COARSE_WALL]))
    tables = error_tables(what, study)
    text = " ".join(sentences(study, tables))
    assert "in e_n costs" in text
    assert "'nonlinear shell' is needed, 'rigid' moves e_n by" in text
    page, png = cost_page(study, tables)
    assert page.count("<table>") >= len(tables)
    assert png.startswith(b"\x89PNG")


def test_ranks_are_refused(monkeypatch):
    for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_NTASKS"):
        monkeypatch.delenv(name, raising=False)
    refuse_ranks()
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    with pytest.raises(StudyError, match="without mpirun") as caught:
        refuse_ranks()
    assert caught.value.code == USAGE


# --- three scenes, solved -----------------------------------------------------------------------------------------

SERIES = ("pad mesh, hex8", "wall mesh", "effect: object")


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "overrides"),
    [
        pytest.param(CYLINDER, COARSE, id="rigid cylinder"),
        pytest.param(BOTTLE.format(wall=1.0), [*COARSE, *COARSE_WALL], id="stiff bottle"),
        pytest.param(BOTTLE.format(wall=0.35), [*COARSE, *COARSE_WALL], id="thin bottle"),
    ],
)
def test_nothing_much_cheaper_than_the_choice_meets_the_target(text, overrides):
    """All that is predicted much cheaper than the choice is solved too: none within 1 % costs below 2/3."""
    own, target = scene(text, overrides), 0.01
    what = costs(own, with_evaluation=False)
    what = replace(what, parameters=tuple(p for p in what.parameters if p.name in SERIES))
    found = probes(own, count=1)
    study = new_study(own, found, "three scenes", "")
    Measuring(study, found, what, None, lambda _: None).run(60.0)
    choice = choose(what, study, target, {}, found, (), measure)
    assert choice.met
    assert choice.measured <= target
    tables = error_tables(what, study)
    goal, base = reference(study, tables), float(np.mean([m.seconds for m in study.of(study.base)]))
    for combination in combinations(tables, base, {}):
        if combination.seconds > choice.seconds / 1.5:
            continue
        setting = setting_of(what.scene, combination.level)
        for probe in found:
            if not study.has(setting):
                study.add(measure(setting, probe, combination.level))
        seconds = np.mean([m.seconds for m in study.of(setting)])
        good = goal.error(study.of(setting)) <= target
        assert not good or seconds > choice.seconds / 1.5, f"{combination.level.name} is cheaper and good enough"


# --- the command ----------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_the_command_measures_goes_on_and_says_what_to_do(tmp_path, capsys):
    file, out = tmp_path / "small.toml", tmp_path / "small-cost.hdf"
    file.write_text(CYLINDER)
    words = ["cost", str(file), "-o", str(out), *(w for v in COARSE for w in ("--set", v))]
    assert main([*words, "--time-limit", "1"]) == DONE
    first = load(out)
    assert first.skipped
    assert all("--time-limit" in s.reason for s in first.skipped)
    assert main([*words, "--time-limit", "3"]) == DONE
    second = load(out)
    assert second.measured.keys() > first.measured.keys()
    assert all(second.measured[key].seconds == m.seconds for key, m in first.measured.items())  # not measured again
    told = capsys.readouterr().out
    assert "in e_n costs" in told or "No measured mesh" in told
    page = out.with_suffix(".html").read_text()
    for part in ("Pareto front", "Calibration", "Winkler foundation", "Not measured"):
        assert part in page
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert main([*words, "--set", "friction.mu=0.5"]) == OTHER_FILE
    assert main([*words[:4], "--candidate", "nowhere"]) == USAGE


@pytest.mark.long
@pytest.mark.launches
def test_a_run_with_a_target_says_what_it_chose_and_goes_on_with_it(tmp_path, once):
    file, out = tmp_path / "small.toml", tmp_path / "small.hdf"
    file.write_text(CYLINDER)
    words = ["-m", "softjaw", "run", file, "-o", out, "--set", "accuracy.e_n=0.03"]
    code, told, _ = once(launch, 0, *words)
    assert code == DONE
    assert "predicted error" in told
    with open_result(out) as result:
        assert result.derived("e_n_error_on_probes")[0] <= 0.03
        assert result.derived("e_n_error_predicted")[0] > 0
        assert "# chosen" in str(result.scene_attributes["overrides"])
        assert "e_n = 0.03" in result.scene
    code, told, _ = once(launch, 2, *words)
    assert code == DONE
    assert "resumed, 0 of" in told
