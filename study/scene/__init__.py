"""The scene: what is grasped, with what, where, how hard, and how exactly it is simulated."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from softjaw.study.scene import checks as scene_checks
from softjaw.study.scene.errors import Finding, KeyPath, Problem, SceneError, key_text
from softjaw.study.scene.file_checks import mesh_file
from softjaw.study.scene.gripper_checks import warnings
from softjaw.study.scene.limit_surface_checks import LEVELS
from softjaw.study.scene.loading import checked_sections, flat, known_keys, with_overrides
from softjaw.study.scene.score_sections import LimitSurface, Score, Task
from softjaw.study.scene.sections import Accuracy, Candidates, Effects, Friction, Gripper, Load, Output, Run
from softjaw.study.scene.shapes import Mesh, Object, Section
from softjaw.study.scene.sweeps import NOT_SWEPT, put, sweep_findings
from softjaw.study.scene.text import key_lines, parse_toml, read_text, toml_text
from softjaw.study.scene.uncertainty_section import Uncertainty

Option = str | int | float | bool
WATCHING = re.compile(r"contact_.*(monitor|view|converged_reason)")  # PETSc options that only print


class Scene(Section):
    """A whole study as one frozen record. Keys are those of the file; properties without the unit are in SI units."""

    object: Object
    gripper: Gripper = Field(default_factory=Gripper)
    friction: Friction = Field(default_factory=Friction)
    candidates: Candidates
    load: Load
    limit_surface: LimitSurface = Field(default_factory=LimitSurface)
    score: Score = Field(default_factory=Score)
    task: Task = Field(default_factory=Task)
    effects: Effects = Field(default_factory=Effects)
    accuracy: Accuracy = Field(default_factory=Accuracy)
    uncertainty: Uncertainty = Field(default_factory=Uncertainty)
    output: Output = Field(default_factory=Output)
    run: Run = Field(default_factory=Run)
    petsc: dict[str, Option] = Field(default_factory=dict, description="options of the contact solver, contact_...")
    sweep: dict[str, tuple[Option, ...]] = Field(
        default_factory=dict,
        description='lists of values by dotted key, as in "object.semi_axis_b_mm" = [10, 20]',
        json_schema_extra={"additionalProperties": True},  # the dotted keys may stand without quotes
    )

    @model_validator(mode="after")
    def _consistent(self) -> Scene:
        """Hold what the sections must satisfy together, for scenes made in Python too."""
        wrong = scene_checks.findings({name: getattr(self, name) for name in Scene.model_fields})
        if wrong:
            raise ValueError("; ".join(f"{key_text(f.path)}: found {f.found}, expected {f.expected}" for f in wrong))
        return self

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about values that are allowed but seldom meant."""
        return tuple(warnings(self.gripper, self.friction, self.load, self.accuracy))

    @property
    def sampled(self) -> tuple[int, ...]:
        """Numbers of the candidates whose sampled wrenches are stored, rising."""
        wanted, labels = self.limit_surface.wrench_samples, self.candidates.labels
        if isinstance(wanted, str):
            return tuple(range(len(labels))) if wanted == "all" else ()
        return tuple(sorted({labels.index(w) if isinstance(w, str) else w for w in wanted}))

    @property
    def axis_symmetry(self) -> int:
        """Order of the symmetry about the axis of all that a case depends on: the object, and its weight if any."""
        if self.object.mass is None:
            return self.object.axis_symmetry
        sideways = (*self.task.weight_direction[:2], *(self.task.centre_of_mass or (0.0, 0.0))[:2])
        return 1 if any(abs(v) > 1e-9 for v in sideways) else self.object.axis_symmetry

    @property
    def cases(self) -> int:
        """Number of cases: candidates x forces x points of the sweep."""
        return self.candidates.count * len(self.load.normal_force_n) * math.prod(map(len, self.sweep.values()))

    def effective(self) -> dict[str, Any]:
        """Every value in effect, defaults filled in, as the tables of a scene file."""
        data = self.model_dump(exclude_none=True)
        if self.candidates.poses:
            data["candidates"] = {"poses": data["candidates"]["poses"]}
        else:
            del data["candidates"]["poses"]
        return data

    def effective_toml(self) -> str:
        """`effective` as a scene file; loading it gives an equal scene."""
        return "# Every value in effect, defaults included.\n" + toml_text(self.effective())

    @property
    def digest(self) -> str:
        """SHA-256 of what changes results, the mesh's bytes included; not names, paths, ``[output]``, ``[run]``."""
        data = self.effective()
        del data["output"], data["run"], data["object"]["name"]
        if not self.uncertainty.parts:  # files of scenes without it keep their digest
            del data["uncertainty"]
        if isinstance(self.object, Mesh):
            data["object"]["mesh"] = _file_digest(self.object.mesh)
        if self.candidates.poses:
            data["candidates"] = [(p.point_mm, p.approach, p.long_side) for p in self.candidates.poses]
        else:
            where = self.candidates
            data["candidates"] = [where.station_values_mm, where.angles_deg, where.roll_deg]
        data["petsc"] = {k: v for k, v in self.petsc.items() if not WATCHING.match(k)}
        data["sweep"] = list(self.sweep.items())  # the order of the axes counts
        return hashlib.sha256(json.dumps(data, sort_keys=True, allow_nan=False).encode()).hexdigest()

    def with_values(self, values: Mapping[str, Option]) -> Scene:
        """The scene with values of dotted keys put in and without a sweep; `SceneError` where that is no scene."""
        sections, wrong = checked_sections(put(self.effective(), values))
        if wrong:
            raise SceneError([Problem("scene", None, key_text(f.path), f.found, f.expected, f.remedy) for f in wrong])
        return Scene(**sections)


def load_scene(path: Path | str, overrides: Sequence[str] = ()) -> Scene:
    """The scene of a file, with ``section.key=value`` overrides put in.

    Raises
    ------
    SceneError
        With every problem found, each a sentence with file, line and key.
    """
    path = Path(path)
    return parse_scene(read_text(path), path, overrides)


def parse_scene(
    text: str, path: Path | str = "scene.toml", overrides: Sequence[str] = (), check_files: bool = True
) -> Scene:
    """The scene of a text that stands in the file ``path``.

    ``check_files = False`` leaves out whether a mesh exists, for a text kept in a result file.
    """
    path, lines, given = Path(path), dict[KeyPath, int](), dict[KeyPath, str]()
    data = parse_toml(text, str(path))
    key_lines(text, lines)
    _flatten_sweep(data, lines)
    problems = with_overrides(data, overrides, given)
    _fill_in(data, path)
    sections, wrong = checked_sections(data)
    if isinstance(sections.get("object"), Mesh) and check_files:
        wrong += mesh_file(sections["object"])
    wrong += sweep_findings(data, wrong)
    problems += [_located(f, str(path), lines, given) for f in wrong]
    if problems:
        raise SceneError(sorted(problems, key=lambda p: (p.file != str(path), p.line or 0)))
    scene = Scene(**{**sections, "sweep": {key: _axis(values) for key, values in sections["sweep"].items()}})
    if scene.cases > scene_checks.MOST_CASES:
        expected = f"at most {scene_checks.MOST_CASES:,}"
        many = Finding(("candidates",), f"{scene.cases:,} cases", expected, "split the study into several scenes")
        raise SceneError([_located(many, str(path), lines, given)])
    return scene


def _flatten_sweep(data: dict[str, Any], lines: dict[KeyPath, int]) -> None:
    """Let ``object.radius_mm = [...]`` in ``[sweep]`` mean the same with and without quotes."""
    if isinstance(data.get("sweep"), dict):
        data["sweep"] = flat(data["sweep"])
        for path in [p for p in lines if p[0] == "sweep"]:
            names = [str(part) for part in path[1:] if isinstance(part, str)]
            lines.setdefault(("sweep", ".".join(names), *(p for p in path if isinstance(p, int))), lines[path])


def _fill_in(data: dict[str, Any], path: Path) -> None:
    """Fill in what depends on the scene file or on the sweep: result file, place of the mesh, values that are swept."""
    output, shape, sweep = data.setdefault("output", {}), data.get("object"), data.get("sweep")
    effects, surface = data.get("effects"), data.setdefault("limit_surface", {})
    if isinstance(effects, dict) and isinstance(surface, dict) and (level := effects.get("limit_surface")) in LEVELS:
        surface.setdefault("model", LEVELS[level][0])
    if isinstance(output, dict):
        output.setdefault("file", f"results/{path.stem}.hdf")
    if isinstance(shape, dict) and isinstance(shape.get("mesh"), str) and shape["mesh"]:
        shape["mesh"] = str((path.parent / shape["mesh"]).resolve())
    for key, values in sweep.items() if isinstance(sweep, dict) else ():
        section, _, name = key.partition(".")
        table = data.get(section)
        if (
            isinstance(table, dict)
            and isinstance(values, list)
            and values
            and key not in NOT_SWEPT
            and name in known_keys(section, table)
        ):
            table.setdefault(name, values[0])


def _axis(values: Sequence[Option]) -> tuple[Option, ...]:
    """Numbers rising, texts as they were given."""
    return tuple(v for v in values if isinstance(v, str)) or tuple(sorted(map(float, values)))


def _located(finding: Finding, file: str, lines: Mapping[KeyPath, int], given: Mapping[KeyPath, str]) -> Problem:
    """A finding with its place: an override, or the line of the nearest key that the file has."""
    key, above = key_text(finding.path), [finding.path[:n] for n in range(len(finding.path), 0, -1)]
    within = (path for path in given if path[: len(finding.path)] == finding.path and finding.path not in lines)
    override = next((given[path] for path in (*above, *within) if path in given), None)
    line = None if override else next((lines[path] for path in above if path in lines), None)
    where = f"--set {override if len(override) < 80 else override[:76] + ' ...'}" if override else file
    return Problem(where, line, key, finding.found, finding.expected, finding.remedy)


@lru_cache(maxsize=16)
def _stamped_digest(file: str, _stamp: tuple[int, int]) -> str:
    with Path(file).open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _file_digest(file: str) -> str:
    """SHA-256 of a file's bytes, computed again when the file changes."""
    status = Path(file).stat()
    return _stamped_digest(file, (status.st_mtime_ns, status.st_size))
