"""Samples of a limit surface: wrenches on it and the motions normal to it, free of units."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


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
    if not (force > 0 and rho > 0):
        raise ValueError(f"force is {force} and rho is {rho}: samples are normalised by a positive force and length")
    w, t = np.atleast_2d(np.asarray(wrench, float)), np.atleast_2d(np.asarray(twist, float))
    W = (w[:, [0, 1, 5]] if w.shape[1] == 6 else w) / force / [1.0, 1.0, rho]
    T = t * [1.0, 1.0, rho]
    length = np.linalg.norm(T, axis=1, keepdims=True)
    if (length == 0).any():
        raise ValueError(f"twist[{int(np.argmin(length))}] is zero: a sample needs a direction of motion")
    return W, T / length


def sample_rank(W: ArrayLike, tolerance: float = 1e-9) -> int:
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
