"""What is wrong with a scene: where, which key, what was found, what was expected, what to do."""

from __future__ import annotations

import datetime
import difflib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError

from softjaw.study.show.tables.printable import printable
from softjaw.study.units import UNITS, split_unit

KeyPath = tuple[str | int, ...]
MOST_TOLD = 50  # problems in one message


class Finding(NamedTuple):
    """One thing wrong with a scene, by the path of its key; ``expected`` and ``remedy`` are parts of a sentence."""

    path: KeyPath
    found: str
    expected: str
    remedy: str


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a scene, with its place; ``line`` is None where there is no line to point at."""

    file: str
    line: int | None
    key: str
    found: str
    expected: str
    remedy: str

    def __str__(self) -> str:
        where = self.file if self.line is None else f"{self.file}:{self.line}"
        key = f" {self.key}:" if self.key else ""
        return f"{where}:{key} found {self.found}, expected {self.expected}; {self.remedy}"


class SceneError(ValueError):
    """A scene that cannot be used, with every problem found in it."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = list(problems)
        super().__init__(first_of([str(p) for p in self.problems], self.problems[0].file if self.problems else ""))


def first_of(lines: Sequence[str], file: object) -> str:
    """The first problems of a file, and how many more there are."""
    more = len(lines) - MOST_TOLD
    return "\n".join([*lines[:MOST_TOLD], *([f"{file}: and {more} more problems"] if more > 0 else [])])


def key_text(path: KeyPath) -> str:
    """A path as it is written in messages: ``candidates.poses[1].approach``."""
    parts = [f"[{part}]" if isinstance(part, int) else f'."{part}"' if "." in part else f".{part}" for part in path]
    return "".join(parts).removeprefix(".")


def shown(value: Any, width: int = 60) -> str:
    """A value as TOML would write it, shortened to ``width`` characters."""
    if isinstance(value, datetime.date | datetime.time):
        text = str(value)
    elif isinstance(value, Mapping):
        text = "a table" if value else "an empty table"
    else:
        text = json.dumps(value, ensure_ascii=False, default=str)
        text = text if isinstance(value, str) else text.replace("Infinity", "inf").replace("NaN", "nan")
    text = printable(text)
    return text if len(text) <= width else text[: width - 4] + " ..."


def closest(word: str, words: Sequence[str]) -> str | None:
    """The word the user most likely meant."""
    near = difflib.get_close_matches(word.lower().replace("-", "_"), [w.lower() for w in words], n=1, cutoff=0.6)
    return next((w for w in words if near and w.lower() == near[0]), None)


def unknown_key(path: KeyPath, value: Any, keys: Sequence[str], elsewhere: Mapping[str, Sequence[str]]) -> Finding:
    """A key that no section takes; ``elsewhere`` maps places (``[friction]``) to the keys they take."""
    key, (stem, unit) = str(path[-1]), split_unit(str(path[-1]))
    same = sorted((k for k in keys if split_unit(k)[0] == stem), key=lambda k: not split_unit(k)[1])
    home = next((place for place, theirs in elsewhere.items() if key in theirs), None)
    expected = f"a key of [{key_text(path[:-1])}]"
    if same:
        target = split_unit(same[0])[1]
        converts = _is_number(value) and unit and target and UNITS[unit].si == UNITS[target].si
        converted = f" = {value * UNITS[unit].size / UNITS[target].size:.10g}" if converts else ""
        remedy = f"the unit is part of the key, so write `{same[0]}{converted}`"
    elif home:
        remedy = f"it belongs to {home}"
    elif near := closest(key, keys):
        remedy = f"did you mean `{near}`?"
    else:
        expected, remedy = f"one of {', '.join(keys)}", "remove it"
    return Finding(path, "an unknown key", expected, remedy)


def model_findings(
    error: ValidationError, model: type[BaseModel], section: str, table: Any, elsewhere: Mapping[str, Sequence[str]]
) -> Iterator[Finding]:
    """What pydantic found wrong in one section, one finding per place in the file."""
    schema, seen = model.model_json_schema(), set()
    for entry in error.errors(include_url=False):
        path, value, owner = _place(entry["loc"], table, schema)
        if path in seen or (entry["type"] == "too_short" and len(value) >= entry["ctx"]["min_length"]):
            continue  # a list whose members were refused is not also too short
        seen.add(path)
        full, key = (section, *path), next((str(p) for p in reversed(path) if isinstance(p, str)), "")
        if entry["type"] == "extra_forbidden":
            yield unknown_key(full, value, list(owner.get("properties", {})), elsewhere if len(path) == 1 else {})
        elif entry["type"] == "missing" and value is None:
            expected = _expectation(owner["properties"][key], key)
            yield Finding(full, "nothing", expected, f"add `{key} = ...` to [{key_text(full[:-1])}]")
        else:
            remedy = _remedy(key, value, owner, schema.get("properties", {}))
            yield Finding(full, shown(value), _expectation(owner, key), remedy)


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
    """The alternatives of a key that is given; leaving it out is none of them."""
    return [s for s in schema.get("anyOf", ()) if s.get("type") != "null"]


def _choices(schema: Mapping[str, Any]) -> list[Any]:
    parts = (schema, *schema.get("anyOf", ()))
    return [value for s in parts for value in s.get("enum", [s["const"]] if "const" in s else [])]


def _expectation(schema: Mapping[str, Any], key: str) -> str:
    """What a key takes, read off its JSON schema: kind, range, unit and description."""
    unit = split_unit(key)[1]
    text = _kind(schema) + (f" [{UNITS[unit].text}]" if unit else "")
    return f"{text} ({schema['description']})" if "description" in schema else text


def _kind(schema: Mapping[str, Any]) -> str:
    kind, options = schema.get("type"), _options(schema)
    if options:
        return " or ".join(map(_kind, options))
    if values := [json.dumps(v) for v in _choices(schema)]:
        return values[0] if len(values) == 1 else f"one of {', '.join(values)}"
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


def _remedy(key: str, value: Any, schema: Mapping[str, Any], siblings: Mapping[str, Any]) -> str:
    """What to do about a value of the wrong type or out of range."""
    unit, choices, default = split_unit(key)[1], _choices(schema), schema.get("default")
    usual = f"the default is {shown(default)}" if default is not None else f"write {_kind(schema)}"
    if isinstance(value, str) and choices and (near := closest(value, [str(c) for c in choices])):
        return f"did you mean {json.dumps(near)}?"
    if isinstance(value, str) and (number := re.match(r"\s*([-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)", value)):
        return f"write the number alone, `{number[1]}` without quotes" + ", the unit is part of the key" * bool(unit)
    if isinstance(value, list) and schema.get("type") != "array" and f"{key}_mm" in siblings:
        return f"for a list write `{key}_mm = {shown(value, 30)}`"
    if schema.get("type") == "array" and not isinstance(value, dict):
        member = schema.get("items", {})
        alone = _is_number(value) and member.get("type") == "number" and _fits(value, member)
        return f"write a list, `{key} = {[value] if alone else _example(schema)}`"
    if _is_number(value) and unit:
        return _other_unit(value, unit, schema) or usual + (f" in {UNITS[unit].text}" if default is None else "")
    return f"choose one of {', '.join(map(json.dumps, choices))}" if choices else usual


def _example(schema: Mapping[str, Any]) -> str:
    """A list that a key takes: a sensible one where it is known, else one of the right length."""
    if known := next(iter(schema.get("examples", ())), None) or schema.get("default"):
        return shown(known)
    members = schema.get("prefixItems") or [schema.get("items", {})] * max(1, schema.get("minItems", 1))
    return f"[{', '.join(_example(s) if s.get('type') == 'array' else '1' for s in members)}]"


def _other_unit(value: float, unit: str, schema: Mapping[str, Any]) -> str:
    """A hint at the unit that was meant, where the value would fit in another one."""
    positive = {"exclusiveMinimum": 0.0, **schema}
    for other in UNITS.values():
        meant = value * other.size / UNITS[unit].size
        same_kind = other.si == UNITS[unit].si in ("m", "Pa") and other != UNITS[unit]
        if same_kind and _fits(meant, positive):
            return f"the unit is {UNITS[unit].text}: if {other.text} was meant, write {meant:.10g}"
    return ""


def _fits(value: float, schema: Mapping[str, Any]) -> bool:
    """Whether a number lies in the range of a schema."""
    low = schema.get("minimum", -1e300) <= value and schema.get("exclusiveMinimum", -1e300) < value
    return low and value <= schema.get("maximum", 1e300) and value < schema.get("exclusiveMaximum", 1e300)


def _is_number(value: Any) -> bool:
    """Whether a value is a number that can be converted to another unit."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300
