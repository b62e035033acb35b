"""Which cases stand for all: candidates spread over what the cheapest model says of them, and three forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem.shape import GapObject
from friction.patch import NoContactError
from study.case import model, sweep
from study.case.build import build_object
from study.cost.winkler import winkler_pad
from study.exits import USAGE, StudyError
from study.scene import Scene

MOST_LOOKED_AT = 60  # units of work, evenly spread, among which the candidates are chosen
FINGER_POINTS = (25, 11)


@dataclass(frozen=True)
class Probe:
    """A candidate that stands for others: its unit of work, and the forces at which it is solved [N]."""

    label: str
    unit: Any
    forces: tuple[float, ...]


def probes(scene: Scene, named: Sequence[str] = (), count: int = 3) -> list[Probe]:
    """Candidates by name or number, or ``count`` of them; each with the lowest, middle and highest force.

    Raises
    ------
    StudyError
        Where there is no such candidate.
    """
    forces = scene.load.normal_force
    few = tuple(dict.fromkeys((forces[0], forces[(len(forces) - 1) // 2], forces[-1])))
    units = sweep.units(scene, lambda point: point.axis_symmetry)
    chosen = [_named(units, scene.candidates.labels, name) for name in dict.fromkeys(named)] or spread(units, count)
    return [Probe(f"{unit.candidate.label}{_point(scene, unit)}", unit, few) for unit in chosen]


def _named(units: Sequence[Any], labels: Sequence[str], name: str) -> Any:
    label = labels[int(name)] if name.isdigit() and int(name) < len(labels) else name
    for unit in units:
        if label in [c.label for c in unit.served]:
            return replace(unit, candidate=next(c for c in unit.served if c.label == label))
    raise StudyError(
        USAGE,
        f"--candidate: found '{name}', expected a candidate's number, 0 to {len(labels) - 1}, or its label, as"
        f" '{labels[0]}'",
    )


def spread(units: Sequence[Any], count: int) -> list[Any]:
    """Units at quantiles of the e_n that a Winkler foundation gives at the highest force: 1/6, 1/2, 5/6 for three."""
    step = -(-len(units) // MOST_LOOKED_AT)
    seen = [(estimate, unit) for unit in units[::step] if (estimate := _estimate(unit)) is not None]
    if not seen:
        raise StudyError(USAGE, "candidates: no pad meets the object; move the stations or poses onto it")
    ranked = [unit for _, unit in sorted(seen, key=lambda pair: (pair[0], pair[1].index))]
    count = min(count, len(ranked))
    return [ranked[int((i + 0.5) / count * len(ranked))] for i in range(count)]


def _estimate(unit: Any) -> float | None:
    """Mean arm of the pressure of a Winkler foundation, which e_n is on a planar patch [m]."""
    try:
        finger = first_finger(build_object(unit.scene.object), unit)
        patch = winkler_pad(unit.scene.gripper, finger, FINGER_POINTS).patch(unit.scene.load.normal_force[-1])
    except (ValueError, RuntimeError, NoContactError):
        return None
    centre = patch.load @ patch.centroid / patch.load.sum()
    return float(patch.load @ np.linalg.norm(patch.centroid - centre, axis=1) / patch.load.sum())


def first_finger(obj: GapObject, unit: Any) -> model.Finger:
    """Finger 1 at first touch."""
    return model.approach(obj, unit.candidate.poses[0], unit.scene.gripper.pad_size)


def _point(scene: Scene, unit: Any) -> str:
    """The unit's point of the sweep, in words."""
    if not scene.sweep:
        return ""
    values = unit.scene.effective()
    told = [f"{key} = {values[key.partition('.')[0]][key.partition('.')[2]]}" for key in scene.sweep]
    return f" ({', '.join(told)})"
