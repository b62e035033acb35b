"""Poses of two pads that face each other, from a station and angles or from a grasp, and which are images of others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from softjaw.fem.objects.gap import Pose
from softjaw.friction.patch import NEGLIGIBLE, FloatArray
from softjaw.study.scene.grasps import GraspPose

if TYPE_CHECKING:
    from softjaw.fem.objects.centre_line import CentreLine

STANDOFF = 5.0  # distance of a pad's origin from the point it is aimed at [m]; the press closes it to first touch


def axis_poses(station: float, angle: float, roll: float, middle: CentreLine | None = None) -> tuple[Pose, Pose]:
    """Poses of the two pads at a station, which is a height, along the object's axis z or its centre line ``middle``.

    Finger 1 stands at ``angle`` and approaches along ``-(cos, sin, 0)``, finger 2 comes from the opposite side. At roll
    0 both long sides are the object's z; ``roll`` turns the gripper about finger 1's approach. On a centre line all of
    this is tilted with it, by the shortest turn that takes z to its tangent.
    """
    approach = -np.array([math.cos(angle), math.sin(angle), 0.0])
    # The rotation of z about the approach, which is normal to it.
    long_side = math.cos(roll) * np.array([0.0, 0.0, 1.0]) + math.sin(roll) * np.cross(approach, [0.0, 0.0, 1.0])
    if middle is None:
        return opposed_poses(np.array([0.0, 0.0, station]), approach, long_side)
    point, tangent = middle.at(station)
    tilt = shortest_turn(tangent)
    return opposed_poses(point, tilt @ approach, tilt @ long_side)


def shortest_turn(tangent: FloatArray) -> FloatArray:
    """Rotation ``(3, 3)`` that takes z to a unit vector above the plane z = 0 the shortest way."""
    x, y, z = tangent
    share = 1.0 / (1.0 + z)
    return np.array([[1.0 - share * x * x, -share * x * y, x], [-share * x * y, 1.0 - share * y * y, y], [-x, -y, z]])


def explicit_poses(pose: GraspPose, placed: Pose) -> tuple[Pose, Pose]:
    """Poses of the two pads of an explicit grasp; of the long side only the part across the approach counts.

    ``placed`` is where the object's frame lies in that of its file, in which the grasp is given.
    """
    approach = (np.array(pose.approach) / np.linalg.norm(pose.approach)) @ placed.rotation
    long_side = across(approach, np.array(pose.long_side) @ placed.rotation)
    return opposed_poses(placed.to_pad(np.array(pose.point)), approach, long_side)


def in_file(point: FloatArray, approach: FloatArray, long_side: FloatArray, placed: Pose) -> tuple[float, ...]:
    """A grasp in the frame of the object's own file: point [mm], approach, long side; nine numbers.

    Rounded to 1 um and 1e-6, so that they are the same on every machine.
    """
    mm, sides = 1e3 * placed.to_object(point), np.concatenate([placed.rotation @ approach, placed.rotation @ long_side])
    # Adding 0 turns -0 into 0.
    return (*(round(float(x), 3) + 0.0 for x in mm), *(round(float(x), 6) + 0.0 for x in sides))


def pose_of(numbers: Sequence[float]) -> GraspPose:
    """The pose of a scene that nine numbers of `in_file` give."""
    # slices of a sequence have no length that a type could tell; the model checks it
    return GraspPose(point_mm=numbers[:3], approach=numbers[3:6], long_side=numbers[6:])  # type: ignore[arg-type]


def across(approach: FloatArray, along: FloatArray) -> FloatArray:
    """Unit vector ``(3,)`` of the part of ``along`` across the approach."""
    part = along - np.dot(approach, along) * approach
    return part / np.linalg.norm(part)


def pad_axes(approach: FloatArray, long_side: FloatArray) -> FloatArray:
    """Rotation of a pad: long side, short side and approach as columns ``(3, 3)``."""
    return np.column_stack([long_side, np.cross(approach, long_side), approach])


def opposed_poses(point: FloatArray, approach: FloatArray, long_side: FloatArray) -> tuple[Pose, Pose]:
    """Two pads that face each other across a point, with the same long side in the object's frame.

    ``point`` (3,) array: any point on the common line of approach [m]. ``approach, long_side`` (3,) arrays: orthogonal
    unit vectors: finger 1's approach, and the long side of both pads. Returns finger 1 and finger 2, each `STANDOFF`
    away from the point.
    """
    first, second = (Pose(pad_axes(a, long_side), point - STANDOFF * a) for a in (approach, -approach))
    return first, second


def turn_of_pose(first: Pose, other: Pose, axis_symmetry: int) -> float | None:
    """Angle about z [rad] that takes one approaching pad to another, if the object looks the same after it, else None.

    A shift along the approach does not count: the press closes the fingers.
    """
    turn = other.rotation @ first.rotation.T
    # Only turns about z take the object to itself, so all else is no image.
    if abs(turn[2, 2] - 1) > NEGLIGIBLE or np.abs(turn[2, :2]).max() > NEGLIGIBLE:
        return None
    angle = math.atan2(turn[1, 0], turn[0, 0])
    step = 2 * math.pi / axis_symmetry if axis_symmetry else 0.0
    if step and abs(angle - step * round(angle / step)) > NEGLIGIBLE:
        return None
    shift = other.rotation.T @ (turn @ first.origin - other.origin)  # in the pad's frame: z is along the approach
    return None if np.abs(shift[:2]).max() > NEGLIGIBLE else angle


def moved(poses: tuple[Pose, Pose], shift: float, turn: float) -> tuple[Pose, Pose]:
    """Both pads turned about the approach of the first [rad], then shifted along their long side [m]."""
    if not shift and not turn:
        return poses
    axis, point = poses[0].rotation[:, 2], poses[0].origin
    K = np.cross(np.eye(3), axis)  # K @ v is axis x v
    turning = np.eye(3) + math.sin(turn) * K + (1 - math.cos(turn)) * K @ K

    def placed(pose: Pose) -> Pose:
        rotation = turning @ pose.rotation
        return Pose(rotation, point + turning @ (pose.origin - point) + shift * rotation[:, 0])

    return placed(poses[0]), placed(poses[1])
