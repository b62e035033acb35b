"""Grasps for simulators and planners: which ones, the pose of the gripper, and the friction that each finger has.

Everything is in the frame of the object's own file, in SI units. A grasp is a case of `study.export.cases` with the
frame of a two-finger gripper laid into its pads.

The gripper's frame has its origin its hand's depth behind the middle between the centres of both undeformed contact
faces at first touch. Its z axis is the direction of approach, from the palm to the fingertips; its closing axis, x or
y, runs from finger 1 to finger 2; the third axis makes it right-handed. A parallel gripper may come from any side
across its closing axis, so ``approach`` says which: along the long side (x) or the short side (y) of finger 1's pad, or
against one of them (`study.case.reach` finds the clearest).
"""

import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from softjaw.friction.patch import FloatArray
from softjaw.study.case.reach import FREE, OPENED_MORE, clearest, hand_axes, opened, refused
from softjaw.study.export.cases import cases
from softjaw.study.export.rigid_body import scene_of
from softjaw.study.flags import LOST, Flag, flag_words, flags_in
from softjaw.study.grippers import Hand
from softjaw.study.messages import USAGE, StudyError, fault_of
from softjaw.study.quantities import BY_KEY, FORCE_RANGE, LEAST_FORCE, MAIN
from softjaw.study.ranking import index_of, judge, ranked, score_of, window
from softjaw.study.result.read import axes_of, maps_in
from softjaw.study.result.store import place_text
from softjaw.study.units import shown, shown_text

COMMENT = 100  # characters in a line of a comment


class GripperFrame(NamedTuple):
    """The gripper that comes to the grasps: its hand, and how it comes.

    ``approach`` are the directions that each grasp is written for; without any it is the one that suits it best.
    ``wider`` [m] is how much the fingers open beyond first touch before the grasp, as far as the stroke allows.
    """

    hand: Hand = Hand()
    approach: tuple[str, ...] = ("minus-x",)
    wider: float = OPENED_MORE
    object_frame: str = "object"


class Hold(NamedTuple):
    """How the gripper takes a grasp: joint values before it and in it, depth [m], and why it cannot."""

    open_joints: dict[str, float]
    closed_joints: dict[str, float]
    depth: float
    unfit: tuple[str, ...]


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
    hold: Hold

    @property
    def maps(self) -> dict[str, float]:
        """Maps by name, NaN where there is nothing."""
        return {name: float(value) for name, value in self.case["maps"].items()}

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it is no grasp to write: it slips, does harm, holds nothing, or is none for this gripper."""
        known = Flag.OUT_OF_REACH * bool(self.hold.unfit)  # which says it better
        lost = tuple(flag.word for flag in flags_in(self.case["flags"] & LOST & ~known))
        return (*lost, *(("payload 0",) if self.maps.get("payload", np.nan) <= 0 else ()), *self.hold.unfit)

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

    @property
    def remark(self) -> str:
        """Place, force, and what the format has no field for, in a few lines."""
        known = []
        for name in (n for n in (*MAIN, *FORCE_RANGE) if np.isfinite(self.maps.get(n, np.nan))):
            q, value, error = BY_KEY.get(f"maps/{name}"), self.maps[name], self.maps.get(f"{name}_error", np.nan)
            error, unit = q.error_in_unit(error, value) if q else error, self.units[name]
            doubt = f" +- {shown_text(error, unit, 2)}" if np.isfinite(error) else ""
            # a value stays in one line with its name and unit
            known.append(f"{name} {shown_text(value, unit)}{doubt}".replace(" ", "\xa0"))
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
    R = hand_axes(case["fingers"][0]["pose_rotation"], approach, closing)
    return R, _middle(case) - depth * R[:, 2]


def _middle(case: dict[str, Any]) -> FloatArray:
    """Middle between the pads' faces at first touch ``(3,)`` [m]."""
    return np.asarray(sum(pad["pose_origin"] for pad in case["fingers"]) / 2)


def chosen(
    ds: xr.Dataset, model: str = "ccm", force: float | None = None, by: str | None = None, top: int = 0,
    least: Mapping[str, float] = MappingProxyType({}), hand: Hand | None = None,
) -> tuple[list[dict[str, Any]], list[str], str]:  # fmt: skip
    """Cases of the first ``top`` grasps (0: all), the best first, the same in words, and the map that ranks them.

    They are ranked ``by`` a map at a ``force`` [N], as ``softjaw show`` does, for this ``hand`` or the scene's.
    ``least`` gives smallest values by the name of a map, in the unit in which ``softjaw show`` prints it; a grasp with
    less is left out.

    Raises `StudyError`: A force outside of the solved ones, or a map that the file does not have.
    """
    with fault_of(ds.attrs["file"], ValueError):
        score = score_of(ds, by)
    with fault_of("--force", ValueError):
        at = judge(ds, force=window(ds) if force is None else force, by=score, top=top or 1, hand=hand)
    k, by = at.attrs["level"], at.attrs["score"]
    units = maps_in(at)
    if unknown := [name for name in least if name not in units]:
        raise StudyError(USAGE, f"--min: found '{unknown[0]}', expected one of {', '.join(units)}")
    which = [index_of(at, int(c), k) for c in ranked(at, k, by)]
    bounds = {name: value / shown(1.0, units[name]) for name, value in least.items()}
    # NaN is not at least anything, so a grasp without the value is left out.
    listed = [
        (case, place_text(axes_of(at), at.label.values, index))
        for index, case in zip(which, cases(at, model, which), strict=True)
        if all(case["maps"][name] >= value for name, value in bounds.items())
    ][: top or None]
    return [case for case, _ in listed], [place for _, place in listed], by


def grasps(ds: xr.Dataset, gripper: GripperFrame, **choice: Any) -> list[RankedGrasp]:
    """The `chosen` grasps with the gripper's pose, one for each direction of approach."""
    hand = gripper.hand if gripper.hand != Hand() else None
    cases, places, by = chosen(ds, **choice, hand=hand)
    values = [case["maps"][by] if by != LEAST_FORCE else 1.0 / case["maps"]["force_low"] for case in cases]
    score = np.nan_to_num([max(float(value), 0.0) for value in values])
    best, units = max(score, default=0.0), maps_in(ds)
    made = []
    for i, (case, place) in enumerate(zip(cases, places, strict=True)):
        merit = float(score[i] / best) if best > 0 else 0.0
        for approach, hold in holds(ds, case, gripper).items():
            name = f"grasp_{i}" + (f"_{approach.replace('-', '_')}" if len(gripper.approach) > 1 else "")
            R, o = gripper_frame(case, approach, gripper.hand.closing, hold.depth)
            made.append(RankedGrasp(name, place, case, R, o, merit, case["place"]["normal_force"], units, hold))
    return made


def holds(ds: xr.Dataset, case: dict[str, Any], gripper: GripperFrame) -> dict[str, Hold]:
    """By approach how the gripper takes a case."""
    hand, maps, force = gripper.hand, case["maps"], case["place"]["normal_force"]
    scene = scene_of(ds, case)
    foam, opening = 2 * scene.gripper.pad_thickness, float(maps["opening"])
    wide, _, depth = opened(hand, scene.gripper, opening, gripper.wider)
    beyond, closed = refused(hand, scene.gripper, opening, force), float(maps["opening_loaded"]) + foam
    joints, pad = (hand.values(wide + foam), hand.values(closed), depth), case["fingers"][0]["pose_rotation"]
    if gripper.approach:
        return dict.fromkeys(gripper.approach, Hold(*joints, tuple(beyond)))
    unknown = "the object cannot be built, so that no approach can be chosen"
    with fault_of(unknown, ValueError, OSError, ending="; name one with --approach"):
        approach, room = clearest(scene, hand, pad, _middle(case), wide, opening, depth)
    beyond += ["the hand meets the object from every side"] * (room < FREE and not beyond)
    return {approach: Hold(*joints, tuple(beyond))}


def first(grasps: Sequence[RankedGrasp], top: int = 0) -> list[RankedGrasp]:
    """Those of the first ``top`` cases (0: all); ``merit`` is relative to the best of them, and falls."""
    few = list(dict.fromkeys(grasp.place for grasp in grasps))[: top or None]
    listed, merit, best = list[RankedGrasp](), 1.0, grasps[0].merit if grasps else 0.0
    for grasp in (grasp for grasp in grasps if grasp.place in few):
        merit = min(merit, grasp.merit / best) if best > 0 else 0.0
        listed.append(replace(grasp, merit=merit))
    return listed


def usable(grasps: Sequence[RankedGrasp]) -> tuple[list[RankedGrasp], str]:
    """Grasps that hold the object, do no harm and fit the gripper, and a sentence on those left out."""
    valid = [grasp for grasp in grasps if not grasp.reasons]
    reasons = Counter(reason for grasp in grasps for reason in grasp.reasons)
    listed = ", ".join(f"{reason} ({count})" if len(reasons) > 1 else reason for reason, count in reasons.items())
    omitted = f"{len(grasps) - len(valid)} of {len(grasps)} grasps left out at {grasps[0].force:g} N" if reasons else ""
    # the force to use is known only where a solved one holds the object
    more = any(g.case["flags"] & Flag.TOO_WEAK and g.maps.get("force_low", 0.0) > g.force for g in grasps)
    return valid, f"{omitted}: {listed}{'; --force names another' * more}" if reasons else ""
