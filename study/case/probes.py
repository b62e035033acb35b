"""Which cases represent all: candidates spread over what the cheapest model says of them, and three forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import ContactPatch, NoContactError
from softjaw.study.case import candidates as grasps
from softjaw.study.case import model
from softjaw.study.case.build import build_object
from softjaw.study.case.fit import bed_closing, stiffness
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import Gripper

FloatArray = NDArray[np.float64]
POINTS = (50, 22)  # along length and width
STEPS, FLAT = 8, 0.2  # Newton steps along the approach, and the least cosine that they divide by
MOST_LOOKED_AT = 60  # units of work, evenly spread, among which the candidates are chosen
FINGER_POINTS = (25, 11)
COARSE_POINTS = ((10, 5), (14, 7))
DIGIT = 1e-9  # m and relative, to which estimates are rounded before they are ranked: ties go to the first unit
HELD_OUT = 5  # cases that a choice is tried on
HARD = 5  # one of so many units is harder than the second probe of a choice


@dataclass(frozen=True)
class Probe:
    """A candidate that represents others: its unit of work, and the forces at which it is solved [N]."""

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
    # A scene of one or two forces has fewer different ones.
    few = tuple(dict.fromkeys((forces[0], forces[(len(forces) - 1) // 2], forces[-1])))
    units = grasps.units(scene, lambda point: point.axis_symmetry)
    chosen = [_named(units, scene.candidates.labels, name) for name in dict.fromkeys(named)] or spread(units, count)
    return probes_at(scene, chosen, few)


def probes_at(scene: Scene, units: Sequence[Any], forces: tuple[float, ...]) -> list[Probe]:
    """Probes of some units at some forces."""
    return [Probe(f"{unit.candidate.label}{_point(scene, unit)}", unit, forces) for unit in units]


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
    return _quantiles(_looked_at(units), count)


def demanding(units: Sequence[Any]) -> list[Any]:
    """The unit whose contact asks most of a mesh, and one that asks more than four of five do.

    That is where coarse beds of springs miss most of e_n at the lowest force: contacts that are small, or just reach a
    second place. The hardest alone would not do: it may be one that no mesh resolves.
    """
    seen = sorted(_looked_at(units), key=lambda s: (-round(s.missed / DIGIT), s.unit.index))
    return [seen[i].unit for i in dict.fromkeys((0, max((len(seen) - 1) // HARD, min(1, len(seen) - 1))))]


def held_out(scene: Scene, found: Sequence[Probe], count: int = HELD_OUT) -> list[Probe]:
    """At least so many cases that no probe has, as far as there are; candidates that no probe has come first.

    Each candidate has one force, which change from one to the next, and the highest, which effects are chosen by.
    """
    forces, taken = scene.load.normal_force, {probe.unit.index: probe.forces for probe in found}
    units = grasps.units(scene, lambda point: point.axis_symmetry)
    new = [unit for unit in units if unit.index not in taken]
    lower, chosen = forces[:-1] or forces, _evenly(new, -(-count // min(2, len(forces))))
    made: list[tuple[Any, Sequence[float]]] = [(unit, (lower[i % len(lower)],)) for i, unit in enumerate(chosen)]
    if not new:
        made = [(p.unit, _evenly([f for f in forces if f not in p.forces], count)) for p in found]
    return [
        Probe(f"{unit.candidate.label}{_point(scene, unit)}, held out", unit, tuple(dict.fromkeys((*own, forces[-1]))))
        for unit, own in made
        if own
    ]


def _evenly(values: Sequence[Any], count: int) -> list[Any]:
    count = min(count, len(values))
    return [values[int((i + 0.5) / count * len(values))] for i in range(count)]


@dataclass(frozen=True)
class _Seen:
    """A unit, its e_n on a Winkler foundation at the highest force [m], and what coarse ones miss at the lowest."""

    unit: Any
    arm: float
    missed: float


def _looked_at(units: Sequence[Any]) -> list[_Seen]:
    # Rounded up, so that no more than so many are looked at.
    seen = [found for unit in units[:: -(-len(units) // MOST_LOOKED_AT)] if (found := _seen(unit))]
    if not seen:
        raise StudyError(USAGE, "candidates: no pad meets the object; move the stations or poses onto it")
    return seen


def _quantiles(seen: Sequence[_Seen], count: int) -> list[Any]:
    # Rounded before it is ranked: rounding errors must not choose other probes on another machine.
    return [s.unit for s in _evenly(sorted(seen, key=lambda s: (round(s.arm / DIGIT), s.unit.index)), count)]


def _seen(unit: Any) -> _Seen | None:
    """None where a pad passes the object."""
    gripper, forces = unit.scene.gripper, unit.scene.load.normal_force
    try:
        finger = model.approach(build_object(unit.scene.object), unit.candidate.poses[0], gripper)
        arm = _arm(winkler_pad(gripper, finger, FINGER_POINTS), forces[-1])
        fine, *coarse = (_arm(winkler_pad(gripper, finger, points), forces[0]) for points in (POINTS, *COARSE_POINTS))
    # A candidate that cannot be looked at here fails as a case, with a message of its own.
    except (ValueError, RuntimeError, NoContactError):
        return None
    return _Seen(unit, arm, max(abs(own / fine - 1.0) for own in coarse) if fine > 0 else 0.0)


def _arm(pad: WinklerPad, force: float) -> float:
    """Mean arm of the pressure, which e_n is on a planar patch [m]."""
    patch = pad.patch(force)
    centre = patch.load @ patch.centroid / patch.load.sum()
    return float(patch.load @ np.linalg.norm(patch.centroid - centre, axis=1) / patch.load.sum())


def _point(scene: Scene, unit: Any) -> str:
    """The unit's point of the sweep, in words."""
    if not scene.sweep:
        return ""
    values = unit.scene.effective()
    values_text = [f"{key} = {values[key.partition('.')[0]][key.partition('.')[2]]}" for key in scene.sweep]
    return f" ({', '.join(values_text)})"


# --- Winkler foundation -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class WinklerPad:
    """A pad of independent springs and a planar contact patch: the milliseconds baseline.

    Every point of the pad's face is a spring of the foam's stiffness in confined compression, ``E_oed / thickness``,
    and feels nothing of its neighbours; all normals are those of the undeformed pad. The closing at a force is exact.

    Parameters
    ----------
    place : (n, 2) array
        Middles of equal cells of the pad's face [m].
    area : float
        Of each cell [m^2].
    height : (n,) array
        Closing displacement at which each cell touches [m]; infinite where there is no object before it.
    stiffness : float
        Pressure over shortening [Pa/m].
    """

    place: FloatArray
    area: float
    height: FloatArray
    stiffness: float

    def closing(self, force: float) -> float:
        """Closing displacement that carries a normal force [m]; the force is piecewise linear in it."""
        return bed_closing(self.height, force / (self.stiffness * self.area))

    def patch(self, force: float) -> ContactPatch:
        """Planar patch in the pad's frame at a normal force [N]."""
        pressure = self.stiffness * np.maximum(self.closing(force) - self.height, 0.0)
        place = np.column_stack([self.place, np.zeros(len(self.place))])
        side = 0.5 * np.array([np.ptp(np.unique(x)) / max(len(np.unique(x)) - 1, 1) for x in self.place.T])
        ring = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*side, 0.0]
        normal = np.broadcast_to([0.0, 0.0, 1.0], place.shape)
        return ContactPatch(place, np.full(len(place), self.area), normal, pressure, place[:, None] + ring)


def winkler_pad(gripper: Gripper, finger: model.Finger, points: tuple[int, int] = POINTS) -> WinklerPad:
    """Bed of springs of a pad at first touch with an object."""
    length, width, thickness = gripper.pad_size
    nx, ny = points
    x, y = ((np.arange(n) + 0.5) / n - 0.5 for n in (nx, ny))
    place = np.stack(np.meshgrid(length * x, width * y, indexing="ij"), axis=-1).reshape(-1, 2)
    return WinklerPad(place, length * width / (nx * ny), _heights(finger, place, thickness), stiffness(gripper))


def _heights(finger: model.Finger, place: FloatArray, thickness: float) -> FloatArray:
    """Distance along the approach from points of the face to the object ``(n,)`` [m]."""
    x = np.column_stack([place, np.zeros(len(place))])
    for _ in range(STEPS):
        gap, normal, _ = finger.gap(x)
        # Divided by a cosine that is not too small, or a steep flank would throw the point far away.
        x[:, 2] = np.clip(x[:, 2] + gap / np.maximum(-normal[:, 2], FLAT), 0.0, thickness)
    gap = finger.gap(x)[0]
    # A point that has not come to the surface looks past the object.
    return np.where(np.abs(gap) < 1e-3 * thickness, x[:, 2], np.inf)
