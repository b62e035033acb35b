"""The state of a pad from its deformed contact face, as it was measured: pressures without knowledge of the object.

The face is pressed into the shape that it had (see `fem.objects.measured_face`). Noise would load it where it was
free: where the measured face lies deeper than the true one, foam is pressed that was not. So the solve is done twice.
At a closing displacement that is less by `NOISE_MARGIN` standard errors of the face only what surely bears still does.
Farther from there than the contact grows on the rest of the way, the object is not where the face was measured but
beyond, and is taken away by as much as the face may be wrong. The growth is estimated from a parabola, whose contact
goes with the root of the closing displacement.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.spatial import cKDTree

from softjaw.fem.contact.path import Pressed
from softjaw.fem.contact.press import Press
from softjaw.fem.objects.gap import Gap, NoContactError
from softjaw.fem.objects.measured_face import MeasuredFace
from softjaw.fem.pad.mesh import Pad
from softjaw.friction.patch import FloatArray

NOISE_MARGIN = 2.0  # standard errors of the face that a contact has to stand
LIFT, RAMP = 3.0, 2.0  # standard errors by which the face is lifted where nothing surely bears; elements of the ramp
LIFT_SAMPLES = 60  # of the lift along a side of the pad


def press_measured(
    face: MeasuredFace, pad: Pad, fallbacks: Sequence[Pad] = (), options: dict[str, Any] | None = None
) -> tuple[Pressed, bool]:
    """State of a pad pressed into the shape of its measured face, and whether contact is distinguished from noise.

    The state is in the frame at first touch, from which the backing plate has moved on by the closing displacement.
    ``face``: measured from where the undeformed face would be; ``pad``: whole, on a rigid backing plate;
    ``fallbacks, options``: as in `fem.contact.press.Press`.

    Raises `NoContactError`: if the face is not pressed in anywhere; `ConvergenceError`, `CheckError`: if there is no
    acceptable state.
    """
    depth = _depth(face, pad)
    if not depth > 1e-6 * pad.shape.size[2]:
        raise NoContactError("the face lies nowhere below the undeformed one, so it touches nothing")
    touching, margin = face.lifted(depth), NOISE_MARGIN * face.doubt

    def pressed(gap: Callable[[FloatArray], Gap], closing: float) -> Pressed:
        press = Press(pad, gap, options, fallbacks)
        try:
            return press.at_closing(closing)
        finally:
            press.destroy()

    # share of the closing displacement: with a larger margin nothing tells contact from noise
    if margin >= 0.5 * depth:
        return pressed(touching.gap, depth), False
    sure = pressed(touching.gap, depth - margin)
    return pressed(_released(pad, touching, sure, depth), depth), True


def _depth(face: MeasuredFace, pad: Pad) -> float:
    """How far the deepest point of the face lies below the undeformed one [m]."""
    nodes = pad.nodes[pad.contact_nodes]
    x, y = (np.linspace(nodes[:, k].min(), nodes[:, k].max(), 4 * LIFT_SAMPLES + 1) for k in (0, 1))
    X, Y = np.meshgrid(x, y, indexing="ij")
    return float(-face.height(X.ravel(), Y.ravel())[0].min())


def _released(pad: Pad, face: MeasuredFace, sure: Pressed, depth: float) -> Callable[[FloatArray], Gap]:
    """Gap of the face, lifted where the pad bears nothing on the way to it, nor may on the rest of the way."""
    bearing = sure.contact_face[sure.pressure > 0][:, :2]
    if not len(bearing):
        return face.gap
    widths = [side / n for side, n in zip(pad.shape.size[:2], pad.shape.elements, strict=False)]
    growth = math.sqrt(depth / sure.closing) - 1.0
    reach = 0.5 * float(np.ptp(bearing, axis=0).max()) * growth + max(widths)
    x, y = (np.linspace(-0.7, 0.7, LIFT_SAMPLES) * side for side in pad.shape.size[:2])
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    t = np.clip((cKDTree(bearing).query(places)[0] - reach) / (RAMP * max(widths)), 0.0, 1.0)
    lift = LIFT * face.doubt * t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    return partial(lifted_gap, face, RectBivariateSpline(x, y, lift))


def lifted_gap(face: MeasuredFace, lift: RectBivariateSpline, X: FloatArray) -> Gap:
    """Gap of a face that is lifted off the pad by a smooth function of the place; where the pad bears there is none."""
    g, normal, hessian = face.gap(X)
    x, y = X[:, 0], X[:, 1]
    d = {(i, j): lift.ev(x, y, dx=i, dy=j) for i in range(3) for j in range(3 - i)}
    normal[:, 0] += d[1, 0]
    normal[:, 1] += d[0, 1]
    hessian[:, :2, :2] += np.stack([np.stack([d[2, 0], d[1, 1]], -1), np.stack([d[1, 1], d[0, 2]], -1)], -2)
    return g + d[0, 0], normal, hessian
