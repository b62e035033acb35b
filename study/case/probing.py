"""Grasps again with an input changed: probes solved in the same unit of work as the case, stored ones scored again."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.objects.gap import Pose
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.contact import SoftContact
from softjaw.study.case import model
from softjaw.study.case.build import build_object, own_frame
from softjaw.study.case.choosing import Candidate
from softjaw.study.case.evaluate import FACING, lengths, quality, settings_of, volume_in_pose
from softjaw.study.case.result import TimeLimitError
from softjaw.study.case.variations import Variation, moved_poses, variations
from softjaw.study.messages import StudyError
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]
NAMES = ("e_n", "quality")
POWER = 5  # of mu in the quality of contacts that face each other: three axes of one finger's surface, two of the other


class Probing:
    """The further solves of one probe, which follow its load path beside it.

    What fails there leaves NaN from that force on, and never harms the case itself; so does a time limit. ``failures``
    says what failed at the last force.
    """

    def __init__(self, unit: Any) -> None:
        self._solves = variations(unit.scene) if unit.probe else ()
        self._paths = [_path(unit, variation) for variation in self._solves]
        self._done = 0  # forces that they have followed
        self.failures: list[str] = []

    def values(self, k: int) -> dict[str, np.ndarray]:
        """Values ``(variations,)`` of the ``k``-th force, keyed as in ``study.quantities``; to be called upward."""
        found = np.full((len(NAMES), len(self._paths)), np.nan)
        self.failures = []
        try:
            # what lies between is a case that failed, or one that is stored already
            for _ in range(self._done, k + 1):
                self.failures = []
                for i in range(len(self._paths)):
                    found[:, i] = self._next(i)
        # Not an Exception, so it needs a branch of its own: the case itself is complete and stays so.
        except TimeLimitError:
            self.failures.append("probe: run.time_limit_s passed")
            self.close()
        self._done = k + 1
        return {f"probes/{name}": values for name, values in zip(NAMES, found, strict=True)} if self._paths else {}

    def _next(self, i: int) -> tuple[float, float]:
        try:
            # A path that has ended by a failure gives NaN from then on.
            return next(self._paths[i], (np.nan, np.nan))
        except (ArithmeticError, MemoryError, RuntimeError, ValueError, StudyError) as error:
            self.failures.append(f"probe, {self._solves[i].name}: {error}")
            return np.nan, np.nan

    def close(self) -> None:
        """End all of them and give their memory back."""
        for path in self._paths:
            path.close()


def _path(unit: Any, variation: Variation) -> Generator[tuple[float, float], None, None]:
    """e_n [m] and quality, curved model, at each force of one further solve."""
    scene = unit.scene.with_values(variation.values) if variation.values else unit.scene
    poses = moved_poses(unit.candidate.poses, variation.shift, variation.turn)
    obj = build_object(scene.object)
    fingers = [model.approach(obj, pose, scene.gripper) for pose in poses]
    solving, settings = Candidate(scene, fingers, poses), settings_of(scene, obj)
    try:
        for outcome in solving.load_path(scene.load.normal_force):
            contacts = [c for c, *_ in outcome.contacts]
            yield min(c.limits["ccm"].e_n for c in contacts), quality(contacts, settings)
    finally:
        solving.destroy()


def change_by_mu(result: Any, scene: Scene, quality: FloatArray) -> FloatArray:
    """Relative change of the quality of every case for a mu larger by its half-width; ``quality`` is over all cases."""
    share = scene.uncertainty.mu / scene.friction.mu
    change = np.full(quality.shape, facing_change_by_mu(share))
    names = ("frame_origin", "frame_axes", "pose_rotation", "pose_origin")
    read = _in_object(own_frame(scene.object), *(result.read(f"fingers/{name}") for name in names))
    arms, torques = lengths(scene, build_object(scene.object))
    off = np.maximum(result.read("misalignment/misalignment"), _scaled_lean(*read, arms))
    tilted = np.argwhere((off > FACING) & (quality > 0))
    if not len(tilted):
        return change
    semi_axes = result.read("limit_surface/semi_axes")[..., 0, :]
    known: dict[bytes, float] = {}  # images of one grasp have the same surfaces
    for place in map(tuple, tilted):
        key = semi_axes[place].tobytes() + quality[place].tobytes()
        if key not in known:
            origin, axes = (values[place] for values in read)
            # Both sides, because the volume is far from linear in mu.
            more, less = (
                _volume(origin, axes, times * semi_axes[place], arms, torques) for times in (1 + share, 1 - share)
            )
            known[key] = (more - less) / (2 * quality[place])
        change[place] = known[key]
    return change


def facing_change_by_mu(share: float) -> float:
    """Relative change of the quality of contacts that face each other for a mu larger by ``share``.

    Half the difference between both sides.

    >>> round(facing_change_by_mu(0.01), 6)
    0.05001
    """
    return ((1 + share) ** POWER - (1 - share) ** POWER) / 2


def _in_object(
    placed: Pose, origin: FloatArray, axes: FloatArray, rotation: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Origins ``(..., 3)`` [m] and axes ``(..., 3, 3)`` of contact frames in the object's frame, from a file's."""
    points = np.einsum("...ij,...j->...i", rotation, origin) + at
    return (points - placed.origin) @ placed.rotation, axes @ np.swapaxes(rotation, -1, -2) @ placed.rotation


def _scaled_lean(origin: FloatArray, axes: FloatArray, arms: FloatArray) -> FloatArray:
    """Larger angle of the scaled line of two contacts to their normals ``(...)`` [rad], as in `evaluate.faces`."""
    line = (origin[..., 1, :] - origin[..., 0, :]) / arms
    lines, normals = np.stack([line, -line], axis=-2), axes[..., 2, :]
    lean = np.arctan2(np.linalg.norm(np.cross(lines, normals), axis=-1), (lines * normals).sum(axis=-1))
    return np.asarray(lean.max(axis=-1))


def _volume(
    origin: FloatArray, axes: FloatArray, semi_axes: FloatArray, arms: FloatArray, torques: float
) -> float:
    """Volume of the grasp wrench space of two contacts in the object's frame; ``semi_axes`` is ``(2, 3)``."""
    contacts = [SoftContact(*own[:2], Ellipsoid(own[2])) for own in zip(origin, axes, semi_axes, strict=True)]
    return volume_in_pose(contacts, arms, torques)
