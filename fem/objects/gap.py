"""What every object offers, and the small pieces that the analytic ones share."""

from __future__ import annotations

from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.objects.pose import FloatArray, Pose

IntArray = NDArray[np.int64]
Gap = tuple[FloatArray, FloatArray, FloatArray]
Surface = tuple[FloatArray, IntArray]


class GapFunction(Protocol):
    """Signed distance with its first two derivatives, in the object's frame."""

    def gap(self, x: FloatArray) -> Gap:
        """``(g (n,), normal (n, 3), hessian (n, 3, 3))`` at the points ``x (n, 3)`` [m, -, 1/m]; g > 0 outside."""
        ...


class GapObject(GapFunction, Protocol):
    """An object that a pad can be pressed on."""

    @property
    def bounds(self) -> FloatArray:
        """Lower and upper corner of the object, ``(2, 3)`` [m]."""
        ...

    @property
    def axis_symmetry(self) -> int:
        """Order of the rotational symmetry about z; 0 means every angle, 1 means none."""
        ...

    def surface(self) -> Surface:
        """Points ``(k, 3)`` [m] and triangles ``(m, 3)`` for drawing."""
        ...

    def near(self, pose: Pose, lower: FloatArray, upper: FloatArray) -> GapFunction:
        """Gap function for use inside a box of the pad's frame."""
        ...


class Analytic:
    """Shapes whose gap function costs the same everywhere."""

    def near(self, pose: Pose, lower: FloatArray, upper: FloatArray) -> Self:
        """Return the shape itself: a closed form needs no region."""
        return self


def radial(d: FloatArray) -> Gap:
    """Length of the rows of ``d (n, k)``, its gradient and Hessian; a fixed direction at the centre itself.

    The Hessian grows as 1/length; below 1e-9 m it is held, so that nothing becomes infinite.
    """
    r = np.linalg.norm(d, axis=1)
    e = d / np.where(r > 0, r, 1.0)[:, None]
    e[r == 0, 0] = 1.0
    H = (np.eye(d.shape[1]) - e[:, :, None] * e[:, None, :]) / np.maximum(r, 1e-9)[:, None, None]
    return r, e, H


def in_plane(x: FloatArray, n: FloatArray, H: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Put the normal ``(n, 2)`` and Hessian ``(n, 2, 2)`` of a cross-section into space; axis z."""
    normal, hessian = np.zeros((len(x), 3)), np.zeros((len(x), 3, 3))
    normal[:, :2], hessian[:, :2, :2] = n, H
    return normal, hessian


def grid_triangles(rows: int, columns: int, *, closed: bool = False) -> IntArray:
    """Triangles over a grid of ``rows x columns`` points, numbered row by row; ``closed`` joins the last column."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns if closed else columns - 1), indexing="ij")
    a, b = (i * columns + j).ravel(), (i * columns + (j + 1) % columns).ravel()
    return np.concatenate([np.stack([a, b, a + columns], 1), np.stack([b, b + columns, a + columns], 1)])
