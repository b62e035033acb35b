"""A catalogue's file is judged before it is run, and every way of being wrong is found."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from softjaw.study.catalogue.model import Case, is_catalogue, load_catalogue
from softjaw.study.catalogue.outcome import Outcome
from softjaw.study.catalogue.run import check_text
from softjaw.study.catalogue.scenes import case_scene, merged
from softjaw.study.catalogue.table import table_text
from softjaw.study.catalogue.verdict import FINITE, judge
from softjaw.study.flags import Flag
from softjaw.study.messages import StudyError
from tests.study.launching import ROOT

HARD = ROOT / "jobs" / "hard-cases.toml"
BASE = """
[base.plain]
object = { shape = "sphere", radius_mm = 30 }
candidates = { stations_mm = [0], angles_deg = [0] }
load = { normal_force_n = [1, 4] }
"""
GOOD = {"force_balance": 0.0, "tension": 0.0, "penetration": 0.0, "min_det_f": 0.9, "acoustic": 0.9}


def catalogue(tmp_path, *cases):
    path = tmp_path / "cases.toml"
    path.write_text(BASE + "".join(f"\n[[case]]\n{case}\n" for case in cases))
    return path


def solved(e_n=0.01, messages=("", ""), checks=GOOD, done=(True, True), errors=None):
    maps = {name: np.array([1.0, 2.0])[list(done)] for name in FINITE} | {"e_n": np.full(sum(done), e_n)}
    forces = np.array([1.0, 4.0])
    return Outcome("", forces, np.array(done), messages, checks=dict(checks), maps=maps, errors=errors or {})


def case(**keys):
    return Case(**{"name": "one", "kind": "k", **keys})


def wrong(found, **keys):
    """What is wrong with a case, compared with another one that was solved with e_n = 10 mm."""
    return " / ".join(judge(case(**keys), {"one": found, "other": solved()}).wrong)


def test_the_shipped_catalogue_has_every_class():
    shipped = load_catalogue(HARD)
    assert is_catalogue(HARD)
    assert not is_catalogue(ROOT / "jobs" / "smoke.toml")
    assert len(shipped.case) >= 40
    kinds = {"curvature", "contact", "force", "foam", "thin wall", "candidate", "same", "mesh", "friction", "wrenches"}
    assert {c.kind for c in shipped.case} == kinds
    assert {c.expect for c in shipped.case} == {"solved", "failed", "refused"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('name = "a b"\nkind = "k"', r"case 'a b': name: "),
        ('name = "a"', r"case 'a': kind: Field required"),
        ('name = "a"\nkind = "k"\nforces = 3', r"case 'a': forces: Extra inputs"),
        (
            'name = "a"\nkind = "k"\nexpect = "refused"',
            r"case 'a': a case that is to fail or to be refused has a reason",
        ),
        ('name = "a"\nkind = "k"\nreason = "x"', r"and no other has one"),
        ('name = "a"\nkind = "k"\nremark = "("', r"case 'a': remark: no regular expression"),
        ('name = "a"\nkind = "k"\nbase = "odd"', r"case 'a' begins with 'odd', which is no \[base.odd\]"),
        ('name = "a"\nkind = "k"\nsame_as = { case = "b", within = 0.1 }', r"compared with 'b', which is no case"),
        ('name = "a"\nkind = "k"\nsame_as = { case = "a", within = 0.1, quantities = ["x"] }', r"no such quantity: x"),
    ],
)
def test_a_wrong_catalogue_is_told_by_case_and_key(tmp_path, text, words):
    with pytest.raises(StudyError, match=words) as refused:
        load_catalogue(catalogue(tmp_path, text))
    assert refused.value.code == 2


def test_cases_of_the_same_name_are_refused(tmp_path):
    with pytest.raises(StudyError, match="cases of the same name: a"):
        load_catalogue(catalogue(tmp_path, *['name = "a"\nkind = "k"'] * 2))


def test_a_case_changes_keys_and_replaces_shapes_and_places(tmp_path):
    path = catalogue(
        tmp_path, 'name = "a"\nkind = "k"\nobject = { radius_mm = 20 }\nload.normal_force_n = [2]',
        'name = "b"\nkind = "k"\nobject = { shape = "plane", thickness_mm = 20 }',
    )  # fmt: skip
    made = load_catalogue(path)
    one, two = (case_scene(made, c, path, ["friction.mu=0.3"]) for c in made.case)
    assert (one.object.radius_mm, one.load.normal_force_n, one.friction.mu) == (20, (2,), 0.3)
    assert (two.object.shape, two.load.normal_force_n) == ("plane", (1, 4))
    poses = merged({"candidates": {"stations_mm": [0]}}, {"candidates": {"poses": []}})
    assert poses == {"candidates": {"poses": []}}


def test_check_judges_every_scene_and_the_reasons_of_refusals(tmp_path):
    path = catalogue(
        tmp_path, 'name = "a"\nkind = "k"\nfriction.mu = -1', 'name = "b"\nkind = "k"',
        'name = "c"\nkind = "k"\nfriction.mu = 11\nexpect = "refused"\nreason = "load"',
        'name = "d"\nkind = "k"\nfriction.mu = 11\nexpect = "refused"\nreason = "friction.mu"',
    )  # fmt: skip
    with pytest.raises(StudyError) as refused:
        check_text(path, [])
    lines = refused.value.message.splitlines()
    assert [re.search(r"case '(.)'", line)[1] for line in lines] == ["a", "c"]
    assert "friction.mu: found -1" in lines[0]


def test_what_is_right_is_ok():
    assert wrong(solved()) == ""
    assert wrong(solved(messages=("", "it slips")), remark="slips") == ""
    assert wrong(Outcome(refused="mu is wrong"), expect="refused", reason="mu") == ""
    failed = solved(messages=("", "the wall collapsed"), done=(True, False))
    assert wrong(failed, expect="failed", reason="collapsed", up_to_n=1.0) == ""
    assert wrong(solved(0.0101), same_as={"case": "other", "within": 0.02}) == ""
    assert wrong(solved(), known={"quantity": "e_n", "value": 0.01, "within": 1e-6}) == ""


@pytest.mark.parametrize(
    ("found", "keys", "words"),
    [
        (Outcome(), {}, "missing, but solved is right"),
        (Outcome(refused="no"), {}, "refused, but solved is right: no"),
        (solved(), {"expect": "refused", "reason": "x"}, "solved, but refused is right"),
        (Outcome(refused="no"), {"expect": "refused", "reason": "yes"}, "the reason is not 'yes': no"),
        (solved(messages=("x", "x"), done=(False, False)), {"expect": "failed", "reason": "x", "up_to_n": 1.0},
         "not solved at 1 N"),
        (solved(messages=("coarse", "")), {}, "remarked, but not expected: coarse"),
        (solved(messages=("coarse; slips", "")), {"remark": "coarse"}, "remarked, but not expected: slips"),
        (solved(), {"remark": "coarse"}, "'coarse' is not remarked"),
        (solved(checks=GOOD | {"force_balance": 1e-6}), {}, "force_balance is 1.0e-06, above 1e-08, without a flag"),
        (solved(checks=GOOD | {"tension": np.nan}), {}, "tension is nan"),
        (solved(checks=GOOD | {"min_det_f": -0.1}), {}, "an element is inverted"),
        (solved(checks=GOOD | {"acoustic": -0.1}), {}, "the foam lost ellipticity, and no remark says so"),
        (solved(np.nan), {}, "a map is not finite: e_n"),
        (solved(0.011), {"same_as": {"case": "other", "within": 0.02}},
         "e_n is 0.011, by the case 'other' 0.01: 1.0e-01"),
        (solved(0.011), {"known": {"quantity": "e_n", "value": 0.01, "within": 0.05}}, "off its closed form"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_found(found, keys, words):
    assert words in wrong(found, **keys)


def test_lost_ellipticity_with_its_remark_is_no_silence():
    told = (Flag.UNSTABLE.sentence, "")
    assert wrong(solved(messages=told, checks=GOOD | {"acoustic": -0.1}), remark="ellipticity") == ""


def test_scales_and_mesh_errors_count_in_a_comparison():
    scaled = solved(0.02)
    scaled.maps["travel"], scaled.maps["S"] = 2 * scaled.maps["travel"], 4 * scaled.maps["S"]
    same = {"case": "other", "within": 1e-9, "length": 2.0, "force": 4.0}
    assert wrong(scaled, same_as=same) == ""
    assert "e_n is 0.02" in wrong(scaled, same_as={"case": "other", "within": 1e-9, "quantities": ("e_n",)})
    error = {"e_n": np.array([0.03, 0.03])}
    both = {"one": solved(0.0104, errors=error), "other": solved(errors=error)}
    found = judge(case(same_as={"case": "other", "within": 0.01}), both)
    assert (found.wrong, found.within) == ((), pytest.approx(0.06))
    assert "not solved alike" in " / ".join(
        judge(case(same_as={"case": "other", "within": 0.1}), {"one": solved(), "other": Outcome()}).wrong
    )


def test_the_table_names_every_case_once_and_says_what_is_wrong():
    cases = [case(), case(name="two", expect="refused", reason="no")]
    outcomes = {"one": solved(), "two": Outcome(refused="other")}
    text = table_text(cases, outcomes, {c.name: judge(c, outcomes) for c in cases})
    assert "WRONG two: the reason is not 'no': other" in text
    assert text.endswith("2 cases in 1 classes: 1 ok, 1 wrong")
    assert replace(outcomes["one"], missing=1).found == "missing"
