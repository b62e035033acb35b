"""What a contact patch from anywhere can carry: friction limits, wrenches, limit surfaces, and the quality of a grasp.

A patch comes in any coordinates and is brought into its contact frame: origin where the line through the centre of
pressure meets it, z along its normal, x along its longer direction or along ``x_axis``.
"""

import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softjaw.friction.patch import ContactPatch, FloatArray
from softjaw.friction.wrench import FrictionLimits
from softjaw.friction.wrench import friction_wrench as wrench_in_frame
from softjaw.lsfit.body import ExactSurface
from softjaw.lsfit.samples import FitErrors
from softjaw.lsfit.surface import FitError, LimitSurface
from softjaw.scoring.quality import Score, grasp_score
from softjaw.study.case.contact import Contact
from softjaw.study.case.evaluate import soft
from softjaw.study.case.limit_surface import STANDS_IN, SurfaceFit, fit_surfaces, six_quartic
from softjaw.study.patch.answer import (
    FITTED_ON,
    SURFACES,
    check_facing,
    contact_of,
    exact_surface,
    grasp_lengths,
    opposite,
)
from softjaw.study.patch.answer import read_patch as read_file
from softjaw.study.patch.patch_reader import Reading
from softjaw.study.quantities import checked_model

ELLIPSOIDS = ("three_motions", "axis_aligned", "full")


class FittedSurface(NamedTuple):
    """A limit surface that was fitted to the friction of a patch.

    Parameters
    ----------
    surface : LimitSurface
        In ``(f_x, f_y, tau_z)`` of the contact frame [N, N, N m]: ``holds``, ``semi_axes``, ``support``, ``volume``.
    fit_error : FitErrors
        Means over motions that it was not fitted to: ``E1`` of ``|P - 1|``, ``Erad`` of the relative error of its
        radius, ``Edir`` of the angle between its normal and the motion [-, -, rad].
    overclaim : float
        Largest share by which it claims too much there [-].
    """

    surface: LimitSurface
    fit_error: FitErrors
    overclaim: float


def read_pressure(
    file: str | Path,
    *,
    unit: str | None = None,
    pressure_unit: str | None = None,
    pressure_name: str | None = None,
    flip_normals: bool = False,
) -> ContactPatch:
    """The contact patch in a pressure field that was measured, or computed elsewhere, as ``softjaw patch`` reads it.

    Parameters
    ----------
    file : path
        Table (.csv) with a face per line, or .vtu or .vtp with an array on cells or points.
    unit, pressure_unit : str, optional
        Units of what carries none: ``m``, ``cm`` or ``mm``; ``pa``, ``kpa`` or ``mpa``.
    pressure_name : str, optional
        Column or array that holds the pressure; by default ``pressure``.
    flip_normals : bool
        Whether all normals are turned to the other side; they point into the object.

    Returns
    -------
    ContactPatch
        Its loaded faces, in the file's coordinates [m, Pa]. What there is to know of the file is a warning.

    Raises
    ------
    StudyError
        The file cannot be read, or what it holds is no patch, with the place of every fault.

    Examples
    --------
    >>> patch = read_pressure("jobs/cylinder-pressure.csv")
    >>> patch.area.shape, round(float(patch.load.sum()), 2)
    ((240,), 12.59)
    """
    read = read_file(str(file), Reading(unit, pressure_unit, pressure_name, flip_normals))
    for note in read.notes:
        warnings.warn(note, stacklevel=2)
    return read.patch


def friction_limits(patch: ContactPatch, mu: float, x_axis: ArrayLike | None = None) -> dict[str, FrictionLimits]:
    """Largest friction of a patch along x and y and about z of its contact frame, and e_n, Eqs. (6)-(11).

    Parameters
    ----------
    patch : ContactPatch
        ``n`` faces in any coordinates.
    mu : float
        Coulomb friction coefficient [-].
    x_axis : (3,) array, optional
        Direction that becomes x; by default the longer direction of the patch.

    Returns
    -------
    dict
        For each friction model (``ccm`` curved; ``pcm`` planar, as in the paper; ``pcm_projected`` planar with the true
        normal force) its `FrictionLimits`: f_x, f_y [N], tau_z [N m], S, F_N [N], e_n [m].

    Raises
    ------
    ValueError
        Normals to both sides, forces that cancel, a direction along the normal, a negative ``mu``.

    Notes
    -----
    Xu, Alt, Zhang, Steinbach: Grasping Posture Estimation for a Two-Finger Parallel Gripper with Soft Material Jaws
    using a Curved Contact Area Friction Model.

    Examples
    --------
    >>> patch = ContactPatch([[0.01, 0, 0], [-0.01, 0, 0]], [1e-4, 1e-4], [[0, 0, 1]] * 2, [1e4, 1e4])
    >>> limits = friction_limits(patch, mu=0.8)["ccm"]
    >>> round(limits.f_x, 12), round(limits.e_n, 12)
    (1.6, 0.01)
    """
    return contact_of(patch, mu, x_axis).limits


def friction_wrench(
    patch: ContactPatch, twist: ArrayLike, mu: float, model: str = "ccm", x_axis: ArrayLike | None = None
) -> FloatArray:
    """Friction wrench of a patch that slips, Eqs. (6)-(8), as the load that drives the motion.

    Parameters
    ----------
    patch, mu, x_axis
        As for `friction_limits`.
    twist : (m, 3) or (m, 6) array
        ``[v_x, v_y, omega_z]`` or ``[v, omega]`` about the origin of the contact frame; only the direction counts.
    model : str
        ``ccm``, ``pcm`` or ``pcm_projected``.

    Returns
    -------
    (m, 6) array
        ``[f_x, f_y, f_z, tau_x, tau_y, tau_z]`` in the contact frame, about its origin [N, N m].

    Raises
    ------
    ValueError
        As for `friction_limits`; a twist of another shape, or that is not finite.

    Examples
    --------
    >>> patch = ContactPatch([[0.01, 0, 0], [-0.01, 0, 0]], [1e-4, 1e-4], [[0, 0, 1]] * 2, [1e4, 1e4])
    >>> float(friction_wrench(patch, [0, 0, 1], mu=0.8).round(9)[0, 5])
    0.016
    """
    return wrench_in_frame(contact_of(patch, mu, x_axis).local, twist, mu, checked_model(model))


def fit_ellipsoid(
    patch: ContactPatch,
    mu: float,
    kind: str = "full",
    model: str = "ccm",
    samples: int = FITTED_ON,
    x_axis: ArrayLike | None = None,
) -> FittedSurface:
    """Ellipsoid as limit surface of a patch.

    Parameters
    ----------
    patch, mu, model, x_axis
        As for `friction_wrench`.
    kind : str
        ``three_motions``: through the largest forces along x and y and the largest torque, as in the paper;
        ``axis_aligned`` or ``full``: least squares, along the axes or in any position.
    samples : int
        Slip motions that it is fitted to.

    Returns
    -------
    FittedSurface
        Surface [N, N, N m] and fit error.

    Raises
    ------
    ValueError
        As for `friction_wrench`; another kind.
    FitError
        The fit failed.

    Examples
    --------
    >>> patch = read_pressure("jobs/cylinder-pressure.csv")
    >>> fit_ellipsoid(patch, mu=0.8, kind="three_motions").surface.holds([1.0, 1.0, 0.01])
    array([ True])
    """
    if kind not in ELLIPSOIDS:
        raise ValueError(f"kind is {kind!r}: expected one of {', '.join(ELLIPSOIDS)}")
    return _fitted(contact_of(patch, mu, x_axis), kind, model, samples)


def fit_quartic(
    patch: ContactPatch,
    mu: float,
    model: str = "ccm",
    samples: int = FITTED_ON,
    x_axis: ArrayLike | None = None,
    wrench: str = "3-D",
) -> FittedSurface:
    """Convex quartic as limit surface of a patch: closer to it than any ellipsoid.

    Parameters
    ----------
    patch, mu, model, samples, x_axis
        As for `fit_ellipsoid`.
    wrench : str
        ``3-D``: the components ``(f_x, f_y, tau_z)``; ``6-D``: all of ``(f, tau)``, for which 1000 samples are few
        and the fit takes some 0.7 s.

    Returns
    -------
    FittedSurface
        Surface [N, N, N m] and fit error; a Gram matrix proves that it is convex.

    Raises
    ------
    ValueError
        As for `friction_wrench`; another name of components.
    FitError
        The fit failed.

    Notes
    -----
    Zhou, Paolini, Bagnell, Mason: A Convex Polynomial Force-Motion Model for Planar Sliding.

    Examples
    --------
    >>> patch = read_pressure("jobs/cylinder-pressure.csv")
    >>> fit_quartic(patch, mu=0.8).fit_error.Erad < fit_ellipsoid(patch, mu=0.8).fit_error.Erad < 0.04
    True
    """
    contact = contact_of(patch, mu, x_axis)
    if wrench == "3-D":
        return _fitted(contact, "quartic", model, samples)
    if wrench != "6-D":
        raise ValueError(f"wrench is {wrench!r}: expected '3-D' or '6-D'")
    return FittedSurface(*six_quartic(contact, checked_model(model), _checked_samples(samples)))


def grasp_quality(
    one: ContactPatch,
    two: ContactPatch | None = None,
    *,
    mu: float,
    distance: float | None = None,
    surface: str = "three_motions",
    model: str = "ccm",
    object_length: float | None = None,
    contact_length: float | None = None,
) -> Score:
    """Quality of a grasp by two patches, for unit normal forces.

    Parameters
    ----------
    one, two : ContactPatch
        In the coordinates of one object, normals into it. Without ``two`` the second contact is like the first, half a
        turn about x and ``distance`` away.
    mu : float
        Coulomb friction coefficient [-].
    distance : float, optional
        Between the contacts, where ``two`` is not given [m].
    surface : str
        ``three_motions``, ``axis_aligned``, ``full``, ``quartic``, or ``exact``, the limit surface itself.
    model : str
        ``ccm``, ``pcm`` or ``pcm_projected``.
    object_length, contact_length : float, optional
        Lengths by which torques of forces and torques about normals are divided [m]; by default the distance, and the
        longer side of the larger contact: along its frame, so of a patch without a longer direction it depends on x.

    Returns
    -------
    Score
        ``quality``, the volume of the grasp wrench space (L-infinity), ``quality_l1``, and ``epsilon``, the radius of
        the largest ball round 0 in it, for a centre of mass halfway between the contacts [-]: a lower bound, a fifth
        too small or more where a surface is no ellipsoid (``softjaw patch`` prints the upper one, too).

    Raises
    ------
    ValueError
        As for `friction_limits`; contacts that do not face each other, neither or both of ``two`` and ``distance``.

    Notes
    -----
    Ferrari, Canny: Planning Optimal Grasps.

    Examples
    --------
    >>> patch = read_pressure("jobs/cylinder-pressure.csv")
    >>> round(grasp_quality(patch, mu=0.8, distance=0.06).quality, 3)
    1.459
    """
    if (two is None) == (distance is None):
        raise ValueError(f"found {'neither' if two is None else 'both'}, expected a second patch or a distance [m]")
    lengths = {"distance": distance, "object_length": object_length, "contact_length": contact_length}
    for name, length in lengths.items():
        if length is not None and (isinstance(length, str) or np.ndim(length) or not 0 < length < np.inf):
            raise ValueError(f"{name} is {length!r}: expected a positive length [m]")
    first = contact_of(one, mu)
    contacts = first, opposite(first, float(distance or 0.0)) if two is None else contact_of(two, mu)
    check_facing(contacts, ("one", "two"))
    _, arms, torques = grasp_lengths(contacts, object_length, contact_length)
    bodies = [_body(c, surface, checked_model(model)) for c in contacts[: 1 if two is None else 2]]
    middle = (contacts[0].origin + contacts[1].origin) / 2
    return grasp_score(soft(contacts, [bodies[0], bodies[-1]]), arms, torques, middle)


def _body(contact: Contact, kind: str, model: str) -> LimitSurface | ExactSurface:
    """Limit surface of a contact per unit of S [-, -, m]."""
    if kind == "exact":
        return exact_surface(contact, model)
    if kind not in SURFACES:
        raise ValueError(f"surface is {kind!r}: expected one of {', '.join((*SURFACES, 'exact'))}")
    return _fit(contact, kind, model, FITTED_ON).body(contact.mu)


def _fitted(contact: Contact, kind: str, model: str, samples: int) -> FittedSurface:
    fit = _fit(contact, kind, checked_model(model), samples)
    surface = fit.body(contact.mu).scaled(np.full(3, contact.limits[model].S))
    return FittedSurface(surface, fit.fit_error, fit.overclaim)


def _fit(contact: Contact, kind: str, model: str, samples: int) -> SurfaceFit:
    fit = fit_surfaces(contact, model, [kind], "least_squares", _checked_samples(samples))[kind]
    if fit.certificate == STANDS_IN:
        raise FitError(f"fit failed of {kind} to the wrenches of {samples} motions; take kind='three_motions'")
    return fit


def _checked_samples(samples: int) -> int:
    if isinstance(samples, bool) or not isinstance(samples, int | np.integer) or samples < 10:
        raise ValueError(f"samples is {samples!r}: expected a whole number of at least 10")
    return int(samples)
