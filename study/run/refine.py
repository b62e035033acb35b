"""Further grasps, in rounds: where the best may still lie between two solved stations, by stored numbers alone.

Between two stations a score is taken to rise no faster than `STEEPER_SLOPE` times the steepest slope of the interval
and of the two beside it. Where that lets it pass the best one by more than the scene tolerates, the middle of the
interval is solved. Poses have no order: around the best of them `study.run.rounds` searches. Angles are not refined,
every station has all.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import FloatArray
from softjaw.study.case.poses import pose_of
from softjaw.study.case.result import UNDECIDED
from softjaw.study.flags import LOST, Flag
from softjaw.study.quantities import DONE, MISSING
from softjaw.study.ranking import judge
from softjaw.study.result.layout import is_case
from softjaw.study.result.read import dataset
from softjaw.study.scene import Scene
from softjaw.study.scene.grasps import GraspPose
from softjaw.study.scene.text import scene_table

Rounds = tuple[tuple[Any, ...], ...]  # as `study.result.layout.Layout.rounds`
Place = tuple[float, ...]  # share of the first step, then point [mm], approach and long side, as a scene gives them
STEEPER_SLOPE = 1.5  # how much steeper a score may be than its slopes between stations show
FINEST_SPACING_SHARE = 1 / 64  # of the scene's mean distance of stations; nearer ones would only follow a jump


def refined(scene: Scene, rounds: Rounds) -> Scene:
    """The scene with the stations or poses that rounds added as its own."""
    rounds = tuple(added for added in rounds if not is_case(added[0]))
    if not rounds:
        return scene
    where, grown = scene.candidates, dict[str, Any](refine=None)
    if where.poses:
        grown |= {"poses": with_places(where.poses, rounds)}
    else:
        stations = {*where.station_values_mm, *(s for added in rounds for s in added)}
        grown |= {"stations": None, "stations_mm": tuple(sorted(stations))}
    return scene.model_copy(update={"candidates": where.model_copy(update=grown)})


def with_places(poses: Sequence[GraspPose], rounds: Sequence[Sequence[Place]]) -> tuple[GraspPose, ...]:
    """The poses of a scene, then those that rounds added."""
    return (*poses, *(pose_of(x[1:]) for added in rounds for x in added))


def chances(stations: FloatArray, score: FloatArray, sound: NDArray[np.bool_], finest: float) -> FloatArray:
    """By which share each interval between stations may beat the best grasp, at the force where that is most.

    ``stations`` (s,) array: rising. ``score`` (p, s, a, f) array: of every case: points of a sweep, stations, angles,
    forces; NaN where there is none. ``sound`` (p, s, a, f) array: whether the grasp can be used. ``finest``: intervals
    that are not twice as wide are not divided, and have no chance. Returns (s - 1,) array: 0 where nothing is expected
    to be better.
    """
    h = np.diff(stations)
    slope = np.abs(np.diff(score, axis=1)) / h[None, :, None, None]
    # fmax: beside a case without a value, the slopes that are known count.
    steepest = slope.copy()
    steepest[:, 1:] = np.fmax(steepest[:, 1:], slope[:, :-1])
    steepest[:, :-1] = np.fmax(steepest[:, :-1], slope[:, 1:])
    middle = (score[:, 1:] + score[:, :-1]) / 2
    most = middle + STEEPER_SLOPE * steepest * h[None, :, None, None] / 2
    most[~(sound[:, 1:] | sound[:, :-1])] = np.nan
    best = np.where(sound, score, -np.inf).max(axis=(1, 2))[:, None, None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(np.where(best > 0, most / best - 1, 0.0), nan=0.0)
    return np.where(h >= 2 * finest * (1 - UNDECIDED), np.maximum(share.max(axis=(0, 2, 3)), 0.0), 0.0)


def chances_in(result: Any) -> FloatArray:
    """`chances` of a result file of stations."""
    values, sound = _scores(result)
    stations, added = result.axes[-3].values, sum(map(len, result.layout.added))
    finest = FINEST_SPACING_SHARE * np.ptp(stations) / max(len(stations) - added - 1, 1)
    return chances(stations, values, sound, finest)


def _scores(result: Any) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The payload, by which grasps are ranked, CCM, NaN where nothing is solved; and whether a grasp can be used."""
    values = _cases(result, result.read("payload/ccm"))
    flags = np.nan_to_num(_cases(result, result.read("flags/flags"))).astype(np.int64)
    if _preset(result):  # what its hand does not reach cannot be used either
        flags |= judge(dataset(result))["flags"].values.reshape(flags.shape) & Flag.OUT_OF_REACH
    values = np.where(_cases(result, result.status) == DONE, values, np.nan)
    return values, np.isfinite(values) & (flags & LOST == 0)


def _preset(result: Any) -> bool:
    return bool(scene_table(result.scene, "gripper").get("preset"))


def scores_of_poses(result: Any) -> FloatArray:
    """The same of every pose at every force and point of the sweep, NaN where a grasp cannot be used."""
    values, sound = _scores(result)
    return np.moveaxis(np.where(sound, values, np.nan), 1, 0).reshape(values.shape[1], -1)


def _cases(result: Any, values: np.ndarray) -> np.ndarray:
    """Values of all cases as points of the sweep, stations, angles, forces; of uncertain inputs the scene's own."""
    return values.reshape(-1, *result.layout.shape[-3:])[:: result.layout.inputs]


def gained(values: FloatArray, before: int) -> float:
    """By which share the poses after the first ``before`` are better than those, in the column where that is most."""
    old, new = (np.fmax.reduce(part, axis=0, initial=0.0) for part in (values[:before], values[before:]))
    with np.errstate(divide="ignore", invalid="ignore"):
        return max(0.0, float(np.nan_to_num(new / old - 1.0, nan=0.0, posinf=np.inf).max(initial=0.0)))


def added_cases(units: Sequence[Any], layout: Any) -> int:
    """Cases that are solved at each station of a plan; images by symmetry lie at the station of what is solved.

    Or for each pose, as if it had no image.
    """
    if not layout.axes[-3].units:
        return int(layout.rows // layout.shape[-3])
    return len(units) * layout.shape[-1] // layout.shape[-3]


def next_stations(result: Any, scene: Scene, each: int) -> tuple[float, ...]:
    """Stations of the next round [mm], rising; none where the best is known well enough or the budget is spent.

    ``each`` is the number of cases that are solved at a station.
    """
    where = scene.candidates
    if where.refine is None:
        return ()
    given, added = where.station_values_mm, [s for some in result.layout.added for s in some]
    budget = where.refine // each - len(added)
    chance = chances_in(result)
    stations = sorted({*given, *added})
    # share of the largest chance: intervals with at least that are divided in the same round
    widest = 0.5 * float(chance.max(initial=0.0))
    limit = max(scene.accuracy.refined_within * (1 + UNDECIDED), widest * (1 - UNDECIDED))
    # Rounded, so that chances that are equal but for rounding come in the order of their stations.
    order = np.lexsort((np.arange(len(chance)), -chance.round(6)))
    chosen = [i for i in order if chance[i] > limit][: max(budget, 0)]
    return tuple(sorted(_middle(stations[i], stations[i + 1]) for i in chosen))


def _middle(low: float, high: float) -> float:
    """Middle of an interval, with no more digits than tell it from the ends.

    >>> _middle(64.70588235294117, 69.11764705882354)
    66.912
    """
    return round((low + high) / 2, 3 - math.floor(math.log10(high - low)))


def about(result: Any) -> str:
    """What was added, and how well the best grasp is known, in a sentence; empty where nothing was added."""
    rounds = result.layout.added
    if not rounds:
        return ""
    count, stations = sum(map(len, rounds)), result.layout.shape[-3]
    what = "stations" if result.axes[-3].units else "poses"
    text = f"{stations - count} {what} of the scene and {count} added in {_counted(len(rounds), 'round')}"
    if (result.status == MISSING).any():
        return f"{text}, the last of which is not complete"
    if _preset(result):  # what its hand reaches takes longer to tell than a status may
        return text
    if what == "poses":
        by = gained(scores_of_poses(result), stations - count)
        return f"{text}, the last by {rounds[-1][0][0]:g} of the first step; the best gained {by:.1%} at most"
    chance = float(chances_in(result).max(initial=0.0))
    known = f"; between them the best may be beaten by {chance:.1%} at most, judged by the slopes beside"
    return text + (known if chance > 0 else "; no station between them is expected to beat the best")


def round_text(added: Sequence[Any]) -> str:
    """What a round adds, in words."""
    if is_case(added[0]):
        return f"{_counted(len(set(added)), 'case')} on a finer mesh"
    if isinstance(added[0], tuple):
        return f"{len(added)} more pose{'s' * (len(added) > 1)} around the best, by {added[0][0]:g} of the first step"
    return f"{_counted(len(added), 'more station')}, at {', '.join(f'{s:g}' for s in added)} mm"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"
