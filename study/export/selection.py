"""Grasps for simulators and planners: which ones, the pose of the gripper, and the friction that each finger has.

Everything is in the frame of the object's own file, in SI units. A grasp is a case of `study.export.cases` with the
frame of a two-finger gripper laid into its pads.

The gripper's frame has its origin ``depth`` behind the middle between the centres of both undeformed contact faces at
first touch. Its z axis is the direction of approach, from the palm to the fingertips; its closing axis, x or y, runs
from finger 1 to finger 2; the third axis makes it right-handed. A parallel gripper may come from any side across its
closing axis, so ``approach`` says which: along the long side of the pads (x) or their short side (y) of finger 1's pad,
or against one of them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from softjaw.study.export.cases import cases
from softjaw.study.flags import LOST, flag_words, flags_in
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.quantities import FORCE_RANGE, LEAST_FORCE, MAIN
from softjaw.study.ranking import at_level, judged, ranked, score_of
from softjaw.study.result.read import axes_of, maps_in
from softjaw.study.result.store import place_text
from softjaw.study.units import shown, shown_text

FloatArray = NDArray[np.float64]
APPROACHES = {"x": (0, 1.0), "minus-x": (0, -1.0), "y": (1, 1.0), "minus-y": (1, -1.0)}  # axis of finger 1's pad, sign
COMMENT = 100  # characters in a line of a comment


@dataclass(frozen=True)
class Selection:
    """Which grasps are written: the first ``top`` (0: all), ranked ``by`` a map at a ``force`` [N].

    ``least`` gives smallest values by the name of a map, in the unit in which ``softjaw show`` prints it; a grasp with
    less is left out.
    """

    model: str = "ccm"
    force: float | None = None
    by: str | None = None
    top: int = 0
    least: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class GripperFrame:
    """Where the gripper's frame lies in the pads (see the module), with names and distances that formats want.

    ``joints`` are those of both fingers, each at half the opening; ``wider`` [m] is how much the fingers open beyond
    first touch before the grasp; ``depth`` [m] lies between the origin of the frame and the middle of the pads.
    """

    approach: tuple[str, ...] = ("minus-x",)
    closing: str = ""
    depth: float = 0.0
    wider: float = 0.02
    joints: tuple[str, ...] = ("finger_joint1", "finger_joint2")
    gripper_frame: str = "gripper"
    object_frame: str = "object"


@dataclass(frozen=True, eq=False)
class RankedGrasp:
    """A solved case as planners take it.

    ``place`` is the case in words. ``rotation`` ``(3, 3)`` has the gripper's axes as columns, ``origin`` ``(3,)`` [m]
    is where it stands. ``merit`` is what the grasp is ranked by over the largest of all that are written: 1 for the
    best, 0 where there is nothing.
    """

    name: str
    place: str
    case: dict[str, Any]
    rotation: FloatArray
    origin: FloatArray
    merit: float
    force: float
    units: dict[str, str]

    @property
    def maps(self) -> dict[str, float]:
        """Maps by name, NaN where there is nothing."""
        return {name: float(value) for name, value in self.case["maps"].items()}

    @property
    def lost(self) -> bool:
        """Whether it slips, does harm or does not hold the object."""
        return bool(self.case["flags"] & LOST)

    @property
    def warnings(self) -> list[str]:
        """Words of its flags."""
        return [flag.word for flag in flags_in(self.case["flags"])]

    @property
    def quaternion(self) -> FloatArray:
        """Rotation of the gripper as ``(x, y, z, w)``, ``w`` not negative."""
        return quaternion(self.rotation)

    @property
    def matrix(self) -> FloatArray:
        """Rotation and origin as a homogeneous matrix ``(4, 4)``."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation, self.origin
        return matrix

    def half(self, opening: str) -> float:
        """Half of the opening at first touch or under load [m], which is where each finger stands."""
        return self.maps[opening] / 2

    @property
    def remark(self) -> str:
        """Place, force, and what the format has no field for, in a few lines."""
        known = []
        for name in (n for n in (*MAIN, *FORCE_RANGE) if np.isfinite(self.maps.get(n, np.nan))):
            error = self.maps.get(f"{name}_error", np.nan)
            doubt = f" +- {100 * error:.2g} %" if np.isfinite(error) else ""
            text = f"{name} {shown_text(self.maps[name], self.units[name])}{doubt}"
            known.append(text.replace(" ", "\xa0"))  # a value stays in one line with its name and unit
        words = flag_words(self.case["flags"], self.maps.get("misalignment", np.nan)) or "none"
        lines = [line.replace("\xa0", " ") for line in textwrap.wrap(", ".join(known), COMMENT)]
        return "\n".join([f"{self.place} per finger", *lines, f"warnings: {words}"])


def quaternion(rotation: FloatArray) -> FloatArray:
    """A rotation ``(3, 3)`` as ``(x, y, z, w)`` with ``w`` not negative.

    >>> quaternion(np.diag([1.0, -1.0, -1.0])).tolist()
    [1.0, 0.0, 0.0, 0.0]
    """
    return np.asarray(Rotation.from_matrix(rotation).as_quat(canonical=True)) + 0.0  # adding 0 turns -0 into 0


def gripper_frame(case: dict[str, Any], approach: str, closing: str, depth: float) -> tuple[FloatArray, FloatArray]:
    """Axes as columns ``(3, 3)`` and origin ``(3,)`` [m] of the gripper in a grasp; see the module."""
    pads = case["fingers"]
    axis, sign = APPROACHES[approach]
    z, across = sign * pads[0]["pose_rotation"][:, axis], pads[0]["pose_rotation"][:, 2]
    columns = [across, np.cross(z, across), z] if closing == "x" else [np.cross(across, z), across, z]
    middle = (pads[0]["pose_origin"] + pads[1]["pose_origin"]) / 2
    return np.column_stack(columns), middle - depth * z


def chosen(ds: xr.Dataset, choice: Selection) -> tuple[list[dict[str, Any]], list[str], str]:
    """Cases of the chosen grasps, the best first, the same in words, and the map that they are ranked by.

    Raises
    ------
    StudyError
        A force outside of the solved ones, or a map that the file does not have.
    """
    try:
        at, k, _ = at_level(ds, choice.force)
    except ValueError as error:
        raise StudyError(USAGE, f"--force: {error}") from error
    units = maps_in(at)
    if unknown := [name for name in choice.least if name not in units]:
        raise StudyError(USAGE, f"--min: found '{unknown[0]}', expected one of {', '.join(units)}")
    at = at.assign(flags=(at.status.dims, judged(at), at["flags"].attrs))
    shape, order = at.status.shape[:-1], ranked(at, k, choice.by)
    which = [(*(int(i) for i in np.unravel_index(c, shape)), k) for c in order]
    least = {name: value / shown(1.0, units[name]) for name, value in choice.least.items()}
    # NaN is not at least anything, so a grasp without the value is left out.
    found = [
        (case, place_text(axes_of(at), at.label.values, index))
        for index, case in zip(which, cases(at, choice.model, which), strict=True)
        if all(case["maps"][name] >= value for name, value in least.items())
    ][: choice.top or None]
    return [case for case, _ in found], [place for _, place in found], score_of(at, choice.by)


def grasps(ds: xr.Dataset, choice: Selection, gripper: GripperFrame) -> list[RankedGrasp]:
    """The chosen grasps with the gripper's pose, one for each direction of approach."""
    cases, places, by = chosen(ds, choice)
    values = [case["maps"][by] if by != LEAST_FORCE else 1.0 / case["maps"]["force_low"] for case in cases]
    score = np.nan_to_num([max(float(value), 0.0) for value in values])
    best, units = max(score, default=0.0), maps_in(ds)
    made = []
    for i, (case, place) in enumerate(zip(cases, places, strict=True)):
        merit = float(score[i] / best) if best > 0 else 0.0
        for approach in gripper.approach:
            R, o = gripper_frame(case, approach, gripper.closing, gripper.depth)
            name = f"grasp_{i}" + (f"_{approach.replace('-', '_')}" if len(gripper.approach) > 1 else "")
            made.append(RankedGrasp(name, place, case, R, o, merit, case["place"]["normal_force"], units))
    return made


def usable(found: Sequence[RankedGrasp]) -> tuple[list[RankedGrasp], str]:
    """Grasps that hold the object and do no harm, and a sentence on those left out."""
    kept = [grasp for grasp in found if not grasp.lost]
    left = [grasp for grasp in found if grasp.lost]
    words = sorted({word for grasp in left for word in grasp.warnings})
    return kept, f"{len(left)} grasps left out ({', '.join(words)})" if left else ""

