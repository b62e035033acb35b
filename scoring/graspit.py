"""The qualities of a grasp as GraspIt! computes them, from linearised contacts, and how far they are off.

GraspIt! (A. T. Miller and P. K. Allen 2004) puts 20 vertices on the limit surface of a soft contact, adds the normal
force to each, and takes the convex hull of all sums of one wrench, or none, per contact (L-infinity). Its volume and
the distance of its nearest facet are the qualities. Every vertex lies on the limit surface, so both are too small; more
vertices help slowly, and the hull in six dimensions soon takes minutes.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from softjaw.scoring.bodies import PolytopeBody, ellipsoid_inside, fibonacci_vertices, is_ellipsoid, vertices_of
from softjaw.scoring.contact import SoftContact

FloatArray = NDArray[np.float64]


MOST_POINTS = 2500  # the hull of more in six dimensions takes longer than some seconds


@dataclass(frozen=True)
class LinearisedScore:
    """Qualities of the linearised L-infinity grasp wrench space.

    Parameters
    ----------
    volume : float
        Volume of the hull [-].
    epsilon : float
        Distance of its nearest facet from 0 [-]; 0 if 0 is not an inner point.
    facets : int
        Number of its (triangulated) facets.
    joggled : bool
        Qhull gave up on the points as they are; they were moved by about 1e-6 of their size.
    """

    volume: float
    epsilon: float
    facets: int
    joggled: bool


def linearised_contacts(contacts: Sequence[SoftContact], m: int | None = None, unit: float = 1.0) -> list[SoftContact]:
    """The contacts with ``m`` Fibonacci vertices each, or GraspIt!'s 20, in place of their ellipsoids.

    GraspIt! pushes its vertices out radially, so they depend on the ``unit`` of length of the torques [m].
    """
    bodies = []
    for i, contact in enumerate(contacts):
        A = ellipsoid_inside(contact.body)
        axes = np.linalg.norm(A, axis=0)
        if not is_ellipsoid(contact.body) or np.abs(A.T @ A - np.diag(axes**2)).max() > 1e-12 * (axes @ axes):
            raise ValueError(f"contacts[{i}] has no ellipsoid along its axes: GraspIt!'s vertices are made for those")
        bodies.append(PolytopeBody(_graspit_vertices(axes, unit) if m is None else fibonacci_vertices(axes, m)))
    return [SoftContact(c.position, c.axes, body) for c, body in zip(contacts, bodies, strict=True)]


def graspit_score(
    contacts: Sequence[SoftContact],
    object_length: float,
    contact_length: float,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    m: int | None = None,
    unit: float = 1.0,
) -> LinearisedScore:
    """Volume and epsilon of a grasp with linearised contacts.

    Parameters
    ----------
    contacts : sequence of SoftContact
        Contacts with ellipsoidal bodies, or with polytopes, which are taken as they are.
    object_length, contact_length : float
        Lengths by which the torques of forces and those about the normals are divided [m]. GraspIt! takes the object's
        largest radius for both.
    centre_of_mass : (3,) array
        Point about which torques are taken [m].
    m : int, optional
        Number of vertices on each limit surface; GraspIt!'s 20 if not given.
    unit : float
        Unit of length of the torques in which GraspIt!'s vertices are placed [m], see `linearised_contacts`.

    Raises
    ------
    ValueError
        If the sums are more than `MOST_POINTS`; for antipodal contacts `scoring.closed_form` gives the volume of any.
    """
    contacts = list(contacts)
    smooth = [k for k, c in enumerate(contacts) if vertices_of(c.body) is None]
    for k, new in zip(smooth, linearised_contacts([contacts[k] for k in smooth], m, unit), strict=True):
        contacts[k] = new
    cones = []
    for contact in contacts:
        C = contact.wrench_map(object_length, contact_length, centre_of_mass)
        vertices = vertices_of(contact.body)
        assert vertices is not None  # the smooth ones were replaced above
        loads = np.hstack([np.ones((len(vertices), 1)), vertices])
        # 0 is the contact that does not press
        cones.append(np.vstack([np.zeros(6), loads @ C.T]))
    count = int(np.prod([len(cone) for cone in cones]))
    if count > MOST_POINTS:
        raise ValueError(f"{count} sums of wrenches are too many for a hull in six dimensions; take a smaller m")
    points = np.array([np.sum(choice, axis=0) for choice in itertools.product(*cones)])
    size = np.linalg.svd(points, compute_uv=False)
    # Qhull would joggle flat points into a volume
    if size[-1] <= 1e-10 * size[0]:
        return LinearisedScore(0.0, 0.0, 0, False)
    try:
        hull, joggled = ConvexHull(points, qhull_options="Qx"), False
    except QhullError:
        hull, joggled = ConvexHull(points, qhull_options="QJ"), True
    nearest = -float(hull.equations[:, -1].max())
    # on a facet through 0 rounding gives either sign
    inner = nearest > 1e-9 * size[0] / np.sqrt(len(points))
    return LinearisedScore(float(hull.volume), nearest if inner else 0.0, len(hull.simplices), joggled)


def _graspit_vertices(axes: FloatArray, unit: float) -> FloatArray:
    """GraspIt!'s vertices; an axis without length is that of a thin ellipsoid, pressed flat."""
    units = np.array([1.0, 1.0, unit])
    return graspit_vertices(np.maximum(axes / units, 1e-12)) * (axes > 0) * units


def graspit_vertices(semi_axes: ArrayLike) -> FloatArray:
    """The 20 vertices of GraspIt!'s soft contact, ``(20, 3)``.

    Directions at the latitudes 90, 45, 0, -45, -90 degrees with 1, 5, 8, 5, 1 points, pushed out radially to the
    ellipsoid.
    """
    rings = [(90, 1), (45, 5), (0, 8), (-45, 5), (-90, 1)]
    latitude = np.radians(np.concatenate([np.full(k, angle) for angle, k in rings]))
    longitude = np.concatenate([2 * np.pi * np.arange(k) / k for _, k in rings])
    u = np.column_stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    return u / np.linalg.norm(u / np.asarray(semi_axes, float), axis=1, keepdims=True)
