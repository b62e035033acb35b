"""From changes to bands: sensitivities by formula, and errors of a few probes carried to all cases. Plain arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
TIE = 1e-6  # relative difference of values that is none: images of one grasp
TIMES = 2.0  # root mean squares of the probes that a band is wide: about 95 of 100 cases lie within
POWER = 5  # of mu in the quality of contacts that face each other: three axes of one finger's surface, two of the other


def carried(change: FloatArray, area: FloatArray, all_areas: FloatArray) -> FloatArray:
    """Error of the mesh of every case from that of the probes: it falls with the number of loaded faces.

    Parameters
    ----------
    change : (p, k) array
        Relative differences between two meshes at the probes, for each force; NaN where there are none.
    area : (p, k) array
        Their contact areas.
    all_areas : (..., k) array
        Those of all cases.

    Returns
    -------
    (..., k) array
        Twice the root mean square of change x area over probes and forces, over the area of each case.

    Examples
    --------
    >>> carried(np.array([[0.02, 0.01]]), np.array([[1.0, 2.0]]), np.array([[1.0, 2.0, 4.0]])).tolist()
    [[0.04, 0.02, 0.01]]
    """
    return TIMES * _rms(change * area, None) / all_areas


def carried_by_force(change: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Relative change of every case from that of the probes: twice its root mean square at each force.

    Parameters
    ----------
    change : (p, k) array
        NaN where there is none.
    shape : tuple of int
        Of all cases, the last one being the force.

    Examples
    --------
    >>> carried_by_force(np.array([[0.1, 0.3], [-0.1, np.nan]]), (1, 2)).round(12).tolist()
    [[0.2, 0.6]]
    """
    return np.broadcast_to(TIMES * _rms(change, 0), shape).copy()


def _rms(values: FloatArray, axis: int | None) -> FloatArray:
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    mean = np.where(known, values, 0.0) ** 2
    return np.sqrt(np.divide(mean.sum(axis=axis), count, out=np.full(np.shape(count), np.nan), where=count > 0))


def at_least_own(share: FloatArray, change: FloatArray, probes: tuple[int, ...], values: FloatArray) -> FloatArray:
    """The band of a probe, and of its images, is no narrower than what was seen there.

    ``share`` and ``values`` are ``(candidates, k)``, ``change`` ``(p, k)``.
    """
    found = share.copy()
    for own, number in zip(np.abs(change), probes, strict=True):
        alike = np.isclose(values, values[number], rtol=TIE, atol=0.0, equal_nan=True).all(axis=-1)
        found[alike] = np.fmax(found[alike], own)
    return found


def largest_side(changes: FloatArray, pairs: list[int]) -> FloatArray:
    """Several inputs of one part together: of each the larger side, added as independent ones.

    ``changes`` is ``(..., v)``, ``pairs`` tells the input of each of the ``v`` solves.

    >>> largest_side(np.array([0.3, -0.1, 0.4]), [0, 0, 1]).round(12).tolist()
    0.5
    """
    sides = [np.abs(changes[..., [p == pair for p in pairs]]) for pair in dict.fromkeys(pairs)]
    return np.sqrt(sum(side.max(axis=-1) ** 2 for side in sides))


def change_by_modulus(force: FloatArray, values: FloatArray, share: float) -> FloatArray:
    """Relative change of values for a modulus larger by ``share``, where they depend on force over modulus only.

    It is minus the slope of ln(value) over ln(force), times the share.

    Parameters
    ----------
    force : (k,) array
        At least two [N].
    values : (..., k) array
        Positive; NaN where there is none.
    share : float

    Examples
    --------
    >>> change_by_modulus(np.array([1.0, 2.0, 4.0]), np.array([1.0, 2.0, 4.0]), 0.1).round(12).tolist()
    [-0.1, -0.1, -0.1]
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.log(np.where(values > 0, values, np.nan))
    return -share * np.gradient(logarithm, np.log(force), axis=-1)


def change_along(station: FloatArray, values: FloatArray, shift: float) -> FloatArray:
    """Relative change of a map for a shift along its stations, as its own slope tells, without sign.

    Parameters
    ----------
    station : (s,) array
        At least two [m].
    values : (s, ...) array
        Positive; NaN where there is none.
    shift : float
        [m].

    Examples
    --------
    >>> change_along(np.array([0.0, 1.0, 2.0]), np.exp([0.0, 3.0, 6.0]), 0.1).round(12).tolist()
    [0.3, 0.3, 0.3]
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.log(np.where(values > 0, values, np.nan))
    return np.abs(shift * np.gradient(logarithm, station, axis=0))


def change_by_mu(share: float) -> float:
    """Relative change of the quality of contacts that face each other for a mu larger by ``share``.

    Half the difference between both sides.

    >>> round(change_by_mu(0.01), 6)
    0.05001
    """
    return ((1 + share) ** POWER - (1 - share) ** POWER) / 2
