"""What all sections of a scene share: their base, kinds of values, and how all that is wrong is said.

Errors are pydantic's, by file, line and key, with the value found and what was expected.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from softjaw.study.messages import USAGE, Problem, StudyError, closest, first_of, printable, shown
from softjaw.study.units import UNITS, in_si, split_unit

KeyPath = tuple[str | int, ...]
Errors = Iterator[InitErrorDetails]  # what a rule yields
Place = tuple[str, int | None]  # a file and a line of it, or an override
Tables = Mapping[str, Mapping[str, FieldInfo]]  # keys of every section, by its name
MOST_LISTED = 50  # problems in one message
HEADER = re.compile(r"\s*(\[\[?)([\w.\"' -]+)\]\]?\s*(?:#.*)?$")
KEY = re.compile(r"""\s*([\w.\"' -]+?)\s*=""")
NAME = re.compile(r""""[^"]*"|'[^']*'|[^.\s]+""")


class SceneError(StudyError, ValueError):
    """A scene that cannot be used, with every problem found in it."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = list(problems)
        # A file that is no scene at all must not fill the terminal.
        lines = first_of([*map(str, self.problems)], MOST_LISTED, " problems", f"{problems[0].file}: ")
        super().__init__(USAGE, "\n".join(lines))

    def __reduce__(self) -> tuple[Any, ...]:
        """Ranks send it to each other."""
        return SceneError, (self.problems,)


def refusal(expected: str) -> PydanticCustomError:
    """The error that a validator raises; ``expected`` continues a sentence that names the value."""
    return PydanticCustomError("scene", "{expected}", {"expected": expected})


def wrong(value: Any, expected: str, *path: str | int) -> InitErrorDetails:
    """An error of a rule, for `refuse`: the value found at ``path`` within the section, and what was expected."""
    return {"type": refusal(expected), "loc": path, "input": value}


def refuse(errors: Iterable[InitErrorDetails]) -> None:
    """Raise all errors of a rule at once, if there are any."""
    if listed := list(errors):
        raise ValidationError.from_exception_data("scene", listed)


@cache
def _with_unit(section: type[BaseModel], name: str) -> str | None:
    """The key or property of a section that has this name and a unit."""
    keys = (f"{name}_{unit}" for unit in UNITS)
    return next((key for key in keys if key in section.model_fields or hasattr(section, key)), None)


class SceneSection(BaseModel):
    """What all sections share: nothing unknown, nothing converted from text, nothing changed later."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, protected_namespaces=())

    def __getattr__(self, name: str) -> Any:
        """A key without its unit is its value in SI units; None where the key says ``"auto"``."""
        key = _with_unit(type(self), name)
        return in_si(key, getattr(self, key)) if key else super().__getattr__(name)  # type: ignore[misc]

    @model_validator(mode="after")
    def _rules_hold(self) -> Self:
        refuse(self.rules())
        return self

    def rules(self) -> Errors:
        """What is wrong with keys that are valid one by one, by their paths within the section."""
        return iter(())


def numbers_text(values: Sequence[float]) -> str:
    """A list of numbers as TOML would write it, without trailing zeros."""
    return f"[{', '.join(f'{v:g}' for v in values)}]"


def _direction(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if not 1e-6 <= math.hypot(*vector) <= 1e6:
        raise refusal("a direction, as in [0, 0, -1]")
    return vector


def once_and_rising(values: tuple[float, ...]) -> tuple[float, ...]:
    """The values in rising order; refused if one is given twice."""
    for value, times in Counter(values).items():
        if times > 1:
            raise refusal(f"each value once; {value:g} is repeated")
    return tuple(sorted(values))


def _one_line(text: str) -> str:
    if printable(text) != text or not {"\n", "\t"}.isdisjoint(text):
        raise refusal("text without control characters")
    return text


Text = Annotated[str, AfterValidator(_one_line)]
RISING = AfterValidator(once_and_rising)
Point = tuple[float, float]
Vector = tuple[float, float, float]
Direction = Annotated[Vector, AfterValidator(_direction)]


# --- what is wrong with a scene ---------------------------------------------------------------------------------------


def key_text(path: KeyPath) -> str:
    """A path as it is written in messages: ``candidates.poses[1].approach``."""
    parts = [f"[{p}]" if isinstance(p, int) else f".{p if p.isidentifier() else shown(p)}" for p in path]
    return "".join(parts).removeprefix(".")


def problems_of(error: ValidationError, data: Any, tables: Tables, place: Callable[[KeyPath], Place]) -> list[Problem]:
    """The errors of a scene, one for each key; ``place`` gives the file and line of a key."""
    expected: dict[KeyPath, list[str]] = {}
    entries: dict[KeyPath, tuple[str, Any]] = {}
    for entry in error.errors(include_url=False):
        path, value = _place_in(data, entry, tables)
        if entry["type"] == "too_short" and isinstance(value, list) and len(value) >= entry["ctx"]["min_length"]:
            continue  # a list whose members were refused is not also too short
        entries.setdefault(path, (entry["type"], value))
        expected.setdefault(path, []).append(_expectation(entry, path))  # more than one where a key has alternatives
    problems = []
    for path, (kind, value) in entries.items():
        actual = "an unknown key" if kind == "extra_forbidden" else "nothing" if value is None else shown(value)
        texts = " or ".join(dict.fromkeys(expected[path]))
        unknown = kind == "extra_forbidden"
        remedy = _right_key(path, tables) if unknown else _right_value(path, kind, value, texts, tables)
        problems.append(Problem(*place(path), key_text(path), actual, texts, remedy))
    return problems


def _place_in(data: Any, entry: ErrorDetails, tables: Tables) -> tuple[KeyPath, Any]:
    """The path of an error without pydantic's names of alternatives, and the value there."""
    loc, kind, value = entry["loc"], entry["type"], data
    known = {*tables, *(key for keys in tables.values() for key in keys)}
    if loc[:1] == ("object",):  # the shape's name comes next
        loc = ("object", "shape") if kind.startswith("union_tag") else ("object", *loc[2:])
    path: list[str | int] = []
    for part in loc:
        member = isinstance(part, int) and isinstance(value, list | tuple) and part < len(value)
        inside = part in value if isinstance(value, Mapping) else member
        if inside or part in known or part == "shape":
            path.append(part)
            value = value[part] if inside else None
    return tuple(path), entry["input"] if kind == "scene" else value


def _expectation(entry: ErrorDetails, path: KeyPath) -> str:
    """What pydantic expected, as the end of a sentence."""
    kind, text = entry["type"], entry["msg"]
    if kind == "extra_forbidden":
        return f"a key of [{key_text(path[:-1])}]" if len(path) > 1 else "a section of a scene"
    if kind == "missing":
        return "more members" if isinstance(entry["loc"][-1], int) else "a value"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return "a table"
    if kind.startswith("union_tag"):
        return f"one of {entry['ctx']['expected_tags']}" if kind == "union_tag_invalid" else "the object's shape"
    text = text.removeprefix("Input should be ").removeprefix("Tuple should have ").replace(" after validation", "")
    text = text.replace("a valid integer", "a whole number").replace("a valid ", "a ")
    return f"{'a number ' * text.startswith(('greater', 'less'))}{text.replace('tuple', 'list')}"


def _right_key(path: KeyPath, tables: Tables) -> str:
    """What to write instead of an unknown key or section."""
    key, (stem, _) = str(path[-1]), split_unit(str(path[-1]))
    if len(path) == 1 and (near := closest(key, list(tables))):
        return f"did you mean [{near}]?"
    keys = list(dict.fromkeys(k for name, table in tables.items() if name == path[0] for k in table))
    same = [k for k in keys if split_unit(k)[0] == stem]
    if near := same[0] if same else closest(key, keys):
        return f"did you mean `{near}`?"
    homes = [f"[{name}]" for name, table in tables.items() if key in table]
    return f"it belongs to {homes[0]}" if homes else f"remove it, or write one of {', '.join(keys or tables)}"


def _right_value(path: KeyPath, kind: str, value: Any, expected: str, tables: Tables) -> str:
    """What to write instead of a wrong value: the choice that was meant, or what the key is, with an example."""
    if kind == "scene":
        return ""  # it says so itself
    if len(path) == 1:
        return f"write [{path[0]}] with its keys below it, as in jobs/smoke.toml"
    choices = re.findall(r"'([^']*)'", expected)
    if isinstance(value, str) and (near := closest(value, choices)):
        return f'did you mean "{near}"?'
    key = next(part for part in reversed(path) if isinstance(part, str))
    field = tables.get(str(path[0]), {}).get(key)
    if field is None:
        return ""
    unit = split_unit(key)[1]
    example = next(iter(field.examples or ()), None) or (None if field.is_required() else field.default)
    written = f", as in `{key} = {shown(example)}`" if example not in (None, (), "") else ""
    return f"{key}: {field.description}{f' [{UNITS[unit].text}]' if unit else ''}{written}"


def lines_of(text: str) -> dict[KeyPath, int]:
    """First line of every section and key of a TOML text that stands on a line of its own; a plain search."""
    lines: dict[KeyPath, int] = {}
    table: KeyPath = ()
    counts: dict[KeyPath, int] = {}
    for number, line in enumerate(text.split("\n"), 1):
        if header := HEADER.match(line):
            table = _names(header[2])
            if header[1] == "[[":
                counts[table] = counts.get(table, -1) + 1
                table = (*table, counts[table])
            path = table
        elif key := KEY.match(line):
            path = (*table, *_names(key[1]))
        else:
            continue
        for n in range(1, len(path) + 1):
            lines.setdefault(path[:n], number)
    return lines


def _names(text: str) -> KeyPath:
    return tuple(name.strip("\"'") for name in NAME.findall(text))
