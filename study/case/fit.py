"""Whether a gripper fits round an object where a candidate stands, from the object's triangles alone.

A gripper closes along a line, so both pads meet the object's extremes along it over their faces, and what carries a pad
runs into whatever reaches past its back. Triangles have their extremes over a rectangle at corners, at its sides and
at its own corners: these are exact, with no grid to fall through.
"""

import math
from typing import NamedTuple

import numpy as np

from softjaw.fem.objects.gap import IntArray
from softjaw.friction.patch import FloatArray
from softjaw.study.quantities import COLLIDES, MISSING, WIDE
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import Gripper
from softjaw.study.units import shown_text

DIGITS = 4  # of lengths in messages


class Jaws(NamedTuple):
    """What a grasp is looked for with: lengths [m], stiffness of the springs [Pa/m], normal force [N]."""

    pad: tuple[float, float, float]
    stiffness: float
    mu: float
    force: float
    max_opening: float = math.inf
    finger: tuple[float, float] | None = None  # length and width of what carries the pad; None: as the pad


def extremes(points: FloatArray, triangles: IntArray, sides: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest z of triangles over a rectangle about the origin; infinite where there are none.

    ``points (k, 3)`` [m], ``triangles (m, 3)``; ``sides``: length and width of the rectangle, along x and y [m].
    """
    from softjaw.fem.objects.triangles import lowest_and_highest  # compiled: most scenes are checked without

    low, high = lowest_and_highest(
        np.ascontiguousarray(points), np.ascontiguousarray(triangles), 0.5 * sides[0], 0.5 * sides[1]
    )
    return float(low), float(high)


def fit_of(points: FloatArray, triangles: IntArray, jaws: Jaws, doubt: float = 0.0) -> tuple[int, str]:
    """Whether a gripper fits round triangles in its own frame: z along finger 1's approach, x along the long side.

    `WIDE` or `COLLIDES` and why; `MISSING`, not computed, where it fits or is nearer to a limit than ``doubt`` [m].
    ``points, triangles``: as for `extremes`.
    """
    low, high = extremes(points, triangles, jaws.pad[:2])
    opening = high - low
    if opening > jaws.max_opening + doubt:
        needed, allowed = (shown_text(v, "m", DIGITS) for v in (opening, jaws.max_opening))
        return WIDE, f"needs an opening of {needed}, the gripper opens to {allowed}"
    if jaws.finger is None or not math.isfinite(opening):
        return MISSING, ""
    nearest, farthest = extremes(points, triangles, jaws.finger)
    # how far the object reaches back beside each pad, from the pad's face
    reach = {"finger 1": low - nearest, "finger 2": farthest - high}
    hit = {name: far for name, far in reach.items() if far > jaws.pad[2] + doubt}
    if not hit:
        return MISSING, ""
    far = " and ".join(f"{shown_text(v, 'm', DIGITS)} beside that of {name}" for name, v in hit.items())
    thick, size = shown_text(jaws.pad[2], "m", DIGITS), " x ".join(shown_text(v, "m", DIGITS) for v in jaws.finger)
    text = f"the object reaches past the pad's face, {far}; the finger, {size}, begins {thick} behind it"
    return COLLIDES, text


def stiffness(gripper: Gripper) -> float:
    """Modulus of confined compression over the pad's thickness [Pa/m]."""
    nu = gripper.foam_ratio
    return 2.0 * gripper.shear_modulus * (1.0 - nu) / (1.0 - 2.0 * nu) / gripper.pad_thickness


def bed_closing(height: FloatArray, wanted: float) -> float:
    """Closing at which springs that touch at ``height`` (infinite: never) are shortened by ``wanted`` in all [m]."""
    h = np.sort(height[np.isfinite(height)])
    # for the k lowest springs in contact the closing is known; the largest k that touches is right
    closing = (wanted + np.cumsum(h)) / np.arange(1, len(h) + 1)
    return float(closing[np.flatnonzero(closing >= h)[-1]])


def jaws_of(scene: Scene) -> Jaws:
    """The gripper of a scene at the force in the middle of its load path."""
    gripper, forces = scene.gripper, scene.load.normal_force
    opening = math.inf if gripper.max_opening is None else gripper.max_opening
    middle = forces[len(forces) // 2]
    return Jaws(gripper.pad_size, stiffness(gripper), scene.friction.mu, middle, opening, gripper.finger_size)


def doubt(points: FloatArray) -> float:
    """By how much triangles with these points ``(k, 3)`` may be off the surface that is solved with [m]."""
    # share of the object's size, by which its triangles may be off the surface that is solved with
    return 1e-3 * float(np.linalg.norm(np.ptp(points, axis=0)))
