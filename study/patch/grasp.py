"""The grasp of two patches: facing each other at a distance, or where their files put them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softjaw.friction.patch import FloatArray
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.epsilon_search import EpsilonBound, epsilon
from softjaw.scoring.grasp import grasp_score
from softjaw.study.exits import USAGE, StudyError
from softjaw.study.patch.evaluate import Judged
from softjaw.study.quantities import MODELS

ANTIPODAL = np.radians(5.0) + 1e-6  # beyond this the study flags a grasp; at 5 degrees rounding decides nothing
ACROSS = 1e-6  # cosine between a normal and the line of the contacts: one across the line points neither way
FACING = np.diag([1.0, -1.0, -1.0])  # half a turn about x: how the second of two equal fingers stands


class Scored(NamedTuple):
    """Volumes of the L-infinity and L1 grasp wrench spaces, and bounds of epsilon in the first.

    The bounds meet for ellipsoids; for a quartic they leave a gap as large as its distance to an ellipsoid inside it.
    """

    quality: float
    quality_l1: float
    epsilon: EpsilonBound


@dataclass(frozen=True, eq=False)
class Grasp:
    """Score of two contacts.

    Parameters
    ----------
    distance : float
        Between the origins of the contact frames [m].
    object_length, contact_length : float
        Lengths by which torques of forces and torques about normals are divided [m].
    misalignment : float
        Largest angle of a normal against the other one reversed and against the line of the contacts [rad].
    slips : bool
        Whether the line of the contacts leaves a friction cone.
    surface : str
        Kind of limit surface that was scored.
    scores : mapping
        `Scored` for each friction model.
    """

    distance: float
    object_length: float
    contact_length: float
    misalignment: float
    slips: bool
    surface: str
    scores: Mapping[str, Scored]


def grasp_of(
    one: Judged,
    two: Judged | None,
    mu: float,
    surface: str,
    distance: float | None = None,
    object_length: float | None = None,
    contact_length: float | None = None,
) -> Grasp:
    """Score of a grasp by two patches, for unit normal forces (S = 1).

    Parameters
    ----------
    one, two : Judged
        The contacts, in the coordinates of one object; without ``two`` the second is like the first, half a turn
        about x away from it.
    mu : float
        Coulomb friction coefficient [-].
    surface : str
        Kind of limit surface, one of ``study.patch.evaluate.SURFACES``.
    distance : float, optional
        Between the contacts, where ``two`` is not given [m].
    object_length, contact_length : float, optional
        By default the distance, and the longer side of the larger contact [m].
    """
    (O1, R1), (O2, R2) = _places(one, two, distance)
    line = O2 - O1
    d = float(np.linalg.norm(line))
    both = one, one if two is None else two
    if two is not None:
        _check_facing(one, two, line, d)
    L, a = object_length or d, contact_length or max(j.rho for j in both)
    N1, N2 = R1[2], R2[2]
    lean = max(_angle(N1, line), _angle(-N2, line))
    scores = {}
    for model in MODELS:
        bodies = [judged.surfaces[model][surface].surface for judged in both]
        contacts = SoftContact(O1, R1, bodies[0]), SoftContact(O2, R2, bodies[1])
        lengths = L, a, (O1 + O2) / 2
        volume = grasp_score(contacts, *lengths, with_epsilon=False)
        scores[model] = Scored(volume.quality, volume.quality_l1, epsilon(contacts, *lengths))
    slips = bool(np.tan(min(lean, 1.57)) > mu + 1e-9)
    return Grasp(d, L, a, max(_angle(N1, -N2), lean), slips, surface, scores)


def _places(one: Judged, two: Judged | None, distance: float | None) -> list[tuple[FloatArray, FloatArray]]:
    """Origin and axes of each contact; what ``FACING`` does happens in the first contact's frame."""
    frame = one.frame
    first = frame.origin, frame.axes
    if two is not None:
        return [first, (two.frame.origin, two.frame.axes)]
    assert distance is not None
    return [first, (frame.origin + distance * frame.axes[2], FACING @ frame.axes)]


def _check_facing(one: Judged, two: Judged, line: FloatArray, distance: float) -> None:
    if distance <= 1e-9 * max(one.rho, two.rho):
        raise StudyError(
            USAGE,
            f"--other: {two.read.file} has its contact at the same place as {one.read.file}; both files have to use "
            "the coordinates of one object",
        )
    away = [j.read.file for j, to in ((one, line), (two, -line)) if j.frame.axes[2] @ to < -ACROSS * distance]
    if len(away) == 2:
        raise StudyError(
            USAGE,
            f"--other: the normals of {away[0]} and {away[1]} point away from each other, expected the direction in "
            "which each finger presses, into the object; add --flip-normals",
        )
    if away:
        raise StudyError(
            USAGE,
            f"--other: the normals of {away[0]} point away from the other contact and those of the other towards it, "
            f"expected the direction in which each finger presses, into the object; turn the normals of {away[0]}",
        )


def _angle(u: FloatArray, v: FloatArray) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))
