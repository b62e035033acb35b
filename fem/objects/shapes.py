"""Rigid objects as gap functions: signed distance with gradient and Hessian, SI units, axis along z.

The closed shapes here are centred on the origin; a surface of revolution keeps the heights of its profile and a mesh
starts at z = 0.
"""

from dataclasses import dataclass

import numpy as np

from softjaw.fem.objects.gap import Analytic, Gap, GapFunction, GapObject, Surface, grid_triangles, radial
from softjaw.fem.objects.revolution import Revolution, closest
from softjaw.friction.patch import FloatArray

__all__ = ["Box", "EllipticCylinder", "GapFunction", "GapObject", "Plane", "Revolution", "Sphere"]

SLAB_HALF_EXTENT = 0.1  # how far a slab is drawn along y and z [m]


@dataclass(frozen=True)
class Plane(Analytic):
    """Slab ``|x| <= thickness / 2`` without end along y and z."""

    thickness: float

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m], normal ``(n, 3)`` and Hessian ``(n, 3, 3)`` (zero)."""
        normal = np.zeros((len(x), 3))
        # the middle plane has to belong to one side: a sign of zero would be no normal
        normal[:, 0] = np.where(x[:, 0] < 0, -1.0, 1.0)
        return np.abs(x[:, 0]) - self.thickness / 2, normal, np.zeros((len(x), 3, 3))

    @property
    def bounds(self) -> FloatArray:
        """Corners ``(2, 3)`` [m] of the part that is drawn."""
        corner = np.array([self.thickness / 2, SLAB_HALF_EXTENT, SLAB_HALF_EXTENT])
        return np.stack([-corner, corner])

    def surface(self) -> Surface:
        """Points and triangles of the part that is drawn."""
        return Box(2 * self.bounds[1], 0.0).surface()


@dataclass(frozen=True)
class Sphere(Analytic):
    """Sphere about the origin."""

    radius: float

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m], normal ``(n, 3)`` and Hessian ``(n, 3, 3)`` [1/m]."""
        r, e, H = radial(np.asarray(x, dtype=float))
        return r - self.radius, e, H

    @property
    def bounds(self) -> FloatArray:
        """Corners ``(2, 3)`` [m]."""
        return self.radius * np.array([[-1.0] * 3, [1.0] * 3])

    def surface(self) -> Surface:
        """Points and triangles of a net of latitudes and longitudes."""
        t, phi = np.meshgrid(np.linspace(0, np.pi, 49), np.linspace(0, 2 * np.pi, 60, endpoint=False), indexing="ij")
        e = np.stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), -np.cos(t)], axis=-1)
        return self.radius * e.reshape(-1, 3), grid_triangles(49, 60, closed=True)


@dataclass(frozen=True)
class EllipticCylinder(Analytic):
    """Cylinder about z with semi-axes ``a`` along x and ``b`` along y, ``length`` long from cap to cap.

    Flat caps meet the wall in a rounded edge, which is a tube round the curve that runs parallel to the ellipse inside
    it: all distances are exact, outside and inside. The curvature jumps where wall and cap meet the edge.

    ``a, b, length`` [m]; ``rim``: radius of the rounding [m]; at most half the ellipse's smallest radius of curvature
    and a quarter of the length are taken.
    """

    a: float
    b: float
    length: float
    rim: float = 0.002

    @property
    def edge_radius(self) -> float:
        """Radius of the rounding at both ends [m]."""
        return min(self.rim, 0.5 * min(self.a, self.b) ** 2 / max(self.a, self.b), 0.25 * self.length)

    @property
    def _wall(self) -> float:
        """Half the length of the straight wall [m]."""
        return 0.5 * self.length - self.edge_radius

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m], normal ``(n, 3)`` and Hessian ``(n, 3, 3)`` [1/m]."""
        x = np.asarray(x, dtype=float)
        g, n, H = closest().ellipse_gap(x, float(self.a), float(self.b))
        normal, hessian = np.zeros((len(x), 3)), np.zeros((len(x), 3, 3))
        normal[:, :2], hessian[:, :2, :2] = n, H
        beyond = np.abs(x[:, 2]) - self._wall
        # caps and edges take the place of the wall, but for points inside that are no farther from it than from the cap
        pick = ~((beyond <= 0) & (g >= beyond - self.edge_radius))
        if not pick.any():  # as mostly under a pad
            return g, normal, hessian
        r, up = self.edge_radius, np.zeros((pick.sum(), 3))
        up[:, 2] = np.where(x[pick, 2] < 0, -1.0, 1.0)
        q = np.stack([g[pick] + r, beyond[pick]], axis=1)  # from the middle of the tube, outwards and up
        tube = (q > 0).all(axis=1)[:, None, None]
        distance, e, H = radial(q)
        directions = np.stack([normal[pick], up], axis=1)
        # the tube's own curvature, and the ellipse's as far as the normal leans outwards
        bent = e[:, :1, None] * hessian[pick] + np.einsum("nia,nij,njb->nab", directions, H, directions)
        g[pick] = np.where(tube[:, 0, 0], distance, q[:, 1]) - r
        normal[pick] = np.where(tube[:, 0], np.einsum("ni,nia->na", e, directions), up)
        hessian[pick] = np.where(tube, bent, 0.0)
        return g, normal, hessian

    @property
    def bounds(self) -> FloatArray:
        """Corners ``(2, 3)`` [m]."""
        corner = np.array([self.a, self.b, self.length / 2])
        return np.stack([-corner, corner])

    def surface(self) -> Surface:
        """Points and triangles: ellipses along the wall, the curves parallel to them on the edges, and the caps."""
        phi, r = np.linspace(0.0, np.pi / 2, 7), self.edge_radius
        t = np.linspace(0, 2 * np.pi, 96, endpoint=False)
        ellipse = np.stack([self.a * np.cos(t), self.b * np.sin(t)], axis=-1)
        normal = np.stack([self.b * np.cos(t), self.a * np.sin(t)], axis=-1)
        normal *= r / np.linalg.norm(normal, axis=1)[:, None]
        ends = [np.insert(ellipse - (1 - np.cos(p)) * normal, 2, self._wall + r * np.sin(p), axis=1) for p in phi]
        top = np.stack([*ends[1:], np.broadcast_to([0.0, 0.0, self.length / 2], (96, 3))])
        wall = [np.insert(ellipse, 2, z, axis=1) for z in np.linspace(-1.0, 1.0, 25) * self._wall]
        points = np.concatenate([top[::-1] * [1, 1, -1], wall, top])
        return points.reshape(-1, 3), grid_triangles(len(points), 96, closed=True)


@dataclass(frozen=True, eq=False)
class Box(Analytic):
    """Box about the origin whose edges and corners are rounded with ``edge_radius``.

    The distance to the box that is smaller by the radius on every side, minus the radius: exact outside and inside.
    The curvature jumps where a flat side meets its rounded edge; with radius 0 the normal jumps at the edges, too.
    """

    size: FloatArray
    edge_radius: float

    def gap(self, x: FloatArray) -> Gap:
        """Signed distance ``(n,)`` [m], normal ``(n, 3)`` and Hessian ``(n, 3, 3)`` [1/m]."""
        sign = np.where(x < 0, -1.0, 1.0)
        q = np.abs(x) - (self.size / 2 - self.edge_radius)
        inside = (q <= 0).all(axis=1)
        r, e, H = radial(np.maximum(q, 0.0))
        active = (q > 0).astype(float)
        H *= active[:, :, None] * active[:, None, :]
        nearest = np.eye(3)[q.argmax(axis=1)]
        g = np.where(inside, q.max(axis=1), r) - self.edge_radius
        normal = sign * np.where(inside[:, None], nearest, e)
        return g, normal, H * sign[:, :, None] * sign[:, None, :]

    @property
    def bounds(self) -> FloatArray:
        """Corners ``(2, 3)`` [m]."""
        return np.stack([-self.size / 2, self.size / 2])

    def surface(self) -> Surface:
        """Points and triangles: the sides of the sharp box, drawn towards the smaller box by the radius."""
        h, core = self.size / 2, self.size / 2 - self.edge_radius
        points, triangles, count = [], [], 0
        for axis in range(3):
            j, k = (axis + 1) % 3, (axis + 2) % 3
            u, v = (_refined_to_the_rim(h[i], core[i]) for i in (j, k))
            for side in (-1.0, 1.0):
                p = np.empty((len(u), len(v), 3))
                p[..., axis], p[..., j], p[..., k] = side * h[axis], u[:, None], v[None, :]
                points.append(p.reshape(-1, 3))
                triangles.append(grid_triangles(len(u), len(v))[:, :: -int(side)] + count)
                count += len(points[-1])
        x = np.concatenate(points)
        base = np.clip(x, -core, core)
        d = x - base
        if self.edge_radius > 0:
            x = base + self.edge_radius * d / np.linalg.norm(d, axis=1)[:, None]
        return x, np.concatenate(triangles)


def _refined_to_the_rim(h: float, core: float) -> FloatArray:
    """Places from -h to h: an even run over the flat part and eight steps, even in angle, over each rounding."""
    rim = core + (h - core) * np.tan(np.linspace(0, np.pi / 4, 9))
    return np.unique(np.concatenate([-rim, np.linspace(-core, core, 13), rim]))
