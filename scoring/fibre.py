"""What one soft contact adds to the volume of a grasp of two, seen along the plane T in which their spans meet.

The contact's cone is ``K = conv(0, N + E)`` in its span of 4 dimensions, and U is the plane of the span across T.
For every u of U the fibre ``{t in T : t + u in K}`` is a convex figure; their integral over U is the figure S. Only
its sides matter. The sides of a fibre lie in the facets of K, so the side of S with a given normal collects, from all
facets whose normal has that part in T, volume times length of that part (coarea formula): the sides of S are the parts
in T of the facets' normals, each as long as its facet is large. The facets are the base ``N + E`` and the cones over
the pieces of the surface of E. In coordinates ``(l, e)`` of normal force and load a triangle (a, b, c) of that surface
has the normal ``(-det(a, b, c), (b - a) x (c - a)) / 6``, and maps turn normals by their cofactors.

For an ellipsoid, image of the unit ball under A, that is ``(P v - c) / 3`` per area at the point v of the unit sphere.
P has rank 2, so only the part of v in a plane counts, where the sphere has the density ``2 / sqrt(1 - |v|^2)``
(Archimedes) on the disc. All depends on one number, the distance ``rho`` at which ``P v0 = c``. With ``rho >= 1`` the
boundary of S is a curve in closed form, with ``rho < 1`` its density over the angle about v0 is.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from softjaw.scoring.contact import Body, FloatArray, ellipsoid_matrix, fibonacci_vertices, hull_volume, vertices_of

IntArray = NDArray[np.intp]


MIN_SINGULAR_VALUE = 1e-200  # instead of a singular value 0
MIN_THICKNESS = 1e-9  # of the longest extent, which flat ellipsoids are given so that their rims have normals
HULL_THICKNESS = 1e-6  # the same of flat hulls, whose normals are differences of points


@dataclass(frozen=True, eq=False)
class Span:
    """A contact's span: wrench map ``C (6, 4)``, orthonormal bases ``T (6, 2)`` of T and ``U (6, 2)`` across T."""

    C: FloatArray
    T: FloatArray
    U: FloatArray

    @cached_property
    def M(self) -> FloatArray:
        """Shadow along T of ``(l, e)``, ``(2, 4)``."""
        return self.U.T @ self.C

    @cached_property
    def det(self) -> float:
        """Volume in the span per volume in ``(l, e)``."""
        return abs(float(np.linalg.det(np.hstack([self.T, self.U]).T @ self.C)))

    @cached_property
    def facet_map(self) -> FloatArray:
        """Part in T of a facet's normal given in ``(l, e)``, ``(2, 4)``."""
        return self.det * np.linalg.inv(np.hstack([self.T, self.U]).T @ self.C)[:, :2].T


class EllipsoidFibre:
    """Parts of an ellipsoid in closed form; only the sides are divided into ``128 * 2**level`` pieces."""

    exact = False
    finest = 7
    error_share = 0.0  # part of what extrapolation adds to the finest level that is taken for its error at least

    def __init__(self, A: FloatArray, span: Span) -> None:
        axes, vectors = np.linalg.eigh(A)
        self.W, self.c, self.v0, _ = _disc(axes, vectors, span.facet_map)
        self.rho = math.hypot(*self.v0)
        self.axes, self.vectors, self.facet_map = axes, vectors, span.facet_map
        self.shadow_map, self.centre = span.M[:, 1:] @ A, span.M[:, 0]
        self.volume = math.pi / 3 * float(axes.prod()) * span.det

    @cached_property
    def rim(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The disc for `ridge`: the rim of a flat body has normals only as the limit of thin ones."""
        return _disc(np.maximum(self.axes, MIN_THICKNESS * self.axes[2]), self.vectors, self.facet_map)

    def measures(self, level: int) -> tuple[float, float]:
        """Volume of the cone K and area of its shadow along T, the hull of an ellipse and 0."""
        W, s, _ = np.linalg.svd(self.shadow_map)
        d = s[0] * s[1]
        b = math.hypot(*(W.T @ self.centre * s[::-1]))
        # Outside the ellipse two tangents from 0 close the figure.
        area = math.pi * d if b <= d else math.sqrt(b * b - d * d) + d * (math.pi - math.acos(d / b))
        return self.volume, area

    def base(self, level: int) -> FloatArray:
        """The side of S that comes from the cone's base, whose volume is ``4/3 pi det A``, ``(2,)``."""
        return 4 / 3 * math.pi * self.c

    def sides(self, level: int, split: FloatArray) -> FloatArray:
        """Sides of S from the cone's flank ``(m, 2)``; no piece mixes both sides of the line ``split``."""
        return self._inside(level, split) if self.rho < 1 else self._outside(level, split)

    def _inside(self, level: int, split: FloatArray) -> FloatArray:
        """Integral of ``2 t^2 / (3 sqrt(1 - |v0 + t e|^2))`` along each ray from v0."""
        n = 128 << level
        turned = np.linalg.solve(self.W, split) if abs(np.linalg.det(self.W)) > 0 else np.array([1.0, 0.0])
        # steps begin at the line, so that no piece lies on both sides of it
        phi = math.atan2(turned[1], turned[0]) + (np.arange(n) + 0.5) * 2 * math.pi / n
        e = np.column_stack([np.cos(phi), np.sin(phi)])
        t = -e @ self.v0
        # rounding may take the square below 0 where rho is near 1
        w = np.sqrt(np.maximum(1 - self.rho**2 + t**2, 1e-300))
        q = math.sqrt(1 - self.rho**2)
        f = (t**2 + w**2 / 2) * (math.pi / 2 + np.arcsin(np.clip(t / w, -1, 1))) + 1.5 * t * q
        return (2 / 3 * f * 2 * math.pi / n)[:, None] * (e @ self.W.T)

    def _outside(self, level: int, split: FloatArray) -> FloatArray:
        """Steps of the curve, ``xi`` being ``rho`` times the sine of the angle at v0."""
        beta, e = 1 / self.rho, self.v0 / self.rho
        across = self.W @ np.array([-e[1], e[0]])
        psi = np.linspace(-math.pi / 2, math.pi / 2, (128 << level) + 1)
        crossing = _cross(across, split)
        if crossing != 0:
            g = _cross(self.c, split) / crossing
            xi = g / math.sqrt(1 + (beta * g) ** 2)
            # a piece across the line would count on one side of it as a whole
            if abs(xi) < 1:
                psi = np.sort(np.append(psi, math.asin(xi)))
        xi, rest = np.sin(psi), np.cos(psi) ** 2
        s = np.sqrt(1 - (beta * xi) ** 2)
        along = (2 + beta**2) * xi - beta**2 * xi**3
        # differences of the curve itself sum to the chord between its ends, however coarse the steps
        return -math.pi / 3 * np.diff(np.outer(along, self.c) + np.outer(s * rest, across), axis=0)

    def ridge(self, level: int, away: FloatArray) -> float:
        """Area in U of the points below the edge of the flank that is farthest in the direction ``away``.

        It is swept by the circle of the sphere on which ``P v - c`` has that direction.
        """
        W, _, v0, sphere = self.rim
        w = np.linalg.solve(W, away)
        w = w / math.hypot(*w)
        nearest = _cross(w, v0)
        if abs(nearest) >= 1:
            return 0.0
        r, first = math.sqrt(1 - nearest**2), float(v0 @ w)
        if first >= r:
            return 0.0
        psi = math.pi if first <= -r else math.acos(first / r)
        ends = np.array([w, [-w[1], w[0]]]) @ sphere[:2]
        centre = self.shadow_map @ (nearest * ends[1]) + self.centre
        a, b = r * self.shadow_map @ ends[0], r * self.shadow_map @ sphere[2]
        # Twice the area, 0 to arc: (m + a cos + b sin) x d(a cos + b sin).
        return 0.5 * abs(2 * psi * _cross(a, b) + 2 * math.sin(psi) * _cross(centre, b))


def _disc(
    axes: FloatArray, vectors: FloatArray, F: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """``P`` as a map W of a plane of the ball, c, v0 in that plane, and the plane's axes with the one across it."""
    # pairs of axes instead of determinant times inverse, which a flat ellipsoid does not have
    cofactor = (vectors * [axes[1] * axes[2], axes[0] * axes[2], axes[0] * axes[1]]) @ vectors.T
    W, s, sphere = np.linalg.svd(F[:, 1:] @ cofactor)
    s = np.maximum(s, MIN_SINGULAR_VALUE)
    c = float(axes.prod()) * F[:, 0]
    return W * s, c, (W.T @ c) / s, sphere


class HullFibre:
    """Parts of a polytope; of any other body those of hulls of its support points, ``20 * 4**level`` of them.

    The hulls lie inside the body, so their volumes are too small, in proportion to 1 over the number of points.
    """

    error_share = 0.5

    def __init__(self, body: Body, span: Span) -> None:
        self.body, self.span = body, span
        self.exact = vertices_of(body) is not None
        self.finest = 7 if self.exact else 5
        self.meshes: dict[int, tuple[FloatArray, IntArray, FloatArray]] = {}

    def _mesh(self, level: int) -> tuple[FloatArray, IntArray, FloatArray]:
        """Points, corners of the triangles and the sides they make."""
        # the faces of a polytope are exact at any level
        level = 0 if self.exact else level
        if level not in self.meshes:
            points, triangles = hull_mesh(inner_points(self.body, 20 * 4**level))
            a, b, c = (points[triangles[:, i]] for i in range(3))
            det = np.einsum("mi,mi->m", a, np.cross(b, c))
            self.meshes[level] = points, triangles, np.column_stack([-det, np.cross(b - a, c - a)]) / 6
        return self.meshes[level]

    def measures(self, level: int) -> tuple[float, float]:
        """Volume of the cone from the triangles, its shadow from the points."""
        points, _, normals = self._mesh(level)
        # a cone of four dimensions has a quarter of base times height, and the normal force goes to 1
        volume = -self.span.det * normals[:, 0].sum() / 4
        M = self.span.M
        return volume, hull_volume(np.vstack([points @ M[:, 1:].T + M[:, 0], np.zeros((1, 2))]))

    def base(self, level: int) -> FloatArray:
        """The base has the volume of the body."""
        return -self._mesh(level)[2][:, 0].sum() * self.span.facet_map[:, 0]

    def sides(self, level: int, split: FloatArray) -> FloatArray:
        """One side per triangle."""
        return self._mesh(level)[2] @ self.span.facet_map.T

    def ridge(self, level: int, away: FloatArray) -> float:
        """Sum over the edges where the triangles' sides pass the direction ``away``."""
        points, triangles, _ = self._mesh(level)
        n = self.sides(level, away)
        x, y = n @ away, n @ np.array([-away[1], away[0]])
        edges = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        # an edge of a closed mesh has two triangles, which follow each other once sorted
        order = np.lexsort(np.sort(edges, axis=1).T)
        i, j = order[0::2] % len(triangles), order[1::2] % len(triangles)
        between = ((y[i] < 0) != (y[j] < 0)) & ((x[i] * y[j] - x[j] * y[i]) * (y[j] - y[i]) > 0)
        v = points @ self.span.M[:, 1:].T + self.span.M[:, 0]
        a, b = np.moveaxis(v[edges[order[0::2]][between]], 1, 0)
        # with signs, so that what slivers without a normal add on one side they take away on the other
        return 0.5 * abs(float(np.where(y[i][between] < 0, 1, -1) @ (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])))


Fibre = EllipsoidFibre | HullFibre


def fibre_of(body: Body, span: Span) -> Fibre:
    """Closed form for ellipsoids, hulls for other bodies."""
    A = ellipsoid_matrix(body)
    return HullFibre(body, span) if A is None else EllipsoidFibre(A, span)


def _cross(a: FloatArray, b: FloatArray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def inner_points(body: Body, count: int) -> FloatArray:
    """Vertices of a polytope; of any other body its ``count`` farthest points in directions all around, ``(k, 3)``."""
    if (vertices := vertices_of(body)) is not None:
        return vertices
    reach = body.support(np.eye(3))
    points = body.support_points(fibonacci_vertices(1 / np.where(reach > 0, reach, 1.0), 320))
    # directions that are even where the body is round
    _, size, axes = np.linalg.svd(points, full_matrices=False)
    return body.support_points(fibonacci_vertices(1 / np.maximum(size, HULL_THICKNESS * size[0]), count) @ axes)


def hull_mesh(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """Points and triangles ``(m, 3)`` of their hull, seen anticlockwise from outside.

    Points of a plane or a line get some more beside their centre, so that the hull has two sides.
    """
    centre, n = points.mean(axis=0), len(points)
    _, size, axes = np.linalg.svd(np.vstack([points - centre, np.zeros((3, 3))]), full_matrices=False)
    flat = size <= HULL_THICKNESS * size[0]
    size = np.maximum(size, HULL_THICKNESS * size[0])
    beside = np.concatenate([sign * (axes * size[:, None])[flat] / math.sqrt(n) for sign in (-1, 1)])
    points = np.vstack([points, centre + beside])
    # Qhull loses facets of points that are much longer than wide; joggled, many points of a plane take no time
    hull = ConvexHull((points - centre) @ axes.T / size, qhull_options="QJ" if flat.any() else "Qt")
    triangles = hull.simplices.astype(np.intp)
    a, b, c = (hull.points[triangles[:, i]] for i in range(3))
    inward = np.einsum("mi,mi->m", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    # axes that make a left-handed frame turn the triangles round
    turned = inward == (np.linalg.det(axes) > 0)
    triangles[turned] = triangles[turned][:, ::-1]
    return points, triangles
