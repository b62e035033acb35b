"""What the next round of a run solves, by stored numbers and the object's triangles alone.

Of sampled grasps finer meshes for some cases. All candidates are solved on the coarse mesh first. The scene's mesh goes
to the places that a list of the best grasps has at the force that is shown, and to grasps that failed, then to those
that may still be better within their errors, also if the coarse mesh says that they slip: where few elements bear
beside an edge it may tilt the contact normal. Those that may be the best, and whose payload is not known to
``accuracy.target``, are solved on a finer mesh, and on one more where that may do; at last the best at other forces.
Each case is named at most three times, so the rounds end.

Of grasps that a scene lists, with uncertain inputs, finer meshes for all cases whose error misses the target.

Of poses that are refined neighbours of the best grasp at each force: shifted along the pads' sides, turned about the
approach or tilted, by a share of a first step. A round solves those of them that a bed of springs ranks highest; the
share is halved once no neighbour is better. A peak that no grasp of the scene comes near stays unseen. Of stations see
`study.run.refine`.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import FloatArray
from softjaw.study import ranking
from softjaw.study.case.bed import JawsOnSurface, grips, spring_payload
from softjaw.study.case.build import build_object, own_frame, samples_together, shapes_of, surface_triangles
from softjaw.study.case.fit import jaws_of
from softjaw.study.case.poses import STANDOFF, explicit_poses, in_file
from softjaw.study.case.result import UNDECIDED, surely_below
from softjaw.study.case.sampler import lids_of
from softjaw.study.case.task import task_of
from softjaw.study.flags import LOST, Flag
from softjaw.study.quantities import DONE, FAILED, LISTED, NO_GRASP
from softjaw.study.ranking import distinct, judge, largest, rank_values, ranked, sure
from softjaw.study.result.read import dataset, other_levels
from softjaw.study.result.write import keeps_coarser
from softjaw.study.run.refine import Place, gained, next_stations, scores_of_poses, with_places
from softjaw.study.scene import Scene
from softjaw.study.scene.grasps import GraspPose
from softjaw.study.scene.sections import FINEST

Case = tuple[int, int, int]  # numbers of the point of a sweep, of the candidate and of the force
Frame = tuple[FloatArray, FloatArray]  # a point [m]; long side, short side and approach as columns
FIRST_STEP_SHARE = 0.25  # first step of a shift, of the pad's side
ROLL, TILT = math.radians(15.0), math.radians(5.0)  # first steps of a turn about the approach and of a tilt of it
FINEST_STEP_SHARE = 1 / 8  # of the first step: 1.6 mm along a pad of 50 mm, 0.6 degrees of tilt
SAME_POSE_STEPS = 0.5  # of a step, within which two poses are one
IN_REACH = 3.0  # times the target: what an error may be that two further meshes bring below it; one, half as much
POSES_PER_ROUND = 4  # poses of a round: few, so that the next ones start from the better of them


def next_round(result: Any, scene: Scene, each: int) -> tuple[Any, ...]:
    """What the next round solves; nothing where the best is known well enough or the budget is spent.

    ``each`` is the number of cases that are solved at a station, or of a pose.
    """
    if scene.candidates.poses:
        return next_poses(result, scores_of_poses(result), scene, each) or next_cases(result, scene)
    # a station between others changes the numbers by which cases are named
    return (not result.layout.finer and next_stations(result, scene, each)) or next_cases(result, scene)


def next_poses(result: Any, values: FloatArray, scene: Scene, each: int) -> tuple[Place, ...]:
    """Poses of the next round; none where a finer step gained too little, at the finest, or with the budget spent.

    ``values`` (poses, columns) array: score of every pose at every force and point of the sweep, NaN where a grasp
    cannot be used. ``scene``: as it was before any round. ``each``: cases of a pose.
    """
    where, rounds = scene.candidates, result.layout.added
    given = len(values) - sum(map(len, rounds))
    added = np.moveaxis(result.status.reshape(-1, *result.layout.shape[-3:]), 1, 0)[given:]
    budget = ((where.refine or 0) - int(np.sum(~np.isin(added, NO_GRASP)))) // each
    share = rounds[-1][0][0] if rounds else 1.0
    while budget > 0 and share >= FINEST_STEP_SHARE:
        if poses := _neighbours(scene, rounds, values, share):
            return tuple(poses[: min(budget, POSES_PER_ROUND)])
        before = given + sum(len(some) for some in rounds if some[0][0] > share)
        if share < 1.0 and gained(values, before) < scene.accuracy.refined_within * (1 + UNDECIDED):
            return ()
        share /= 2
    return ()


def _neighbours(scene: Scene, rounds: Any, values: FloatArray, share: float) -> list[Place]:
    """Neighbours of the best grasps that are not known yet, those first that a bed of springs finds the better."""
    shape, jaws = shapes_of(scene)[0], jaws_of(scene)
    placed, surface, obj = own_frame(shape), surface_triangles(shape), build_object(shape)
    lids, task = lids_of(obj), task_of(scene)

    def promise(grip: JawsOnSurface) -> float:
        return grip.peak * spring_payload(grip.contacts, task)

    known = [_frame(pose, placed) for pose in with_places(scene.candidates.poses, rounds)]

    def unknown(frame: Frame) -> bool:
        return not any(apart(frame, other, jaws.pad) < SAME_POSE_STEPS * share for other in known)

    poses: list[tuple[float, Place]] = []
    columns = (column for column in values.T if np.nanmax(column, initial=0.0) > 0.0)
    for best in dict.fromkeys(map(largest, columns)):
        # payload on a bed of springs, below which it is none [kg]
        reference = max(promise(JawsOnSurface(surface, *known[best], jaws)), 1e-9)
        for grip in grips(surface, filter(unknown, _moved(known[best], share, jaws.pad)), jaws, lids):
            # In the middle between both contacts, where the next tilt turns about.
            known.append((grip.middle, grip.axes))
            place = in_file(grip.middle, grip.axes[:, 2], grip.axes[:, 0], placed)
            poses.append((round(promise(grip) / reference, 3), (share, *place)))
    return [place for _, place in sorted(poses, key=lambda pair: -pair[0])]


def _frame(pose: GraspPose, placed: Any) -> Frame:
    """A grasp in the object's frame."""
    axes = explicit_poses(pose, placed)[0]
    return axes.origin + STANDOFF * axes.rotation[:, 2], axes.rotation


def _moved(frame: Frame, share: float, pad: Sequence[float]) -> Iterator[Frame]:
    """The ten neighbours of a grasp: shifts to both sides along both sides of the pads, and turns about all axes."""
    point, axes = frame
    for side, sign in product((0, 1), (1.0, -1.0)):
        yield point + sign * share * FIRST_STEP_SHARE * pad[side] * axes[:, side], axes
    for axis, sign in product((2, 0, 1), (1.0, -1.0)):
        turn, (i, j) = sign * share * (ROLL if axis == 2 else TILT), ((axis + 1) % 3, (axis + 2) % 3)
        R = np.eye(3)
        R[[i, j], [i, j]], R[i, j], R[j, i] = math.cos(turn), -math.sin(turn), math.sin(turn)
        yield point, axes @ R


def apart(first: Frame, other: Frame, pad: Sequence[float]) -> float:
    """How far two grasps are apart, in first steps; shifts along the approach and swapped fingers do not count."""
    off, R = first[1].T @ (other[0] - first[0]), np.abs(first[1].T @ other[1])
    shift = max(abs(float(off[k])) / (FIRST_STEP_SHARE * pad[k]) for k in (0, 1))
    roll, tilt = math.atan2(R[1, 0], R[0, 0]), math.atan2(math.hypot(R[0, 2], R[1, 2]), R[2, 2])
    return max(shift, roll / ROLL, tilt / TILT)


# --- finer meshes -----------------------------------------------------------------------------------------------------


def next_cases(result: Any, scene: Scene) -> tuple[Case, ...]:
    """Cases of the next round; none where the best are known as well as the scene asks for."""
    if not scene.candidates.sampled:
        return off_target(dataset(result), scene, result.layout.finer) if samples_together(scene) else ()
    if "work/mesh" not in {q.key for q in result.layout.quantities}:
        return ()
    ds = judge(dataset(result))
    k = ds.attrs["level"]
    order, known = [int(i) for i in ranked(ds, k, "payload")], sure(ds, "payload", k)
    if known is None:
        return ()
    named, shape, target = result.layout.finer, ds.status.shape, scene.accuracy.target
    relative = ds[f"{scene.accuracy.target_of}_error"].values.reshape(-1, shape[-1])
    often = _often(ds, named, k, surely_below(relative, target or 0.0))
    times, flags = often[:, k], ds["flags"].values[..., k].ravel()
    lost = [i for i in order if flags[i] & LOST and not flags[i] & Flag.OUT_OF_REACH][:LISTED]
    order = [i for i in order if not flags[i] & LOST and np.isfinite(known.value[i])]
    places = distinct(ds, order, rank_values(ds, "payload", k), k)
    error = np.nan_to_num(known.error, nan=np.inf)
    # thin parts may have no state on a mesh this coarse; what a bed of springs ranks first comes first
    without = ds.status.values.reshape(-1, shape[-1]) == FAILED
    failed = [] if named else np.flatnonzero(without[:, k])[:LISTED].tolist()
    chosen = failed + [place.best for place in places[:LISTED] if not times[place.best]]
    chosen = chosen or [i for i in rivals(places, known.value, error, lost) if not times[i]][:LISTED]
    if not chosen:
        relative = np.nan_to_num(relative[:, k], nan=np.inf)
        most = max((known.value[i] - error[i] for i in order), default=-np.inf)
        reach = relative < IN_REACH / np.maximum(times, 1) * (target or np.inf)
        near = {place.best for place in places[:LISTED] if reach[place.best]}
        near |= {i for i in order if known.value[i] + error[i] > most and (times[i] == 1 or reach[i])}
        chosen = [i for i in near if 0 < times[i] < FINEST and not (target and surely_below(relative[i], target))]
        # what one mesh says of pads that meet beside a thin part, or of a contact that slips, the next one may not
        chosen += [i for i in lost if times[i] == 1 and (known.value[i] + error[i] > most or error[i] > known.value[i])]
    # The least force that holds a mass lies between this force and the one below.
    levels: tuple[int, ...] = (k - 1, k) if k and "safety_factor" in ds else (k,)
    if not chosen and places and "safety_factor" not in ds:  # the first lines say what the best holds at these forces
        chosen = [places[0].best]
        levels = tuple(i for i in other_levels(shape[-1], k) if not named[case_of(chosen[0], i, shape)])
    cases = {(i, n) for i in chosen for n in levels if n == k or often[i, n] < FINEST}
    cases |= {(i, n) for i in chosen for n in np.flatnonzero(without[i, :k] & (often[i, :k] == 0)).tolist()}
    return tuple(sorted(case_of(i, n, shape) for i, n in cases))


def _often(ds: Any, named: Mapping[Case, int], k: int = 0, known: Any = False) -> NDArray[np.int64]:
    """How often each case was named, ``(candidates, forces)``; `FINEST` for those that are not named again.

    These wait for ``--retry-failed``, or are ``known`` to the target at a force beside the ``k``-th: all samples of
    uncertain inputs are solved on the mesh that a case is named for, whatever its error.
    """
    shape, forces = ds.status.shape, ds.status.shape[-1]
    left = keeps_coarser(ds["message"].values).reshape(-1, forces)
    often = np.array([[named[case_of(i, n, shape)] for n in range(forces)] for i in range(len(left))])
    return np.where(left | known & (often > 0) & (np.arange(forces) != k), FINEST, often)


def off_target(ds: Any, scene: Scene, named: Mapping[Case, int]) -> tuple[Case, ...]:
    """Cases whose error is not surely below the target, as far as there is a finer mesh.

    All start on the scene's mesh, so the first time a case is named twice.
    """
    shape, target = ds.status.shape, scene.accuracy.target or math.inf
    error = np.where(ds.status == DONE, ds[f"{scene.accuracy.target_of}_error"], 0.0).reshape(-1, shape[-1])
    often = _often(ds, named)
    cases = ((case_of(i, k, shape), often[i, k]) for (i, k), e in np.ndenumerate(error) if not surely_below(e, target))
    return tuple(case for case, times in cases for _ in range(2 - min(times, 1)) if times < FINEST)


def rivals(
    places: Iterable[ranking.Place], value: FloatArray, error: FloatArray, lost: Iterable[int] = (), count: int = LISTED
) -> list[int]:
    """Grasps that within the errors may be among the best ``count`` places, or be the best of one; the best first.

    Of those that do not hold, ``lost``, the ones that may hold more than every place surely does.

    >>> places = [ranking.Place(0, [1], 0.0, []), ranking.Place(2, [], 0.0, []), ranking.Place(3, [], 0.0, [])]
    >>> rivals(places, np.array([9.0, 8.5, 8.0, 6.0]), np.array([0.1, 1.0, 1.5, 0.2]), count=1)
    [1, 2]
    """
    places = list(places)
    least = min((value[place.best] - error[place.best] for place in places[:count]), default=-np.inf)
    known: list[int] = []
    for n, place in enumerate(places):
        head = place.best
        known += [head] if n >= count and value[head] + error[head] > least else []
        best = value[head] - error[head]
        known += [i for i in place.near if value[i] + error[i] > max(best, least)]
    most = max((value[place.best] - error[place.best] for place in places), default=-np.inf)
    known += [i for i in lost if value[i] + error[i] > most]
    return sorted(known, key=lambda i: (-value[i], i))


def case_of(candidate: int, k: int, shape: tuple[int, ...]) -> Case:
    """A case from the number of its candidate, counted over sweeps, stations and angles."""
    point, number = divmod(candidate, shape[-3] * shape[-2])
    return point, number, k
