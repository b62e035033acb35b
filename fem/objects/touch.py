"""Where a pad that moves along its approach meets the object first."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from softjaw.fem.objects.gap import GapFunction
from softjaw.fem.objects.pose import FloatArray, Pose

CREEP = 1e-4  # smallest step of a trace in units of the reach: a point that grazes the surface still gets past
SHARPNESS = 1e-12  # how well the touch is located [m]
GRAZE = 1e-9  # depth that a point has to reach to have met the object [m]: less is a pad that may as well pass it


class NoContactError(ValueError):
    """The pad does not meet the object on its way."""


def first_touch(obj: GapFunction, pose: Pose, points: FloatArray, reach: float) -> float:
    """Distance [m] that the pad travels along its approach until the first of its points meets the object.

    Sphere tracing: a point may move by its signed distance without crossing the surface. All points are traced at once
    and those that are already further than the first hit are given up; each hit is then located by bisection.

    Parameters
    ----------
    obj : GapFunction
        Object; its gap must be a signed distance.
    pose : Pose
        The pad's frame before the approach.
    points : (n, 3) array
        Points of the pad's front face in the pad's frame [m].
    reach : float
        Distance to give up at [m].

    Raises
    ------
    NoContactError
        If no point meets the object within ``reach``, or only grazes it, or the pad starts inside the object.
    """
    reach += GRAZE  # what is met just at the end of the reach is met
    start, approach = pose.to_object(points), pose.rotation[:, 2]

    def gap(which: np.ndarray, t: FloatArray) -> FloatArray:
        return obj.gap(start[which] + t[:, None] * approach)[0]

    active = np.arange(len(points))
    t = np.zeros(len(points))
    g = gap(active, t)
    if g.min() < -GRAZE:
        raise NoContactError(
            f"the pad starts {-g.min() * 1e3:.3g} mm inside the object; start it further out against its approach"
        )
    closest, first, grazed = g.min(), np.inf, False
    while len(active):
        low = t
        t = t + np.maximum(g, CREEP * reach)
        g = gap(active, t)
        closest = min(closest, g.min())
        grazed |= bool((g[t < reach] < GRAZE).any())
        hit = g <= -GRAZE
        if hit.any():
            first = min(first, _bisected(lambda s, which=active[hit]: gap(which, s), low[hit], t[hit]).min())
        keep = ~hit & (t < min(first, reach))
        active, t, g = active[keep], t[keep], g[keep]
    if np.isinf(first) and grazed:
        raise NoContactError(
            f"the pad only grazes the object on its way along the approach ({_vector(approach)}) from "
            f"({_vector(pose.origin)}) m: whether it touches hangs on rounding; move the station or the pose"
        )
    if first > reach:
        raise NoContactError(
            f"the pad passes the object: within {reach * 1e3:.4g} mm along the approach ({_vector(approach)}) from "
            f"({_vector(pose.origin)}) m no point of its face comes closer than {closest * 1e3:.3g} mm; check station, "
            "angle and the object's size and unit"
        )
    return float(first)


def _bisected(gap: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
    """Places of the sign changes between ``low`` (outside) and ``high`` (inside), ``(k,)``."""
    while (high - low).max() > SHARPNESS and ((middle := 0.5 * (low + high)) != low).any():
        inside = gap(middle) <= 0
        low, high = np.where(inside, low, middle), np.where(inside, middle, high)
    return high


def _vector(v: FloatArray) -> str:
    """Three numbers for a message."""
    return ", ".join(f"{x:.4g}" for x in v + 0.0)
