"""The file of a cost study: measurements as columns, one row per case, written anew after each and renamed into place.

A study has some hundred rows, so the whole file is written each time: a killed study keeps all that it measured.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from softjaw.study.accuracy.cost.knobs import Skipped
from softjaw.study.accuracy.cost.measure import QUANTITIES, UNITS, Measured
from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.result.guarded import GuardedFile, opened
from softjaw.study.writing import beside

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

    @property
    def spent(self) -> float:
        """CPU time of all measurements [s]."""
        return sum(m.spent for m in self.measured.values())


HEADER = ("scene", "digest", "title", "scene_file", "base", "calibration", "machine")


def save(path: Path, study: CostStudy) -> None:
    """Write the study; raise `StudyError` where that cannot be done."""
    with beside(path, folders=True) as part, h5py.File(part, "w") as file:
        file.attrs.update(program=PROGRAM, kind=KIND, version=VERSION)
        for name in HEADER:
            file.attrs[name] = getattr(study, name)
        file.attrs["calibration_meaning"] = "CPU seconds of one sparse factorisation of fixed size on this machine"
        file.create_dataset("candidates", data=np.array(study.candidates, object), dtype=TEXT)
        for name, values in _columns(study).items():
            units, meaning = MEANING[name]
            text = isinstance(values[0], str) if values else name in ("setting", "level", "candidate", "message")
            made = file.create_dataset(
                f"measurements/{name}",
                data=np.array(values, object if text else float),
                dtype=TEXT if text else "<f8",
                fletcher32=True if values and not text else None,  # what HDF5 then compares whenever it is read
            )
            made.attrs.update(units=units, long_name=meaning)
        for name in ("knob", "level", "reason"):
            values = [getattr(s, name) for s in study.skipped]
            file.create_dataset(f"skipped/{name}", data=np.array(values, object), dtype=TEXT)


def _columns(study: CostStudy) -> dict[str, list]:
    columns: dict[str, list] = {name: [] for name in MEANING}
    for m in study.measured.values():
        for force, values, flags in zip(m.forces, m.values, m.flags, strict=True):
            row = [m.setting, m.what, m.candidate, float(force), *map(float, values), float(flags), m.seconds,
                   m.own, float(m.repeats), m.message]  # fmt: skip
            for name, value in zip(MEANING, row, strict=True):
                columns[name].append(value)
    return columns


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
    columns = {name: f"measurements/{name}" for name in MEANING}
    texts = ("setting", "level", "candidate", "message")
    read = {name: file.texts(at) if name in texts else _numbers(file, at) for name, at in columns.items()}
    if len({len(values) for values in read.values()}) != 1:
        raise ValueError("its columns are not equally long")
    skipped = zip(*(file.texts(f"skipped/{name}") for name in ("knob", "level", "reason")), strict=True)
    study.skipped = [Skipped(*texts) for texts in skipped]
    _fill(study, read)
    return study


def _numbers(file: GuardedFile, path: str) -> np.ndarray:
    found = file.plain(path)
    if found.ndim != 1 or found.dtype.kind != "f":
        raise ValueError(f"{path} is no list of numbers")
    return file.values(found)


def _fill(study: CostStudy, read: dict) -> None:
    rows: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(zip(read["setting"], read["candidate"], strict=True)):
        rows.setdefault(key, []).append(i)
    for (setting, candidate), own in rows.items():
        first = own[0]
        values = np.column_stack([read[name][own] for name in QUANTITIES])
        study.add(
            Measured(setting, read["level"][first], candidate, read["normal_force"][own], values,
                     float(read["cpu_seconds"][first]), float(read["own_seconds"][first]),
                     int(read["repeats"][first]), read["message"][first], read["flags"][own])
        )  # fmt: skip
