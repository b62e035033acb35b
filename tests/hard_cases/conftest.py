"""The table of the hard cases: a line for each, collected from all processes of the tests, written where asked."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from tests.hard_cases.hard_case import CASES, TOLERANCES, HardCase, Outcome
from tests.hard_cases.verdict import Verdict

HEAD = ("class", "case", "what is hard", "outcome", "its.", "halvings", "s", "det F", "ellipticity",
        "source of the number", "difference", "verdict")  # fmt: skip
INTRODUCTION = """# Hard cases

Written by `make hard-cases` from `tests/hard_cases/cases.toml`. Each case is compared with a number from elsewhere, and
the run computes both. its., halvings: Newton iterations and shortened steps; smallest det F and smallest eigenvalue of
the acoustic tensor over the shear modulus (not positive: the foam has lost ellipticity): the worst of all forces and
both fingers. difference: the largest relative one of closing displacement, e_n and S (or of what the source names) at
the forces that are solved, and the one that is allowed. verdict: `no number` and `gap` do not count as ok; a gap is a
known fault, or a number that the second one does not confirm. Balance of forces, tension and penetration are checked
for every solved force.
"""
ROW = "hard case"
_rows: dict[str, list[str]] = {}


def row(case: HardCase, found: Outcome, verdict: Verdict) -> list[str]:
    """Cells of one case."""
    some = bool(found.done.any())
    numbers = [f"{found.checks[name]:.3g}" if some else "" for name in ("min_det_f", "ellipticity")]
    difference = "" if verdict.difference is None else f"{verdict.difference:.0e} of {verdict.within:.0e}"
    work = [str(found.iterations), str(found.halvings)] if some else ["", ""]
    seconds = f"{found.seconds:.1f}" if some else ""
    source = f"{case.source.kind}: {case.source.what}" if case.source else "none"
    return [case.kind, case.name, case.hard, found.text, *work, seconds, *numbers, source, difference, verdict.word]


def table_text(rows: dict[str, list[str]]) -> str:
    """The table as Markdown, in the order of the cases; then tolerances, failures and gaps with their reasons."""
    lines = [HEAD, ["---"] * len(HEAD), *(rows[name] for name in CASES if name in rows)]
    words = Counter(cells[-1] for cells in rows.values())
    count = f"{len(rows)} cases in {len({c[0] for c in rows.values()})} classes: " + ", ".join(
        f"{words[word]} {word}" for word in ("ok", "no number", "gap", "WRONG")
    )
    allowed = [f"* {name}, {value:g}: {because}" for name, (value, because) in TOLERANCES.items()]
    shown = [case for name, case in CASES.items() if name in rows]
    failures = [f"* {case.name}: {case.because}" for case in shown if case.because]
    gaps = [f"* {case.name}: {case.gap}" for case in shown if case.gap]
    parts = (("Tolerances", allowed), ("Failures that are right", failures), ("Gaps", gaps))
    after = [line for title, part in parts if part for line in (f"## {title}", "", *part, "")]
    return "\n".join([INTRODUCTION, *(f"| {' | '.join(cells)} |" for cells in lines), "", count, "", *after])


def pytest_addoption(parser):
    parser.addoption("--table", metavar="FILE", help="where the table of the hard cases is written")


def pytest_runtest_logreport(report):
    """Keep the row of a case; under xdist the reports come from the workers."""
    _rows.update({value[1]: value for key, value in report.user_properties if key == ROW})


def rows_of(text: str) -> dict[str, list[str]]:
    """Rows of the cases in a table that was written before."""
    cells = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| ")]
    found = [[cell.strip() for cell in row] for row in cells if len(row) == len(HEAD)]
    return {row[1]: row for row in found if row[1] in CASES}


def pytest_sessionfinish(session):
    """Write the table where all cases have come; rows of cases that did not run now stay as they were."""
    file = session.config.getoption("--table", None)
    if not file:
        return
    rows = (rows_of(Path(file).read_text()) if Path(file).exists() else {}) | _rows
    if len(rows) == len(CASES):
        Path(file).write_text(table_text(rows))
