"""A cost study: which settings of a scene are compared, what was measured, and the file that a study resumes from.

The file holds the measurements as columns, one row per case. A study has some hundred rows, so the whole file is
written anew after each measurement and renamed into place: a killed study keeps all that it measured.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from softjaw.study.accuracy.parameters import (
    Level,
    Parameter,
    Skipped,
    contact_parameters,
    evaluation_parameters,
    value_of,
)
from softjaw.study.messages import OTHER_FILE, StudyError, beside
from softjaw.study.result import provenance
from softjaw.study.result.hdf5 import StoredFile, opened
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]
QUANTITIES = ("e_n", "max_force", "max_torque", "quality")
PROGRAM, KIND, VERSION = "softjaw", "cost study", 3
TEXT = h5py.string_dtype("utf-8")
COLUMNS = {  # of the file: unit and meaning; texts have no unit
    "setting": (None, "identifies a setting: the values by which it differs from the scene, or parameter and level"),
    "level": (None, "the setting in words"),
    "candidate": (None, "label of the grasp candidate"),
    "normal_force": ("N", "normal force per finger"),
    "e_n": ("m", "eccentricity parameter max tau_z / (mu S) of the weaker finger, CCM"),
    "max_force": ("N", "larger of max f_x and max f_y of the weaker finger, CCM"),
    "max_torque": ("N m", "max tau_z of the weaker finger, CCM"),
    "quality": ("", "volume of the grasp wrench space"),
    "flags": ("", "flags of the case, as in a result file"),
    "cpu_seconds": ("s", "CPU time of one case, the least of the repeats"),
    "own_seconds": ("s", "part of it that an evaluation parameter itself takes"),
    "repeats": ("", "how often it was measured"),
    "message": (None, "why there are no values"),
}
HEADER = ("scene", "digest", "title", "scene_file", "base", "calibration", "machine")
BASE = "{}"  # the setting of the scene as it is


@dataclass(frozen=True)
class Measured:
    """One probe at one setting.

    Parameters
    ----------
    setting, what : str
        What identifies the setting, and the setting in words.
    candidate : str
    forces : (k,) array
        Normal forces [N].
    values : (k, 4) array
        `QUANTITIES` of every force; NaN where there is none.
    seconds : float
        CPU time of one case, the least of the repeats [s].
    own : float
        The part of it that an evaluation parameter itself takes [s].
    repeats : int
    message : str
        Why values are missing.
    flags : (k,) array
        Flags of the cases; 0 where there is no value, and by default.
    """

    setting: str
    what: str
    candidate: str
    forces: FloatArray
    values: FloatArray
    seconds: float
    own: float = math.nan
    repeats: int = 1
    message: str = ""
    flags: FloatArray = field(default_factory=lambda: np.zeros(()))

    def __post_init__(self) -> None:
        object.__setattr__(self, "flags", np.broadcast_to(self.flags, np.shape(self.forces)))

    @property
    def spent(self) -> float:
        """CPU time that the measurement took, roughly [s]."""
        return self.repeats * len(self.forces) * (self.seconds if math.isnan(self.own) else self.own)


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
    calibration: float = math.nan
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

    @property
    def base_seconds(self) -> float:
        """CPU time of one case of the scene as it is, the mean over the probes [s]."""
        return float(np.mean([m.seconds for m in self.of(self.base)]))

    def completed(
        self, setting: str, probes: Sequence[Any], solve: Callable[[Any], Measured], after: Callable[[], Any] = bool
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


def new_study(scene: Scene, probes: Sequence[Any], title: str, scene_file: str) -> CostStudy:
    """An empty study of a scene on this machine."""
    own = plain(scene)
    machine = f"{provenance.cpu()}, {provenance.program()}"
    labels = [probe.label for probe in probes]
    return CostStudy(own.effective_toml(), own.digest, title, scene_file, BASE, labels, machine=machine)


# --- what is compared -------------------------------------------------------------------------------------------------


def plain(scene: Scene) -> Scene:
    """The scene without its sweep and its target: what the settings are compared with."""
    target: dict[str, Any] = {"accuracy.target": None}
    return scene.with_values(target)


def same(one: Any, other: Any) -> bool:
    """Whether two values of a key are the same; lists and tuples are alike."""
    first, second = (tuple(v) if isinstance(v, list | tuple) else v for v in (one, other))
    # A scene gives tuples where JSON and TOML give lists.
    return bool(first == second)


def setting_of(scene: Scene, level: Level) -> str:
    """What identifies a level's setting: the values by which it differs from the scene."""
    changed = {key: value for key, value in level.values if not same(value, value_of(scene, key))}
    between = {"between": level.between} if level.between else {}
    # Sorted, so that the same setting has the same text in every study.
    return json.dumps(changed | between, sort_keys=True)


@dataclass(frozen=True)
class Planned:
    """A setting to be measured on every probe; ``name`` of the parameter is empty for the scene as it is.

    ``evaluation`` says whether the contact is that of the scene as it is.
    """

    name: str
    level: Level
    setting: str
    evaluation: bool = False


@dataclass(frozen=True)
class Costs:
    """The parameters of a scene, and which of their levels the scene refuses."""

    scene: Scene
    parameters: tuple[Parameter, ...]
    skipped: tuple[Skipped, ...] = ()

    def setting(self, parameter: Parameter, level: Level) -> str:
        """What identifies a level's setting in a study."""
        return f"{parameter.name}: {level.name}" if parameter.evaluation else setting_of(self.scene, level)

    @cached_property
    def tasks(self) -> list[Planned]:
        """Everything to be measured, each setting once, the scene's own first."""
        # The scene's own first: every expected time is scaled from it.
        found = {BASE: Planned("", Level("as in the scene"), BASE)}
        for parameter in self.parameters:
            for level in parameter.levels:
                setting = self.setting(parameter, level)
                found.setdefault(setting, Planned(parameter.name, level, setting, parameter.evaluation))
        return list(found.values())


def costs(scene: Scene, with_evaluation: bool = True) -> Costs:
    """The parameters of a scene."""
    own = plain(scene)
    parameters, skipped = contact_parameters(own)
    more = evaluation_parameters(own) if with_evaluation else []
    return Costs(own, (*parameters, *more), tuple(skipped))


# --- file -------------------------------------------------------------------------------------------------------------


def save(path: Path, study: CostStudy) -> None:
    """Write the study; raise `StudyError` where that cannot be done."""
    rows = [
        (m.setting, m.what, m.candidate, force, *values, flags, m.seconds, m.own, m.repeats, m.message)
        for m in study.measured.values()
        for force, values, flags in zip(m.forces, m.values, m.flags, strict=True)
    ]
    columns = zip(*rows, strict=True) if rows else [()] * len(COLUMNS)
    with beside(path, folders=True) as part, h5py.File(part, "w") as file:
        file.attrs.update(program=PROGRAM, kind=KIND, version=VERSION)
        file.attrs.update({name: getattr(study, name) for name in HEADER})
        file.attrs["calibration_meaning"] = "CPU seconds of one sparse factorisation of fixed size on this machine"
        file.create_dataset("candidates", data=np.array(study.candidates, object), dtype=TEXT)
        for (name, (units, meaning)), values in zip(COLUMNS.items(), columns, strict=True):
            # HDF5 compares checksums whenever numbers are read; texts of variable length have none
            kind = {"dtype": TEXT} if units is None else {"dtype": "<f8", "fletcher32": bool(rows) or None}
            data = np.array(values, object if units is None else float)
            made = file.create_dataset(f"measurements/{name}", data=data, **kind)
            made.attrs.update(units=units or "", long_name=meaning)
        for i, column in enumerate(fields(Skipped)):
            texts = np.array([astuple(s)[i] for s in study.skipped], object)
            file.create_dataset(f"skipped/{column.name}", data=texts, dtype=TEXT)


def load(path: Path) -> CostStudy:
    """Read a study; raise `StudyError` if the file is none."""

    def make(file: StoredFile) -> CostStudy:
        try:
            return _read(path, file)
        finally:
            file.close()

    # Nothing to walk through: reading the study has read all of the file.
    return opened(path, "cost study", make)


def _read(path: Path, file: StoredFile) -> CostStudy:
    found = file.attributes()
    if (found.get("kind"), found.get("version")) != (KIND, str(VERSION)):
        raise StudyError(OTHER_FILE, f"{path}: not a cost study of this version; choose another file with -o")
    header: dict[str, Any] = {name: str(found[name]) for name in HEADER}
    study = CostStudy(**header | {"calibration": float(header["calibration"])}, candidates=file.texts("candidates"))
    skipped = (file.texts(f"skipped/{column.name}") for column in fields(Skipped))
    study.skipped = [Skipped(*texts) for texts in zip(*skipped, strict=True)]
    read = {name: _column(file, f"measurements/{name}", units is None) for name, (units, _) in COLUMNS.items()}
    # Columns of a damaged file would be paired wrongly without a word.
    if len({len(values) for values in read.values()}) != 1:
        raise ValueError("its columns are not equally long")
    rows: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(zip(read["setting"], read["candidate"], strict=True)):
        rows.setdefault(key, []).append(i)
    for (setting, candidate), own in rows.items():
        level, message, seconds, part, repeats = (
            read[name][own[0]] for name in ("level", "message", "cpu_seconds", "own_seconds", "repeats")
        )
        values = np.column_stack([read[name][own] for name in QUANTITIES])
        study.add(Measured(setting, level, candidate, read["normal_force"][own], values, float(seconds), float(part),
                           int(repeats), message, read["flags"][own]))  # fmt: skip
    return study


def _column(file: StoredFile, path: str, texts: bool) -> Any:
    """Texts, or numbers ``(rows,)``."""
    if texts:
        return file.texts(path)
    found = file.plain(path)
    # A file of unknown origin: what is not a list of numbers must not reach the arithmetic.
    if found.ndim != 1 or found.dtype.kind != "f":
        raise ValueError(f"{path} is not a list of numbers")
    return file.values(found)
