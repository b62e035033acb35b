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

from softjaw.scoring.contact import PolytopeBody, SoftContact
from softjaw.scoring.epsilon_search import epsilon
from softjaw.scoring.inscribed import ellipsoid_inside, is_ellipsoid
from softjaw.scoring.polytope import fibonacci_vertices, graspit_vertices

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


@dataclass(frozen=True)
class LinearisationBias:
    """Qualities with linearised contacts by those with smooth ones; 0 / 0 is given as nan."""

    linearised: LinearisedScore
    volume: float
    epsilon: float


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
        If the sums are more than `MOST_POINTS`; for antipodal contacts `scoring.volume` gives the volume of any.
    """
    contacts = list(contacts)
    smooth = [k for k, c in enumerate(contacts) if not hasattr(c.body, "vertices")]
    for k, new in zip(smooth, linearised_contacts([contacts[k] for k in smooth], m, unit), strict=True):
        contacts[k] = new
    cones = []
    for contact in contacts:
        C = contact.wrench_map(object_length, contact_length, centre_of_mass)
        loads = np.hstack([np.ones((len(contact.body.vertices), 1)), contact.body.vertices])
        cones.append(np.vstack([np.zeros(6), loads @ C.T]))
    count = int(np.prod([len(cone) for cone in cones]))
    if count > MOST_POINTS:
        raise ValueError(f"{count} sums of wrenches are too many for a hull in six dimensions; take a smaller m")
    points = np.array([np.sum(choice, axis=0) for choice in itertools.product(*cones)])
    size = np.linalg.svd(points, compute_uv=False)
    if size[-1] <= 1e-10 * size[0]:
        return LinearisedScore(0.0, 0.0, 0, False)
    try:
        hull, joggled = ConvexHull(points, qhull_options="Qx"), False
    except QhullError:
        hull, joggled = ConvexHull(points, qhull_options="QJ"), True
    nearest = -float(hull.equations[:, -1].max())
    inner = nearest > 1e-9 * size[0] / np.sqrt(len(points))
    return LinearisedScore(float(hull.volume), nearest if inner else 0.0, len(hull.simplices), joggled)


def linearisation_bias(
    contacts: Sequence[SoftContact],
    volume: float,
    object_length: float,
    contact_length: float,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    m: int | None = None,
    unit: float = 1.0,
) -> LinearisationBias:
    """What linearising does to a grasp's qualities; ``volume`` is that of its smooth L-infinity grasp wrench space."""
    found = graspit_score(contacts, object_length, contact_length, centre_of_mass, m, unit)
    exact = epsilon(contacts, object_length, contact_length, centre_of_mass).upper
    return LinearisationBias(
        found, found.volume / volume if volume else np.nan, found.epsilon / exact if exact else np.nan
    )


def _graspit_vertices(axes: FloatArray, unit: float) -> FloatArray:
    """GraspIt!'s vertices; an axis without length is that of a thin ellipsoid, pressed flat."""
    units = np.array([1.0, 1.0, unit])
    return graspit_vertices(np.maximum(axes / units, 1e-12)) * (axes > 0) * units
