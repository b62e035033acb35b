"""What is wrong with a scene: where, which key, what was found, what was expected, what to do."""

from __future__ import annotations

import datetime
import difflib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from softjaw.study.messages import printable
from softjaw.study.units import UNITS, converted, split_unit

KeyPath = tuple[str | int, ...]
MOST_LISTED = 50  # problems in one message


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a scene, with its place; ``line`` is None where no line can be named."""

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


class Finding(NamedTuple):
    """One thing wrong with a scene, by the path of its key; ``expected`` and ``remedy`` are parts of a sentence."""

    path: KeyPath
    found: str
    expected: str
    remedy: str

    def below(self, *path: str | int) -> Finding:
        """The same finding, its path continued upwards."""
        return self._replace(path=(*path, *self.path))

    def at(self, file: str, line: int | None) -> Problem:
        """The finding with its place."""
        return Problem(file, line, key_text(self.path), self.found, self.expected, self.remedy)


class SceneError(ValueError):
    """A scene that cannot be used, with every problem found in it."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = list(problems)
        # A file that is no scene at all must not fill the terminal.
        lines, more = [str(p) for p in self.problems[:MOST_LISTED]], len(self.problems) - MOST_LISTED
        super().__init__("\n".join([*lines, *([f"{problems[0].file}: and {more} more problems"] if more > 0 else [])]))


class RefusalError(ValueError):
    """A value or an override that cannot be used: what was found, what was expected, what to do."""

    def __init__(self, found: str, expected: str, remedy: str) -> None:
        super().__init__(found, expected, remedy)

    def __str__(self) -> str:
        found, expected, remedy = self.args
        return f"found {found}, expected {expected}; {remedy}"


def key_text(path: KeyPath) -> str:
    """A path as it is written in messages: ``candidates.poses[1].approach``."""
    parts = [f"[{p}]" if isinstance(p, int) else f".{p if p.isidentifier() else shown(p)}" for p in path]
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
    # A value may hold what a terminal would obey.
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
        # Units of one kind only: a length must not be offered as an angle.
        converts = is_number(value) and unit and target and UNITS[unit].si == UNITS[target].si
        right = f" = {converted(value, unit, target):.10g}" if converts else ""
        remedy = f"the unit is part of the key, so write `{same[0]}{right}`"
    elif home:
        remedy = f"it belongs to {home}"
    elif near := closest(key, keys):
        remedy = f"did you mean `{near}`?"
    else:
        expected, remedy = f"one of {', '.join(keys)}", "remove it"
    return Finding(path, "an unknown key", expected, remedy)


def is_number(value: Any) -> bool:
    """Whether a value is a number that can be converted to another unit."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300
