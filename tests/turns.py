"""Decisions that must not hang on rounding are tried in random positions with numbers a little off."""

import os

import numpy as np
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

TURNS = int(os.environ.get("TURNS", 20))  # positions; ``make test-long`` asks for more
ULPS = np.finfo(float).eps * np.arange(-8, 9)
# the same examples on every rank and every day, and no folder of past failures beside the project; no seed is simpler
tries = settings(max_examples=TURNS, deadline=None, derandomize=True, database=None, phases=[Phase.generate])
seeds = st.integers(0, 2**32 - 1)


def seeded(test):
    """Try a test with many seeds, its argument ``seed``."""
    return tries(given(seed=seeds)(test))


def shaken(rng, x):
    """Every number up to four units in the last place away."""
    return np.asarray(x) * (1 + np.finfo(float).eps * rng.integers(-4, 5, size=np.shape(x)))
