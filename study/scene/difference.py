"""In which keys two scenes differ, in words."""

from __future__ import annotations

import tomllib
from typing import Any

from softjaw.study.scene.errors import shown
from softjaw.study.scene.loading import flat

MOST_NAMED, WIDTH = 5, 30


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
    named = [f"{key} is {value_text(one)} there and {value_text(other)} here" for key, one, other in changed]
    more = [f"and {len(named) - MOST_NAMED} more keys"] if len(named) > MOST_NAMED else []
    return "; ".join([*named[:MOST_NAMED], *more])


def changes(theirs: str, ours: str) -> list[tuple[str, Any, Any]]:
    """Keys that change results and differ between two effective scenes, with both values; None is a key not set.

    Raises
    ------
    ValueError
        One of them is not TOML.
    """
    one, other = (_values(text) for text in (theirs, ours))
    keys = [key for key in dict.fromkeys([*other, *one]) if one.get(key) != other.get(key)]
    return [(key, one.get(key), other.get(key)) for key in keys]


def _values(text: str) -> dict[str, Any]:
    """Values by dotted key, without those that change no result."""
    try:
        tables = tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    values = flat({name: table for name, table in tables.items() if name not in ("output", "run")})
    for pose in values.get("candidates.poses", ()):
        pose.pop("label", None)
    return {key: value for key, value in values.items() if key != "object.name"}


def value_text(value: Any) -> str:
    """A value of a scene in a few words."""
    return "not set" if value is None else shown(value, WIDTH)
