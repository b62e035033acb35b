"""Volume of the grasp wrench space of any number of soft contacts, from how far it reaches along many rays.

The hull of some hundred wrenches on the surface is a polytope inside the space; its volume is a lower bound, up to the
1e-6 that Qhull may have to move points. Rays from an inner point p, spread evenly over the volume of the polytope, go
on beyond it by a factor s, and the space is ``mean(s^6)`` times as large. The rays are no random sample (Kronecker
sequence of the generalised golden ratio), but the error is stated as if they were. The reach r along ``w`` is the least
``h(u) - p . u`` over ``u . w = 1``, h the support function of the space: for ellipsoids a small programme over Lorentz
cones, solved for all rays at once (`scoring.gauge`).

A body that is no ellipsoid is replaced by the nearest one to find each ray's u, and r is then taken from the body's own
support for this u: too large by what is quadratic in the body's distance from the ellipsoid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull
from scipy.special import ndtri

from softjaw.scoring.bodies import Body, check_kind, ellipsoid_matrix, ellipsoid_near, joint_support, touching_points
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.gauge import facing

FloatArray = NDArray[np.float64]


GOLDEN = 1.1347241384015194  # root of x^7 = x + 1
FLAT = 1e-12  # share of the largest component or direction up to which there are no wrenches along one
GAP = 1e-6  # of the reach at which the programmes stop


class RayVolume(NamedTuple):
    """Estimate of a volume, its relative standard error, a lower bound, and whether the estimate tends to be high."""

    volume: float
    relative_error: float
    lower: float
    high: bool


def ray_volume(
    contacts: Sequence[SoftContact],
    object_length: float,
    contact_length: float,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    kind: str = "linf",
    rays: int = 4096,
    corners: int = 300,
) -> RayVolume:
    """Volume of the grasp wrench space of two or more contacts.

    Parameters
    ----------
    contacts : sequence of SoftContact
        In any pose.
    object_length, contact_length : float
        Lengths by which arms and torques about the normals are divided [m].
    centre_of_mass : (3,) array
        Point about which torques are taken [m]; it changes the volume only within the error.
    kind : str
        "linf": every normal force is at most 1; "l1": their sum is.
    rays, corners : int
        Numbers of rays and of wrenches that make the polytope.

    Returns
    -------
    RayVolume
        Volume 0 if all wrenches lie in less than 6 dimensions; ``high`` if a body is no ellipsoid, see above.
    """
    check_kind(kind)
    if len(contacts) < 2 or rays < 1 or corners < 16:
        raise ValueError(
            f"{len(contacts)} contacts, {rays} rays, {corners} corners: take at least 2 contacts, 1 ray, 16 corners"
        )
    C = np.array([contact.wrench_map(object_length, contact_length, centre_of_mass) for contact in contacts])
    bodies = [contact.body for contact in contacts]
    C, det = _rounded(C, bodies, kind)
    if det == 0:
        return RayVolume(0.0, 0.0, 0.0, False)
    p, V, facets = _polytope(C, bodies, kind, corners)
    ends = _filling(facets, rays)
    ellipsoids = [ellipsoid_matrix(body) for body in bodies]
    near = [ellipsoid_near(body) if A is None else A for A, body in zip(ellipsoids, bodies, strict=True)]
    D = np.array([A @ Ci[:, 1:].T for A, Ci in zip(near, C, strict=True)])
    length = np.linalg.norm(ends, axis=1)
    u = facing(C[:, :, 0], D, ends / length[:, None], kind, GAP, p)[0]
    # the polytope lies inside, so a reach short of its end is rounding
    gain = (np.maximum((joint_support(C, bodies, u, kind) - u @ p) / length, 1)) ** 6
    mean = float(gain.mean())
    error = float(gain.std()) / mean / math.sqrt(rays)
    return RayVolume(V * mean * det, error, V * det, any(A is None for A in ellipsoids))


def _polytope(C: FloatArray, bodies: Sequence[Body], kind: str, corners: int) -> tuple[FloatArray, float, FloatArray]:
    """An inner point of a polytope inside the space, its volume, and its facets seen from there, ``(f, 6, 6)``."""
    points = _extreme(C, bodies, _directions(corners // 3), kind)
    while True:
        # Flat sides with many corners confuse Qhull; joggled input always gives a hull, some 1e-6 off.
        hull = ConvexHull(points, qhull_options="QJ")
        p = points[hull.vertices].mean(axis=0)
        facets = points[hull.simplices] - p
        V = np.abs(np.linalg.det(facets)) / 720
        if len(points) >= corners:
            return p, float(V.sum()), facets
        normals = hull.equations[:, :-1]
        reach = -hull.equations[:, -1] - normals @ p
        # new corners go where the space extends farthest beyond the facets: there the estimate varies most
        beyond = V * ((joint_support(C, bodies, normals, kind) - normals @ p) / reach - 1)
        best = np.argsort(-beyond)[: min(len(points) // 3, corners - len(points))]
        points = np.vstack([points, _extreme(C, bodies, normals[best], kind)])


def _filling(facets: FloatArray, rays: int) -> FloatArray:
    """Rays to the facets that fill the polytope evenly, ``(m, 6)``."""
    # facets count by volume, so that equal shares of rays fill equal volumes
    share = np.cumsum(np.abs(np.linalg.det(facets)))
    facet = np.searchsorted(share, (np.arange(rays) + 0.5) / rays * share[-1])
    # normalised exponential numbers are spread evenly over a simplex
    weight = -np.log(_even(rays))
    return np.einsum("mk,mkd->md", weight / weight.sum(axis=1, keepdims=True), facets[facet])


def _even(m: int) -> FloatArray:
    """Points ``(m, 6)`` of the unit cube, evenly spread."""
    return (0.5 + np.arange(1, m + 1)[:, None] * GOLDEN ** -np.arange(1, 7.0)) % 1


def _directions(m: int) -> FloatArray:
    """Unit vectors ``(m, 6)``, evenly spread."""
    x = ndtri(_even(m))
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def _extreme(C: FloatArray, bodies: Sequence[Body], u: FloatArray, kind: str) -> FloatArray:
    """Wrenches of the space that are farthest along each ``u``, ``(m, 6)``."""
    w = np.array(
        [Ci[:, 0] + touching_points(body, u @ Ci[:, 1:]) @ Ci[:, 1:].T for Ci, body in zip(C, bodies, strict=True)]
    )
    h = np.einsum("nmi,mi->nm", w, u)
    # a contact that would resist the direction is let go
    chosen = h > 0
    # where contacts share one normal force the best takes all of it
    if kind == "l1":
        chosen &= np.arange(len(C))[:, None] == h.argmax(axis=0)
    return np.where(chosen[:, :, None], w, 0.0).sum(axis=0)


def _rounded(C: FloatArray, bodies: Sequence[Body], kind: str) -> tuple[FloatArray, float]:
    """Wrench maps in coordinates in which the space is about round, and the volume of their unit; 0 if it is flat."""
    loads = np.hstack([Ci * np.append(1.0, body.support(np.eye(3))) for Ci, body in zip(C, bodies, strict=True)])
    size = np.linalg.norm(loads, axis=1)
    if (size <= FLAT * size.max()).any():
        return C, 0.0
    # rows of one size: the rank must not depend on the lengths
    axes, s, _ = np.linalg.svd(loads / size[:, None])
    if len(s) < 6 or s[5] <= FLAT * s[0]:
        return C, 0.0
    det = 1.0
    # twice by the covariance of extreme wrenches: the first frame is round for the loads, not for the space
    for L in (size[:, None] * axes * s, None, None):
        if L is None:
            L = np.linalg.cholesky(np.cov(_extreme(C, bodies, _directions(512), kind).T))
        C, det = np.linalg.solve(L, C), det * abs(float(np.linalg.det(L)))
    return C, det
