"""Units: exact factors, one choice for what people read, and one place where it is made."""

from __future__ import annotations

import ast
import math
from pathlib import Path

import numpy as np
import pytest

from softjaw.study.units import SHOWN, UNITS, in_si, shown, shown_text, shown_unit

STUDY = Path(__file__).parents[2] / "study"
# Folders whose modules take their factors from the table; the others follow as they are rebuilt.
KEPT = ("result", "lookup", "scene", "show/tables", "table.py", "quantities.py", "flags.py")
FILES = sorted(f for f in (p.relative_to(STUDY).as_posix() for p in STUDY.rglob("*.py")) if f.startswith(KEPT))
FACTORS = {1e3, 1e-3, 180 / math.pi, math.pi / 180}


@pytest.mark.parametrize(
    ("key", "value", "si"),
    [("a_mm", 25, 0.025), ("a_inch", 1, 0.0254), ("a_cm", 3, 0.03), ("e_gpa", 2, 2e9), ("p_kpa", 40, 4e4),
     ("m_g", 50, 0.05), ("t_deg", 180, math.pi), ("mu", 0.8, 0.8),
     ("springs_n_per_mm", 2, 2000)],
)  # fmt: skip
def test_values_of_a_scene_are_rounded_once(key, value, si):
    assert in_si(key, value) == si


def test_all_units_of_a_kind_share_their_si_unit_and_what_people_read_comes_back():
    for unit in UNITS.values():
        assert unit.si in ("m", "kg", "N", "Pa", "rad", "N/m")
    for si, unit in SHOWN.items():
        assert unit.si == si
        assert shown(unit.size, si) == pytest.approx(1.0, rel=1e-15)
    assert shown(np.array([1.0, 2.0]), "Pa").tolist() == [1e-3, 2e-3]
    assert {shown_unit(si) for si in ("Pa", "m", "rad")} == {"kPa", "mm", "deg"}
    assert shown_text(math.pi, "rad") == "180 deg"


@pytest.mark.parametrize("file", FILES)
def test_nobody_else_multiplies_by_a_thousand(file):
    for node in ast.walk(ast.parse((STUDY / file).read_text())):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            values = {part.value for part in (node.left, node.right) if isinstance(part, ast.Constant)}
            assert not FACTORS & {v for v in values if isinstance(v, int | float)}, (file, node.lineno)
