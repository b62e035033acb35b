"""How much a parallel gripper holds: the largest load at a point that both contacts bear.

The drive of a parallel gripper keeps the sum of both normal forces, ``2 F``. A load along the closing axis shifts force
from one finger to the other, ``F + s`` and ``F - s``; the friction of the contacts follows their normal forces. So the
wrenches that the grasp can answer with are

    W = 2 F conv(A_1, A_2),    A_i = p_i + B_i,

``p_i`` the wrench of the pressure of finger i and ``B_i`` its limit surface, both per unit normal force. The squeeze
itself has to be borne first: two forces that do not face each other make a couple, and unless 0 lies in W the grasp
does not even hold itself. The payload is how far W reaches along the force at the centre of mass, without a torque.

Over all directions of the force these reaches bound a convex set in space; the worst direction is where its boundary
is nearest. Every solve for one direction also gives a plane that the set lies behind; the foot of that plane is tried
next, which can only come nearer, from many starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog

from softjaw.scoring.bodies import touching_points
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.reach import reach

FloatArray = NDArray[np.float64]
ROUNDS = 30  # of going to the nearest plane; five are usual
SETTLED = 1e-6  # relative change of the force that ends them
DESCENTS = 6  # from the starts that reach least
CUTS, OUTSIDE = 200, 1e-9  # planes tried for the squeeze; relative distance from which 0 is outside
STARTS = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)])


@dataclass(frozen=True)
class Payload:
    """Largest force that is held.

    Parameters
    ----------
    force : float
        Of the load at the centre of mass [N]; 0 where the squeeze itself is not borne.
    direction : (3,) array
        Direction in which the load pulls then.
    shortfall : float
        Of the squeeze itself: how far 0 lies outside of W, over the size of W; 0 where the grasp holds itself [-].
    """

    force: float
    direction: FloatArray
    shortfall: float


def payload(
    contacts: Sequence[SoftContact],
    normal_force: float,
    centre_of_mass: ArrayLike,
    direction: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
) -> Payload:
    """Largest force at the centre of mass that two contacts hold, along ``direction`` or the worst of all directions.

    Parameters
    ----------
    contacts : sequence of two SoftContact
        Limit surfaces per unit normal force, positions and frames in the object's frame.
    normal_force : float
        Per finger, as the drive has it without a load [N].
    centre_of_mass : (3,) array
        Where the load acts [m].
    direction : (3,) array, optional
        In which it pulls, of any length; None: the worst.
    pressure : (2, 6) array, optional
        Wrench of each finger's pressure on the object about the origin, per unit normal force [-, m]; by default the
        force along the contact normal through the contact's origin.
    """
    centre = np.asarray(centre_of_mass, dtype=float)
    length = max(float(np.linalg.norm(c.position - centre)) for c in contacts) or 1.0
    C = np.array([c.wrench_map(length, length, centre) for c in contacts])
    if pressure is not None:
        p = np.asarray(pressure, dtype=float)
        C[:, :3, 0], C[:, 3:, 0] = p[:, :3], (p[:, 3:] - np.cross(centre, p[:, :3])) / length
    shortfall = squeeze_shortfall(C, contacts)
    if shortfall > OUTSIDE:
        return Payload(0.0, np.zeros(3) if direction is None else _unit(direction), shortfall)
    if direction is not None:
        d = _unit(direction)
        return Payload(2.0 * normal_force * _along(C, contacts, d)[0], d, 0.0)
    starts = sorted(STARTS, key=lambda d: _along(C, contacts, _unit(d))[0])[:DESCENTS]
    force, worst = min((_descend(C, contacts, _unit(d)) for d in starts), key=lambda found: found[0])
    return Payload(2.0 * normal_force * force, worst, 0.0)


def _descend(C: FloatArray, contacts: Sequence[SoftContact], d: FloatArray) -> tuple[float, FloatArray]:
    """Nearest boundary of the held forces, per ``2 F``, that going from plane to plane finds from a direction."""
    force, across = _along(C, contacts, d)
    for _ in range(ROUNDS):
        size = float(np.linalg.norm(across))
        if size == 0.0:
            break
        ahead, plane = _along(C, contacts, across / size)
        if ahead >= force * (1.0 - SETTLED):
            break
        force, d, across = ahead, across / size, plane
    return force, d


def _along(C: FloatArray, contacts: Sequence[SoftContact], d: FloatArray) -> tuple[float, FloatArray]:
    """Largest load along ``d``, per ``2 F``, and the normal of the plane behind which all held loads lie."""
    w = np.concatenate([-d, np.zeros(3)])  # the contacts answer a load with its opposite
    found = reach(C, [c.body for c in contacts], w, "l1")
    return max(found.lower, 0.0), -found.u[:3]


def squeeze_shortfall(C: FloatArray, contacts: Sequence[SoftContact]) -> float:
    """How far 0 lies outside of ``conv(A_1, A_2)``, over its size; 0 where it is inside [-].

    Cutting planes: the direction in which the points found so far reach least asks both bodies for their next points.
    """
    points = [_touching(C, contacts, u) for u in np.vstack([np.eye(6), -np.eye(6)])]
    planes = np.vstack([p[0] for p in points])
    scale = float(np.abs(planes).max())
    for _ in range(CUTS):
        # the smallest t over |u| <= 1 (largest component) such that every point has u . a <= t
        found = linprog(
            np.append(np.zeros(6), 1.0),
            A_ub=np.hstack([planes, -np.ones((len(planes), 1))]),
            b_ub=np.zeros(len(planes)),
            bounds=[(-1, 1)] * 6 + [(None, None)],
        )
        u, inner = found.x[:6], float(found.x[6])
        if not u.any():
            return 0.0
        new, outer = _touching(C, contacts, u)
        if outer - inner <= 1e-7 * scale:
            break
        planes = np.vstack([planes, new])
    return max(0.0, -outer / scale)


def _touching(C: FloatArray, contacts: Sequence[SoftContact], u: FloatArray) -> tuple[FloatArray, float]:
    """Points of both ``A_i`` that lie furthest along ``u``, ``(2, 6)``, and how far the further one is."""
    rows = []
    for Ci, contact in zip(C, contacts, strict=True):
        local = Ci.T @ u
        rows.append(Ci @ np.append(1.0, touching_points(contact.body, local[1:])[0]))
    found = np.array(rows)
    return found, float((found @ u).max())


def _unit(v: ArrayLike) -> FloatArray:
    d = np.asarray(v, dtype=float)
    return d / np.linalg.norm(d)
