"""The table of a catalogue: a line for each case, and below it what is wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from softjaw.study.catalogue.model import Case
from softjaw.study.catalogue.outcome import Outcome
from softjaw.study.catalogue.verdict import Verdict

HEAD = ("class", "case", "outcome", "its.", "cuts", "s", "balance", "tension", "penetr.", "det F", "acoustic",
        "agrees to", "verdict")  # fmt: skip
LEFT = 3  # columns of text
NOTE = (
    "its., cuts: Newton iterations and shortened steps; balance of the force, tension over the largest pressure,",
    "penetration over an element's size, smallest det F and smallest eigenvalue of the acoustic tensor over the shear",
    "modulus (not positive: the foam has lost ellipticity): the worst of all forces and both fingers; agrees to:",
    "largest relative difference to the same case posed in another way.",
)


def table_text(cases: Sequence[Case], outcomes: Mapping[str, Outcome], verdicts: Mapping[str, Verdict]) -> str:
    """The table of all cases, classes in the order of the file."""
    rows = [HEAD, *(_row(c, outcomes[c.name], verdicts[c.name]) for c in cases)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(HEAD))]
    places = [str.ljust] * LEFT + [str.rjust] * (len(HEAD) - LEFT)
    lines = ["  ".join(put(cell, w) for put, cell, w in zip(places, row, widths, strict=True)) for row in rows]
    wrong = [f"WRONG {c.name}: {text}" for c in cases for text in verdicts[c.name].wrong]
    right = sum(not verdicts[c.name].wrong for c in cases)
    count = f"{len(cases)} cases in {len({c.kind for c in cases})} classes: {right} ok, {len(cases) - right} wrong"
    return "\n".join([*(line.rstrip() for line in lines), "", *NOTE, *wrong, count])


def _row(case: Case, found: Outcome, verdict: Verdict) -> tuple[str, ...]:
    made = bool(found.done.any())
    sizes = [f"{found.checks[name]:.0e}" if made else "" for name in ("force_balance", "tension", "penetration")]
    numbers = [f"{found.checks[name]:.3g}" if made else "" for name in ("min_det_f", "acoustic")]
    agrees = "" if verdict.difference is None else f"{verdict.difference:.0e} of {verdict.within:.0e}"
    return (
        case.kind, case.name, found.text, str(found.iterations) if made else "", str(found.cuts) if made else "",
        "" if found.refused else f"{found.seconds:.1f}", *sizes, *numbers, agrees, verdict.word,
    )  # fmt: skip
