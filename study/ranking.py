"""Which grasps come first: by score, but those that fail in the hand come last."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.objects.gap import IntArray
from softjaw.friction.patch import FloatArray
from softjaw.study.case.reach import FREE, clearest, hand_axes, opened, refused
from softjaw.study.case.result import TIE
from softjaw.study.flags import HARM, LOST, Flag, flags_in
from softjaw.study.grippers import Hand, gripper_file
from softjaw.study.messages import StudyError
from softjaw.study.quantities import DONE, FORCE_RANGE, LEAST_FORCE, LISTED
from softjaw.study.result.interpolation import at_force
from softjaw.study.result.read import half_width, scene_of, stated_error, swept_values, values_of
from softjaw.study.scene.text import scene_table

if TYPE_CHECKING:
    import xarray as xr  # slow to load, and a run needs it at its end only

LARGEST = "the largest solved"
MIN_ROLL_COSINE = math.cos(math.radians(30.0))  # pads rolled by more are another place


def judged(ds: Any) -> IntArray:
    """Flags of all cases, with `Flag.TOO_WEAK` and `Flag.TOO_STRONG` where a case lies outside its safe force range.

    A force is too weak where the grasp does not hold the object with the safety that is asked for, and too strong above
    ``force_high``. Files that derive no such range have their own flags only.
    """
    factor = ds["safety_factor"].sel(model="ccm").values if "force_low" in ds else math.inf
    high = ds["force_high"].values[..., None] if "force_high" in ds else math.inf
    return ds["flags"].values | outside(ds["normal_force"].values, factor, high, safety_of(ds))


def safety_of(ds: Any) -> FloatArray:
    """The safety with which grasps have to hold the object's mass; 1 where nothing is to be held.

    At the points of a sweep ``(..., 1, 1, 1)``.
    """
    if "force_low" not in ds:
        return np.ones(())
    points, alike = ds["flags"].shape[:-3], float(task_keys(ds).get("safety", 1.0))
    if "task.safety" not in swept_values(ds, (0,) * len(points)):
        return np.array(alike)
    each = [swept_values(ds, at)["task.safety"] for at in np.ndindex(*points)]
    return np.reshape(np.array(each, float), (*points, 1, 1, 1) if points else ())


def outside(force: FloatArray, factor: Any, high: Any, safety: FloatArray) -> IntArray:
    """`Flag.TOO_WEAK` where a safety factor is below the one asked for, `Flag.TOO_STRONG` beyond a largest force."""
    weak = factor < safety * (1 - TIE)
    return np.asarray(Flag.TOO_WEAK * weak | Flag.TOO_STRONG * (force > high * (1 + 1e-9)))


def task_keys(ds: Any, section: str = "task") -> dict[str, Any]:
    """Keys of a section of the scene, defaults filled in; nothing where there is no scene."""
    return scene_table(ds.attrs.get("scene", ""), section)


def keys_at(ds: Any, index: Sequence[int] = (), section: str = "task") -> dict[str, Any]:
    """The same at a case, whose point of the sweep may have others."""
    swept = {key.partition(".")[2]: v for key, v in swept_values(ds, index).items() if key.startswith(f"{section}.")}
    return task_keys(ds, section) | swept


def falling(values: np.ndarray) -> np.ndarray:
    """Positions from the largest to the smallest value, NaN last; of values within `TIE` the first comes first.

    >>> falling(np.array([1.0, 3.0, np.nan, 3.0 + 1e-15])).tolist()
    [1, 3, 0, 2]
    """
    return np.argsort(_places(np.asarray(values, float)), kind="stable")


def largest(values: np.ndarray) -> int:
    """Position of the largest value in the flattened array; of values within `TIE` the first.

    >>> largest(np.array([np.nan, 2.0, 2.0 + 1e-15])), largest(-np.array([2.0 + 1e-15, 2.0]))
    (1, 0)
    """
    return int(falling(np.ravel(values))[0])


def nearest(values: np.ndarray, wanted: float) -> int:
    """Position of the value that is nearest to another one; of two that are equally near the first.

    >>> nearest(np.array([0.1, 0.3]), 0.2), nearest(np.array([0.1, 0.3]), 0.21)
    (0, 1)
    """
    return largest(-np.abs(np.asarray(values, float) - wanted))


def _places(values: np.ndarray) -> IntArray:
    """Place of every value in the ranking, counted from 0; those within `TIE` of the next share one."""
    known = np.nan_to_num(values, nan=-np.inf)
    order = np.argsort(-known, kind="stable")
    ranked = known[order]
    # share of the largest value, below which a difference is none
    same = TIE * np.abs(ranked[1:]) + 1e-12 * np.abs(values[np.isfinite(values)]).max(initial=0.0)
    with np.errstate(invalid="ignore"):  # from one that is not there to the next
        apart = ranked[:-1] - ranked[1:] > np.where(np.isfinite(same), same, 0.0)
    places = np.empty(len(order), np.int64)
    places[order] = np.concatenate([[0], np.cumsum(apart)])[: len(order)]
    return places


def ranking(score: np.ndarray, flags: np.ndarray) -> np.ndarray:
    """Positions from the best to the worst: by score, but with the `LOST` ones last; ties as in `falling`.

    >>> ranking(np.array([1.0, 3.0, 2.0]), np.array([0, 1024, 0])).tolist()
    [2, 0, 1]
    """
    lost = (np.nan_to_num(flags).astype(int) & LOST) > 0
    return np.lexsort((_places(np.asarray(score, float)), lost))


def passed_over(score: np.ndarray, flags: np.ndarray) -> tuple[list[int], str]:
    """Positions of the `LOST` grasps that score higher than the best usable one, the highest first, and what they lack.

    >>> passed_over(np.array([1.0, 3.0, 2.0]), np.array([0, 1024, Flag.TOO_STRONG]))
    ([1, 2], 'slips or too strong')
    """
    order = ranking(score, flags)
    if not len(order) or flags[order[0]] & LOST or not np.isfinite(score[order[0]]):
        return [], ""
    better = [int(i) for i in order if flags[i] & LOST and score[i] > score[order[0]] * (1 + 1e-3)]
    marks = int(np.bitwise_or.reduce([int(flags[i]) & LOST for i in better])) if better else 0
    return better, " or ".join(flag.word for flag in flags_in(marks))


class Sure(NamedTuple):
    """Values of some grasps and how far off they may be.

    ``value, error`` (n,) arrays: ``error`` is the stated one; NaN where it is not known. ``changes`` (n, m) array:
    what samples of the uncertain inputs, the same for all grasps, change; a zero where no input is uncertain.
    """

    value: FloatArray
    error: FloatArray
    changes: FloatArray

    @property
    def half_width(self) -> FloatArray:
        """All of it together, ``(n,)``."""
        return np.hypot(self.error, half_width(self.changes))

    @property
    def vague(self) -> NDArray[np.bool_]:
        """Which values are hardly known, ``(n,)``: to no better than a fifth."""
        return ~(self.half_width <= 0.2 * np.abs(self.value))

    def guessed(self) -> Sure:
        """The same, with the fifth for the errors that are not known."""
        return self._replace(error=np.where(np.isnan(self.error), 0.2 * np.abs(self.value), self.error))

    def apart(self, i: int, j: int) -> bool | None:
        """Whether grasp ``i`` is better than ``j`` beyond the errors of their difference; None where not known.

        Inputs move all grasps at once, so it is the difference that has an interval. A difference within `TIE` of the
        values is none, also where nothing is said to be in error.
        """
        error = np.hypot(np.hypot(self.error[i], self.error[j]), half_width(self.changes[i] - self.changes[j]))
        least = TIE * max(abs(self.value[i]), abs(self.value[j]))
        return None if np.isnan(error) else bool(self.value[i] - self.value[j] > error + least)


def sure(ds: xr.Dataset, name: str, k: int) -> Sure | None:
    """A map (CCM) of all candidates at a force level; None where a file knows no error of it."""
    error, samples = stated_error(ds, name), ds.get(f"{name}_samples")
    if error is None:
        return None
    values, of_mesh = values_of(ds, name)[..., k].ravel(), error[..., k].ravel()
    if samples is None:
        return Sure(values, of_mesh, np.zeros((len(values), 1)))
    return Sure(values, of_mesh, samples.values[..., k, :].reshape(len(values), -1) - values[:, None])


def score_of(ds: xr.Dataset, by: str | None = None) -> str:
    """What grasps are ranked by: what is named, else payload; quality or e_n where a file has no value of it.

    Raises `ValueError` for what no grasp has a value of, the least force where the scene names no mass among it.
    """
    if by == LEAST_FORCE:
        if "force_low" not in ds:
            raise ValueError("--by force: the scene names no object.mass_g to hold; expected it, or another order")
        return by
    known = [n for n in (by or "payload", "quality", "e_n") if n in ds and np.isfinite(ds[n].values).any()]
    if by and known and by not in known:
        raise ValueError(f"--by {by}: no grasp has a value of it; name another order")
    return known[0] if known else "e_n"


def rank_values(ds: xr.Dataset, name: str, k: int) -> np.ndarray:
    """What grasps are ranked by at a force level, the largest first; flat over the candidates.

    It is a map (curved model), or the inverse of the least force; grasps that have none come after, by payload.
    """
    if name != LEAST_FORCE:
        return values_of(ds, name)[..., k].ravel()
    force, payload = ds["force_low"].values.ravel(), values_of(ds, "payload")[..., k].ravel()
    return np.where(np.isfinite(force), 1.0 / force, payload - payload[np.isfinite(payload)].max(initial=0.0) - 1.0)


def ranked(ds: xr.Dataset, k: int, by: str | None = None) -> IntArray:
    """The candidates solved at a force level, flat, the best first; see `score_of` and `ranking`.

    Of grasps that their errors cannot tell from the best of them the simpler ones come first, antipodal, without a flag
    and known to a fifth, and then those that surely reach more. Of the `LOST` ones those come first that are safe at
    another force.
    """
    done = np.flatnonzero(ds["status"].values[..., k].ravel() == DONE)
    name = score_of(ds, by)
    score, flags = rank_values(ds, name, k), judged(ds)[..., k].ravel()
    order, errors = done[ranking(score[done], flags[done])], sure(ds, name, k)
    half, vague = np.zeros(len(score)), np.zeros(len(order), bool)
    if errors is not None:
        vague, errors = errors.vague[order], errors.guessed()
        half = errors.half_width
    surely, places, group, head, surest = score - half, _places(score), np.zeros(len(order), np.int64), 0, 0
    for n, i in enumerate(order):
        first, lost = order[head], flags[[order[head], i]] & LOST > 0
        alike = places[i] == places[first]
        if errors is not None and not alike:  # an error of its own that is larger makes no grasp better
            alike = errors.apart(first, i) is False and score[i] > surely[first]
            # nor may one whose own value is hardly known hide that another of its group is surely better
            alike = alike and errors.apart(order[surest], i) is not True
        if not (alike and lost[0] == lost[1]):
            head = surest = n
        elif surely[i] > surely[order[surest]]:
            surest = n
        group[n] = head
    marks = flags[order]
    hopeless = marks & LOST > 0
    if all(name in ds for name in FORCE_RANGE):
        safe = (np.maximum(ds["force_low"].values, least_force(ds)) <= ds["force_high"].values).ravel()[order]
        hopeless &= ~(safe & (marks & LOST & ~(Flag.TOO_WEAK | Flag.TOO_STRONG | Flag.YIELDS) == 0))
    turned = (marks & Flag.NOT_ANTIPODAL > 0) | vague
    return order[np.lexsort((_places(surely)[order], (marks != 0) | vague, turned, group, hopeless))]


# --- distinct places, and the force that is shown ---------------------------------------------------------------------


class Place(NamedTuple):
    """The best grasp of a place, and the others there: neighbours within a distance [m], and images by symmetry."""

    best: int
    near: list[int]
    within: float
    images: list[int]


def distinct(ds: xr.Dataset, order: Sequence[int], score: np.ndarray, k: int, top: int = 0) -> list[Place]:
    """The first ``top`` distinct places (0: all) of a ranking at a force level.

    Grasps are neighbours where both pads touch less than half a pad apart, rolled by at most 30 degrees. Stations and
    angles have images too, which have neighbours of their own: grasps at one station with the same ``score`` and
    opening.
    """
    shape, rest, places = ds.status.shape[:-1], np.asarray(order, int), list[Place]()
    count = int(np.prod(shape))
    index = np.array(np.unravel_index(np.arange(count), shape)).T
    origin, turn = (ds[name].values if name in ds else None for name in ("finger_pose_origin", "finger_pose_rotation"))
    opening = np.nan_to_num(values_of(ds, "opening")[..., k].ravel()) if "opening" in ds else score

    @cache
    def half(*point: int) -> FloatArray:
        """Half the sides of the pads at a point of the sweep [m]."""
        pad = keys_at(ds, point, "gripper")
        return 0.5e-3 * np.array([pad.get(f"pad_{side}_mm", 0.0) for side in ("length", "width", "width")])

    while len(rest) and not 0 < top <= len(places):
        head = rest[0]
        same_point = (index[rest, :-2] == index[head, :-2]).all(axis=1)
        alike = np.all([np.abs(v[rest] - v[head]) <= TIE * abs(v[head]) for v in (score, opening)], axis=0)
        images = same_point & (index[rest, -2] == index[head, -2]) & alike & (not ds.attrs["poses"])
        near, far = np.zeros(len(rest), bool), np.zeros(len(rest))
        if origin is not None and turn is not None:
            x, R = origin[..., k, :, :].reshape(count, 2, 3), turn[..., k, :, :, :].reshape(count, 2, 3, 3)
            # The fingers of two grasps may have changed sides.
            for i, pads in product((head, *rest[images]), (x[rest], x[rest][:, ::-1])):
                rolled = np.abs(R[rest, 0, :, 0] @ R[i, 0, :, 0]) < MIN_ROLL_COSINE
                apart = np.einsum("nfi,fij->nfj", pads - x[i], R[i])
                close = (np.abs(apart) < half(*index[head, :-2])).all(axis=(1, 2)) & same_point & ~rolled
                near, far = near | close, np.where(close, np.linalg.norm(apart, axis=2).max(axis=1), far)
        near[0] = images[0] = False
        near &= ~images
        places.append(Place(int(head), rest[near].tolist(), float(far[near].max(initial=0.0)), rest[images].tolist()))
        rest = rest[1:][~(near | images)[1:]]
    return places


def at_level(ds: Any, force: float | None = None) -> tuple[Any, int, str]:
    """The dataset at a force [N], the number of its level, and in words why it is that one.

    Between two solved forces values are interpolated; without a force it is that of `shown_level`.

    Raises `ValueError` for a force outside of the solved ones.
    """
    forces = ds["normal_force"].values
    if force is None:
        return ds, *shown_level(ds, judged(ds))
    near = np.flatnonzero(np.isclose(forces, force))
    if near.size:
        return ds, int(near[0]), ""
    interpolated = at_force(ds, force)
    low, high = interpolated.attrs["between"]
    return interpolated, 0, f"between solved ones, {low:g} and {high:g} N"


def window(ds: Any) -> float | None:
    """The least force that holds the object and does no harm, where these are between solved ones alone [N].

    None where a solved one does, or no other is known.
    """
    if "force_low" not in ds or ((ds["status"].values == DONE) & (judged(ds) & LOST == 0)).any():
        return None
    low, first = ds["force_low"].values, ds["normal_force"].values[0]
    high = ds["force_high"].values if "force_high" in ds else np.full(low.shape, np.inf)
    for force in map(float, np.sort(low[(low >= first) & (low <= high)])[:LISTED]):
        interpolated = at_force(ds, force)
        if ((interpolated["status"].values == DONE) & (judged(interpolated) & LOST == 0)).any():
            return force
    return None


def shown_level(ds: Any, flags: np.ndarray) -> tuple[int, str]:
    """Number of the force level at which grasps are ranked, and in words why it is that one.

    Where the object's mass is known the lowest at which a grasp holds it and does no harm; else the highest that most
    of the solved candidates reached, that some wall bears, or at which any can be used.

    ``flags``: as `judged` gives them.
    """
    forces, done = ds["normal_force"].values, ds["status"].values == DONE
    solved, borne, usable = ((done & (flags & bad == 0)).reshape(-1, len(forces)) for bad in (0, HARM, LOST))
    if "force_low" in ds and usable.any():
        return int(np.flatnonzero(usable.any(axis=0))[0]), "the lowest solved force at which a grasp holds the object"
    if (flags[done] & HARM).any() and borne.any():
        k = int(np.flatnonzero(borne.any(axis=0))[-1])
        return k, "the highest at which a grasp does no harm" if k < len(forces) - 1 else LARGEST
    # one failed case must not move all grasps to another force, nor a few that went far
    shared = np.flatnonzero(2 * solved.sum(axis=0) > solved.any(axis=1).sum())
    last = np.flatnonzero(solved.any(axis=0))[-1] if solved.any() else len(forces) - 1
    k = int(shared[-1]) if len(shared) else int(last)
    if usable.any() and not usable[:, k].any():  # as where the pads meet beside a small object
        return int(np.flatnonzero(usable.any(axis=0))[-1]), "the highest at which a grasp can be used"
    return k, LARGEST if k == last else "the largest that most candidates were solved at"


# --- the decisions that everything shown rests on --------------------------------------------------------------------


def judge(
    ds: xr.Dataset,
    chosen: tuple[int, ...] | None = None,
    force: float | None = None,
    by: str | None = None,
    top: int = LISTED,
    lines: bool = True,
    hand: Hand | None = None,
) -> xr.Dataset:
    """The dataset at a force [N] with `judged` flags and decisions as attributes.

    ``score``: the map that grasps are ranked by; ``level`` and ``why``: the force level that is shown, and why it is
    that one; ``best``: index of the best case there, or None; ``chosen``: the case that was asked for; ``reach``: of
    the ``top`` places (of grasps where not ``lines``) the direction from which the ``hand`` comes, by default the
    scene's, see `approach_of`. Those that it does not reach are ranked last, and the next ones are looked at.

    Raises `ValueError` for a force outside of the solved ones.
    """
    hand, reach = hand or hand_of(ds), dict(ds.attrs.get("reach", {}))
    about = {"title": ds.attrs.get("title") or Path(ds.attrs.get("file", "")).stem, "chosen": chosen, "reach": reach}
    while True:
        flags = ds["flags"].values.copy()
        flags.reshape(-1, flags.shape[-1])[[c for c, approach in reach.items() if approach == ()]] |= Flag.OUT_OF_REACH
        result, k, why = at_level(ds.assign(flags=(ds.status.dims, flags, ds["flags"].attrs)), force)
        score = score_of(result, by or ds.attrs.get("score"))
        result = result.assign(flags=(ds.status.dims, judged(result), ds["flags"].attrs))
        ranks = places = ranked(result, k, score).tolist()
        if lines and hand:
            places = [place.best for place in distinct(result, ranks, rank_values(result, score, k), k, top)]
        marks = result["flags"].values[..., k].ravel()
        new = [c for c in places[: top or None] if c not in reach and not marks[c] & LOST]
        if not new or hand is None:
            best = index_of(result, ranks[0], k) if ranks else None
            return result.assign_attrs(about, score=score, level=k, why=why, best=best)
        reach |= {c: approach_of(result, c, k, hand) for c in new}


def index_of(ds: xr.Dataset, candidate: int, k: int) -> tuple[int, ...]:
    """Index of a candidate's case at a force level."""
    return (*map(int, np.unravel_index(candidate, ds.status.shape[:-1])), k)


def hand_of(ds: xr.Dataset) -> Hand | None:
    """The hand of the gripper that the scene names; None where it names none, or where its file is not there now."""
    name = task_keys(ds, "gripper").get("preset")
    with suppress(StudyError):
        return gripper_file(name)[1] if name else None
    return None


def least_force(ds: xr.Dataset) -> float:
    """Normal force per finger below which the hand of the scene does not press [N]; 0 without one."""
    hand = hand_of(ds)
    return hand.force_n[0] if hand else 0.0


def approach_of(ds: xr.Dataset, candidate: int, k: int, hand: Hand) -> tuple[float, ...] | None:
    """Direction from which a hand comes to a case; empty where it does not reach it, None where that is not known."""
    index = index_of(ds, candidate, k)
    opening, pad = float(values_of(ds, "opening")[index]), ds["finger_pose_rotation"].values[index][0]
    try:
        scene = scene_of(ds, index)
        wide, _, depth = opened(hand, scene.gripper, opening)
        middle = ds["finger_pose_origin"].values[index].mean(axis=0)
        approach, room = clearest(scene, hand, pad, middle, wide, opening, depth)
    except (ValueError, OSError):  # the object is not there now
        return None
    free = room >= FREE and not refused(hand, scene.gripper, opening, ds["normal_force"].values[k])
    return tuple(hand_axes(pad, approach, "x")[:, 2].tolist()) if free else ()
