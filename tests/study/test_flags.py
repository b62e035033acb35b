"""Flags: every bit that any code can set has a word and a sentence, and every message and reader tells it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from softjaw.friction.frame import FrameFlag
from softjaw.scoring.quality import ScoreFlag
from softjaw.study import pipeline
from softjaw.study.case import candidates as grasps
from softjaw.study.flags import OF_FILE, Flag, flag_definitions, flag_sentences, flag_words, flags_in, raised
from softjaw.study.quantities import map_row
from softjaw.study.result.datasets import MESSAGE_BYTES
from softjaw.study.scene import parse_scene
from softjaw.study.show.best_grasps import LABEL_WIDTH

ROOT = Path(__file__).parents[2]
TABLE = sum(Flag)  # all bits that have a row
OF_LOWER = {member.name for kind in (FrameFlag, ScoreFlag) for member in kind if member}


def test_no_bit_is_written_as_a_number():
    """Where flags are put together or told apart every bit is one of the table."""
    for file in sorted((ROOT / "study").rglob("*.py")):
        if file.name != "flags.py" and "flag" in file.read_text().lower():
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.BitOr | ast.BitAnd):
                    parts = (node.left, node.right) if isinstance(node, ast.BinOp) else (node.value,)
                    numbers = [part.value for part in parts if isinstance(part, ast.Constant)]
                    assert not [n for n in numbers if isinstance(n, int) and n > 1], (file, node.lineno)


def test_flags_of_lower_packages_have_rows_of_the_same_names():
    for kind in (FrameFlag, ScoreFlag):
        members = [member for member in kind if member]
        assert raised(kind(sum(members))) == sum(Flag[member.name] for member in members)


def test_every_row_is_reachable():
    used = "".join(file.read_text() for file in (ROOT / "study").rglob("*.py") if file.name != "flags.py")
    assert [flag.name for flag in Flag if flag.name not in OF_LOWER and f"Flag.{flag.name}" not in used] == []


def test_words_fit_their_column_and_sentences_their_message():
    assert len({flag.word for flag in Flag}) == len({flag.sentence for flag in Flag}) == len(Flag)
    for flag in Flag:
        assert flag.value.bit_count() == 1
        assert 0 < len(flag.word) <= LABEL_WIDTH
        assert flag.sentence
        assert ";" not in flag.sentence + flag.word
    assert len(flag_sentences(OF_FILE).encode()) < MESSAGE_BYTES - 400


def test_the_definition_in_the_file_tells_every_bit_of_a_file_and_no_other():
    text = map_row("flags").definition
    assert text == flag_definitions()
    for flag in Flag:
        assert (f" {int(flag)} {flag.sentence}" in text) == bool(flag & OF_FILE)


@pytest.mark.parametrize("value", [0, *map(int, Flag), OF_FILE, TABLE, 8 + 256])
def test_a_value_is_told_bit_by_bit(value):
    assert sum(flags_in(value)) == value
    assert flag_words(value) == ", ".join(flag.word for flag in flags_in(value))
    assert [part for part in flag_sentences(value).split("; ") if part] == [flag.sentence for flag in flags_in(value)]


CYLINDER = """
[object]
shape = "elliptic_cylinder"
semi_axis_a_mm = 25
semi_axis_b_mm = 25
length_mm = 100
[gripper]
elements = [4, 4, 2]
[candidates]
stations_mm = [0]
angles_deg = [0]
[load]
normal_force_n = [1]
"""


@pytest.fixture(scope="module")
def solved():
    """One coarse case of the pipeline, and its unit."""
    given = parse_scene(CYLINDER)
    unit = grasps.units(given, lambda point: point.axis_symmetry)[0]
    return unit, next(iter(pipeline.solve_unit(unit)))[1]


def test_the_message_of_a_case_tells_its_flags(solved):
    _, case = solved
    assert case.values["maps/flags"] & Flag.COARSE
    assert case.message == flag_sentences(case.values["maps/flags"])
