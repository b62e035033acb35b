"""Volume of the grasp wrench space of any number of soft contacts, from how far it reaches along many rays.

The hull of some hundred wrenches on the surface is a polytope inside the space; its volume is a lower bound, up to the
1e-6 that Qhull may have to move points. Rays from an inner point p, spread evenly over the volume of the polytope, go
on beyond it by a factor s, and the space is ``mean(s^6)`` times as large. The rays are no random sample (Kronecker
sequence of the generalised golden ratio), but the error is stated as if they were. The reach r along ``w`` is the least
``h(u) - p . u`` over ``u . w = 1``, h the support function of the space: for ellipsoids a small programme over Lorentz
cones, solved for all rays at once (`scoring.conic`).

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

from softjaw.scoring.boundary import ellipsoid_matrix, sphere_mesh, touching_points
from softjaw.scoring.conic import cone_programme
from softjaw.scoring.contact import Body, SoftContact

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
    if kind not in ("linf", "l1"):
        raise ValueError(f"kind is {kind!r}: take 'linf' or 'l1'")
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
    near = [_nearest(body) if A is None else A for A, body in zip(ellipsoids, bodies, strict=True)]
    D = np.array([A @ Ci[:, 1:].T for A, Ci in zip(near, C, strict=True)])
    length = np.linalg.norm(ends, axis=1)
    u = _facing(C[:, :, 0], D, p, ends / length[:, None], kind)
    gain = (np.maximum((_support(C, bodies, u, kind) - u @ p) / length, 1)) ** 6
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
        beyond = V * ((_support(C, bodies, normals, kind) - normals @ p) / reach - 1)
        best = np.argsort(-beyond)[: min(len(points) // 3, corners - len(points))]
        points = np.vstack([points, _extreme(C, bodies, normals[best], kind)])


def _filling(facets: FloatArray, rays: int) -> FloatArray:
    """Rays to the facets that fill the polytope evenly, ``(m, 6)``."""
    share = np.cumsum(np.abs(np.linalg.det(facets)))
    facet = np.searchsorted(share, (np.arange(rays) + 0.5) / rays * share[-1])
    weight = -np.log(_even(rays))
    return np.einsum("mk,mkd->md", weight / weight.sum(axis=1, keepdims=True), facets[facet])


def _even(m: int) -> FloatArray:
    """Points ``(m, 6)`` of the unit cube, evenly spread."""
    return (0.5 + np.arange(1, m + 1)[:, None] * GOLDEN ** -np.arange(1, 7.0)) % 1


def _directions(m: int) -> FloatArray:
    """Unit vectors ``(m, 6)``, evenly spread."""
    x = ndtri(_even(m))
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def _support(C: FloatArray, bodies: Sequence[Body], u: FloatArray, kind: str) -> FloatArray:
    h = np.array([(f := u @ Ci)[:, 0] + body.support(f[:, 1:]) for Ci, body in zip(C, bodies, strict=True)])
    h = np.maximum(h, 0)
    return h.max(axis=0) if kind == "l1" else h.sum(axis=0)


def _extreme(C: FloatArray, bodies: Sequence[Body], u: FloatArray, kind: str) -> FloatArray:
    """Wrenches of the space that are farthest along each ``u``, ``(m, 6)``."""
    w = np.array(
        [Ci[:, 0] + touching_points(body, u @ Ci[:, 1:]) @ Ci[:, 1:].T for Ci, body in zip(C, bodies, strict=True)]
    )
    h = np.einsum("nmi,mi->nm", w, u)
    chosen = h > 0
    if kind == "l1":
        chosen &= np.arange(len(C))[:, None] == h.argmax(axis=0)
    return np.where(chosen[:, :, None], w, 0.0).sum(axis=0)


def _rounded(C: FloatArray, bodies: Sequence[Body], kind: str) -> tuple[FloatArray, float]:
    """Wrench maps in coordinates in which the space is about round, and the volume of their unit; 0 if it is flat."""
    loads = np.hstack([Ci * np.append(1.0, body.support(np.eye(3))) for Ci, body in zip(C, bodies, strict=True)])
    size = np.linalg.norm(loads, axis=1)
    if (size <= FLAT * size.max()).any():
        return C, 0.0
    axes, s, _ = np.linalg.svd(loads / size[:, None])
    if len(s) < 6 or s[5] <= FLAT * s[0]:
        return C, 0.0
    det = 1.0
    for L in (size[:, None] * axes * s, None, None):
        if L is None:
            L = np.linalg.cholesky(np.cov(_extreme(C, bodies, _directions(512), kind).T))
        C, det = np.linalg.solve(L, C), det * abs(float(np.linalg.det(L)))
    return C, det


def _nearest(body: Body) -> FloatArray:
    """Root ``(3, 3)`` of the quadratic form that fits the squared support best on evenly spread directions."""
    reach = body.support(np.eye(3))
    scale = 1 / np.where(reach > 0, reach, 1.0)
    t = sphere_mesh(2)[0]
    i, j = np.triu_indices(3)
    h = (body.support(t * scale) + body.support(-t * scale)) / 2
    fit = np.linalg.lstsq(t[:, i] * t[:, j] / h.max() ** 2, (h / h.max()) ** 2, rcond=None)[0]
    B = np.zeros((3, 3))
    B[i, j] += fit / 2
    B[j, i] += fit / 2
    values, vectors = np.linalg.eigh(B / np.outer(scale, scale))
    return (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T


def _facing(c: FloatArray, D: FloatArray, p: FloatArray, w: FloatArray, kind: str) -> FloatArray:
    """Normals ``u``, ``u . w = 1``, of the space of ellipsoids where the rays from p leave it, ``(m, 6)``."""
    n, k = len(c), 1 if kind == "l1" else len(c)
    # Unknowns (u, s, q): s_i >= c_i u + |D_i u|, s_i >= 0, q >= -p u; the least sum of s and q is the reach.
    L = np.zeros((n + k + 1, 4, 7 + k))
    L[:n, 0, :6], L[:n, 1:, :6] = -c, D
    L[np.arange(n), 0, 6 + np.arange(n) % k] = 1
    L[n + np.arange(k), 0, 6 + np.arange(k)] = 1
    L[-1, 0, :6], L[-1, 0, -1] = p, 1
    h = w @ c.T + np.linalg.norm(np.einsum("iad,md->mia", D, w), axis=2)
    size = np.abs(h).max(axis=1, keepdims=True) + np.abs(w @ p)[:, None]
    s = np.maximum(h, 0)
    v0 = np.hstack([w, (s.max(axis=1, keepdims=True) if k == 1 else s) + size, size - (w @ p)[:, None]])
    B = np.zeros((len(w), 7 + k, 6 + k))
    B[:, :6, :5], B[:, 6:, 5:] = _across(w), np.eye(k + 1)
    cost = np.concatenate([np.zeros(5), np.ones(k + 1)])
    G, h0 = -np.einsum("iad,mde->miae", L, B), np.einsum("iad,md->mia", L, v0)
    x = cone_programme(cost, G, h0, GAP * size[:, 0])[0]
    return w + np.einsum("mde,me->md", B, x)[:, :6]


def _across(w: FloatArray) -> FloatArray:
    """Orthonormal columns across each unit vector, ``(m, 6, 5)``: the reflection that turns it to the first axis."""
    a = w.copy()
    a[:, 0] += np.copysign(1, a[:, 0])
    return (np.eye(6) - 2 * a[:, :, None] * a[:, None, :] / (a * a).sum(axis=1)[:, None, None])[:, :, 1:]
