"""Combinations of the measured levels of a cost study: predicted time and error, and which ones nothing beats."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.accuracy.convergence import ParameterErrors, best_known, flagged, pareto_front, unsure
from softjaw.study.accuracy.cost_study import same
from softjaw.study.accuracy.parameters import Level
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]
NO_LOSS = ("load steps", "gap collocation", "effect: wrench", "effect: model size", "effect: fingers")
NOT_CHOSEN = (*NO_LOSS, "effect: friction pressure coupling")  # which is another model than the paper's
SMALL, ALIKE = 1e-4, 1e-6  # differences of e_n, and relative ones of work and error, that are none


def explicit(scene: Scene) -> dict[str, Any]:
    """Keys that the scene gives itself, but for those that say ``auto``, and those that it sweeps."""
    given: dict[str, Any] = {}
    for name in ("object", "gripper", "effects", "accuracy"):
        section = getattr(scene, name)
        given |= {f"{name}.{key}": getattr(section, key) for key in section.model_fields_set}
    # A swept key varies from case to case, so a choice must not touch it either.
    return {key: value for key, value in given.items() if value != "auto"} | dict.fromkeys(scene.sweep)


def allowed(level: Level, given: Mapping[str, Any]) -> bool:
    """Whether a level leaves what is given as it is."""
    return all(key not in given or same(value, given[key]) for key, value in level.values)


def families(tables: Sequence[ParameterErrors]) -> dict[str, list[ParameterErrors]]:
    """The parameters that are chosen from, by what they lead to."""
    found: dict[str, list[ParameterErrors]] = {}
    for table in tables:
        if not table.parameter.evaluation and table.name not in NOT_CHOSEN:
            found.setdefault(table.family, []).append(table)
    return found


@dataclass(frozen=True)
class Combination:
    """Levels of several parameters, their predicted CPU time per case [s], error of e_n, and work over the scene's."""

    levels: tuple[Level, ...]
    seconds: float
    error: float
    work: float = 1.0

    @property
    def level(self) -> Level:
        """All of it as one level."""
        values = tuple(pair for level in self.levels for pair in level.values)
        return Level("; ".join(level.name for level in self.levels) or "as in the scene", values)


def combinations(tables: Sequence[ParameterErrors], base_seconds: float, given: Mapping[str, Any]) -> list[Combination]:
    """Every combination of levels that a scene leaves open, one of each family, the cheapest first."""
    choices: list[list[tuple[Level, float, FloatArray]]] = []
    estimate: FloatArray | float = 0.0
    sure: NDArray[np.bool_] | bool = True
    for family, own in families(tables).items():
        best = best_known(tables, family)
        sure = sure & ~unsure(best.levels[-1].flags)
        estimate = estimate + best.estimates
        if (options := _options(own, best, base_seconds, given)) is not None:
            choices.append(options)
    made = []
    for chosen in product(*choices):
        # The largest sum over cases, not the sum of the largest: errors of one case add up.
        error = np.atleast_1d(sum((c[2] for c in chosen), estimate))[sure].max(initial=0.0) if np.any(sure) else np.inf
        seconds = base_seconds * math.prod(c[1] for c in chosen)
        work = math.prod(c[0].work for c in chosen)
        made.append(Combination(tuple(c[0] for c in chosen), seconds, float(error), work))
    # Rounded, with the name as the last word: the order must not depend on the machine.
    return sorted(made, key=lambda c: (float(f"{c.work:.6g}"), float(f"{c.error:.6g}"), c.level.name))


def _options(
    tables: Sequence[ParameterErrors], best: ParameterErrors, base_seconds: float, given: Mapping[str, Any]
) -> list[tuple[Level, float, FloatArray]] | None:
    """Levels of one family, time over the base's and errors; None where the scene leaves none open.

    Levels with a flag that the finest of the family does not carry are left out.
    """
    options, found_any = [], False
    for table in tables:
        for i, found in enumerate(table.levels):
            level, own = found.level, i == table.own
            if not own and not (allowed(level, given) and _matters(table, i)):
                continue
            found_any = True
            if np.isfinite(found.by_case[0]).all() and not flagged(found.flags, best.levels[-1].flags).any():
                option = (Level(level.name), 1.0) if own else (level, found.seconds / base_seconds)
                options.append((*option, found.by_case[0]))
    return options if found_any else None


def _matters(table: ParameterErrors, i: int) -> bool:
    """Whether a level is cheaper than the scene's own, or more accurate."""
    if table.own < 0:
        return True
    level, own = table.levels[i], table.levels[table.own]
    return level.level.work < (1.0 - ALIKE) * own.level.work or level.worst[0] < own.worst[0] - SMALL


def best_of(made: Sequence[Combination]) -> list[Combination]:
    """Those that no other beats in both work and predicted error, the cheapest first, by more than a tenth."""
    kept: list[Combination] = []
    for i in pareto_front([c.work for c in made], [c.error for c in made]):
        # Little gain is not worth another trial.
        if not kept or made[i].error < 0.9 * kept[-1].error:
            kept.append(made[i])
    return kept
