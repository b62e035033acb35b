"""Probes: candidates that are solved again with an input changed, in the same unit of work as the case itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from softjaw.study.accuracy.uncertainty.variations import Variation, moved_poses, variations
from softjaw.study.case import model
from softjaw.study.case.build import build_object
from softjaw.study.case.grasp import quality
from softjaw.study.case.solving import solver
from softjaw.study.messages import StudyError
from softjaw.study.run.stopping import TimeLimitError

NAMES = ("e_n", "quality")


class Probing:
    """The further solves of one probe, which climb its forces beside it.

    What fails there leaves NaN from that force on, and never harms the case itself; so does a time limit. ``failures``
    says what failed at the last force.
    """

    def __init__(self, unit: Any) -> None:
        self._solves = variations(unit.scene) if unit.probe else ()
        self._ladders = [_ladder(unit, variation) for variation in self._solves]
        self.failures: list[str] = []

    def values(self) -> dict[str, np.ndarray]:
        """Values ``(variations,)`` of the next force, keyed as in ``study.quantities``."""
        found = np.full((len(NAMES), len(self._ladders)), np.nan)
        self.failures = []
        try:
            for i in range(len(self._ladders)):
                found[:, i] = self._next(i)
        except TimeLimitError:
            self.failures.append("probe: run.time_limit_s passed")
            self.close()
        return {f"probes/{name}": values for name, values in zip(NAMES, found, strict=True)} if self._ladders else {}

    def _next(self, i: int) -> tuple[float, float]:
        try:
            return next(self._ladders[i], (np.nan, np.nan))
        except (ArithmeticError, MemoryError, RuntimeError, ValueError, StudyError) as error:
            self.failures.append(f"probe, {self._solves[i].name}: {error}")
            return np.nan, np.nan

    def close(self) -> None:
        """End all of them and give their memory back."""
        for ladder in self._ladders:
            ladder.close()


def _ladder(unit: Any, variation: Variation) -> Iterator[tuple[float, float]]:
    """e_n [m] and quality, curved model, at each force of one further solve."""
    scene = unit.scene.with_values(variation.values) if variation.values else unit.scene
    poses = moved_poses(unit.candidate.poses, variation.shift, variation.turn)
    obj = build_object(scene.object)
    fingers = [model.approach(obj, pose, scene.gripper.pad_size) for pose in poses]
    solving = solver(scene, fingers, poses)
    try:
        for outcome in solving.ladder(scene.load.normal_force):
            contacts = [c for c, *_ in outcome.contacts]
            yield min(c.limits["curved"].e_n for c in contacts), quality(scene, obj, contacts)
    finally:
        solving.destroy()
