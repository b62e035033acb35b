"""Score of a grasp by two antipodal contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntFlag

import numpy as np

from softjaw.scoring.contact import Body, EllipsoidBody
from softjaw.scoring.epsilon import epsilon_l1, epsilon_linf
from softjaw.scoring.volume import volume_l1, volume_linf

NOTHING = 1e-12
"""Share of the largest load, torques divided by their length, up to which a load is the rounding of none."""


class ScoreFlag(IntFlag):
    """Why a score is zero or smaller than the forces suggest; flags add up."""

    CLEAN = 0
    NO_TORQUE = 1  # a contact carries no torque about its normal
    NO_FORCE = 2  # a contact carries no friction along one of its axes


@dataclass(frozen=True)
class Score:
    """Qualities of a grasp, for normal forces of one.

    Parameters
    ----------
    quality : float
        Volume of the L-infinity grasp wrench space [-].
    quality_l1 : float
        Volume of the L1 grasp wrench space [-].
    epsilon : float
        Radius of the largest ball around 0 in the L-infinity grasp wrench space [-].
    flag : ScoreFlag
        0 if nothing is unusual.
    epsilon_l1 : float
        The same radius in the L1 grasp wrench space [-].
    method : str
        How the volumes were found: "antipodal" in closed form, "pose" by division of two contacts in any pose, "rays"
        by an estimate for three or more.
    error : float
        Relative error of the volumes left by that method [-].
    """

    quality: float
    quality_l1: float
    epsilon: float
    flag: ScoreFlag
    epsilon_l1: float
    method: str = "antipodal"
    error: float = 0.0


def score(
    contact1: Sequence[float] | Body,
    contact2: Sequence[float] | Body,
    distance: float,
    object_length: float,
    contact_length: float,
    centre_of_mass: float = 0.0,
) -> Score:
    """Score of two soft contacts that face each other.

    Parameters
    ----------
    contact1, contact2 : (3,) sequence or Body
        Semi-axes ``(f_x, f_y, tau_z)`` of an ellipsoid, per unit normal force [-, -, m]; ``(mu, mu, mu e_n)`` is the
        simplified surface of Eq. (12), see `simplified_contact`. Or any limit surface in these coordinates, of which
        only the volume and the shadow's area count; epsilon has no closed form then and is nan, see
        `scoring.grasp.grasp_score`.
    distance : float
        Distance of the contacts [m].
    object_length : float
        Length by which the arms of the contacts are divided [m].
    contact_length : float
        Length by which the torques about the normals are divided [m].
    centre_of_mass : float
        Its place on the line of the contacts, from the midpoint towards contact 2 [m]; only epsilon depends on it.

    Examples
    --------
    >>> score((1, 1, 0.01), (1, 1, 0.01), distance=0.06, object_length=0.06, contact_length=0.05).flag
    <ScoreFlag.CLEAN: 0>
    """
    rho = _positive("contact_length", contact_length)
    L = _positive("object_length", object_length)
    d = _positive("distance", distance) / L
    if hasattr(contact1, "volume") or hasattr(contact2, "volume"):
        bodies = (_as_body("contact1", contact1), _as_body("contact2", contact2))
        sizes = [size for body in bodies for size in (body.volume / rho, body.shadow_area)]
        return Score(volume_linf(*sizes, d), volume_l1(*sizes, d), math.nan, contact_flag(bodies, rho), math.nan)
    a, b = _scaled("contact1", contact1, rho), _scaled("contact2", contact2, rho)
    x = centre_of_mass / L
    sizes = [*_volume_and_shadow(a), *_volume_and_shadow(b)]
    arms = -d / 2 - x, d / 2 - x
    flag = _lacking(a, b)
    return Score(volume_linf(*sizes, d), volume_l1(*sizes, d), epsilon_linf(a, b, *arms), flag, epsilon_l1(a, b, *arms))


def contact_flag(bodies: Sequence[Body], contact_length: float) -> ScoreFlag:
    """What some contact does not carry at all, up to `NOTHING`; torques are divided by the length [m]."""
    return _lacking(*((body.support(np.eye(3)) / [1.0, 1.0, contact_length]).tolist() for body in bodies))


def _lacking(*contacts: Sequence[float]) -> ScoreFlag:
    flag = ScoreFlag.CLEAN
    for f_x, f_y, tau in contacts:
        least = NOTHING * max(f_x, f_y, tau)
        if tau <= least:
            flag |= ScoreFlag.NO_TORQUE
        if f_x <= least or f_y <= least:
            flag |= ScoreFlag.NO_FORCE
    return flag


def simplified_contact(mu: float, e_n: float) -> tuple[float, float, float]:
    """Semi-axes ``mu (1, 1, e_n)`` of Eq. (12), the simplified limit surface, too large for curved contacts."""
    return mu, mu, mu * e_n


def _scaled(name: str, contact: Sequence[float], length: float) -> tuple[float, float, float]:
    f_x, f_y, tau_z = map(float, contact)
    for label, value in (("f_x", f_x), ("f_y", f_y), ("tau_z", tau_z)):
        if not 0 <= value < math.inf:
            raise ValueError(f"{name}: {label} is {value}; semi-axes must be finite and not negative")
    return f_x, f_y, tau_z / length


def _as_body(name: str, contact: Sequence[float] | Body) -> Body:
    return contact if hasattr(contact, "volume") else EllipsoidBody(np.array(_scaled(name, contact, 1.0)))


def _positive(name: str, value: float) -> float:
    if not 0 < value < math.inf:
        raise ValueError(f"{name} is {value}: it must be a positive length in metres")
    return float(value)


def _volume_and_shadow(axes: tuple[float, float, float]) -> tuple[float, float]:
    f_x, f_y, tau_z = axes
    return 4 / 3 * math.pi * f_x * f_y * tau_z, math.pi * f_x * f_y
