"""Probes: which candidates they are, and what is changed when they are solved again.

An input is moved by its half-width, the mesh is made coarser, or the gripper stands elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from softjaw.fem.objects.gap import Pose
from softjaw.study.case.build import has_wall, pad_shape
from softjaw.study.scene import Scene
from softjaw.study.scene.objects import Walled

COARSEST_WALL, FEWEST = 50.0, 2  # mm, and elements along a side, as scenes allow


@dataclass(frozen=True)
class Variation:
    """One more solve of a probe; ``pair`` counts the inputs of a part, which each may have two sides.

    Attributes
    ----------
    name : str
        In words.
    part : str
        Of the uncertainty interval, as in ``Uncertainty.parts``.
    values : dict
        Keys of the scene that change.
    shift : float
        Of both pads along their long side [m].
    turn : float
        Of the gripper about the approach of finger 1 [rad].
    """

    name: str
    part: str
    values: dict[str, Any] = field(default_factory=dict)
    shift: float = 0.0
    turn: float = 0.0
    pair: int = 0


def by_formula(scene: Scene) -> tuple[str, ...]:
    """Parts that follow at every candidate from what is solved anyway.

    A mesh error is mapped where every case has two meshes. Friction that nowhere acts back on the pressure scales
    with mu. A pad on a rigid object and a rigid sheet is in a state that depends only on the force over its modulus, so
    a stiffer pad is a smaller force.
    """
    from softjaw.study.case.effects import may_bend  # loads PETSc, and most scenes ask for no uncertainty

    wall = has_wall(scene.object) and scene.effects.object != "rigid"
    alike = not wall and not may_bend(scene) and len(scene.load.normal_force) > 1
    holds = {
        "mesh": scene.accuracy.meshes > 1,
        "mu": scene.effects.friction_pressure_coupling == "none",
        "modulus": alike,
    }
    return tuple(part for part in scene.uncertainty.parts if holds.get(part, False))


def variations(scene: Scene) -> tuple[Variation, ...]:
    """All further solves of a probe, in the order in which they are stored."""
    own, done = scene.uncertainty, by_formula(scene)
    made = {
        "mesh": [Variation("half as many elements per direction", "mesh", _coarser(scene))],
        "mu": [Variation("mu + half-width", "mu", {"friction.mu": scene.friction.mu + own.mu})],
        "modulus": [Variation("shear modulus + half-width", "modulus", _stiffer(scene))],
        "wall": [Variation("wall thickness + half-width", "wall", _thicker(scene))],
        "pose": _moved(own.pose, own.pose_turn, "+" if _mirrored(scene) else "+-"),
    }
    return tuple(v for part in own.parts if part not in done for v in made[part])


def _coarser(scene: Scene) -> dict[str, Any]:
    # Clipped, or a coarse mesh would be halved to one that scenes refuse.
    elements = [max(n, FEWEST) for n in pad_shape(scene.gripper, coarser=True).elements]
    # an odd number of elements has no symmetric halves
    found: dict[str, Any] = {"gripper.elements": elements, "effects.model_size": "full"}
    if has_wall(scene.object):
        sizes = {key: getattr(scene.accuracy, key) for key in ("wall_around_mm", "wall_along_mm", "wall_coarse_mm")}
        found |= {f"accuracy.{key}": min(2 * size, COARSEST_WALL) for key, size in sizes.items()}
    return found


def _stiffer(scene: Scene) -> dict[str, Any]:
    times = 1 + scene.uncertainty.shear_modulus_percent / 100
    found: dict[str, Any] = {"gripper.shear_modulus_kpa": times * scene.gripper.shear_modulus_kpa}
    if scene.gripper.shear_moduli_kpa:
        found["gripper.shear_moduli_kpa"] = [times * term for term in scene.gripper.shear_moduli_kpa]
    return found


def _thicker(scene: Scene) -> dict[str, Any]:
    times, shape = 1 + scene.uncertainty.wall_thickness_percent / 100, scene.object
    if not isinstance(shape, Walled) or shape.wall is None:
        return {}
    found: dict[str, Any] = {}
    if shape.wall_mm is not None:
        found["object.wall_mm"] = times * shape.wall_mm
    if shape.wall_profile_mm is not None:
        found["object.wall_profile_mm"] = [[z, times * t] for z, t in shape.wall_profile_mm]
    if shape.base_wall_mm is not None:
        found["object.base_wall_mm"] = times * shape.base_wall_mm
    return found


def _mirrored(scene: Scene) -> bool:
    """Whether a turn to one side is the mirror image of that to the other: with pads along or across a round object."""
    where = scene.candidates
    return scene.object.axis_symmetry == 0 and not where.poses and where.roll_deg % 90 == 0


def _moved(shift: float, turn: float, ways: str) -> list[Variation]:
    """To both sides, for a grasp may stand where its quality is largest."""
    shifts = [Variation(f"gripper shifted by {s} half-width", "pose", shift=float(f"{s}1") * shift) for s in "+-"]
    turns = [Variation(f"gripper turned by {s} half-width", "pose", turn=float(f"{s}1") * turn, pair=1) for s in ways]
    return shifts * bool(shift) + turns * bool(turn)


def moved_poses(poses: Sequence[Pose], shift: float, turn: float) -> tuple[Pose, ...]:
    """Both pads shifted along their long side [m], then turned about the approach of the first [rad]."""
    axis, point = poses[0].rotation[:, 2], poses[0].origin
    K = np.cross(np.eye(3), axis)  # K @ v is axis x v
    turning = np.eye(3) + np.sin(turn) * K + (1 - np.cos(turn)) * K @ K

    def moved(pose: Pose) -> Pose:
        origin = point + turning @ (pose.origin - point) + shift * pose.rotation[:, 0]
        return Pose(turning @ pose.rotation, origin)

    return tuple(moved(pose) for pose in poses)


def probe_candidates(scene: Scene, units: Sequence[Any]) -> tuple[int, ...]:
    """Numbers of the candidates that are probes, rising; none where no further solve is asked for.

    Unless they are named they are units at quantiles of the e_n that a Winkler foundation gives, so they do not depend
    on how many ranks there are.
    """
    own = scene.uncertainty
    if not own.parts or not changes(scene):
        return ()
    from softjaw.study.case.probes import spread  # loads PETSc, as above

    forces = len(scene.load.normal_force)
    first = {unit.index: unit.rows[0][0] // forces for unit in units}
    if isinstance(own.probes, int):
        tried = [unit for unit in units if not unit.state]
        return tuple(sorted(first[unit.index] for unit in spread(tried, own.probes))) if tried else ()
    named = () if isinstance(own.probes, int) else scene.candidates.numbers(own.probes)
    # A named candidate may be an image: the unit that serves it is the probe.
    serving = {rows[0] // forces: first[unit.index] for unit in units for rows in unit.rows}
    return tuple(sorted({serving[number] for number in named}))


def changes(scene: Scene) -> tuple[str, ...]:
    """What is changed in the further solves of a probe, in words."""
    return tuple(variation.name for variation in variations(scene))


def with_probes(scene: Scene, units: Sequence[Any], chosen: Sequence[int]) -> tuple[Any, ...]:
    """The units of work, those of the probes marked, and as much more expensive as they are."""
    if not chosen:
        return tuple(units)
    # The cost tells the schedule to begin with probes, which take several times as long.
    forces, times = len(scene.load.normal_force), 1 + len(changes(scene))
    return tuple(
        replace(unit, probe=True, cost=times * unit.cost) if unit.rows[0][0] // forces in chosen else unit
        for unit in units
    )
