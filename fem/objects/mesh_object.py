"""Triangle meshes as objects: read, checked, and turned into a smooth signed distance round the contact.

The distance to the triangles themselves has a normal that jumps and a curvature that sits in the edges alone. In the
box where a pad works it is therefore sampled on a grid and interpolated by a tricubic B-spline: g is twice continuously
differentiable and costs the same for every mesh. The spline passes through the samples; it rounds edges over about one
grid step and keeps everything larger, facets included. A quarter of the pad's element size is a good step; one far
below the triangles' size only renders the facets more sharply.

VTK is imported where it is used: loading it took a quarter of every start, and most objects need none of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.gap import Gap, IntArray, Surface
from softjaw.fem.objects.mesh_check import sound_mesh
from softjaw.fem.objects.mesh_file import read_triangles
from softjaw.fem.objects.pose import FloatArray, Pose
from softjaw.fem.objects.tricubic import coefficients, evaluate

if TYPE_CHECKING:
    import pyvista as pv
    from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance

__all__ = ["MeshError", "MeshObject", "MeshRegion"]

STEPS_PER_BOX = 80  # default grid: steps along the longest side of the box
MARGIN = 3  # cells sampled beyond the box
MOST_SAMPLES = 4_000_000
MOST_CENTRES = 4_000  # cells at whose centres the interpolation is compared with the distance itself
TURNS = {"x": [1, 2, 0], "y": [2, 0, 1], "z": [0, 1, 2]}  # cyclic, so that no mesh is mirrored


@dataclass(frozen=True, eq=False)
class MeshObject:
    """Closed triangle mesh, oriented outwards.

    Parameters
    ----------
    points : (k, 3) array
        Corners in the object's frame [m].
    triangles : (m, 3) array of int
        Corners of each triangle, counterclockwise from outside.
    grid_step : float or None
        Step of the sampling grid [m]; by default 1/80 of the longest side of the box that is asked for.
    notes : tuple of str
        What was repaired or tolerated when the mesh was checked.
    """

    points: FloatArray
    triangles: IntArray
    grid_step: float | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a step that is no length."""
        if self.grid_step is not None and not (np.isfinite(self.grid_step) and self.grid_step > 0):
            raise ValueError(f"grid_step must be a positive length in metres, found {self.grid_step}")

    @classmethod
    def from_file(cls, path: str | Path, unit: str, axis: str = "z", grid_step: float | None = None) -> Self:
        """Mesh from an STL, OBJ, PLY or OFF file, checked and moved to the object's frame.

        ``axis`` of the file becomes z, by a cyclic exchange of the coordinates; z starts at 0 and the bounding box is
        centred in x and y. Raises ``MeshError`` with one sentence that says what is wrong and what to do.
        """
        if axis not in TURNS:
            raise MeshError(f"the mesh's axis must be one of {', '.join(TURNS)}, found {axis!r}")
        corners, triangles = read_triangles(Path(path))
        try:
            points, triangles, notes = sound_mesh(corners, triangles, unit)
        except MeshError as problem:
            raise MeshError(f"{path}: {problem}") from problem
        points = points[:, TURNS[axis]]
        low, high = points.min(axis=0), points.max(axis=0)
        origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
        return cls(np.ascontiguousarray(points - origin), triangles, grid_step, notes)

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m] to the triangles, its normal ``(n, 3)`` and a Hessian ``(n, 3, 3)`` of zeros.

        Exact and as rough as the triangles: meant for points far away. Where a pad touches, take ``near``.
        """
        g, closest = self.distance(x), self._closest(x)
        d = x - closest
        far = np.abs(g) > 1e-9 * np.ptp(self.points)
        normal = self._flat_normals(x)
        normal[far] = d[far] / g[far, None]
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        return g, normal, np.zeros((len(x), 3, 3))

    def distance(self, x: FloatArray) -> FloatArray:
        """Signed distance ``(n,)`` [m] to the triangles; the sign comes from normals weighted by angle."""
        from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkDoubleArray

        out = vtkDoubleArray()
        self._implicit.FunctionValue(numpy_to_vtk(np.ascontiguousarray(x, dtype=float)), out)
        return vtk_to_numpy(out).copy()

    def near(self, pose: Pose, lower: FloatArray, upper: FloatArray) -> MeshRegion:
        """Smooth signed distance inside the box from ``lower (3,)`` to ``upper (3,)`` of the pad's frame [m].

        Depends on the arguments alone, so every rank gets the same region.
        """
        lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        if not (upper > lower).all():
            raise ValueError(f"the box from {lower.tolist()} to {upper.tolist()} m is empty; swap its corners")
        step = self.grid_step or float((upper - lower).max()) / STEPS_PER_BOX
        cells = np.ceil((upper - lower) / step - 1e-9) + 2 * MARGIN
        if np.prod(cells + 1) > MOST_SAMPLES:
            raise ValueError(
                f"a grid step of {step * 1e3:.3g} mm needs {np.prod(cells + 1):.3g} samples for one pad, "
                f"more than {MOST_SAMPLES}; raise grid_step"
            )
        first = lower - MARGIN * step
        axes = [first[d] + step * np.arange(int(cells[d]) + 1) for d in range(3)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        samples = self.distance(pose.to_object(grid.reshape(-1, 3))).reshape(grid.shape[:3])
        return MeshRegion(self, pose, lower, upper, step, first, samples, coefficients(samples))

    @property
    def bounds(self) -> FloatArray:
        """Corners ``(2, 3)`` [m]."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    @property
    def axis_symmetry(self) -> int:
        """None that could be relied on."""
        return 1

    def surface(self) -> Surface:
        """Points and triangles; large meshes are decimated."""
        if len(self.triangles) <= 20_000:
            return self.points, self.triangles
        mesh = self._polydata.decimate(1 - 10_000 / len(self.triangles))
        return np.asarray(mesh.points, dtype=float), mesh.regular_faces.astype(np.int64)

    @cached_property
    def _polydata(self) -> pv.PolyData:
        """Mesh as VTK knows it."""
        import pyvista as pv

        return pv.PolyData.from_regular_faces(self.points, self.triangles)

    @cached_property
    def _implicit(self) -> vtkImplicitPolyDataDistance:
        """VTK's signed distance."""
        from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance

        implicit = vtkImplicitPolyDataDistance()
        implicit.SetInput(self._polydata)
        return implicit

    def _closest(self, x: FloatArray) -> FloatArray:
        """Closest points ``(n, 3)`` of the triangles [m]."""
        return self._polydata.find_closest_cell(x, return_closest_point=True)[1]

    def _flat_normals(self, x: FloatArray) -> FloatArray:
        """Normal ``(n, 3)`` of the triangle closest to each point."""
        cells = self._polydata.find_closest_cell(x)
        a, b, c = self.points[self.triangles[cells]].transpose(1, 0, 2)
        return np.cross(b - a, c - a)


@dataclass(frozen=True, eq=False)
class MeshRegion:
    """Signed distance to a mesh, twice continuously differentiable inside a box of the pad's frame.

    Outside the box the distance to the triangles is taken: slower and rougher, but of the right sign and growing.
    """

    mesh: MeshObject
    pose: Pose
    lower: FloatArray
    upper: FloatArray
    grid_step: float
    first: FloatArray
    samples: FloatArray
    coefficients: FloatArray

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m], its gradient ``(n, 3)`` and Hessian ``(n, 3, 3)`` [1/m], object's frame.

        The gradient is that of the spline, so its length is 1 up to the interpolation error.
        """
        y = self.pose.to_pad(np.asarray(x, dtype=float))
        inside = self._covers(y)
        if inside.all():
            return self._spline(y)
        g, normal, hessian = np.empty(len(y)), np.empty((len(y), 3)), np.empty((len(y), 3, 3))
        g[inside], normal[inside], hessian[inside] = self._spline(y[inside])
        g[~inside], normal[~inside], hessian[~inside] = self.mesh.gap(x[~inside])
        return g, normal, hessian

    @cached_property
    def vertex_error(self) -> float:
        """Largest |g| [m] of the mesh's own corners inside the box; NaN if there are none."""
        y = self.pose.to_pad(self.mesh.points)
        y = y[self._covers(y)]
        return float(np.abs(self._spline(y)[0]).max()) if len(y) else np.nan

    @cached_property
    def centre_error(self) -> float:
        """Largest difference [m] to the distance itself at centres of cells within two steps of the surface."""
        near = np.argwhere(np.abs(self.samples[:-1, :-1, :-1]) < 2 * self.grid_step)
        y = self.first + self.grid_step * (near[:: 1 + len(near) // MOST_CENTRES] + 0.5)
        y = y[self._covers(y)]
        if not len(y):
            return np.nan
        return float(np.abs(self._spline(y)[0] - self.mesh.distance(self.pose.to_object(y))).max())

    def _covers(self, y: FloatArray) -> np.ndarray:
        """Whether points of the pad's frame lie in the box, ``(n,)``."""
        return ((y >= self.lower) & (y <= self.upper)).all(axis=1)

    def _spline(self, y: FloatArray) -> Gap:
        """Interpolation at points ``y (n, 3)`` of the pad's frame, turned into the object's frame."""
        R = self.pose.rotation
        g, gradient, hessian = evaluate(self.coefficients, self.first, self.grid_step, np.ascontiguousarray(y))
        return g, gradient @ R.T, R @ hessian @ R.T
