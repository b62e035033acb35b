"""The scene: what is grasped, with what, where, how hard, and how exactly it is simulated."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError, model_validator

from softjaw.study.scene.grasps import OF_EVERY_KIND, Candidates
from softjaw.study.scene.loader import Loader, SectionOrLoader
from softjaw.study.scene.objects import SHAPES, Mesh, Object
from softjaw.study.scene.problems import Finding, SceneError, closest, shown
from softjaw.study.scene.section import SceneSection, model_findings
from softjaw.study.scene.sections import (
    Accuracy,
    Effects,
    Friction,
    Gripper,
    LimitSurfaceKeys,
    Output,
    Run,
    ScoreKeys,
    TaskKeys,
    Uncertainty,
    petsc_findings,
)
from softjaw.study.scene.text import toml_text

Option = str | int | float | bool
WATCHING = ("monitor", "view", "converged_reason")  # PETSc options that only print
JOINT: tuple[tuple[Callable[..., Iterator[Finding]], tuple[str, ...]], ...] = (
    # what several sections must satisfy together: the rule, and its sections, the one at fault first
    (Effects.object_findings, ("effects", "object")),
    (Friction.used_findings, ("friction", "effects")),
    (Effects.surface_findings, ("effects", "limit_surface")),
    (Gripper.symmetry_findings, ("gripper", "effects")),
    (Gripper.support_findings, ("gripper", "effects", "accuracy")),
    (Candidates.findings_on, ("candidates", "object")),
    (Candidates.pose_findings, ("candidates", "object", "gripper")),
    (lambda s, c: c.unknown_names("wrench_samples", s.wrench_samples), ("limit_surface", "candidates")),
    (lambda u, c: c.unknown_names("probes", u.probes), ("uncertainty", "candidates")),
    (Uncertainty.input_findings, ("uncertainty", "object", "friction", "sweep")),
    (petsc_findings, ("petsc",)),
)


def _optional(model: type[SceneSection]) -> Any:
    """A section that may be left out."""
    return Field(default_factory=model)


class Scene(SceneSection, metaclass=Loader):
    """A whole study as one frozen record. Keys are those of the file; properties without the unit are in SI units."""

    object: Object
    gripper: Gripper = _optional(Gripper)
    friction: Friction = _optional(Friction)
    candidates: Candidates
    load: SectionOrLoader = Field(...)  # or the function of the class would be its default
    limit_surface: LimitSurfaceKeys = _optional(LimitSurfaceKeys)
    score: ScoreKeys = _optional(ScoreKeys)
    task: TaskKeys = _optional(TaskKeys)
    effects: Effects = _optional(Effects)
    accuracy: Accuracy = _optional(Accuracy)
    uncertainty: Uncertainty = _optional(Uncertainty)
    output: Output = _optional(Output)
    run: Run = _optional(Run)
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
            raise _scene_error(wrong)
        return self

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about values that are allowed but seldom meant."""
        return tuple(self._warnings())

    def _warnings(self) -> Iterator[str]:
        mu, g, force = self.friction.mu, self.gripper, self.load.normal_force[-1]
        if mu > 2:
            yield f"friction.mu = {mu:g} is large: foam on plastic has about 0.8, and the paper's highest is 2"
        strain = force / (g.pad_length * g.pad_width) / g.shear_modulus
        if strain > 2:
            area = f"{g.pad_length_mm * g.pad_width_mm:g} mm^2"
            yield (
                f"load.normal_force_n = {force:g} N on {area} is a mean pressure of {strain:.2g} times the pad's shear"
                " modulus: cases may not converge"
            )
        walled = getattr(self.object, "wall", None) is not None
        if self.accuracy.target is not None and walled and self.effects.object != "rigid":
            yield "accuracy.target refines cases on rigid objects alone: on a simulated wall there are two meshes"
        if g.poisson_ratio > 0.45 and g.element == "hex8":
            yield f'gripper.poisson_ratio = {g.poisson_ratio:g} makes hex8 elements too stiff: use element = "hex27"'

    @property
    def sampled(self) -> tuple[int, ...]:
        """Numbers of the candidates whose sampled wrenches are stored, rising."""
        names = self.limit_surface.wrench_samples
        if isinstance(names, str):
            return tuple(range(self.candidates.total)) if names == "all" else ()
        return tuple(sorted(self.candidates.numbers(names)))

    @property
    def axis_symmetry(self) -> int:
        """Order of the symmetry about the axis of all that a case depends on: the object and its weight."""
        sideways = (*(self.task.direction or (0.0, 0.0))[:2], *(self.task.centre_of_mass or (0.0, 0.0))[:2])
        # A weight off the axis makes angles differ that are alike for the object.
        return 1 if any(abs(v) > 1e-9 for v in sideways) else self.object.axis_symmetry

    @property
    def cases(self) -> int:
        """Number of cases: candidates x forces x points of the sweep."""
        return self.candidates.total * len(self.load.normal_force_n) * math.prod(map(len, self.sweep.values()))

    def effective(self) -> dict[str, Any]:
        """Every value in effect, defaults filled in, as the tables of a scene file."""
        data = self.model_dump(exclude_none=True)
        # Only the way that was chosen: a scene that gives both would be refused.
        if self.candidates.poses or self.candidates.sampler:
            way = ("poses",) if self.candidates.poses else ("sampler", "count", "seed")
            data["candidates"] = {key: v for key, v in data["candidates"].items() if key in (*way, *OF_EVERY_KIND)}
        else:
            for key in ("poses", "count", "seed"):
                del data["candidates"][key]
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
            # By content: a mesh that was moved or copied is the same one.
            data["object"]["mesh"] = _file_digest(self.object.mesh)
        if self.candidates.poses:
            data["candidates"] = [(p.point_mm, p.approach, p.long_side) for p in self.candidates.poses]
        else:
            where = self.candidates
            data["candidates"] = [where.station_values_mm, where.angles_deg, where.roll_deg]
        # Options that only watch the solver change no result.
        data["petsc"] = {k: v for k, v in self.petsc.items() if not any(word in k for word in WATCHING)}
        data["sweep"] = list(self.sweep.items())  # the order of the axes counts
        return hashlib.sha256(json.dumps(data, sort_keys=True, allow_nan=False).encode()).hexdigest()

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any]) -> Scene:
        """The scene of tables like those of a file: sections with their keys, units in the keys.

        Parameters
        ----------
        tables : mapping of mappings
            A mesh that it names is looked for from the working directory.

        Raises
        ------
        SceneError
            With every problem found, each a sentence with its key. It is a `ValueError`.

        Examples
        --------
        >>> ball = {"shape": "sphere", "radius_mm": 30}
        >>> tables = {"object": ball, "candidates": {"stations_mm": [0]}, "load": {"normal_force_n": [1, 2]}}
        >>> Scene.from_dict(tables).object.radius
        0.03
        """
        from softjaw.study.scene.load import scene_of

        return scene_of(tables)

    def with_values(self, values: Mapping[str, Any] | None = None, /, **more: Any) -> Scene:
        """The scene with values of dotted keys put in, and without its sweep.

        Parameters
        ----------
        values, **more
            Values by dotted key, in the key's own unit: ``scene.with_values(**{"gripper.shear_modulus_kpa": 60})``.
            None takes a key out, which then has its default.

        Raises
        ------
        SceneError
            With everything that is wrong then. It is a `ValueError`.

        Examples
        --------
        >>> ball = {"shape": "sphere", "radius_mm": 30}
        >>> tables = {"object": ball, "candidates": {"stations_mm": [0]}, "load": {"normal_force_n": [1, 2]}}
        >>> Scene.from_dict(tables).with_values(**{"object.radius_mm": 20}).object.radius
        0.02
        """
        return Scene.of_tables(put(self.effective(), plain_tables({**(values or {}), **more})))

    @classmethod
    def of_tables(cls, tables: Mapping[str, Any]) -> Scene:
        """The scene of tables in which everything is filled in, as `effective` gives them, and without a sweep."""
        sections, wrong = checked_sections(tables)
        if wrong:
            raise _scene_error(wrong)
        return Scene(**sections)


NAMES = tuple(Scene.model_fields)
SECTIONS: dict[str, type[SceneSection]] = {
    name: field.annotation
    for name, field in Scene.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, SceneSection)
}


def section_model(name: str, table: Mapping[str, Any]) -> type[SceneSection] | None:
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


def plain_tables(tables: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of tables, or of values by dotted key, with lists and numbers instead of numpy's.

    Raises
    ------
    TypeError
        For what is no mapping by text.
    """
    if not isinstance(tables, Mapping) or not all(isinstance(key, str) for key in tables):
        raise TypeError(f"tables of a scene: found {shown(tables)}, expected a mapping of sections, {{'object': ...}}")
    return {key: _plain(value) for key, value in tables.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return plain_tables(value)
    if isinstance(value, list | tuple):
        return [_plain(member) for member in value]
    return value.tolist() if hasattr(value, "tolist") else value


def _scene_error(wrong: Iterable[Finding]) -> SceneError:
    return SceneError([f.at("scene", None) for f in wrong])


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
            found.append(_unknown_shape(table.get("shape")))
        else:
            try:
                sections[name] = model.model_validate(table)
            except ValidationError as error:
                others = {place: keys for place, keys in keys_by_place().items() if keys != list(model.model_fields)}
                found.extend(model_findings(error, model, name, table, others))
    return sections, found + findings(sections)


def findings(sections: Mapping[str, Any]) -> list[Finding]:
    """Everything wrong with sections that are valid one by one; a joint rule needs all of its sections."""
    found = [
        f.below(name) for name, part in sections.items() if isinstance(part, SceneSection) for f in part.findings()
    ]
    for rule, names in JOINT:
        if all(name in sections for name in names):
            found += [f.below(names[0]) for f in rule(*(sections[name] for name in names))]
    return found


def _unknown_section(name: str, value: Any) -> Finding:
    homes = [place for place, keys in keys_by_place().items() if name in keys]
    expected = f"one of {', '.join(f'[{n}]' for n in NAMES)}"
    if near := closest(name, NAMES):
        return Finding((name,), "an unknown section", expected, f"did you mean [{near}]?")
    kind = "an unknown section" if isinstance(value, Mapping) else "a key outside of any section"
    return Finding((name,), kind, expected, f"it belongs to {homes[0]}" if homes else "remove it")


def _unknown_shape(shape: Any) -> Finding:
    near = closest(shape, list(SHAPES)) if isinstance(shape, str) else None
    found, remedy = "nothing" if shape is None else shown(shape), f'did you mean "{near}"?' if near else "choose one"
    return Finding(("object", "shape"), found, f"one of {', '.join(map(shown, SHAPES))}", remedy)


@lru_cache(maxsize=16)
def _stamped_digest(file: str, _stamp: tuple[int, int]) -> str:
    with Path(file).open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _file_digest(file: str) -> str:
    """SHA-256 of a file's bytes, computed again when the file changes."""
    status = Path(file).stat()
    return _stamped_digest(file, (status.st_mtime_ns, status.st_size))
