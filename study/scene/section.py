"""What all sections of a scene share: their base, kinds of values, and what pydantic's errors mean for a user."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from softjaw.study.messages import printable
from softjaw.study.scene.problems import (
    Finding,
    KeyPath,
    RefusalError,
    closest,
    is_number,
    key_text,
    shown,
    unknown_key,
)
from softjaw.study.units import UNITS, converted, split_unit

BOUNDS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}


class SceneSection(BaseModel):
    """What all sections share: nothing unknown, nothing converted from text, nothing changed later."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, protected_namespaces=())

    def findings(self) -> Iterator[Finding]:
        """What is wrong with keys that are valid one by one, by their paths within the section."""
        return iter(())


def numbers_text(values: Sequence[float]) -> str:
    """A list of numbers as TOML would write it, without trailing zeros."""
    return f"[{', '.join(f'{v:g}' for v in values)}]"


def _lower_first(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] >= pair[1]:
        remedy = f"write {numbers_text(pair[::-1])}"
        raise RefusalError(numbers_text(pair), "two different values, the lower first", remedy)
    return pair


def _direction(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if not 1e-6 <= math.hypot(*vector) <= 1e6:
        raise RefusalError(shown(list(vector)), "a direction", "write for example [0, 0, -1]")
    return vector


def once_and_rising(values: tuple[float, ...]) -> tuple[float, ...]:
    """The values in rising order; refused if one is given twice."""
    for value, times in Counter(values).items():
        if times > 1:
            raise RefusalError(f"{value:g} more than once", "each value once", "remove the repetition")
    return tuple(sorted(values))


def _one_line(text: str) -> str:
    if printable(text) != text or not {"\n", "\t"}.isdisjoint(text):
        raise RefusalError(shown(text), "text without control characters", "remove them")
    return text


Text = Annotated[str, AfterValidator(_one_line)]
Point = Annotated[tuple[float, float], Field(strict=False)]
Vector = Annotated[tuple[float, float, float], Field(strict=False)]
Direction = Annotated[Vector, AfterValidator(_direction)]
Interval = Annotated[Point, AfterValidator(_lower_first)]


def model_findings(
    error: ValidationError, model: type[SceneSection], section: str, table: Any, elsewhere: Mapping[str, Sequence[str]]
) -> Iterator[Finding]:
    """What pydantic found wrong in one section, one finding per place in the file."""
    schema, seen = model.model_json_schema(), set()
    for entry in error.errors(include_url=False):
        kind, (path, value, owner) = entry["type"], _place(entry["loc"], table, schema)
        if path in seen or (kind == "too_short" and len(value) >= entry["ctx"]["min_length"]):
            continue  # a list whose members were refused is not also too short
        seen.add(path)
        full, key = (section, *path), next((str(p) for p in reversed(path) if isinstance(p, str)), "")
        if kind == "value_error" and isinstance(refusal := entry["ctx"]["error"], RefusalError):
            yield Finding(full, *refusal.args)
        elif kind == "extra_forbidden":
            yield unknown_key(full, value, list(owner.get("properties", {})), elsewhere if len(path) == 1 else {})
        elif kind == "missing" and value is None:
            expected = _expectation(owner["properties"][key], key)
            yield Finding(full, "nothing", expected, f"add `{key} = ...` to [{key_text(full[:-1])}]")
        else:
            yield Finding(full, shown(value), _expectation(owner, key), _remedy(key, value, owner))


def _place(loc: Sequence[str | int], table: Any, schema: dict[str, Any]) -> tuple[KeyPath, Any, dict[str, Any]]:
    """The part of a pydantic location that is in the file, the value there, and the schema of that place.

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
            here = here["properties"][part]
            given = _options(here)
            here = here | given[0] | {"anyOf": ()} if len(given) == 1 else here
        elif isinstance(value, list | tuple) and isinstance(part, int) and part < len(value):
            path.append(part)
            value = value[part]
            here = here["prefixItems"][part] if "prefixItems" in here else here.get("items", {})
    return tuple(path), value, here


def _options(schema: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The alternatives of a key that is given; leaving it out is none of them, nor is switching a table on."""
    return [s for s in schema.get("anyOf", ()) if s.get("type") not in ("null", "boolean")]


def _choices(schema: Mapping[str, Any]) -> list[str]:
    parts = (schema, *schema.get("anyOf", ()))
    return [str(value) for s in parts for value in s.get("enum", [s["const"]] if "const" in s else [])]


def _expectation(schema: Mapping[str, Any], key: str) -> str:
    """What a key takes, read off its JSON schema: kind, range, unit and description."""
    unit = split_unit(key)[1]
    text = kind_text(schema) + (f" [{UNITS[unit].text}]" if unit else "")
    return f"{text} ({schema['description']})" if "description" in schema else text


def kind_text(schema: Mapping[str, Any]) -> str:
    """What values a key takes, read off its JSON schema: kind and range, or all choices."""
    kind, options = schema.get("type"), _options(schema)
    if options:
        return " or ".join(map(kind_text, options))
    if values := [json.dumps(v) for v in _choices(schema)]:
        return values[0] if len(values) == 1 else f"one of {', '.join(values)}"
    if kind in ("number", "integer"):
        limits = " and ".join(f"{sign} {schema[name]:.10g}" for name, sign in BOUNDS.items() if name in schema)
        return f"{'a whole number' if kind == 'integer' else 'a number'} {limits}".strip()
    if kind == "array":
        low, high = schema.get("minItems", 0), schema.get("maxItems")
        count = f"{low}" if low == high else f"{low} or more" if high is None else f"{low} to {high}"
        item = (schema.get("prefixItems") or [schema.get("items", {})])[0]
        each = f", each {kind_text(item)}" if item.get("type") in ("number", "integer", "array") else ""
        return f"a list of {count}{each}"
    return {"string": "text", "boolean": "true or false"}.get(str(kind), "a table")


def _remedy(key: str, value: Any, schema: Mapping[str, Any]) -> str:
    """What to do about a value of the wrong type or out of range: the likely slip, else a value that is right."""
    unit, example = split_unit(key)[1], schema.get("default") or next(iter(schema.get("examples", ())), None)
    if isinstance(value, str) and (near := closest(value, _choices(schema))):
        return f"did you mean {json.dumps(near)}?"
    if unit and is_number(value) and (slip := _other_unit(value, unit, schema)):
        return slip
    if example is not None:
        return f"write for example `{key} = {shown(example)}`"
    return f"write {kind_text(schema)}" + (", without quotes and without the unit" if isinstance(value, str) else "")


def _other_unit(value: float, unit: str, schema: Mapping[str, Any]) -> str:
    """A hint at the unit that was meant, where the value would fit in another one."""
    positive = {"exclusiveMinimum": 0.0, **schema}
    for name, other in UNITS.items():
        meant = converted(value, name, unit)
        if name != unit and other.si == UNITS[unit].si in ("m", "Pa") and _fits(meant, positive):
            return f"the unit is {UNITS[unit].text}: if {other.text} was meant, write {meant:.10g}"
    return ""


def _fits(value: float, schema: Mapping[str, Any]) -> bool:
    """Whether a number lies in the range of a schema."""
    low = schema.get("minimum", -1e300) <= value and schema.get("exclusiveMinimum", -1e300) < value
    return low and value <= schema.get("maximum", 1e300) and value < schema.get("exclusiveMaximum", 1e300)
