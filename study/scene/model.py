"""The scene: what is grasped, with what, where, how hard, and how exactly it is simulated; how it is read."""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field, ValidationError, ValidationInfo, field_validator

from softjaw.fem.pad.halving import halved
from softjaw.study.grippers import filled_in
from softjaw.study.messages import Problem, closest, shortened, shown
from softjaw.study.scene.grasps import OF_EVERY_KIND, Candidates, GraspPose
from softjaw.study.scene.objects import SHAPES, Mesh, Object, Sections, SectionTable
from softjaw.study.scene.section import (
    Errors,
    KeyPath,
    Place,
    SceneError,
    SceneSection,
    lines_of,
    problems_of,
    refuse,
    wrong,
)
from softjaw.study.scene.sections import (
    UNCERTAIN,
    Accuracy,
    Effects,
    Friction,
    Gripper,
    LimitSurfaceKeys,
    Load,
    Run,
    ScoreKeys,
    TaskKeys,
    Uncertainty,
    petsc_rules,
)
from softjaw.study.scene.text import flat, parse_toml, quoted, read_text, toml_text

Option = str | int | float | bool
WATCHING = ("monitor", "view", "converged_reason")  # PETSc options that only print
WAYS = {  # of giving candidates, with what an override of each replaces
    "stations": ("poses", "sampled"), "stations_mm": ("stations", "poses", "sampled"),
    "poses": ("stations", "stations_mm", "angles_deg", "sampled"),
    "sampled": ("stations", "stations_mm", "angles_deg", "poses"),
}  # fmt: skip
NOT_SWEPT = (  # they change which cases or datasets a file has, or no number of a case
    "object.shape", "object.mesh", "object.unit", "object.name", "object.mass_g", "object.density", "gripper.preset",
    "candidates.stations", "candidates.stations_mm", "candidates.angles_deg", "candidates.poses", "candidates.sampled",
    "candidates.refine", "load.normal_force_n", "accuracy.meshes", "accuracy.target", "accuracy.target_of",
    "effects.wrench", "limit_surface.samples",
)  # fmt: skip
OF_FACES = ("gripper.element", "gripper.elements")  # keys that the number of stored faces depends on
OF_PRESET = {"gripper.preset", "gripper.pad_thickness_mm", "load.normal_force_n"}  # keys that a preset has a say in
NO_RESULT = ("run", "uncertainty")  # sections that change no result of a case
MOST_GRID_POINTS, MOST_CASES = 10_000, 1_000_000
OVERRIDE = "section.key=value with a value as in TOML, as in gripper.pad_width_mm=20 or object.name='\"cup\"'"
Rule = Callable[..., Errors]
JOINT: dict[str, tuple[tuple[Rule, tuple[str, ...]], ...]] = {
    # What a section must satisfy together with others, which come before it: the rules, and the other sections
    "effects": ((Effects.object_rules, ("object",)),),
    "gripper": ((Gripper.symmetry_rules, ("effects",)), (Gripper.plate_rules, ("effects",))),
    "friction": ((Friction.used_rules, ("effects",)),),
    "candidates": ((Candidates.rules_on, ("object",)),),
    "petsc": ((petsc_rules, ()),),
    "uncertainty": ((Uncertainty.spread_rules, UNCERTAIN),),
}


class Scene(SceneSection):
    """A whole study as one frozen record. Keys are those of the file; properties without the unit are in SI units."""

    model_config = ConfigDict(validate_default=True)
    # A section follows those that its rules in `JOINT` look at.
    object: Object
    effects: Effects = Field(default_factory=Effects)
    accuracy: Accuracy = Field(default_factory=Accuracy)
    gripper: Gripper = Field(default_factory=Gripper)
    friction: Friction = Field(default_factory=Friction)
    candidates: Candidates
    load: Load
    limit_surface: LimitSurfaceKeys = Field(default_factory=LimitSurfaceKeys)
    score: ScoreKeys = Field(default_factory=ScoreKeys)
    task: TaskKeys = Field(default_factory=TaskKeys)
    run: Run = Field(default_factory=Run)
    petsc: dict[str, Option] = Field(default_factory=dict, description="options of the contact solver, contact_...")
    sweep: dict[str, Annotated[tuple[str | int | float | tuple[int | float, ...], ...], Field(min_length=1)]] = Field(
        default_factory=dict,
        description='lists of values by dotted key, as in "object.semi_axis_b_mm" = [10, 20]',
        json_schema_extra={"additionalProperties": True},  # the dotted keys may stand without quotes
    )
    uncertainty: Uncertainty = Field(default_factory=Uncertainty)

    @field_validator("*")
    @classmethod
    def _joint_rules(cls, part: Any, info: ValidationInfo) -> Any:
        """Hold what sections must satisfy together; a rule needs all of its sections."""
        for rule, names in JOINT.get(str(info.field_name), ()):
            if all(name in info.data for name in names):
                refuse(rule(part, *(info.data[name] for name in names)))
        return part

    @field_validator("sweep")
    @classmethod
    def _sweep_rules(cls, sweep: dict[str, tuple[Any, ...]], info: ValidationInfo) -> dict[str, tuple[Any, ...]]:
        refuse(axis_rules(sweep, info.data))
        if len(info.data) == list(cls.model_fields).index("sweep"):  # every section is valid
            refuse(_point_rules(sweep, info.data))
        return {k: v if isinstance(v[0], str | tuple) else tuple(sorted(map(float, v))) for k, v in sweep.items()}

    def __hash__(self) -> int:
        """Of the sections that scenes differ in most; others hold tables, which have no hash."""
        return hash((self.object, self.gripper, self.candidates, self.load))

    def rules(self) -> Errors:
        """Samples of uncertain inputs that are scenes, and not more cases than a file can hold."""
        if self.uncertainty.spread:
            certain, samples = self.at({}).effective(), self.realisations[1:]
            for key, width in self.uncertainty.spread.items():
                values = [sample[key] for sample in samples]
                place = "uncertainty", "spread", key
                if key in self.sweep:
                    yield wrong(width, "a key that is not swept, too", *place)
                for value in {min(values), max(values)}:
                    if trouble := _trouble(certain, {key: value}):
                        yield wrong(width, f"a spread whose samples are valid, unlike {value:.3g} ({trouble})", *place)
                        break
        if self.cases > MOST_CASES:
            yield wrong(self.cases, f"at most {MOST_CASES:,} cases; split the study into several scenes", "candidates")

    @classmethod
    def from_file(cls, file: str | Path, overrides: Sequence[str] = ()) -> Scene:
        """The scene of a file.

        Parameters
        ----------
        file : path
            Scene as TOML; a mesh that it names is looked for from the file's folder.
        overrides : sequence of str
            ``section.key=value`` as behind ``--set``.

        Raises
        ------
        SceneError
            With every problem found, each a sentence with file, line and key. It is a `ValueError`.

        Examples
        --------
        >>> Scene.from_file("jobs/smoke.toml", ["gripper.pad_width_mm=20"]).gripper.pad_width
        0.02
        """
        return load_scene(file, overrides)

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
            load = f"{force:g} N on {g.pad_length_mm * g.pad_width_mm:g} mm^2"
            yield f"load.normal_force_n = {load}: {strain:.2g} times the shear modulus may not converge"
        if g.shear_modulus_kpa > 1e4:
            yield f"gripper.shear_modulus_kpa = {g.shear_modulus_kpa:g} is more than rubber has; foam: 8 to 80 kPa"
        where = self.candidates
        if where.refine and where.refine < (each := self.cases // max(where.total, 1)):
            yield f"candidates.refine = {where.refine} adds no grasp: one takes at least {each} cases"
        usual = Gripper()
        own_plate = (g.sheet_thickness_mm, g.sheet_modulus_gpa) != (usual.sheet_thickness_mm, usual.sheet_modulus_gpa)
        if g.tilt_stiffness_nm_per_rad is not None and own_plate:
            yield "gripper.tilt_stiffness_nm_per_rad: a backing plate that tilts is rigid, whatever sheet_* say"
        walled = getattr(self.object, "wall", None) is not None
        if self.accuracy.target is not None and walled and self.effects.object != "rigid":
            yield "accuracy.target refines cases on rigid objects alone: on a simulated wall there are two meshes"
        pairs, span = getattr(self.object, "wall_mm", None), self.object.spans_mm.get("z")
        if isinstance(pairs, tuple) and span:
            (low, high), first, last = span, pairs[0][0], pairs[-1][0]
            if min(last, high) - max(first, low) < 0.5 * (high - low):
                reach = f"pairs [z, thickness] from {first:g} to {last:g} mm on an object from {low:g} to {high:g} mm"
                yield f"object.wall_mm: {reach}; below and above them it stays as thick as there"
        if g.poisson_ratio > 0.45 and g.element == "hex8":
            instead = f'element = "hex27" with elements = {list(halved(g.elements))}'
            yield f"gripper.poisson_ratio = {g.poisson_ratio:g} makes hex8 elements too stiff: use {instead}"

    @property
    def axis_symmetry(self) -> int:
        """Order of the symmetry about the axis of all that a case depends on: the object and its weight."""
        sideways = (*(self.task.direction or (0.0, 0.0))[:2], *(self.task.centre_of_mass or (0.0, 0.0))[:2])
        # A weight off the axis makes angles differ that are alike for the object.
        return 1 if any(abs(v) > 1e-9 for v in sideways) else self.object.axis_symmetry

    @property
    def cases(self) -> int:
        """Number of cases: candidates x forces x points of the sweep x samples of uncertain inputs."""
        points = math.prod(map(len, self.sweep.values()))
        points *= 1 + self.uncertainty.samples if self.uncertainty.spread else 1
        return self.candidates.total * len(self.load.normal_force_n) * points

    @property
    def points(self) -> list[dict[str, Any]]:
        """Values by dotted key of every point that is solved: those of the sweep, and for each all `realisations`."""
        grid = [dict(zip(self.sweep, values, strict=True)) for values in product(*self.sweep.values())]
        return [point | inputs for point in grid for inputs in self.realisations]

    @property
    def realisations(self) -> list[dict[str, float]]:
        """Values of the uncertain inputs by dotted key: the scene's own, which are none, then those of the samples."""
        if not self.uncertainty.spread:
            return [{}]
        keys = {key: key.partition(".") for key in self.uncertainty.spread}
        means = {key: getattr(getattr(self, section), name) for key, (section, _, name) in keys.items()}
        return [{}, *self.uncertainty.inputs(means)]

    def effective(self) -> dict[str, Any]:
        """Every value in effect, defaults filled in, as the tables of a scene file."""
        data = self.model_dump(exclude_none=True)
        # Only the way that was chosen: a scene that gives both would be refused.
        if self.candidates.poses or self.candidates.sampled:
            way = ("poses",) if self.candidates.poses else ("sampled",)
            data["candidates"] = {key: v for key, v in data["candidates"].items() if key in (*way, *OF_EVERY_KIND)}
        else:
            del data["candidates"]["poses"]
        return data

    def effective_toml(self) -> str:
        """`effective` as a scene file; loading it gives an equal scene."""
        return "# Every value in effect, defaults included.\n" + toml_text(self.effective())

    @property
    def digest(self) -> str:
        """SHA-256 of what changes results, the mesh's bytes included; not names, paths, ``[run]``."""
        data = self.effective()
        del data["run"], data["object"]["name"]
        data["gripper"].pop("preset", None)  # whose keys stand beside it
        if not self.uncertainty.spread:  # files of scenes without it keep their digest
            del data["uncertainty"]
        if isinstance(self.object, Mesh):
            # By content: a mesh that was moved or copied is the same one.
            data["object"]["mesh"] = file_digest(self.object.mesh)
        if self.candidates.poses:
            data["candidates"] = [(p.point_mm, p.approach, p.long_side) for p in self.candidates.poses]
        else:
            data["candidates"] = [self.candidates.station_values_mm, self.candidates.angles_deg]
        data["candidates"] += [self.candidates.roll_deg, self.candidates.shift_mm]
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
        return _scene(plain_tables(tables), "", Path("scene"))

    def with_values(self, values: Mapping[str, Any] | None = None, /, **more: Any) -> Scene:
        """The scene with values of dotted keys put in, and without its sweep.

        Parameters
        ----------
        values, **more
            Values by dotted key or by section, in the key's own unit: ``{"gripper.shear_modulus_kpa": 60}``, or
            ``gripper={"shear_modulus_kpa": 60}``. None takes a key out, which then has its default.

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
        parts = {**(values or {}), **more}
        sections = {key: v for key, v in parts.items() if isinstance(v, Mapping) and key in Scene.model_fields}
        given = {key: value for key, value in parts.items() if key not in sections}
        given |= {f"{section}.{key}": v for section, table in sections.items() for key, v in table.items()}
        if "candidates.stations_mm" in given:  # which are not the first and the last of the scene's own number
            given.setdefault("candidates.stations", None)
        return Scene.of_tables(put(self.effective(), plain_tables(given)))

    def at(self, point: Mapping[str, Any]) -> Scene:
        """The scene at one of its `points`: without its sweep, and nothing is uncertain."""
        return self.with_values({**point, "uncertainty.spread": {}})

    def reread(self) -> Scene:
        """The scene with its object's file as it is now."""
        return self.model_copy(update={"object": type(self.object).model_validate(self.object.model_dump())})

    @classmethod
    def of_tables(cls, tables: Mapping[str, Any]) -> Scene:
        """The scene of tables in which everything is filled in, as `effective` gives them, and without a sweep."""
        return _scene(dict(tables), "", Path("scene"), check_files=False)


SECTIONS: dict[str, type[SceneSection]] = {
    name: field.annotation
    for name, field in Scene.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, SceneSection)
}


def models_of(shape: Any) -> dict[str, type[SceneSection]]:
    """The models of all sections by name; that of ``[object]`` depends on its shape."""
    return SECTIONS | ({"object": SHAPES[shape]} if shape in SHAPES else {})


def tables_of(data: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Keys of every section by its name, with those of the tables inside; those of the object by its shape."""
    shape = data.get("object")
    models = models_of(str(shape.get("shape")) if isinstance(shape, Mapping) else None)
    tables = {name: dict(models[name].model_fields if name in models else {}) for name in Scene.model_fields}
    if models.get("object") is Sections:
        tables["object"] |= SectionTable.model_fields
    tables["candidates"] |= GraspPose.model_fields
    return tables


def put(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with the values of dotted keys put in, and without a sweep."""
    tables = {name: dict(table) for name, table in data.items() if isinstance(table, Mapping) and name != "sweep"}
    for key, value in _matching_foam(tables.get("gripper", {}), values).items():
        section, _, name = key.partition(".")
        if not name:
            tables[section] = value  # no table, which is refused as in a file
            continue
        tables.setdefault(section, {})[name] = value
        if value is None:
            del tables[section][name]
    _preset_again(data.get("gripper", {}), tables, values)
    return {**data, **tables, "sweep": {}}


def _preset_again(before: Mapping[str, Any], tables: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Hold values put into tables to a gripper's preset: its pad where it is new, the opening that other foam leaves.

    Raises `SceneError`: there is no such preset, or it has not this force.
    """
    if OF_PRESET.isdisjoint(values):
        return
    given = {key.removeprefix("gripper.") for key in values}
    if "preset" not in given:
        without = {"gripper": {key: value for key, value in before.items() if key != "max_opening_mm"}}
        follows = not filled_in(without, Path()) and without["gripper"].items() >= before.items()
        given |= before.keys() - ({"max_opening_mm"} if follows else set())
    if trouble := filled_in(tables, Path(), given):
        key, actual, expected = trouble
        raise SceneError([Problem("scene", None, key, shown(actual), expected, "")])


def _matching_foam(gripper: Mapping[str, Any], values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Values with hyperfoam's terms as a new modulus scales them, without the modulus or the terms of another foam."""
    terms, modulus = gripper.get("terms_kpa"), values.get("gripper.shear_modulus_kpa")
    if "gripper.terms_kpa" in values:
        return {"gripper.shear_modulus_kpa": None, **values}
    if values.get("gripper.material", "hyperfoam") != "hyperfoam":
        return {"gripper.terms_kpa": None, **values}
    if not terms or not isinstance(modulus, int | float):
        return values
    scale = modulus / gripper["shear_modulus_kpa"]
    return {**values, "gripper.terms_kpa": [[exponent, scale * term] for exponent, term in terms]}


def plain_tables(tables: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of tables with lists and numbers instead of numpy's; `TypeError` for what is no mapping by text."""
    if not isinstance(tables, Mapping) or not all(isinstance(key, str) for key in tables):
        raise TypeError(f"tables of a scene: found {shown(tables)}, expected a mapping of sections, {{'object': ...}}")
    return json.loads(json.dumps(dict(tables), default=lambda v: getattr(v, "tolist", v.__str__)()))


@lru_cache(maxsize=16)
def _stamped_digest(file: str, _stamp: tuple[int, int]) -> str:
    with Path(file).open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def file_digest(file: str) -> str:
    """SHA-256 of a file's bytes, computed again when the file changes."""
    status = Path(file).stat()
    return _stamped_digest(file, (status.st_mtime_ns, status.st_size))


def load_scene(path: Path | str, overrides: Sequence[str] = (), check_files: bool = True) -> Scene:
    """The scene of a file, with ``section.key=value`` overrides put in; see `Scene.from_file` and `parse_scene`."""
    return parse_scene(read_text(Path(path)), path, overrides, check_files)


def parse_scene(
    text: str, path: Path | str = "scene.toml", overrides: Sequence[str] = (), check_files: bool = True
) -> Scene:
    """The scene of a text from the file ``path``; ``check_files = False`` for a stored one, whose mesh may be gone."""
    path = Path(path)
    return _scene(parse_toml(text, str(path)), text, path, overrides, check_files)


def _scene(
    data: dict[str, Any], text: str, path: Path, overrides: Sequence[str] = (), check_files: bool = True
) -> Scene:
    """The scene of tables that stand in a text, if any, of the file ``path``."""
    given: dict[KeyPath, Place] = {}
    overrides = (overrides,) if isinstance(overrides, str) else overrides
    problems, lines = put_overrides(data, overrides, given), lines_of(text)
    for table, name in ((data, "sweep"), (data.get("uncertainty"), "spread")):
        if isinstance(table, dict) and isinstance(table.get(name), dict):
            table[name] = flat(table[name])  # dotted keys mean the same with and without quotes

    def place(key: KeyPath) -> Place:
        """An override before the file, whose value it replaces; of the file the line of the nearest key."""
        above = [key[:n] for n in range(len(key), 0, -1)]
        spelled = [(k[0], *str(k[1]).split("."), *k[2:]) if k[0] == "sweep" and k[1:] else k for k in above]
        line = next((lines[k] for pair in zip(above, spelled, strict=True) for k in pair if k in lines), None)
        return next((given[k] for k in above if k in given), (str(path), line))

    if check_files and (trouble := filled_in(data, path.parent)):
        key, actual, expected = trouble
        problems.append(Problem(*place(tuple(key.split("."))), key, shown(actual), expected, ""))
    # Before the checks, which want to see what depends on the file's name and on the sweep.
    _fill_in(data, path)
    try:
        scene = Scene.model_validate(_tuples(data), context=check_files)
    except ValidationError as error:
        problems += problems_of(error, data, tables_of(data), place)
    if problems:
        # Problems of the file first and from top to bottom, as an editor goes through them.
        raise SceneError(sorted(problems, key=lambda p: (p.file != str(path), p.line or 0)))
    return scene


def _tuples(value: Any) -> Any:
    """A copy of tables with tuples instead of lists."""
    if isinstance(value, Mapping):
        return {key: _tuples(member) for key, member in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _fill_in(data: dict[str, Any], path: Path) -> None:
    """Fill in what depends on the scene file or on the sweep: place of the mesh, values that are swept."""
    shape, sweep = data.get("object"), data.get("sweep")
    if isinstance(shape, dict) and isinstance(shape.get("mesh"), str) and shape["mesh"]:
        # Relative to the scene, so that a run from any folder finds the mesh.
        shape["mesh"] = str((path.parent / shape["mesh"]).resolve())
    for key, values in sweep.items() if isinstance(sweep, dict) else ():
        section, _, name = key.partition(".")
        table = data.setdefault(section, {}) if section in SECTIONS else data.get(section)
        if not isinstance(table, dict) or not isinstance(values, list) or not values or key in NOT_SWEPT:
            continue
        if (model := models_of(str(table.get("shape"))).get(section)) and name in model.model_fields:
            # A swept key needs a value at which the sections can be checked; the modulus follows from given terms.
            if not (name == "shear_modulus_kpa" and "terms_kpa" in table):
                table.setdefault(name, values[0])


def put_overrides(data: dict[str, Any], overrides: Sequence[str], given: dict[KeyPath, Place]) -> list[Problem]:
    """Put ``section.key=value`` texts into ``data``; ``given`` gets the text behind every key."""
    problems = []
    for text in overrides:
        place, (named, _, written) = f"--set {shortened(text)}", text.partition("=")
        replaces = written.strip().startswith("{")  # such a table takes the place of another, keys of one are put in
        if replaces and named.strip() == "sweep":
            data["sweep"] = {}
        if (tables := _override(text)) is None:
            problems.append(Problem(place, None, "", shown(text), OVERRIDE, ""))
        for section, table in (tables or {}).items():
            if not isinstance(table, Mapping) or not isinstance(data.setdefault(section, {}), dict):
                data[section], given[(section,)] = table, (place, None)
                continue
            for key, value in (flat(table) if section == "sweep" else table).items():
                old = data[section].get(key)
                both = isinstance(old, dict) and isinstance(value, Mapping) and not replaces
                data[section][key] = {**old, **value} if both else value
                given[(section, key)] = place, None
                given.setdefault((section,), (place, None)) if len(data[section]) == 1 else None
                for way in WAYS.get(key, ()) if section == "candidates" else ():
                    if (section, way) not in given:
                        data[section].pop(way, None)
    return problems


def _override(text: str) -> dict[str, Any] | None:
    """The tables that an override represents; None where it is no TOML."""
    key, equals, value = (part.strip() for part in text.partition("="))
    # Shells take the quotes of a text away.
    for written in (value, quoted(value)) if value[:1] not in tuple("[{\"'") else (value,):
        with suppress(ValueError, RecursionError):
            # What a terminal would obey has no place in a scene, nor in the messages about it.
            if equals and text.isprintable():
                return tomllib.loads(f"{key} = {written}")
    return None


def axis_rules(sweep: Mapping[str, Sequence[Any]], sections: Mapping[str, Any]) -> Errors:
    """What is wrong with the axes of a sweep before any of their values is tried."""
    models = models_of(getattr(sections.get("object"), "shape", None))
    for key, values in sweep.items():
        section, _, name = key.partition(".")
        kinds = {type(v) if isinstance(v, str | tuple) else float for v in values}
        if section not in models or name not in models[section].model_fields:
            near = closest(key, [f"{s}.{k}" for s, m in models.items() for k in m.model_fields])
            yield wrong(key, f"a key with a single value, as `{near or 'gripper.pad_width_mm'}`", key)
        elif key in NOT_SWEPT or section in NO_RESULT:
            more = "places and forces are lists of their own, other keys want a scene for each value"
            yield wrong(values, f"a key that changes the numbers of cases alone; {more}", key)
        elif key in OF_FACES and "run" in sections and sections["run"].patches == "all":
            yield wrong(values, 'run.patches = "none" beside it, for faces that differ from case to case', key)
        elif len(set(values)) < len(values) or len(kinds) > 1:
            yield wrong(values, "numbers, texts or lists, each once", key)


def _point_rules(sweep: Mapping[str, Sequence[Any]], sections: Mapping[str, Any]) -> Errors:
    """What is wrong at the points of a sweep: single values, then the first combination."""
    data = {name: v.model_dump(exclude_none=True) if hasattr(v, "model_dump") else v for name, v in sections.items()}
    points = math.prod(map(len, sweep.values()))
    if points > MOST_GRID_POINTS:  # trying too many would take minutes
        yield wrong(points, f"at most {MOST_GRID_POINTS:,} combinations; sweep fewer keys or values")
        return
    alone = [(key, i, value) for key, values in sweep.items() for i, value in enumerate(values)]
    if errors := [wrong(v, trouble, key, i) for key, i, v in alone if (trouble := _trouble(data, {key: v}))]:
        yield from errors
        return
    for point in product(*sweep.values()) if len(sweep) > 1 else ():
        at = dict(zip(sweep, point, strict=True))
        if trouble := _trouble(data, at):
            yield wrong(", ".join(f"{key} = {shown(value)}" for key, value in at.items()), trouble)
            return


def _trouble(data: Mapping[str, Any], values: Mapping[str, Any]) -> str:
    """What is wrong with a scene with values put in; empty where nothing is."""
    try:
        Scene.of_tables(put(data, values))
    except SceneError as error:
        first = error.problems[0]
        return first.expected if first.key in values else f"{first.expected} in {first.key}"
    return ""
