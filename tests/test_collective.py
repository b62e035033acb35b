"""Tests that several ranks run together: what they do to a folder that they share, one rank does alone."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SHARED = {"shared_path", "folder", "small_disk"}  # fixtures that give all ranks the same folder
WRITERS = {
    "write_text", "write_bytes", "mkdir", "touch", "unlink", "rename", "replace", "rmtree", "copy", "copyfile",
    "truncate", "make", "create", "File", "ResultWriter", "open", "savefig", "dump", "sealed", "save",
    "write_report", "launch", "study", "run", "Popen",
}  # fmt: skip
CASES = [path for path in sorted(HERE.rglob("*.py")) if "shared_path" in path.read_text() and path != Path(__file__)]


def name_of(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def done_by_all(node: ast.AST) -> Iterator[ast.Call]:
    """Calls that every rank makes: those in functions of their own are handed to ``once``."""
    if isinstance(node, ast.Call):
        yield node
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.Lambda | ast.FunctionDef):
            yield from done_by_all(child)


def written_together(source: str) -> list[str]:
    """What tests and fixtures with a shared folder write on every rank at once: function and call."""
    found = []
    for test in ast.walk(ast.parse(source)):
        if isinstance(test, ast.FunctionDef) and SHARED & {a.arg for a in test.args.args}:
            fixture = any("fixture" in ast.unparse(d) for d in test.decorator_list)
            if test.name.startswith("test_") or fixture:
                calls = done_by_all(test)
                found += [f"{test.name}: {ast.unparse(call)}" for call in calls if name_of(call) in WRITERS]
    return found


@pytest.mark.parametrize("path", [pytest.param(p, id=str(p.relative_to(HERE))) for p in CASES])
def test_ranks_that_share_a_folder_do_not_write_it_at_once(path):
    assert written_together(path.read_text()) == []


def test_a_file_that_two_ranks_write_is_noticed():
    both = "def test_it(shared_path):\n    path = make(shared_path / 'b.hdf')\n    assert path"
    assert written_together(both) == ["test_it: make(shared_path / 'b.hdf')"]
    alone = "def test_it(once, shared_path):\n    once(lambda: make(shared_path))\n    once(make, 1)"
    assert written_together(alone) == []
