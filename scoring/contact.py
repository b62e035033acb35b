"""A soft contact somewhere on the object: where it presses, and its limit surface, the loads it can carry.

Limit surfaces are any bodies: polytopes, ellipsoids, and the ellipsoids that other bodies hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ROUNDING_SHARE = 1e-12  # of the largest number of its kind: an extent, a load or an arm below it is the rounding of 0


class Body(Protocol):
    """Limit surface in ``(f_x, f_y, tau_z)`` per unit normal force, with 0 inside or on it.

    A body that has ``vertices (k, 3)`` counts as their hull, one that has ``F (3, r)`` as the image of the unit ball
    under that map, an ellipsoid about 0. One that is ``sampled`` has a volume that is not exact. A payload also takes
    one that has ``discs (n, 6)`` and nothing else, which is their sum.
    """

    @property
    def volume(self) -> float:
        """Volume."""

    @property
    def shadow_area(self) -> float:
        """Area of the shadow on the first two coordinates."""

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, 3) -> (m,)``."""

    def support_points(self, t: ArrayLike) -> FloatArray:
        """A point of the body that is farthest in each direction, ``(m, 3) -> (m, 3)``; 0 for no direction."""


@dataclass(frozen=True, eq=False)
class PolytopeBody:
    """Hull of wrenches, such as samples of a limit surface or the vertices of a linearised one.

    ``vertices (k, 3)`` are ``(f_x, f_y, tau_z)`` per unit normal force [-, -, m]; 0 must not lie outside.
    """

    vertices: FloatArray

    @cached_property
    def volume(self) -> float:
        """Volume of the hull."""
        return hull_volume(self.vertices)

    @cached_property
    def shadow_area(self) -> float:
        """Area of the hull's shadow on the plane of the forces."""
        return hull_volume(self.vertices[:, :2])

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, 3) -> (m,)``."""
        return (np.atleast_2d(np.asarray(t, float)) @ self.vertices.T).max(axis=1)

    def support_points(self, t: ArrayLike) -> FloatArray:
        """A vertex that is farthest in each direction, ``(m, 3) -> (m, 3)``."""
        return self.vertices[(np.atleast_2d(np.asarray(t, float)) @ self.vertices.T).argmax(axis=1)]

    def scaled(self, factors: ArrayLike) -> PolytopeBody:
        """Image of the hull under ``w -> factors * w``."""
        return PolytopeBody(self.vertices * np.asarray(factors, float))


class DiscBody(NamedTuple):
    """Sum of ``discs (n, 6)``, two half-axes of each in ``(f_x, f_y, tau_z)``, such as the limit surface of faces."""

    discs: FloatArray


def vertices_of(body: Body) -> FloatArray | None:
    """Vertices ``(k, 3)`` of a polytope, None of any other body."""
    vertices = getattr(body, "vertices", None)
    return None if vertices is None else np.asarray(vertices, float)


def discs_of(body: Body) -> FloatArray | None:
    """Discs ``(n, 6)`` of a body that is their sum, two half-axes ``(3,)`` of each; None of any other body."""
    return getattr(body, "discs", None)


def ball_map(body: Body) -> FloatArray | None:
    """Map ``(3, 3)`` of the unit ball onto an ellipsoid; None of any other body."""
    F = getattr(body, "F", None)
    return None if F is None else np.hstack([F, np.zeros((3, 3 - F.shape[1]))])


def ellipsoid_matrix(body: Body) -> FloatArray | None:
    """Symmetric ``A (3, 3)`` such that the body is the image of the unit ball under it; None if it is no ellipsoid."""
    if (F := ball_map(body)) is None:
        return None
    V, axes, _ = np.linalg.svd(F)
    return (V * axes) @ V.T


def ellipsoid_inside(body: Body) -> FloatArray:
    """Root ``A (3, 3)`` of an ellipsoid inside the body: ``|A t| <= support(t)``, with equality if it is one.

    Otherwise it has the proportions of the body's semi-axes. Its size follows from the support on a few thousand
    directions, less what a support function can fall between them, 2 to 4 % of its largest value.
    """
    if (F := ball_map(body)) is not None:
        return F.T
    ends = body.support(np.vstack([np.eye(3), -np.eye(3)]))
    axes = (ends[:3] + ends[3:]) / 2
    # a flat body holds no ellipsoid of three axes; a point keeps the bound true
    if (axes <= 0).any():
        return np.zeros((3, 3))
    # between samples a support of the even body falls by no more than the distance times its largest value
    h = body.support(fibonacci_vertices(np.ones(3), 6000) / axes)
    spacing = 2.8 / np.sqrt(len(h))  # no direction is farther than this from the nearest of the Fibonacci points
    return np.diag(axes * max(h.min() - spacing * h.max() / (1 - spacing), 0))


def joint_support(C: FloatArray, bodies: Sequence[Body], u: FloatArray, kind: str) -> FloatArray:
    """Support ``(m,)`` of the grasp wrench space of contacts ``C (n, r, 4)`` along ``u (m, r)``; kind: `joined`."""
    felt = np.einsum("mr,irc->imc", u, C)
    h = np.array([part[:, 0] + body.support(part[:, 1:]) for part, body in zip(felt, bodies, strict=True)])
    return joined(h, kind)


def joined(h: FloatArray, kind: str) -> FloatArray:
    """Supports ``(n, m)`` of the contacts for unit normal forces as one of the grasp; "linf" or "l1"."""
    # without a normal force a contact adds nothing, and can be let go where it would resist
    h = np.maximum(h, 0)
    return h.max(axis=0) if kind == "l1" else h.sum(axis=0)


def fibonacci_vertices(semi_axes: ArrayLike, m: int) -> FloatArray:
    """``m`` points spread evenly over the unit sphere and stretched to the ellipsoid, ``(m, 3)``."""
    i = np.arange(m)
    # equal steps of height cut a sphere into rings of equal area (Archimedes)
    z = 1 - (2 * i + 1) / m
    phi = i * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z]) * np.asarray(semi_axes, float)


def hull_volume(points: FloatArray) -> float:
    """Volume of the hull of points ``(m, d)``; 0 where they are thinner than `ROUNDING_SHARE` of their extent."""
    centred = points - points.mean(axis=0)
    _, extent, axes = np.linalg.svd(centred, full_matrices=False)
    # Qhull fails on flat points, and joggled ones would have a volume of rounding
    if len(points) <= points.shape[1] or extent[-1] <= ROUNDING_SHARE * extent[0]:
        return 0.0
    even = centred @ axes.T / extent  # Qhull loses facets of points that are much longer than wide
    try:
        return float(ConvexHull(even).volume * extent.prod())
    except QhullError:
        # Joggled input always gives a hull; its volume is off by 1e-6 to 1e-5.
        return float(ConvexHull(even, qhull_options="QJ").volume * extent.prod())


class SoftContact(NamedTuple):
    """A finger's contact with the object.

    ``position (3,)``: origin of the contact frame [m]; ``axes (3, 3)``: rows x, y, N: unit vectors of a right-handed
    frame; the finger presses along N, into the object; ``body``: limit surface in that frame, per unit normal force.
    """

    position: FloatArray
    axes: FloatArray
    body: Body

    def wrench_map(
        self, object_length: ArrayLike, contact_length: float, centre_of_mass: ArrayLike = (0.0, 0.0, 0.0)
    ) -> FloatArray:
        """Wrenches ``(6, 4)`` on the object of a unit normal force, ``f_x``, ``f_y`` and ``tau_z`` [-].

        ``object_length``, one or one along each of x, y and z, divides the arms of forces, ``contact_length`` the
        torque about the contact's normal [m]; torques are taken about ``centre_of_mass`` [m].
        """
        arm = (self.position - np.asarray(centre_of_mass, float)) / object_length
        x, y, N = self.axes
        C = np.zeros((6, 4))
        C[:3, :3] = F = np.array([N, x, y]).T
        # the arm times these; numpy's cross takes longer than all the rest
        C[3:, :3] = arm[1] * F[2] - arm[2] * F[1], arm[2] * F[0] - arm[0] * F[2], arm[0] * F[1] - arm[1] * F[0]
        C[3:, 3] = N / contact_length
        return C
