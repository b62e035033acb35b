"""The cheapest combination of measured settings whose error of e_n meets a target, tried on the probes themselves.

Predicted: errors of a case add up over the knobs, with the doubts of the limits that they are measured against; the
sum never hopes that errors of opposite sign cancel, so combinations somewhat beyond the target are tried too. What is
cheapest follows from the unknowns and not from measured times, which change from run to run. A combination that meets
the target on the probes is tried on cases that it was not chosen by.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.accuracy.cost.errors import KnobErrors, best_known, flagged, flags_of, front, places, unsure
from softjaw.study.accuracy.cost.knobs import Level
from softjaw.study.accuracy.cost.measure import Measured, measure
from softjaw.study.accuracy.cost.study import Costs, CostStudy, same, setting_of
from softjaw.study.case.probes import Probe
from softjaw.study.scene import Scene
from softjaw.study.scene.text import value_text

FloatArray = NDArray[np.float64]
NO_LOSS = ("load steps", "gap collocation", "effect: wrench", "effect: model size", "effect: fingers")
NOT_CHOSEN = (*NO_LOSS, "effect: friction pressure coupling")  # which is another model than the paper's
HOPE, CHEAPEST = 2.0, 5  # predicted errors up to so many targets are tried, and so many of the cheapest
BELOW = 1e-6  # errors below this are none
SMALL, ALIKE = 1e-4, 1e-6  # differences of e_n, and relative ones of work and error, that are none
Solve = Callable[[str, "Probe", Level], Measured]


def percent(error: float) -> str:
    """A relative error for people.

    >>> percent(0.0213), percent(0.00123), percent(3e-8), percent(0.34)
    ('2.1 %', '0.12 %', '< 0.0001 %', '34 %')
    """
    if not math.isfinite(error):
        return "–"
    if error < BELOW:
        return "< 0.0001 %"
    return f"{100 * error:.2g} %" if error < 0.995 else f"{100 * error:.0f} %"


def seconds_text(seconds: float) -> str:
    """A CPU time per case.

    >>> seconds_text(0.0234), seconds_text(0.6), seconds_text(12.3)
    ('23 ms', '0.6 s', '12 s')
    """
    if not math.isfinite(seconds):
        return "–"
    return f"{1e3 * seconds:.2g} ms" if seconds < 0.1 else f"{seconds:.2g} s"


def values_text(values: dict) -> str:
    """Scene keys and values, as in ``gripper.elements = [20, 10, 6]``."""
    return ", ".join(f"{key} = {value_text(value)}" for key, value in values.items()) or "as in the scene"


@dataclass(frozen=True)
class Combination:
    """Levels of several knobs, their predicted CPU time per case [s], error of e_n, and work over the scene's own."""

    levels: tuple[Level, ...]
    seconds: float
    error: float
    work: float = 1.0

    @property
    def level(self) -> Level:
        """All of it as one level."""
        values = tuple(pair for level in self.levels for pair in level.values)
        return Level("; ".join(level.name for level in self.levels) or "as in the scene", values)


@dataclass(frozen=True)
class Choice:
    """Settings that were chosen for a target.

    Attributes
    ----------
    values : dict
        Scene keys and their values.
    target, predicted, measured : float
        Relative errors of e_n, with the doubt of what they are measured against; ``measured`` is the largest on the
        probes, NaN where the combination was not solved there.
    seconds : float
        CPU time per case [s].
    note : str
        How it was chosen, or why not.
    held_out : float
        The largest on cases that it was not chosen by; NaN where there are none.
    met : bool
        Whether the target is kept on all of them.
    """

    values: dict[str, Any]
    target: float
    predicted: float
    measured: float
    seconds: float
    note: str
    held_out: float = math.nan
    met: bool = False

    def __str__(self) -> str:
        """What was chosen, in one sentence."""
        measured = "" if math.isnan(self.measured) else f", measured on the probes {percent(self.measured)}"
        measured += "" if math.isnan(self.held_out) else f", on cases held out {percent(self.held_out)}"
        verdict = "" if self.met else "; THE TARGET IS NOT MET"
        return (
            f"accuracy.e_n = {self.target:g}: {values_text(self.values)}; predicted error {percent(self.predicted)}"
            f"{measured}, about {seconds_text(self.seconds)} CPU per case ({self.note}){verdict}"
        )


def nothing(target: float, note: str, seconds: float = math.nan) -> Choice:
    """The scene as it is, with an error that is not known."""
    return Choice({}, target, math.nan, math.nan, seconds, note)


def explicit(scene: Scene) -> dict[str, Any]:
    """Keys that the scene gives itself, but for those that say ``auto``, and those that it sweeps."""
    given = {}
    for name in ("object", "gripper", "effects", "accuracy"):
        section = getattr(scene, name)
        given |= {f"{name}.{key}": getattr(section, key) for key in section.model_fields_set}
    return {key: value for key, value in given.items() if value != "auto"} | dict.fromkeys(scene.sweep)


def allowed(level: Level, given: Mapping[str, Any]) -> bool:
    """Whether a level leaves what is given as it is."""
    return all(key not in given or same(value, given[key]) for key, value in level.values)


@dataclass(frozen=True)
class Reference:
    """What cases are judged by, for each probe case ``(cases,)``: limit of e_n [m], its relative doubt, flags."""

    value: FloatArray
    doubt: FloatArray
    flags: NDArray[np.int64]

    def error(self, found: Sequence[Measured]) -> float:
        """Largest relative error of e_n of what was measured, where the reference itself can be trusted.

        Infinite where a case failed, or carries a flag that the reference does not.
        """
        error = np.abs(_e_n(found) - self.value) / np.abs(self.value) + self.doubt
        bad = np.isnan(error) | flagged(flags_of(found), self.flags)
        return float(np.where(bad, np.inf, error)[~unsure(self.flags)].max(initial=0.0))


def _families(tables: Sequence[KnobErrors]) -> dict[str, list[KnobErrors]]:
    """The knobs that are chosen from, by what they lead to."""
    found: dict[str, list[KnobErrors]] = {}
    for table in tables:
        if not table.judging and table.name not in NOT_CHOSEN:
            found.setdefault(table.family or table.name, []).append(table)
    return found


def combinations(tables: Sequence[KnobErrors], base_seconds: float, given: Mapping[str, Any]) -> list[Combination]:
    """Every combination of levels that a scene leaves open, one of each family, the cheapest first.

    Levels with a flag that the finest of the family does not carry are left out.
    """
    families: list[list[tuple[Level, float, FloatArray]]] = []
    doubt: FloatArray | float = 0.0
    sure: NDArray[np.bool_] | bool = True
    for family, own in _families(tables).items():
        best, options = best_known(tables, family), []
        sure = sure & ~unsure(best.levels[-1].flags)
        for table in own:
            for i, (level, found) in enumerate(zip(table.settings, table.levels, strict=True)):
                if i != table.own and not (allowed(level, given) and _matters(table, i)):
                    continue
                own_level = i == table.own
                good = np.isfinite(found.by_case[0]).all() and not flagged(found.flags, best.levels[-1].flags).any()
                option = (Level(level.name), 1.0) if own_level else (level, found.seconds / base_seconds)
                options.append((good, (*option, found.by_case[0])))
        doubt = doubt + best.doubts
        if options:
            families.append([option for good, option in options if good])
    made = []
    for chosen in product(*families):
        error = np.atleast_1d(sum((c[2] for c in chosen), doubt))[sure].max(initial=0.0) if np.any(sure) else np.inf
        seconds = base_seconds * math.prod(c[1] for c in chosen)
        work = math.prod(c[0].work for c in chosen)
        made.append(Combination(tuple(c[0] for c in chosen), seconds, float(error), work))
    return sorted(made, key=lambda c: (float(f"{c.work:.6g}"), float(f"{c.error:.6g}"), c.level.name))


def _matters(table: KnobErrors, i: int) -> bool:
    """Whether a level is cheaper than the scene's own, or more accurate."""
    if table.own < 0:
        return True
    cheaper = table.settings[i].work < (1.0 - ALIKE) * table.settings[table.own].work
    return cheaper or table.levels[i].worst[0] < table.levels[table.own].worst[0] - SMALL


def best_of(made: Sequence[Combination]) -> list[Combination]:
    """Those that no other beats in both work and predicted error, the cheapest first, by more than a tenth."""
    kept: list[Combination] = []
    for i in front([c.work for c in made], [c.error for c in made]):
        if not kept or made[i].error < 0.9 * kept[-1].error:
            kept.append(made[i])
    return kept


def reference(study: CostStudy, tables: Sequence[KnobErrors]) -> Reference:
    """The limit that the scene's own setting is moved to by what every knob's own limit moves."""
    base = _e_n(study.of(study.base))
    value, doubt, flags = base.copy(), np.zeros(base.shape), np.full(base.shape, -1)
    for family in _families(tables):
        best = best_known(tables, family)
        value = value * best.limits[0].value / base
        doubt = doubt + best.doubts
        flags &= best.levels[-1].flags
    return Reference(value, doubt, np.where(flags < 0, flags_of(study.of(study.base)), flags))


def _e_n(found: Sequence[Measured]) -> FloatArray:
    return np.concatenate([m.values[:, 0] for m in found])


def choose(
    costs: Costs, study: CostStudy, target: float, given: Mapping[str, Any], probes: Sequence[Probe] = (),
    others: Sequence[Probe] = (), solve: Solve = measure,
) -> Choice:  # fmt: skip
    """The cheapest combination whose error is within the target on the probes, and then on ``others``.

    Combinations that the study does not hold are solved on ``probes`` and added to it; without probes only those
    that it holds are tried, and the prediction has the last word. On ``others`` what is chosen is compared with the
    most accurate combination.
    """
    tables, own = costs.errors(study), study.of(study.base)
    base_seconds = float(np.mean([m.seconds for m in own]))
    if not all(np.isfinite(m.values).all() for m in own):
        told = next(m.message for m in own if not np.isfinite(m.values).all())
        note = f"a probe has no solution with the scene as it is, so errors are not known: {told}"
        return nothing(target, note, base_seconds)
    made, goal = combinations(tables, base_seconds, given), reference(study, tables)
    doubtful = _unsure_places(own, goal.flags)
    if not made:
        return nothing(target, "every measured level carries a flag that the finest does not", base_seconds)

    solved = partial(_solved, costs, study, solve)
    tried: list[Choice] = []
    for combination in _hopeful(made, target):
        if tried and tried[-1].met:
            break
        if not probes and not study.has(setting_of(costs.scene, combination.level)):
            continue
        found = solved(combination, probes) if probes else study.of(setting_of(costs.scene, combination.level))
        error, rest = goal.error(found), math.nan
        if error <= target and others:
            finest = _most_accurate(combinations(tables, base_seconds, {}))
            best = solved(finest, others)
            rest = _against(best, finest.error).error(solved(combination, others))
            doubtful += _unsure_places(best, flags_of(best))
        seconds = float(np.mean([m.seconds for m in found]))
        met = error <= target and not rest > target
        tried.append(replace(_choice(combination, target, "", met), measured=error, held_out=rest, seconds=seconds))
    choice = _best(tried, made, target, bool(probes))
    if not doubtful:
        return choice
    note = f"{choice.note}; even the finest levels are flagged at {doubtful[0]}, so the error is not known there"
    return replace(choice, met=False, note=note)


def _solved(
    costs: Costs, study: CostStudy, solve: Solve, combination: Combination, cases: Sequence[Probe]
) -> list[Measured]:
    """What a combination gives at some cases, from the study or solved and added to it."""
    level = combination.level
    setting = setting_of(costs.scene, level)
    return study.completed(setting, cases, lambda probe: replace(solve(setting, probe, level), what=level.name))


def _against(best: Sequence[Measured], doubt: float) -> Reference:
    """What was measured with the most accurate combination as a reference."""
    value = _e_n(best)
    return Reference(value, np.full(value.shape, doubt), flags_of(best))


def _unsure_places(found: Sequence[Measured], flags: NDArray[np.int64]) -> list[str]:
    return [place for place, bad in zip(places(found), unsure(flags), strict=True) if bad]


def _hopeful(made: Sequence[Combination], target: float) -> list[Combination]:
    """What is worth a try: the cheapest that might do, then those that nothing beats."""
    found = [c for c in made if c.error <= HOPE * target]
    cheap = found[:CHEAPEST]
    return cheap + [c for c in best_of(found[CHEAPEST:]) if c not in cheap]


def _most_accurate(made: Sequence[Combination]) -> Combination:
    return min(made, key=lambda c: float(f"{c.error:.6g}"))


def _best(tried: Sequence[Choice], made: Sequence[Combination], target: float, measured: bool) -> Choice:
    """What meets the target, or is predicted to where nothing can be ``measured``; else the best that was reached."""
    if tried and tried[-1].met:
        where = "the probes" if math.isnan(tried[-1].held_out) else "the probes and on cases that it was not chosen by"
        return replace(tried[-1], note=f"the cheapest that meets the target on {where}")
    known = [choice.values for choice in tried]
    within = next((c for c in made if c.error <= target and dict(c.level.values) not in known), None)
    if within is not None and not measured:
        return _choice(within, target, "predicted from one knob at a time", True)
    note = "no measured setting meets the target, this is the best that was reached"
    note += "; raise --time-limit of 'softjaw cost'"
    finite = [choice for choice in tried if math.isfinite(choice.measured)]
    if not finite:
        return _choice(_most_accurate(made), target, note, False)
    return replace(min(finite, key=lambda c: max(c.measured, np.nan_to_num(c.held_out))), note=note)


def _choice(chosen: Combination, target: float, note: str, met: bool) -> Choice:
    return Choice(dict(chosen.level.values), target, chosen.error, math.nan, chosen.seconds, note, met=met)
