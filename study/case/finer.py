"""Finer meshes for the cases that two meshes do not tell to the target.

Each starts from the state on the mesh before it at the same force, so that forces stay independent of each other, and
its error comes from these two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.pad.shape import PadShape
from softjaw.friction.patch import ContactPatch
from softjaw.study.case.build import build_object, pad_elements
from softjaw.study.case.evaluate import OF_MESHES, error_of_one, settings_of
from softjaw.study.case.model import Finger
from softjaw.study.case.result import surely_below
from softjaw.study.case.solving import PressedContact, Solved, Solver, solver
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import MOST_ELEMENTS, MOST_MESHES

FloatArray = NDArray[np.float64]
OF_FINER = 1.0  # weight of the difference between two meshes so near each other
NOT_SOLVED = "on a finer mesh, which accuracy.target asks for, it was not solved ({reason})"


def on_finer(scene: Scene, mesh: int) -> Scene:
    """The scene with the finer mesh of its pads that is `pad_elements`."""
    # values that the scene itself could have, so nothing is checked again
    gripper = scene.gripper.model_copy(update={"elements": pad_elements(scene, mesh)})
    return scene.model_copy(update={"gripper": gripper})


def weight_of(fine: Sequence[PressedContact], scene: Scene) -> float:
    """Weight of the difference between the two finest meshes of a case."""
    return OF_MESHES if fine[0].state.pad.shape.elements == scene.gripper.elements else OF_FINER


def error_of(found: Solved, scene: Scene) -> float:
    """Error of ``accuracy.target_of`` from the two finest meshes of a case, relative; NaN where there is one alone."""
    fine, coarse = ([c[mesh] for c in found.contacts if len(c) > mesh] for mesh in (0, 1))
    if not coarse:
        return math.nan
    views, name = list(zip(*(c.views for c in coarse), strict=True)), scene.accuracy.target_of
    settings = settings_of(scene, build_object(scene.object))
    return error_of_one(name, fine, coarse, views, settings, weight_of(fine, scene))


class Finer:
    """Solves the cases of a candidate again that are not surely known to the scene's target.

    Parameters
    ----------
    scene : Scene
        At the levels of its effects.
    fingers : list of Finger
        Both at first touch.
    poses : two Pose
    """

    def __init__(self, scene: Scene, fingers: list[Finger], poses: Sequence[Any]) -> None:
        self._scene, self._fingers, self._poses = scene, fingers, poses
        self._target = float(scene.accuracy.target or 0.0)
        self._solvers: dict[int, Solver] = {}

    def known_to_target(self, found: Solved, force: float) -> Solved:
        """The case as it is where its error is surely below the target, else on up to `MOST_MESHES`.

        Where a finer mesh has no state the case keeps the answer of the one before, with a note.
        """
        for mesh in range(3, MOST_MESHES + 1):
            # undecided, and unknown, is refined, which is right in both cases
            error = error_of(found, self._scene)
            if surely_below(error, self._target) or math.prod(pad_elements(self._scene, mesh)) > MOST_ELEMENTS:
                break
            try:
                found = self._again(mesh, found, force)
            except (ConvergenceError, CheckError, ArithmeticError) as error:
                note = NOT_SOLVED.format(reason=error)
                return replace(found, note="; ".join(text for text in (found.note, note) if text))
        return found

    def _again(self, mesh: int, found: Solved, force: float) -> Solved:
        """The case on a mesh, from its state on the one before."""
        if mesh not in self._solvers:
            self._solvers[mesh] = solver(on_finer(self._scene, mesh), self._fingers, self._poses)
        own, before = self._solvers[mesh], [c[0] for c in found.contacts]
        # of two fingers that are images only the first is solved
        states = [path.at(force, [c.state]) for path, c in zip(own.paths, before, strict=False)]
        fine = own.contacts(states)
        return Solved([list(pair) for pair in zip(fine, before, strict=True)], [*states, *found.spent])

    def destroy(self) -> None:
        """Give the factors' memory back."""
        for own in self._solvers.values():
            own.destroy()


def stored(contact: PressedContact, shape: PadShape) -> dict[str, FloatArray]:
    """Patch of a contact on the faces of a pad with the scene's mesh, keyed as a file has it."""
    patch, own = contact.patch, contact.state.pad.shape
    if own == shape:
        return {name: getattr(patch, name) for name in ("pressure", "area", "centroid", "normal")}
    weights = contact.state.pad.side_weights
    shares = [_shares(_edges(own, axis, weights), _edges(shape, axis, weights)) for axis in (0, 1)]
    return joined(patch, shares[0], shares[1])


def joined(patch: ContactPatch, along: FloatArray, across: FloatArray) -> dict[str, FloatArray]:
    """A patch on other faces, which get shares ``(faces, own faces)`` of its own along length and width.

    Loads and areas are divided by these, so that sums over the patch, and moments of its loads, stay as they are;
    position and normal are means by load, or by area where there is none.
    """

    def summed(values: FloatArray) -> FloatArray:
        grid = values.reshape(along.shape[1], across.shape[1], -1)
        return np.einsum("ai,bj,ijc->abc", along, across, grid).reshape(-1, *values.shape[1:])

    def mean(values: FloatArray) -> FloatArray:
        by_load, by_area = summed(forces[:, None] * values), summed(patch.area[:, None] * values)
        return np.where(load[:, None] > 0, by_load / np.where(load > 0, load, 1.0)[:, None], by_area / area[:, None])

    forces = patch.pressure * patch.area
    load, area = summed(forces), summed(patch.area)
    normal = mean(patch.normal)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    # where those on both sides of an edge cancel, the approach is between them
    normal = np.where(length > 0, normal / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])
    return {"pressure": load / area, "area": area, "centroid": mean(patch.centroid), "normal": normal}


def _edges(shape: PadShape, axis: int, weights: FloatArray) -> FloatArray:
    """Edges of the faces of a patch along an axis of the undeformed pad [m]."""
    lines = shape.lines(axis, False)
    inside = lines[:-1, None] + np.diff(lines)[:, None] * (np.cumsum(weights) - weights)
    return np.append(inside.ravel(), lines[-1])


def _shares(own: FloatArray, others: FloatArray) -> FloatArray:
    """Which part of each interval between ``own`` edges lies in each one between others ``(others, own)``."""
    low, high = np.maximum(own[:-1], others[:-1, None]), np.minimum(own[1:], others[1:, None])
    parts = np.maximum(high - low, 0.0)
    return parts / parts.sum(axis=0)
