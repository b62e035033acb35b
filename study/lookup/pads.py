"""Poses of both pads between solved stations and angles, as they stand: no angle is folded to an image of itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softjaw.study.lookup.interpolation import FloatArray
from softjaw.study.lookup.source import Source
from softjaw.study.quantities import DONE

PLACE_ROUNDING = 1e-9  # how far beside a solved place [m, rad] counts as on it


def pad_poses(source: Source, place: FloatArray, by_poses: bool) -> tuple[FloatArray, FloatArray]:
    """Rotations ``(m, 2, 3, 3)`` and origins ``(m, 2, 3)`` [m] of both pads at first touch; NaN outside of the map.

    Parameters
    ----------
    source : Source
    place : (m, 3) array
        Station [m] or number of the pose, angle [rad], force [N].
    by_poses : bool
        Whether the first is a number.
    """
    stations = np.arange(source.status.shape[0]) if by_poses else source.axes[0].values
    i, r = _neighbours(stations, place[:, 0])
    j, t = _neighbours(source.axes[1].values, 0.0 * place[:, 1] + source.axes[1].values[0] if by_poses else place[:, 1])
    solved = (source.status == DONE).argmax(axis=-1)  # a pose is the same at every force
    R, x = np.zeros((len(place), 2, 3, 3)), np.zeros((len(place), 2, 3))
    for a, along in enumerate((1 - r, r)):
        for b, about in enumerate((1 - t, t)):
            weight, at = along * about, (i[a], j[b], solved[i[a], j[b]])
            for name, pose in (("pose_rotation", R), ("pose_origin", x)):
                values = source.read(f"fingers/{name}")[at]
                share = weight.reshape(-1, *[1] * (values.ndim - 1))
                pose += np.where(share == 0, 0.0, share * values)  # a corner that does not count may have no value
    whole = np.isfinite(R).all(axis=(1, 2, 3))
    U, _, V = np.linalg.svd(R[whole])
    R[whole] = U @ V
    return R, x


def _neighbours(values: FloatArray, x: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Positions ``(2, m)`` of the values below and above ``x (m,)``, and the share of the upper one; NaN outside."""
    order = np.argsort(values)
    v = np.asarray(values, float)[order]
    near = np.clip(x, v[0], v[-1])
    low = np.clip(np.searchsorted(v, near, side="right") - 1, 0, max(len(v) - 2, 0))
    high = np.minimum(low + 1, len(v) - 1)
    share = (near - v[low]) / np.where(high > low, v[high] - v[low], 1.0)
    return np.stack([order[low], order[high]]), np.where(np.abs(x - near) > PLACE_ROUNDING, np.nan, share)
