"""Score of a grasp by soft contacts anywhere on the object."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.scoring.boundary import ellipsoid_matrix
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.epsilon import epsilon_l1, epsilon_linf
from softjaw.scoring.epsilon_search import epsilon
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.rays import ray_volume
from softjaw.scoring.score import Score, contact_flag
from softjaw.scoring.volume import volume_l1, volume_linf

FloatArray = NDArray[np.float64]


def grasp_score(
    contacts: Sequence[SoftContact],
    object_length: float,
    contact_length: float,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    tolerance: float = 1e-4,
    with_epsilon: bool = True,
) -> Score:
    """Score of two or more soft contacts in any poses, with any limit surfaces.

    Parameters
    ----------
    contacts : sequence of SoftContact
        At least two.
    object_length : float
        Length by which the arms of the contacts are divided [m].
    contact_length : float
        Length by which the torques about the normals are divided [m].
    centre_of_mass : (3,) array
        Point about which torques are taken [m]; only epsilon depends on it.
    tolerance : float
        Two contacts count as facing each other, and the closed form is used, if both normals are within this angle of
        the line of the contacts [rad]; the volume is then off by up to some 10 times its square.
    with_epsilon : bool
        Whether to find both epsilons, which without a closed form takes longer than the volumes; else they are nan.

    Returns
    -------
    Score
        Epsilon is the lower bound if `scoring.epsilon_search` left a gap.

    Examples
    --------
    >>> from softjaw.scoring.contact import EllipsoidBody, contact_axes
    >>> body = EllipsoidBody([1, 1, 0.2])
    >>> pads = [SoftContact([x, 0, 0], contact_axes([-x, 0, 0], [0, 0, 1]), body) for x in (-0.5, 0.5)]
    >>> found = grasp_score(pads, object_length=1.0, contact_length=1.0)
    >>> found.method, abs(found.quality / (14 / 9 * math.pi**2 * 0.2) - 1) < 1e-12
    ('antipodal', True)
    """
    if len(contacts) < 2:
        raise ValueError(f"contacts has {len(contacts)} entry: a grasp needs at least two")
    lengths = object_length, contact_length, centre_of_mass
    contacts[0].wrench_map(*lengths)  # refuses lengths that are none
    if len(contacts) > 2:
        linf, l1 = (ray_volume(contacts, *lengths, kind=kind) for kind in ("linf", "l1"))
        # Of bodies that are no ellipsoids the estimate tends to be high, by an unknown share of what exceeds the bound.
        errors = [1 - v.lower / v.volume if v.high else v.relative_error for v in (linf, l1)]
        volumes = linf.volume, l1.volume, "rays", max(errors)
    elif faces(contacts, tolerance):
        d = float(np.linalg.norm(contacts[1].position - contacts[0].position)) / object_length
        bodies = [contact.body for contact in contacts]
        sizes = [size for body in bodies for size in (body.volume / contact_length, body.shadow_area)]
        volumes = volume_linf(*sizes, d), volume_l1(*sizes, d), "antipodal", 10 * tolerance**2
    else:
        found = pose_volume(*contacts, *lengths)
        volumes = found.linf, found.l1, "pose", found.relative_error
    epsilons = _epsilons(contacts, *lengths) if with_epsilon else (math.nan, math.nan)
    flag = contact_flag([contact.body for contact in contacts], contact_length)
    return Score(volumes[0], volumes[1], epsilons[0], flag, epsilons[1], *volumes[2:])


def faces(contacts: Sequence[SoftContact], tolerance: float) -> bool:
    """Whether two contacts press against each other along their common line, up to an angle [rad]."""
    line = contacts[1].position - contacts[0].position
    d = float(np.linalg.norm(line))
    N1, N2 = contacts[0].axes[2], contacts[1].axes[2]
    return d > 0 and max(np.abs(N1 * d - line).max(), np.abs(N2 * d + line).max()) <= tolerance * d


def _epsilons(
    contacts: Sequence[SoftContact], object_length: float, contact_length: float, centre_of_mass: ArrayLike
) -> tuple[float, float]:
    """L-infinity and L1, in closed form where there is one."""
    roots = [ellipsoid_matrix(contact.body) for contact in contacts]
    arms = np.array([contact.position for contact in contacts]) - np.asarray(centre_of_mass, float)
    if len(contacts) == 2 and faces(contacts, 1e-12) and all(A is not None for A in roots):
        semi_axes = [_line_axes(contacts[0], contact, A) for contact, A in zip(contacts, roots, strict=True)]
        along = arms @ contacts[0].axes[2]
        on_line = np.abs(arms - np.outer(along, contacts[0].axes[2])).max() <= 1e-12 * np.abs(arms).max()
        if on_line and all(axes is not None for axes in semi_axes):
            sized = [axes / [1, 1, contact_length] for axes in semi_axes]
            a = (along / object_length).tolist()
            return epsilon_linf(*sized, *a), epsilon_l1(*sized, *a)
    bounds = (epsilon(contacts, object_length, contact_length, centre_of_mass, kind) for kind in ("linf", "l1"))
    linf, l1 = (bound.lower for bound in bounds)
    return linf, l1


def _line_axes(first: SoftContact, contact: SoftContact, A: FloatArray) -> FloatArray | None:
    """Semi-axes of an ellipsoid along the first contact's axes; None if it is not aligned with them."""
    turn = first.axes @ contact.axes.T
    B = turn @ A @ turn.T
    axes = B.diagonal().copy()
    return axes if np.abs(B - np.diag(axes)).max() <= 1e-12 * np.abs(axes).max() else None
