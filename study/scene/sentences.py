"""Sentences about keys and values that do not fit a section's model, with what was probably meant."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

from softjaw.study.scene.errors import Finding, KeyPath, closest, key_text, shown
from softjaw.study.units import UNITS, split_unit

EXAMPLES = {
    "stations_mm": "[25, 50, 75]", "station_range_mm": "[25, 175]", "angles_deg": "[0, 90]", "size_mm": "[60, 40, 120]",
    "profile_mm": "[[0, 30], [50, 30], [80, 20], [100, 20]]", "normal_force_n": "[1, 2, 5]", "alpha": "[-2]",
    "shear_moduli_kpa": "[40]", "point_mm": "[0, 0, 20]", "approach": "[1, 0, 0]", "long_side": "[0, 0, 1]",
    "poses": "[{ point_mm = [0, 0, 20], approach = [1, 0, 0], long_side = [0, 0, 1] }]",
}  # fmt: skip
LATER_LEVELS = {"fingers": ("one",)}


def unknown_key(path: KeyPath, value: Any, keys: Sequence[str], elsewhere: Mapping[str, Sequence[str]]) -> Finding:
    """A key that no section model knows; ``elsewhere`` maps places (``[friction]``) to the keys they take."""
    key, table = str(path[-1]), key_text(path[:-1])
    stem, unit = split_unit(key)
    same = sorted((k for k in keys if split_unit(k)[0] == stem), key=lambda k: not split_unit(k)[1])
    homes = [place for place, theirs in elsewhere.items() if key in theirs]
    if same:
        remedy = f"the unit is part of the key, so write `{same[0]}{_converted(value, unit, split_unit(same[0])[1])}`"
    elif homes:
        remedy = f"it belongs to {homes[0]}"
    elif near := closest(key, keys):
        remedy = f"did you mean `{near}`?"
    else:
        remedy = "remove it"
    expected = f"one of {', '.join(keys)}" if remedy == "remove it" else f"a key of [{table}]"
    return Finding(path, "an unknown key", expected, remedy)


def _converted(value: Any, unit: str, target: str) -> str:
    """`` = value`` in the target's unit, where both units are known and measure the same kind of thing."""
    if not _is_number(value) or not unit or not target:
        return ""
    given, wanted = UNITS[unit], UNITS[target]
    return f" = {value * given.size / wanted.size:.10g}" if given.si == wanted.si else ""


def expectation(schema: Mapping[str, Any], key: str = "") -> str:
    """What a key takes, read off its JSON schema: kind, range, unit and description."""
    unit = split_unit(key)[1]
    text = _kind(schema) + (f" [{UNITS[unit].text}]" if unit else "")
    return f"{text} ({schema['description']})" if "description" in schema else text


def _kind(schema: Mapping[str, Any]) -> str:
    options = [_kind(s) for s in schema.get("anyOf", ()) if s.get("type") != "null"]
    if options:
        return " or ".join(options)
    if "const" in schema or "enum" in schema:
        values = [json.dumps(v) for v in schema.get("enum", [schema.get("const")])]
        return values[0] if len(values) == 1 else f"one of {', '.join(values)}"
    kind = schema.get("type")
    if kind in ("number", "integer"):
        bounds = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
        limits = " and ".join(f"{sign} {schema[name]:.10g}" for name, sign in bounds.items() if name in schema)
        return f"{'a whole number' if kind == 'integer' else 'a number'} {limits}".strip()
    if kind == "array":
        low, high = schema.get("minItems", 0), schema.get("maxItems")
        count = f"{low}" if low == high else f"{low} or more" if high is None else f"{low} to {high}"
        item = (schema.get("prefixItems") or [schema.get("items", {})])[0]
        each = f", each {_kind(item)}" if item.get("type") in ("number", "integer", "array") else ""
        return f"a list of {count}{each}"
    return {"string": "text", "boolean": "true or false"}.get(str(kind), "a table")


def model_findings(
    error: ValidationError, model: type[BaseModel], section: str, table: Any, elsewhere: Mapping[str, Sequence[str]]
) -> Iterator[Finding]:
    """What pydantic found wrong in one section, one finding per place in the file."""
    schema, seen = model.model_json_schema(), set()
    for entry in error.errors(include_url=False):
        path, value, owner = _walk(entry["loc"], table, schema)
        kind, key = entry["type"], str(path[-1]) if path else ""
        if path in seen or (kind == "too_short" and len(value) >= entry["ctx"]["min_length"]):
            continue  # a list whose members were refused is not also too short
        seen.add(path)
        full = (section, *path)
        if kind == "extra_forbidden":
            yield unknown_key(full, value, list(owner.get("properties", {})), elsewhere if len(path) == 1 else {})
        elif kind == "missing" and value is None:
            expected = expectation(owner["properties"][key], key)
            yield Finding(full, "nothing", expected, f"add `{key} = ...` to [{key_text(full[:-1])}]")
        else:
            name = next((str(p) for p in reversed(path) if isinstance(p, str)), "")
            expected = expectation(owner, name)
            yield Finding(
                full, shown(value), expected, _remedy(section, name, value, owner, schema.get("properties", {}))
            )


def _walk(loc: Sequence[str | int], table: Any, schema: dict[str, Any]) -> tuple[KeyPath, Any, dict[str, Any]]:
    """The part of a pydantic location that exists in the file, the value there, and the schema of that place.

    For an unknown or missing key the schema is that of the table around it.
    """
    path: list[str | int] = []
    definitions, value, here = schema.get("$defs", {}), table, schema
    for part in loc:
        if "$ref" in here:
            here = definitions[here["$ref"].rsplit("/", 1)[-1]]
        if isinstance(value, Mapping) and isinstance(part, str) and here.get("properties") is not None:
            path.append(part)
            value = value.get(part)
            if part not in here["properties"] or value is None:
                return tuple(path), value, here
            here = _given(here["properties"][part])
        elif isinstance(value, list | tuple) and isinstance(part, int) and part < len(value):
            path.append(part)
            value = value[part]
            here = here["prefixItems"][part] if "prefixItems" in here else here.get("items", {})
    return tuple(path), value, here


def _given(schema: dict[str, Any]) -> dict[str, Any]:
    """The schema of a key that is given, where leaving it out is allowed too."""
    options = [s for s in schema.get("anyOf", ()) if s.get("type") != "null"]
    return schema | options[0] | {"anyOf": ()} if len(options) == 1 else schema


def _remedy(section: str, key: str, value: Any, schema: Mapping[str, Any], siblings: Any) -> str:
    """What to do about a value of the wrong type or out of range."""
    default = schema.get("default")
    choices = [
        v for s in (schema, *schema.get("anyOf", ())) for v in s.get("enum", [s["const"]] if "const" in s else [])
    ]
    if isinstance(value, str) and section == "effects" and value in LATER_LEVELS.get(key, ()):
        return f"this version does not simulate it, so use {json.dumps(choices[-1])}"
    if isinstance(value, str) and choices and (near := closest(value, [str(c) for c in choices])):
        return f"did you mean {json.dumps(near)}?"
    if isinstance(value, str) and (number := re.match(r"\s*([-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)", value)):
        return f"write the number alone, `{number[1]}` without quotes" + (
            ", the unit is part of the key" * bool(split_unit(key)[1])
        )
    if isinstance(value, list) and schema.get("type") != "array" and f"{key}_mm" in siblings:
        return f"for a list write `{key}_mm = {shown(value, 30)}`"
    if schema.get("type") == "array" and not isinstance(value, dict):
        member = schema.get("items", {})
        alone = _is_number(value) and member.get("type") == "number" and _fits(value, member)
        return f"write a list, `{key} = {[value] if alone else _example(key, schema)}`"
    if _is_number(value) and split_unit(key)[1]:
        return _other_unit(value, split_unit(key)[1], schema)
    if choices:
        return f"choose one of {', '.join(json.dumps(c) for c in choices)}"
    return f"the default is {shown(default)}" if default is not None else f"write {_kind(schema)}"


def _example(key: str, schema: Mapping[str, Any]) -> str:
    """A list that a key takes: a sensible one where it is known, else one of the right length."""
    if key in EXAMPLES or schema.get("default"):
        return EXAMPLES.get(key) or shown(schema["default"])
    members = schema.get("prefixItems") or [schema.get("items", {})] * max(1, schema.get("minItems", 1))
    return f"[{', '.join(_example('', s) if s.get('type') == 'array' else '1' for s in members)}]"


def _fits(value: float, schema: Mapping[str, Any]) -> bool:
    """Whether a number lies in the range of a schema."""
    low = schema.get("minimum", -1e300) <= value and schema.get("exclusiveMinimum", -1e300) < value
    return low and value <= schema.get("maximum", 1e300) and value < schema.get("exclusiveMaximum", 1e300)


def _is_number(value: Any) -> bool:
    """Whether a value is a number that can be converted to another unit."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def _other_unit(value: float, unit: str, schema: Mapping[str, Any]) -> str:
    """A hint at the unit that was meant, where the value would fit in another one."""
    low = max(schema.get("minimum", 0.0), schema.get("exclusiveMinimum", 0.0))
    high = min(schema.get("maximum", 1e300), schema.get("exclusiveMaximum", 1e300))
    ours = UNITS[unit]
    for other in UNITS.values():
        meant = value * other.size / ours.size
        if other.si == ours.si in ("m", "Pa") and other != ours and low < meant <= high:
            return f"the unit is {ours.text}: if {other.text} was meant, write {meant:.10g}"
    default = schema.get("default")
    return f"the default is {shown(default)}" if default is not None else f"write {_kind(schema)} in {ours.text}"
