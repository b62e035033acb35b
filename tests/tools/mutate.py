"""How many small random bugs the fast tests notice: ``python -m tests.tools.mutate --count 100 --out mutants.jsonl``.

A mutant is the project with one change: an operator, a constant, a sign, an index or a condition of ``FOLDERS``. The
seed fixes the sample. First the tests of ``make test`` that start no ranks run without a change, which shows the files
of tests that run each line, and their times. Then each mutant meets the files that run its line, the fastest first,
until a test fails. What is compiled, or outside of functions, is not seen so: there the lines count that name it. The
work is done in a copy. Each slice of a mutant's tests adds one line of JSON to the output; the same command again
resumes. A test that fails without a change is left out.
"""

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
from itertools import accumulate
from pathlib import Path
from typing import Any

import pytest
from scipy.stats import binomtest

from softjaw.study.doctor import launch_environment

ROOT = Path(__file__).parents[2]
FOLDERS = ("fem", "friction", "lsfit", "scoring", "study/case", "study/result", "study/run")
KINDS = ("operator", "constant", "sign", "index", "condition")
OPERATORS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*", ast.FloorDiv: "/", ast.Mod: "//"}
COMPARISONS = {ast.Lt: ">", ast.LtE: ">=", ast.Gt: "<", ast.GtE: "<=", ast.Eq: "!=", ast.NotEq: "=="}
PACKAGES = ("fem", "friction", "lsfit", "scoring", "study")
MARKS = "not long and not ranks"
REPORT = "report.xml"
SLICE_S = 60  # of tests by their time without a change; a mutant that passes waits until the others had theirs
COMPILING_S, HANGING = 120, 5  # what takes longer than the one and so many times its time hangs
WHOLE_S = 10_000  # of all tests


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
    """A copy of the project in which one file at a time is changed, and what its tests run there."""

    def __init__(self, folder: Path, kept: Path) -> None:
        self.folder = folder
        self.failing: list[str] = []
        for package in (*PACKAGES, "softjaw", "tests", "jobs"):
            shutil.copytree(ROOT / package, folder / package, symlinks=True)
        for file in (file for file in ROOT.iterdir() if file.is_file()):
            shutil.copy2(file, folder)
        shutil.copytree(ROOT / "docs", folder / "docs")
        (folder / ".venv").symlink_to(sys.prefix)
        if not kept.exists():
            self.measure(kept)
        found = json.loads(kept.read_text())
        self.failing, self.durations, self.covered = (found[key] for key in ("failing", "durations", "covered"))
        self.sources = {str(f.relative_to(ROOT)): f.read_text() for p in PACKAGES for f in (ROOT / p).rglob("*.py")}

    def measure(self, kept: Path) -> None:
        """Run all tests without a change."""
        covered = self.folder / "covered.json"
        failing = self.failures(WHOLE_S, "-p", "tests.tools.covered", COVERED=str(covered))
        kept.write_text(json.dumps(measured(failing, self.folder / REPORT, covered)))

    def tests_of(self, mutation: Mutation) -> list[str]:
        """Test files that run the line; else those that run a line with the name of what it stands in."""
        place = (mutation.file, mutation.line)
        seen, places = {place}, [place]
        files: set[str] = set()
        while places:
            file, line = places.pop()
            statement = enclosing(self.sources[file], line)
            of_file = self.covered.get(file, {})
            found = {name for k in range(statement.first, statement.last + 1) for name in of_file.get(str(k), [])}
            files |= found
            for name in () if found or statement.seen(of_file) else statement.names:
                more = set(self._mentions(name, file)) - seen
                seen |= more
                places += more
        return sorted(files, key=lambda name: (self.durations.get(name, 1.0), name))

    def _mentions(self, name: str, file: str) -> Iterator[tuple[str, int]]:
        """Lines with a name in its file and in those that know its module."""
        word, module = re.compile(rf"\b{name}\b"), Path(file).stem
        for other, source in self.sources.items():
            if other == file or (module in source and name in source):
                for number, line in enumerate(source.splitlines(), 1):
                    if word.search(line) and not line.startswith(("from ", "import ", "def ", "class ")):
                        yield other, number

    def failures(self, limit: float, *words: str, **variables: str) -> list[str]:
        """The tests that fail, or why there is no answer."""
        report = self.folder / REPORT
        report.unlink(missing_ok=True)
        left_out = [word for name in self.failing for word in ("--deselect", name)]
        words = (sys.executable, "-m", "pytest", "-q", "-m", MARKS, f"--junitxml={report}", *left_out, *words)
        environment = {**launch_environment(), "PYTHONPATH": str(self.folder), **variables}
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
        return wrong(report) or [f"exit code {process.returncode}: {output[-200:]}"]

    def tried(self, mutation: Mutation, after: int) -> tuple[str, int]:
        """The test that notices a mutation, empty if none, and how many of its files are left for another time."""
        files = self.tests_of(mutation)[after:]
        if not files:
            return "", 0
        costs = list(accumulate(self.durations.get(name, 1.0) for name in files))
        count = max(1, sum(cost <= SLICE_S for cost in costs))
        target = self.folder / mutation.file
        source = target.read_text()
        stale = self._compiled_with(mutation.file)
        kept = {file: file.read_bytes() for file in stale}
        times = target.stat()
        try:
            target.write_text(mutated(source, mutation))
            for file in stale:
                file.unlink()
            failures = self.failures(COMPILING_S + HANGING * costs[count - 1], "-x", *files[:count])
        finally:
            target.write_text(source)
            os.utime(target, ns=(times.st_atime_ns, times.st_mtime_ns))
            for file in self._compiled_with(mutation.file):
                file.unlink()
            for file, content in kept.items():
                file.write_bytes(content)
        return (failures[0], 0) if failures else ("", len(files) - count)

    def _compiled_with(self, name: str) -> list[Path]:
        """What numba has compiled of a file and of those that import it: it looks at the time of one file only."""
        names = {name}
        while more := {n for n, text in self.sources.items() if any(imports(text, m) for m in names)} - names:
            names |= more
        return [f for n in names for f in (self.folder / n).parent.glob(f"__pycache__/{Path(n).stem}.*.nb[ic]")]


@dataclass(frozen=True)
class Statement:
    """Lines of a statement, and the names of the compiled function, or of the top level, in which it stands."""

    first: int
    last: int
    names: list[str]
    body: range

    def seen(self, lines: dict[str, list[str]]) -> bool:
        """Whether tests run other lines of the same function, so that none runs this one."""
        return any(lines.get(str(k)) for k in self.body)


def enclosing(source: str, line: int) -> Statement:
    """The statement around a line of a source."""
    tree = ast.parse(source)
    around = [n for n in ast.walk(tree) if isinstance(n, ast.stmt) and n.lineno <= line <= (n.end_lineno or 0)]
    if not around:
        return Statement(line, line, [], range(0))
    inner = max(around, key=lambda n: (n.lineno, -(n.end_lineno or 0)))
    body = getattr(inner, "body", None)
    last = max(line, body[0].lineno - 1) if isinstance(body, list) else inner.end_lineno
    first = line if isinstance(inner, ast.FunctionDef | ast.ClassDef) else inner.lineno
    functions = [n for n in around if isinstance(n, ast.FunctionDef) and n is not inner]
    if functions:
        function = functions[-1]
        return Statement(first, last or line, [function.name], range(function.body[0].lineno, function.end_lineno or 0))
    outer = around[0]
    names = [outer.name] if isinstance(outer, ast.FunctionDef | ast.ClassDef) else []
    if isinstance(outer, ast.Assign | ast.AnnAssign):
        targets = outer.targets if isinstance(outer, ast.Assign) else [outer.target]
        names = [n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)]
    return Statement(first, last or line, names, range(0))


def imports(source: str, name: str) -> bool:
    """Whether a source imports a file of the project."""
    folder, _, module = name.removesuffix(".py").replace("/", ".").rpartition(".")
    of_folder = re.search(rf"^from softjaw\.{folder} import (\([^)]*\b{module}\b|.*\b{module}\b)", source, re.M)
    return bool(of_folder) or f"from softjaw.{folder}.{module} import" in source


def node_id(case: ElementTree.Element) -> str:
    """How pytest names a test of its report."""
    return f"{(case.get('classname') or '').replace('.', '/')}.py::{case.get('name')}"


def wrong(report: Path) -> list[str]:
    """The tests that failed, from a report of pytest."""
    cases = ElementTree.parse(report).iter("testcase") if report.exists() else ()
    return [node_id(case) for case in cases if case.find("failure") is not None or case.find("error") is not None]


def measured(failing: list[str], report: Path, covered: Path) -> dict[str, Any]:
    """What fails, the seconds of each file of tests, and the files that run each line."""
    seconds: Counter[str] = Counter()
    for case in ElementTree.parse(report).iter("testcase"):
        seconds[node_id(case).partition("::")[0]] += float(case.get("time") or 0)
    return {"failing": failing, "durations": seconds, "covered": json.loads(covered.read_text())}


def interval(hits: int, count: int) -> tuple[float, float]:
    """The 95 % interval of a share (Clopper and Pearson 1934)."""
    found = binomtest(hits, count).proportion_ci()
    return found.low, found.high


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
    lines = options.out.read_text().splitlines() if options.out.exists() else []
    rows = {row["number"]: row for row in map(json.loads, lines)}
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder), options.out.with_suffix(".tests.json"))
        while waiting := [i for i in range(len(mutants)) if i not in rows or rows[i]["left"]]:
            for i in waiting:
                m, begun = mutants[i], time.monotonic()
                done = len(copy.tests_of(m)) - rows[i]["left"] if i in rows else 0
                killer, left = copy.tried(m, done)
                rows[i] = {"number": i, **asdict(m), "killed_by": killer, "left": left}
                rows[i]["seconds"] = round(time.monotonic() - begun)
                with options.out.open("a") as file:
                    file.write(json.dumps(rows[i]) + "\n")
                state = killer or (f"{left} files left" if left else "SURVIVED")
                print(f"{i} {m.file}:{m.line} {m.kind}: {state} ({rows[i]['seconds']} s)", flush=True)
    survivors = [row for row in rows.values() if not row["killed_by"]]
    for row in survivors:
        print(f"survivor {row['file']}:{row['line']}: {row['kind']}: {row['old']}  ->  {row['new']}")
    low, high = interval(len(rows) - len(survivors), len(rows))
    print(f"{len(rows) - len(survivors)} of {len(rows)} mutants were noticed: {low:.0%} to {high:.0%}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
