"""The table of the hard cases: a line for each, collected from all processes of the tests, written where asked."""

from __future__ import annotations

from pathlib import Path

from tests.hard_cases.hard_case import CASES, HardCase, Outcome
from tests.hard_cases.verdict import Verdict

HEAD = ("class", "case", "outcome", "its.", "halvings", "s", "balance", "adhesion", "penetr.", "det F", "ellipticity",
        "agrees to", "verdict")  # fmt: skip
INTRODUCTION = """# Hard cases

Written by `make hard-cases` from `tests/hard_cases/cases.toml`. its., halvings: Newton iterations and shortened steps;
balance of the force, tension over the largest pressure, penetration over an element's size, smallest det F and smallest
eigenvalue of the acoustic tensor over the shear modulus (not positive: the foam has lost ellipticity): the worst of all
forces and both fingers; agrees to: largest relative difference to the same case posed in another way.
"""
ROW = "hard case"
_rows: dict[str, list[str]] = {}


def row(case: HardCase, found: Outcome, verdict: Verdict) -> list[str]:
    """Cells of one case."""
    some = bool(found.done.any())
    sizes = [f"{found.checks[name]:.0e}" if some else "" for name in ("force_balance", "adhesion", "penetration")]
    numbers = [f"{found.checks[name]:.3g}" if some else "" for name in ("min_det_f", "ellipticity")]
    agrees = "" if verdict.difference is None else f"{verdict.difference:.0e} of {verdict.within:.0e}"
    work = [str(found.iterations), str(found.halvings)] if some else ["", ""]
    seconds = f"{found.seconds:.1f}" if some else ""
    return [
        case.kind,
        case.name,
        found.text,
        *work,
        seconds,
        *sizes,
        *numbers,
        agrees,
        "WRONG" if verdict.wrong else "ok",
    ]


def table_text(rows: dict[str, list[str]]) -> str:
    """The table as Markdown, in the order of the cases."""
    lines = [HEAD, ["---"] * len(HEAD), *(rows[name] for name in CASES if name in rows)]
    wrong = sum(cells[-1] != "ok" for cells in rows.values())
    count = f"{len(rows)} cases in {len({c[0] for c in rows.values()})} classes: {len(rows) - wrong} ok, {wrong} wrong"
    return "\n".join([INTRODUCTION, *(f"| {' | '.join(cells)} |" for cells in lines), "", count, ""])


def pytest_addoption(parser):
    parser.addoption("--table", metavar="FILE", help="where the table of the hard cases is written")


def pytest_runtest_logreport(report):
    """Keep the row of a case; under xdist the reports come from the workers."""
    _rows.update({value[1]: value for key, value in report.user_properties if key == ROW})


def pytest_sessionfinish(session):
    """Write the table where all cases have come."""
    file = session.config.getoption("--table", None)
    if file and len(_rows) == len(CASES):
        Path(file).write_text(table_text(_rows))
