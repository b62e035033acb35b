"""One table, four renderings: the same cells in text, page, CSV and JSON, none lost, none made up."""

import csv
import io
import json
import math

import numpy as np
import pytest

from softjaw.study.page import block_of
from softjaw.study.table import MOST_NOTES, Column, Table, as_csv, as_json, as_text, with_error

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
