"""Which cases of sampled grasps the finer meshes get, in rounds, by stored numbers alone.

All candidates are solved on the coarse mesh first. The scene's mesh goes to the places that a list of the best grasps
has at the force that is shown, then to those that may still be better within their errors, also if the coarse mesh says
that they slip: where few elements bear beside an edge it may tilt the contact normal. Those that may be the best, and
whose payload is not known to ``accuracy.target``, then are solved once more, on up to two finer meshes. Each case is
named at most twice, so the rounds end.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.case.result import surely_below
from softjaw.study.flags import LOST
from softjaw.study.quantities import LISTED
from softjaw.study.ranking import Place, at_level, distinct, judged, rank_values, ranked, sure
from softjaw.study.result.read import dataset
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]
Case = tuple[int, int, int]  # numbers of the point of a sweep, of the candidate and of the force


def next_cases(result: Any, scene: Scene) -> tuple[Case, ...]:
    """Cases of the next round; none where the best are known as well as the scene asks for."""
    if not scene.candidates.sampled or "work/mesh" not in {q.key for q in result.layout.quantities}:
        return ()
    ds, k, _ = at_level(dataset(result))
    order, known = [int(i) for i in ranked(ds, k, "payload")], sure(ds, "payload", k)
    if known is None or not order:
        return ()
    named, shape = result.layout.finer, ds.status.shape
    times = np.array([named[case_of(i, k, shape)] for i in range(len(known.value))])
    flags = judged(ds)[..., k].ravel()
    lost = [i for i in order if flags[i] & LOST][:LISTED]
    order = [i for i in order if not flags[i] & LOST and np.isfinite(known.value[i])]
    places = distinct(ds, order, rank_values(ds, "payload", k), k)
    error = np.nan_to_num(known.error, nan=np.inf)
    chosen = [place.best for place in places[:LISTED] if not times[place.best]]
    chosen = chosen or [i for i in rivals(places, known.value, error, lost) if not times[i]][:LISTED]
    if not chosen:
        relative = error / np.maximum(known.value, np.finfo(float).tiny)
        target, most = scene.accuracy.target, max((known.value[i] - error[i] for i in order), default=-np.inf)
        near = [i for i in order if times[i] == 1 and known.value[i] + error[i] > most]
        chosen = [i for i in near if not (target and surely_below(relative[i], target))]
    # The least force that holds a mass lies between this force and the one below.
    levels = (k - 1, k) if k and "safety_factor" in ds else (k,)
    return tuple(sorted({case_of(i, level, shape) for i in chosen for level in levels}))


def rivals(
    places: Iterable[Place], value: FloatArray, error: FloatArray, lost: Iterable[int] = (), count: int = LISTED
) -> list[int]:
    """Grasps that within the errors may be among the best ``count`` places, or be the best of one; the best first.

    Of those that do not hold, ``lost``, the ones that may hold more than every place surely does.

    >>> places = [Place(0, [1], 0.0, []), Place(2, [], 0.0, []), Place(3, [], 0.0, [])]
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
