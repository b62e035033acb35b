"""The coarser mesh of a pad; checking a scene needs no more, and does without numpy."""

from __future__ import annotations


def halved(elements: tuple[int, int, int]) -> tuple[int, int, int]:
    """Half as many elements in every direction, rounded up; to even numbers along the sides where they are even.

    >>> halved((20, 10, 6))
    (10, 6, 3)
    """
    # symmetry of the pad needs even numbers, and a mesh line in the middle is where the fine mesh has one
    length, width = (2 * -(-n // 4) if n % 2 == 0 else -(-n // 2) for n in elements[:2])
    return length, width, -(-elements[2] // 2)
