"""Values and CPU seconds of one probe at one setting, by the ordinary pipeline, and the speed of this machine."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.pattern import Pattern
from softjaw.fem.petsc import Factors
from softjaw.study import pipeline
from softjaw.study.accuracy.cost.knobs import EACH_ALONE, Level, with_level
from softjaw.study.case.probes import Probe
from softjaw.study.case.result import CaseFailure

FloatArray = NDArray[np.float64]
T = TypeVar("T")
Case = tuple[FloatArray, int]  # values and flags
QUANTITIES = ("e_n", "max_force", "max_torque", "quality")
UNITS = {"e_n": "m", "max_force": "N", "max_torque": "N m", "quality": ""}
ENOUGH, REPEATS = 1.0, 3  # seconds after which, and times, that a cheap measurement is repeated
CALIBRATION = 24  # points along a side of the cube whose Laplacian is factorised


@dataclass(frozen=True)
class Measured:
    """One probe at one setting.

    Parameters
    ----------
    setting : str
        What tells settings apart.
    what : str
        The setting in words.
    candidate : str
    forces : (k,) array
        Normal forces [N].
    values : (k, 4) array
        `QUANTITIES` of every force; NaN where there is none.
    seconds : float
        CPU time of one case, the least of the repeats [s].
    own : float
        The part of it that the knob itself takes, where that is not the contact solve [s].
    repeats : int
    message : str
        Why values are missing.
    flags : (k,) array
        Flags of the cases, as ``study.show.tables.ranking`` names them; 0 where there is no value, and by default.
    """

    setting: str
    what: str
    candidate: str
    forces: FloatArray
    values: FloatArray
    seconds: float
    own: float = np.nan
    repeats: int = 1
    message: str = ""
    flags: FloatArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.flags is None:
            object.__setattr__(self, "flags", np.zeros(len(self.forces)))

    @property
    def spent(self) -> float:
        """CPU time that the measurement took, roughly [s]."""
        return self.repeats * len(self.forces) * (self.seconds if np.isnan(self.own) else self.own)


def cpu_seconds(work: Callable[[], T]) -> tuple[float, T]:
    """CPU time of this process for one piece of work [s], and what the work gave."""
    start = time.process_time()
    found = work()
    return time.process_time() - start, found


def least_seconds(work: Callable[[], T]) -> tuple[float, T, int]:
    """The least CPU time of up to three repeats of a cheap piece of work [s], what it gave, and how many there were."""
    best, found = cpu_seconds(work)
    spent, times = best, 1
    while spent < ENOUGH and times < REPEATS:
        seconds, found = cpu_seconds(work)
        best, spent, times = min(best, seconds), spent + seconds, times + 1
    return best, found, times


def measure_once(setting: str, probe: Probe, level: Level) -> Measured:
    """`measure` without repeats."""
    return measure(setting, probe, level, lambda work: (*cpu_seconds(work), 1))


def measure(setting: str, probe: Probe, level: Level, timed: Callable = least_seconds) -> Measured:
    """A probe's cases at a level of a contact knob; what fails is a message, never an exception."""
    scene = with_level(probe.unit.scene, level)
    ladders = ladders_of(probe.forces, level.between)

    def solve() -> tuple[dict[float, Case], str]:
        found: dict[float, Case] = {}
        message = ""
        for forces in ladders:
            point = scene.with_values({"load.normal_force_n": list(forces)})
            outcome, told = _climb(replace(probe.unit, scene=point), forces)
            found |= outcome
            message = message or told
        return found, message

    seconds, (found, message), repeats = timed(solve)
    nothing = np.full(len(QUANTITIES), np.nan), 0
    values, flags = zip(*(found.get(force, nothing) for force in probe.forces), strict=True)
    return Measured(
        setting, level.name, probe.label, np.array(probe.forces), np.array(values), seconds / len(probe.forces),
        repeats=repeats, message=message, flags=np.array(flags, float),
    )  # fmt: skip


def ladders_of(forces: Sequence[float], between: int) -> list[tuple[float, ...]]:
    """Ladders that a level solves.

    >>> ladders_of((1.0, 3.0), 1), ladders_of((1.0, 3.0), EACH_ALONE)
    ([(1.0, 2.0, 3.0)], [(1.0,), (3.0,)])
    """
    if between == EACH_ALONE:
        return [(force,) for force in forces]
    rising = [forces[0]]
    for low, high in pairwise(forces):
        rising += [low + (high - low) * (i + 1) / (between + 1) for i in range(between)] + [high]
    return [tuple(rising)]


def _climb(unit: Any, forces: Sequence[float]) -> tuple[dict[float, Case], str]:
    found: dict[float, Case] = {}
    message = ""
    try:
        for k, result in pipeline.solve_unit(unit):
            if isinstance(result, CaseFailure):
                message = message or result.message
            else:
                found[forces[k]] = from_maps(result.values), int(result.values["maps/flags"])
    except Exception as error:  # whatever a case dies of is its result, as in a run
        message = f"{type(error).__name__}: {error}"
    return found, message


def from_maps(values: dict[str, Any], number: int = 0, score: str = "quality") -> FloatArray:
    """`QUANTITIES` of a case in a friction model, by default the curved one."""
    names = ("e_n", "f_x_max", "f_y_max", "tau_z_max", score)
    e_n, f_x, f_y, tau_z, volume = (float(values[f"maps/{name}"][number]) for name in names)
    return np.array([e_n, max(f_x, f_y), tau_z, volume])


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

    def factorise() -> None:
        Factors(pattern).destroy()

    return least_seconds(factorise)[0]
