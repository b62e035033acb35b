"""Grasp candidates: where both pads stand, which are images of each other, and the units of work that cover all cases.

A unit is the load path of one candidate at one point of the sweep. Candidates that are images of each other under the
object's rotational symmetry are served by one unit. Cases are numbered like a C-ordered array over `axes`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.objects.gap import Pose
from softjaw.friction.patch import NEGLIGIBLE
from softjaw.study.case.build import (
    build_object,
    check_object,
    forces_apart,
    geometry,
    middle_of,
    own_frame,
    pad_shape,
    shapes_of,
    surface_triangles,
    with_mass,
)
from softjaw.study.case.fit import doubt, extremes, fit_of, jaws_of
from softjaw.study.case.poses import axis_poses, explicit_poses, moved, turn_of_pose
from softjaw.study.messages import USAGE, StudyError, first_of, shown
from softjaw.study.quantities import MISSING, REALISATION, Axis
from softjaw.study.scene import Scene
from softjaw.study.units import UNITS, in_si, split_unit


class Candidate(NamedTuple):
    """One place to grasp: station along the object's axis [m], angle about it [rad].

    With explicit poses ``station`` is the candidate's number and ``angle`` is 0. ``note`` is what the reader of a
    result should know about its place.
    """

    station: float
    angle: float
    poses: tuple[Pose, Pose]
    label: str
    note: str = ""


def candidates(scene: Scene) -> list[Candidate]:
    """The grasp candidates in the order of their rows: stations, then angles at each."""
    where = scene.candidates
    if where.poses:
        placed = own_frame(scene.object)
        return [
            Candidate(float(i), 0.0, moved(explicit_poses(pose, placed), where.shift, where.roll), label)
            for i, (pose, label) in enumerate(zip(where.poses, where.labels, strict=True))
        ]
    middle, half = middle_of(scene), in_si("half_extent_mm", where.half_extent_mm(scene.gripper))
    notes = {s: middle.remark(s, half) if middle else "" for s in where.station_values}
    return [
        Candidate(s, angle, _pads(where, s, angle, middle), label, notes[s])
        for (s, angle), label in zip(product(where.station_values, where.angles), where.labels, strict=True)
    ]


def _pads(where: Any, station: float, angle: float, middle: Any) -> tuple[Pose, Pose]:
    """Both pads at a station and an angle before they touch, as the scene's section ``where`` turns and shifts them."""
    return moved(axis_poses(station, angle, where.roll, middle), where.shift, 0.0)


def touching_pads(scene: Scene, station: float, angle: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations ``(2, 3, 3)`` and origins ``(2, 3)`` [m] of both pads where they first touch at a station and an angle.

    In the frame of the object's own file, of a scene whose candidates are stations [m] and angles [rad].
    """
    obj, placed = build_object(scene.object), own_frame(scene.object)
    pads = _pads(scene.candidates, station, angle, middle_of(scene))
    poses = [geometry().approach(obj, pad, scene.gripper).pose for pad in pads]
    origins = placed.to_object(np.stack([pose.origin for pose in poses]))
    return placed.rotation @ np.stack([pose.rotation for pose in poses]), origins


def check_candidates(scene: Scene) -> None:
    """Refuse explicit poses whose pads pass the object, and a sampler that finds no grasp, without all its grasps.

    Raises `StudyError` with the numbers and labels of the poses.
    """
    if scene.candidates.sampled and not scene.candidates.poses:
        _sampler().check_sampler(scene)
    if not scene.candidates.poses or scene.object.shape == "plane":  # which has no end
        return
    labels: dict[int, str] = {}
    for shape in shapes_of(scene):
        points, triangles = surface_triangles(shape)
        for number, place in enumerate(candidates(scene)):
            pose = place.poses[0]  # finger 2 comes along the same line
            low, _ = extremes((points - pose.origin) @ pose.rotation, triangles, scene.gripper.pad_size[:2])
            if not math.isfinite(low):
                labels[number] = f"{shown([*scene.candidates.poses[number].point_mm])} of '{place.label}'"
    if labels:
        remedy = "expected a line of approach that meets it; point_mm is in mm, in the frame of the object's own file"
        misses = [f"candidates.poses[{i}].point_mm: found {label}, where the pads miss the object; {remedy}"
                 for i, label in labels.items()]  # fmt: skip
        raise StudyError(USAGE, "\n".join(first_of(misses, 5, " poses miss it")))


def turn_between(first: Candidate, second: Candidate, axis_symmetry: int) -> float | None:
    """Angle about z that turns both pads of one candidate into those of another, if the object looks the same then.

    In [0, 2 pi) [rad]. ``axis_symmetry``: order of the object's rotational symmetry about z; 0 is every angle.
    """
    angle, other = (turn_of_pose(*pair, axis_symmetry) for pair in zip(first.poses, second.poses, strict=True))
    if angle is None or other is None or abs(math.remainder(angle - other, 2 * math.pi)) > NEGLIGIBLE:
        return None
    # A turn just below 0 by rounding would otherwise become a whole one.
    return 0.0 if abs(angle) <= NEGLIGIBLE else angle % (2 * math.pi)


def groups(places: Sequence[Candidate], axis_symmetry: int) -> list[list[tuple[int, float]]]:
    """Candidates that are images of each other: lists of (number, turn from the first of the list [rad])."""
    alike: dict[tuple[float, ...], list[list[tuple[int, float]]]] = {}
    for number, place in enumerate(places):
        for group in (similar := alike.setdefault(_invariants(place), [])):
            if (turn := turn_between(places[group[0][0]], place, axis_symmetry)) is not None:
                group.append((number, turn))
                break
        else:
            similar.append([(number, 0.0)])
    # By the first member, so that the units do not depend on how they were found.
    return sorted((group for similar in alike.values() for group in similar), key=lambda group: group[0][0])


def _invariants(place: Candidate) -> tuple[float, ...]:
    """What no turn about z and no shift along the approach changes: only candidates alike in it need be compared."""
    pose = place.poses[0]
    height = pose.origin[2] - (pose.origin @ pose.rotation[:, 2]) * pose.rotation[2, 2]
    # Adding 0 turns -0 into 0, which would be another key.
    return tuple(round(float(v), 6) + 0.0 for v in (*pose.rotation[2], height))


def with_sampled_grasps(scene: Scene) -> Scene:
    """The scene `with_mass`, and with explicit poses where it asks for a sampler; see `study.case.sampler`.

    Raises `StudyError` for geometry that cannot be, or that leaves no grasp between the pads.
    """
    scene = with_mass(scene)
    if scene.candidates.sampled is None:
        return scene
    check_object(scene)
    return _sampler().with_sampled_grasps(scene)


def _sampler() -> Any:
    from softjaw.study.case import sampler  # compiled loops, which most scenes are checked without

    return sampler


# --- axes of the maps, and units of work ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Unit:
    """One load path, number ``index`` in the order of its first row, and the rows that it fills.

    ``scene``: with this point of the sweep put in, and no sweep of its own. ``candidate`` is the one that is solved;
    ``served`` are those that it serves, itself first, ``turns`` the angles about z that take it to each [rad], and
    ``rows`` for each its rows, one per force, rising. ``cost``: work, in element solves; only ratios mean something.
    ``state, reason``: one of `study.quantities.NO_GRASP` and why, for a candidate that is not solved; else `MISSING`,
    not computed. ``finest``: finest mesh of each force, as `study.case.solver` numbers them; empty where the scene
    alone says it. ``together``: that one is solved whatever the error on the one before, as of other samples.
    """

    index: int
    scene: Scene
    candidate: Candidate
    rows: tuple[tuple[int, ...], ...]
    served: tuple[Candidate, ...]
    turns: tuple[float, ...]
    cost: float
    state: int = MISSING
    reason: str = ""
    finest: tuple[int, ...] = ()
    together: bool = False

    @property
    def apart(self) -> bool:
        """Whether its forces are independent of each other, so that ranks may divide them."""
        return forces_apart(self.scene) and (not self.finest or any(self.finest))


def axes(scene: Scene) -> list[Axis]:
    """The axes of the maps: those of the sweep in the scene's order, samples, station, angle and normal force."""
    where = scene.candidates
    if where.poses:
        station = Axis("station", np.arange(len(where.poses), dtype=float), "", "number of the grasp candidate")
        angle = Axis("angle", np.zeros(1), "rad", "angle about the object's axis (explicit poses)")
    else:
        station = Axis("station", np.array(where.station_values), "m", "station along the object's axis")
        angle = Axis("angle", np.array(where.angles), "rad", "angle about the object's axis")
    force = Axis("normal_force", np.array(scene.load.normal_force), "N", "normal force per finger")
    scene_axes = [station, angle, force]
    if samples := scene.realisations[1:]:
        texts = (", ".join(f"{key} = {value:g}" for key, value in inputs.items()) for inputs in samples)
        numbers = np.arange(1.0 + len(samples))
        scene_axes.insert(0, Axis(REALISATION, numbers, "", "sample of the uncertain inputs", ("as given", *texts)))
    return [*_sweep_axes(scene.sweep), *scene_axes]


def option_text(value: Any) -> str:
    """A swept word or list of numbers as a file has it."""
    return value if isinstance(value, str) else " x ".join(f"{x:g}" for x in value)


def _sweep_axes(sweep: Mapping[str, Sequence[Any]]) -> list[Axis]:
    """One axis per key, named by the key without section and unit where that is unambiguous."""
    stems = [split_unit(key.partition(".")[2]) for key in sweep]
    known = ["station", "angle", "normal_force", *(stem for stem, _ in stems)]
    made = []
    for (key, values), (stem, unit) in zip(sweep.items(), stems, strict=True):
        # Keys of two sections with one stem keep their section in the name.
        name = stem if known.count(stem) == 1 else split_unit(key.replace(".", "_"))[0]
        if isinstance(values[0], str | tuple):
            made.append(Axis(name, np.arange(len(values), dtype=float), "", key, tuple(map(option_text, values))))
        else:
            units = UNITS[unit].si if unit else ""
            made.append(Axis(name, np.array([in_si(key, v) for v in values], dtype=float), units, key))
    return made


def units(scene: Scene) -> list[Unit]:
    """All units of work of a scene, in the order of their first rows."""
    made: list[Unit] = []
    forces, count = len(scene.load.normal_force_n), scene.candidates.total
    for point, values in enumerate(scene.points):
        at_point = scene.at(values)
        places, cost = candidates(at_point), path_cost(at_point)
        for group in groups(places, at_point.axis_symmetry):
            rows = tuple(tuple(range(r, r + forces)) for r in ((point * count + n) * forces for n, _ in group))
            served, turns = tuple(places[n] for n, _ in group), tuple(turn for _, turn in group)
            made.append(Unit(len(made), at_point, served[0], rows, served, turns, cost))
    return made


def path_cost(scene: Scene) -> float:
    """Work of one load path in element solves: forces x elements x nodes per element, and the coarse mesh's share."""
    # A triquadratic element has eight times the nodes that it does not share.
    nodes = {"hex8": 1, "hex27": 8}[scene.gripper.element]
    elements = [math.prod(pad_shape(scene.gripper, coarser).elements) for coarser in (False, True)]
    share = sum(elements[: scene.accuracy.meshes]) / elements[0]
    return len(scene.load.normal_force_n) * math.prod(scene.gripper.elements) * nodes * share


def decided(units: Sequence[Unit]) -> list[Unit]:
    """Units of work with the states of those whose candidate is too wide or collides; images share the state."""
    states = []
    for unit in units:
        scene, jaws = unit.scene, jaws_of(unit.scene)
        if math.isfinite(jaws.max_opening) or jaws.finger is not None:
            points, triangles = surface_triangles(scene.object)
            pose = unit.candidate.poses[0]
            state, reason = fit_of((points - pose.origin) @ pose.rotation, triangles, jaws, doubt(points))
            unit = replace(unit, state=state, reason=reason)
        states.append(unit)
    return states
