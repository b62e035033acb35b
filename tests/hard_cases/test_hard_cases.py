"""Small scenes at the edges of what can be simulated come to what is right for them, and what is wrong is found."""

from __future__ import annotations

import numpy as np
import pytest

from softjaw.study.flags import Flag
from tests.hard_cases.conftest import ROW, row, table_text
from tests.hard_cases.hard_case import CASES, HardCase, Known, Outcome, Same, outcome, scene_of
from tests.hard_cases.verdict import FINITE, Verdict, judge

GOOD = {"force_balance": 0.0, "adhesion": 0.0, "penetration": 0.0, "min_det_f": 0.9, "ellipticity": 0.9}


NAMES = [pytest.param(case.name, marks=() if case.quick else pytest.mark.long) for case in CASES.values()]


@pytest.mark.parametrize("name", NAMES)
def test_a_hard_case_comes_to_what_is_right_for_it(name, record_property):
    case, found = CASES[name], outcome(name)
    verdict = judge(case, found, outcome(case.same_as.case) if case.same_as else None)
    record_property(ROW, row(case, found, verdict))
    assert not verdict.wrong


def test_there_are_cases_of_every_class_and_outcome():
    assert len(CASES) >= 101
    kinds = {"curvature", "contact", "force", "foam", "thin wall", "candidate", "same", "mesh", "friction", "wrenches"}
    assert {c.kind for c in CASES.values()} == kinds
    assert {c.expect for c in CASES.values()} == {"solved", "failed", "refused"}
    assert all((c.expect == "solved") != bool(c.reason) for c in CASES.values())
    assert all(c.same_as.case in CASES for c in CASES.values() if c.same_as)


def test_a_case_changes_keys_and_replaces_shapes_and_places():
    base = {"name": "a", "kind": "k"}
    one = scene_of(HardCase(**base, sections={"object": {"length_mm": 90}, "load": {"normal_force_n": [2]}}))
    two = scene_of(HardCase(**base, sections={"object": {"shape": "plane", "thickness_mm": 20}}))
    assert (one.object.length_mm, one.object.semi_axis_a_mm, one.load.normal_force_n) == (90, 25, (2,))
    assert (two.object.shape, two.load.normal_force_n) == ("plane", (1, 4))


def solved(e_n=0.01, messages=("", ""), checks=GOOD, done=(True, True), errors=None):
    maps = {name: np.array([1.0, 2.0])[list(done)] for name in FINITE} | {"e_n": np.full(sum(done), e_n)}
    return Outcome("", np.array([1.0, 4.0]), np.array(done), messages, checks=checks, maps=maps, errors=errors or {})


def wrong(found, **keys):
    """What is wrong with a case, compared with another one that was solved with e_n = 10 mm."""
    return " / ".join(judge(HardCase("one", "k", **keys), found, solved()).wrong)


def test_what_is_right_is_ok():
    assert wrong(solved()) == ""
    assert wrong(solved(messages=("", "it slips")), note="slips") == ""
    assert wrong(Outcome(refused="mu is wrong"), expect="refused", reason="mu") == ""
    failed = solved(messages=("", "the wall collapsed"), done=(True, False))
    assert wrong(failed, expect="failed", reason="collapsed", up_to_n=1.0) == ""
    assert wrong(solved(0.0101), same_as=Same("other", 0.02)) == ""
    assert wrong(solved(), known=Known("e_n", 0.01, 1e-6)) == ""
    lost = solved(messages=(Flag.UNSTABLE.sentence, ""), checks=GOOD | {"ellipticity": -0.1})
    assert wrong(lost, note="ellipticity") == ""


@pytest.mark.parametrize(
    ("found", "keys", "words"),
    [
        (Outcome(refused="no"), {}, "refused, but solved is right: no"),
        (solved(), {"expect": "refused", "reason": "x"}, "solved, but refused is right"),
        (Outcome(refused="no"), {"expect": "refused", "reason": "yes"}, "the reason is not 'yes': no"),
        (solved(messages=("x", "x"), done=(False, False)), {"expect": "failed", "reason": "x", "up_to_n": 1.0},
         "not solved at 1 N"),
        (solved(messages=("coarse", "")), {}, "remarked, but not expected: coarse"),
        (solved(messages=("coarse; slips", "")), {"note": "coarse"}, "remarked, but not expected: slips"),
        (solved(), {"note": "coarse"}, "'coarse' is not remarked"),
        (solved(checks=GOOD | {"force_balance": 1e-6}), {}, "force_balance is 1.0e-06"),
        (solved(checks=GOOD | {"adhesion": np.nan}), {}, "adhesion is nan"),
        (solved(checks=GOOD | {"min_det_f": -0.1}), {}, "an element is inverted"),
        (solved(checks=GOOD | {"ellipticity": -0.1}), {}, "lost ellipticity"),
        (solved(np.nan), {}, "a map is not finite: e_n"),
        (solved(0.011), {"same_as": Same("other", 0.02)}, "1.0e-01 apart"),
        (solved(0.011), {"known": Known("e_n", 0.01, 0.05)}, "off its closed form"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_found(found, keys, words):
    assert words in wrong(found, **keys)


def test_scales_and_mesh_errors_count_in_a_comparison():
    scaled = solved(0.02)
    scaled.maps["closing"], scaled.maps["S"] = 2 * scaled.maps["closing"], 4 * scaled.maps["S"]
    assert wrong(scaled, same_as=Same("other", 1e-9, length=2.0, force=4.0)) == ""
    assert "e_n is 0.02" in wrong(scaled, same_as=Same("other", 1e-9, ("e_n",)))
    error = {"e_n": np.array([0.03, 0.03])}
    case = HardCase("one", "k", same_as=Same("other", 0.01))
    found = judge(case, solved(0.0104, errors=error), solved(errors=error))
    assert (found.wrong, found.within) == ((), pytest.approx(0.06))
    assert "not solved alike" in " / ".join(judge(case, solved(), Outcome()).wrong)


def test_the_table_counts_what_is_wrong():
    rows = {name: row(CASES[name], solved(), Verdict(wrong)) for name, wrong in (("round", ()), ("plane", ("no",)))}
    lines = table_text(rows).splitlines()
    assert lines[-1] == "2 cases in 1 classes: 1 ok, 1 wrong"
    assert [line.split(" | ")[-1] for line in lines if "| round |" in line or "| plane |" in line] == [
        "ok |",
        "WRONG |",
    ]
