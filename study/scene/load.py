"""From the text of a scene file to a `Scene`: overrides, sweeps, and every problem at once with its line."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from softjaw.study.scene.checks import LEVELS, MOST_CASES
from softjaw.study.scene.grasp_checks import mesh_file
from softjaw.study.scene.model import (
    NAMES,
    SECTIONS,
    Option,
    Scene,
    checked_sections,
    keys_by_place,
    put,
    section_model,
)
from softjaw.study.scene.objects import Mesh, Section
from softjaw.study.scene.problems import Finding, KeyPath, Problem, SceneError, closest, key_text, shown, unknown_key
from softjaw.study.scene.text import flat, key_lines, parse_toml, read_text
from softjaw.study.show.tables.printable import shortened

ALTERNATIVES = (("stations_mm",), ("stations", "station_range_mm"), ("poses",))  # ways of giving candidates
NOT_SWEPT = {
    "object.shape": "write one scene per shape",
    "object.mesh": "write one scene per mesh",
    "object.name": "a name changes no result",
    "candidates.stations": "stations are an axis of the maps already",
    "friction.cor_grid": "it changes the size of the results",
    "accuracy.meshes": "it changes which maps there are",
    "accuracy.e_n": "mesh, steps and effects are chosen once, for all cases",
    "accuracy.cost_file": "mesh, steps and effects are chosen once, for all cases",
    "effects.wrench": "it changes what is stored",
    "object.mass_g": "it changes which maps there are; the safety factor is in proportion to 1 / mass",
    "limit_surface.samples": "it changes the size of the results",
    "limit_surface.wrench_samples": "it changes the size of the results",
}
NO_RESULT = ("output", "run")  # sections that change no result
MOST_GRID_POINTS = 10_000


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
    path, given = Path(path), dict[KeyPath, str]()
    data = parse_toml(text, str(path))
    if isinstance(data.get("sweep"), dict):
        data["sweep"] = flat(data["sweep"])  # dotted keys mean the same with and without quotes
    problems = _put_overrides(data, overrides, given)
    _fill_in(data, path)
    sections, wrong = checked_sections(data)
    if isinstance(sections.get("object"), Mesh) and check_files:
        wrong += mesh_file(sections["object"])
    wrong += _sweep_findings(data, wrong)
    scene = None
    if not problems and not wrong:
        scene = Scene(**{**sections, "sweep": {key: _axis(values) for key, values in sections["sweep"].items()}})
        if scene.cases > MOST_CASES:
            found, remedy = f"{scene.cases:,} cases", "split the study into several scenes"
            wrong.append(Finding(("candidates",), found, f"at most {MOST_CASES:,}", remedy))
    if wrong:
        lines = _lines(text)
        problems += [_located(f, str(path), lines, given) for f in wrong]
    if scene is None or problems:
        raise SceneError(sorted(problems, key=lambda p: (p.file != str(path), p.line or 0)))
    return scene


def _lines(text: str) -> dict[KeyPath, int]:
    """The first line of every key, section and list member, and of every section that is only implied."""
    lines: dict[KeyPath, int] = {}
    for path, line in key_lines(text):
        if path[0] == "sweep":
            names, members = [p for p in path[1:] if isinstance(p, str)], [p for p in path if isinstance(p, int)]
            lines.setdefault(("sweep", ".".join(names), *members), line)
        for n in range(1, len(path) + 1):
            lines.setdefault(path[:n], line)
    return lines


def _located(finding: Finding, file: str, lines: Mapping[KeyPath, int], given: Mapping[KeyPath, str]) -> Problem:
    """A finding with its place: an override, or the line of the nearest key that the file has."""
    key, above = key_text(finding.path), [finding.path[:n] for n in range(len(finding.path), 0, -1)]
    within = (path for path in given if path[: len(finding.path)] == finding.path and finding.path not in lines)
    override = next((given[path] for path in (*above, *within) if path in given), None)
    line = None if override else next((lines[path] for path in above if path in lines), None)
    where = f"--set {shortened(override)}" if override else file
    return Problem(where, line, key, finding.found, finding.expected, finding.remedy)


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
        if not isinstance(table, dict) or not isinstance(values, list) or not values or key in NOT_SWEPT:
            continue
        if (model := section_model(section, table)) and name in model.model_fields:
            table.setdefault(name, values[0])


def _axis(values: Sequence[Option]) -> tuple[Option, ...]:
    """Numbers rising, texts as they were given."""
    return tuple(v for v in values if isinstance(v, str)) or tuple(sorted(map(float, values)))


class OverrideError(ValueError):
    """An override that cannot be read: what was found, what was expected, what to do."""


def _put_overrides(data: dict[str, Any], overrides: Sequence[str], given: dict[KeyPath, str]) -> list[Problem]:
    """Put ``section.key=value`` texts into ``data``; ``given`` learns which key came from which text."""
    problems = []
    for text in overrides:
        try:
            _merge(data, _override(text), text, given)
        except OverrideError as error:
            problems.append(Problem(f"--set {shortened(text)}", None, "", *error.args))
    return problems


def _override(text: str) -> dict[str, Any]:
    key, equals, value = (part.strip() for part in text.partition("="))
    expected = "section.key=value, as in gripper.pad_width_mm=20"
    if not equals or not re.fullmatch(r'[\w-]+([.]([\w-]+|"[\w.-]+"))*', key, re.ASCII) or not text.isprintable():
        raise OverrideError(shown(text), expected, "write the key, `=` and the value without blanks")
    if "." not in key:
        if key in NAMES:
            raise OverrideError(f"the section {key} without a key", expected, f"write --set {key}.key=value")
        homes = [place for place, keys in keys_by_place().items() if key in keys]
        section = homes[0][1:].partition("]")[0] if homes else "section"
        raise OverrideError(f"the key {key} without its section", expected, f"write --set {section}.{text}")
    try:
        return tomllib.loads(f"{key} = {value}")
    except RecursionError:
        raise OverrideError("a value nested too deeply", "a value as in TOML", "flatten it") from None
    except ValueError:
        if re.fullmatch(r"[A-Za-z_./][\w./ -]*|[36]-D", value):  # shells take the quotes away
            return tomllib.loads(f'{key} = "{value}"')
    remedy = "write 0.8, [1, 2], true or '\"text\"'"
    raise OverrideError(f"the value {shown(value)}", "a value as in TOML", remedy) from None


def _merge(
    data: dict[str, Any], extra: Mapping[str, Any], text: str, given: dict[KeyPath, str], path: KeyPath = ()
) -> None:
    for key, value in extra.items():
        here = (*path, key)
        if here[0] == "sweep" and len(here) == 2:
            data.update(flat({key: value}))
            given.update({("sweep", k): text for k in flat({key: value})})
        elif isinstance(value, Mapping) and isinstance(data.setdefault(key, {}), dict):
            _merge(data[key], value, text, given, here)
        else:
            data[key] = value
            given[here] = text
            if path == ("candidates",):
                _drop_alternatives(data, key, given)


def _drop_alternatives(data: dict[str, Any], key: str, given: Mapping[KeyPath, str]) -> None:
    """Let an override of one way of giving candidates replace the others, unless they are overrides too."""
    for way in ALTERNATIVES if any(key in way for way in ALTERNATIVES) else ():
        if key not in way and not any(("candidates", name) in given for name in way):
            for name in way:
                data.pop(name, None)


def _sweep_findings(data: Mapping[str, Any], base: Sequence[Finding]) -> Iterator[Finding]:
    """Everything wrong with the sweep: its keys, its values one by one, and their combinations."""
    good = {}
    for key, values in _table(data, "sweep").items():
        found = list(_axis_findings(key, values, data))
        yield from found
        if not found:
            good[key] = values
    points = math.prod(map(len, good.values()))
    if points > MOST_GRID_POINTS:
        expected = f"at most {MOST_GRID_POINTS:,}"
        yield Finding(("sweep",), f"{points:,} combinations", expected, "sweep fewer keys or values")
    elif good:
        yield from _point_findings(data, good, base)


def _point_findings(
    data: Mapping[str, Any], axes: Mapping[str, Sequence[Any]], base: Sequence[Finding]
) -> Iterator[Finding]:
    """What is wrong at the points of a sweep that is not wrong without it; single values before combinations."""

    def new(values: Mapping[str, Any], known: Sequence[Finding]) -> list[Finding]:
        return [f for f in checked_sections(put(data, values))[1] if f not in known]

    first = {key: values[0] for key, values in axes.items()}
    at_first = new(first, base)
    wrong = [(next((k for k in axes if k == key_text(f.path)), next(iter(axes))), 0, f) for f in at_first]
    for key, values in axes.items():
        for i, value in enumerate(values[1:], start=1):
            wrong += [(key, i, f) for f in new({**first, key: value}, [*base, *at_first])]
    for key, i, f in wrong:
        value, place = shown(axes[key][i]), f"(value {i + 1} of {len(axes[key])})"
        own = key_text(f.path) == key
        found = f"{f.found} {place}" if own else f"{value} {place}, with which {key_text(f.path)} has {f.found}"
        yield Finding(("sweep", key, i), found, f.expected, f.remedy)
    failed, seen = {(key, axes[key][i]) for key, i, _ in wrong}, list(base)
    for values in product(*axes.values()) if len(axes) > 1 else ():
        together = dict(zip(axes, values, strict=True))
        for f in new(together, seen) if failed.isdisjoint(together.items()) else ():
            seen.append(f)
            names = " and ".join(f"{key} = {shown(value)}" for key, value in together.items())
            yield Finding(("sweep",), f"{names}, with which {key_text(f.path)} has {f.found}", f.expected, f.remedy)


def _axis_findings(key: str, values: Any, data: Mapping[str, Any]) -> Iterator[Finding]:
    """What is wrong with one axis of a sweep before any of its values is tried."""
    path, (section, _, name) = ("sweep", key), key.partition(".")
    model = section_model(section, _table(data, "object"))
    scalar = "a key with a single value, as in gripper.pad_width_mm"
    if model is None or name not in model.model_fields:
        every = [f"{s}.{k}" for s, m in {**SECTIONS, "object": model or Section}.items() for k in m.model_fields]
        near = closest(key, every)
        if model is not None and not near:
            f = unknown_key((section, name), None, list(model.model_fields), keys_by_place())
            yield Finding(path, f.found, f.expected, f.remedy)
        else:
            yield Finding(path, "an unknown key", scalar, f"did you mean `{near}`?" if near else "write section.key")
    elif key in NOT_SWEPT or section in NO_RESULT or _is_list(model, name):
        remedy = NOT_SWEPT.get(key, "remove it" if section in NO_RESULT else "sweep a key that takes one value")
        yield Finding(path, "a key that cannot be swept", scalar, remedy)
    elif key == "gripper.element" and _table(data, "output").get("patches", "all") == "all":
        expected = "the same number of faces in every case"
        yield Finding(path, "kinds of elements beside stored patches", expected, 'write output.patches = "none"')
    elif not isinstance(values, list | tuple) or not values:
        yield Finding(path, shown(values), "a list of values", f'write `"{key}" = [...]`')
    elif {type(v) for v in values} not in ({str}, {int}, {float}, {int, float}):
        yield Finding(path, shown(values), "single values of one kind", "write a list of numbers, or a list of texts")
    elif len(set(values)) < len(values):
        yield Finding(path, shown(values), "each value once", "remove the repetition")


def _table(data: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = data.get(name)
    return table if isinstance(table, Mapping) else {}


def _is_list(model: type[BaseModel], name: str) -> bool:
    schema = model.model_json_schema()["properties"][name]
    return any(s.get("type") == "array" for s in (schema, *schema.get("anyOf", ())))
