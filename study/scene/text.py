"""The TOML text of a scene: reading it, writing it back, and comparing two of them."""

import json
import re
import tomllib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from softjaw.study.messages import Problem, closest, first_of, shortened, shown
from softjaw.study.scene.section import SceneError

LARGEST = 1_000_000  # bytes; a scene is a few kB
REMEDY = "write each `key = value` once and on a line of its own, text in quotes, decimals with a point, lists in [ ]"
MOST_NAMED, WIDTH = 5, 24


def read_text(path: Path) -> str:
    """The text of a scene file; a `SceneError` says why it cannot be read."""

    def refuse(actual: str, expected: str, remedy: str) -> SceneError:
        return SceneError([Problem(str(path), None, "", actual, expected, remedy)])

    toml = "a scene, which is a text file in TOML"
    try:
        with path.open("rb") as file:
            # Never more than that: the name may lead to a huge file, or to one without an end.
            content = file.read(LARGEST + 1)
    except OSError as error:
        scenes = [p.name for p in path.parent.glob("*.toml") if p != path and p.name != "pyproject.toml"]
        near = closest(path.name, scenes)
        remedy = f"did you mean `{path.with_name(near)}`?" if near else "check the path and its permissions"
        raise refuse(f"a file that cannot be read ({error.strerror})", toml, remedy) from None
    # A result file is the likeliest mix-up, so it is recognised.
    if b"\0" in content:
        hint = "use `softjaw show` for results" if content.startswith(b"\x89HDF") else "name the scene's .toml file"
        raise refuse("binary data", toml, hint)
    if len(content) > LARGEST:
        raise refuse(f"more than {LARGEST / 1e6:.0f} MB", "a scene of a few kB", "name the scene's .toml file")
    try:
        # Some editors begin a file with a byte order mark, and end lines with two characters.
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        actual = f"a byte that is not UTF-8 in line {line}"
        raise refuse(actual, toml + " coded in UTF-8", "save it as UTF-8 (or without special characters)") from None


def parse_toml(text: str, file: str) -> dict[str, Any]:
    """The tables of a scene's text; a `SceneError` names the line where it stops being TOML."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        deep = Problem(file, None, "", "lists or tables nested too deeply", "a scene", "flatten them")
        raise SceneError([deep]) from None
    except ValueError as error:
        reason, _, place = str(error).partition(" (at ")
        lines = text.rstrip("\n").split("\n")
        number = place.removeprefix("line ").partition(",")[0]  # tomllib gives it as text only
        # A place behind the text, as of a bracket that is never closed, becomes the last line.
        line = min(int(number), len(lines)) if number.isdigit() else len(lines)
        actual = f"{shown(lines[line - 1].strip())} ({reason[:1].lower()}{reason[1:]})"
        raise SceneError([Problem(file, line, "", actual, "TOML", REMEDY)]) from None


def toml_text(data: Mapping[str, Any]) -> str:
    """TOML text of the tables of a scene, those within a table on a line; None is left out."""
    plain = [_line(key, value) for key, value in data.items() if not isinstance(value, Mapping)]
    sections = [(_key(key), value) for key, value in data.items() if isinstance(value, Mapping) and value]
    tables = [f"\n[{name}]\n{''.join(_line(*pair) for pair in table.items())}" for name, table in sections]
    return "".join([*plain, *tables])


def _line(key: str, value: Any) -> str:
    return "" if value is None else f"{_key(key)} = {_value(value)}\n"


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        nested = any(isinstance(v, list | tuple | Mapping) for v in value)
        members = [_value(v) for v in value]
        return "[\n  " + ",\n  ".join(members) + ",\n]" if nested else f"[{', '.join(members)}]"
    if isinstance(value, str):
        return quoted(value)
    # repr of a float comes back as the same float, so that the digest does.
    return repr(value) if isinstance(value, float) else json.dumps(value)


def quoted(text: str) -> str:
    r"""A text as TOML writes it, in which whatever does not print is escaped.

    >>> print(quoted("mug\x7f\xa02"))
    "mug\U0000007f\U000000a02"
    """
    # JSON's escapes are TOML's, but for those of pairs beyond four digits
    return "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in json.dumps(text, ensure_ascii=False))


def flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Tables in tables as one table with dotted keys."""
    pairs: dict[str, Any] = {}
    for key, value in table.items():
        pairs |= flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {prefix + key: value}
    return pairs


def differences(theirs: str, ours: str) -> str:
    r"""Up to five keys that change results and differ between two effective scenes, with both values.

    >>> differences("[friction]\nmu = 0.8", "[friction]\nmu = 0.5")
    'friction.mu is 0.8 there and 0.5 here'
    """
    try:
        changed = changes(theirs, ours)
    except ValueError:
        return "its scene cannot be read"
    if not changed:
        return "the same keys, but another mesh file or another version"
    texts = ((key, *value_texts(first, second)) for key, first, second in changed)
    named = [f"{key} is {there} there and {here} here" for key, there, here in texts]
    return "; ".join(first_of(named, MOST_NAMED, " keys"))


def changes(theirs: str, ours: str) -> list[tuple[str, Any, Any]]:
    """Keys that change results and differ between two effective scenes, with both values; None is a key not set.

    Raises `ValueError`: one of them is not TOML.
    """
    before, after = (_values(text) for text in (theirs, ours))
    # In the order of our scene, which is the one that the reader knows.
    keys = [key for key in dict.fromkeys([*after, *before]) if before.get(key) != after.get(key)]
    return [(key, before.get(key), after.get(key)) for key in keys]


def _values(text: str) -> dict[str, Any]:
    """Values by dotted key, without those that change no result."""
    values = flat({name: table for name, table in parse_toml(text, "scene").items() if name != "run"})
    for pose in values.get("candidates.poses", ()):
        # Labels name candidates and change no result.
        pose.pop("label", None)
    return {key: value for key, value in values.items() if key not in ("object.name", "gripper.preset")}


def value_texts(first: Any, second: Any) -> tuple[str, str]:
    """Two values of a scene in a few words; where those are alike, from shortly before the values differ.

    >>> value_texts([[0.0, 0.5], [20.0, 0.3], [120.0, 0.3]], [[0.0, 0.5], [20.0, 0.3], [120.0, 0.4]])
    ('...0.3]]', '...0.4]]')
    """
    a, b = ("not set" if value is None else shown(value, LARGEST) for value in (first, second))
    if shortened(a, WIDTH) == shortened(b, WIDTH):
        alike = next((i for i, pair in enumerate(zip(a, b, strict=False)) if len(set(pair)) > 1), 0)
        start = max(a.rfind(" ", 0, alike) + 1, alike - WIDTH // 3)
        a, b = (f"...{text[start:]}" for text in (a, b))
    return shortened(a, WIDTH), shortened(b, WIDTH)


def scene_table(text: str, section: str) -> dict[str, Any]:
    """A section of a stored scene; empty where there is none."""
    return dict(_stored_tables(text).get(section, {}))


@lru_cache(maxsize=8)
def _stored_tables(text: str) -> dict[str, Any]:
    """Tables of a stored scene, which are asked for again for each line of a list."""
    return parse_toml(text, "scene")
