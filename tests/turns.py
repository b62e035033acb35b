"""Decisions that must not hang on rounding are tried in random positions with numbers a little off."""

import os

import numpy as np

TURNS = int(os.environ.get("TURNS", 20))  # positions; ``make test-long`` asks for more


def shaken(rng, x):
    """Every number up to four units in the last place away."""
    return np.asarray(x) * (1 + np.finfo(float).eps * rng.integers(-4, 5, size=np.shape(x)))
