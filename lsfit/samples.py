"""Samples of a limit surface: wrenches on it and the motions normal to it, free of units."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from softjaw.lsfit.surface import ZERO_SHARE, FitFlag

FloatArray = NDArray[np.float64]
THIN_RATIO = 1e-3  # of principal lengths of samples: below it they carry the flag THIN
FLAT_RATIO = 1e-9  # of principal lengths: below it samples are flat


def normalised_samples(wrench: ArrayLike, twist: ArrayLike, force: float, rho: float) -> tuple[FloatArray, FloatArray]:
    """Wrenches ``(f_x, f_y, tau / rho) / force`` and unit motions ``(v_x, v_y, rho omega) / |.|``.

    With ``rho`` in proportion to the patch, equal patches of any size and unit give equal samples.

    Parameters
    ----------
    wrench : (m, 3) or (m, 6) array
        ``[f_x, f_y, tau_z]``, or all six components of which these three are taken [N, N m].
    twist : (m, 3) array
        ``[v_x, v_y, omega_z]`` [m/s, rad/s].
    force : float
        ``mu S`` [N].
    rho : float
        Length of the contact [m].

    Returns
    -------
    W, T : (m, 3) array
        Wrenches and unit motions [-].
    """
    w, t = np.atleast_2d(np.asarray(wrench, float)), np.atleast_2d(np.asarray(twist, float))
    return _normalised(w[:, [0, 1, 5]] if w.shape[1] == 6 else w, t, force, rho)


def six_samples(
    wrench: ArrayLike, twist: ArrayLike, force: float, rho: float, point: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[FloatArray, FloatArray]:
    """Wrenches ``(f, tau / rho) / force`` and unit motions ``(v, rho omega) / |.|`` of a reference point.

    Parameters
    ----------
    wrench, twist : (m, 6) array
        ``[f, tau]`` about, and ``[v, omega]`` of, the origin [N, N m; m/s, rad/s].
    force : float
        ``mu S`` [N].
    rho : float
        Length of the contact [m].
    point : (3,) array
        Reference point in the contact frame, such as the centre of pressure [m]; the power of no sample changes.

    Returns
    -------
    W, T : (m, 6) array
        Wrenches and unit motions [-].
    """
    w, t = np.atleast_2d(np.array(wrench, float)), np.atleast_2d(np.array(twist, float))
    if w.shape != t.shape or w.shape[1] != 6:
        raise ValueError(f"wrench has shape {w.shape} and twist {t.shape}: expected (m, 6) for both")
    p = np.asarray(point, float)
    # torque and velocity change together, so that w . t is the same about either point
    w[:, 3:] -= np.cross(p, w[:, :3])
    t[:, :3] += np.cross(t[:, 3:], p)
    return _normalised(w, t, force, rho)


def _normalised(w: FloatArray, t: FloatArray, force: float, rho: float) -> tuple[FloatArray, FloatArray]:
    """Samples free of units, of three components, the last a torque, or of six, the last three torques."""
    if not (force > 0 and rho > 0):
        raise ValueError(f"force is {force} and rho is {rho}: samples are normalised by a positive force and length")
    size = np.array([1.0, 1.0, rho] if t.shape[1] == 3 else [1.0, 1.0, 1.0, rho, rho, rho])
    # a torque is divided by rho and a rotation multiplied by it: powers keep their value
    T = t * size
    length = np.sqrt(np.einsum("md,md->m", T, T))
    if not length.all():
        raise ValueError(f"twist[{int(np.argmin(length))}] is zero: a sample needs a direction of motion")
    return w / force / size, T / length[:, None]


def sphere_motions(count: int, dimension: int = 6) -> FloatArray:
    """Unit motions spread evenly over the sphere, ``(count, dimension)``, the same in every run.

    The additive recurrence by powers of the generalised golden ratio fills the unit cube evenly; the normal quantile
    of each number makes it evenly spread over directions.
    """
    # fixed-point iteration for the root of x^(d + 1) = x + 1
    root = 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (dimension + 1))
    u = (0.5 + np.outer(np.arange(1, count + 1), root ** -np.arange(1.0, dimension + 1))) % 1
    # independent normal numbers have a density that depends on the length alone: no direction is favoured
    x = ndtri(u)
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def sample_rank(W: ArrayLike, tolerance: float = FLAT_RATIO) -> int:
    """Dimension of the space that the samples span; below 3, no limit surface can be fitted to them alone.

    Parameters
    ----------
    W : (m, d) array
        Normalised wrenches [-].
    tolerance : float
        Singular values below this share of the largest count as zero.
    """
    values = np.linalg.svd(np.asarray(W, float), compute_uv=False)
    return int((values > tolerance * values.max(initial=0.0)).sum())


def checked_wrenches(W: ArrayLike, dimension: int | None = None) -> FloatArray:
    """Wrenches to fit a surface to, ``(m, d)``, without those that are zero, or the rounding of that (`ZERO_SHARE`).

    Raises
    ------
    ValueError
        If there are none, one is not finite, or they do not have ``dimension`` components.
    """
    W = np.asarray(W, float)
    if W.ndim != 2 or len(W) == 0 or (dimension is not None and W.shape[1] != dimension):
        raise ValueError(f"W has shape {W.shape}: expected wrenches as rows, (m, {dimension or 'd'})")
    if not np.isfinite(W).all():
        raise ValueError(f"W[{int(np.argmin(np.isfinite(W).all(axis=1)))}] is not finite: drop it or correct it")
    pressed = _pressed(W)
    if not pressed.any():
        raise ValueError("all wrenches are zero: a contact without friction has no limit surface to fit")
    return W if pressed.all() else W[pressed]


def checked_motions(W: ArrayLike, T: ArrayLike | None) -> tuple[FloatArray, FloatArray | None]:
    """`checked_wrenches` with their motions ``(m, d)``, which must have the length 1, or without."""
    if T is None:
        return checked_wrenches(W), None
    W, T = np.asarray(W, float), np.asarray(T, float)
    if W.shape != T.shape:
        raise ValueError(f"W has shape {W.shape} and T {T.shape}: every wrench needs its motion")
    wrenches = checked_wrenches(W)
    length = np.sqrt(np.einsum("md,md->m", T, T))
    # asked this way round, a length that is not a number fails too
    if not abs(length - 1).max() <= 1e-5:
        # nan counts as infinitely wrong, so that the message names it first
        n = int(np.argmax(np.where(np.isfinite(length), abs(length - 1), np.inf)))
        raise ValueError(f"T[{n}] has length {length[n]}: expected unit motions, as normalised_samples gives them")
    return wrenches, T if len(wrenches) == len(T) else T[_pressed(W)]


def _pressed(W: FloatArray) -> NDArray[np.bool_]:
    """Which wrenches are not zero, ``(m,)``."""
    # squares of lengths, hence the square of the share
    size = np.einsum("md,md->m", W, W)
    return size > ZERO_SHARE**2 * size.max()


def principal_frame(W: FloatArray) -> tuple[FloatArray, FloatArray, FitFlag]:
    """Coordinates ``w = B y`` in the span of the samples, in which their components have the mean square 1.

    Returns
    -------
    B : (d, r) array
        Map onto the span; its rank is `sample_rank`.
    Y : (m, r) array
        The samples.
    flag : FitFlag
        Whether the samples are flat or thin.
    """
    # of W itself: the product W'W squares the ratio of long and short directions, and loses the short
    U, values, V = np.linalg.svd(W, full_matrices=False)
    r = int((values > FLAT_RATIO * values[0]).sum())
    flag = FitFlag.CLEAN if r == W.shape[1] else FitFlag.RANK_DEFICIENT
    flag |= FitFlag.THIN if values[r - 1] < THIN_RATIO * values[0] else FitFlag.CLEAN
    # columns of U have the length 1: times sqrt(m) their mean square is 1
    size = np.sqrt(len(W))
    V[np.abs(V) < 1e-15] = 0.0  # components that no sample has stay exactly zero
    return V[:r].T * (values[:r] / size), U[:, :r] * size, flag
