"""Flags and units: every bit has a word and a sentence; exact factors, and one choice for what people read."""

import math

import numpy as np
import pytest

from softjaw.friction.frame import FrameFlag
from softjaw.scoring.quality import ScoreFlag
from softjaw.study.flags import OF_FILE, Flag, flag_definitions, flag_sentences, flag_words, flags_in, raised
from softjaw.study.quantities import map_row
from softjaw.study.result.datasets import MESSAGE_BYTES
from softjaw.study.show.best_grasps import LABEL_WIDTH
from softjaw.study.units import SHOWN, UNITS, in_si, shown, shown_text, shown_unit
from tests.study.launching import ROOT

TABLE = sum(Flag)  # all bits that have a row
OF_LOWER = {member.name for kind in (FrameFlag, ScoreFlag) for member in kind if member}


def test_flags_of_lower_packages_have_rows_of_the_same_names_and_words_fit_where_they_stand():
    for kind in (FrameFlag, ScoreFlag):
        members = [member for member in kind if member]
        assert raised(kind(sum(members))) == sum(Flag[member.name] for member in members)
    used = "".join(file.read_text() for file in (ROOT / "study").rglob("*.py") if file.name != "flags.py")
    assert [flag.name for flag in Flag if flag.name not in OF_LOWER and f"Flag.{flag.name}" not in used] == []
    assert len({flag.word for flag in Flag}) == len({flag.sentence for flag in Flag}) == len(Flag)
    for flag in Flag:
        assert flag.value.bit_count() == 1
        assert 0 < len(flag.word) <= LABEL_WIDTH
        assert flag.sentence
        assert ";" not in flag.sentence + flag.word
    assert len(flag_sentences(OF_FILE).encode()) < MESSAGE_BYTES - 400
    text = map_row("flags").definition
    assert text == flag_definitions()
    for flag in Flag:
        assert (f" {int(flag)} {flag.sentence}" in text) == bool(flag & OF_FILE)


@pytest.mark.parametrize("value", [0, *map(int, Flag), OF_FILE, TABLE, 8 + 256])
def test_a_value_is_told_bit_by_bit(value):
    assert sum(flags_in(value)) == value
    assert flag_words(value) == ", ".join(flag.word for flag in flags_in(value))
    assert [part for part in flag_sentences(value).split("; ") if part] == [flag.sentence for flag in flags_in(value)]


@pytest.mark.parametrize(("key", "value", "si"), [
    ("a_mm", 25, 0.025), ("a_inch", 1, 0.0254), ("a_cm", 3, 0.03), ("e_gpa", 2, 2e9), ("p_kpa", 40, 4e4),
    ("m_g", 50, 0.05), ("t_deg", 180, math.pi), ("mu", 0.8, 0.8), ("springs_n_per_mm", 2, 2000),
])  # fmt: skip
def test_values_of_a_scene_are_rounded_once(key, value, si):
    assert in_si(key, value) == si


def test_all_units_of_a_kind_share_their_si_unit_and_what_people_read_comes_back():
    for unit in UNITS.values():
        assert unit.si in ("m", "kg", "N", "Pa", "rad", "N/m", "N m/rad")
    for si, unit in SHOWN.items():
        assert unit.si == si
        assert shown(unit.size, si) == pytest.approx(1.0, rel=1e-15)
    assert shown(np.array([1.0, 2.0]), "Pa") == pytest.approx([1e-3, 2e-3], rel=1e-15)
    assert {shown_unit(si) for si in ("Pa", "m", "rad")} == {"kPa", "mm", "deg"}
    assert shown_text(math.pi, "rad") == "180 deg"
