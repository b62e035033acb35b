"""The cheapest settings whose error of e_n meets a target: how errors are judged, and the choice from a cost study.

Predicted: errors of a case add up over the parameters, with the error estimates of the limits that they are measured
against; the sum never hopes that errors of opposite sign cancel, so combinations somewhat beyond the target are tried
too. What is cheapest follows from the unknowns and not from measured times, which change from run to run. A combination
that meets the target on the probes is tried on cases that it was not chosen by.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.accuracy.combinations import Combination, best_of, combinations, explicit, families
from softjaw.study.accuracy.convergence import (
    ParameterErrors,
    best_known,
    error_tables,
    flagged,
    flags_of,
    places,
    unsure,
)
from softjaw.study.accuracy.cost_study import Costs, CostStudy, Measured, costs, load, setting_of
from softjaw.study.accuracy.parameters import Level
from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.result.derived import MEANING
from softjaw.study.scene import Scene, parse_scene
from softjaw.study.scene.problems import SceneError
from softjaw.study.scene.text import changes, toml_text, value_text

FloatArray = NDArray[np.float64]
HOPE, CHEAPEST = 2.0, 5  # predicted errors up to so many targets are tried, and so many of the cheapest
BELOW = 1e-6  # errors below this are none
Solve = Callable[[str, Any, Level], Measured]
CHOSEN = ("gripper.elements", "gripper.element")  # with the sections effects and accuracy: what a choice may change
FREE = tuple(f"{name}." for name in ("accuracy", "candidates", "load", "effects", "limit_surface", "score", "sweep",
                                     "task", "run", "uncertainty"))  # fmt: skip


def percent(error: float) -> str:
    """A relative error as it is shown.

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


def values_text(values: Mapping[str, Any]) -> str:
    """Scene keys and values, as in ``gripper.elements = [20, 10, 6]``."""
    return ", ".join(f"{key} = {value_text(value)}" for key, value in values.items()) or "as in the scene"


@dataclass(frozen=True)
class Choice:
    """Settings that were chosen for a target.

    Attributes
    ----------
    values : dict
        Scene keys and their values.
    target, predicted, measured : float
        Relative errors of e_n, with the error estimate of what they are measured against; ``measured`` is the largest
        on the probes, NaN where the combination was not solved there.
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

    def overrides(self) -> list[str]:
        """The chosen values as overrides that say where they come from."""
        texts = [toml_text({"x": {"x": value}}).splitlines()[1].partition(" = ")[2] for value in self.values.values()]
        return [*(f"{key}={text}  # chosen" for key, text in zip(self.values, texts, strict=True)), f"# {self}"]

    def fill(self, writer: Any) -> None:
        """Write what the choice promises into the result file, by one rank, after all cases."""
        values = (self.predicted, self.measured, self.held_out, self.seconds)
        for name, value in zip(MEANING, values, strict=True):
            writer.write_derived(name, value)


def unchanged(target: float, note: str, seconds: float = math.nan) -> Choice:
    """The scene as it is, with an error that is not known."""
    return Choice({}, target, math.nan, math.nan, seconds, note)


# --- how errors are judged --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Reference:
    """What cases are judged by, ``(cases,)`` each: reference solution of e_n [m], relative error estimate, flags."""

    value: FloatArray
    estimate: FloatArray
    flags: NDArray[np.int64]

    def error(self, found: Sequence[Measured]) -> float:
        """Largest relative error of e_n of what was measured, where the reference itself can be trusted.

        Infinite where a case failed, or carries a flag that the reference does not.
        """
        # The reference's own error is added: a small distance from a doubtful limit proves nothing.
        error = np.abs(e_n(found) - self.value) / np.abs(self.value) + self.estimate
        bad = np.isnan(error) | flagged(flags_of(found), self.flags)
        # Where even the reference is flagged no error is known; `choose` says so instead.
        return float(np.where(bad, np.inf, error)[~unsure(self.flags)].max(initial=0.0))


def e_n(found: Sequence[Measured]) -> FloatArray:
    """e_n of all cases of some probes [m]."""
    return np.concatenate([m.values[:, 0] for m in found])


def reference(study: CostStudy, tables: Sequence[ParameterErrors]) -> Reference:
    """The limit that the scene's own setting is moved to by what every parameter's own limit moves."""
    base = e_n(study.of(study.base))
    value, estimate, flags = base.copy(), np.zeros(base.shape), np.full(base.shape, -1)
    for family in families(tables):
        best = best_known(tables, family)
        # Relative moves multiply, as far as parameters do not act on each other.
        value = value * best.limits[0].value / base
        estimate = estimate + best.estimates
        flags &= best.levels[-1].flags
    return Reference(value, estimate, np.where(flags < 0, flags_of(study.of(study.base)), flags))


# --- choice -----------------------------------------------------------------------------------------------------------


def choose(
    costs: Costs, study: CostStudy, target: float, given: Mapping[str, Any], probes: Sequence[Any] = (),
    others: Sequence[Any] = (), solve: Solve | None = None,
) -> Choice:  # fmt: skip
    """The cheapest combination whose error is within the target on the probes, and then on ``others``.

    Combinations that the study does not hold are solved on ``probes`` and added to it; without ``solve`` only those
    that it holds are tried, and the prediction has the last word. On ``others`` what is chosen is compared with the
    most accurate combination.
    """
    tables, own, base_seconds = error_tables(costs, study), study.of(study.base), study.base_seconds
    # Without the scene's own values there is nothing that errors could be measured from.
    if failed := [m.message for m in own if not np.isfinite(m.values).all()]:
        note = f"a probe has no solution with the scene as it is, so errors are not known: {failed[0]}"
        return unchanged(target, note, base_seconds)
    made, goal = combinations(tables, base_seconds, given), reference(study, tables)
    doubtful = _unsure_places(own, goal.flags)
    if not made:
        return unchanged(target, "every measured level carries a flag that the finest does not", base_seconds)

    def solved(combination: Combination, cases: Sequence[Any]) -> list[Measured]:
        level = combination.level
        setting = setting_of(costs.scene, level)
        if solve is None:
            return study.of(setting) if study.has(setting) else []
        return study.completed(setting, cases, lambda probe: replace(solve(setting, probe, level), what=level.name))

    tried: list[Choice] = []
    # Predictions only order the trials; a measured error has the last word.
    for combination in _hopeful(made, target):
        if not (found := solved(combination, probes)):
            continue
        error, rest = goal.error(found), math.nan
        if error <= target and others:
            # The other cases have no refinement series, so the most accurate combination stands for the limit.
            finest = _most_accurate(combinations(tables, base_seconds, {}))
            best = solved(finest, others)
            value = e_n(best)
            against = Reference(value, np.full(value.shape, finest.error), flags_of(best))
            rest = against.error(solved(combination, others))
            doubtful += _unsure_places(best, flags_of(best))
        seconds = float(np.mean([m.seconds for m in found]))
        # `not rest > target` also holds for NaN, where there are no other cases.
        made_of = _predicted(combination, target, "", error <= target and not rest > target)
        tried.append(replace(made_of, measured=error, held_out=rest, seconds=seconds))
        if tried[-1].met:
            break
    choice = _best(tried, made, target, solve is not None)
    if not doubtful:
        return choice
    note = f"{choice.note}; even the finest levels are flagged at {doubtful[0]}, so the error is not known there"
    # A met target does not cover cases whose error nobody knows.
    return replace(choice, met=False, note=note)


def _unsure_places(found: Sequence[Measured], flags: NDArray[np.int64]) -> list[str]:
    return [place for place, bad in zip(places(found), unsure(flags), strict=True) if bad]


def _hopeful(made: Sequence[Combination], target: float) -> list[Combination]:
    """What is worth a try: the cheapest that might do, then those that nothing beats."""
    found = [c for c in made if c.error <= HOPE * target]
    cheap = found[:CHEAPEST]
    return cheap + [c for c in best_of(found[CHEAPEST:]) if c not in cheap]


def _most_accurate(made: Sequence[Combination]) -> Combination:
    # Rounded, so that the last digits of a machine do not choose among equals.
    return min(made, key=lambda c: float(f"{c.error:.6g}"))


def _best(tried: Sequence[Choice], made: Sequence[Combination], target: float, measured: bool) -> Choice:
    """What meets the target, or is predicted to where nothing can be ``measured``; else the best that was reached."""
    if tried and tried[-1].met:
        where = "the probes" if math.isnan(tried[-1].held_out) else "the probes and on cases that it was not chosen by"
        return replace(tried[-1], note=f"the cheapest that meets the target on {where}")
    known = [choice.values for choice in tried]
    # What was tried and missed its target must not come back as a prediction.
    within = next((c for c in made if c.error <= target and dict(c.level.values) not in known), None)
    if within is not None and not measured:
        return _predicted(within, target, "predicted from one parameter at a time", True)
    note = "no measured setting meets the target, this is the best one"
    note += "; raise --time-limit of 'softjaw cost'"
    finite = [choice for choice in tried if math.isfinite(choice.measured)]
    if not finite:
        return _predicted(_most_accurate(made), target, note, False)
    # The worse of both counts; NaN, where nothing was held out, counts as none.
    return replace(min(finite, key=lambda c: max(c.measured, np.nan_to_num(c.held_out))), note=note)


def _predicted(chosen: Combination, target: float, note: str, met: bool) -> Choice:
    return Choice(dict(chosen.level.values), target, chosen.error, math.nan, chosen.seconds, note, met=met)


# --- a stored study ---------------------------------------------------------------------------------------------------


def stored_costs(scene: Scene) -> tuple[CostStudy, Costs]:
    """The cost study that a scene names, and its parameters; meshes, candidates and forces may differ.

    Raises
    ------
    StudyError
        Where the study is one of another object, pad or friction.
    """
    path = Path(str(scene.accuracy.cost_file))
    study = load(path)
    try:
        measured = parse_scene(study.scene, path, check_files=False)
    except SceneError as error:
        raise StudyError(OTHER_FILE, f"{path}: its scene cannot be read by this version: {error}") from error
    differ = [
        f"{key} is {there} there and {here} here"
        for key, there, here in changes(measured.effective_toml(), scene.effective_toml())
        if key not in CHOSEN and not key.startswith(FREE)
    ]
    if differ:
        raise StudyError(
            OTHER_FILE,
            f"accuracy.cost_file: {path} was measured for another scene ({'; '.join(differ[:3])}); expected one of this"
            " object and gripper: run 'softjaw cost' for this scene, or remove the key",
        )
    return study, costs(measured, with_evaluation=False)


def expected(scene: Scene) -> str:
    """What ``check`` can say of the target without solving anything; empty where the scene names none."""
    if scene.accuracy.e_n is None:
        return ""
    goal = f"e_n within {100 * scene.accuracy.e_n:g} %"
    if scene.accuracy.cost_file is None:
        return f"{goal}: the mesh is chosen when the run starts, by solving some ten cases on several meshes"
    study, measured = stored_costs(scene)
    return f"{goal}: {choose(measured, study, scene.accuracy.e_n, explicit(scene))}"
