"""Grasp candidates: where both pads stand, which are images of each other, and the units of work that cover all cases.

A unit is the load path of one candidate at one point of the sweep. Candidates that are images of each other under the
object's rotational symmetry are served by one unit. Cases are numbered like a C-ordered array over `axes`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.objects.gap import Pose
from softjaw.study.case.build import forces_apart, middle_of, own_frame, pad_shape
from softjaw.study.quantities import MISSING, REALISATION
from softjaw.study.scene import Option, Scene
from softjaw.study.scene.grasps import GraspPose
from softjaw.study.units import UNITS, in_si, split_unit

if TYPE_CHECKING:
    from softjaw.fem.objects.centre_line import CentreLine

FloatArray = NDArray[np.float64]
STANDOFF = 5.0  # distance of a pad's origin from the point it is aimed at [m]; the press closes it to first touch
ALIKE = 1e-9  # differences of directions [-] and of lines of approach [m] that are only rounding


@dataclass(frozen=True)
class Candidate:
    """One place to grasp: station along the object's axis [m], angle about it, roll about the approach [rad].

    With explicit poses ``station`` is the candidate's number and ``angle`` and ``roll`` are 0. ``note`` is what the
    reader of a result should know about its place.
    """

    station: float
    angle: float
    roll: float
    poses: tuple[Pose, Pose]
    label: str
    note: str = ""


def candidates(scene: Scene) -> list[Candidate]:
    """The grasp candidates in the order of their rows: stations, then angles at each."""
    where = scene.candidates
    if where.poses:
        placed = own_frame(scene.object)
        return [
            Candidate(float(i), 0.0, 0.0, moved(explicit_poses(pose, placed), where.shift, where.roll), label)
            for i, (pose, label) in enumerate(zip(where.poses, where.labels, strict=True))
        ]
    middle, half = middle_of(scene), in_si("half_extent_mm", where.half_extent_mm(scene.gripper))
    notes = {s: middle.remark(s, half) if middle else "" for s in where.station_values}
    places = product(where.station_values, where.angles)
    return [
        Candidate(
            station, angle, where.roll, moved(axis_poses(station, angle, where.roll, middle), where.shift, 0.0),
            label, notes[station],
        )
        for (station, angle), label in zip(places, where.labels, strict=True)
    ]  # fmt: skip


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


def axis_poses(station: float, angle: float, roll: float, middle: CentreLine | None = None) -> tuple[Pose, Pose]:
    """Poses of the two pads at a station, which is a height, along the object's axis z or its centre line ``middle``.

    Finger 1 stands at ``angle`` and approaches along ``-(cos, sin, 0)``, finger 2 comes from the opposite side. At roll
    0 both long sides are the object's z; ``roll`` turns the gripper about finger 1's approach. On a centre line all of
    this is tilted with it, by the shortest turn that takes z to its tangent.
    """
    approach = -np.array([math.cos(angle), math.sin(angle), 0.0])
    # The rotation of z about the approach, which is normal to it.
    long_side = math.cos(roll) * np.array([0.0, 0.0, 1.0]) + math.sin(roll) * np.cross(approach, [0.0, 0.0, 1.0])
    if middle is None or middle.straight:
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


def across(approach: FloatArray, along: FloatArray) -> FloatArray:
    """Unit vector ``(3,)`` of the part of ``along`` across the approach."""
    part = along - np.dot(approach, along) * approach
    return part / np.linalg.norm(part)


def pad_axes(approach: FloatArray, long_side: FloatArray) -> FloatArray:
    """Rotation of a pad: long side, short side and approach as columns ``(3, 3)``."""
    return np.column_stack([long_side, np.cross(approach, long_side), approach])


def opposed_poses(point: FloatArray, approach: FloatArray, long_side: FloatArray) -> tuple[Pose, Pose]:
    """Two pads that face each other across a point, with the same long side in the object's frame.

    Parameters
    ----------
    point : (3,) array
        Any point on the common line of approach [m].
    approach, long_side : (3,) arrays
        Orthogonal unit vectors: finger 1's approach, and the long side of both pads.

    Returns
    -------
    (Pose, Pose)
        Finger 1 and finger 2, each `STANDOFF` away from the point.
    """
    return (_pose(point, approach, long_side), _pose(point, -approach, long_side))


def _pose(point: FloatArray, approach: FloatArray, long_side: FloatArray) -> Pose:
    return Pose(pad_axes(approach, long_side), point - STANDOFF * approach)


def turn_of_pose(one: Pose, other: Pose, axis_symmetry: int) -> float | None:
    """Angle about z [rad] that takes one approaching pad to another, if the object looks the same after it, else None.

    A shift along the approach does not count: the press closes the fingers.
    """
    turn = other.rotation @ one.rotation.T
    # Only turns about z take the object to itself, so all else is no image.
    if abs(turn[2, 2] - 1) > ALIKE or np.abs(turn[2, :2]).max() > ALIKE:
        return None
    angle = math.atan2(turn[1, 0], turn[0, 0])
    step = 2 * math.pi / axis_symmetry if axis_symmetry else 0.0
    if step and abs(angle - step * round(angle / step)) > ALIKE:
        return None
    shift = other.rotation.T @ (turn @ one.origin - other.origin)  # in the pad's frame: z is along the approach
    return None if np.abs(shift[:2]).max() > ALIKE else angle


def turn_between(first: Candidate, second: Candidate, axis_symmetry: int) -> float | None:
    """Angle about z that turns both pads of one candidate into those of another, if the object looks the same then.

    Parameters
    ----------
    first, second : Candidate
    axis_symmetry : int
        Order of the object's rotational symmetry about z; 0 is every angle.

    Returns
    -------
    float or None
        Angle in [0, 2 pi) [rad].
    """
    one, two = (turn_of_pose(*pair, axis_symmetry) for pair in zip(first.poses, second.poses, strict=True))
    if one is None or two is None or abs(math.remainder(one - two, 2 * math.pi)) > ALIKE:
        return None
    # A turn just below 0 by rounding would otherwise become a whole one.
    return 0.0 if abs(one) <= ALIKE else one % (2 * math.pi)


def groups(places: Sequence[Candidate], axis_symmetry: int) -> list[list[tuple[int, float]]]:
    """Candidates that are images of each other: lists of (number, turn from the first of the list [rad])."""
    found: dict[tuple[float, ...], list[list[tuple[int, float]]]] = {}
    for number, place in enumerate(places):
        for group in (alike := found.setdefault(_invariants(place), [])):
            if (turn := turn_between(places[group[0][0]], place, axis_symmetry)) is not None:
                group.append((number, turn))
                break
        else:
            alike.append([(number, 0.0)])
    # By the first member, so that the units do not depend on how they were found.
    return sorted((group for alike in found.values() for group in alike), key=lambda group: group[0][0])


def _invariants(place: Candidate) -> tuple[float, ...]:
    """What no turn about z and no shift along the approach changes: only candidates alike in it need be compared."""
    pose = place.poses[0]
    height = pose.origin[2] - (pose.origin @ pose.rotation[:, 2]) * pose.rotation[2, 2]
    # Adding 0 turns -0 into 0, which would be another key.
    return tuple(round(float(v), 6) + 0.0 for v in (*pose.rotation[2], height))


# --- axes of the maps, and units of work ------------------------------------------------------------------------------


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
    state, reason : int, str
        One of `study.quantities.NO_GRASP` and why, for a candidate that is not solved; else `MISSING`, not computed.
    hopeless : bool
        Whether a bed of springs says that it cannot hold, or bears on a pad's rim: it comes last in the order of work.
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
    hopeless: bool = False

    @property
    def apart(self) -> bool:
        """Whether its forces are independent of each other, so that ranks may divide them."""
        return forces_apart(self.scene)


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
    return [*_sweep_axes(scene.sweep), *_realisation_axis(scene), station, angle, force]


def _realisation_axis(scene: Scene) -> list[Axis]:
    """The scene's own inputs and every sample of the uncertain ones; no axis where none is uncertain."""
    if len(realisations := scene.realisations) == 1:
        return []
    texts = (", ".join(f"{key} = {value:g}" for key, value in inputs.items()) for inputs in realisations[1:])
    numbers = np.arange(len(realisations), dtype=float)
    return [Axis(REALISATION, numbers, "", "sample of the uncertain inputs", ("as given", *texts))]


def _sweep_axes(sweep: Mapping[str, Sequence[Option]]) -> list[Axis]:
    """One axis per key, named by the key without section and unit where that is unambiguous."""
    stems = [split_unit(key.partition(".")[2]) for key in sweep]
    taken = ["station", "angle", "normal_force", *(stem for stem, _ in stems)]
    made = []
    for (key, values), (stem, unit) in zip(sweep.items(), stems, strict=True):
        # Keys of two sections with one stem keep their section in the name.
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
    forces, count = len(scene.load.normal_force_n), scene.candidates.total
    for point, values in enumerate(scene.points):
        here = scene.with_values(values | {"uncertainty.spread": {}})
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
    # A tip of no width must not make a candidate infinitely dear.
    return float(r.max() / max(np.interp(place.station, z, r), 0.1 * r.max()))


def path_cost(scene: Scene) -> float:
    """Work of one load path in element solves: forces x elements x nodes per element, and the coarse mesh's share."""
    # A triquadratic element has eight times the nodes that it does not share.
    nodes = {"hex8": 1, "hex27": 8}[scene.gripper.element]
    return len(scene.load.normal_force_n) * math.prod(scene.gripper.elements) * nodes * meshes_cost(scene)


def meshes_cost(scene: Scene) -> float:
    """Elements of all meshes of a case over those of the fine one."""
    shares = [math.prod(pad_shape(scene.gripper, coarser).elements) for coarser in (False, True)]
    return sum(shares[: scene.accuracy.meshes]) / shares[0]
