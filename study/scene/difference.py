"""In which keys two scenes differ, in words."""

from __future__ import annotations

import tomllib
from typing import Any

from study.scene.errors import shown
from study.scene.loading import flat

MOST_NAMED, WIDTH = 5, 30


def differences(theirs: str, ours: str) -> str:
    r"""Up to five keys that change results and differ between two effective scenes, with both values.

    >>> differences("[friction]\nmu = 0.8", "[friction]\nmu = 0.5")
    'friction.mu is 0.8 there and 0.5 here'
    """
    try:
        one, other = (_values(text) for text in (theirs, ours))
    except ValueError:
        return "its scene cannot be read"
    keys = [key for key in dict.fromkeys([*other, *one]) if one.get(key) != other.get(key)]
    if not keys:
        return "the same keys, but another mesh file or another version"
    named = [f"{key} is {_text(one.get(key))} there and {_text(other.get(key))} here" for key in keys[:MOST_NAMED]]
    more = [f"and {len(keys) - MOST_NAMED} more keys"] if len(keys) > MOST_NAMED else []
    return "; ".join([*named, *more])


def _values(text: str) -> dict[str, Any]:
    """Values by dotted key, without those that change no result."""
    values = flat({section: table for section, table in tomllib.loads(text).items() if section != "output"})
    for pose in values.get("candidates.poses", ()):
        pose.pop("label", None)
    return {key: value for key, value in values.items() if key != "object.name"}


def _text(value: Any) -> str:
    return "not set" if value is None else shown(value, WIDTH)
