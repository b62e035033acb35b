"""From which side a hand comes to a grasp: where its palm and fingers, as boxes, leave the object free.

The object is points of its surface. Boxes are two corners in the gripper's frame (`study.export.selection`): the palm,
both fingers and the foam on them, as wide open as before the grasp, and prolonged against the approach by the way that
the hand comes. The distance of a point from a box is exact: the clearance is known to the spacing of the points.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from softjaw.friction.patch import FloatArray
from softjaw.study.case.build import own_frame, surface_triangles
from softjaw.study.case.result import TIE
from softjaw.study.grippers import APPROACHES, Hand
from softjaw.study.units import shown_text

OPENED_MORE = 0.02  # the fingers open beyond first touch before a grasp [m]
WAY = 0.1  # of approach and retreat [m]
FREE = 1e-3  # clearance [m] from which a hand and an object are apart, of points that are 2 mm apart
SPACING = 2e-3  # of points on a surface [m]
MOST_SPACINGS = 200.0  # along the object's diagonal; larger objects get points that are further apart
FINGER_THICKNESS = 0.01  # of a hand that does not say it [m]
FROM_ABOVE = np.cos(np.radians(45.0))  # between the approach and the weight


@lru_cache(maxsize=8)
def surface_points(shape: Any, spacing: float = SPACING) -> FloatArray:
    """Points ``(n, 3)`` [m] on an object's surface, no further apart than ``spacing``, in the frame of its own file."""
    from trimesh.remesh import subdivide_to_size  # slow to load

    points, triangles = surface_triangles(shape)
    points = own_frame(shape).to_object(np.asarray(points, float))
    size = max(spacing, float(np.linalg.norm(np.ptp(points, axis=0))) / MOST_SPACINGS)
    finer = subdivide_to_size(points, np.asarray(triangles), size, max_iter=20)[0]
    return np.unique(np.round(finer, 7), axis=0)


def boxes(hand: Hand, pad: FloatArray, opening: float, depth: float) -> FloatArray:
    """Corners ``(k, 2, 3)`` [m] of palm, fingers and foam in the hand's frame, prolonged by `WAY` against z.

    ``pad (3,)`` are the pad's extents along the approach and across both axes, and its thickness [m], ``opening`` is
    the distance of the faces of the foam, and ``depth`` the pads' distance from the frame.
    """
    width, thickness = (pad[1], FINGER_THICKNESS) if hand.finger_mm is None else np.array(hand.finger_mm) / 1e3
    tip, root = depth + pad[0] / 2, depth - pad[0] / 2
    bare = opening / 2 + pad[2]
    foam = opening / 2, bare, pad[1], root
    finger = bare, bare + thickness, max(width, pad[1]), min(0.0, root)
    made = []
    for (low, high, wide, start), sign in product((foam, finger), (-1.0, 1.0)):
        box = np.sort([[sign * low, -wide / 2, start - WAY], [sign * high, wide / 2, tip]], axis=0)
        made.append(box if hand.closing == "x" else box[:, [1, 0, 2]])
    if hand.palm_mm is not None:
        made.append(np.sort(hand.palm_mm, axis=0) / 1e3 - [[0.0, 0.0, WAY], [0.0, 0.0, 0.0]])
    return np.stack(made)


def hand_axes(pad: FloatArray, approach: str, closing: str) -> FloatArray:
    """Axes of the hand as columns ``(3, 3)``, from those of finger 1's pad and the hand's ``closing`` axis."""
    axis, sign = APPROACHES[approach]
    z, across = sign * pad[:, axis], pad[:, 2]
    columns = [across, np.cross(z, across), z] if closing == "x" else [np.cross(across, z), across, z]
    return np.column_stack(columns)


def rooms(
    points: FloatArray, hand: Hand, pad: FloatArray, middle: FloatArray, size: Sequence[float], wide: float,
    touch: float, depth: float,
) -> dict[str, float]:  # fmt: skip
    """By approach the clearance [m] of a hand that comes to pads ``wide`` apart round ``middle (3,)`` [m].

    At first ``touch`` [m] fingers and palm, without the foam, may come as near as the object but no nearer. ``pad``:
    axes of finger 1's as columns ``(3, 3)``. ``size``: of a pad, along its axes. Others as for `boxes`.
    """
    clearances = {}
    for approach in hand.approaches:
        R = hand_axes(pad, approach, hand.closing)
        sides = size[:2] if approach.endswith("x") else size[1::-1]
        before, there = (boxes(hand, np.array([*sides, size[2]]), apart, depth) for apart in (wide, touch))
        x = (points - middle) @ R + [0.0, 0.0, depth]
        clearances[approach] = min(clearance(x, before), clearance(x, there[2:]) + FREE)  # the first two are foam
    return clearances


def opened(hand: Hand, gripper: Any, opening: float, wider: float = OPENED_MORE) -> tuple[float, float, float]:
    """Opening before a grasp, the largest there is, and the depth of the pads in it [m]; ``gripper`` is a scene's."""
    foam = 2 * gripper.pad_thickness
    most = min(hand.stroke_mm / 1e3 - foam, gripper.max_opening or np.inf)
    return min(opening + wider, max(most, opening)), most, hand.depth(opening + foam)


def refused(hand: Hand, gripper: Any, opening: float, force: float) -> list[str]:
    """Why a gripper cannot take a grasp wherever it comes from: its opening [m] or its force [N]."""
    most, (low, high) = opened(hand, gripper, opening)[1], hand.force_n
    wide = f"wider than the {shown_text(most, 'm')} that it opens" if most > 0 else "no opening left between its foam"
    words = [wide] * (opening > most * (1 + TIE))
    return words + [f"a force beyond its {low:g} to {high:g} N"] * (not low <= force <= high)


def clearance(points: FloatArray, corners: FloatArray) -> float:
    """Least distance [m] of points ``(n, 3)`` from boxes ``(k, 2, 3)``; negative as deep as a point is inside.

    >>> clearance(np.array([[3.0, 0, 0], [0, 5, 4]]), np.array([[[-1.0, -1, -1], [1, 1, 1]]]))
    2.0
    """
    # a row for each coordinate: sums over three neighbours in memory take two to four times as long
    x, (low, high) = np.ascontiguousarray(points.T), corners.transpose(1, 0, 2)[..., None]
    outside = np.maximum(low - x, x - high)
    return float((np.sqrt((np.maximum(outside, 0.0) ** 2).sum(axis=1)) + np.minimum(outside.max(axis=1), 0.0)).min())


def clearest(
    scene: Any, hand: Hand, pad: FloatArray, middle: FloatArray, wide: float, touch: float, depth: float
) -> tuple[str, float]:
    """The approach of a hand, and its clearance [m]; parameters as for `rooms`.

    It is the one from above, if the hand is `FREE` there, else the clearest. `ValueError, OSError`: no object is there.
    """
    room = rooms(surface_points(scene.object), hand, pad, middle, scene.gripper.pad_size, wide, touch, depth)
    weight = np.array(scene.task.direction or (0.0, 0.0, -1.0))
    down = {name: float(hand_axes(pad, name, "x")[:, 2] @ weight / np.linalg.norm(weight)) for name in room}
    approach = chosen_approach(room, down)
    return approach, room[approach]


def chosen_approach(clearances: dict[str, float], down: dict[str, float]) -> str:
    """Of the approaches that are `FREE` the one from above, if there is one, else the clearest.

    ``down`` is the cosine between each approach and the weight.

    >>> chosen_approach({"x": 0.02, "y": 0.01, "minus-y": 0.03}, {"x": 0.0, "y": 1.0, "minus-y": -1.0})
    'y'
    >>> chosen_approach({"x": 0.02, "y": -0.01}, {"x": 0.0, "y": 1.0})
    'x'
    """
    above = [name for name, value in clearances.items() if value >= FREE and down[name] > FROM_ABOVE]
    ranked = down if above else clearances
    # Rounded, so that of equal ones the first is taken on every machine.
    return max(above or clearances, key=lambda name: round(ranked[name], 6))
