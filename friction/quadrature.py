"""Patches with four faces in each quadrilateral of a mesh, at its Gauss points: the accurate way to integrate friction.

One face in the middle of each element gives forces and torques with an error of order 2 in the element's size. With the
2 x 2 Gauss points the order is 3 for a smooth pressure (torque of a 2:1 rectangle with 32 x 32 elements: 4e-4 against
1.4e-6); what remains is the kink of the speed at the axis of rotation. On a curved surface order 3 takes the normals at
the corners too, because plane elements describe it to order 2 however many points they have; an outline that bends
within the surface stays of order 2, unless the pressure falls to zero there. Patches from the contact solution need
nothing of this: their faces are quadrature points already.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from softjaw.friction.patch import ContactPatch, FloatArray

GAUSS = 1 / np.sqrt(3)
# Reference coordinates of the corners of an element, in order around it, and of the corners of its four faces.
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
POINTS = GAUSS * CORNERS


def gauss_patch(
    corners: ArrayLike, pressure: ArrayLike | Callable[[FloatArray], FloatArray], corner_normal: ArrayLike | None = None
) -> ContactPatch:
    """Patch with one face at each of the 2 x 2 Gauss points of ``n`` quadrilaterals.

    Parameters
    ----------
    corners : (n, 4, 3) array
        Corners of the quadrilaterals in order around each, all with the same sense [m]; a triangle repeats its last.
    pressure : (n,) array, (n, 4) array or callable
        Constant on each quadrilateral, or at its corners and bilinear between them, or a function of points ``(m, 3)``
        that returns ``(m,)`` [Pa].
    corner_normal : (n, 4, 3) array, optional
        Normals of the surface at the corners, of any length, for elements that curve with it; without them the
        elements are bilinear and have their own normals [-].

    Returns
    -------
    ContactPatch
        ``4 n`` faces, with corners.

    Examples
    --------
    >>> patch = gauss_patch([[[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]], [3.0])
    >>> len(patch.area), float(patch.load.sum().round(12))
    (4, 6.0)
    """
    q = np.asarray(corners, float)
    if q.ndim != 3 or q.shape[1:] != (4, 3):
        raise ValueError(f"corners has shape {q.shape}, expected (n, 4, 3); repeat the last corner of a triangle")
    N, slopes = shape_functions(POINTS)
    r = N @ q
    along = np.stack([slopes[..., 0] @ q, slopes[..., 1] @ q], axis=2)
    if corner_normal is not None:
        r, along = _curved(q, np.asarray(corner_normal, float), r, along)
    facing = np.cross(along[:, :, 0], along[:, :, 1])
    return ContactPatch(
        centroid=r.reshape(-1, 3),
        area=np.linalg.norm(facing, axis=2).ravel(),
        normal=facing.reshape(-1, 3),
        pressure=_pressure(pressure, r, N).ravel(),
        corners=_quarters(q).reshape(-1, 4, 3),
    )


def shape_functions(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bilinear shape functions ``(m, 4)`` and their slopes ``(m, 4, 2)`` at reference points ``(m, 2)``."""
    x, y = points[:, None, 0], points[:, None, 1]
    a, b = CORNERS[:, 0], CORNERS[:, 1]
    slopes = np.stack([a * (1 + b * y), b * (1 + a * x)], axis=-1) / 4
    return (1 + a * x) * (1 + b * y) / 4, slopes


def _curved(q: FloatArray, n: FloatArray, r: FloatArray, along: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points and tangents bent towards the tangent planes of the corners.

    Half of the mean way to those planes, ``1/2 sum_k N_k n_k n_k . (q_k - r)``, is the bow of any quadratic surface
    (Phong tessellation, Boubekeur and Alexa 2008, with the factor 1/2).
    """
    N, slopes = shape_functions(POINTS)
    n = n / np.linalg.norm(n, axis=2, keepdims=True)
    gap = np.einsum("nkc,nkgc->ngk", n, q[:, :, None] - r[:, None])
    closing = -np.einsum("nkc,ngac->ngak", n, along)
    bow = np.einsum("gk,ngk,nkc->ngc", N, gap, n) / 2
    tilt = (np.einsum("gka,ngk,nkc->ngac", slopes, gap, n) + np.einsum("gk,ngak,nkc->ngac", N, closing, n)) / 2
    return r + bow, along + tilt


def _pressure(pressure: ArrayLike | Callable[[FloatArray], FloatArray], r: FloatArray, N: FloatArray) -> FloatArray:
    """Pressures at the Gauss points ``r (n, 4, 3)``, ``(n, 4)``."""
    if callable(pressure):
        return np.asarray(pressure(r.reshape(-1, 3)), float).reshape(r.shape[:2])
    p = np.asarray(pressure, float)
    if p.shape == (len(r),):
        return np.repeat(p[:, None], 4, axis=1)
    if p.shape == (len(r), 4):
        return p @ N.T
    raise ValueError(
        f"pressure has shape {p.shape}, expected {(len(r),)} (one per quadrilateral), {(len(r), 4)} (at its corners) "
        "or a function of points"
    )


def _quarters(q: FloatArray) -> FloatArray:
    """Corners of the four parts that the middle lines cut from each quadrilateral, ``(n, 4, 4, 3)``."""
    ends = (CORNERS[:, None] + CORNERS[None]) / 2
    N, _ = shape_functions(ends.reshape(-1, 2))
    return (N @ q).reshape(len(q), 4, 4, 3)
