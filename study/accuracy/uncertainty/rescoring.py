"""The quality of stored grasps with another friction coefficient, which needs no further solve."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.pose import pose_volume
from softjaw.study.accuracy.uncertainty import carrying
from softjaw.study.case.build import build_object
from softjaw.study.case.evaluate import FACING, lengths
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]


def change_by_mu(result: Any, scene: Scene, quality: FloatArray) -> FloatArray:
    """Relative change of the quality of every case for a mu larger by its half-width; ``quality`` is over all cases."""
    share = scene.uncertainty.mu / scene.friction.mu
    change = np.full(quality.shape, carrying.change_by_mu(share))
    tilted = np.argwhere((result.map("misalignment") > FACING) & (quality > 0))
    if not len(tilted):
        return change
    read = {name: result.fingers(name) for name in ("frame_origin", "frame_axes", "pose_rotation", "pose_origin")}
    semi_axes = result.read("limit_surface/semi_axes")[..., 0, :]
    arms, torques = lengths(scene, build_object(scene.object))
    known: dict[bytes, float] = {}  # images of one grasp have the same surfaces
    for place in map(tuple, tilted):
        key = semi_axes[place].tobytes() + quality[place].tobytes()
        if key not in known:
            frames = {name: values[place] for name, values in read.items()}
            more, less = (_volume(frames, times * semi_axes[place], arms, torques) for times in (1 + share, 1 - share))
            known[key] = (more - less) / (2 * quality[place])
        change[place] = known[key]
    return change


def _volume(frames: dict[str, FloatArray], semi_axes: FloatArray, arms: float, torques: float) -> float:
    """Volume of the grasp wrench space of two contacts, from what a file holds of them; ``semi_axes`` is ``(2, 3)``."""
    contacts = [
        SoftContact(
            frames["pose_rotation"][i] @ frames["frame_origin"][i] + frames["pose_origin"][i],
            frames["frame_axes"][i] @ frames["pose_rotation"][i].T,
            Ellipsoid(semi_axes[i]),
        )
        for i in range(2)
    ]
    return pose_volume(*contacts, arms, torques, with_l1=False).linf
