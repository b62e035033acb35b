"""From a scene to its axes, its grasp candidates and the units of work that cover every case once.

A unit is the load path of one candidate at one point of the sweep. Candidates that are images of each other
under the object's rotational symmetry are served by one unit. Cases are numbered like a C-ordered array over `axes`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from softjaw.study.case.candidates import Candidate, candidates, groups
from softjaw.study.scene import Option, Scene
from softjaw.study.units import UNITS, in_si, split_unit

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Axis:
    """One axis of the maps: ``values`` ``(k,)`` in SI units; texts are numbered and listed in ``options``."""

    name: str
    values: FloatArray
    units: str
    long_name: str
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Unit:
    """One load path, and the rows that it fills.

    Attributes
    ----------
    index : int
        Number of the unit, in the order of its first row.
    scene : Scene
        The scene with this point of the sweep put in; its own sweep is empty.
    candidate : Candidate
        The candidate that is solved.
    rows : tuple of tuples of int
        For each candidate served, its rows, one per force, rising.
    served, turns : tuples
        The candidates served, ``candidate`` first, and the angle about z that takes ``candidate`` to each [rad].
    cost : float
        Work, in element solves; only ratios mean something.
    probe : bool
        Whether it is solved again with inputs changed, as `study.case.probing` does.
    """

    index: int
    scene: Scene
    candidate: Candidate
    rows: tuple[tuple[int, ...], ...]
    served: tuple[Candidate, ...]
    turns: tuple[float, ...]
    cost: float
    probe: bool = False


def axes(scene: Scene) -> list[Axis]:
    """The axes of the maps: those of the sweep in the scene's order, then station, angle and normal force."""
    where = scene.candidates
    if where.poses:
        station = Axis("station", np.arange(len(where.poses), dtype=float), "", "number of the grasp candidate")
        angle = Axis("angle", np.zeros(1), "rad", "angle about the object's axis (explicit poses)")
    else:
        station = Axis("station", np.array(where.station_values), "m", "station along the object's axis")
        angle = Axis("angle", np.array(where.angles), "rad", "angle about the object's axis")
    force = Axis("normal_force", np.array(scene.load.normal_force), "N", "normal force per finger")
    return [*_sweep_axes(scene.sweep), station, angle, force]


def _sweep_axes(sweep: Mapping[str, Sequence[Option]]) -> list[Axis]:
    """One axis per key, named by the key without section and unit where that is unambiguous."""
    stems = [split_unit(key.partition(".")[2]) for key in sweep]
    taken = ["station", "angle", "normal_force", *(stem for stem, _ in stems)]
    made = []
    for (key, values), (stem, unit) in zip(sweep.items(), stems, strict=True):
        name = stem if taken.count(stem) == 1 else split_unit(key.replace(".", "_"))[0]
        if any(isinstance(v, str) for v in values):
            made.append(Axis(name, np.arange(len(values), dtype=float), "", key, tuple(map(str, values))))
        else:
            units = UNITS[unit].si if unit else ""
            made.append(Axis(name, np.array([in_si(key, v) for v in values], dtype=float), units, key))
    return made


def units(scene: Scene, axis_symmetry: Callable[[Scene], int]) -> list[Unit]:
    """All units of work of a scene, in the order of their first rows.

    Parameters
    ----------
    scene : Scene
    axis_symmetry : callable
        Order of the rotational symmetry about z of the object of a scene (0: every angle, 1: none). It is called for
        every point of the sweep, because a sweep can change the shape.
    """
    made: list[Unit] = []
    forces, count = len(scene.load.normal_force_n), scene.candidates.count
    for point, values in enumerate(product(*scene.sweep.values())):
        here = scene.with_values(dict(zip(scene.sweep, values, strict=True)))
        places, cost = candidates(here), path_cost(here)
        for group in groups(places, axis_symmetry(here)):
            rows = tuple(tuple(range(r, r + forces)) for r in ((point * count + n) * forces for n, _ in group))
            served, turns = tuple(places[n] for n, _ in group), tuple(turn for _, turn in group)
            made.append(Unit(len(made), here, served[0], rows, served, turns, cost * narrowness(here, served[0])))
    return made


def narrowness(scene: Scene, place: Candidate) -> float:
    """How much narrower a bottle is at a place than at its widest: narrow places are pressed deeper, in more steps."""
    if scene.object.shape != "revolution" or scene.candidates.poses:
        return 1.0
    z, r = np.transpose(scene.object.profile)
    return float(r.max() / max(np.interp(place.station, z, r), 0.1 * r.max()))


def path_cost(scene: Scene) -> float:
    """Work of one load path in element solves: forces x elements x nodes per element, and the coarse mesh's share."""
    nodes = {"hex8": 1, "hex27": 8}[scene.gripper.element]
    coarse = 1 + (scene.accuracy.meshes - 1) / 8
    return len(scene.load.normal_force_n) * math.prod(scene.gripper.elements) * nodes * coarse
