"""How many small random bugs the fast tests notice: ``python -m tests.tools.mutate --count 100 --out mutants.jsonl``.

A mutant is the project with one change: an operator, a constant, a sign, an index or a condition of ``FOLDERS``. The
seed fixes the sample. First the tests of ``make test`` run without a change, which shows the files of tests that run
each line, and their times. Then each mutant meets the files that run its line, the fastest first, until a test fails.
What is compiled, or outside of functions, is not seen so: such mutants meet all files that run anything of their module
or lie in the folder that mirrors its own. Those that pass meet the tests that start ranks. The working tree is never
touched: the files that git knows are copied, and the copy is changed. Each mutant adds one line of JSON to the output;
the same command again resumes. A test that fails without a change is named and left out.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("fem", "friction", "lsfit", "scoring", "study/case", "study/result", "study/run")
KINDS = ("operator", "constant", "sign", "index", "condition")
OPERATORS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*", ast.FloorDiv: "/", ast.Mod: "//"}
COMPARISONS = {ast.Lt: ">", ast.LtE: ">=", ast.Gt: "<", ast.GtE: "<=", ast.Eq: "!=", ast.NotEq: "=="}
COMPILED = re.compile(r"^\s*@(numba\.)?(njit|vectorize|guvectorize)|^\s*@\w*(kernel|compiled)", re.M)
FAST, RANKS = "not long", "ranks and not long"
LIMIT_S = 1500  # of a mutant; what takes longer hangs


@dataclass(frozen=True)
class Mutation:
    """One change of a file: ``old`` at this place becomes ``new``; the line counts from 1, the column from 0."""

    file: str
    line: int
    column: int
    kind: str
    old: str
    new: str


def changes(node: ast.AST) -> Iterator[tuple[str, ast.AST, str]]:
    """Kind, part of the source, and what stands there instead, for each change of this node."""
    match node:
        case ast.BinOp(left, op, right) if type(op) in OPERATORS:
            new = f"({ast.unparse(left)}) {OPERATORS[type(op)]} ({ast.unparse(right)})"
            yield "operator", node, f"({new})"
        case ast.Compare(left, [op], [right]) if type(op) in COMPARISONS:
            yield "operator", node, f"({ast.unparse(left)} {COMPARISONS[type(op)]} {ast.unparse(right)})"
        case ast.UnaryOp(ast.USub(), operand):
            yield "sign", node, f"(+{ast.unparse(operand)})"
        case ast.Call(ast.Attribute(ast.Name("np"), "abs"), [argument], []):
            yield "sign", node, f"({ast.unparse(argument)})"
        case ast.Constant(bool(value)):
            yield "condition", node, str(not value)
        case ast.Constant(int(value) | float(value)):
            yield "constant", node, repr(value + 1 if isinstance(value, int) else 2 * value or 1.0)
        case ast.Subscript(_, ast.Constant(int(value)) as index):
            yield "index", index, repr(value + 1 if value >= 0 else value - 1)
        case ast.BoolOp(op, values):
            word = " or " if isinstance(op, ast.And) else " and "
            yield "condition", node, f"({word.join(f'({ast.unparse(v)})' for v in values)})"
        case ast.If(test) | ast.While(test) | ast.IfExp(test):
            yield "condition", test, f"(not ({ast.unparse(test)}))"


def parts(node: ast.AST) -> Iterator[ast.AST]:
    """The node and all within it that is computed: no annotations, decorators, messages."""
    yield node
    for name, value in ast.iter_fields(node):
        if name not in ("annotation", "returns", "type_params", "decorator_list"):
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST) and not isinstance(child, ast.JoinedStr | ast.Raise):
                    yield from parts(child)


def segment(lines: list[bytes], node: Any) -> str:
    """Source of a node; ``ast.get_source_segment`` would split the file again for each."""
    first, last = node.lineno - 1, node.end_lineno - 1
    if first == last:
        return lines[first][node.col_offset : node.end_col_offset].decode()
    parts = [lines[first][node.col_offset :], *lines[first + 1 : last], lines[last][: node.end_col_offset]]
    return b"".join(parts).decode()


def mutations(file: Path, root: Path = ROOT) -> list[Mutation]:
    """All mutations of one file."""
    source, name = file.read_bytes(), str(file.relative_to(root))
    lines = source.splitlines(keepends=True)
    return [
        Mutation(name, place.lineno, place.col_offset, kind, segment(lines, place), new)
        for node in parts(ast.parse(source))
        for kind, place, new in changes(node)
    ]


def sample(count: int, seed: int, root: Path = ROOT) -> list[Mutation]:
    """A fixed random sample, with as many mutations of each kind."""
    files = sorted(file for folder in FOLDERS for file in (root / folder).rglob("*.py"))
    every = list(dict.fromkeys(mutation for file in files for mutation in mutations(file, root)))
    chance = random.Random(seed)
    of_kind = {kind: [m for m in every if m.kind == kind] for kind in KINDS}
    for those in of_kind.values():
        chance.shuffle(those)
    return [of_kind[KINDS[k % len(KINDS)]][k // len(KINDS)] for k in range(count)]


def mutated(source: str, mutation: Mutation) -> str:
    """The source with the change."""
    lines = source.splitlines(keepends=True)
    start = sum(map(len, lines[: mutation.line - 1]))
    start += len(lines[mutation.line - 1].encode()[: mutation.column].decode())
    if not source.startswith(mutation.old, start):
        raise ValueError(f"{mutation.file}:{mutation.line}: '{mutation.old}' is not there")
    return source[:start] + mutation.new + source[start + len(mutation.old) :]


class Copy:
    """A copy of the project in which one file at a time is changed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.failing: list[str] = []
        self.durations: dict[str, float] = {}
        self.covered: dict[str, dict[str, list[str]]] = {}
        listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
        for name in subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines():
            if (ROOT / name).exists():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name, follow_symlinks=False)
        (folder / ".venv").symlink_to(Path(sys.prefix))
        self._restore_compiled()

    def _restore_compiled(self) -> None:
        """Take over what numba has compiled of the unchanged sources; their times are the same."""
        for file in [*ROOT.rglob("__pycache__/*.nb[ic]")]:
            target = self.folder / file.relative_to(ROOT)
            if ".venv" not in file.parts and "softjaw" not in file.relative_to(ROOT).parts[:1]:
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(file, target)

    def _drop_compiled(self) -> None:
        """Numba looks at the time of one file only, while a compiled loop holds those that it calls."""
        for file in self.folder.rglob("__pycache__/*.nb[ic]"):
            file.unlink()

    def tests_of(self, mutation: Mutation) -> list[str]:
        """Test files that run a line, or else anything of its file, the fastest first."""
        of_file = self.covered.get(mutation.file, {})
        names = set(of_file.get(str(mutation.line), []))
        if not names:
            mirrored = (self.folder / "tests" / Path(mutation.file).parent).rglob("test_*.py")
            names = {str(path.relative_to(self.folder)) for path in mirrored}.union(*of_file.values())
        return sorted(names, key=lambda name: (self.durations.get(name, 1.0), name))

    def failures(self, *words: str, marks: str = FAST, limit: float = LIMIT_S, **variables: str) -> list[str]:
        """The tests that fail, or why there is no answer."""
        report = self.folder / "report.xml"
        report.unlink(missing_ok=True)
        left_out = [word for name in self.failing for word in ("--deselect", name)]
        words = (sys.executable, "-m", "pytest", "-q", "-m", marks, f"--junitxml={report}", *left_out, *words)
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(self.folder), **variables}
        with subprocess.Popen(
            words, cwd=self.folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, start_new_session=True,
        ) as process:  # fmt: skip
            try:
                output, _ = process.communicate(timeout=limit)
            except BaseException as error:
                os.killpg(process.pid, signal.SIGKILL)
                if not isinstance(error, subprocess.TimeoutExpired):
                    raise
                return [f"no answer within {limit:.0f} s"]
        if process.returncode in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
            return []
        cases = ElementTree.parse(report).iter("testcase") if report.exists() else ()
        wrong = [case for case in cases if case.find("failure") is not None or case.find("error") is not None]
        return [node_id(case) for case in wrong] or [f"exit code {process.returncode}: {output[-200:]}"]

    def killer(self, mutation: Mutation) -> str:
        """The test that notices the mutation; empty for a survivor."""
        target, original = self.folder / mutation.file, ROOT / mutation.file
        source = original.read_text()
        compiled = COMPILED.search(source) is not None
        try:
            target.write_text(mutated(source, mutation))
            if compiled:
                self._drop_compiled()
            files = self.tests_of(mutation)
            failures = (files and self.failures("-x", *files)) or self.failures("-x", marks=RANKS)
            return failures[0] if failures else ""
        finally:
            shutil.copy2(original, target)
            if compiled:
                self._restore_compiled()

    def measure(self, kept: Path) -> None:
        """Run all tests without a change, or take what an earlier run has measured."""
        if not kept.exists():
            covered = self.folder / "covered.json"
            limit = 10 * LIMIT_S
            failing = self.failures("-p", "tests.tools.covered", limit=limit, COVERED=str(covered))
            seconds: Counter[str] = Counter()
            for case in ElementTree.parse(self.folder / "report.xml").iter("testcase"):
                seconds[node_id(case).partition("::")[0]] += float(case.get("time") or 0)
            lines = json.loads(covered.read_text())
            kept.write_text(json.dumps({"failing": failing, "durations": seconds, "covered": lines}))
        measured = json.loads(kept.read_text())
        self.failing, self.durations, self.covered = (measured[key] for key in ("failing", "durations", "covered"))
        for name in self.failing:
            print(f"fails without a change: {name}", flush=True)


def node_id(case: ElementTree.Element) -> str:
    """How pytest names a test of its report."""
    return f"{(case.get('classname') or '').replace('.', '/')}.py::{case.get('name')}"


def main(arguments: list[str] | None = None) -> int:
    """Try the mutants and print the share that was noticed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=20260101)
    parser.add_argument("--out", type=Path, default=Path("results/mutants.jsonl"))
    parser.add_argument("--list", action="store_true", help="only print the mutants")
    options = parser.parse_args(arguments)
    mutants = sample(options.count, options.seed)
    if options.list:
        for m in mutants:
            print(f"{m.file}:{m.line}: {m.kind}: {' '.join(m.old.split())}  ->  {m.new}")
        return 0
    options.out.parent.mkdir(parents=True, exist_ok=True)
    tried = [json.loads(line) for line in options.out.read_text().splitlines()] if options.out.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        copy.measure(options.out.with_suffix(".tests.json"))
        for m in mutants[len(tried) :]:
            begun = time.monotonic()
            row = asdict(m) | {"killed_by": copy.killer(m), "seconds": round(time.monotonic() - begun)}
            tried.append(row)
            with options.out.open("a") as file:
                file.write(json.dumps(row) + "\n")
            print(f"{m.file}:{m.line} {m.kind}: {row['killed_by'] or 'SURVIVED'} ({row['seconds']} s)", flush=True)
    survivors = [row for row in tried if not row["killed_by"]]
    for row in survivors:
        print(f"survivor {row['file']}:{row['line']}: {row['kind']}: {row['old']}  ->  {row['new']}")
    print(f"{len(tried) - len(survivors)} of {len(tried)} mutants were noticed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
