"""The scene: what is grasped, with what, where, how hard, and how exactly it is simulated."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError, model_validator

from softjaw.study.scene.checks import findings, value_warnings
from softjaw.study.scene.objects import SHAPES, Mesh, Object, Section
from softjaw.study.scene.problems import Finding, KeyPath, Problem, SceneError, closest, key_text, model_findings, shown
from softjaw.study.scene.sections import (
    Accuracy,
    Candidates,
    Effects,
    Friction,
    Gripper,
    LimitSurface,
    Load,
    Output,
    Run,
    Score,
    Task,
    Uncertainty,
)
from softjaw.study.scene.text import toml_text
from softjaw.study.show.tables.printable import UNPRINTABLE

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
        wrong = findings({name: getattr(self, name) for name in Scene.model_fields})
        if wrong:
            raise ValueError("; ".join(f"{key_text(f.path)}: found {f.found}, expected {f.expected}" for f in wrong))
        return self

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about values that are allowed but seldom meant."""
        return tuple(value_warnings(self.gripper, self.friction, self.load, self.accuracy))

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


NAMES = tuple(Scene.model_fields)
SECTIONS: dict[str, type[Section]] = {
    name: field.annotation
    for name, field in Scene.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, Section)
}


def section_model(name: str, table: Mapping[str, Any]) -> type[Section] | None:
    """The model of a section; that of ``[object]`` depends on its shape."""
    return SHAPES.get(str(table.get("shape"))) if name == "object" else SECTIONS.get(name)


def keys_by_place() -> dict[str, list[str]]:
    """Keys of every section, and of every shape of ``[object]``, by the way the place is written in messages."""
    shapes = {f'[object] with shape = "{name}"': list(model.model_fields) for name, model in SHAPES.items()}
    return {f"[{name}]": list(model.model_fields) for name, model in SECTIONS.items()} | shapes


def put(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with the values of dotted keys put in, and without a sweep."""
    tables = {name: dict(table) for name, table in data.items() if isinstance(table, Mapping) and name != "sweep"}
    for key, value in values.items():
        section, _, name = key.partition(".")
        tables.setdefault(section, {})[name] = value
    return {**data, **tables, "sweep": {}}


def checked_sections(data: Mapping[str, Any]) -> tuple[dict[str, Any], list[Finding]]:
    """The valid sections of a scene, and everything wrong with it but for its sweep and its files."""
    sections: dict[str, Any] = {}
    found = [_unknown_section(name, value) for name, value in data.items() if name not in NAMES]
    for name in NAMES:
        if name not in data and Scene.model_fields[name].is_required():
            remedy = f"add [{name}], as in jobs/smoke.toml"
            found.append(Finding((name,), "no such section", f"a section [{name}]", remedy))
        elif not isinstance(table := data.get(name, {}), Mapping):
            found.append(Finding((name,), shown(table), f"a section [{name}]", f"write [{name}] on a line of its own"))
        elif name in ("petsc", "sweep"):
            sections[name] = dict(table)
        elif (model := section_model(name, table)) is None:
            found.append(_unknown_shape(table))
        else:
            try:
                sections[name] = model.model_validate(table)
            except ValidationError as error:
                others = {place: keys for place, keys in keys_by_place().items() if keys != list(model.model_fields)}
                found.extend(model_findings(error, model, name, table, others))
    return sections, found + findings(sections) + list(_unprintable(data))


def _unprintable(value: Any, path: KeyPath = ()) -> Iterator[Finding]:
    """Texts and keys that a terminal would obey, or that would break lines wherever they are shown."""
    if isinstance(value, str) and (UNPRINTABLE.search(value) or "\n" in value or "\t" in value):
        yield Finding(path, shown(value), "text without control characters", "remove them")
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            if UNPRINTABLE.search(key) or "\n" in key:
                yield Finding(path, f"the key {shown(key)}", "a key without control characters", "remove them")
            else:
                yield from _unprintable(inner, (*path, key))
    elif isinstance(value, list | tuple):
        for index, inner in enumerate(value):
            yield from _unprintable(inner, (*path, index))


def _unknown_section(name: str, value: Any) -> Finding:
    homes = [place for place, keys in keys_by_place().items() if name in keys]
    expected = f"one of {', '.join(f'[{n}]' for n in NAMES)}"
    if near := closest(name, NAMES):
        return Finding((name,), "an unknown section", expected, f"did you mean [{near}]?")
    kind = "an unknown section" if isinstance(value, Mapping) else "a key outside of any section"
    return Finding((name,), kind, expected, f"it belongs to {homes[0]}" if homes else "remove it")


def _unknown_shape(table: Mapping[str, Any]) -> Finding:
    shape, path, expected = table.get("shape"), ("object", "shape"), f"one of {', '.join(map(shown, SHAPES))}"
    if shape is not None:
        near = closest(shape, list(SHAPES)) if isinstance(shape, str) else None
        return Finding(path, shown(shape), expected, f'did you mean "{near}"?' if near else "choose one of these")
    fits = {name: sum(key in model.model_fields for key in table) for name, model in SHAPES.items()}
    likely = max(fits, key=lambda name: fits[name])
    return Finding(path, "nothing", expected, f'add `shape = "{likely}"` to [object]')


@lru_cache(maxsize=16)
def _stamped_digest(file: str, _stamp: tuple[int, int]) -> str:
    with Path(file).open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _file_digest(file: str) -> str:
    """SHA-256 of a file's bytes, computed again when the file changes."""
    status = Path(file).stat()
    return _stamped_digest(file, (status.st_mtime_ns, status.st_size))
