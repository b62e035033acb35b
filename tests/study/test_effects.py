"""What indicators measure, which reasons are given, and that no indicator lets `auto` skip an effect wrongly."""

from __future__ import annotations

import importlib.util
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.study import pipeline
from softjaw.study.case import model
from softjaw.study.case.build import build_object
from softjaw.study.case.candidates import units
from softjaw.study.case.effects import LEVELS, Simulated, neglected_traction
from softjaw.study.case.result import CaseFailure
from softjaw.study.quantities import EFFECTS, REASONS
from softjaw.study.scene import load_scene, parse_scene
from tests.study.test_pipeline import OVAL, PLATE, cases, solved

ROOT = Path(__file__).resolve().parents[2]
COUPLED = 'effects.friction_pressure_coupling="tangential"'


def scene_of(*overrides):
    text = f"[object]\n{PLATE}\n[gripper]\nelements = [4, 4, 2]\n[candidates]\nstations_mm = [0]\nangles_deg = [0]\n"
    return parse_scene(text + "[load]\nnormal_force_n = [1]\n", "scene.toml", overrides)


def pressed(moved, pressure):
    """A pad's front moved as a whole by a vector [m], under an even pressure [Pa], on a plane."""
    pad = model.pad(scene_of().gripper, (False, False), "weighted", False, False)
    start = np.einsum("qa,fai->fqi", pad.face_N, pad.nodes[pad.face_nodes])
    normal = np.broadcast_to([0.0, 0.0, -1.0], start.shape)
    points = SimpleNamespace(position=start + moved, normal=normal, load=pressure * pad.face_area)
    return SimpleNamespace(pad=pad, points=points)


def test_neglected_traction_is_that_of_sheared_columns_until_they_slide():
    """E d / (thickness p) where that is below mu; moves along the normal do not count."""
    stiffness = pressed(np.zeros(3), 1.0).pad.modulus_per_thickness
    for d, p, mu in ((1e-4, 5e3, 0.8), (2e-3, 5e3, 0.8), (2e-3, 5e3, 0.3)):
        found = neglected_traction(pressed(np.array([0.6 * d, 0.8 * d, 3e-3]), p), mu)
        assert found == pytest.approx(min(mu, stiffness * d / p), rel=1e-12)
    assert neglected_traction(pressed(np.array([0.0, 0.0, 3e-3]), 5e3), 0.8) == 0.0


@pytest.mark.parametrize(("moved", "overrides", "walled", "level", "reason"), [
    (1e-6, (), False, "none", "indicator below the target"),
    (1e-3, (), False, "none", "left out, though the indicator is above the target"),
    (1e-3, (COUPLED,), False, "tangential traction", "forced by the scene"),
    (1e-3, (), True, "none", "the default level of this version"),
])  # fmt: skip
def test_friction_that_does_not_act_back_is_told_where_it_matters(moved, overrides, walled, level, reason):
    contacts = [SimpleNamespace(state=pressed(np.array([d, 0.0, 0.0]), 2e3)) for d in (0.0, moved)]
    solver = SimpleNamespace(level=SimpleNamespace(number=int(walled)))
    case = Simulated(scene_of(*overrides), contacts, [], solver)
    found, indicator, why = LEVELS["friction_pressure_coupling"](case)
    assert (found, REASONS[why]) == (level, reason)
    assert np.isnan(indicator) if walled else indicator == neglected_traction(contacts[1].state, 0.8)


def test_reasons_of_levels_that_no_target_chooses():
    effects = [result.effects for _, path in solved(OVAL) for result in path]
    for name, level, reason in (
        ("friction", "ccm", "never skipped, because it costs next to nothing"),
        ("limit_surface", "convex quartic", "never skipped, because it costs next to nothing"),
        ("wrench", "3-D", "e_n and quality do not depend on it"),
    ):
        assert {(own[name][0], REASONS[own[name][2]]) for own in effects} == {(level, reason)}
    for own in effects:
        assert own.keys() == EFFECTS.keys()
        assert all(own[name][0] in levels for name, levels in EFFECTS.items())


def test_six_components_change_nothing_that_is_mapped():
    for one, six in zip(cases(OVAL), cases(OVAL, 'effects.wrench="6-D"'), strict=True):
        for name, value in one.items():
            if name.startswith("maps/"):
                np.testing.assert_array_equal(value, six[name])


@pytest.fixture(scope="module")
def job():
    """The program behind docs/effects.png."""
    spec = importlib.util.spec_from_file_location("effects_job", ROOT / "jobs" / "effects.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def wrong_skips(job, rows):
    return [row for row in rows if row[2] <= job.PANELS[row[0]][0] and row[3] > job.TARGET]


@pytest.mark.long
def test_no_effect_of_rigid_objects_is_skipped_wrongly(job, monkeypatch):
    """Among the places one where a pad just reaches a waist's middle: there e_n changes most for least."""
    monkeypatch.chdir(ROOT)
    kept = ("bottle", "cylinder 8 x 8 mm", "plane")
    monkeypatch.setattr(job, "RIGID", {name: job.RIGID[name] for name in kept})
    monkeypatch.setitem(job.RIGID, "bottle", ("jobs/bottle-rigid.toml", "[60, 85]"))
    rows = list(job.rigid_rows())
    exact = [row[3] for row in rows if row[0] == job.EXACT]
    assert max(exact) < 1e-6
    judged = [row for row in rows if row[0] in job.PANELS]
    assert wrong_skips(job, judged) == []
    for effect in ("friction-pressure coupling", "friction"):
        own = [row for row in judged if row[0] == effect]
        assert len(wrong_skips(job, own)) == 0
        assert max(row[3] for row in own) > job.TARGET  # something to be wrong about
        assert min(row[2] for row in own) <= job.PANELS[effect][0]


@pytest.mark.long
def test_no_shell_is_skipped_wrongly(job, monkeypatch):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(job, "WALLS", {name: own for name, own in job.WALLS.items() if name.startswith("cup")})
    rows = list(job.wall_rows())
    assert wrong_skips(job, rows) == []
    for effect in {row[0] for row in rows}:
        own = [row for row in rows if row[0] == effect]
        assert max(row[3] for row in own) > job.TARGET
        assert min(row[2] for row in own) <= job.PANELS[effect][0]


CHOOSING = {
    "softjaw.study.case.solving": ("choose_level",),
    "softjaw.study.pipeline": ("effects_of",),
}


def cpu_share_of_choosing(file, overrides, monkeypatch):
    """CPU time of everything that chooses or evaluates levels, over that of the candidates as a whole."""
    spent = []

    def timed(work):
        def measured(*arguments):
            start = time.process_time()
            try:
                return work(*arguments)
            finally:
                spent.append(time.process_time() - start)

        return measured

    for module, names in CHOOSING.items():
        owner = importlib.import_module(module)
        for name in names:
            monkeypatch.setattr(owner, name, timed(getattr(owner, name)))
    scene, whole = load_scene(ROOT / file, overrides), 0.0
    for unit in units(scene, lambda point: build_object(point.object).axis_symmetry):
        start = time.process_time()
        assert not [r for _, r in pipeline.solve_unit(unit) if isinstance(r, CaseFailure)]
        whole += time.process_time() - start
    return sum(spent) / whole


@pytest.mark.long
@pytest.mark.parametrize(("file", "overrides"), [
    ("jobs/bottle-rigid.toml", ("candidates.stations_mm=[30, 60, 90, 120, 150]", "candidates.angles_deg=[0]")),
    ("jobs/bottle.toml", ("candidates.stations_mm=[60, 112]",)),
])  # fmt: skip
def test_choosing_costs_at_most_five_per_cent(file, overrides, monkeypatch):
    """Whatever the scene; the shares are printed with -s."""
    share = cpu_share_of_choosing(file, overrides, monkeypatch)
    print(f"\n{file} {overrides[-1]}: {share:.2%} of the CPU time for choosing")
    assert share <= 0.05
