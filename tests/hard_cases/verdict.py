"""Whether a case came to what is right for it, as sentences about what is wrong."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from softjaw.fem.contact import checks
from softjaw.study.flags import Flag
from tests.hard_cases.hard_case import HardCase, Outcome
from tests.hard_cases.sources import accepts

FINITE = ("closing", "e_n", "S", "F_N", "contact_area", "p_max", "quality", "f_x_max", "f_y_max", "tau_z_max")
LIMITS = {"force_balance": checks.BALANCE, "adhesion": checks.CONTACT_LAWS, "penetration": checks.CONTACT_LAWS}


@dataclass(frozen=True)
class Verdict:
    """What is wrong with a case (nothing: it is right), and how far it is from the second number."""

    wrong: tuple[str, ...] = ()
    difference: float | None = None
    gap: bool = False

    @property
    def word(self) -> str:
        if self.gap:
            return "gap"
        return "WRONG" if self.wrong else "ok" if self.difference is not None else "no number"


def judge(case: HardCase, found: Outcome, other: Outcome | None = None) -> Verdict:
    """Judge a case by what was found of it and of its source."""
    wrong = [*_outcome(case, found), *_solved(case, found)]
    difference, text, source = None, "", case.source
    if source is None or source.kind == "none":
        pass
    elif source.bound is not None:
        difference, text = _bound(case)
    elif source.told is not None:
        reasons = found.refused or "; ".join(found.messages)
        number = re.search(case.reason, reasons)
        difference = abs(float(number.group(1)) / source.told - 1.0) if number else np.inf
        text = "" if difference <= source.tolerance else f"the reason does not tell {source.told:g}: {reasons}"
    elif found.done.any():
        difference, text = _difference(case, found, other)
    wrong += [text] if text else []
    # a failure that is a gap must be found as it is stated; any other gap that has closed is to be taken out
    gap = bool(case.gap) and bool(wrong) == (case.expect == "solved")
    closed = ("the gap that it states has closed",) if case.gap and not gap and not wrong else ()
    return Verdict((*wrong, *closed), difference, gap)


def _bound(case: HardCase) -> tuple[float, str]:
    """How far apart what is accepted and what is refused are, about the bound in closed form."""
    bound, tolerance = case.source.bound, case.source.tolerance
    apart = abs(bound.refused - bound.accepted) / bound.value
    between = min(bound.accepted, bound.refused) <= bound.value <= max(bound.accepted, bound.refused)
    if not between or apart > tolerance:
        return apart, f"{bound.accepted:g} and {bound.refused:g} do not enclose {bound.value:g} closely"
    for value, right in ((bound.accepted, True), (bound.refused, False)):
        if accepts(case, value) != right:
            return apart, f"{bound.key} = {value:g} is not {'accepted' if right else 'refused'}"
    return apart, ""


def _outcome(case: HardCase, found: Outcome) -> Iterator[str]:
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
    if case.note and not any(re.search(case.note, part) for part in parts or [""]):
        yield f"'{case.note}' is not remarked"


def _difference(case: HardCase, found: Outcome, other: Outcome) -> tuple[float, str]:
    """Largest relative difference, in units of what is allowed, and a sentence where it is more.

    All forces that are solved here must be solved by the source, too, and none else; numbers that are stated hold for
    the forces they name. Mesh errors that both show are allowed too.
    """
    source = case.source
    stated = bool(source.formula or source.stored)
    theirs_at = {round(float(f) / source.force, 9): k for k, f in enumerate(other.forces[other.done])}
    mine_at = {round(float(f), 9): k for k, f in enumerate(found.forces[found.done])}
    both = [f for f in mine_at if f in theirs_at]
    if not both or (not stated and len(both) != max(len(mine_at), len(theirs_at))):
        told = other.refused or "; ".join(m for m, good in zip(other.messages, other.done, strict=True) if not good)
        return np.inf, f"{source.what}: not solved alike: {told}"
    k, j = [mine_at[f] for f in both], [theirs_at[f] for f in both]
    names = tuple(other.maps) if stated else source.quantities
    worst, allowed, text = -1.0, source.tolerance, ""
    for name in names:
        mine, theirs = found.maps[name][k], other.maps[name][j] / source.factor(name)
        errors = [o.errors[name][i] for o, i in ((found, k), (other, j)) if name in o.errors]
        limit = np.maximum(np.full(len(both), source.tolerance), sum(errors) if len(errors) == 2 else 0.0)
        # beside a number that is 0 the difference itself counts
        off = np.abs(mine - theirs) / np.where(theirs == 0.0, 1.0, np.abs(theirs))
        i = int(np.argmax(off / limit))
        if off[i] / limit[i] > worst / allowed:
            worst, allowed = float(off[i]), float(limit[i])
        if not off[i] <= limit[i]:
            text = (
                f"{name} is {mine[i]:.6g}, by {source.what} {theirs[i]:.6g}: {off[i]:.1e} apart, {limit[i]:.1e} allowed"
            )
    return worst, text
