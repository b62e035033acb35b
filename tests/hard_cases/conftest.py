"""The table of the hard cases: a line for each, collected from all processes of the tests, written where asked."""

from collections import Counter
from pathlib import Path

from tests.hard_cases.hard_case import CASES, HardCase, Outcome
from tests.hard_cases.verdict import Verdict

HEAD = ("case", "what is hard", "outcome", "difference")
INTRODUCTION = """# Hard cases

Small scenes at the edges of what can be simulated. `make hard-cases` solves those of `tests/hard_cases/cases.toml`,
each together with a second number from elsewhere, and writes this page.

* **outcome**: solved, failed or refused, each as it should. `gap` is a known fault, or a number that the second one
  does not confirm; gaps do not count as ok.
* **difference**: the largest relative one of closing displacement, e_n and S (or of what `source` in `cases.toml`
  names: another element, mesh or formulation, an independent code, a closed form, a limit, an invariance). `cases.toml`
  has the one that is allowed, with its reason. Force balance, tension and penetration are checked at every force.
"""
ROW = "hard case"
OK = "ok"
OUTCOME = HEAD.index("outcome")
_rows: dict[str, list[str]] = {}


def row(case: HardCase, outcome: Outcome, verdict: Verdict) -> list[str]:
    difference = "" if verdict.difference is None else f"{verdict.difference:.0e}"
    word = outcome.text if verdict.word == OK else f"{outcome.text}; {verdict.word}"
    return [case.name, case.hard, word, difference]


def table_text(rows: dict[str, list[str]]) -> str:
    lines = [HEAD, ["---"] * len(HEAD), *(rows[name] for name in CASES if name in rows)]
    words = Counter(cells[OUTCOME].rpartition("; ")[2] if ";" in cells[OUTCOME] else OK for cells in rows.values())
    each = ", ".join(f"{words[word]} {word}" for word in (OK, "no number", "gap", "WRONG"))
    count = f"{len(rows)} cases in {len({CASES[name].kind for name in rows})} classes: {each}"
    shown = [case for name, case in CASES.items() if name in rows]
    failures = [f"* {case.name}: {case.because}" for case in shown if case.because]
    gaps = [f"* {case.name}: {case.gap}" for case in shown if case.gap]
    parts = (("Failures that are right", failures), ("Gaps", gaps))
    after = [line for title, part in parts if part for line in (f"## {title}", "", *part, "")]
    return "\n".join([INTRODUCTION, *(f"| {' | '.join(cells)} |" for cells in lines), "", count, "", *after])


def pytest_addoption(parser):
    parser.addoption("--table", metavar="FILE", help="where the table of the hard cases is written")


def pytest_runtest_logreport(report):
    """Keep the row of a case; under xdist the reports come from the workers."""
    _rows.update({value[0]: value for key, value in report.user_properties if key == ROW})


def pytest_sessionfinish(session):
    """Write the table where all cases have come."""
    if (file := session.config.getoption("--table", None)) and len(_rows) == len(CASES):
        Path(file).write_text(table_text(_rows))
