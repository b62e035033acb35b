"""What is filled once, after all cases: axes of curvature studies, safe force ranges, intervals.

The safe force range of a candidate is enough to hold the object's weight, and not so much that its wall is damaged.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softjaw.friction.patch import FloatArray
from softjaw.study.case.build import geometry
from softjaw.study.case.candidates import axes
from softjaw.study.case.result import UNDECIDED
from softjaw.study.quantities import FORCE_RANGE, Quantity
from softjaw.study.scene import Scene

LOW, HIGH = FORCE_RANGE
LOW_ERROR, HIGH_ERROR = f"{LOW}_error", f"{HIGH}_error"
# maps that they follow from, of the curved model
SOURCES = ("safety_factor", "payload_error", "indentation", "indentation_error", "wall_stress", "wall_stress_error")

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
                     " solved forces and 0 by straight lines. NaN: none of them holds it.", "derived"),
            Quantity(LOW_ERROR, over, "N", "error of the force to use",
                     "What the stated error of the payload and the bend of safety_factor over the solved forces may "
                     "move it; NaN where fewer than two of them are solved up to it.", "derived"),
        ]  # fmt: skip
    if getattr(scene.object, "wall", None) is not None:
        listed += [
            Quantity(HIGH, over, "N", "largest force that the wall bears",
                     "Normal force per finger at which indentation passes object.allowed_dent_mm or stress the yield"
                     " strength, as force_low; else the largest solved force. NaN: wall taken as rigid.", "derived"),
            Quantity(HIGH_ERROR, over, "N", "error of the largest force that the wall bears",
                     "How much less it is where indentation and stress are larger by their stated errors.", "derived"),
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
    if scene.object.mass is not None:
        factor, stated = values["safety_factor"], values.get("payload_error", 0.0)
        ranges[LOW] = first_crossing(forces, factor, scene.task.safety)
        ranges[LOW_ERROR] = crossing_error(forces, factor, scene.task.safety, stated)
    if getattr(scene.object, "wall", None) is not None:
        dent: float | None = getattr(scene.object, "allowed_dent", None)
        limits = {"indentation": dent, "wall_stress": geometry().material_of(scene.object).yield_strength}
        known = np.isfinite(values["indentation"])
        solved = np.where(known.any(axis=-1) & ended, np.where(known, forces, 0.0).max(axis=-1), np.nan)

        def largest(share: float) -> FloatArray:
            """With values that are larger by a share of their errors."""
            larger = {n: values[n] * (1.0 + share * np.nan_to_num(values.get(f"{n}_error", 0.0))) for n in limits}
            crossings = [first_crossing(forces, larger[n], most) for n, most in limits.items() if most is not None]
            # fmin, not minimum: a limit that is never passed is NaN and bounds nothing.
            return np.fmin.reduce([solved, *crossings])

        ranges[HIGH] = largest(0.0)
        ranges[HIGH_ERROR] = ranges[HIGH] - largest(1.0)
    return ranges


def crossing_error(forces: ArrayLike, values: ArrayLike, limit: float, stated: ArrayLike = 0.0) -> FloatArray:
    """Error of `first_crossing` [N]: that of a straight line in a curve that bends as much as the values beside it do.

    The errors of the values, ``stated (..., k)`` as shares, move the crossing, too: by their share of the limit over
    the slope; the larger of those beside the crossing counts. NaN where no three values lie about the crossing, the one
    at no force counted.

    >>> crossing_error([1.0, 2.0], [[1.0, 4.0]], 2.5).round(3).tolist()  # x^2, which passes at 1.581 and not at 1.5
    [0.083]
    >>> crossing_error([1.0, 2.0], [[1.0, 4.0]], 2.5, [[0.02, 0.03]]).round(3).tolist()  # 3 % of 2.5 over 3
    [0.108]
    """
    x, y = _from_nothing(forces, values)
    at = first_crossing(forces, values, limit)
    if len(x) < 3:
        return np.full(at.shape, np.nan)
    step = np.diff(x)
    slope = np.diff(y, axis=-1) / step
    bend = np.abs(2 * np.diff(slope, axis=-1) / (step[1:] + step[:-1]))  # of every node but the first and the last
    k = np.clip(np.searchsorted(x, at) - 1, 0, len(step) - 1)[..., None]  # interval of the crossing

    def at_ends(parts: FloatArray) -> list[FloatArray]:
        """What there is at both ends of the interval: at no force there is neither a bend nor an error."""
        return [np.take_along_axis(parts, np.clip(k + i, 0, parts.shape[-1] - 1), -1)[..., 0] for i in (-1, 0)]

    ends, shares = at_ends(bend), at_ends(np.broadcast_to(stated, np.shape(values)))
    rise, k = np.take_along_axis(slope, k, -1)[..., 0], k[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((np.fmax(*ends) / 2 * (at - x[k]) * (x[k + 1] - at) + np.fmax(*shares) * limit) / rise)


def _from_nothing(forces: ArrayLike, values: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Forces and values with those at no force before them."""
    return np.append(0.0, np.asarray(forces, float)), np.insert(np.asarray(values, float), 0, 0.0, axis=-1)


def first_crossing(forces: ArrayLike, values: ArrayLike, limit: float) -> FloatArray:
    """Force at which values ``(..., k)`` first pass a limit, by straight lines from 0 at no force; NaN for never.

    A solved value within `UNDECIDED` of the limit has passed it; what comes after a NaN is not used.

    >>> first_crossing([1.0, 2.0], [[0.5, 1.5], [0.5, 0.9]], 1.0).tolist()
    [1.5, nan]
    """
    x, y = _from_nothing(forces, values)
    # Nothing beyond the first gap is used: the true crossing may lie inside it.
    above = np.cumprod(np.isfinite(y), axis=-1).astype(bool) & (y >= limit * (1.0 - UNDECIDED))
    k = np.maximum(above.argmax(axis=-1), 1)[..., None]
    low, high = np.take_along_axis(y, k - 1, -1)[..., 0], np.take_along_axis(y, k, -1)[..., 0]
    # Equal neighbours would divide by 0; the clip then gives an end of their interval.
    share = np.clip((limit - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    crossing = x[k[..., 0] - 1] + share * (x[k[..., 0]] - x[k[..., 0] - 1])
    return np.where(above.any(axis=-1), crossing, np.nan)
