"""Small scenes at the edges of what can be simulated come to what is right for them, and what is wrong is found."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.fem.contact.checks import explained
from softjaw.fem.contact.problem import SpringBed
from softjaw.fem.errors import ConvergenceError, NotReachedError
from softjaw.fem.materials import material
from softjaw.fem.objects.shapes import Sphere
from tests.fem import reference
from tests.hard_cases.conftest import ROW, row
from tests.hard_cases.hard_case import CASES, TOLERANCES, HardCase, Outcome, Source, outcome, scene_of
from tests.hard_cases.sources import FORMULAS, second
from tests.hard_cases.verdict import FINITE, judge

GOOD = {"force_balance": 0.0, "adhesion": 0.0, "penetration": 0.0, "min_det_f": 0.9, "ellipticity": 0.9}
STUCK = ConvergenceError("stuck at 3 N")
NAMES = [pytest.param(case.name, marks=() if case.quick else pytest.mark.long) for case in CASES.values()]


@pytest.mark.parametrize("name", NAMES)
def test_a_hard_case_comes_to_what_is_right_for_it(name, record_property):
    case, found = CASES[name], outcome(name)
    verdict = judge(case, found, second(name))
    record_property(ROW, row(case, found, verdict))
    assert verdict.word in ("gap" if case.gap else "ok", "no number"), verdict.wrong


def test_there_are_cases_of_every_class_and_outcome_and_a_pressed_column_is_in_balance():
    assert len(CASES) >= 101
    kinds = {"curvature", "contact", "force", "foam", "thin wall", "candidate", "same", "mesh", "friction", "wrenches"}
    assert {c.kind for c in CASES.values()} == kinds
    assert {c.expect for c in CASES.values()} == {"solved", "failed", "refused"}
    assert all((c.expect == "solved") != bool(c.reason) for c in CASES.values())
    assert all(bool(c.because or c.gap) for c in CASES.values() if c.expect == "failed")
    assert all(c.source.case in CASES for c in CASES.values() if c.source and c.source.case)
    assert all(c.hard and (c.source or c.gap) for c in CASES.values())
    assert {c.source.within for c in CASES.values() if c.source} == set(TOLERANCES)
    scene = scene_of(CASES["to-79-percent-without-bulging"])
    g, found = scene.gripper, FORMULAS["pressed column"](scene)
    stretch = 1 - found["closing"] / g.pad_thickness
    force = g.shear_modulus * g.pad_length * g.pad_width * (1 / stretch - stretch)
    assert force == pytest.approx(scene.load.normal_force)
    x, y = (((np.arange(400) + 0.5) / 400 - 0.5) * side for side in (g.pad_length, g.pad_width))
    assert found["e_n"] == pytest.approx(np.hypot(*np.meshgrid(x, y)).mean(), rel=1e-5)


def solved(e_n=0.01, messages=("", ""), checks=GOOD, done=(True, True), errors=None):
    maps = {name: np.array([1.0, 2.0])[list(done)] for name in FINITE} | {"e_n": np.full(sum(done), e_n)}
    return Outcome("", np.array([1.0, 4.0]), np.array(done), messages, checks=checks, maps=maps, errors=errors or {})


def source(**keys):
    """A source that is another case, with the tolerance of coarse meshes, 0.03."""
    return Source("finer mesh", "another one", **{"within": "coarse mesh", "case": "round"} | keys)


def judged(found, other=None, **keys):
    return judge(HardCase("round", "k", **keys), found, solved() if other is None else other)


@pytest.mark.parametrize(("found", "keys"), [
    (Outcome(refused="no"), {}), (solved(), {"expect": "refused", "reason": "x"}),
    (Outcome(refused="no"), {"expect": "refused", "reason": "yes"}),
    (solved(messages=("x", "x"), done=(False, False)), {"expect": "failed", "reason": "x", "up_to_n": 1.0}),
    (solved(messages=("coarse", "")), {}), (solved(messages=("coarse; slips", "")), {"note": "coarse"}),
    (solved(), {"note": "coarse"}), (solved(checks=GOOD | {"force_balance": 1e-6}), {}),
    (solved(checks=GOOD | {"adhesion": np.nan}), {}), (solved(checks=GOOD | {"min_det_f": -0.1}), {}),
    (solved(checks=GOOD | {"ellipticity": -0.1}), {}), (solved(np.nan), {}), (solved(0.011), {"source": source()}),
    (solved(done=(True, False)), {"source": source(), "expect": "failed", "reason": ""}),
    (Outcome(refused="of 12 m"), {"expect": "refused", "reason": "of ([0-9]+) m", "source": source(told=11.0)}),
])  # fmt: skip
def test_what_is_wrong_is_found_once(found, keys):
    assert len(judged(found, **keys).wrong) == 1


def foam(det, strain, ellipticity):
    return SimpleNamespace(strains=lambda x, directions: (det, strain, ellipticity))


@pytest.mark.parametrize(("state", "error", "words"), [
    ((0.5, 0.4, 0.3), STUCK, ""), ((0.1, 1.2, 0.9), STUCK, "120%"), ((0.4, 1.2, -0.06), STUCK, "ellipticity.* -0.06"),
    ((0.4, 1.2, -0.06), NotReachedError("the force stays below"), ""),
])  # fmt: skip
def test_the_state_of_the_foam_is_the_reason_where_it_is(state, error, words):
    told = explained(error, foam(*state), np.zeros(1), 3.0)
    assert (told is error) == (not words)
    assert re.search(words, str(told))


def test_only_nearly_incompressible_pads_start_unsqueezed():
    gap = reference.placed(Sphere(0.02), reference.facing(0.02))
    spread = []
    for nu in (0.25, 0.499):
        pad = reference.pad_of((4, 2, 2), law=material("neo_hookean", 4e4, nu))
        spread.append(np.ptp(pad.displacement(SpringBed(pad, gap).guess(1e-3))[:, 2]))
    assert spread[0] > 5e-4
    assert spread[1] < 1e-12  # of strokes of 1 mm; the guess is the same everywhere
