"""Quality of a grasp: volumes and epsilons of two contacts that face each other, and of any two anywhere."""

import math
from collections.abc import Iterable, Sequence
from enum import IntFlag
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softjaw.scoring.closed_form import epsilon_l1, epsilon_linf, volume_l1, volume_linf
from softjaw.scoring.contact import ROUNDING_SHARE, Body, FloatArray, SoftContact, ellipsoid_matrix
from softjaw.scoring.epsilon import epsilon
from softjaw.scoring.pose import pose_volume


class ScoreFlag(IntFlag):
    """Why a score is zero or smaller than the forces suggest; flags add up."""

    CLEAN = 0
    NO_TORQUE = 1  # a contact carries no torque about its normal
    NO_FORCE = 2  # a contact carries no friction along one of its axes


class Score(NamedTuple):
    """Qualities of a grasp, for normal forces of one [-].

    ``quality`` and ``quality_l1`` are the volumes of the L-infinity and L1 grasp wrench spaces, ``epsilon`` and
    ``epsilon_l1`` the radii of the largest balls around 0 in them. ``method`` says how the volumes were found,
    "antipodal" in closed form or "pose" by division of the surfaces, and ``error`` the relative error that it leaves.
    """

    quality: float
    quality_l1: float
    epsilon: float
    flag: ScoreFlag
    epsilon_l1: float
    method: str = "antipodal"
    error: float = 0.0


def score(
    contact1: Iterable[float], contact2: Iterable[float], distance: float, object_length: float, contact_length: float
) -> Score:
    """Score of two soft contacts that face each other, about a centre of mass halfway between them.

    Contacts are semi-axes ``(f_x, f_y, tau_z)`` of ellipsoids per unit normal force [-, -, m]; other bodies go to
    `grasp_score`. ``distance`` is that of the contacts, ``object_length`` divides their arms and ``contact_length`` the
    torques about the normals [m].

    >>> score((1, 1, 0.01), (1, 1, 0.01), distance=0.06, object_length=0.06, contact_length=0.05).flag
    <ScoreFlag.CLEAN: 0>
    """
    d = distance / object_length
    a, b = ((f_x, f_y, tau_z / contact_length) for f_x, f_y, tau_z in (map(float, contact1), map(float, contact2)))
    (V1, A1), (V2, A2) = ((4 / 3 * math.pi * math.prod(axes), math.pi * axes[0] * axes[1]) for axes in (a, b))
    linf, l1 = volume_linf(V1, A1, V2, A2, d), volume_l1(V1, A1, V2, A2, d)
    return Score(linf, l1, epsilon_linf(a, b, -d / 2, d / 2), _lacking(a, b), epsilon_l1(a, b, -d / 2, d / 2))


def contact_flag(bodies: Sequence[Body], contact_length: float) -> ScoreFlag:
    """What some contact does not carry at all, up to `ROUNDING_SHARE`; torques are divided by the length [m]."""
    return _lacking(*((body.support(np.eye(3)) / [1.0, 1.0, contact_length]).tolist() for body in bodies))


def _lacking(*contacts: Sequence[float]) -> ScoreFlag:
    flag = ScoreFlag.CLEAN
    for f_x, f_y, tau in contacts:
        least = ROUNDING_SHARE * max(f_x, f_y, tau)
        if tau <= least:
            flag |= ScoreFlag.NO_TORQUE
        if f_x <= least or f_y <= least:
            flag |= ScoreFlag.NO_FORCE
    return flag


def grasp_score(
    contacts: Sequence[SoftContact],
    object_length: float,
    contact_length: float,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    tolerance: float = 1e-4,
    with_epsilon: bool = True,
) -> Score:
    """Score of two soft contacts in any poses, with any limit surfaces; lengths and centre as in `scoring.epsilon`.

    The contacts count as facing each other, and the closed form is used, if both normals are within ``tolerance`` of
    the line of the contacts [rad]; the volume is then off by up to some 10 times its square. Bodies that are sampled
    have no closed form. Both epsilons, nan unless asked for, take longer than the volumes without one; they are the
    lower bounds if a gap was left.
    """
    lengths = object_length, contact_length, centre_of_mass
    bodies = [contact.body for contact in contacts]
    if faces(contacts, tolerance) and not any(getattr(body, "sampled", False) for body in bodies):
        d = float(np.linalg.norm(contacts[1].position - contacts[0].position)) / object_length
        (V1, A1), (V2, A2) = ((body.volume / contact_length, body.shadow_area) for body in bodies)
        linf, l1 = volume_linf(V1, A1, V2, A2, d), volume_l1(V1, A1, V2, A2, d)
        method, error = "antipodal", 10 * tolerance**2
    else:
        linf, l1, error = pose_volume(contacts[0], contacts[1], *lengths)
        method = "pose"
    epsilons = _epsilons(contacts, *lengths) if with_epsilon else (math.nan, math.nan)
    return Score(linf, l1, epsilons[0], contact_flag(bodies, contact_length), epsilons[1], method, error)


def faces(contacts: Sequence[SoftContact], tolerance: float) -> bool:
    """Whether two contacts press against each other along their common line, up to an angle [rad]."""
    line = contacts[1].position - contacts[0].position
    # compared by components, not by the arc cosine, which has no digits near 0
    d = float(np.linalg.norm(line))
    N1, N2 = contacts[0].axes[2], contacts[1].axes[2]
    return d > 0 and max(np.abs(N1 * d - line).max(), np.abs(N2 * d + line).max()) <= tolerance * d


def _epsilons(
    contacts: Sequence[SoftContact], object_length: float, contact_length: float, centre_of_mass: ArrayLike
) -> tuple[float, float]:
    """L-infinity and L1, in closed form where there is one."""
    arms = np.array([contact.position for contact in contacts]) - np.asarray(centre_of_mass, float)
    if faces(contacts, ROUNDING_SHARE):
        first, second = (_line_axes(contacts[0], contact) for contact in contacts)
        along = arms @ contacts[0].axes[2]
        on_line = np.abs(arms - np.outer(along, contacts[0].axes[2])).max() <= ROUNDING_SHARE * np.abs(arms).max()
        if on_line and first is not None and second is not None:
            a, b = (axes / [1, 1, contact_length] for axes in (first, second))
            arm1, arm2 = (along / object_length).tolist()
            return epsilon_linf(a, b, arm1, arm2), epsilon_l1(a, b, arm1, arm2)
    bounds = (epsilon(contacts, object_length, contact_length, centre_of_mass, kind) for kind in ("linf", "l1"))
    linf, l1 = (bound.lower for bound in bounds)
    return linf, l1


def _line_axes(first: SoftContact, contact: SoftContact) -> FloatArray | None:
    """Semi-axes of an ellipsoid along the first contact's axes; None if it is no ellipsoid or not aligned with them."""
    A = ellipsoid_matrix(contact.body)
    if A is None:
        return None
    turn = first.axes @ contact.axes.T
    B = turn @ A @ turn.T
    axes = B.diagonal().copy()
    return axes if np.abs(B - np.diag(axes)).max() <= ROUNDING_SHARE * np.abs(axes).max() else None
