"""Objects as gap functions: where a pad stands, what every object offers it, and where a pad meets one first."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import FloatArray

IntArray = NDArray[np.int64]
Gap = tuple[FloatArray, FloatArray, FloatArray]
Surface = tuple[FloatArray, IntArray]
SHARPNESS = 1e-12  # how well the touch is located [m]
GRAZE = 1e-9  # depth that a point has to reach to have met the object [m]: less is a pad that may as well pass it


class Pose(NamedTuple):
    """Where a pad stands: ``x_object = rotation @ x_pad + origin``.

    Columns of the rotation are the pad's long side, its short side and its approach direction in the object's frame,
    the origin is the centre of its undeformed contact face [m].
    """

    rotation: FloatArray
    origin: FloatArray

    def to_object(self, x: FloatArray) -> FloatArray:
        """Points of the pad's frame in the object's frame, ``(n, 3)`` [m]."""
        return x @ self.rotation.T + self.origin

    def to_pad(self, x: FloatArray) -> FloatArray:
        """Points of the object's frame in the pad's frame, ``(n, 3)`` [m]."""
        return (x - self.origin) @ self.rotation


IN_PLACE = Pose(np.eye(3), np.zeros(3))


def about_z(angle: float) -> FloatArray:
    """Rotation ``(3, 3)`` about the axis z [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


class GapFunction(Protocol):
    """Signed distance with its first two derivatives, in the object's frame."""

    def gap(self, x: FloatArray) -> Gap:
        """``(g (n,), normal (n, 3), hessian (n, 3, 3))`` at the points ``x (n, 3)`` [m, -, 1/m]; g > 0 outside."""


class GapObject(GapFunction, Protocol):
    """An object that a pad can be pressed on."""

    @property
    def bounds(self) -> FloatArray:
        """Lower and upper corner of the object, ``(2, 3)`` [m]."""

    def first_touch(self, pose: Pose, points: FloatArray, reach: float) -> float:
        """Distance [m] along the approach at which the first of the pad's ``points (n, 3)`` meets the object."""

    def surface(self) -> Surface:
        """Points ``(k, 3)`` [m] and triangles ``(m, 3)`` for drawing."""

    def near(self, pose: Pose, lower: FloatArray, upper: FloatArray, element: float | None = None) -> GapFunction:
        """Gap function for use inside a box of the pad's frame, by a pad with elements of this size [m]."""


class Analytic(GapFunction):
    """Shapes whose gap function costs the same everywhere."""

    def first_touch(self, pose: Pose, points: FloatArray, reach: float) -> float:
        """See `first_touch`."""
        return first_touch(self, pose, points, reach)

    def near(self, pose: Pose, lower: FloatArray, upper: FloatArray, element: float | None = None) -> GapFunction:
        """Return the shape itself: a closed form needs no region."""
        return self


def radial(d: FloatArray) -> Gap:
    """Length of the rows of ``d (n, k)``, its gradient and its Hessian, which is held within 1e-9 m of the centre."""
    r = np.linalg.norm(d, axis=1)
    e = d / np.where(r > 0, r, 1.0)[:, None]
    e[r == 0, 0] = 1.0
    H = (np.eye(d.shape[1]) - e[:, :, None] * e[:, None, :]) / np.maximum(r, 1e-9)[:, None, None]
    return r, e, H


def grid_triangles(rows: int, columns: int, *, closed: bool = False) -> IntArray:
    """Triangles over a grid of ``rows x columns`` points, numbered row by row; ``closed`` joins the last column."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns if closed else columns - 1), indexing="ij")
    a, b = (i * columns + j).ravel(), (i * columns + (j + 1) % columns).ravel()
    return np.concatenate([np.stack([a, b, a + columns], 1), np.stack([b, b + columns, a + columns], 1)])


def cone_volumes(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Signed volumes ``(m,)`` [m^3] of the tetrahedra from the middle of the points' box to each triangle."""
    # about the middle: an origin far away would cost digits
    a, b, c = (points[triangles] - 0.5 * (points.min(axis=0) + points.max(axis=0))).transpose(1, 0, 2)
    return np.asarray(np.einsum("ij,ij->i", a, np.cross(b, c)) / 6)


def solid_centroid(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Centroid ``(3,)`` of the volume inside one closed surface of ``triangles (m, 3)``, by the divergence theorem."""
    middle, volume = 0.5 * (points.min(axis=0) + points.max(axis=0)), cone_volumes(points, triangles)
    return middle + volume @ (points[triangles] - middle).sum(axis=1) / (4 * volume.sum())


def edges_of(triangles: IntArray) -> IntArray:
    """Points at both ends ``(3 m, 2)`` of the edges of ``triangles (m, 3)``, as each triangle runs through them."""
    return triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


class NoContactError(ValueError):
    """The pad does not meet the object on its way."""


def first_touch(obj: GapFunction, pose: Pose, points: FloatArray, reach: float) -> float:
    """Distance [m] that the pad moves along its approach until the first of its points meets the object.

    Sphere tracing: a point may move by its signed distance without crossing the surface. All points are traced at once
    and those that are already further than the first hit are given up; each hit is then located by bisection.

    ``obj``: its gap must be a signed distance; ``pose``: the pad's frame before the approach; ``points (n, 3)``: of the
    contact face in that frame [m]; ``reach``: distance to give up at [m].

    Raises `NoContactError`: if no point meets the object within ``reach``, or only grazes it, or the pad starts inside
    the object.
    """
    reach += GRAZE  # what is met just at the end of the reach is met
    start, approach = pose.to_object(points), pose.rotation[:, 2]

    def gap(which: np.ndarray, t: FloatArray) -> FloatArray:
        return obj.gap(start[which] + t[:, None] * approach)[0]

    active = np.arange(len(points))
    t = np.zeros(len(points))
    g = gap(active, t)
    if g.min() < -GRAZE:
        text = f"the pad starts {-g.min() * 1e3:.3g} mm inside the object; start it further out against its approach"
        raise NoContactError(text)
    closest, first, grazed = g.min(), np.inf, False
    while len(active):
        low = t
        # smallest step of a trace in units of the reach: a point that grazes the surface still gets past
        t = t + np.maximum(g, 1e-4 * reach)
        g = gap(active, t)
        closest = min(closest, g.min())
        # a touch too shallow for a hit: distinguished from a pad that passes well clear
        grazed |= bool((g[t < reach] < GRAZE).any())
        hit = g <= -GRAZE
        if hit.any():
            first = min(first, _bisected(partial(gap, active[hit]), low[hit], t[hit]).min())
        keep = ~hit & (t < min(first, reach))
        active, t, g = active[keep], t[keep], g[keep]
    if np.isinf(first) and grazed:
        raise NoContactError(
            f"the pad only grazes the object on its way along the approach ({_vector(approach)}) from "
            f"({_vector(pose.origin)}) m: whether it touches depends on rounding; move the station or the pose"
        )
    if first > reach:
        raise NoContactError(
            f"the pad misses the object by {closest * 1e3:.3g} mm within {reach * 1e3:.4g} mm along "
            f"({_vector(approach)}) from ({_vector(pose.origin)}) m; check station, angle and the object's size, unit"
        )
    return float(first)


def _bisected(gap: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
    """Places of the sign changes between ``low`` (outside) and ``high`` (inside), ``(k,)``."""
    # the second condition ends it where neighbouring doubles are further apart than `SHARPNESS`
    while (high - low).max() > SHARPNESS and ((middle := 0.5 * (low + high)) != low).any():
        inside = gap(middle) <= 0
        low, high = np.where(inside, low, middle), np.where(inside, middle, high)
    # the inner end: there the pad has certainly met the object
    return high


def _vector(v: FloatArray) -> str:
    # adding zero turns -0 into 0
    return ", ".join(f"{x:.4g}" for x in v + 0.0)
