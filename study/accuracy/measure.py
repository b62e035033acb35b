"""Values and CPU seconds of probes at settings, by the ordinary pipeline, and in which order a study measures them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.assembly import Pattern
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.petsc import Factors
from softjaw.study import pipeline
from softjaw.study.accuracy.cost_study import QUANTITIES, Costs, CostStudy, Measured, Planned, save
from softjaw.study.accuracy.evaluation import SolvedProbe, as_quantities, solved, work_of
from softjaw.study.accuracy.parameters import EACH_ALONE, WINKLER, Level, Skipped, expected_seconds, with_level
from softjaw.study.case.probes import Probe
from softjaw.study.case.result import CaseFailure
from softjaw.study.run.progress import duration

FloatArray = NDArray[np.float64]
T = TypeVar("T")
Case = tuple[FloatArray, int]  # values and flags
ENOUGH, REPEATS = 1.0, 3  # seconds after which, and times, that a cheap measurement is repeated
CALIBRATION = 24  # points along a side of the cube whose Laplacian is factorised


def timed(work: Callable[[], T], repeats: int = REPEATS) -> tuple[float, T, int]:
    """The least CPU time of some repeats of a cheap piece of work [s], what it gave, and how many there were."""
    best, spent, times = np.inf, 0.0, 0
    # The least of some repeats, because other programs only ever add time; dear work is not repeated.
    while times < repeats and (spent < ENOUGH or not times):
        # CPU time: a busy machine stretches the wall clock only.
        start = time.process_time()
        found = work()
        seconds = time.process_time() - start
        best, spent, times = min(best, seconds), spent + seconds, times + 1
    return best, found, times


def measure(setting: str, probe: Probe, level: Level, repeats: int = REPEATS) -> Measured:
    """A probe's cases at a level of a discretisation parameter; what fails is a message, never an exception."""
    scene = with_level(probe.unit.scene, level)

    def solve() -> tuple[dict[float, Case], str]:
        found: dict[float, Case] = {}
        messages = []
        for forces in load_paths(probe.forces, level.between):
            load: dict[str, Any] = {"load.normal_force_n": list(forces)}
            outcome, message = _solve_path(replace(probe.unit, scene=scene.with_values(load)), forces)
            found |= outcome
            messages.append(message)
        return found, next(filter(None, messages), "")

    seconds, (found, message), times = timed(solve, repeats)
    # A force that failed keeps its row, so that cases stay comparable between settings.
    nothing = np.full(len(QUANTITIES), np.nan), 0
    values, flags = zip(*(found.get(force, nothing) for force in probe.forces), strict=True)
    return Measured(
        setting, level.name, probe.label, np.array(probe.forces), np.array(values), seconds / len(probe.forces),
        repeats=times, message=message, flags=np.array(flags, float),
    )  # fmt: skip


measure_once = partial(measure, repeats=1)


def load_paths(forces: Sequence[float], between: int) -> list[tuple[float, ...]]:
    """Load paths that a level solves.

    >>> load_paths((1.0, 3.0), 1), load_paths((1.0, 3.0), EACH_ALONE)
    ([(1.0, 2.0, 3.0)], [(1.0,), (3.0,)])
    """
    if between == EACH_ALONE:
        return [(force,) for force in forces]
    rising = [forces[0]]
    for low, high in pairwise(forces):
        rising += [low + (high - low) * (i + 1) / (between + 1) for i in range(between)] + [high]
    return [tuple(rising)]


def _solve_path(unit: Any, forces: Sequence[float]) -> tuple[dict[float, Case], str]:
    found: dict[float, Case] = {}
    message = ""
    try:
        for k, result in pipeline.solve_unit(unit):
            if isinstance(result, CaseFailure):
                # The first message counts: what fails above follows from it.
                message = message or result.message
            else:
                found[forces[k]] = as_quantities(result.values), int(result.values["maps/flags"])
    except Exception as error:  # whatever a case dies of is its result, as in a run
        message = f"{type(error).__name__}: {error}"
    return found, message


def measure_evaluation(solved_probe: SolvedProbe, parameter: str, level: Level) -> Measured:
    """A probe's cases at a level of an evaluation parameter; the hulls only at the highest force: they take seconds."""
    found, work = solved_probe, work_of(solved_probe, parameter, level.name)
    forces, contacts = found.probe.forces, found.contacts
    if parameter == "score":
        forces, contacts = forces[-1:], contacts[-1:]
    values, own, repeats, message = [], 0.0, 1, ""
    for force, pair in zip(forces, contacts, strict=True):
        try:
            seconds, value, repeats = timed(partial(work, pair, force))
        except Exception as error:  # whatever a case dies of is its result, as in a run
            reason = str(error).partition("\n")[0]  # Qhull prints its whole state
            seconds, value, message = 0.0, np.full(len(QUANTITIES), np.nan), f"{type(error).__name__}: {reason}"
        values.append(value)
        own += seconds / len(forces)
    whole = own if level.name == WINKLER else own + found.seconds
    return Measured(f"{parameter}: {level.name}", level.name, found.probe.label, np.array(forces), np.array(values),
                    whole, own, repeats, message)  # fmt: skip


def warm_up(probe: Probe) -> None:
    """Compile what is compiled at first use: a pad of few elements on the same object."""
    mesh = Level("warm up", (("gripper.elements", [4, 4, 2]), ("gripper.element", "hex8")))
    measure("", replace(probe, forces=probe.forces[:1]), mesh)


def calibration_seconds() -> float:
    """CPU time of one sparse factorisation of fixed size: MUMPS, 7-point Laplacian of a cube of 24 points a side [s].

    Runs on two machines compare by their seconds over this one.
    """
    n = CALIBRATION
    number = np.arange(n**3, dtype=np.int32).reshape(n, n, n)
    pairs = [(np.delete(number, -1, axis).ravel(), np.delete(number, 0, axis).ravel()) for axis in range(3)]
    rows = np.concatenate([number.ravel(), *[p for pair in pairs for p in pair]])
    columns = np.concatenate([number.ravel(), *[p for pair in pairs for p in reversed(pair)]])
    pattern = Pattern(n**3, rows, columns)
    np.add.at(pattern.values, pattern.slots(rows, columns), np.where(rows == columns, 6.0, -1.0))
    return timed(lambda: Factors(pattern).destroy())[0]


class Measuring:
    """Measures what is missing in a study, the cheapest first, and saves after each."""

    def __init__(
        self, study: CostStudy, probes: Sequence[Probe], costs: Costs, path: Path | None, say: Callable[[str], None]
    ) -> None:
        self.study, self.probes, self.costs, self.path, self.say = study, probes, costs, path, say
        self._solved: dict[str, SolvedProbe] | None = None

    def run(self, seconds: float) -> None:
        """Measure until everything is there or would take the study beyond so many CPU seconds."""
        todo = [task for task in self.costs.tasks if not self.study.has(task.setting)]
        self.study.skipped = list(self.costs.skipped)
        if todo:
            # Or the first setting would be charged with compiling.
            warm_up(self.probes[0])
        if np.isnan(self.study.calibration):
            self.study.calibration = calibration_seconds()
        while todo:
            # The scene as it is comes first whatever it takes: all else is judged by it.
            base = [task for task in todo if task.setting == self.study.base]
            task = base[0] if base else min(todo, key=self.expected)
            if not base and self.study.spent + self.expected(task) > seconds:
                break
            todo.remove(task)
            self._measure(task)
        for task in todo:
            reason = f"would take about {duration(self.expected(task))}; raise --time-limit"
            self.study.skipped.append(Skipped(task.name, task.level.name, reason))
        self._save()

    def expected(self, task: Planned) -> float:
        """CPU time that a task will take, by the measured level of its parameter that is nearest to it [s].

        The scene as it is has been measured before.
        """
        cases = sum(len(p.forces) for p in self.probes)
        if task.evaluation:
            return expected_seconds(task.name, task.level.name) * cases
        known = [t for t in self.costs.tasks if not t.evaluation and self.study.has(t.setting)]
        alike = [t for t in known if t.name == task.name] or [t for t in known if t.setting == self.study.base]
        # Nearest by ratio: the time is scaled by the ratio of works.
        near = min(alike, key=lambda t: abs(np.log(t.level.work / task.level.work)))
        measured = np.mean([m.seconds for m in self.study.of(near.setting)])
        return float(measured * task.level.work / near.level.work * cases)

    def _measure(self, task: Planned) -> None:
        def solve(probe: Probe) -> Measured:
            if not task.evaluation:
                return measure(task.setting, probe, task.level)
            return measure_evaluation(self.contacts[probe.label], task.name, task.level)

        if task.evaluation and not self.contacts:
            return
        found = self.study.completed(task.setting, self.probes, solve, self._save)
        failed = sum(bool(m.message) for m in found)
        note = f", {failed} of {len(found)} candidates failed" if failed else ""
        name = f"{task.name}: " if task.name else ""
        self.say(f"{name}{task.level.name}: {np.mean([m.seconds for m in found]):.3g} s per case{note}")

    @property
    def contacts(self) -> dict[str, SolvedProbe]:
        """Contacts of all probes at the scene's own settings, by label, solved once; none where one fails."""
        if self._solved is None:
            try:
                self._solved = {probe.label: solved(probe) for probe in self.probes}
            # Discretisation can still be compared without the contacts of the scene's own settings.
            except (ConvergenceError, CheckError) as error:
                self._solved = {}
                self.say(f"friction, limit surfaces and scores are not measured: {error}")
        return self._solved

    def _save(self) -> None:
        if self.path is not None:
            save(self.path, self.study)
