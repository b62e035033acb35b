"""What is filled once, after all cases: axes of curvature studies, safe force ranges, intervals.

The safe force range of a candidate is enough to hold the object's weight, and not so much that its wall is damaged.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.friction.patch import FloatArray
from softjaw.study.case.build import geometry
from softjaw.study.case.candidates import axes
from softjaw.study.case.result import UNDECIDED
from softjaw.study.flags import Flag
from softjaw.study.quantities import FORCE_RANGE, Quantity
from softjaw.study.result.interpolation import BESIDE_CASES, law_claims, plain
from softjaw.study.scene import Scene

LOW, HIGH = FORCE_RANGE
LOW_ERROR, HIGH_ERROR = f"{LOW}_error", f"{HIGH}_error"
# maps that they follow from, of the curved model
SOURCES = (
    "safety_factor", "payload_error", "indentation", "indentation_error", "wall_stress", "wall_stress_error", "flags",
)  # fmt: skip

# on which they depend besides
LIMITS = {"task.safety", "object.allowed_dent_mm", "object.yield_strength_mpa", "object.wall_material"}
SWEPT = {"object.semi_axis_a_mm", "object.semi_axis_b_mm"}  # give the axes that curvature studies are drawn over


def derived(scene: Scene) -> list[Quantity]:
    """Everything that is derived for a scene: axes of curvature studies, force to use, largest force of the wall."""
    # Curvature belongs to the object alone: station, angle and normal force are left out.
    names = tuple(axis.name for axis in axes(scene))
    over, listed = names[:-1], []
    if scene.object.shape == "elliptic_cylinder" and SWEPT & set(scene.sweep):
        listed += [
            Quantity("b_over_a", names[:-3], "", "b / a",
                     "Semi-axis across the contact over that along its normal.", "derived"),
            Quantity("apex_curvature", names[:-3], "1/m", "apex curvature a / b^2",
                     "Curvature of the section where pads at angle 0 touch.", "derived"),
        ]  # fmt: skip
    if scene.object.mass is not None:
        listed += [
            Quantity(LOW, over, "N", "force to use",
                     "Smallest normal force per finger at which safety_factor (CCM) passes task.safety, between the"
                     " solved forces and below them by power laws. NaN: none holds it, or one below is not solved.",
                     "derived"),
            Quantity(LOW_ERROR, over, "N", "error of the force to use",
                     "What the stated error of the payload and the interpolation of safety_factor may move it; NaN"
                     " where no two forces are solved, or the payload's error is not known.", "derived"),
        ]  # fmt: skip
    if getattr(scene.object, "wall", None) is not None:
        listed += [
            Quantity(HIGH, over, "N", "largest force that the wall bears",
                     "Normal force per finger at which indentation passes object.allowed_dent_mm or stress the yield"
                     " strength, as force_low; else the largest solved force. Forces without a result are bridged"
                     " between solved ones. NaN: wall taken as rigid.", "derived"),
            Quantity(HIGH_ERROR, over, "N", "error of the largest force that the wall bears",
                     "What their stated errors and the interpolation may move it, to less.", "derived"),
        ]  # fmt: skip
    return listed


def finalise(writer: Any, scene: Scene) -> None:
    """Fill it, by one rank, after all cases."""
    if any(q.name == "b_over_a" for q in derived(scene)):
        points = [scene.at(values).object for values in scene.points]
        shape = writer.layout.shape[:-3]
        a, b = (np.reshape([getattr(p, name) for p in points], shape) for name in ("semi_axis_a", "semi_axis_b"))
        writer.write_derived("b_over_a", b / a)
        writer.write_derived("apex_curvature", a / b**2)
    maps = {q.name: q for q in writer.layout.quantities if q.name in SOURCES}
    values = {name: writer.read(f"{q.key}/ccm" if q.by_model else q.key) for name, q in maps.items()}
    for name, value in force_ranges(scene, values).items():
        writer.write_derived(name, value)


def force_ranges(scene: Scene, values: Mapping[str, FloatArray], ended: ArrayLike = True) -> dict[str, FloatArray]:
    """Safe force ranges of the candidates and their errors, from maps by name, of which NaN are not solved.

    ``ended``: which candidates have no case that is still to come, beyond which nothing is known of the others.
    """
    forces, ranges = np.asarray(scene.load.normal_force), dict[str, FloatArray]()
    swept = {*scene.sweep, *scene.uncertainty.spread}
    snapped = np.nan_to_num(values.get("flags", 0.0)).astype(np.int64) & Flag.SNAPPED > 0
    points = [scene.at(point) for point in scene.points] if swept & LIMITS else [scene]

    def at_points(limit: Callable[[Scene], float | None]) -> FloatArray:
        """A limit at the points of the sweep, as maps have them but for the force; infinite where there is none."""
        each = np.array([math.inf if (value := limit(point)) is None else value for point in points])
        return each.reshape(*next(iter(values.values())).shape[:-3], 1, 1) if len(points) > 1 else each[0]

    if scene.object.mass is not None:
        safety, stated = at_points(lambda point: point.task.safety), values.get("payload_error", np.nan)
        ranges[LOW], ranges[LOW_ERROR] = crossing(forces, values["safety_factor"], safety, stated, snapped)
    if getattr(scene.object, "wall", None) is not None:
        limits = {
            "indentation": at_points(lambda point: getattr(point.object, "allowed_dent", None)),
            "wall_stress": at_points(lambda point: geometry().material_of(point.object).yield_strength),
        }
        known = np.isfinite(values["indentation"])
        solved = np.where(known.any(axis=-1) & ended, np.where(known, forces, 0.0).max(axis=-1), np.nan)
        shares = {name: values.get(f"{name}_error", np.nan) for name in limits}
        without_holes = {name: np.apply_along_axis(_without_holes, -1, values[name], forces) for name in limits}
        snapped = np.apply_along_axis(_without_holes, -1, np.where(known, snapped, np.nan), forces) > 0.0
        bounds = [crossing(forces, without_holes[name], most, shares[name], snapped) for name, most in limits.items()]
        larger = {name: without_holes[name] * (1.0 + np.nan_to_num(share)) for name, share in shares.items()}
        # fmin, not minimum: a limit that is never passed is NaN and bounds nothing.
        high = ranges[HIGH] = np.fmin.reduce([solved, *(at for at, _ in bounds)])
        least = np.fmin.reduce([solved, *(crossing(forces, larger[name], most)[0] for name, most in limits.items())])
        off = np.maximum.reduce([high - least, *(np.where(at == high, error, 0.0) for at, error in bounds)])
        ranges[HIGH_ERROR] = off if any(f"{name}_error" in values for name in limits) else np.full(off.shape, np.nan)
    return ranges


def _without_holes(values: FloatArray, forces: FloatArray) -> FloatArray:
    """Values ``(k,)`` up to the last that is known: a wall that is harmed there may be so at a force without a result.

    >>> _without_holes(np.array([np.nan, 2.0, np.nan, 4.0, np.nan]), np.arange(5.0)).tolist()
    [2.0, 2.0, 3.0, 4.0, nan]
    """
    known = np.isfinite(values)
    return np.interp(forces, forces[known], values[known], right=np.nan) if known.any() else values


def crossing(
    forces: ArrayLike, values: ArrayLike, limit: ArrayLike, stated: ArrayLike = np.nan, snapped: ArrayLike = False
) -> tuple[FloatArray, FloatArray]:
    """Force at which values ``(..., k)`` first pass a ``limit (...)`` [N], NaN for never, and the error of that.

    Between solved forces by power laws, as look-ups interpolate, below the first by the law of the first two. A solved
    value within `UNDECIDED` of the limit has passed it; what comes after a NaN is not used. The error is that of a
    look-up there, from what the values ``stated (..., k)`` as shares, and how far a straight line leads elsewhere;
    below the first force half of that or how far one from 0 leads, whatever is more, and what another exponent makes of
    it, that of the next two forces or one that differs by a tenth. Between the last force before a wall has ``snapped
    (..., k)``, or 0, and the first after it the error reaches to both. NaN where no two forces tell a law.

    >>> [v.round(3).tolist() for v in crossing([1.0, 2.0], [[0.5, 2.0], [0.5, 0.9]], 1.0, 0.1)]
    [[1.414, nan], [0.342, nan]]
    >>> [v.round(3).tolist() for v in crossing([1.0, 2.0, 4.0], [1.0, 2.0, 8.0], 0.5, 0.0)]  # linear, then quadratic
    [0.5, 0.347]
    """
    x, y, limit = (np.asarray(v, float) for v in (forces, values, limit))
    passed = np.cumprod(np.isfinite(y), axis=-1).astype(bool) & (y >= limit[..., None] * (1.0 - UNDECIDED))
    k = passed.argmax(axis=-1)
    if len(x) < 2:  # proportional to the force, as far as one tells
        at = np.asarray(np.minimum(x[0] * limit / np.where(passed[..., 0], y[..., 0], np.nan), x[0]))
        return at, np.full(at.shape, np.nan)

    def taken(parts: ArrayLike, i: NDArray[np.int64]) -> FloatArray:
        return np.asarray(np.take_along_axis(np.broadcast_to(parts, y.shape), i[..., None], -1)[..., 0], float)

    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.diff(np.log(np.where(y > 0.0, y, np.nan))) / np.diff(np.log(x))
        # exponents of contacts that begin from nothing
        first = np.clip(np.nan_to_num(slopes[..., :1], nan=1.0), 0.5, 2.0)
        exponent = taken(np.concatenate([first, slopes], axis=-1), k)
        law = x[k] * (limit / taken(y, k)) ** (1.0 / exponent)
        above = np.maximum(k, 1)  # of the two forces about the crossing; below the first one of the first two
        below, low = above - 1, taken(y, above - 1)
        line = x[below] + (limit - low) / (taken(y, above) - low) * (x[above] - x[below])
        nothing = (k > 0) & (low <= 0.0)  # a straight line from a force at which there is none
        at = np.where(passed.any(axis=-1), np.minimum(np.where(nothing, line, law), x[k]), np.nan)
        share = np.clip(np.log(at / x[below]) / np.log(x[above] / x[below]), 0.0, 1.0)
        claims = law_claims(y, plain("force", "N", x), np.zeros(y.shape, bool))
        of_law = BESIDE_CASES * taken(claims, below) * share * (1.0 - share)
        ends = taken(stated, below), taken(stated, k)
        error = np.hypot(of_law, np.where(share < 1.0, (1.0 - share) * ends[0] + share * ends[1], ends[1]))
        # payloads that torques limit change their exponent by as much
        changes = np.fmax(np.abs(np.diff(slopes[..., :2])).max(axis=-1, initial=0.0), 0.1)
        changes = np.fmax(changes, np.abs(slopes[..., 0] - first[..., 0]))
        error += np.where(k > 0, 0.0, np.log(x[0] / at) * changes)
        away = np.abs(np.clip(line, 0.0, x[k]) - at)
        away = np.where(k > 0, away, np.fmax(0.5 * away, np.abs(x[k] * limit / taken(y, k) - at)))
        snaps = taken(np.diff(np.broadcast_to(snapped, y.shape), axis=-1, prepend=False), k) > 0.0
        reach = np.fmax(at - np.where(k > 0, x[below], 0.0), x[k] - at)
        error = np.where(nothing | snaps, reach, at * error / exponent + away)
    return at, np.where(np.isfinite(y[..., 1]) | (k > 0), error, np.nan)
