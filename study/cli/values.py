"""Types of the command line's options: numbers in their ranges, directions, and names."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable


def whole(least: int) -> Callable[[str], int]:
    """A type of whole numbers from ``least`` to a million."""

    def count(text: str) -> int:
        if not least <= (value := int(text)) <= 10**6:
            raise argparse.ArgumentTypeError(f"found {text}, expected {least} to 1000000")
        return value

    return count


def bound(text: str) -> tuple[str, float]:
    """A name and a number with an equals sign between them."""
    name, _, value = text.partition("=")
    try:
        return name, finite(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"found {text}, expected a map and a number, such as payload=200") from None


def names(text: str) -> tuple[str, ...]:
    """Names with commas between them, none of them empty."""
    parts = tuple(name.strip() for name in text.split(","))
    if not all(parts):
        raise argparse.ArgumentTypeError(f"found {text}, expected names with commas between them")
    return parts


def pair(text: str) -> tuple[str, ...]:
    """Two names with a comma between them."""
    if len(two := names(text)) != 2:
        raise argparse.ArgumentTypeError(f"found {text}, expected two names with a comma between them")
    return two


def place(text: str) -> tuple[float, float | None]:
    """A station and perhaps an angle, with a comma between them."""
    station, comma, angle = text.partition(",")
    try:
        return finite(station), finite(angle) if comma else None
    except ValueError:
        raise argparse.ArgumentTypeError(f"found {text}, expected a station, or station,angle as in 75,90") from None


def not_negative(text: str) -> float:
    """A number, 0 or above."""
    if not 0 <= (value := float(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"found {text}, expected a number, 0 or above")
    return value


def counts(text: str) -> tuple[int, ...]:
    """Whole numbers above 0 with commas between them."""
    return tuple(map(whole(1), text.split(",")))


def seconds(text: str) -> float:
    """A time [s] of at least 0.1 s."""
    if not 0.1 <= (value := float(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"found {text}, expected at least 0.1 s")
    return value


def finite(text: str) -> float:
    """A number that is neither infinite nor NaN."""
    if not math.isfinite(value := float(text)):
        raise argparse.ArgumentTypeError(f"found {text}, expected a number")
    return value


def positive(text: str) -> float:
    """A number above 0."""
    if not 0 < (value := float(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"found {text}, expected a number above 0")
    return value


def direction(text: str) -> list[float]:
    """Three numbers with commas between them, not all of them 0."""
    try:
        vector = [float(part) for part in text.split(",")]
    except ValueError:
        vector = []
    if len(vector) != 3 or not all(map(math.isfinite, vector)) or not any(vector):
        raise argparse.ArgumentTypeError(f"found {text}, expected three numbers such as 1,0,0, not all of them 0")
    return vector
