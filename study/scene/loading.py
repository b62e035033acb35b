"""From the tables of a scene file to checked sections: models, and overrides from the command line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from softjaw.study.scene import checks as scene_checks
from softjaw.study.scene.errors import Finding, KeyPath, Problem, closest, shown
from softjaw.study.scene.score_sections import LimitSurface, Score, Task
from softjaw.study.scene.sections import Accuracy, Candidates, Effects, Friction, Gripper, Load, Output, Run
from softjaw.study.scene.sentences import model_findings
from softjaw.study.scene.shapes import SHAPES, Section
from softjaw.study.scene.uncertainty_section import Uncertainty
from softjaw.study.show.tables.printable import UNPRINTABLE, shortened

SECTIONS: dict[str, type[Section]] = {
    "gripper": Gripper,
    "friction": Friction,
    "candidates": Candidates,
    "load": Load,
    "limit_surface": LimitSurface,
    "score": Score,
    "task": Task,
    "effects": Effects,
    "accuracy": Accuracy,
    "uncertainty": Uncertainty,
    "output": Output,
    "run": Run,
}
NAMES = ("object", *SECTIONS, "petsc", "sweep")
REQUIRED = ("object", "candidates", "load")
ALTERNATIVES = (("stations_mm",), ("stations", "station_range_mm"), ("poses",))


def keys_by_place() -> dict[str, list[str]]:
    """Keys of every section, and of every shape of ``[object]``, by the way the place is written in messages."""
    shapes = {f'[object] with shape = "{name}"': list(model.model_fields) for name, model in SHAPES.items()}
    return {f"[{name}]": list(model.model_fields) for name, model in SECTIONS.items()} | shapes


def known_keys(section: str, table: Mapping[str, Any]) -> list[str]:
    """Keys that a section takes; those of ``[object]`` depend on its shape."""
    model = SHAPES.get(str(table.get("shape"))) if section == "object" else SECTIONS.get(section)
    return list(model.model_fields) if model else []


def checked_sections(data: Mapping[str, Any]) -> tuple[dict[str, Any], list[Finding]]:
    """The valid sections of a scene, and everything wrong with it but for its sweep and its files."""
    sections: dict[str, Any] = {}
    found = [_unknown_section(name, value) for name, value in data.items() if name not in NAMES]
    for name in NAMES:
        if name not in data and name in REQUIRED:
            found.append(
                Finding((name,), "no such section", f"a section [{name}]", f"add [{name}], as in jobs/smoke.toml")
            )
        elif not isinstance(table := data.get(name, {}), Mapping):
            found.append(Finding((name,), shown(table), f"a section [{name}]", f"write [{name}] on a line of its own"))
        elif name in ("petsc", "sweep"):
            sections[name] = dict(table)
        elif (model := SECTIONS.get(name) or SHAPES.get(str(table.get("shape")))) is None:
            found.append(_unknown_shape(table))
        else:
            try:
                sections[name] = model.model_validate(table)
            except ValidationError as error:
                others = {place: keys for place, keys in keys_by_place().items() if keys != list(model.model_fields)}
                found.extend(model_findings(error, model, name, table, others))
    return sections, found + scene_checks.findings(sections) + list(_unprintable(data))


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
    what = "an unknown section" if isinstance(value, Mapping) else "a key outside of any section"
    return Finding((name,), what, expected, f"it belongs to {homes[0]}" if homes else "remove it")


def _unknown_shape(table: Mapping[str, Any]) -> Finding:
    shape, expected = table.get("shape"), f"one of {', '.join(shown(s) for s in SHAPES)}"
    if shape is not None:
        near = closest(shape, list(SHAPES)) if isinstance(shape, str) else None
        return Finding(
            ("object", "shape"), shown(shape), expected, f'did you mean "{near}"?' if near else "choose one of these"
        )
    fits = {name: sum(key in model.model_fields for key in table) for name, model in SHAPES.items()}
    likely = max(fits, key=lambda name: fits[name])
    return Finding(("object", "shape"), "nothing", expected, f'add `shape = "{likely}"` to [object]')


class OverrideError(ValueError):
    """An override that cannot be read: what was found, what was expected, what to do."""


def with_overrides(data: dict[str, Any], overrides: Sequence[str], given: dict[KeyPath, str]) -> list[Problem]:
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
    raise OverrideError(
        f"the value {shown(value)}", "a value as in TOML", "write 0.8, [1, 2], true or '\"text\"'"
    ) from None


def _merge(
    data: dict[str, Any], extra: Mapping[str, Any], text: str, given: dict[KeyPath, str], path: KeyPath = ()
) -> None:
    for key, value in extra.items():
        here = (*path, key)
        if here[0] == "sweep" and len(here) == 2:
            data.update({k: v for k, v in flat({key: value}).items()})
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


def flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A sweep's table with dotted keys, whether its keys were quoted or not."""
    pairs: dict[str, Any] = {}
    for key, value in table.items():
        pairs |= flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {prefix + key: value}
    return pairs
