"""Surface of revolution: bottles, cups and bulbs from the heights and radii of a profile."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softjaw.fem.objects.gap import Analytic, Gap, Surface, grid_triangles
from softjaw.fem.objects.profile import Curve, through, with_lids
from softjaw.friction.patch import NEGLIGIBLE, FloatArray

TURN = np.radians(3.0)  # largest turn of the curve within one segment of the polyline


def closest() -> Any:
    """The module of closest points; it loads numba, which a scene that is only checked does not need."""
    from softjaw.fem.objects import closest

    return closest


@dataclass(frozen=True, eq=False)
class Revolution(Analytic):
    """Body that a profile sweeps round the z axis.

    ``profile (k, 2)``: heights z and radii r [m] in order along the outside; r > 0, r = 0 allowed at the two ends.
    Three or more points on a line give exactly this line, the others a smooth curve (see ``fem.objects.profile``).
    ``rim``: radius of the rounding at corners between straight runs and where an open end meets its flat cap [m];
    smaller where the body is thin. ``beyond``: whether the rim of an open end's cap lies beyond the last point, as that
    of a wall does, which reaches up to there; else the cap lies at its height.

    Raises `ValueError`: for points that make no body, with the number of the point.
    """

    profile: FloatArray
    rim: float = 0.002
    beyond: bool = False

    def __post_init__(self) -> None:
        """Refuse a curve that is no body's; the points rise, and lie on the axis at the ends alone."""
        object.__setattr__(self, "profile", np.asarray(self.profile, dtype=float))
        _check_line(self._line)

    @cached_property
    def closed(self) -> tuple[Curve, tuple[float, float], tuple[float, float]]:
        """Outline, the part of it between the profile's ends, and between flat caps; see `with_lids`."""
        return with_lids(through(self.profile, self.rim), self.rim, (None, None) if self.beyond else ())

    @property
    def curve(self) -> Curve:
        """Outline with its caps."""
        return self.closed[0]

    @cached_property
    def _places(self) -> FloatArray:
        """Parameters of a polyline that turns by a small angle from vertex to vertex and keeps every break."""
        curve = self.curve
        h = np.diff(curve.breaks)
        inner = (curve.breaks[:-1, None] + h[:, None] * (np.arange(16) / 16)).ravel()
        speed = np.linalg.norm(curve.derivative(inner, 1), axis=1)
        # segments follow the turn, not the length: a straight run needs one, a rim many
        turn = (np.abs(curve.curvature(inner)) * speed).reshape(-1, 16).max(axis=1) * h
        n = np.maximum(1, np.ceil(turn / TURN)).astype(int)
        steps = [start + length * np.arange(k) / k for start, length, k in zip(curve.breaks[:-1], h, n, strict=True)]
        return np.concatenate([*steps, curve.breaks[-1:]])

    @cached_property
    def _line(self) -> FloatArray:
        return self.curve.derivative(self._places)

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m], normal ``(n, 3)`` and Hessian ``(n, 3, 3)`` [1/m]."""
        x = np.ascontiguousarray(x, dtype=float)
        curve = self.curve
        return closest().profile_gap(x, curve.breaks, curve.coefficients, self._line, self._places)

    @property
    def bounds(self) -> FloatArray:
        """Corners ``(2, 3)`` [m], caps included."""
        (low, _), (high, r) = self._line.min(axis=0), self._line.max(axis=0)
        return np.array([[-r, -r, low], [r, r, high]])

    def surface(self) -> Surface:
        """Points and triangles: the profile, finest where it bends, at 48 angles."""
        fine = self._places
        s = fine if len(fine) < 60 else fine[np.linspace(0, len(fine) - 1, 60).round().astype(int)]
        s = np.unique(np.concatenate([s, np.linspace(0, self.curve.breaks[-1], 25)]))
        # rounding may leave the pole at a negative radius
        z, r = np.maximum(self.curve.derivative(s), [-np.inf, 0.0]).T[:, :, None]
        phi = np.linspace(0, 2 * np.pi, 48, endpoint=False)
        points = np.stack([r * np.cos(phi), r * np.sin(phi), z + 0 * phi], axis=-1).reshape(-1, 3)
        return points, grid_triangles(len(s), 48, closed=True)


def _check_line(line: FloatArray) -> None:
    """Refuse a curve that touches the axis on the way, or itself; ``line (m + 1, 2)`` is its polyline."""
    if line[1:-1, 1].min() <= NEGLIGIBLE:
        z = 1e3 * line[1 + line[1:-1, 1].argmin(), 0]
        raise ValueError(f"the profile's curve swings to the axis near z = {z:.4g} mm; add points there to hold it off")
    a, d = line[:-1], np.diff(line, axis=0)

    def cross(u: FloatArray, v: FloatArray) -> FloatArray:
        return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]

    e, touch = d / np.linalg.norm(d, axis=1)[:, None], NEGLIGIBLE * np.ptp(line, axis=0).max()
    start = cross(e[:, None], a[None] - a[:, None])  # distances of all ends from all pieces' lines
    end = cross(e[:, None], line[None, 1:] - a[:, None])
    split = (start * end < 0) | (np.minimum(np.abs(start), np.abs(end)) <= touch)
    low, high = np.minimum(a, line[1:]) - touch, np.maximum(a, line[1:])
    near = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=-1)
    # neighbours share an end and always touch
    i, _ = np.nonzero(np.triu(split & split.T & near, k=2))
    if len(i):
        z, r = 1e3 * a[i[0]]
        raise ValueError(
            f"the profile crosses or touches itself near z = {z:.4g} mm, r = {r:.4g} mm; give "
            "the points in order along the outside, and more of them where it bends sharply"
        )
