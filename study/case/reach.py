"""Explicit grasps that miss the object, found before anything is solved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softjaw.fem.objects.gap import Gap, GapObject, NoContactError, Pose
from softjaw.study.case import model
from softjaw.study.case.build import build_object
from softjaw.study.case.candidates import candidates
from softjaw.study.exits import USAGE, StudyError
from softjaw.study.scene import Scene

MOST_TRIED, MOST_NAMED = 1000, 5  # pads brought to the object here (the others fail as cases), and sentences


@dataclass(frozen=True, eq=False)
class _AsItIs:
    """An object that is touched and not pressed: the region that a mesh would sample for a contact is not needed."""

    object: GapObject

    @property
    def bounds(self) -> np.ndarray:
        """Corners ``(2, 3)`` [m]."""
        return self.object.bounds

    def gap(self, x: np.ndarray) -> Gap:
        """Signed distance with its derivatives."""
        return self.object.gap(x)

    def near(self, pose: Pose, lower: np.ndarray, upper: np.ndarray) -> _AsItIs:
        """Return the object itself."""
        return self


def check_poses(scene: Scene, points: list[Scene]) -> None:
    """Refuse explicit poses of which a pad passes the object; stations lie on the object anyway.

    Parameters
    ----------
    scene : Scene
        The scene as it stands in the file.
    points : list of Scene
        The scenes of all points of the sweep.

    Raises
    ------
    StudyError
        With the labels of the poses.
    """
    if not scene.candidates.poses:
        return
    places = candidates(scene)[: MOST_TRIED // 2]
    missed: dict[int, str] = {}
    tried = 0
    for shape, size in dict.fromkeys((point.object, point.gripper.pad_size) for point in points):
        obj = _AsItIs(build_object(shape))
        for number, place in enumerate(places):
            if number not in missed and tried < MOST_TRIED:
                tried += 2
                passing = [k + 1 for k, pose in enumerate(place.poses) if _passes(obj, pose, size)]
                if passing:
                    missed[number] = f"finger {passing[0]} passes" if len(passing) == 1 else "both fingers pass"
    if missed:
        lines = [
            f"candidates.poses[{i}]: found '{places[i].label}', where {who} the object; expected a line of"
            " approach on which both pads meet it; change point_mm (in mm, in the object's frame) or approach"
            for i, who in list(missed.items())[:MOST_NAMED]
        ]
        more = [f"and {len(missed) - MOST_NAMED} more poses pass the object"] if len(missed) > MOST_NAMED else []
        raise StudyError(USAGE, "\n".join(lines + more))


def _passes(obj: GapObject, pose: Pose, size: tuple[float, float, float]) -> bool:
    try:
        model.approach(obj, pose, size)
    except NoContactError:
        return True
    return False
