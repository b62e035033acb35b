"""Epsilon quality of any soft contacts in any pose: the weakest wrench that breaks the grasp, between two bounds.

Epsilon is the least support of the grasp wrench space over unit wrenches, a problem with many local minima. The lower
bound comes from `scoring.radius`, which proves that a ball fits; for two contacts it has always met the upper bound so
far. The upper bound is the support for the weakest wrench found: from the directions the proof points to, or from many
if those leave a gap, the reach along ``u`` gives the facet it meets (`scoring.gauge`), whose own direction is weaker
still, until nothing changes.

Where 0 is not an inner point epsilon is 0, exactly. That is decided by a convex programme: either some wrench ``u`` has
``c_i . u + |D_i u| < 0`` for all contacts, or the contacts do not span all wrenches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.scoring.conic import cone_programme
from softjaw.scoring.contact import Body, SoftContact
from softjaw.scoring.gauge import contact_support, gauge, joint_support
from softjaw.scoring.inscribed import ellipsoid_inside, is_ellipsoid
from softjaw.scoring.radius import certified_radius
from softjaw.scoring.reach import reach

FloatArray = NDArray[np.float64]

_SMALLEST = 1e-9  # relative to the largest wrench of a contact: what counts as no wrench
_ABSOLUTE = 1e-6
_ROUNDS, _STARTS, _SPLITS = 12, 40, 16


class EpsilonBound(NamedTuple):
    """Epsilon lies between ``lower`` and ``upper``; ``wrench (6,)`` is the unit wrench that gives the upper bound."""

    lower: float
    upper: float
    wrench: FloatArray


def epsilon(
    contacts: Sequence[SoftContact],
    object_length: float,
    contact_length: float,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    kind: str = "linf",
    tolerance: float = 1e-4,
) -> EpsilonBound:
    """Radius of the largest ball around 0 in the grasp wrench space, for normal forces of at most one [-].

    Parameters
    ----------
    contacts : sequence of SoftContact
        One or more, in any pose.
    object_length, contact_length : float
        Lengths by which the torques of forces and those about the normals are divided [m]; epsilon depends on both.
    centre_of_mass : (3,) array
        Point about which torques are taken [m]; epsilon depends on it.
    kind : str
        "linf": every normal force is at most one; "l1": their sum is.
    tolerance : float
        Relative gap of the bounds to work for; an absolute one of 1e-6 is enough too.

    Notes
    -----
    The bounds hold up to rounding. A body that is no ellipsoid is replaced by an ellipsoid inside it for the lower
    bound, which leaves a gap as large as its fit error; the upper bound uses its own support.

    Examples
    --------
    >>> from softjaw.scoring.contact import EllipsoidBody, SoftContact, contact_axes
    >>> body = EllipsoidBody([1, 1, 0.2])
    >>> pads = [SoftContact([x, 0, 0], contact_axes([-x, 0, 0], [0, 0, 1]), body) for x in (-0.5, 0.5)]
    >>> round(epsilon(pads, 1.0, 1.0).upper, 6) == round(0.4 / 1.04**0.5, 6)
    True
    """
    if kind not in ("linf", "l1"):
        raise ValueError(f"kind is {kind!r}: take 'linf' or 'l1'")
    C = np.array([contact.wrench_map(object_length, contact_length, centre_of_mass) for contact in contacts])
    if not len(C):
        raise ValueError("contacts is empty: a grasp needs at least one contact")
    c, bodies = C[:, :, 0], [contact.body for contact in contacts]
    D = np.array([ellipsoid_inside(body) @ Ci[:, 1:].T for body, Ci in zip(bodies, C, strict=True)])
    exact = all(is_ellipsoid(body) for body in bodies)
    if (apart := separating_wrench(c, D)) is None:
        lower, upper, u = _between(c, D, kind, tolerance)
    else:
        lower, upper, u = 0.0, 0.0, apart
    if not exact:
        upper, u = _weakest_of_bodies(C, bodies, u, kind)
    return EpsilonBound(min(lower, upper), upper, u)


def separating_wrench(c: FloatArray, D: FloatArray) -> FloatArray | None:
    """Unit wrench ``(6,)`` that no contact can resist at all, or None if 0 is an inner point of what they span."""
    n, size = len(c), np.abs(c).max()
    _, spread, V = np.linalg.svd(np.vstack([c, D.reshape(-1, 6)]))
    if len(spread) < 6 or spread[-1] <= _SMALLEST * spread[0]:
        return V[-1]
    # least t with c_i u + |D_i u| <= t, force and torque of u of at most one
    G = np.zeros((1, n + 2, 4, 7))
    G[0, :n, 0, :6], G[0, :n, 1:, :6], G[0, :n, 0, 6] = c, -D, -1
    G[0, n, 1:, :3] = G[0, n + 1, 1:, 3:6] = -np.eye(3)
    h = np.zeros((1, n + 2, 4))
    h[0, :n, 0], h[0, n:, 0] = size, 1
    x, _ = cone_programme(np.eye(7)[6], G, h, np.array([1e-9 * size]))
    u = x[:, :6] / max(np.linalg.norm(x[:, :6]), 1e-300)
    return u[0] if contact_support(c, D, u).max() < -_SMALLEST * size else None


def _between(c: FloatArray, D: FloatArray, kind: str, tolerance: float) -> tuple[float, float, FloatArray]:
    """Bounds of epsilon, closer than the tolerance unless that takes too many proofs."""
    proofs = [certified_radius(c, D, kind)]
    upper, u = _weakest(c, D, proofs[0].directions, kind, proofs[0].radius * (1 + tolerance / 10))
    for _ in range(_SPLITS):
        first = min(proofs, key=lambda proof: proof.radius)
        if upper <= first.radius * (1 + tolerance) + _ABSOLUTE:
            break
        if len(proofs) == 1:
            many = np.random.default_rng(0).normal(size=(_STARTS, 6))
            upper, u = min((upper, u), _weakest(c, D, many, kind, first.radius), key=lambda pair: pair[0])
        proofs.remove(first)
        for side in (first.split, -first.split):
            proofs.append(certified_radius(c, D, kind, np.vstack([first.planes, side])))
            found = _weakest(c, D, proofs[-1].directions[:6], kind, first.radius)
            upper, u = min((upper, u), found, key=lambda pair: pair[0])
    return min(proof.radius for proof in proofs), upper, u


def _weakest(c: FloatArray, D: FloatArray, u: FloatArray, kind: str, enough: float) -> tuple[float, FloatArray]:
    """Least support found from the starts ``u``, and its unit wrench."""
    best, at = np.inf, u[0]
    for _ in range(_ROUNDS):
        u = gauge(c, D, u, kind).u
        u = u / np.linalg.norm(u, axis=1, keepdims=True)
        h = joint_support(c, D, u, kind)
        before, k = best, h.argmin()
        if h[k] < best:
            best, at = float(h[k]), u[k]
        if best <= enough or before - best <= 1e-9 * best:
            break
    return best, at


def _weakest_of_bodies(C: FloatArray, bodies: Sequence[Body], u: FloatArray, kind: str) -> tuple[float, FloatArray]:
    """Least support of contacts with any bodies found from the start ``u (6,)``, and its unit wrench."""
    best, at = np.inf, u
    for _ in range(_ROUNDS):
        found = reach(C, bodies, u, kind, tolerance=1e-5)
        length = float(np.linalg.norm(found.u))
        u = found.u / length
        if not found.upper / length < best * (1 - 1e-6):
            break
        best, at = found.upper / length, u
    return best, at
