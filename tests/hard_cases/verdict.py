"""Whether a case came to what is right for it, as sentences about what is wrong."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from softjaw.fem.contact import checks
from softjaw.study.flags import Flag
from tests.hard_cases.hard_case import HardCase, Outcome

FINITE = ("closing", "e_n", "S", "F_N", "contact_area", "p_max", "quality", "f_x_max", "f_y_max", "tau_z_max")
LIMITS = {
    "force_balance": checks.BALANCE,
    "adhesion": checks.ADHESION,
    "penetration": checks.PENETRATION,
}


@dataclass(frozen=True)
class Verdict:
    """What is wrong with a case (nothing: it is right), and how far it is from the case that it must equal."""

    wrong: tuple[str, ...] = ()
    difference: float | None = None
    within: float | None = None


def judge(case: HardCase, found: Outcome, other: Outcome | None = None) -> Verdict:
    """Judge a case by what was found of it and of the case that it is compared with."""
    wrong = [*_outcome(case, found), *_solved(case, found), *_known(case, found)]
    difference = within = None
    if case.same_as and found.found == "solved":
        if other.done.size != found.done.size or not other.done.all():
            wrong.append(f"the case '{case.same_as.case}' that it is compared with was not solved alike")
        else:
            difference, within, text = _difference(case, found, other)
            wrong += [text] if text else []
    return Verdict(tuple(wrong), difference, within)


def _outcome(case: HardCase, found: Outcome) -> Iterator[str]:
    """Compare the outcome and its reasons with what is right."""
    reasons = [found.refused] if found.refused else [
        m for m, good in zip(found.messages, found.done, strict=True) if not good
    ]  # fmt: skip
    if found.found != case.expect:
        told = f": {reasons[0]}" if reasons else ""
        yield f"{found.text}, but {case.expect} is right{told}"
        return
    for reason in dict.fromkeys(reasons):
        if not re.search(case.reason, reason):
            yield f"the reason is not '{case.reason}': {reason}"
    early = found.forces[(found.forces <= case.up_to_n) & ~found.done]
    if early.size:
        yield f"not solved at {early.min():g} N, but up to {case.up_to_n:g} N it must be"


def _solved(case: HardCase, found: Outcome) -> Iterator[str]:
    """Judge the forces that were solved: laws, numbers, notes."""
    if not found.done.any():
        return
    told = [m for m, good in zip(found.messages, found.done, strict=True) if good]
    parts = list(dict.fromkeys(part for m in told for part in m.split("; ") if part))
    for name, limit in LIMITS.items():
        if not found.checks[name] <= limit:
            yield f"{name} is {found.checks[name]:.1e}, above {limit:.0e}, without a flag"
    if not found.checks["min_det_f"] > 0:
        yield f"an element is inverted: det F = {found.checks['min_det_f']:.2g}"
    if not found.checks["ellipticity"] > 0 and Flag.UNSTABLE.sentence not in parts:
        yield "the foam lost ellipticity, and no note says so"
    if any(not np.isfinite(found.maps[name]).all() for name in FINITE):
        yield "a map is not finite: " + ", ".join(n for n in FINITE if not np.isfinite(found.maps[n]).all())
    if strange := [part for part in parts if not case.note or not re.search(case.note, part)]:
        yield f"remarked, but not expected: {'; '.join(strange)}"
    if case.note and not any(re.search(case.note, part) for part in parts):
        yield f"'{case.note}' is not remarked"


def _known(case: HardCase, found: Outcome) -> Iterator[str]:
    """Compare with a closed form."""
    if case.known is None or found.found != "solved":
        return
    value = float(found.maps[case.known.quantity][-1])
    off = abs(value / case.known.value - 1.0)
    if not off <= case.known.within:
        yield (
            f"{case.known.quantity} is {value:.5g}, {off:.1e} off its closed form {case.known.value:.5g},"
            f" {case.known.within:g} is allowed"
        )


def _difference(case: HardCase, found: Outcome, other: Outcome) -> tuple[float, float, str]:
    """Largest relative difference, the one that is allowed, and a sentence where it is more.

    Mesh errors that both files show are allowed too.
    """
    same = case.same_as
    worst, allowed, text = 0.0, same.within, ""
    for name in same.quantities:
        mine, theirs = found.maps[name], other.maps[name] * same.factor(name)
        errors = [o.errors[name] for o in (found, other) if name in o.errors]
        limit = np.maximum(same.within, sum(errors)) if len(errors) == 2 else np.full(mine.shape, same.within)
        off = np.abs(mine - theirs) / np.maximum(np.abs(theirs), 1e-300)
        k = int(np.argmax(off / limit))
        if off[k] / limit[k] >= worst / allowed:
            worst, allowed = float(off[k]), float(limit[k])
        if not off[k] <= limit[k]:
            both = f"{name} is {mine[k]:.6g}, by the case '{same.case}' {theirs[k]:.6g}"
            text = f"{both}: {off[k]:.1e} apart, {limit[k]:.1e} allowed"
    return worst, allowed, text
