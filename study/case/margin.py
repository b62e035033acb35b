"""Comparisons that rounding does not decide: with a limit, and of values with each other."""

from __future__ import annotations

MARGIN = 1e-6  # of a limit: what is nearer to it is undecided
TIE = 1e-6  # relative difference of values that is none: images of one grasp, or equal as far as can be told


def surely_below(value: float, limit: float) -> bool:
    """Whether a value is below a limit by more than `MARGIN`; no where that is undecided, or the value is NaN.

    >>> surely_below(0.9, 1.0), surely_below(1.0 - 1e-12, 1.0), surely_below(1.1, 1.0)
    (True, False, False)
    """
    return value <= limit * (1.0 - MARGIN)
