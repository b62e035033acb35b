"""The ``[sweep]`` section: its keys, its values, and whether every combination of them is a scene."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from pydantic import BaseModel

from softjaw.study.scene.errors import Finding, closest, key_text, shown
from softjaw.study.scene.loading import SECTIONS, checked_sections, keys_by_place
from softjaw.study.scene.sentences import unknown_key
from softjaw.study.scene.shapes import SHAPES, Section

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


def put(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with the values of dotted keys put in, and without a sweep."""
    tables = {name: dict(table) for name, table in data.items() if isinstance(table, Mapping) and name != "sweep"}
    for key, value in values.items():
        section, _, name = key.partition(".")
        tables.setdefault(section, {})[name] = value
    return {**data, **tables, "sweep": {}}


def sweep_findings(data: Mapping[str, Any], base: Sequence[Finding]) -> Iterator[Finding]:
    """Everything wrong with the sweep: its keys, its values one by one, and their combinations."""
    good = {}
    for key, values in _table(data, "sweep").items():
        found = list(_axis_findings(key, values, data))
        yield from found
        if not found:
            good[key] = values
    if not good:
        return
    points = math.prod(map(len, good.values()))
    if points > MOST_GRID_POINTS:
        expected = f"at most {MOST_GRID_POINTS:,}"
        yield Finding(("sweep",), f"{points:,} combinations", expected, "sweep fewer keys or values")
        return
    first = {key: values[0] for key, values in good.items()}
    at_first = _new(data, first, base)
    wrong = [(next((k for k in good if k == key_text(f.path)), next(iter(good))), 0, f) for f in at_first]
    for key, values in good.items():
        for i, value in enumerate(values[1:], start=1):
            wrong += [(key, i, f) for f in _new(data, {**first, key: value}, [*base, *at_first])]
    for key, i, f in wrong:
        value, place = shown(good[key][i]), f"(value {i + 1} of {len(good[key])})"
        own = key_text(f.path) == key
        found = f"{f.found} {place}" if own else f"{value} {place}, with which {key_text(f.path)} has {f.found}"
        yield Finding(("sweep", key, i), found, f.expected, f.remedy)
    failed = {(key, good[key][i]) for key, i, _ in wrong}
    seen = set(base)
    for values in product(*good.values()) if len(good) > 1 else ():
        together = dict(zip(good, values, strict=True))
        if failed.isdisjoint(together.items()):
            for f in _new(data, together, list(seen)):
                seen.add(f)
                names = " and ".join(f"{key} = {shown(value)}" for key, value in together.items())
                yield Finding(("sweep",), f"{names}, with which {key_text(f.path)} has {f.found}", f.expected, f.remedy)


def _new(data: Mapping[str, Any], values: Mapping[str, Any], known: Sequence[Finding]) -> list[Finding]:
    return [f for f in checked_sections(put(data, values))[1] if f not in known]


def _axis_findings(key: str, values: Any, data: Mapping[str, Any]) -> Iterator[Finding]:
    """What is wrong with one axis of a sweep before any of its values is tried."""
    path, (section, _, name) = ("sweep", key), key.partition(".")
    model = SHAPES.get(str(_table(data, "object").get("shape"))) if section == "object" else SECTIONS.get(section)
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
