"""Antipodal grasps of any triangle surface: sampled, set straight, ranked on a spring foundation, thinned.

From points of the surface the gripper is turned and shifted until both pads meet the object squarely and in their
middles. A bed of springs gives the pressures, and these the payload that ranks the grasps; nothing is solved. What is
wider than the opening, runs into the fingers or slips comes with that state.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np

from softjaw.fem.objects.gap import IntArray
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.friction.patch import FloatArray, NoContactError
from softjaw.study.case.bed import JawsOnSurface, Side, grips, spring_payload
from softjaw.study.case.build import MAX_SLOPE, build_object, has_wall, listed_accuracy, own_frame, surface_triangles
from softjaw.study.case.contact import slips
from softjaw.study.case.fit import Jaws, fit_of, jaws_of
from softjaw.study.case.poses import across, in_file, pad_axes, pose_of
from softjaw.study.case.reach import FREE, opened, rooms, surface_points
from softjaw.study.case.task import Task, task_of
from softjaw.study.grippers import gripper_file
from softjaw.study.messages import USAGE, NoGraspError
from softjaw.study.quantities import COLLIDES, MISSING, SLIPS, STATES, WIDE
from softjaw.study.scene import Scene
from softjaw.study.units import shown_text

SAMPLES = 300  # points of the surface from which grasps are looked for, four times as many where few are found
TURNS = 4  # rounds of setting a grasp straight; most end after two
STRAIGHT = math.radians(0.5)  # tilt between two rounds that ends them
APART, NEAR = 0.5, 0.25  # of the pad's length: grasps that are nearer are at one place; and one, if directions agree
ALIKE, ROLLED = math.radians(20.0), math.radians(30.0)  # the same for approach and roll
SEARCH_STEPS = (0.25, 0.25, 0.12, 0.06)  # of a local search, of the pad's sides; rolls of `ROLLED` go with the first
WORTHWHILE = 0.01  # gain of payload that is worth a step
BETWEEN = 4e-3  # distance of the points of an object that a hand must not meet [m]
EDGE_COST = 0.05  # of a payload, for which a place off the edges of the object is preferred


@dataclass(frozen=True, eq=False)  # one is itself alone: arrays have no hash, and what a hand reaches is kept by it
class SampledGrasp:
    """A grasp as the spring foundation sees it.

    ``point`` (3,) array: middle between both contacts [m]. ``approach, long_side`` (3,) arrays: finger 1's approach and
    the pads' long side. ``opening``: distance of the pads' faces at first touch [m]. ``payload``: what it holds on a
    bed of springs, less where foam is crushed or bears on an edge, for ranking [kg]. ``state``: why it is not worth a
    solve, `WIDE`, `COLLIDES` or `SLIPS`; else `MISSING`, not computed.
    """

    point: FloatArray
    approach: FloatArray
    long_side: FloatArray
    opening: float
    payload: float
    state: int = MISSING


def axes_of(approach: FloatArray, along: FloatArray) -> FloatArray:
    """`pad_axes`; where ``along`` is the approach itself, the long side follows the axis that lies most across it."""
    if np.linalg.norm(along - (along @ approach) * approach) < 1e-6:
        along = np.eye(3)[np.argmin(np.abs(approach))]
    return pad_axes(approach, across(approach, along))


def straightened(surface: tuple[FloatArray, IntArray], grip: JawsOnSurface) -> JawsOnSurface:
    """Turn and shift a gripper until both pads meet the object squarely and in their middles, or a few rounds are over.

    Raises `NoContactError` where the pads pass the object.
    """
    jaws = grip.jaws
    for _ in range(TURNS):
        tilt, shift = grip.tilt, grip.shift
        approach = grip.axes @ tilt
        point = grip.point + grip.axes @ np.array([*shift, grip.depth])
        axes = axes_of(approach / np.linalg.norm(approach), grip.axes[:, 0])
        # shift between two rounds that ends them, of the pad's side
        done = tilt[2] > math.cos(STRAIGHT) and np.abs(shift).max() < 0.01 * jaws.pad[0]
        grip = JawsOnSurface(surface, point, axes, jaws)
        if done:
            break
    return grip


def same_place(grip: JawsOnSurface, other: JawsOnSurface) -> bool:
    """Whether two grips are so near that both would lead to the same grasps."""
    near = np.linalg.norm(grip.point - other.point) < 0.5 * NEAR * grip.jaws.pad[0]
    return bool(near and abs(grip.axes[:, 2] @ other.axes[:, 2]) > math.cos(0.5 * ALIKE))


def long_sides(grip: JawsOnSurface, axis: FloatArray) -> list[FloatArray]:
    """Directions for the pads' long side, in space: the flattest of the surface and the one across it.

    Where the surface curves alike every way, the object's own longest ``axis`` decides.
    """
    H = sum(_curvature(side, flip) for side, flip in zip(grip.sides, (1.0, -1.0), strict=True))
    values, vectors = np.linalg.eigh(H)
    order = np.argsort(np.abs(values))
    small, large = np.abs(values)[order]
    flattest = grip.axes[:, :2] @ vectors[:, order[0]]
    # relative difference of principal curvatures below which the long side follows the object's own axes
    if large - small <= 0.05 * max(large, 1.0 / grip.jaws.pad[0]):
        flattest = axes_of(grip.axes[:, 2], axis)[:, 0]
    return [flattest, np.cross(grip.axes[:, 2], flattest)]


def _curvature(side: Side, flip: float) -> FloatArray:
    """Hessian ``(2, 2)`` of the quadratic that fits the height field under the pressure best [1/m]."""
    loaded = side.pressure > 0.0
    if np.count_nonzero(loaded) < 8:
        return np.zeros((2, 2))
    x, y = side.x[loaded], flip * side.y[loaded]
    A = np.column_stack([np.ones_like(x), x, y, 0.5 * x * x, x * y, 0.5 * y * y])
    w = np.sqrt(side.pressure[loaded])
    a = np.linalg.lstsq(A * w[:, None], side.height[loaded] * w, rcond=None)[0]
    return np.array([[a[3], a[4]], [a[4], a[5]]])


def antipodal_grasps(
    surface: tuple[FloatArray, IntArray],
    jaws: Jaws,
    task: Task,
    count: int,
    samples: int,
    seed: int = 0,
    lids: FloatArray | None = None,
    reached: Callable[[SampledGrasp], bool] = lambda _: True,
) -> list[SampledGrasp]:
    """At most ``count`` distinct grasps of a surface, the best first; then those that are not worth a solve.

    ``surface`` (k, 3) array, (m, 3) int array: points [m] and triangles. ``task``: what they have to hold. ``count``:
    grasps that can be solved. ``samples``: number of points where grasps are looked for. ``seed``: of these points; the
    same seed gives the same grasps on every machine. ``lids`` (n, 3, 3) array, optional: corners of the triangles
    that close holes [m]: no pad is put there if there are other places. ``reached``: whether the hand gets to a grasp
    that can be solved; others are given where there is none.
    """
    surface = np.ascontiguousarray(surface[0]), np.ascontiguousarray(surface[1])
    offered: dict[bool | None, list[SampledGrasp]] = {None: [], False: [], True: []}  # by what `offers` says of them
    for grasp, over in offers(surface, jaws, task, seed, samples, lids):
        offered[over].append(grasp)
    grasps = offered[False]
    if all(grasp.state for grasp in grasps):  # an open box may be held nowhere else
        grasps += offered[True]
    best = [grasp for grasp in thinned(grasps, count, jaws.pad[0], reached) if not grasp.state]
    grasps += [improved(surface, grasp, jaws, task, lids) for grasp in best]
    return thinned(grasps + offered[None], count, jaws.pad[0], reached)


def offers(
    surface: tuple[FloatArray, IntArray], jaws: Jaws, task: Task, seed: int, samples: int, lids: FloatArray | None
) -> Iterator[tuple[SampledGrasp, bool | None]]:
    """Grasps as they are found, and whether a pad is over a hole; None: as aimed, with the state that rejects it."""
    points, triangles = surface
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # twice the area long
    axes = principal_axes(corners, np.linalg.norm(normals, axis=1))
    axis = axes[-1]
    # places that only a pad in their middle meets squarely, such as the bottom of a bowl, are seldom hit at random
    through_centre = [(np.asarray(task.centre_of_mass, float), direction) for direction in axes]
    starts: list[tuple[JawsOnSurface, bool]] = []  # and whether they meet the object squarely
    good = 0

    def aims() -> Iterator[tuple[FloatArray, FloatArray]]:
        yield from [*through_centre, *sampled(corners, normals, samples, seed)]
        if good < samples / 4:  # little of the surface can be gripped: it is looked for with more points
            yield from sampled(corners, normals, 3 * samples, seed + 1)

    for place, normal in aims():
        try:
            aimed = JawsOnSurface(surface, place, axes_of(-normal, axis), jaws)
            if state := state_of(aimed):
                yield SampledGrasp(aimed.point, aimed.axes[:, 2], aimed.axes[:, 0], aimed.opening, 0.0, state), None
            start = straightened(surface, aimed)
            square = start.tilt[2] > math.cos(STRAIGHT)
            # one that is still turning leads elsewhere than one that has come to rest beside it
            if any(same_place(start, other) and (rests or not square) for other, rests in starts):
                continue
            starts.append((start, square))
            for along in long_sides(start, axis):
                turned = JawsOnSurface(surface, start.point, axes_of(start.axes[:, 2], along), jaws)
                grip = straightened(surface, turned)
                grasp = judged(grip, task)
                good += not grasp.state
                yield grasp, lids is not None and grip.over(lids)
        except NoContactError:
            continue


def improved(
    surface: tuple[FloatArray, IntArray], grasp: SampledGrasp, jaws: Jaws, task: Task, lids: FloatArray | None = None
) -> SampledGrasp:
    """The best grasp by payload that shifts of the pads along their sides and rolls lead to from another one.

    A grasp whose pressure is in the middle of the pads may hold less than one nearer to the centre of mass.
    """
    for share in SEARCH_STEPS:
        point, axes = grasp.point, axes_of(grasp.approach, grasp.long_side)
        shifts = [point + sign * share * jaws.pad[k] * axes[:, k] for k in (0, 1) for sign in (1.0, -1.0)]
        rolls = [axes[:, 0] + sign * math.tan(share * ROLLED / SEARCH_STEPS[0]) * axes[:, 1] for sign in (1.0, -1.0)]
        frames = [*((place, axes) for place in shifts), *((point, axes_of(axes[:, 2], roll)) for roll in rolls)]
        for grip in grips(surface, frames, jaws, lids):
            wanted = (1.0 + WORTHWHILE) * grasp.payload
            other = judged(grip, task, wanted)
            if not other.state and other.payload > wanted:
                grasp = replace(other, point=grip.middle)
    return grasp


def sampled(corners: FloatArray, normals: FloatArray, count: int, seed: int) -> list[tuple[FloatArray, FloatArray]]:
    """Points spread evenly over the area of triangles ``corners (m, 3, 3)``, with the normals of their triangles.

    ``normals (m, 3)`` are as long as the triangles are large.
    """
    area = np.linalg.norm(normals, axis=1)
    rng = np.random.default_rng(seed)
    # one point in each of `count` equal shares of the area: fewer gaps than independent points have
    share = (np.arange(count) + rng.random(count)) / count * area.sum()
    chosen = np.minimum(np.searchsorted(np.cumsum(area), share), len(corners) - 1)
    u, v = rng.random((2, count))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = corners[chosen].transpose(1, 0, 2)
    place = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    return list(zip(place, normals[chosen] / area[chosen, None], strict=True))


def principal_axes(corners: FloatArray, area: FloatArray) -> FloatArray:
    """Principal axes ``(3, 3)`` of the area of triangles ``corners (m, 3, 3)``, the last the one of largest extent."""
    off = corners - area @ corners.mean(axis=1) / area.sum()
    three = np.concatenate([off, off.sum(axis=1, keepdims=True)], axis=1)  # corners and their sum tell the integral
    moments = np.einsum("n,nki,nkj->ij", area, three, three)
    # rounded, so that those of a round body are the same on every machine
    axes = np.linalg.eigh(np.round(moments / np.trace(moments), 6))[1].T
    return axes * np.sign(np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1))


def state_of(grip: JawsOnSurface) -> int:
    """Why a grasp is not worth a solve, or `MISSING`."""
    # foam gives way by its thickness at most to what only the rim of a pad meets, between the cells of its face
    felt, most = grip.opening + grip.jaws.pad[2], grip.jaws.max_opening
    state, _ = fit_of(grip.local, grip.triangles, grip.jaws._replace(max_opening=min(felt, most)))
    if state == WIDE and felt < most:
        return COLLIDES
    return int(state or (SLIPS if slips(grip.misalignment[1], grip.jaws.mu) else MISSING))


def judged(grip: JawsOnSurface, task: Task, least: float = 0.0) -> SampledGrasp:
    """State of a grasp on a bed of springs, with its payload there, or one below ``least``."""
    state = state_of(grip)
    share = grip.peak * (1.0 - min(grip.on_edges, EDGE_COST))
    worth = 0.0 if state else share * spring_payload(grip.contacts, task, least / share)
    return SampledGrasp(grip.point, grip.axes[:, 2], grip.axes[:, 0], grip.opening, worth, state)


def thinned(
    grasps: Sequence[SampledGrasp], count: int, length: float, reached: Callable[[SampledGrasp], bool]
) -> list[SampledGrasp]:
    """At most ``count`` distinct grasps that are worth a solve, then as many that are not; by payload each.

    Of the first those that the hand has ``reached``, if there are any. The best one of every place comes before any
    place gets a second one; places are half a pad's ``length`` apart.
    """
    distinct: list[SampledGrasp] = []
    for good in (True, False):
        some = [g for g in grasps if (not g.state) is good]
        best = max((g.payload for g in some), default=0.0)
        # rounded, so that those that are equal but for rounding come in the order in which they were found
        # digits of a payload over the best one, by which grasps are ranked
        ranked = sorted(some, key=lambda g: -round(g.payload / best, 3) if best > 0 else 0.0)
        # share of the best payload, below which a grasp is not proposed
        worth = ranked[: next((n for n, grasp in enumerate(ranked) if grasp.payload < 0.02 * best), len(ranked))]
        chosen = (good and _spread(worth, count, length, reached)) or _spread(worth, count, length)
        distinct += sorted(chosen, key=lambda g: -g.payload)
    return distinct


def _spread(
    ranked: Sequence[SampledGrasp], count: int, length: float, asked: Callable[[SampledGrasp], bool] = lambda _: True
) -> list[SampledGrasp]:
    """At most ``count`` distinct grasps of which ``asked`` is true: of every place the first, then further ones."""
    chosen: list[SampledGrasp] = []
    for alike in (same_point, same_grasp):
        for grasp in ranked:
            if len(chosen) == count:
                return chosen
            if not any(alike(grasp, other, length) for other in chosen) and asked(grasp):
                chosen.append(grasp)
    return chosen


def same_point(grasp: SampledGrasp, other: SampledGrasp, length: float) -> bool:
    """Whether two grasps have their middles at one place."""
    return float(np.linalg.norm(grasp.point - other.point)) < APART * length


def same_grasp(grasp: SampledGrasp, other: SampledGrasp, length: float) -> bool:
    """Whether two grasps are alike in place, approach and roll; the fingers may change places."""
    return (
        float(np.linalg.norm(grasp.point - other.point)) < NEAR * length
        and abs(float(grasp.approach @ other.approach)) > math.cos(ALIKE)
        and abs(float(grasp.long_side @ other.long_side)) > math.cos(ROLLED)
    )


# --- scenes -----------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=8)
def with_sampled_grasps(scene: Scene) -> Scene:
    """The scene with the grasps that its sampler finds as explicit poses; `NoGraspError` where none fits the pads."""
    given, obj = scene.candidates, build_object(scene.object)
    task, surface, by_hand = task_of(scene), surface_triangles(scene.object), reached_by_hand(scene)
    slope = math.sin(MAX_SLOPE) if has_wall(scene.object) else math.inf
    grasps = antipodal_grasps(
        surface, jaws_of(scene), task, given.sampled or 1, SAMPLES, lids=lids_of(obj),
        reached=lambda grasp: abs(grasp.approach[2]) <= slope and by_hand(grasp),
    )  # fmt: skip
    placed = own_frame(scene.object)
    given_as = [(in_file(grasp.point, grasp.approach, grasp.long_side, placed), grasp.state) for grasp in grasps]
    poses = tuple(pose_of(numbers) for numbers, state in given_as if not state)
    if not poses:
        raise _no_grasp(grasps)
    # how many were asked for stays, which tells that they are screened
    where = given.model_copy(update={"poses": poses})
    where._rejected = tuple((*numbers, state) for numbers, state in given_as if state)
    return scene.model_copy(update={"candidates": where, "accuracy": listed_accuracy(scene)})


def reached_by_hand(scene: Scene) -> Callable[[SampledGrasp], bool]:
    """Whether the hand of the scene's gripper gets to a grasp; of a gripper without a name nothing is known."""
    if scene.gripper.preset is None:
        return lambda _: True
    hand, placed, size = gripper_file(scene.gripper.preset)[1], own_frame(scene.object), scene.gripper.pad_size
    points = surface_points(scene.object, BETWEEN)

    @cache
    def reached(grasp: SampledGrasp) -> bool:
        axes = placed.rotation @ axes_of(grasp.approach, grasp.long_side)
        wide, most, depth = opened(hand, scene.gripper, grasp.opening)
        room = rooms(points, hand, axes, placed.to_object(grasp.point), size, wide, grasp.opening, depth)
        return grasp.opening <= most and max(room.values()) > FREE

    return reached


def check_sampler(scene: Scene) -> None:
    """Refuse a scene of which `with_sampled_grasps` would find no grasp; it ends with the first one."""
    obj, rejected = build_object(scene.object), list[SampledGrasp]()
    surface, task = surface_triangles(scene.object), task_of(scene)
    for grasp, _ in offers(surface, jaws_of(scene), task, 0, SAMPLES, lids_of(obj)):
        if not grasp.state:
            return
        rejected.append(grasp)
    raise _no_grasp(rejected)


def _no_grasp(rejected: Sequence[SampledGrasp]) -> NoGraspError:
    states = [STATES[state] for state in sorted({grasp.state for grasp in rejected})] or ["the pads miss the object"]
    width = ""
    if rejected:
        width = f"; the narrowest needs an opening of {shown_text(min(g.opening for g in rejected), 'm', 3)}"
    text = f"candidates.sampled: found no grasp between the pads ({', '.join(states)}{width}); expected one: give"
    return NoGraspError(USAGE, f"{text} poses, another pad, or a larger gripper.max_opening_mm")


def lids_of(obj: Any) -> FloatArray | None:
    """Corners ``(n, 3, 3)`` of the triangles that close holes of a mesh [m]; None for other objects."""
    return obj.lids if isinstance(obj, MeshObject) else None
