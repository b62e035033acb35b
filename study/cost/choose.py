"""The cheapest combination of measured settings whose error of e_n meets a target, tried on the probes themselves.

Predicted: errors add up over the knobs (the largest of all probe cases each), times multiply. The sum never hopes that
errors of opposite sign cancel, so combinations somewhat beyond the target are tried too, the cheapest first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.cost.errors import KnobErrors, best_known
from study.cost.file import CostStudy
from study.cost.knobs import Level
from study.cost.measure import Measured, measure
from study.cost.pareto import front
from study.cost.study import Costs, same, setting_of
from study.scene import Scene

if TYPE_CHECKING:
    from study.cost.probes import Probe

FloatArray = NDArray[np.float64]
NO_LOSS = ("load steps", "gap collocation", "effect: wrench", "effect: model size", "effect: fingers")
NOT_CHOSEN = (*NO_LOSS, "effect: friction pressure coupling")  # which is another model than the paper's
HOPE, MOST_TRIED = 2.0, 8  # predicted errors up to so many targets are tried, at most so many combinations
NOISE, SMALL = 0.1, 1e-4  # of a time, and of e_n: less is no difference
Solve = Callable[[str, "Probe", Level], Measured]


@dataclass(frozen=True)
class Combination:
    """Levels of several knobs, with their predicted time per case [s] and error of e_n."""

    levels: tuple[Level, ...]
    seconds: float
    error: float

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
        Relative errors of e_n; ``measured`` on the probes, NaN where the combination was not solved there.
    seconds : float
        CPU time per case [s].
    remark : str
        How it was chosen.
    """

    values: dict[str, Any]
    target: float
    predicted: float
    measured: float
    seconds: float
    remark: str

    @property
    def met(self) -> bool:
        """Whether the best known error is within the target."""
        return (self.predicted if math.isnan(self.measured) else self.measured) <= self.target


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


def combinations(tables: Sequence[KnobErrors], base_seconds: float, given: Mapping[str, Any]) -> list[Combination]:
    """Every combination of levels that a scene leaves open, one of each family."""
    families: dict[str, list[tuple[Level, float, float]]] = {}
    for table in tables:
        if table.judging or table.name in NOT_CHOSEN:
            continue
        options = families.setdefault(table.family or table.name, [])
        for i, (level, found) in enumerate(zip(table.settings, table.levels, strict=True)):
            if i == table.own:
                options.append((Level(level.name), 1.0, float(found.worst[0])))
            elif allowed(level, given) and np.isfinite(found.worst[0]) and _matters(table, i):
                options.append((level, found.seconds / base_seconds, float(found.worst[0])))
    made = []
    for choice in product(*filter(None, families.values())):
        seconds = base_seconds * math.prod(c[1] for c in choice)
        made.append(Combination(tuple(c[0] for c in choice), seconds, sum(c[2] for c in choice)))
    return sorted(made, key=lambda c: (c.seconds, c.error))


def _matters(table: KnobErrors, i: int) -> bool:
    """Whether a level differs from the scene's own by more than the noise of a measurement."""
    if table.own < 0:
        return True
    own, level = table.levels[table.own], table.levels[i]
    cheaper = level.seconds < (1.0 - NOISE) * own.seconds
    return cheaper or level.worst[0] < own.worst[0] - SMALL


def best_of(made: Sequence[Combination]) -> list[Combination]:
    """Those that no other beats in both predicted time and error, the cheapest first, by more than noise."""
    kept: list[Combination] = []
    for i in front([c.seconds for c in made], [c.error for c in made]):
        if not kept or made[i].error < (1.0 - NOISE) * kept[-1].error:
            kept.append(made[i])
    return kept


def reference(study: CostStudy, tables: Sequence[KnobErrors]) -> FloatArray:
    """Limit of e_n ``(cases,)`` [m]: that of the scene's own setting, moved by what every knob's own limit moves."""
    base = np.concatenate([m.values[:, 0] for m in study.of(study.base)])
    found, families = base.copy(), set()
    for table in tables:
        family = table.family or table.name
        if table.judging or table.name in NOT_CHOSEN or family in families:
            continue
        best = best_known(tables, family)
        found = found * best.limits[0].value / base
        families.add(family)
    return found


def measured_error(study: CostStudy, setting: str, goal: FloatArray) -> float:
    """Largest relative error of e_n of a setting on the probes; NaN where a case failed."""
    values = np.concatenate([m.values[:, 0] for m in study.of(setting)])
    return float((np.abs(values - goal) / goal).max())


def choose(
    costs: Costs, study: CostStudy, target: float, given: Mapping[str, Any], probes: Sequence[Probe] = (),
    solve: Solve = measure,
) -> Choice:  # fmt: skip
    """The cheapest combination whose error on the probes is within the target.

    Combinations that the study does not hold are solved on ``probes`` and added to it; without probes only those
    that it holds are tried, and the prediction has the last word.
    """
    tables, own = costs.errors(study), study.of(study.base)
    base_seconds = float(np.mean([m.seconds for m in own]))
    if not all(np.isfinite(m.values).all() for m in own):
        told = next(m.message for m in own if not np.isfinite(m.values).all())
        remark = f"a probe has no solution with the scene as it is, so errors are not known: {told}"
        return Choice({}, target, math.nan, math.nan, base_seconds, remark)
    made = combinations(tables, base_seconds, given)
    goal = reference(study, tables)
    hopeful = [c for c in made if c.error <= HOPE * target]
    tried: list[tuple[Combination, float, float]] = []
    for combination in hopeful:
        if len(tried) == MOST_TRIED:
            break
        setting = setting_of(costs.scene, combination.level)
        if not study.has(setting):
            if not probes:
                continue
            for probe in probes:
                study.add(replace(solve(setting, probe, combination.level), what=combination.level.name))
        error = measured_error(study, setting, goal)
        seconds = float(np.mean([m.seconds for m in study.of(setting)]))
        tried.append((combination, error, seconds))
        if error <= target:
            break
    good = [t for t in tried if t[1] <= target]
    if good:
        combination, error, seconds = min(good, key=lambda t: t[2])
        return _choice(combination, target, error, seconds, "the cheapest that meets the target on the probes")
    within = next((c for c in made if c.error <= target and not any(t[0] is c for t in tried)), None)
    if within is not None:
        return _choice(within, target, math.nan, within.seconds, "predicted from one knob at a time")
    last = min(made, key=lambda c: c.error)
    remark = "no measured setting meets the target, this is the most accurate; raise --time-limit of 'softjaw cost'"
    return _choice(last, target, next((t[1] for t in tried if t[0] is last), math.nan), last.seconds, remark)


def _choice(chosen: Combination, target: float, measured: float, seconds: float, remark: str) -> Choice:
    return Choice(dict(chosen.level.values), target, chosen.error, measured, seconds, remark)
