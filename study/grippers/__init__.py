"""Grippers: what a scene's ``[gripper]`` gets from one, and what planners need to know of its hand.

Each is a TOML file in this folder, with the source beside every number; a user's own gripper is a file of the same
form. Lengths are in mm in the hand's own frame: z is the approach, from the palm to the fingertips, and the fingers
close along ``closing``. The foam sits on fingers whose bare faces meet at zero, so that ``gap``, the distance of the
bare faces, is the opening of the pads and both thicknesses of the foam.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from softjaw.study.messages import USAGE, StudyError
from softjaw.study.units import in_si

FOLDER = Path(__file__).parent
PRESETS = tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))
EXPECTED = f"one of {', '.join(PRESETS)}, or a file of the same form"
APPROACHES = {"x": (0, 1.0), "minus-x": (0, -1.0), "y": (1, 1.0), "minus-y": (1, -1.0)}  # axis of finger 1's pad, sign
Approach = Annotated[str, Field(pattern="^(minus-)?[xy]$")]
Size = Annotated[float, Field(gt=0)]
Pair = Annotated[tuple[float, float], Field(strict=False)]
Triple = Annotated[tuple[float, float, float], Field(strict=False)]
IN_FILES = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)  # a table within another does not inherit it


class Linkage(BaseModel):
    """Fingers on parallelograms: a crank turns about a pivot, and the pad keeps its direction.

    All are [along the closing axis, along the approach] [mm], when open: the pivot from the middle of the hand, the
    crank from the pivot, the pad's face from the end of the crank.
    """

    model_config = IN_FILES
    pivot: Pair
    crank: Pair
    pad: Pair

    def angle(self, gap: float) -> float:
        """Angle [rad] at which the bare faces are ``gap`` [mm] apart; 0 is open.

        >>> made = Linkage(pivot=(10, 0), crank=(0, 20), pad=(0, 5))
        >>> round(math.degrees(made.angle(0.0)), 9)
        30.0
        """
        across = gap / 2 - self.pivot[0] - self.pad[0]
        return math.acos(max(-1.0, min(1.0, across / math.hypot(*self.crank)))) - math.atan2(*self.crank[::-1])

    def depth(self, gap: float) -> float:
        """Distance [mm] along the approach from the hand's frame to the middle of the pads."""
        turn = self.angle(gap) + math.atan2(*self.crank[::-1])
        return self.pivot[1] + math.hypot(*self.crank) * math.sin(turn) + self.pad[1]


class Hand(BaseModel):
    """A parallel gripper as planners need it; a gripper of which nothing is known by default.

    ``stroke_mm`` is the largest gap, ``force_n`` the least and the largest force of one finger; makers often state the
    sum of both. ``joints`` have a value per gap [m/m], or per angle of the ``linkage_mm``
    [rad/rad], which then has a ``largest_angle``. ``palm_mm`` are two corners of a box, ``finger_mm`` the width of a
    finger and its thickness from the face outwards. ``approaches`` are those that the mounted pads allow.
    """

    model_config = IN_FILES
    frame: str = "gripper"
    closing: Literal["x", "y"] = "y"
    stroke_mm: float = Field(math.inf, gt=0)
    depth_mm: float = Field(0.0, ge=0)
    force_n: Pair = (0.0, math.inf)
    joints: dict[str, float] = Field(default={"finger_joint1": 0.5, "finger_joint2": 0.5}, min_length=1)
    linkage_mm: Linkage | None = None
    largest_angle: float = math.inf
    approaches: Annotated[tuple[Approach, ...], Field(strict=False, min_length=1)] = tuple(APPROACHES)
    palm_mm: Annotated[tuple[Triple, Triple], Field(strict=False)] | None = None
    finger_mm: Annotated[tuple[Size, Size], Field(strict=False)] | None = None

    def values(self, gap: float) -> dict[str, float]:
        """Joint values [m or rad] at a gap [m], within the stroke.

        >>> Hand(stroke_mm=80).values(0.1)
        {'finger_joint1': 0.04, 'finger_joint2': 0.04}
        """
        mm = max(0.0, min(1e3 * gap, self.stroke_mm))
        if self.linkage_mm is None:
            return {name: factor * mm / 1e3 for name, factor in self.joints.items()}
        angle = max(0.0, min(self.linkage_mm.angle(mm), self.largest_angle))
        return {name: factor * angle for name, factor in self.joints.items()}

    def closing_along(self, axis: Literal["x", "y"]) -> Hand:
        """The same hand in a frame that is turned about the approach, so that it closes along ``axis``.

        >>> Hand(palm_mm=((-3, -10, -50), (2, 10, 0))).closing_along("x").palm_mm
        ((-10.0, -2.0, -50.0), (10.0, 3.0, 0.0))
        """
        palm = self.palm_mm
        if palm and axis != self.closing:
            (x, y, z), (X, Y, Z) = palm
            palm = ((y, -X, z), (Y, -x, Z)) if axis == "x" else ((-Y, x, z), (-y, X, Z))
        return self.model_copy(update={"closing": axis, "palm_mm": palm})

    def depth(self, gap: float) -> float:
        """Distance [m] from the hand's frame to the middle of the pads at a gap [m]."""
        return in_si("depth_mm", self.linkage_mm.depth(1e3 * gap) if self.linkage_mm else self.depth_mm)


@lru_cache
def gripper_file(name: str) -> tuple[dict[str, Any], Hand]:
    """Keys of a scene's ``[gripper]`` and the hand, of a preset or of a file."""
    path = FOLDER / f"{name}.toml" if name in PRESETS else Path(name)
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
        hand = Hand.model_validate(tables.get("hand", {}))
        if other := [k for k, keys in tables.items() if k not in ("gripper", "hand") or not isinstance(keys, dict)]:
            raise ValueError(f"found {', '.join(other)}, expected tables [gripper] and [hand] alone")
        if "preset" in tables.get("gripper", {}):
            raise ValueError("found gripper.preset, expected the gripper's own numbers")
        if not 0 <= hand.force_n[0] <= hand.force_n[1]:
            raise ValueError(f"hand.force_n: found {list(hand.force_n)}, expected the least and the largest force")
    except OSError as error:
        raise StudyError(USAGE, f"gripper: found '{name}', expected {EXPECTED}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise StudyError(USAGE, f"{path}: hand.{where}: found {first['input']!r}; {first['msg']}") from error
    except ValueError as error:
        raise StudyError(USAGE, f"{path}: {error}") from error
    return tables.get("gripper", {}), hand


def filled_in(
    tables: dict[str, Any], folder: Path, given: Collection[str] | None = None
) -> tuple[str, Any, str] | None:
    """Put the keys of ``gripper.preset`` into a scene's tables, where it has none of its own; what is wrong with it.

    The largest opening is what the foam leaves of the stroke. An error is a key, what it has, and what was expected; a
    gripper's own file is looked for from ``folder``, and has its whole path then. Keys but ``given`` are filled in
    anew; by default all that are there are the scene's own.
    """
    gripper = tables.get("gripper")
    if not isinstance(gripper, dict) or not isinstance(name := gripper.get("preset"), str):
        return None
    if name not in PRESETS:
        gripper["preset"] = str((folder / name).absolute())
    try:
        keys, hand = gripper_file(gripper["preset"])
    except StudyError as error:
        more = "" if isinstance(error.__cause__, OSError) else f": {error}"  # of no such file all is said
        return "gripper.preset", name, f"{EXPECTED}{more}"
    for key in () if given is None else {*keys, "max_opening_mm"} - {*given}:
        gripper.pop(key, None)
    for key, value in keys.items():
        gripper.setdefault(key, value)
    thickness, most = gripper.get("pad_thickness_mm", 15.0), hand.stroke_mm / 2  # by default as a scene's
    if math.isfinite(most) and isinstance(thickness, int | float) and "max_opening_mm" not in gripper:
        if thickness >= most:
            return "gripper.pad_thickness_mm", thickness, f"less than {most:g} mm, of which two fill the stroke"
        gripper["max_opening_mm"] = 2 * (most - thickness)
    load = tables.get("load")
    forces = load.get("normal_force_n") if isinstance(load, dict) else None
    low, high = hand.force_n
    listed = forces if isinstance(forces, list | tuple) else []
    beyond = [force for force in listed if isinstance(force, int | float) and not low <= force <= high]
    return ("load.normal_force_n", beyond[0], f"{low:g} to {high:g} N, which this gripper has") if beyond else None
