"""Which grasps come first: by score, but those that fail in the hand come last."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.case.result import TIE
from softjaw.study.flags import BORNE, LOST, Flag, flags_in
from softjaw.study.result.layout import DONE

IntArray = NDArray[np.int64]
NOTHING = 1e-12  # of the largest value, below which a difference is none


def judged(ds: Any) -> IntArray:
    """Flags of all cases, with `Flag.TOO_WEAK` and `Flag.TOO_STRONG` where a case lies outside its safe force range.

    A force is too weak where the grasp does not hold the object with the safety that is asked for, and too strong above
    ``force_high``. Files that derive no such range have their own flags only.
    """
    flags = ds["flags"].values.copy()
    if "force_low" in ds:
        flags |= Flag.TOO_WEAK * (ds["safety_factor"].sel(model="ccm").values < safety_of(ds) * (1 - TIE))
    if "force_high" in ds:
        flags |= Flag.TOO_STRONG * (ds["normal_force"].values > ds["force_high"].values[..., None] * (1 + 1e-9))
    return flags


def safety_of(ds: Any) -> float:
    """How many times its mass the object has to be held, by its scene; 1 where that does not say it."""
    return float(tomllib.loads(ds.attrs.get("scene", "")).get("task", {}).get("safety", 1.0))


def falling(values: np.ndarray) -> np.ndarray:
    """Positions from the largest to the smallest value, NaN last; of values within `TIE` the first comes first.

    >>> falling(np.array([1.0, 3.0, np.nan, 3.0 + 1e-15])).tolist()
    [1, 3, 0, 2]
    """
    return np.argsort(_places(np.asarray(values, float)), kind="stable")


def largest(values: np.ndarray) -> int:
    """Position of the largest value in the flattened array; of values within `TIE` the first.

    >>> largest(np.array([np.nan, 2.0, 2.0 + 1e-15])), largest(-np.array([2.0 + 1e-15, 2.0]))
    (1, 0)
    """
    return int(falling(np.ravel(values))[0])


def nearest(values: np.ndarray, wanted: float) -> int:
    """Position of the value that is nearest to another one; of two that are equally near the first.

    >>> nearest(np.array([0.1, 0.3]), 0.2), nearest(np.array([0.1, 0.3]), 0.21)
    (0, 1)
    """
    return largest(-np.abs(np.asarray(values, float) - wanted))


def _places(values: np.ndarray) -> IntArray:
    """Place of every value in the ranking, counted from 0; those within `TIE` of the next share one."""
    known = np.nan_to_num(values, nan=-np.inf)
    order = np.argsort(-known, kind="stable")
    found = known[order]
    same = TIE * np.abs(found[1:]) + NOTHING * np.abs(values[np.isfinite(values)]).max(initial=0.0)
    with np.errstate(invalid="ignore"):  # from one that is not there to the next
        apart = found[:-1] - found[1:] > np.where(np.isfinite(same), same, 0.0)
    places = np.empty(len(order), np.int64)
    places[order] = np.concatenate([[0], np.cumsum(apart)])[: len(order)]
    return places


def ranking(score: np.ndarray, flags: np.ndarray) -> np.ndarray:
    """Positions from the best to the worst: by score, but with the `LOST` ones last; ties as in `falling`.

    >>> ranking(np.array([1.0, 3.0, 2.0]), np.array([0, 1024, 0])).tolist()
    [2, 0, 1]
    """
    lost = (np.nan_to_num(flags).astype(int) & LOST) > 0
    return np.lexsort((_places(np.asarray(score, float)), lost))


def passed_over(score: np.ndarray, flags: np.ndarray) -> tuple[list[int], str]:
    """Positions of the `LOST` grasps that score higher than the best usable one, the highest first, and what they lack.

    >>> passed_over(np.array([1.0, 3.0, 2.0]), np.array([0, 1024, Flag.TOO_STRONG]))
    ([1, 2], 'slips or too strong')
    """
    order = ranking(score, flags)
    if not len(order) or flags[order[0]] & LOST or not np.isfinite(score[order[0]]):
        return [], ""
    better = [int(i) for i in order if flags[i] & LOST and score[i] > score[order[0]] * (1 + 1e-3)]
    marks = int(np.bitwise_or.reduce([int(flags[i]) & LOST for i in better])) if better else 0
    return better, " or ".join(flag.word for flag in flags_in(marks))


def borne_level(status: np.ndarray, flags: np.ndarray) -> int | None:
    """Highest force level at which some solved grasp is neither too weak nor too strong; None where all forces are.

    ``status`` and ``flags`` are over all cases, the last axis being the force.
    """
    borne = ((status == DONE) & (flags & BORNE == 0)).reshape(-1, status.shape[-1]).any(axis=0)
    return int(np.flatnonzero(borne)[-1]) if borne.any() else None
