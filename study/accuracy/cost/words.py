"""What a cost study says, in sentences that a user can act on."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from softjaw.study.accuracy.cost.choose import NO_LOSS, Choice, Combination, best_of, combinations
from softjaw.study.accuracy.cost.errors import KnobErrors
from softjaw.study.accuracy.cost.file import CostStudy
from softjaw.study.scene.text import value_text

GOALS = (0.05, 0.02, 0.01, 0.005, 0.002)
NEEDED = 0.01  # change of e_n from which an effect is needed
BELOW = 1e-6  # errors below this are none


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


def settings_text(combination: Combination) -> str:
    """The settings of a combination as scene keys."""
    return values_text(dict(combination.level.values))


def values_text(values: dict) -> str:
    """Scene keys and values, as in ``gripper.elements = [20, 10, 6]``."""
    return ", ".join(f"{key} = {value_text(value)}" for key, value in values.items()) or "as in the scene"


def sentences(study: CostStudy, tables: Sequence[KnobErrors]) -> list[str]:
    """The answer: what an error of e_n costs, what the next halving costs, which effects are needed."""
    base = float(np.mean([m.seconds for m in study.of(study.base)]))
    best = best_of(combinations(_meshes_only(tables), base, {}))
    return [text for text in (_price(best, _known(tables)), _own(tables, base), *map(_need, tables)) if text]


def _meshes_only(tables: Sequence[KnobErrors]) -> list[KnobErrors]:
    return [t for t in tables if "mesh" in t.name or t.name == "object grid"]


def _known(tables: Sequence[KnobErrors]) -> float:
    """To what the limits of all meshes are known, relative to e_n: the best of every family, added up."""
    found: dict[str, float] = {}
    for table in _meshes_only(tables):
        name = table.family or table.name
        found[name] = min(table.doubt, found.get(name, math.inf))
    return sum(found.values())


def _price(best: Sequence[Combination], known: float) -> str:
    """What 2 % cost, or what the front reaches, and the price of the next halving of the error."""
    if not best or not best[0].levels:
        return "No mesh but the scene's own was measured. Raise --time-limit."
    reached = [g for g in GOALS if best[-1].error <= g]
    if not reached:
        error = percent(best[-1].error)
        return f"No measured mesh brings e_n within 5 %; the best is at {error}. Raise --time-limit for finer ones."
    goal = 0.02 if 0.02 in reached else reached[-1]
    now = next(c for c in best if c.error <= goal)
    half = next((c for c in best if c.error <= 0.5 * now.error), None)
    text = f"{percent(now.error)} in e_n costs {seconds_text(now.seconds)} per case with {settings_text(now)}"
    if half is None:
        return f"{text}; half that error is less than the {percent(known)} to which the finest meshes are known."
    return f"{text}; the next halving of the error costs {half.seconds / now.seconds:.2g} times as much."


def _own(tables: Sequence[KnobErrors], base: float) -> str:
    """Where the scene as it is stands."""
    own = [(t, t.levels[t.own]) for t in _meshes_only(tables) if t.own >= 0]
    if not own:
        return ""
    parts = ", ".join(f"{percent(level.worst[0])} by the {t.name.partition(',')[0]}" for t, level in own)
    return f"The scene as it is costs {seconds_text(base)} per case and has {parts}."


def _need(table: KnobErrors) -> str:
    """Whether an effect is needed: what its cheapest level moves e_n by."""
    if not table.name.startswith("effect: ") or table.name in NO_LOSS or len(table.levels) < 2:
        return ""
    cheap, fine = table.levels[0], table.levels[-1]
    moved = cheap.worst[0]
    need = "is needed" if moved > NEEDED else "is not needed"
    faster = fine.seconds / cheap.seconds
    effect = table.name.removeprefix("effect: ")
    by = f"'{cheap.name}' moves e_n by {percent(moved)} and is {faster:.2g} times as fast"
    return f"{effect.capitalize()}: '{fine.name}' {need}, {by}."


def choice_text(choice: Choice) -> str:
    """What was chosen, in one sentence."""
    measured = "" if math.isnan(choice.measured) else f", measured on the probes {percent(choice.measured)}"
    measured += "" if math.isnan(choice.held_out) else f", on cases held out {percent(choice.held_out)}"
    verdict = "" if choice.met else "; THE TARGET IS NOT MET"
    return (
        f"accuracy.e_n = {choice.target:g}: {values_text(choice.values)}; predicted error {percent(choice.predicted)}"
        f"{measured}, about {seconds_text(choice.seconds)} CPU per case ({choice.remark}){verdict}"
    )
