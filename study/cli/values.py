"""Types of the command line's options: numbers in their ranges, lists, names."""

from __future__ import annotations

import math
from argparse import ArgumentTypeError
from collections.abc import Callable
from typing import Any

MILLION = 10**6
NO_DRAKE = "Drake has no parameter for it: no torsional friction, or a pressure field of its own; expected"


def number(expected: str = "a number", least: float = -math.inf) -> Callable[[str], float]:
    """A type of finite numbers from ``least``; ``expected`` says what they are."""

    def value(text: str) -> float:
        try:
            given = float(text)
        except ValueError:
            given = math.nan
        if not (math.isfinite(given) and given >= least):
            raise ArgumentTypeError(f"found {text}, expected {expected}")
        return given

    return value


POSITIVE = number("a number above 0", math.ulp(0.0))


def whole(least: int) -> Callable[[str], int]:
    """A type of whole numbers from ``least`` to a million."""

    def count(text: str) -> int:
        if not (text.strip().lstrip("+-").isdigit() and least <= int(text) <= MILLION):
            raise ArgumentTypeError(f"found {text}, expected a whole number from {least} to {MILLION}")
        return int(text)

    return count


def several(
    kind: Callable[[str], Any], expected: str, least: int = 1, most: int = MILLION
) -> Callable[[str], tuple[Any, ...]]:
    """A type of ``least`` to ``most`` values of a kind with commas between them."""

    def parts(text: str) -> tuple[Any, ...]:
        try:
            given = tuple(map(kind, text.split(",")))
        except ArgumentTypeError:
            given = ()
        if not least <= len(given) <= most:
            raise ArgumentTypeError(f"found {text}, expected {expected}")
        return given

    return parts


def named(text: str) -> str:
    """A name that is not empty."""
    if not text.strip():
        raise ArgumentTypeError("found no name")
    return text.strip()


def bound(text: str) -> tuple[str, float]:
    """A name and a number with an equals sign between them."""
    key, _, value = text.partition("=")
    return key, number("a map and a number, such as payload=200")(value)


def direction(text: str) -> tuple[float, ...]:
    """Three numbers with commas between them, not all of them 0."""
    vector = several(number(), "three numbers, such as 1,0,0", 3, 3)(text)
    if not any(vector):
        raise ArgumentTypeError(f"found {text}, expected a direction, such as 1,0,0")
    return vector


def format_of(text: str) -> str:
    """A format of `export`; another one than those is refused by argparse, Drake with the reason."""
    if text == "drake":
        raise ArgumentTypeError(f"{NO_DRAKE} another format")
    return text
