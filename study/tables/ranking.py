"""What flags mean, and which grasps come first: by score, but those that fail in the hand come last."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.storage.layout import DONE

IntArray = NDArray[np.int64]
SLIDES_OUT, YIELDS = 16384, 32768  # flags of a file, as study.storage.quantities says
TOO_WEAK, TOO_STRONG = 1 << 20, 1 << 21  # flags of no file: the force is outside the window that the file derives
OF_FILE = TOO_WEAK - 1
BORNE = SLIDES_OUT | YIELDS | TOO_WEAK | TOO_STRONG  # what another force may cure
LOST = 1024 | 2048 | BORNE  # of a grasp that does not hold, or does harm, as it was computed

FLAGS = (  # as study.storage.quantities defines them
    (1, "no torque", "a contact carries no torque about its normal"),
    (2, "no force", "a contact carries no force along one of its axes"),
    (8, "hole", "the centre of pressure lies over a hole of the patch"),
    (4 + 16, "frame", "the contact frame came from a rule for degenerate patches"),
    (32, "mixed", "normals of a patch point to opposite sides: its normal force and frame cannot be trusted"),
    (64, "overhang", "some loaded faces of a patch are turned more than 90 deg from the contact normal"),
    (256, "askew", "contacts more than 5 deg from antipodal"),
    (512, "nodal", "solved with nodal gaps, because weighted ones had no solution"),
    (1024, "slips", "the line that joins the contacts leaves a friction cone, so the grasp slips"),
    (2048, "overlap", "the fingers' pads run into each other beside the object"),
    (4096, "coarse", "the mesh is coarse for this contact: take more elements before trusting the numbers"),
    (8192, "snapped", "the wall has snapped in on the way to this force"),
    (16384, "slides out", "the pads push the object along its axis with more than friction can hold"),
    (32768, "yields", "the wall's stress is above its yield strength: the dent stays"),
    (65536, "no fit", "a limit surface could not be fitted: the ellipsoid from three motions stands in"),
    (262144, "jumped", "the pad jumped on the way to this force: the state depends on the load path"),
    (TOO_WEAK, "too weak", "this force does not hold the object's weight"),
    (TOO_STRONG, "too strong", "this force dents the wall deeper than is allowed, or makes it yield"),
)


def judged(result: Any) -> IntArray:
    """Flags of all cases, with `TOO_WEAK` and `TOO_STRONG` where a case lies outside its window of forces.

    A force is too weak where the grasp does not hold the object's weight, and too strong above ``force_high``. Files
    that derive no window have their own flags only.
    """
    flags = np.nan_to_num(result.map("flags")).astype(np.int64)
    bounds = {d.name for d in getattr(result.layout, "derived", ())}
    if "force_low" in bounds:
        flags |= TOO_WEAK * (result.map("safety_factor", "curved") < 1)
    if "force_high" in bounds:
        flags |= TOO_STRONG * (result.axes[-1].values > result.derived("force_high")[..., None] * (1 + 1e-9))
    return flags


def ranking(score: np.ndarray, flags: np.ndarray) -> np.ndarray:
    """Positions from the best to the worst: by score, but with the `LOST` ones last.

    >>> ranking(np.array([1.0, 3.0, 2.0]), np.array([0, 1024, 0])).tolist()
    [2, 0, 1]
    """
    lost = (np.nan_to_num(flags).astype(int) & LOST) > 0
    return np.lexsort((-np.nan_to_num(score, nan=-np.inf), lost))


def passed_over(score: np.ndarray, flags: np.ndarray) -> tuple[list[int], str]:
    """Positions of the `LOST` grasps that score higher than the best usable one, the highest first, and what they lack.

    >>> passed_over(np.array([1.0, 3.0, 2.0]), np.array([0, 1024, TOO_STRONG]))
    ([1, 2], 'slips or too strong')
    """
    order = ranking(score, flags)
    if not len(order) or flags[order[0]] & LOST or not np.isfinite(score[order[0]]):
        return [], ""
    better = [int(i) for i in order if flags[i] & LOST and score[i] > score[order[0]] * (1 + 1e-3)]
    marks = int(np.bitwise_or.reduce([int(flags[i]) & LOST for i in better])) if better else 0
    return better, " or ".join(name for bit, name, _ in FLAGS if marks & bit)


def borne_level(status: np.ndarray, flags: np.ndarray) -> int | None:
    """Highest force level at which some solved grasp is neither too weak nor too strong; None where all forces are.

    ``status`` and ``flags`` are over all cases, the last axis being the force.
    """
    borne = ((status == DONE) & (flags & BORNE == 0)).reshape(-1, status.shape[-1]).any(axis=0)
    return int(np.flatnonzero(borne)[-1]) if borne.any() else None
