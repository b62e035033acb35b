"""Body of stacked sections as a gap function: exact near its wall, from a fine triangulation far away."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.objects.gap import Analytic, Gap, GapFunction, Pose, Surface, grid_triangles
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.outer_surface import OuterSurface
from softjaw.fem.objects.splines import SplineSurface, spline_surface
from softjaw.fem.shell.facing import FAR, Wall, face
from softjaw.friction.patch import FloatArray

AROUND, ALONG = 192, 256  # samples of the surface that splines join
RIM = 17  # samples of a rounded edge, which is short
DRAWN_AROUND, DRAWN_ALONG = 72, 90


@dataclass(frozen=True, eq=False)
class Stacked(Analytic):
    """Closed body inside an outer surface."""

    outer: OuterSurface

    @property
    def bounds(self) -> FloatArray:
        """Corners ``(2, 3)`` [m]."""
        return self._triangles.bounds

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m], normal ``(n, 3)`` and Hessian ``(n, 3, 3)`` [1/m]."""
        x = np.asarray(x, dtype=float)
        # where the exact place on the wall is looked for [m]
        return self.gap_of(x, np.abs(self._triangles.gap(x)[0]) < 0.004)

    def near(self, pose: Pose, lower: FloatArray, upper: FloatArray, element: float | None = None) -> GapFunction:
        """Gap function for use close to the wall, which need not ask the triangles first."""
        return CloseToWall(self)

    def gap_of(self, x: FloatArray, close: NDArray[np.bool_]) -> Gap:
        """Exact where points are ``close`` to the wall and face it, else from the triangles."""
        g, normal, hessian = np.zeros(len(x)), np.zeros((len(x), 3)), np.zeros((len(x), 3, 3))
        none = np.zeros((self._wall.nodes.max() + 1, 3))
        near = np.flatnonzero(close)
        met = face(self._wall, x[near], self._wall.places(x[near]), none, none)
        # points beyond the ends of the wall face nothing and are left to the triangles
        hit = met.gap < FAR
        for values, value in ((g, met.gap), (normal, met.normal), (hessian, met.H)):
            values[near[hit]] = value[hit]
        rest = np.setdiff1d(np.arange(len(x)), near[hit])
        if len(rest):
            g[rest], normal[rest], _ = self._triangles.gap(x[rest])
        return g, normal, hessian

    def surface(self) -> Surface:
        """Points and triangles for drawing."""
        return self._sampled(DRAWN_AROUND, DRAWN_ALONG)

    @cached_property
    def _wall(self) -> Wall:
        """The undeformed wall between the first and the last section, as one that does not give way."""
        return undeformed(wall_surface(self.outer))

    @cached_property
    def _triangles(self) -> MeshObject:
        return MeshObject(*self._sampled(AROUND, ALONG))

    def _sampled(self, around: int, along: int) -> Surface:
        """Closed triangulation, oriented outwards; its two ends are fans about the axis."""
        theta = np.linspace(0.0, 2 * np.pi, around, endpoint=False)
        s = np.unique(np.concatenate([np.linspace(0, self.outer.end, along), self.outer.curve.breaks]))
        T, S = np.meshgrid(theta, s[1:-1], indexing="ij")
        X = self.outer.jets(T, S)[:, 0].reshape(around, -1, 3).transpose(1, 0, 2)
        rows = X.shape[0]
        ends = self.outer.jets(np.zeros(2), np.array([0.0, self.outer.end]))[:, 0]
        first, last = rows * around, rows * around + 1
        ring, after = np.arange(around), (np.arange(around) + 1) % around
        bottom = np.stack([np.full(around, first), after, ring], 1)
        top = np.stack([np.full(around, last), ring + (rows - 1) * around, after + (rows - 1) * around], 1)
        triangles = np.concatenate([grid_triangles(rows, around, closed=True), bottom, top])
        return np.concatenate([X.reshape(-1, 3), ends]), triangles.astype(np.int64)


class CloseToWall(NamedTuple):
    """Gap function of a body for points close to its wall, as of a pad that touches it."""

    body: Stacked

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance, normal and Hessian, as of `Stacked`."""
        return self.body.gap_of(x, np.ones(len(x), dtype=bool))


def wall_surface(outer: OuterSurface, lower: float | None = None, upper: float | None = None) -> SplineSurface:
    """Splines through the part of an outer surface between two places ``s`` [m], by default the ends of its wall."""
    ends = outer.wall[0] if lower is None else lower, outer.wall[1] if upper is None else upper
    breaks = outer.curve.breaks
    breaks = breaks[(breaks > ends[0]) & (breaks < ends[1])]
    inner = max(ends[0], outer.wall[0]), min(ends[1], outer.wall[1])
    runs = np.linspace(ends[0], inner[0], RIM), np.linspace(*ends, ALONG), np.linspace(inner[1], ends[1], RIM)
    s = np.unique(np.concatenate([*runs, breaks]))
    # lines that coincide up to rounding would leave a spline an interval without length
    s = s[np.concatenate([[True], np.diff(s) > 1e-9])]
    theta = np.linspace(0.0, 2 * np.pi, AROUND + 1)
    T, S = np.meshgrid(theta, s, indexing="ij")
    return spline_surface(theta, s, outer.jets(T, S)[:, 0].reshape(*T.shape, 3))


def undeformed(surface: SplineSurface) -> Wall:
    """The surface's own grid as the mesh of a wall."""
    m, k = len(surface.theta) - 1, len(surface.s)
    number = np.arange(m * k, dtype=np.int32).reshape(m, k)
    return Wall(surface, surface.theta, surface.s, np.vstack([number, number[:1]]), np.full(m * k, 1e-3))
