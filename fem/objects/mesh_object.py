"""Triangle meshes as objects: read, cleaned, and turned into a smooth signed distance round the contact.

A finger sees the part of the surface that faces it (`facing_sheet`), with facets made smooth (`smooth_triangles`). The
distance to it is sampled on a grid in the box where the pad works and interpolated by a tricubic B-spline
(`splines`): g is twice continuously differentiable and costs the same for every mesh. Real edges are rounded over
about one step of the grid, which is a quarter of the pad's element; what is finer the pad cannot feel. Errors: that of
the spline, of fourth order in the step where the surface is smooth, and a two-hundredth of a step of the sheet.

The grid lies evenly about the middle of the box, so that the mirror image of a mesh has the mirror image of its gap.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.facing_sheet import COARSE, FacingSheet, facing_sheet
from softjaw.fem.objects.gap import IN_PLACE, Gap, IntArray, NoContactError, Pose, Surface
from softjaw.fem.objects.mesh_file import read_triangles, stated_unit
from softjaw.fem.objects.mesh_holes import solid
from softjaw.fem.objects.smooth_triangles import CREASE_ANGLE, SmoothTriangles, smooth_triangles
from softjaw.fem.objects.splines import evaluate_grid, grid_coefficients
from softjaw.fem.objects.triangle_tree import TriangleTree
from softjaw.fem.objects.triangles import cleaned, decimated
from softjaw.friction.patch import FloatArray

MARGIN_CELLS = 3  # least number of cells sampled beyond the box
MOST_SAMPLES = 4_000_000
CYCLES = {"x": [1, 2, 0], "y": [2, 0, 1], "z": [0, 1, 2]}  # cyclic, so that no mesh is mirrored


@dataclass(frozen=True, eq=False)
class MeshObject:
    """Triangles that a finger can meet, on whichever of their sides; points and lids in the object's frame [m].

    ``grid_step`` of the sampling grid is by default a quarter of the pad's element [m]; ``notes``: what was mended or
    left open when the mesh was read; edges that turn by less than ``crease_angle`` [deg] are taken for facets of a
    smooth surface, 0 keeps every facet flat; ``lids (l, 3, 3)``: triangles over the holes, where a pad before one is
    flagged; ``placed``: where the object's frame lies in that of the mesh file [m]; ``closed``: whether the triangles
    are closed surfaces, counterclockwise from outside.
    """

    points: FloatArray
    triangles: IntArray
    grid_step: float | None = None
    notes: tuple[str, ...] = ()
    crease_angle: float = CREASE_ANGLE
    lids: FloatArray = field(default_factory=lambda: np.empty((0, 3, 3)))
    placed: Pose = IN_PLACE
    closed: bool = True

    @classmethod
    def from_file(
        cls, path: str | Path, unit: str, axis: str = "z", grid_step: float | None = None,
        crease_angle: float = CREASE_ANGLE,
    ) -> Self:  # fmt: skip
        """Mesh from a file, cleaned and moved to the object's frame.

        ``axis`` of the file becomes z, by a cyclic exchange of the coordinates; z starts at 0 and the bounding box is
        centred in x and y. Raises ``MeshError`` with one sentence that says what is wrong and what to do.
        """
        corners, triangles = read_triangles(Path(path))
        try:
            clean = cleaned(corners, triangles, unit)
        except MeshError as problem:
            raise MeshError(f"{path}: {problem}") from problem
        turn = np.eye(3)[:, CYCLES[axis]]
        points = clean.points @ turn
        low, high = points.min(axis=0), points.max(axis=0)
        origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
        points, lids = np.ascontiguousarray(points - origin), clean.lids @ turn - origin
        placed, stated = Pose(turn, turn @ origin), stated_unit(Path(path))
        doubt = (f"its coordinates are taken in {unit}, its file says {stated}",) * (stated not in ("", unit))
        notes = (*clean.notes, *doubt)
        return cls(points, clean.triangles, grid_step, notes, crease_angle, lids, placed, clean.closed)

    def first_touch(self, pose: Pose, points: FloatArray, reach: float) -> float:
        """Distance [m] along the approach to the first triangle before ``points (n, 3)`` of the pad's frame.

        Raises `NoContactError`: if none of the lines meets a triangle within ``reach`` [m].
        """
        distance = self._tree.along(pose.to_object(points), pose.rotation[:, 2]).min()
        if distance > reach:
            text = f"the pad misses the object within {reach * 1e3:.4g} mm; check station, angle, object size and unit"
            raise NoContactError(text)
        return float(distance)

    @cached_property
    def solid(self) -> tuple[float, FloatArray, float]:
        """Volume that the triangles enclose [m^3], as if it were full; centroid ``(3,)`` and the error of that [m]."""
        return solid(self.points, self.triangles, self.closed)

    def hole_share(self, pose: Pose, points: FloatArray, depth: float) -> float:
        """Share of the lines along the approach before ``points (n, 3)`` of the pad's frame that go through a hole.

        Counted are holes before any triangle and within ``depth`` [m] of the points, to both sides.
        """
        corners = pose.to_pad(self.lids.reshape(-1, 3)).reshape(-1, 3, 3)
        low, high = corners.min(axis=1), corners.max(axis=1)
        over = (low <= np.append(points.max(axis=0)[:2], depth)) & (high >= np.append(points.min(axis=0)[:2], -depth))
        if not (near := over.all(axis=1)).any():
            return 0.0
        lids = TriangleTree(self.lids[near].reshape(-1, 3), np.arange(3 * near.sum()).reshape(-1, 3))
        start, approach = pose.to_object(points) - depth * pose.rotation[:, 2], pose.rotation[:, 2]
        hole, wall = lids.along(start, approach), self._tree.along(start, approach)
        # share of the depth to which holes count: a wall so close behind closes one
        return float(np.mean((hole < wall - 0.1 * depth) & (hole < 2 * depth)))

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m] to the flat triangles, its unit gradient ``(n, 3)`` and a Hessian of zeros.

        Of all triangles, exact and as rough as they are: meant for points far away. Where a pad touches, take ``near``.
        """
        g, normal, _ = self._tree.signed(x)
        return g, normal, np.zeros((len(x), 3, 3))

    def near(self, pose: Pose, lower: FloatArray, upper: FloatArray, element: float | None = None) -> MeshRegion:
        """Smooth signed distance inside the box from ``lower (3,)`` to ``upper (3,)`` of the pad's frame [m].

        ``element`` is the size of the pad's elements [m]. Every rank gets the same region.
        """
        box = np.array([lower, upper], dtype=float)
        size = box[1] - box[0]
        step = self._step(size, element)
        # whole coarse cells, as `sampled` asks for; rounding of the quotient must not add one
        cells = COARSE * np.ceil((size / step - 1e-9 + 2 * MARGIN_CELLS) / COARSE)
        if np.prod(cells + 1) > MOST_SAMPLES:
            text = f"grid_step {step * 1e3:.3g} mm: {np.prod(cells + 1):.3g} samples, at most {MOST_SAMPLES}; raise it"
            raise ValueError(text)
        sheet = facing_sheet(self._smooth, self._tree, self.closed, pose, box, step)
        axes = [0.5 * box[:, d].sum() + step * (np.arange(int(cells[d]) + 1) - 0.5 * cells[d]) for d in range(3)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        samples = sheet.sampled(pose.to_object(grid.reshape(-1, 3)).reshape(grid.shape), step)
        first = np.array([axis[0] for axis in axes])
        return MeshRegion(sheet, pose, box[0], box[1], step, first, grid_coefficients(samples))

    def _step(self, size: FloatArray, element: float | None) -> float:
        """Step of the grid over a box of this size [m]."""
        if self.grid_step:
            return self.grid_step
        # four steps of the grid per element, or 80 along the longest side of the box
        wanted = element / 4 if element else float(size.max()) / 80
        # a large box with small elements gets a coarser grid rather than none
        # samples of a grid whose step is not the user's own
        return max(wanted, float(np.cbrt(np.prod(size) / 1_000_000)))

    @property
    def bounds(self) -> FloatArray:
        """Corners ``(2, 3)`` [m]."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    def surface(self) -> Surface:
        """Points and triangles; large meshes are decimated."""
        if len(self.triangles) <= 20_000:
            return self.points, self.triangles
        return decimated(self.points, self.triangles, 10_000)

    def sharp_facets(self, width: float) -> str:
        """A note on facets wider than ``width`` [m] that stay sharp though they may be meant as round; mostly empty."""
        smooth = self._smooth
        edges, off = smooth.doubtful(width)
        if len(edges) < 4:  # a round surface has more edges of one kind than a scan has by chance
            return ""
        turn = np.degrees(smooth.turn[edges])
        least = max(np.ceil(turn.max()), CREASE_ANGLE)  # with which edges at the ends of long facets are round, too
        return (
            f"{len(edges)} edges of wide facets, {turn.min():.3g} to {turn.max():.3g} degrees, stay sharp; if round,"
            f" the surface lies up to {1e3 * off.max():.2g} mm outside: raise object.crease_angle_deg above"
            f" {least:.0f}, or export a finer mesh"
        )

    @cached_property
    def _tree(self) -> TriangleTree:
        return TriangleTree(self.points, self.triangles)

    @cached_property
    def _smooth(self) -> SmoothTriangles:
        return smooth_triangles(self.points, self.triangles, self.crease_angle)


@dataclass(frozen=True, eq=False)
class MeshRegion:
    """Signed distance to what a finger sees of a mesh, twice continuously differentiable inside a box of its frame.

    Outside the box the distance to the sheet itself is taken: slower and rougher, but of the right sign and growing.
    """

    sheet: FacingSheet
    pose: Pose
    lower: FloatArray
    upper: FloatArray
    grid_step: float
    first: FloatArray
    coefficients: FloatArray

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m], its gradient ``(n, 3)`` and Hessian ``(n, 3, 3)`` [1/m], object's frame.

        The gradient is that of the spline, so its length is 1 up to the interpolation error.
        """
        y = self.pose.to_pad(np.asarray(x, dtype=float))
        inside = ((y >= self.lower) & (y <= self.upper)).all(axis=1)
        if inside.all():
            return self._spline(y)
        g, normal, hessian = np.empty(len(y)), np.empty((len(y), 3)), np.zeros((len(y), 3, 3))
        g[inside], normal[inside], hessian[inside] = self._spline(y[inside])
        g[~inside], normal[~inside] = self.sheet.signed(x[~inside])
        return g, normal, hessian

    def _spline(self, y: FloatArray) -> Gap:
        """Interpolation at points ``y (n, 3)`` of the pad's frame, turned into the object's frame."""
        R = self.pose.rotation
        g, gradient, hessian = evaluate_grid(self.coefficients, self.first, self.grid_step, np.ascontiguousarray(y))
        return g, gradient @ R.T, R @ hessian @ R.T
