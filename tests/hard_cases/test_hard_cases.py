"""Small scenes at the edges of what can be simulated come to what is right for them, and what is wrong is found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from softjaw.study.flags import Flag
from tests.hard_cases.closed_forms import FORMULAS
from tests.hard_cases.conftest import OUTCOME, ROW, row, rows_of, table_text
from tests.hard_cases.hard_case import CASES, TOLERANCES, Bound, HardCase, Outcome, Source, outcome, scene_of
from tests.hard_cases.sources import scaled, second
from tests.hard_cases.verdict import FINITE, Verdict, judge

GOOD = {"force_balance": 0.0, "adhesion": 0.0, "penetration": 0.0, "min_det_f": 0.9, "ellipticity": 0.9}


NAMES = [pytest.param(case.name, marks=() if case.quick else pytest.mark.long) for case in CASES.values()]


@pytest.mark.parametrize("name", NAMES)
def test_a_hard_case_comes_to_what_is_right_for_it(name, record_property):
    case, found = CASES[name], outcome(name)
    verdict = judge(case, found, second(name))
    record_property(ROW, row(case, found, verdict))
    assert verdict.word in ("gap" if case.gap else "ok", "no number"), verdict.wrong


def test_there_are_cases_of_every_class_and_outcome():
    assert len(CASES) >= 101
    kinds = {"curvature", "contact", "force", "foam", "thin wall", "candidate", "same", "mesh", "friction", "wrenches"}
    assert {c.kind for c in CASES.values()} == kinds
    assert {c.expect for c in CASES.values()} == {"solved", "failed", "refused"}
    assert all((c.expect == "solved") != bool(c.reason) for c in CASES.values())
    assert all(bool(c.because or c.gap) for c in CASES.values() if c.expect == "failed")
    assert all(c.source.case in CASES for c in CASES.values() if c.source and c.source.case)
    assert all(c.hard and (c.source or c.gap) for c in CASES.values())
    used = {c.source.within for c in CASES.values() if c.source}
    assert used == set(TOLERANCES)


def test_a_scaled_scene_has_scaled_sizes_forces_and_moduli():
    one, two = scene_of(CASES["wall-1"]), scaled(scene_of(CASES["wall-1"]), length=2.0, force=8.0)
    assert two.gripper.pad_length_mm == 2 * one.gripper.pad_length_mm
    assert two.object.profile_mm[3] == (8.0, 66.0)
    assert two.load.normal_force_n == tuple(8 * f for f in one.load.normal_force_n)
    assert (two.gripper.shear_modulus_kpa, two.object.young_modulus_gpa) == (80.0, pytest.approx(4.0))
    assert two.object.wall_poisson_ratio == 0.38
    assert (two.accuracy.wall_element_mm, two.gripper.elements) == (6.0, one.gripper.elements)


def test_a_pressed_column_is_in_balance_and_its_mean_arm_is_that_of_a_rectangle():
    scene = scene_of(CASES["to-79-percent-without-bulging"])
    g, found = scene.gripper, FORMULAS["pressed column"](scene)
    stretch = 1 - found["closing"] / g.pad_thickness
    force = g.shear_modulus * g.pad_length * g.pad_width * (1 / stretch - stretch)
    assert force == pytest.approx(scene.load.normal_force)
    x, y = (((np.arange(400) + 0.5) / 400 - 0.5) * side for side in (g.pad_length, g.pad_width))
    assert found["e_n"] == pytest.approx(np.hypot(*np.meshgrid(x, y)).mean(), rel=1e-5)


def test_a_case_changes_keys_and_replaces_shapes_and_places():
    base = {"name": "a", "kind": "k"}
    one = scene_of(HardCase(**base, sections={"object": {"length_mm": 90}, "load": {"normal_force_n": [2]}}))
    two = scene_of(HardCase(**base, sections={"object": {"shape": "plane", "thickness_mm": 20}}))
    assert (one.object.length_mm, one.object.semi_axis_a_mm, one.load.normal_force_n) == (90, 25, (2,))
    assert (two.object.shape, two.load.normal_force_n) == ("plane", (1, 4))


def solved(e_n=0.01, messages=("", ""), checks=GOOD, done=(True, True), errors=None):
    maps = {name: np.array([1.0, 2.0])[list(done)] for name in FINITE} | {"e_n": np.full(sum(done), e_n)}
    return Outcome("", np.array([1.0, 4.0]), np.array(done), messages, checks=checks, maps=maps, errors=errors or {})


def source(**keys):
    """A source that is another case, with the tolerance of coarse meshes, 0.03."""
    return Source("finer mesh", "another one", **{"within": "coarse mesh", "case": "round"} | keys)


def judged(found, other=None, **keys):
    return judge(HardCase("round", "k", **keys), found, solved() if other is None else other)


def test_what_is_right_is_ok():
    assert judged(solved(), source=source()).word == "ok"
    assert judged(solved(messages=("", "it slips")), note="slips").wrong == ()
    refused = Outcome(refused="mu is wrong: 11")
    assert judged(refused, expect="refused", reason="mu").word == "no number"
    assert judged(refused, expect="refused", reason="wrong: ([0-9]+)", source=source(told=11.0)).word == "ok"
    failed = solved(messages=("", "the wall collapsed"), done=(True, False))
    right = {"expect": "failed", "reason": "collapsed", "up_to_n": 1.0}
    assert judged(failed, failed, **right, source=source()).word == "ok"
    assert judged(solved(0.0102), source=source()).wrong == ()
    lost = solved(messages=(Flag.UNSTABLE.sentence, ""), checks=GOOD | {"ellipticity": -0.1})
    assert judged(lost, note="ellipticity").wrong == ()


def test_a_gap_never_counts_as_ok_and_is_wrong_when_it_has_closed():
    assert judged(solved(0.02), source=source(), gap="known").word == "gap"
    assert judged(solved(), source=source(), gap="known").word == "WRONG"
    failed = solved(messages=("", "the wall collapsed"), done=(True, False))
    stated = {"expect": "failed", "reason": "collapsed", "gap": "known", "source": source()}
    assert judged(failed, failed, **stated).word == "gap"
    assert judged(solved(), **stated).word == "WRONG"


@pytest.mark.parametrize(("found", "keys"), [
    (Outcome(refused="no"), {}),
    (solved(), {"expect": "refused", "reason": "x"}),
    (Outcome(refused="no"), {"expect": "refused", "reason": "yes"}),
    (solved(messages=("x", "x"), done=(False, False)), {"expect": "failed", "reason": "x", "up_to_n": 1.0}),
    (solved(messages=("coarse", "")), {}),
    (solved(messages=("coarse; slips", "")), {"note": "coarse"}),
    (solved(), {"note": "coarse"}),
    (solved(checks=GOOD | {"force_balance": 1e-6}), {}),
    (solved(checks=GOOD | {"adhesion": np.nan}), {}),
    (solved(checks=GOOD | {"min_det_f": -0.1}), {}),
    (solved(checks=GOOD | {"ellipticity": -0.1}), {}),
    (solved(np.nan), {}),
    (solved(0.011), {"source": source()}),
    (solved(done=(True, False)), {"source": source(), "expect": "failed", "reason": ""}),
    (Outcome(refused="of 12 m"), {"expect": "refused", "reason": "of ([0-9]+) m", "source": source(told=11.0)}),
])  # fmt: skip
def test_what_is_wrong_is_found_once(found, keys):
    assert len(judged(found, **keys).wrong) == 1


def test_scales_mesh_errors_and_stated_numbers_count_in_a_comparison():
    other = solved(0.02)
    other.maps["closing"], other.maps["S"] = 2 * other.maps["closing"], 4 * other.maps["S"]
    other = replace(other, forces=4 * other.forces)
    assert judged(solved(), other, source=source(within="rounding", length=2.0, force=4.0)).wrong == ()
    assert judged(solved(), other, source=source(force=4.0)).word == "WRONG"
    error = {"e_n": np.array([0.03, 0.03])}
    found = judged(solved(0.0104, errors=error), solved(errors=error), source=source())
    assert (found.wrong, found.within) == ((), pytest.approx(0.06))
    stated = Outcome("", np.array([4.0]), np.ones(1, bool), maps={"e_n": np.array([0.0101])})
    found = judged(solved(), stated, source=source(case="", stored="a file"))
    assert (found.word, found.difference) == ("ok", pytest.approx(1 - 1 / 1.01))


def test_a_bound_is_enclosed_by_what_is_accepted_and_what_is_refused():
    case, refused = CASES["mu-11"], Outcome(refused="friction.mu")
    assert judge(case, refused).word == "ok"
    wider = replace(case, source=replace(case.source, bound=Bound("friction.mu", 10.0, 9.99, 9.995)))
    assert judge(wider, refused).word == "WRONG"
    other = replace(case, source=replace(case.source, bound=Bound("friction.mu", 9.99, 9.98, 9.995)))
    assert judge(other, refused).word == "WRONG"


def test_the_table_counts_what_is_wrong():
    rows = {
        name: row(CASES[name], solved(), Verdict(wrong, 0.01, 0.03))
        for name, wrong in (("round", ()), ("plane", ("no",)))
    }
    lines = table_text(rows).splitlines()
    assert rows_of("\n".join(lines)) == rows
    assert "2 cases in 1 classes: 1 ok, 0 no number, 0 gap, 1 WRONG" in lines
    assert [cells[OUTCOME].endswith("WRONG") for cells in rows.values()] == [False, True]
