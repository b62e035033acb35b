"""Texts from files of unknown origin, made harmless for a terminal."""

from __future__ import annotations

import re

# What a terminal obeys or what hides text: control characters, line separators, changes of direction, halves of letters
UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufeff]")


def printable(text: str) -> str:
    r"""A text of unknown origin with nothing in it that a terminal would obey.

    >>> print(printable("a\x1b[2Jb"))
    a\u001b[2Jb
    """
    return UNPRINTABLE.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def shortened(text: str, width: int = 80) -> str:
    """A printable text of at most ``width`` letters."""
    text = printable(text)
    return text if len(text) <= width else text[: width - 4] + " ..."
