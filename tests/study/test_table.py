"""What people and programs read: flags by word, units by exact factors, and one table in four renderings."""

import csv
import io
import json
import math

import numpy as np
import pytest

from softjaw.friction.frame import FrameFlag
from softjaw.scoring.quality import ScoreFlag
from softjaw.study.flags import OF_FILE, Flag, flag_definitions, flag_sentences, flag_words, flags_in, raised
from softjaw.study.page import block_of
from softjaw.study.quantities import map_row
from softjaw.study.result.datasets import MESSAGE_BYTES
from softjaw.study.show.best_grasps import LABEL_WIDTH
from softjaw.study.table import MOST_NOTES, Column, Table, as_csv, as_json, as_text, with_error
from softjaw.study.units import SHOWN, UNITS, in_si, shown, shown_text, shown_unit
from tests.study.launching import ROOT

EVERY_FLAG = sum(Flag)  # all bits that have a row
OF_LOWER = {member.name for kind in (FrameFlag, ScoreFlag) for member in kind if member}
COLUMNS = (
    Column("grasp"), Column("e_n", "m", error="e_n_error"), Column("e_n_error", display=False),
    Column("opening", "m", "open", error="opening_error", relative=False, drop=1),
    Column("opening_error", "m", display=False),
    Column("force", "N", digits=5, drop=2), Column("range", programs=False, wrap=8),
)
ROWS = (
    {"grasp": 1, "e_n": 0.0171, "e_n_error": 0.01, "opening": 0.06, "opening_error": 2e-4, "force": 2.0,
     "range": "a, b"},
    {"grasp": 2, "e_n": math.nan, "opening": 0.06, "opening_error": 2e-4, "force": math.inf, "range": "-"},
)  # fmt: skip
TABLE = Table("two grasps", COLUMNS, ROWS, [f"note {k}" for k in range(5)], {"best": np.float64(1.5)}, "grasps")


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


@pytest.mark.parametrize("value", [0, *map(int, Flag), OF_FILE, EVERY_FLAG, 8 + 256])
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


def test_people_read_units_and_as_many_digits_as_the_errors_leave():
    title, heads, units, first, second, *notes = as_text(TABLE).splitlines()
    assert title == "two grasps"
    assert heads.split() == ["e_n", "open", "force"]
    assert units.split() == ["grasp", "[mm]", "[mm]", "[N]", "range"]
    assert first.split() == ["1", "17.10", "±", "0.17", "60.00", "±", "0.20", "2", "a,", "b"]
    assert second.split() == ["2", "-", "60.00", "±", "0.20", "-", "-"]
    held = Column("held", "kg", error="off"), Column("off", "1", display=False)
    assert "641 ± 13" in as_text(Table("", held, [{"held": 0.641, "off": 0.02}]))
    score = Column("score", error="interval", relative=False), Column("interval", display=False)
    assert "0.45 ± 0.29" in as_text(Table("", score, [{"score": 0.45, "interval": 0.29}]))
    assert notes[:MOST_NOTES] == list(TABLE.notes[:MOST_NOTES])
    assert len(notes) == MOST_NOTES + 1
    assert "2 more" in notes[-1]


@pytest.mark.parametrize(("width", "hidden"), [(80, []), (40, ["force"]), (32, ["opening", "force"])])
def test_a_narrow_text_leaves_out_the_least_important_columns(width, hidden):
    lines = as_text(TABLE, width).splitlines()
    assert max(map(len, lines)) <= max(width, 40)
    heads = lines[1].split()
    assert [name for name in ("opening", "force") if (name.replace("opening", "open")) not in heads] == hidden


def test_the_page_has_the_cells_of_the_text_and_programs_every_column_in_si_units_none_to_be_computed():
    block = block_of(TABLE, first=True)
    assert block["head"] == ["grasp", "e_n [mm]", "open [mm]", "force [N]", "range"]
    cells = ["1", "17.10 ± 0.17", "60.00 ± 0.20", "2", "a, b"]
    assert [cell.replace("\N{NO-BREAK SPACE}", " ") for cell in block["rows"][0]] == cells
    assert block["looks"] == ["n", "n", "n", "n", "wide"]
    assert block["first"]
    record = json.loads(as_json(TABLE))
    assert record["best"] == 1.5
    assert record["notes"] == list(TABLE.notes)
    assert record["units"] == {c.name: c.unit for c in COLUMNS if c.name != "range"}
    assert [row["e_n"] for row in record["grasps"]] == [0.0171, None]
    assert record["grasps"][1]["e_n_error"] is None
    assert record["grasps"][1]["force"] is None
    head, first, second = csv.reader(io.StringIO(as_csv(TABLE)))
    assert head == ["grasp", "e_n [m]", "e_n_error", "opening [m]", "opening_error [m]", "force [N]"]
    assert [float(cell) for cell in first] == [1, 0.0171, 0.01, 0.06, 2e-4, 2.0]
    assert second == ["2", "", "", "0.06", "0.0002", ""]
    cells = ["=1+1", "+A1", "-A1", "@x", "\tx", "-3.5", "+2e-3", "at 0 mm", None]
    table = Table("", [Column("a"), Column("b")], [{"a": cell, "b": 1} for cell in cells])
    _, *found = csv.reader(io.StringIO(as_csv(table)))
    assert [row[0] for row in found] == ["'=1+1", "'+A1", "'-A1", "'@x", "'\tx", "-3.5", "+2e-3", "at 0 mm", ""]


@pytest.mark.parametrize(("value", "error", "text"), [
    (-17.0812, 0.152, "-17.08 ± 0.15"), (123456.0, 1234.0, "123456 ± 1234"), (0.0, 0.02, "0.000 ± 0.020"),
    (9.9996, 0.0009, "10.000 ± 0.001"),
])  # fmt: skip
def test_an_error_decides_on_the_digits_of_its_value(value, error, text):
    assert with_error(value, error) == text
