"""How many small random bugs the fast tests notice: ``python -m tests.tools.mutate --count 100 --out mutants.jsonl``.

A mutant is the project with one change: an operator, a constant, a sign, an index or a condition of ``FOLDERS``. The
seed fixes the sample. Each mutant meets the tests of ``make test`` that start no ranks and import its file, the nearest
first, until one fails or `MOST_S` are spent: the share is a lower bound. The work is done in a copy, by children of a
process that has imported the libraries. Each mutant adds a line of JSON to the output; the same command resumes.
"""

import argparse
import ast
import importlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import pytest
from scipy.stats import binomtest

ROOT = Path(__file__).parents[2]
FOLDERS = ("fem", "friction", "lsfit", "scoring", "study/case", "study/result", "study/run")
KINDS = ("operator", "constant", "sign", "index", "condition")
OPERATORS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*", ast.FloorDiv: "/", ast.Mod: "//"}
COMPARISONS = {ast.Lt: ">", ast.LtE: ">=", ast.Gt: "<", ast.GtE: "<=", ast.Eq: "!=", ast.NotEq: "=="}
PACKAGES = ("fem", "friction", "lsfit", "scoring", "study")
MARKS = "not long and not ranks"
GROUP = 3  # files of tests that a child has first; then twice as many
MOST_S, HANGING_S = 120, 100  # CPU time for a mutant, and of a single test, compiling included
LIBRARIES = ("numpy", "scipy.optimize", "scipy.interpolate", "scipy.spatial", "numba", "skfem", "trimesh", "pyvista",
             "xarray", "pydantic", "hypothesis", "clarabel", "rich")  # fmt: skip


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
    source, name = file.read_text(), str(file.relative_to(root))
    return [
        Mutation(name, place.lineno, place.col_offset, kind, str(ast.get_source_segment(source, place)), new)
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
    lines = source.splitlines(keepends=True)
    start = sum(map(len, lines[: mutation.line - 1]))
    start += len(lines[mutation.line - 1].encode()[: mutation.column].decode())
    if not source.startswith(mutation.old, start):
        raise ValueError(f"{mutation.file}:{mutation.line}: '{mutation.old}' is not there")
    return source[:start] + mutation.new + source[start + len(mutation.old) :]


class Copy:
    """A copy of the project in which one file at a time is changed, and who imports whom there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for package in (*PACKAGES, "softjaw", "tests", "jobs", "docs"):
            shutil.copytree(ROOT / package, folder / package, symlinks=True)
        for file in (file for file in ROOT.iterdir() if file.is_file()):
            shutil.copy2(file, folder)
        (folder / ".venv").symlink_to(sys.prefix)
        sources = [f.relative_to(folder) for p in (*PACKAGES, "tests") for f in (folder / p).rglob("*.py")]
        names = {".".join(f.with_suffix("").parts): str(f) for f in sources}
        self.imports = {str(f): imported((folder / f).read_text(), names) for f in sources}

    def users(self, name: str) -> dict[str, int]:
        """Files that import a file, also by others, by the number of imports in between."""
        distance, newest = {name: 0}, {name}
        while newest := {f for f, of in self.imports.items() if of & newest} - set(distance):
            distance |= dict.fromkeys(newest, max(distance.values()) + 1)
        return distance

    def tests_of(self, name: str) -> list[str]:
        """Files of tests that use a file, those that are near first: by imports, then by folder."""
        users = {f: n for f, n in self.users(name).items() if Path(f).name.startswith("test_")}
        beside = str(Path("tests", name).parent)
        return sorted(users, key=lambda f: (users[f], not f.startswith(beside), f))

    def killer(self, mutation: Mutation) -> str:
        """The first test that notices a mutation; empty if none does in `MOST_S`."""
        target, users = self.folder / mutation.file, self.users(mutation.file)
        source, times = target.read_text(), target.stat()
        # numba looks at the time of one file only: what it has compiled of this one's users goes, and comes back
        compiled = [f for n in users for f in (self.folder / n).parent.glob(f"__pycache__/{Path(n).stem}.*.nb[ic]")]
        kept = {file: file.read_bytes() for file in compiled}
        target.write_text(mutated(source, mutation))
        for file in compiled:
            file.unlink()
        files, spent, count = self.tests_of(mutation.file), 0.0, GROUP
        try:
            while files and spent < MOST_S:
                failure, seconds = run_apart(self.folder, files[:count], MOST_S - spent)
                if failure:
                    return failure
                files, spent, count = files[count:], spent + seconds, 2 * count
            return ""
        finally:
            target.write_text(source)
            os.utime(target, ns=(times.st_atime_ns, times.st_mtime_ns))
            for n in users:
                for file in (self.folder / n).parent.glob(f"__pycache__/{Path(n).stem}.*.nb[ic]"):
                    file.unlink()
            for file, content in kept.items():
                file.write_bytes(content)


def imported(source: str, names: dict[str, str]) -> set[str]:
    """Files of the project that a source imports."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module:
            module = node.module.removeprefix("softjaw.")
            found |= {module, f"{module}.__init__", *(f"{module}.{alias.name}" for alias in node.names)}
    return {names[name] for name in found & set(names)}


class Watch:
    """A plugin of pytest that tells the first failure and ends what hangs or has had its time."""

    def __init__(self, pipe: int, limit: float) -> None:
        self.pipe, self.limit = pipe, limit

    def tell(self, text: str) -> None:
        os.write(self.pipe, text.encode())
        os._exit(0)

    def pytest_runtest_protocol(self, item: pytest.Item) -> None:
        if time.process_time() > self.limit:
            self.tell("")
        signal.signal(signal.SIGPROF, lambda *_: self.tell(f"{item.nodeid}: no answer within {HANGING_S} s"))
        signal.setitimer(signal.ITIMER_PROF, HANGING_S)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.tell(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.tell(f"{report.nodeid}: not collected")


def run_apart(folder: Path, files: list[str], limit: float) -> tuple[str, float]:
    """The first test of some files that fails, and the CPU seconds, in a child that has all libraries already."""
    end, pipe = os.pipe()
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    if not (child := os.fork()):
        os.close(end)
        os.chdir(folder)
        os.environ["PYTHONPATH"] = str(folder)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(1, 2)
        sys.path[:] = [str(folder), *(path for path in sys.path if path not in ("", str(ROOT)))]
        for name in [name for name in sys.modules if name.partition(".")[0] in ("softjaw", "tests")]:
            del sys.modules[name]
        pytest.main(["-q", "-m", MARKS, "-p", "no:faulthandler", *files], plugins=[Watch(pipe, limit)])
        os._exit(0)
    os.close(pipe)
    with os.fdopen(end) as answer:
        failure = answer.read()
    status = os.waitpid(child, 0)[1]
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    died = f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else ""
    return failure or died, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(arguments: list[str] | None = None) -> int:
    """Try the mutants and print the share that was noticed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=20260101)
    parser.add_argument("--out", type=Path, default=Path("results/mutants.jsonl"))
    options = parser.parse_args(arguments)
    mutants = sample(options.count, options.seed)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    lines = options.out.read_text().splitlines() if options.out.exists() else []
    rows = {row["number"]: row for row in map(json.loads, lines)}
    for name in LIBRARIES:
        importlib.import_module(name)
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        for i in (i for i in range(len(mutants)) if i not in rows):
            killer = copy.killer(mutants[i])
            rows[i] = {"number": i, **asdict(mutants[i]), "killed_by": killer}
            with options.out.open("a") as file:
                file.write(json.dumps(rows[i]) + "\n")
            print(f"{i} {mutants[i].file}:{mutants[i].line} {mutants[i].kind}: {killer or 'SURVIVED'}", flush=True)
    survivors = [row for row in rows.values() if not row["killed_by"]]
    for row in survivors:
        print(f"survivor {row['file']}:{row['line']}: {row['kind']}: {row['old']}  ->  {row['new']}")
    hits = len(rows) - len(survivors)
    share = binomtest(hits, len(rows)).proportion_ci()  # 95 % of Clopper and Pearson
    print(f"{hits} of {len(rows)} mutants were noticed: {share.low:.0%} to {share.high:.0%}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
