"""The text of a scene: reading it, the line of every key, and writing it back."""

from __future__ import annotations

import contextlib
import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softjaw.study.scene.errors import KeyPath, Problem, SceneError, closest, key_text, shown

LARGEST = 1_000_000  # bytes; a scene is a few kB
CURES = {  # start of tomllib's sentence: what to do
    "Expected newline or end of document": "give each key its own line, and write decimals with a point, `mu = 0.8`",
    "Invalid value": "write text in quotes, numbers as 0.8 or 1e-3, and true or false in small letters",
    "Unclosed array": "close the list with `]`",
    "Unterminated string": "close the text with a quote",
    "Expected '=' after a key": "write `key = value`; a key has no blanks in it",
    "Cannot": "give each key and section once",
    "Expected ']'": "close the section's name with `]`",
    "Expected \"'": "close the text with a quote",
    "Found invalid character": "close the text with a quote on the same line",
}
_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|' + r"'''.*?'{3,5}|" + r'"(?:\\.|[^"\\\n])*"|' + r"'[^'\n]*'|"
    r"#[^\n]*|\n|[\[\]{}=,.]|[^\s\[\]{}=,.\"'#]+",
    re.DOTALL,
)


def read_text(path: Path) -> str:
    """The text of a scene file; a `SceneError` says why it cannot be read."""

    def refuse(found: str, expected: str, remedy: str) -> SceneError:
        return SceneError([Problem(str(path), None, "", found, expected, remedy)])

    toml = "a scene, which is a text file in TOML"
    if path.is_dir():
        inside = sorted(p.name for p in path.glob("*.toml"))
        raise refuse("a directory", toml, f"name one of {', '.join(inside)}" if inside else "name a file in it")
    if not path.exists():
        scenes = [p.name for p in path.parent.glob("*.toml") if p.name != "pyproject.toml"]
        near = closest(path.name, scenes)
        raise refuse("no such file", toml, f"did you mean `{path.with_name(near)}`?" if near else "check the path")
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
    except OSError as error:
        raise refuse(f"a file that cannot be read ({error.strerror})", toml, "check its permissions") from None
    if b"\0" in content:
        hint = "use `softjaw show` for results" if content.startswith(b"\x89HDF") else "name the scene's .toml file"
        raise refuse("binary data", toml, hint)
    if len(content) > LARGEST:
        raise refuse(f"more than {LARGEST / 1e6:.0f} MB", "a scene of a few kB", "name the scene's .toml file")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        found = f"a byte that is not UTF-8 in line {line}"
        raise refuse(found, toml + " coded in UTF-8", "save it as UTF-8 (or without special characters)") from None


def parse_toml(text: str, file: str) -> dict[str, Any]:
    """The tables of a scene's text; a `SceneError` names the line where it stops being TOML."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        deep = Problem(file, None, "", "lists or tables nested too deeply", "a scene", "flatten them")
        raise SceneError([deep]) from None
    except ValueError as error:
        raise SceneError([_syntax_problem(text, file, str(error))]) from None


def _syntax_problem(text: str, file: str, message: str) -> Problem:
    reason, _, place = message.partition(" (at ")
    numbers = re.findall(r"\d+", place)
    last = text.rstrip("\n").count("\n") + 1
    line = min(int(numbers[0]), last) if numbers else last
    if reason.startswith(("Cannot overwrite", "Cannot declare", "Cannot mutate", "Duplicate")):
        before = "\n".join(text.split("\n")[:line])
        lines: dict[KeyPath, int] = {}
        again: list[tuple[KeyPath, int]] = []
        with contextlib.suppress(ValueError):  # the rest of the line may not be TOML
            again = key_lines(before, lines)
        if again:
            path, line = again[0]
            found = f"the same {'section' if len(path) == 1 else 'key'} again"
            expected = f"it once, and line {lines[path]} has it"
            return Problem(file, line, key_text(path), found, expected, "remove one of them")
    cure = next((c for start, c in CURES.items() if reason.startswith(start)), "correct this line")
    found = f"{shown(text.split(chr(10))[line - 1].strip())} ({reason[:1].lower()}{reason[1:]})"
    return Problem(file, line, "", found, "TOML", cure)


def key_lines(text: str, lines: dict[KeyPath, int]) -> list[tuple[KeyPath, int]]:
    """Put the line of every section, key and list member of a TOML text into ``lines``.

    Returns
    -------
    list of (path, line)
        Keys and sections that are given again, in the order of the text.
    """
    return _Scan(text, lines).statements()


class _Scan:
    """A walk over text that ``tomllib`` has accepted (or refused for a duplicate only), to learn lines."""

    def __init__(self, text: str, lines: dict[KeyPath, int]) -> None:
        self.tokens: list[tuple[str, int]] = []
        line = 1
        for match in _TOKEN.finditer(text):
            if not match[0].startswith("#"):
                self.tokens.append((match[0], line))
            line += match[0].count("\n")
        self.tokens.append(("", line))
        self.lines, self.at, self.again = lines, 0, list[tuple[KeyPath, int]]()

    def peek(self) -> str:
        return self.tokens[self.at][0]

    def skip(self, *kinds: str) -> None:
        while self.peek() in kinds:
            self.at += 1

    def record(self, path: KeyPath, line: int, once: bool = True) -> None:
        for n in range(1, len(path)):
            self.lines.setdefault(path[:n], line)
        if once and path in self.lines:
            self.again.append((path, line))
        self.lines.setdefault(path, line)

    def key(self, *ends: str) -> KeyPath:
        parts: list[str] = []
        while self.peek() not in (*ends, "", "\n"):
            token = self.peek()
            if token != ".":
                parts.append(next(iter(tomllib.loads(f"{token}=0"))))
            self.at += 1
        return tuple(parts)

    def statements(self) -> list[tuple[KeyPath, int]]:
        base: KeyPath = ()
        counts: dict[KeyPath, int] = {}
        sections: set[KeyPath] = set()
        while self.skip("\n") or self.peek():
            line = self.tokens[self.at][1]
            if self.peek() == "[":
                start = self.at
                self.skip("[")
                many = self.at - start == 2
                base = self.key("]")
                self.skip("]")
                if many:
                    counts[base] = counts.get(base, -1) + 1
                    base = (*base, counts[base])
                else:
                    base = next(((*p, n, *base[len(p) :]) for p, n in counts.items() if base[: len(p)] == p), base)
                self.record(base, line, once=base in sections)
                sections.add(base)
            else:
                self.entry(base)
        return self.again

    def entry(self, base: KeyPath) -> None:
        line = self.tokens[self.at][1]
        path = (*base, *self.key("="))
        self.record(path, line)
        self.skip("=")
        self.value(path)

    def value(self, path: KeyPath) -> None:
        if self.peek() == "[":
            self.at += 1
            index = 0
            while self.skip("\n", ",") or self.peek() not in ("]", ""):
                self.record((*path, index), self.tokens[self.at][1])
                self.value((*path, index))
                index += 1
            self.at += 1
        elif self.peek() == "{":
            self.at += 1
            while self.skip("\n", ",") or self.peek() not in ("}", ""):
                self.entry(path)
            self.at += 1
        else:
            while self.peek() not in (",", "]", "}", "\n", ""):
                self.at += 1


def toml_text(data: Mapping[str, Any]) -> str:
    """TOML text of the tables of a scene; None is left out."""
    plain, tables = [], []
    for key, value in data.items():
        if isinstance(value, Mapping) and value:
            tables.append(f"[{_key(key)}]\n{toml_text(value)}")
        elif value is not None and not isinstance(value, Mapping):
            plain.append(f"{_key(key)} = {_value(value)}\n")
    return "".join(plain) + "".join("\n" + t for t in tables)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        nested = any(isinstance(v, list | tuple | Mapping) for v in value)
        members = [_value(v) for v in value]
        return "[\n  " + ",\n  ".join(members) + ",\n]" if nested else f"[{', '.join(members)}]"
    if isinstance(value, str):  # JSON's escapes are TOML's, but for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value) if isinstance(value, float) else json.dumps(value)
