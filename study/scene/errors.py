"""What is wrong with a scene: where, which key, what was found, what was expected, what to do."""

from __future__ import annotations

import datetime
import difflib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from softjaw.study.show.tables.printable import printable

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
    rest = [f"{file}: and {more} more problems"] if more > 0 else []
    return "\n".join([*lines[:MOST_TOLD], *rest])


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
