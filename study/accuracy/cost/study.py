"""A cost study: what is measured in which order, within a limit of time, and the file that it is resumed from.

The file holds the measurements as columns, one row per case. A study has some hundred rows, so the whole file is
written anew after each measurement and renamed into place: a killed study keeps all that it measured.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.study.accuracy.cost.errors import KnobErrors, tables
from softjaw.study.accuracy.cost.judging import judge, solved
from softjaw.study.accuracy.cost.knobs import (
    EACH_ALONE,
    Knob,
    Level,
    Skipped,
    contact_knobs,
    expected_seconds,
    judging_knobs,
    weight,
    with_level,
)
from softjaw.study.accuracy.cost.measure import QUANTITIES, UNITS, Measured, calibration_seconds, measure, warm_up
from softjaw.study.case.probes import Probe
from softjaw.study.messages import OTHER_FILE, StudyError, beside
from softjaw.study.result import provenance
from softjaw.study.result.guarded import GuardedFile, opened
from softjaw.study.run.progress import duration
from softjaw.study.scene import Scene

FIRST_GUESS = 2e-8  # seconds of one force over `weight`, before anything is measured
PROGRAM, KIND, VERSION = "softjaw", "cost study", 2
TEXT = h5py.string_dtype("utf-8")
MEANING = {
    "setting": ("", "what tells settings apart: the values by which they differ from the scene, or knob and level"),
    "level": ("", "the setting in words"),
    "candidate": ("", "label of the grasp candidate"),
    "normal_force": ("N", "normal force per finger"),
    "e_n": (UNITS["e_n"], "eccentricity parameter max tau_z / (mu S) of the weaker finger, curved model"),
    "max_force": (UNITS["max_force"], "larger of max f_x and max f_y of the weaker finger, curved model"),
    "max_torque": (UNITS["max_torque"], "max tau_z of the weaker finger, curved model"),
    "quality": (UNITS["quality"], "volume of the grasp wrench space"),
    "flags": ("", "flags of the case, as in a result file"),
    "cpu_seconds": ("s", "CPU time of one case, the least of the repeats"),
    "own_seconds": ("s", "part of it that the knob itself takes, where that is not the contact solve"),
    "repeats": ("", "how often it was measured"),
    "message": ("", "why there are no values"),
}


@dataclass
class CostStudy:
    """What was measured for one scene, on one machine.

    Attributes
    ----------
    scene, digest, title, scene_file : str
        The effective scene, and where it came from.
    base : str
        Setting of the scene as it is.
    candidates : list of str
        Labels of the probes.
    calibration : float
        CPU seconds of one factorisation of fixed size.
    machine : str
    measured : dict
        By setting and candidate.
    skipped : list of Skipped
        Levels that were not measured.
    """

    scene: str
    digest: str
    title: str = ""
    scene_file: str = ""
    base: str = ""
    candidates: list[str] = field(default_factory=list)
    calibration: float = np.nan
    machine: str = ""
    measured: dict[tuple[str, str], Measured] = field(default_factory=dict)
    skipped: list[Skipped] = field(default_factory=list)

    def add(self, found: Measured) -> None:
        """Keep a measurement."""
        self.measured[found.setting, found.candidate] = found

    def has(self, setting: str) -> bool:
        """Whether a setting was measured on every probe."""
        return all((setting, label) in self.measured for label in self.candidates)

    def of(self, setting: str) -> list[Measured]:
        """Measurements of a setting, one for each probe."""
        return [self.measured[setting, label] for label in self.candidates]

    def completed(
        self, setting: str, probes: Sequence[Probe], solve: Callable[[Probe], Measured], after: Callable[[], Any] = bool
    ) -> list[Measured]:
        """Measurements of a setting on some probes; what is not there is solved, kept and followed by ``after()``."""
        for probe in probes:
            if (setting, probe.label) not in self.measured:
                self.add(solve(probe))
                after()
        return [self.measured[setting, probe.label] for probe in probes]

    @property
    def spent(self) -> float:
        """CPU time of all measurements [s]."""
        return sum(m.spent for m in self.measured.values())


TEXTS = ("setting", "level", "candidate", "message")  # of the columns
HEADER = ("scene", "digest", "title", "scene_file", "base", "calibration", "machine")


def save(path: Path, study: CostStudy) -> None:
    """Write the study; raise `StudyError` where that cannot be done."""
    rows = [
        (m.setting, m.what, m.candidate, force, *values, flags, m.seconds, m.own, m.repeats, m.message)
        for m in study.measured.values()
        for force, values, flags in zip(m.forces, m.values, m.flags, strict=True)
    ]
    columns = zip(*rows, strict=True) if rows else [()] * len(MEANING)
    with beside(path, folders=True) as part, h5py.File(part, "w") as file:
        file.attrs.update(program=PROGRAM, kind=KIND, version=VERSION)
        file.attrs.update({name: getattr(study, name) for name in HEADER})
        file.attrs["calibration_meaning"] = "CPU seconds of one sparse factorisation of fixed size on this machine"
        file.create_dataset("candidates", data=np.array(study.candidates, object), dtype=TEXT)
        for (name, (units, meaning)), values in zip(MEANING.items(), columns, strict=True):
            # HDF5 compares checksums whenever numbers are read; texts of variable length have none
            kind = {"dtype": TEXT} if name in TEXTS else {"dtype": "<f8", "fletcher32": bool(rows) or None}
            data = np.array(values, object if name in TEXTS else float)
            made = file.create_dataset(f"measurements/{name}", data=data, **kind)
            made.attrs.update(units=units, long_name=meaning)
        for name in vars(Skipped("", "", "")):
            values = np.array([getattr(s, name) for s in study.skipped], object)
            file.create_dataset(f"skipped/{name}", data=values, dtype=TEXT)


def load(path: Path) -> CostStudy:
    """Read a study; raise `StudyError` if the file is none."""

    def make(file: GuardedFile) -> CostStudy:
        try:
            return _read(path, file)
        finally:
            file.close()

    return opened(path, "cost study", make, lambda study: None)


def _read(path: Path, file: GuardedFile) -> CostStudy:
    found = file.attributes()
    if (found.get("kind"), found.get("version")) != (KIND, str(VERSION)):
        raise StudyError(OTHER_FILE, f"{path}: not a cost study of this version; choose another file with -o")
    header = {name: str(found[name]) for name in HEADER}
    study = CostStudy(**{**header, "calibration": float(header["calibration"])}, candidates=file.texts("candidates"))
    skipped = zip(*(file.texts(f"skipped/{name}") for name in ("knob", "level", "reason")), strict=True)
    study.skipped = [Skipped(*texts) for texts in skipped]
    read = {name: _column(file, name) for name in MEANING}
    if len({len(values) for values in read.values()}) != 1:
        raise ValueError("its columns are not equally long")
    rows: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(zip(read["setting"], read["candidate"], strict=True)):
        rows.setdefault(key, []).append(i)
    for (setting, candidate), own in rows.items():
        level, message = (read[name][own[0]] for name in ("level", "message"))
        seconds, part, repeats = (float(read[name][own[0]]) for name in ("cpu_seconds", "own_seconds", "repeats"))
        values = np.column_stack([read[name][own] for name in QUANTITIES])
        study.add(Measured(setting, level, candidate, read["normal_force"][own], values, seconds, part, int(repeats),
                           message, read["flags"][own]))  # fmt: skip
    return study


def _column(file: GuardedFile, name: str) -> Any:
    """Texts, or numbers ``(rows,)``."""
    path = f"measurements/{name}"
    if name in TEXTS:
        return file.texts(path)
    found = file.plain(path)
    if found.ndim != 1 or found.dtype.kind != "f":
        raise ValueError(f"{path} is no list of numbers")
    return file.values(found)


# --- what is measured -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Task:
    """A setting to be measured on every probe; a knob of the contact has a ``level``, others have not."""

    knob: str
    name: str
    setting: str
    level: Level | None
    weight: float


def plain(scene: Scene) -> Scene:
    """The scene without its sweep and its target: what the settings are compared with."""
    return scene.with_values({"accuracy.e_n": None, "accuracy.cost_file": None})


def setting_of(scene: Scene, level: Level) -> str:
    """What tells a level's setting from others: the values by which it differs from the scene."""
    changed = {key: value for key, value in level.values if not same(value, value_of(scene, key))}
    between = {"between": level.between} if level.between else {}
    return json.dumps(changed | between, sort_keys=True)


def value_of(scene: Scene, key: str) -> Any:
    """Value of a dotted key of a scene."""
    section, _, name = key.partition(".")
    return getattr(getattr(scene, section), name)


def same(one: Any, other: Any) -> bool:
    """Whether two values of a key are the same; lists and tuples are alike."""
    plain_values = [tuple(v) if isinstance(v, list | tuple) else v for v in (one, other)]
    return plain_values[0] == plain_values[1]


BASE = "{}"  # the setting of the scene as it is


@dataclass(frozen=True)
class Costs:
    """The knobs of a scene and how their settings are called."""

    scene: Scene
    knobs: tuple[Knob, ...]
    skipped: tuple[Skipped, ...]
    judging: dict[str, list[str]]

    @cached_property
    def settings(self) -> dict[tuple[str, str], str]:
        """Settings by knob and level."""
        return {(k.name, v.name): setting_of(self.scene, v) for k in self.knobs for v in k.levels}

    @cached_property
    def tasks(self) -> list[Task]:
        """Everything to be measured, each setting once, the scene's own first."""
        found: dict[str, Task] = {}
        base = Level("as in the scene")
        for knob, level in [("", base), *((k.name, v) for k in self.knobs for v in k.levels)]:
            setting = setting_of(self.scene, level)
            load = weight(with_level(self.scene, level)) * {0: 1, EACH_ALONE: 1.5}.get(level.between, level.between)
            found.setdefault(setting, Task(knob, level.name, setting, level, load))
        for name, levels in self.judging.items():
            found |= {f"{name}: {v}": Task(name, v, f"{name}: {v}", None, np.nan) for v in levels}
        return list(found.values())

    def errors(self, study: CostStudy) -> list[KnobErrors]:
        """What a study says of every knob."""
        return tables(study, self.knobs, self.settings, self.judging)


def costs(scene: Scene, with_judging: bool = True) -> Costs:
    """The knobs of a scene."""
    own = plain(scene)
    knobs, skipped = contact_knobs(own)
    return Costs(own, tuple(knobs), tuple(skipped), judging_knobs(own) if with_judging else {})


def new_study(scene: Scene, found: Sequence[Probe], title: str, scene_file: str) -> CostStudy:
    """An empty study of a scene on this machine."""
    own = plain(scene)
    machine = f"{provenance.cpu()}, {provenance.program()}"
    return CostStudy(
        own.effective_toml(), own.digest, title, scene_file, BASE, [p.label for p in found], np.nan, machine
    )


class Measuring:
    """Measures what is missing in a study, the cheapest first, and saves after each."""

    def __init__(self, study: CostStudy, found: Sequence[Probe], what: Costs, path: Path | None,
                 say: Callable[[str], None]) -> None:  # fmt: skip
        self.study, self.probes, self.costs, self.path, self.say = study, found, what, path, say
        self._contacts: list[Any] = []

    def run(self, seconds: float) -> None:
        """Measure until everything is there or would take the study beyond so many CPU seconds."""
        todo = [task for task in self.costs.tasks if not self.study.has(task.setting)]
        self.study.skipped = list(self.costs.skipped)
        if todo:
            warm_up(self.probes[0])
        if np.isnan(self.study.calibration):
            self.study.calibration = calibration_seconds()
        while todo:
            base = [task for task in todo if task.setting == self.study.base]
            task = base[0] if base else min(todo, key=self.expected)
            if not base and self.study.spent + self.expected(task) > seconds:
                break
            todo.remove(task)
            self._measure(task)
        self.study.skipped += [Skipped(t.knob, t.name, self._too_long(t)) for t in todo]
        self._save()

    def expected(self, task: Task) -> float:
        """CPU time that a task will take, by the measured level of its knob that is nearest to it [s]."""
        cases = sum(len(p.forces) for p in self.probes)
        if task.level is None:
            return expected_seconds(task.knob, task.name) * cases
        known = [t for t in self.costs.tasks if t.level is not None and self.study.has(t.setting)]
        alike = [t for t in known if t.knob == task.knob] or [t for t in known if t.setting == self.study.base]
        if not alike:
            return FIRST_GUESS * task.weight * cases
        near = min(alike, key=lambda t: abs(np.log(t.weight / task.weight)))
        measured = np.mean([m.seconds for m in self.study.of(near.setting)])
        return float(measured * task.weight / near.weight * cases)

    def _too_long(self, task: Task) -> str:
        return f"would take about {duration(self.expected(task))}; raise --time-limit"

    def _measure(self, task: Task) -> None:
        level = task.level
        if level is not None:
            solve = lambda probe: replace(measure(task.setting, probe, level), what=task.name)  # noqa: E731
        else:
            contacts = dict(zip((p.label for p in self.probes), self._solved(), strict=False))
            if not contacts:
                return
            solve = lambda probe: judge(contacts[probe.label], task.knob, task.name)  # noqa: E731
        own = self.study.completed(task.setting, self.probes, solve, self._save)
        failed = sum(bool(m.message) for m in own)
        told = f", {failed} of {len(own)} candidates failed" if failed else ""
        knob = f"{task.knob}: " if task.knob else ""
        self.say(f"{knob}{task.name}: {np.mean([m.seconds for m in own]):.3g} s per case{told}")

    def _solved(self) -> list[Any]:
        """Contacts of all probes at the scene's own settings, solved once; of none where one fails."""
        if not self._contacts:
            try:
                self._contacts = [solved(p) for p in self.probes]
            except (ConvergenceError, CheckError) as error:
                self.say(f"friction, limit surfaces and scores are not measured: {error}")
        return self._contacts

    def _save(self) -> None:
        if self.path is not None:
            save(self.path, self.study)
