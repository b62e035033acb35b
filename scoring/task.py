"""Whether a grasp holds a load, the weight of the object or any other wrench, at given normal forces.

The load ``w`` is held if the contacts can answer with ``-w``. How the normal forces behave is a choice:

* "up_to": each lies anywhere between 0 and its grip force. A parallel gripper that is pushed along its closing line
  unloads one finger while its drive or its self-locking gear keeps the other within the limit.
* "fixed": each is its grip force, whatever happens. Fingers driven by constant force hold no load along their common
  line, and contacts whose normal forces do not balance may hold only a heavy enough load.

Forces are in N and torques in N m about the origin of the contacts' frame. The safety factor, the largest multiple of
the load that is held, is a ratio along one line of wrenches, so it depends neither on the point torques refer to nor
on a length that would make them comparable with forces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.scoring.contact import SoftContact
from softjaw.scoring.reach import Reach, reach

FloatArray = NDArray[np.float64]

GRAVITY = 9.80665
_SLIPS = "slides along x", "slides along y", "turns about its normal"
_KINDS = {"up_to": "linf", "fixed": "fixed"}
_NOTHING = 1e-9  # relative size below which a part of a wrench counts as rounding
_LIMIT = 1e-6  # how near to the limit a load is neither held nor not, as factors are good to some 1e-8
_STILL = 1e-4  # share of the largest motion up to which there is none, or no difference: motions are good to some 1e-5


@dataclass(frozen=True)
class TaskResult:
    """What a grasp makes of a load.

    Parameters
    ----------
    safety_factor : float
        Largest multiple of the load that is held [-], as proved; 0 if none is, up to 1e-9 of what the contacts bear.
    gap : float
        How much larger it could be at most [-].
    lowest_factor : float
        Smallest multiple that is held [-]; 0 unless fixed normal forces need a load to balance them.
    holds : bool
        Whether the load itself is held; so it counts at the limit.
    at_limit : bool
        Whether that is undecided: the load is within 1e-6 of the limit, or in the ``gap``.
    motion : (6,) array
        Motion by which the object escapes beyond the limit: velocity of the origin, then rotation, of any size. Where
        limit surfaces have corners, as polytopes have, there may be several, and this is one of them.
    limits : tuple of str
        What each contact does then; of loads that weigh the same all are named.
    """

    safety_factor: float
    gap: float
    lowest_factor: float
    holds: bool
    at_limit: bool
    motion: FloatArray
    limits: tuple[str, ...]


def weight_wrench(
    mass: float,
    direction: ArrayLike,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    acceleration: ArrayLike = (0.0, 0.0, 0.0),
) -> FloatArray:
    """Weight of an object and, if the gripper accelerates, its inertia: ``(6,)``, forces [N] then torques [N m].

    Parameters
    ----------
    mass : float
        Mass [kg].
    direction : (3,) array
        Direction of gravity in the contacts' frame, of any length.
    centre_of_mass : (3,) array
        Where the weight acts [m].
    acceleration : (3,) array
        Acceleration of gripper and object, without rotation [m/s^2].

    Examples
    --------
    >>> weight_wrench(1.0, [0, 0, -1], [0.5, 0, 0])[[2, 4]].tolist()
    [-9.80665, 4.903325]
    """
    down = _vector("direction", direction, 3)
    if not 0 < mass < math.inf:
        raise ValueError(f"mass is {mass}: it must be a positive number of kilograms")
    if not down.any():
        raise ValueError("direction is zero: give the direction in which gravity pulls")
    # in the gripper's frame inertia pulls against the acceleration
    force = mass * (GRAVITY * down / np.linalg.norm(down) - _vector("acceleration", acceleration, 3))
    return np.concatenate([force, np.cross(_vector("centre_of_mass", centre_of_mass, 3), force)])


def hold_task(
    contacts: Sequence[SoftContact], normal_forces: ArrayLike, wrench: ArrayLike, normal: str = "up_to"
) -> TaskResult:
    """Whether the grasp holds a load, and with how much to spare.

    Parameters
    ----------
    contacts : sequence of SoftContact
        One or more, in any pose.
    normal_forces : float or (n,) array
        Grip force of each contact [N].
    wrench : (6,) array
        Load on the object: force [N] and torque about the origin [N m]; `weight_wrench` gives that of its weight.
    normal : str
        "up_to" or "fixed", see above.
    """
    if normal not in _KINDS:
        raise ValueError(f"normal is {normal!r}: take 'up_to' or 'fixed'")
    if not len(contacts):
        raise ValueError("contacts is empty: a grasp needs at least one contact")
    F = np.broadcast_to(np.asarray(normal_forces, float), (len(contacts),))
    if not (np.isfinite(F).all() and (F > 0).all()):
        raise ValueError(f"normal_forces is {F.tolist()}: grip forces must be positive newtons")
    load = _vector("wrench", wrench, 6)
    if not load.any():
        raise ValueError("wrench is zero: any grasp holds that; give the load to hold")
    # Torques about the middle of the contacts, by their own length, keep the numbers of one size.
    middle = np.mean([contact.position for contact in contacts], axis=0)
    spread = max(float(np.linalg.norm(contact.position - middle)) for contact in contacts)
    grip = max(float(np.max(contact.body.support(np.diag([0.0, 0.0, 1.0])))) for contact in contacts)
    # a single contact without torque has no length, and needs none
    length = max(spread, grip) or 1.0
    C: FloatArray = F[:, None, None] * np.array([contact.wrench_map(length, length, middle) for contact in contacts])
    w: FloatArray = -np.concatenate([load[:3], (load[3:] - np.cross(middle, load[:3])) / length])
    # both are exact up to the gap of a programme: a bisection over factors would leave more
    lowest, bounds = (_range_fixed if normal == "fixed" else _range_up_to)(C, contacts, w)
    strength = np.linalg.norm([Ci * np.append(1.0, _axes(k)) for Ci, k in zip(C, contacts, strict=True)])
    # a programme seldom ends at 0 exactly, and a grip force from a tiny factor would be huge instead of infinite
    factor = bounds.lower if bounds.lower > _NOTHING * strength / np.linalg.norm(w) else 0.0
    # back from the middle and its unit of length: a motion is given by the velocity of the origin
    u = np.concatenate([bounds.u[:3] - np.cross(bounds.u[3:] / length, middle), bounds.u[3:] / length])
    gap = max(bounds.upper - factor, 0.0)
    holds = bool(factor >= 1 - _LIMIT and lowest <= 1 + _LIMIT)
    inside = factor > 1 + _LIMIT and lowest < 1 - _LIMIT
    outside = factor + gap < 1 - _LIMIT or lowest > 1 + _LIMIT
    return TaskResult(factor, gap, lowest, holds, not (inside or outside), -u, _limits(contacts, C, bounds.u))


def least_grip_force(
    contacts: Sequence[SoftContact],
    wrench: ArrayLike,
    safety_factor: float = 1.0,
    normal: str = "up_to",
    shares: ArrayLike = 1.0,
) -> float:
    """Least grip force that holds a load times a safety factor [N]; infinite if none does.

    Parameters
    ----------
    contacts, wrench, normal
        As for `hold_task`.
    safety_factor : float
        Multiple of the load to hold.
    shares : float or (n,) array
        Normal forces of the contacts by the grip force; 1 for two fingers that press against each other.

    Notes
    -----
    All wrenches grow with the grip force, so one programme for a grip force of 1 N is enough.
    """
    if not 0 < safety_factor < math.inf:
        raise ValueError(f"safety_factor is {safety_factor}: it must be a positive number")
    unit = hold_task(contacts, shares, wrench, normal)
    return safety_factor / unit.safety_factor if unit.safety_factor > _NOTHING * unit.gap else math.inf


def _range_up_to(C: FloatArray, contacts: Sequence[SoftContact], w: FloatArray) -> tuple[float, Reach]:
    """Multiples of ``w`` in the sum of the contacts' cones: from 0 to the reach."""
    # loads at full size: the rank must not depend on units of force and torque
    U = _span([Ci @ np.diag([1.0, *_axes(contact)]) for Ci, contact in zip(C, contacts, strict=True)])
    off = w - U @ (U.T @ w)
    # no contact can answer a part across the span, so a motion along it meets no resistance
    if np.linalg.norm(off) > _NOTHING * np.linalg.norm(w):
        return 0.0, Reach(0.0, 0.0, off / (off @ w))
    # the programmes need contacts that fill their space, so they are posed within the span
    bounds = reach(U.T @ C, [contact.body for contact in contacts], U.T @ w, "linf")
    return 0.0, bounds._replace(u=U @ bounds.u)


def _range_fixed(C: FloatArray, contacts: Sequence[SoftContact], w: FloatArray) -> tuple[float, Reach]:
    """Multiples of ``w`` among the wrenches of contacts with given normal forces."""
    bodies = [contact.body for contact in contacts]
    # normal forces are given here: only friction is free to answer
    U = _span([Ci[:, 1:] * _axes(contact) for Ci, contact in zip(C, contacts, strict=True)])
    b, nothing = C[:, :, 0].sum(axis=0), _NOTHING * float(np.abs(C[:, :3, 0]).sum())
    off_w, off_b = (a - U @ (U.T @ a) for a in (w, b))
    small_w = np.linalg.norm(off_w) <= _NOTHING * np.linalg.norm(w)
    if small_w and np.linalg.norm(off_b) <= nothing:
        C, w = U.T @ C, U.T @ w
        # with fixed normal forces the held multiples are an interval that need not begin at 0
        forth, back = reach(C, bodies, w, "fixed"), reach(C, bodies, -w, "fixed")
        # the reach along -w is minus the smallest multiple; where 0 is among the multiples no load is needed
        lowest = max(-back.lower, 0.0) if np.isfinite(back.lower) else 0.0
        return lowest, forth._replace(u=U @ forth.u)
    # Friction has no part off its span: there the normal forces alone have to balance one multiple of the load.
    s = 0.0 if small_w else float(off_b @ off_w / (off_w @ off_w))
    rest = s * w - b
    balanced = bool(np.linalg.norm(s * off_w - off_b) <= nothing)
    if balanced and s >= 0 and np.linalg.norm(rest) > nothing:
        # the normal forces are in `rest` already, so friction alone has to make it
        friction = U.T @ C * [0.0, 1.0, 1.0, 1.0]
        balanced = reach(friction, bodies, U.T @ rest, "fixed").lower >= 1 - _LIMIT
    s = s if balanced and s >= 0 else 0.0
    u = off_w if not small_w else off_b
    return s, Reach(s, s, u / max(abs(u @ w), 1e-300))


def _limits(contacts: Sequence[SoftContact], C: FloatArray, u: FloatArray) -> tuple[str, ...]:
    """What the contacts do when the object escapes: its motion there, weighed by the loads it works against."""
    felt = np.array([Ci.T @ u for Ci in C])  # along N, x, y and about N
    felt[:, 1:] *= [_axes(contact) for contact in contacts]
    size = np.linalg.norm(felt, axis=1)
    if size.max() <= _NOTHING * np.linalg.norm(C) * np.linalg.norm(u):
        return ("stays in place",) * len(contacts)  # what they feel of a motion that they cannot stop is rounding
    said = []
    for part, friction in zip(felt, np.linalg.norm(felt[:, 1:], axis=1), strict=True):
        if np.linalg.norm(part) <= _STILL * size.max():
            said.append("stays in place")
        # where the support is not positive the contact does best without any normal force
        elif part[0] + friction <= _STILL * size.max():
            said.append("lets go")
        elif friction <= _STILL * size.max():
            said.append("is pushed back along its normal")
        else:
            along = np.abs(part[1:]) >= (1 - _STILL) * np.abs(part[1:]).max()
            said.append(" and ".join(name for name, most in zip(_SLIPS, along, strict=True) if most))
    return tuple(said)


def _axes(contact: SoftContact) -> FloatArray:
    """Loads that the contact can carry one by one, ``(3,)``."""
    # a polytope need not be symmetric
    ends = contact.body.support(np.vstack([np.eye(3), -np.eye(3)]))
    return np.maximum(ends[:3], ends[3:])


def _span(maps: Sequence[FloatArray]) -> FloatArray:
    """Orthonormal columns that span the wrenches."""
    U, size, _ = np.linalg.svd(np.hstack(list(maps)), full_matrices=False)
    return U[:, size > _NOTHING * max(size[0], 1e-300)]


def _vector(name: str, value: ArrayLike, length: int) -> FloatArray:
    vector = np.asarray(value, dtype=float)
    if vector.shape != (length,) or not np.isfinite(vector).all():
        raise ValueError(f"{name} is {vector.tolist()}: expected {length} finite numbers")
    return vector
