"""From the text of a scene file to a `Scene`: overrides, sweeps, and every problem at once with its line."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

from softjaw.study.messages import shortened
from softjaw.study.scene.model import (
    NAMES,
    SECTIONS,
    Option,
    Scene,
    checked_sections,
    keys_by_place,
    plain_tables,
    put,
    section_model,
)
from softjaw.study.scene.objects import Mesh
from softjaw.study.scene.problems import Finding, KeyPath, Problem, RefusalError, SceneError, closest, key_text, shown
from softjaw.study.scene.section import SceneSection
from softjaw.study.scene.sections import LEVELS
from softjaw.study.scene.text import flat, key_lines, parse_toml, read_text

ALTERNATIVES = (("stations_mm",), ("stations", "station_range_mm"), ("poses",))  # ways of giving candidates
NOT_SWEPT = {
    "object.shape": "write one scene per shape",
    "object.mesh": "write one scene per mesh",
    "object.name": "a name changes no result",
    "candidates.stations": "stations are an axis of the maps already",
    "friction.cor_grid": "it changes the size of the results",
    "accuracy.meshes": "it changes which maps there are",
    "accuracy.target": "it changes which maps there are",
    "effects.wrench": "it changes what is stored",
    "object.mass_g": "it changes which maps there are; the safety factor is in proportion to 1 / mass",
    "limit_surface.samples": "it changes the size of the results",
    "limit_surface.wrench_samples": "it changes the size of the results",
}
Place = tuple[str, int | None]  # a file and a line of it, or an override
NO_RESULT = ("output", "run", "uncertainty")  # sections that change no result of a case
OVERRIDE = "section.key=value, as in gripper.pad_width_mm=20"
MOST_GRID_POINTS, MOST_CASES = 10_000, 1_000_000


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
    path = Path(path)
    return _scene(parse_toml(text, str(path)), text, path, overrides, check_files)


def scene_of(tables: Mapping[str, Any]) -> Scene:
    """The scene of tables as a file would have them; see `Scene.from_dict`."""
    return _scene(plain_tables(tables), "", Path("scene"))


def _scene(
    data: dict[str, Any], text: str, path: Path, overrides: Sequence[str] = (), check_files: bool = True
) -> Scene:
    """The scene of tables that stand in a text, if any, of the file ``path``."""
    given = dict[KeyPath, Place]()
    if isinstance(data.get("sweep"), dict):
        data["sweep"] = flat(data["sweep"])  # dotted keys mean the same with and without quotes
    problems = _put_overrides(data, overrides, given)
    # Before the checks, which want to see what depends on the file's name and on the sweep.
    _fill_in(data, path)
    sections, wrong = checked_sections(data)
    if isinstance(sections.get("object"), Mesh) and check_files:
        wrong += [f.below("object") for f in sections["object"].file_findings()]
    wrong += _sweep_findings(data, wrong)
    scene = None
    # Only a scene without problems can be built and its cases be counted.
    if not problems and not wrong:
        scene = Scene(**{**sections, "sweep": {key: _axis(values) for key, values in sections["sweep"].items()}})
        if scene.cases > MOST_CASES:
            found, remedy = f"{scene.cases:,} cases", "split the study into several scenes"
            wrong.append(Finding(("candidates",), found, f"at most {MOST_CASES:,}", remedy))
    if wrong:
        problems += _located(wrong, text, str(path), given)
    if scene is None or problems:
        # Problems of the file first and from top to bottom, as an editor goes through them.
        raise SceneError(sorted(problems, key=lambda p: (p.file != str(path), p.line or 0)))
    return scene


def _located(wrong: Sequence[Finding], text: str, file: str, given: Mapping[KeyPath, Place]) -> Iterator[Problem]:
    """The findings with their places: an override, or the line of the nearest key that the file has."""
    lines: dict[KeyPath, Place] = {}
    for path, line in key_lines(text).items():
        lines[path] = (file, line)
        if path[0] == "sweep":
            names, members = [p for p in path[1:] if isinstance(p, str)], [p for p in path if isinstance(p, int)]
            lines.setdefault(("sweep", ".".join(names), *members), (file, line))
    for path, place in given.items():  # a section that only overrides give
        for n in range(1, len(path)):
            lines.setdefault(path[:n], place)
    for found in wrong:
        above = [found.path[:n] for n in range(len(found.path), 0, -1)]
        # The longest path that has a place, and an override before the file: its value is the one in effect.
        where, number = next((places[p] for places in (given, lines) for p in above if p in places), (file, None))
        yield found.at(where, number)


def _fill_in(data: dict[str, Any], path: Path) -> None:
    """Fill in what depends on the scene file or on the sweep: result file, place of the mesh, values that are swept."""
    output, shape, sweep = data.setdefault("output", {}), data.get("object"), data.get("sweep")
    effects, surface = data.get("effects"), data.setdefault("limit_surface", {})
    # A level of the effect and the model name the same choice; what the scene gives itself stays.
    if isinstance(effects, dict) and isinstance(surface, dict) and (level := effects.get("limit_surface")) in LEVELS:
        surface.setdefault("model", LEVELS[level][0])
    if isinstance(output, dict):
        output.setdefault("file", f"results/{path.stem}.hdf")
    if isinstance(shape, dict) and isinstance(shape.get("mesh"), str) and shape["mesh"]:
        # Relative to the scene, so that a run from any folder finds the mesh.
        shape["mesh"] = str((path.parent / shape["mesh"]).resolve())
    for key, values in sweep.items() if isinstance(sweep, dict) else ():
        section, _, name = key.partition(".")
        table = data.get(section)
        if not isinstance(table, dict) or not isinstance(values, list) or not values or key in NOT_SWEPT:
            continue
        if (model := section_model(section, table)) and name in model.model_fields:
            # A swept key needs a value at which the sections can be checked.
            table.setdefault(name, values[0])


def _axis(values: Sequence[Option]) -> tuple[Option, ...]:
    """Numbers rising, texts as they were given."""
    return tuple(v for v in values if isinstance(v, str)) or tuple(sorted(map(float, values)))


def _put_overrides(data: dict[str, Any], overrides: Sequence[str], given: dict[KeyPath, Place]) -> list[Problem]:
    """Put ``section.key=value`` texts into ``data``; ``given`` gets the text behind every key."""
    problems = []
    for text in overrides:
        place = f"--set {shortened(text)}"
        try:
            _merge(data, _override(text), (place, None), given)
        except RefusalError as error:
            problems.append(Problem(place, None, "", *error.args))
    return problems


def _override(text: str) -> dict[str, Any]:
    key, equals, value = (part.strip() for part in text.partition("="))
    if equals and key in NAMES:
        raise RefusalError(f"the section {key} without a key", OVERRIDE, f"write --set {key}.key=value")
    if equals and key.isidentifier():
        home = next((place for place, keys in keys_by_place().items() if key in keys), "[section]")
        section = home[1:].partition("]")[0]
        raise RefusalError(f"the key {key} without its section", OVERRIDE, f"write --set {section}.{text}")
    # shells take the quotes of a text away
    for written in (value, json.dumps(value)) if value[:1] not in tuple("[{\"'") else (value,):
        with suppress(ValueError, RecursionError):
            # What a terminal would obey has no place in a scene, nor in the messages about it.
            if equals and text.isprintable():
                return tomllib.loads(f"{key} = {written}")
    remedy = "write the key, `=`, and a value as in TOML: 0.8, [1, 2], true or '\"text\"'"
    raise RefusalError(shown(text), OVERRIDE, remedy)


def _merge(
    data: dict[str, Any], extra: Mapping[str, Any], place: Place, given: dict[KeyPath, Place], path: KeyPath = ()
) -> None:
    for key, value in extra.items():
        here = (*path, key)
        if here[0] == "sweep" and len(here) == 2:
            data.update(flat({key: value}))
            given.update({("sweep", k): place for k in flat({key: value})})
        elif isinstance(value, Mapping) and isinstance(data.setdefault(key, {}), dict):
            _merge(data[key], value, place, given, here)
        else:
            data[key] = value
            given[here] = place
            if path == ("candidates",):
                _drop_alternatives(data, key, given)


def _drop_alternatives(data: dict[str, Any], key: str, given: Mapping[KeyPath, Place]) -> None:
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
    # Counted before any point is tried: checking too many would take minutes.
    if points > MOST_GRID_POINTS:
        expected = f"at most {MOST_GRID_POINTS:,}"
        yield Finding(("sweep",), f"{points:,} combinations", expected, "sweep fewer keys or values")
    elif good:
        yield from _point_findings(data, good, base)


def _point_findings(
    data: Mapping[str, Any], axes: Mapping[str, Sequence[Any]], base: Sequence[Finding]
) -> Iterator[Finding]:
    """What is wrong at the points of a sweep that is not wrong without it; single values before combinations."""
    seen, failed = set(base), set[tuple[str, int]]()
    points = product(*(range(len(values)) for values in axes.values()))
    # Points with fewer moved keys first, so that a single bad value is named before its combinations.
    for point in sorted(points, key=lambda p: sum(map(bool, p))):
        at = dict(zip(axes, point, strict=True))
        # A value that is wrong by itself would be reported again with every other value.
        if not failed.isdisjoint(at.items()):
            continue
        moved = [key for key, i in at.items() if i]
        for f in checked_sections(put(data, {key: axes[key][i] for key, i in at.items()}))[1]:
            if f in seen:
                continue
            seen.add(f)
            where = key_text(f.path)
            if len(moved) > 1:
                names = " and ".join(f"{key} = {shown(axes[key][i])}" for key, i in at.items())
                yield f._replace(path=("sweep",), found=f"{names}, with which {where} has {f.found}")
                continue
            key = moved[0] if moved else where if where in axes else next(iter(axes))
            failed.update([(key, at[key])] if moved else ())
            place = f"(value {at[key] + 1} of {len(axes[key])})"
            found = f"{shown(axes[key][at[key]])} {place}, with which {where} has {f.found}"
            yield f._replace(path=("sweep", key, at[key]), found=f"{f.found} {place}" if where == key else found)


def _axis_findings(key: str, values: Any, data: Mapping[str, Any]) -> Iterator[Finding]:
    """What is wrong with one axis of a sweep before any of its values is tried."""
    path, (section, _, name) = ("sweep", key), key.partition(".")
    model = section_model(section, _table(data, "object"))
    scalar = "a key with a single value, as in gripper.pad_width_mm"
    if model is None or name not in model.model_fields:
        every = [f"{s}.{k}" for s, m in {**SECTIONS, "object": model or SceneSection}.items() for k in m.model_fields]
        near = closest(key, every)
        yield Finding(path, "an unknown key", scalar, f"did you mean `{near}`?" if near else "write section.key")
    elif key in NOT_SWEPT or section in NO_RESULT:
        yield Finding(path, "a key that cannot be swept", scalar, NOT_SWEPT.get(key, "remove it"))
    elif key == "gripper.element" and _table(data, "output").get("patches", "all") == "all":
        expected = "the same number of faces in every case"
        yield Finding(path, "kinds of elements beside stored patches", expected, 'write output.patches = "none"')
    elif not isinstance(values, list | tuple) or not values:
        yield Finding(path, shown(values), "a list of values", f'write `"{key}" = [...]`')
    # Exact types, because True is an int and would be swept as 1.
    elif {type(v) for v in values} not in ({str}, {int}, {float}, {int, float}):
        yield Finding(path, shown(values), "single values of one kind", "write a list of numbers, or a list of texts")
    elif len(set(values)) < len(values):
        yield Finding(path, shown(values), "each value once", "remove the repetition")


def _table(data: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = data.get(name)
    return table if isinstance(table, Mapping) else {}
