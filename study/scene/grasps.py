"""The ``[candidates]`` section: where to grasp, the rules of stations and poses, and grasps that are seldom meant."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PrivateAttr

from softjaw.study.scene.objects import Plate, Shape, Span, SphereShape
from softjaw.study.scene.section import RISING, Direction, Errors, SceneSection, Text, Vector, wrong
from softjaw.study.scene.sections import Gripper

Angle = Annotated[float, Field(ge=-360, le=360)]
POSE = [{"point_mm": [0, 0, 20], "approach": [1, 0, 0], "long_side": [0, 0, 1]}]
EXAMPLE = "for example `stations = 35` with `stations_mm = [25, 175]`"
BUDGET = 120  # cases of a refinement
# keys that stations, poses and a sampler share
OF_EVERY_KIND = ("roll_deg", "shift_mm", "refine")


class GraspPose(SceneSection):
    """One explicit grasp: finger 1 comes along ``approach`` through the point, finger 2 from the opposite side."""

    point_mm: Vector = Field(
        description="a point on the line along which the fingers close, [x, y, z] in the frame of its own file",
        examples=[[0, 0, 20]],
    )
    approach: Direction = Field(description="direction from finger 1 towards the object", examples=[[1, 0, 0]])
    long_side: Direction = Field(
        description="direction of the pads' long side; only its part across the approach counts", examples=[[0, 0, 1]]
    )
    label: Text = Field("", max_length=100, description="name of the grasp")

    def rules(self) -> Errors:
        """Directions that do not fix a frame."""
        along = sum(a * b for a, b in zip(self.approach, self.long_side, strict=True))
        if abs(along) > 0.996 * math.hypot(*self.approach) * math.hypot(*self.long_side):  # parallel, to some 5 degrees
            yield wrong(self.long_side, "a direction across the approach, in the pad's face", "long_side")


def _budget(given: Any) -> Any:
    """The default number of cases for true, none for false and 0."""
    return BUDGET if given is True else given or None


class Candidates(SceneSection):
    """Where to grasp: stations along the object's axis x angles about it, explicit poses, or sampled grasps."""

    _rejected: tuple[tuple[float, ...], ...] = PrivateAttr(())
    stations: int | None = Field(
        None, ge=2, le=10_000, description="number of stations, spread evenly from the first to the last of stations_mm"
    )
    stations_mm: Annotated[tuple[float, ...], Field(min_length=1, max_length=10_000), RISING] | None = Field(
        None, description="stations along the object's axis; with `stations` the first and the last",
        examples=[[25, 50, 75]],
    )  # fmt: skip
    angles_deg: Annotated[tuple[Angle, ...], Field(min_length=1, max_length=3600), RISING] = Field(
        (0.0, 90.0), description="angles about the axis", examples=[[0, 90]]
    )
    roll_deg: Angle = Field(
        0.0, description="turn of the gripper about the approach; 0 has the long side along the axis, or as in poses"
    )
    shift_mm: float = Field(0.0, ge=-200, le=200, description="shift of the gripper along the pads' long side")
    poses: tuple[GraspPose, ...] = Field((), max_length=100_000, description="explicit grasps", examples=[POSE])
    sampled: int | None = Field(
        None, ge=1, le=1000, description="looks for so many distinct grasps itself: places that face each other"
    )
    refine: Annotated[Annotated[int, Field(ge=1, le=100_000)] | None, BeforeValidator(_budget)] = Field(
        None, description=f"most cases that are solved beside the scene's own, around the best; true is {BUDGET}",
        examples=[BUDGET],
    )  # fmt: skip

    @property
    def station_values_mm(self) -> tuple[float, ...]:
        """Stations along the object's axis, rising [mm]; empty with explicit poses."""
        if self.stations is None or self.stations_mm is None:
            return self.stations_mm or ()
        low, high = self.stations_mm
        return tuple(low + (high - low) * i / (self.stations - 1) for i in range(self.stations))

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the candidates: stations, then angles at each."""
        if self.poses:
            return tuple(pose.label or f"p{i:02d}" for i, pose in enumerate(self.poses))
        return tuple(f"{s:g} mm, {a:g} deg" for s in self.station_values_mm for a in self.angles_deg)

    @property
    def rejected(self) -> tuple[tuple[float, ...], ...]:
        """Grasps that the sampler offered and rejected: point [mm], approach, long side and state of each."""
        return self._rejected

    @property
    def total(self) -> int:
        """Number of candidates; of a sampler that has not run as many as it may give."""
        return len(self.poses) or self.sampled or len(self.station_values_mm) * len(self.angles_deg)

    def rules(self) -> Errors:
        """Exactly one way of giving the candidates."""
        given = {"stations_mm": self.stations_mm, "poses": self.poses or None, "sampled": self.sampled}
        ways = [way for way, value in given.items() if value is not None]
        if self.stations is not None and len(self.stations_mm or ()) != 2:
            key = "stations_mm" if self.stations_mm else "stations"
            expected = f"the first and the last of stations_mm beside stations, {EXAMPLE}"
            yield wrong(getattr(self, key), expected, key)
        elif len(ways) != 1:
            expected = "one of stations_mm, also with the number of stations, sampled, or [[candidates.poses]]"
            yield wrong(ways, f"{expected}, {EXAMPLE}", *ways[-1:])
        if (self.poses or self.sampled) and self.angles_deg != Candidates.model_fields["angles_deg"].default:
            yield wrong(self.angles_deg, "stations beside it", "angles_deg")

    def rules_on(self, shape: Shape) -> Errors:
        """Stations beside the object, or along its faces, cannot touch it."""
        low, high = shape.spans_mm.get("z", (-math.inf, math.inf))
        outside = [s for s in self.station_values_mm if not low <= s <= high]
        if outside:
            expected = f"stations [mm] along the object's axis, from {low:g} to {high:g} mm"
            yield wrong(outside, expected, "stations_mm")
        for angle in self.angles_deg if isinstance(shape, Plate) and self.station_values_mm else ():
            if abs(math.cos(math.radians(angle))) < 0.5:
                yield wrong(angle, "angles within 60 of 0 or 180: the two planes face x", "angles_deg")

    def half_extent_mm(self, gripper: Gripper) -> float:
        """Half of what a pad covers along the object's axis [mm]."""
        along, across = abs(math.cos(self.roll)), abs(math.sin(self.roll))
        return (gripper.pad_length_mm * along + gripper.pad_width_mm * across) / 2

    def warnings(self, shape: Shape, span: Span | None, gripper: Gripper) -> Iterator[str]:
        """Sentences about the stations on an object that reaches from ``span[0]`` to ``span[1]`` on its axis [mm]."""
        places = self.station_values_mm
        if span is None or not places:
            return
        (low, high), half = span, self.half_extent_mm(gripper)
        slack = 1e-6 * (high - low)
        over = [s for s in places if s - half < low - slack or s + half > high + slack]
        if over and not isinstance(shape, Plate | SphereShape):
            yield (
                f"candidates: at {len(over)} of {len(places)} stations ({listed(over)} mm) a pad of {2 * half:g} mm"
                f" meets the edge of the object, which reaches from {low:g} to {high:g} mm"
            )


def listed(places: Sequence[float]) -> str:
    """The first few of some places."""
    return ", ".join(f"{s:g}" for s in places[:4]) + (", ..." if len(places) > 4 else "")
