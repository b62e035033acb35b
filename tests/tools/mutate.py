"""How many small random bugs the fast tests notice: ``python -m tests.tools.mutate --count 100 --out mutants.jsonl``.

A mutant is the project with one change: an operator, a constant, a sign, an index or a condition of ``FOLDERS``. The
seed fixes the sample. Each mutant meets the tests of its own folder first, then all others of ``make test``, until the
first fails. Before that all tests run without a change, which shows how long each file takes. The working tree is never
touched: the files that git knows are copied, and the copy is changed. Each mutant adds one line of JSON; the same
command again resumes.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = ("fem", "friction", "lsfit", "scoring", "study/case", "study/result", "study/run")
KINDS = ("operator", "constant", "sign", "index", "condition")
OPERATORS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*", ast.FloorDiv: "/", ast.Mod: "//"}
COMPARISONS = {ast.Lt: ">", ast.LtE: ">=", ast.Gt: "<", ast.GtE: "<=", ast.Eq: "!=", ast.NotEq: "=="}
COMPILED = re.compile(r"^\s*@(numba\.)?(njit|vectorize|guvectorize)|^\s*@\w*(kernel|compiled)", re.M)
# mpirun answers, and the ranks of a test have their own limits; what takes longer hangs
SECONDS_OF_A_MUTANT = 1500


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


def mutations(file: Path, root: Path = ROOT) -> list[Mutation]:
    """All mutations of one file."""
    source = file.read_text()
    sites = []
    for node in parts(ast.parse(source)):
        for kind, place, new in changes(node):
            if old := ast.get_source_segment(source, place):
                name = str(file.relative_to(root))
                sites.append(Mutation(name, place.lineno, place.col_offset, kind, old, new))
    return sites


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
        self.folder, self.durations = folder, dict[str, float]()
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

    def tests_of(self, file: str) -> list[str]:
        """Test files of the file's folder, the nearest folder and the fastest first."""
        ordered: list[str] = []
        for parent in [p for p in Path(file).parents if p.name]:
            here = self.folder / "tests" / parent
            names = [str(p.relative_to(self.folder)) for p in here.rglob("test_*.py")]
            nearest = [n for n in names if n not in ordered]
            ordered += sorted(nearest, key=lambda n: (self.durations.get(n, 1.0), n))
        return ordered

    def all_tests(self) -> list[str]:
        names = [str(p.relative_to(self.folder)) for p in (self.folder / "tests").rglob("test_*.py")]
        return sorted(names, key=lambda n: (self.durations.get(n, 1.0), n))

    def fails(self, files: list[str], report: Path, limit: float = SECONDS_OF_A_MUTANT) -> str:
        """The first test that fails; empty when all pass."""
        words = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not long", f"--junitxml={report}", *files]
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(self.folder)}
        with subprocess.Popen(
            words, cwd=self.folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, start_new_session=True,
        ) as process:  # fmt: skip
            try:
                output, _ = process.communicate(timeout=limit)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, 9)
                process.communicate()
                return f"no answer within {limit:.0f} s"
        if process.returncode in (0, 5):
            return ""
        if report.exists():
            for case in ElementTree.parse(report).iter("testcase"):
                if case.find("failure") is not None or case.find("error") is not None:
                    return f"{case.get('classname')}::{case.get('name')}"
        return f"exit code {process.returncode}: {output[-200:]}"

    def killer(self, mutation: Mutation) -> str:
        """The test that notices the mutation; empty for a survivor."""
        target, original = self.folder / mutation.file, ROOT / mutation.file
        source = original.read_text()
        compiled = COMPILED.search(source) is not None
        report = self.folder / "report.xml"
        try:
            target.write_text(mutated(source, mutation))
            if compiled:
                self._drop_compiled()
            near = self.tests_of(mutation.file)
            rest = [file for file in self.all_tests() if file not in near]
            return self.fails(near, report) or self.fails(rest, report) if near else self.fails(rest, report)
        finally:
            shutil.copy2(original, target)
            if compiled:
                self._restore_compiled()


def measured(path: Path) -> dict[str, float]:
    """Seconds of each test file in a report of pytest (``--junitxml``)."""
    seconds: Counter[str] = Counter()
    for case in ElementTree.parse(path).iter("testcase"):
        seconds[f"{(case.get('classname') or '').replace('.', '/')}.py"] += float(case.get("time") or 0)
    return dict(seconds)


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
        report = options.out.with_suffix(".xml").resolve()
        if not report.exists() and (failed := copy.fails(copy.all_tests(), report)):
            report.unlink(missing_ok=True)
            print(f"without any change the tests fail: {failed}", file=sys.stderr)
            return 1
        copy.durations.update(measured(report))
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
