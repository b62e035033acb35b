"""Where a line meets a contact area: on plane faces, or on one surface whose normal turns continuously."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from softjaw.friction.patch import NEGLIGIBLE, ContactPatch, FloatArray, slivers

ASLANT = np.array([0.48, 0.64, 0.6])  # a direction in which points of a grid that faces an axis are all apart
UNLOADED = 0.01  # weight of a face's own normal, in mean loads of all faces: the object's counts where there is load


def foot(faces: ContactPatch, start: FloatArray, N: FloatArray) -> tuple[FloatArray, NDArray[np.intp], bool]:
    """Where the line ``start + s N`` meets the faces, the numbers of these, and whether it misses all.

    Of several places the one with the least ``abs(s)``; without corners the nearest centre.

    Of two places that are equally near the one along ``N`` counts. A line through an edge meets the faces on both
    sides; slivers are met by none. A line that meets nothing has its foot on the plane of the face, or the mean of the
    planes of several, whose centre is nearest.
    """
    offset = faces.centroid - start
    along = offset @ N
    away = np.linalg.norm(offset - along[:, None] * N, axis=1)
    slope = faces.normal @ N
    # a line along a face has no foot on its plane: the place beside the centre is taken
    steep = np.abs(slope) < NEGLIGIBLE
    s = np.where(steep, along, (offset * faces.normal).sum(axis=1) / np.where(steep, 1.0, slope))
    corners = faces.corners
    met = np.array([], dtype=int) if corners is None else _pierced(faces, corners, start, N, away, steep)
    if corners is not None and len(met):
        q = corners[met]
        # corners of a warped face lie off its plane, and so does the foot: places closer than that are equally near
        warp = np.abs(((q - faces.centroid[met, None]) * faces.normal[met, None]).sum(axis=-1)).max(axis=1)
        margin = NEGLIGIBLE * np.ptp(q, axis=1).max(axis=1) + warp
        nearest = met[_nearest(s[met], margin)]
        met = met[np.abs(s[met] - s[nearest]) <= margin]
        return start + s[nearest] * N, met, False
    # all centres that are equally near count, or which one does would hang on rounding
    met = np.flatnonzero(away <= away.min() + NEGLIGIBLE * np.sqrt(faces.area.max()))
    return start + s[met].mean() * N, met, True


def _nearest(s: FloatArray, margin: FloatArray) -> int:
    """Position of the least ``abs(s)``; of those that are equal within the margin, the one with the largest ``s``."""
    tied = np.flatnonzero(np.abs(s) <= np.abs(s).min() + margin)
    return int(tied[np.argmax(s[tied])])


def _pierced(
    faces: ContactPatch, corners: FloatArray, start: FloatArray, N: FloatArray, away: FloatArray, steep: np.ndarray
) -> np.ndarray:
    """Faces, edges included, that the line through ``start`` along ``N`` runs through."""
    offset = corners - faces.centroid[:, None]
    reach = np.sqrt(np.einsum("ikj,ikj->ik", offset, offset).max(axis=1))
    # few faces come near the line: the exact test is for these alone
    near = np.flatnonzero((away <= (1 + 1e-6) * reach) & ~steep)
    if not len(near):
        return near
    q = (corners[near] - start) @ _across(N).T
    d = np.roll(q, -1, axis=1) - q
    side = d[..., 1] * q[..., 0] - d[..., 0] * q[..., 1]
    slack = NEGLIGIBLE * reach[near, None] * np.linalg.norm(d, axis=-1)
    return near[(side >= -slack).all(axis=1) | (side <= slack).all(axis=1)]


def _across(N: FloatArray) -> FloatArray:
    """Two directions ``(2, 3)`` at right angles to ``N`` and to each other."""
    return np.linalg.svd(N[None])[2][1:]


class ContactFace(NamedTuple):
    """One surface of bilinear faces, loaded or not, whose normal is bilinear between the corners.

    ``corners, normal (n, 4, 3)``: around each face, and unit normals there; faces that share a corner share both [m].
    """

    corners: FloatArray
    normal: FloatArray

    @classmethod
    def of(cls, patch: ContactPatch) -> ContactFace:
        """The contact face of a pad from all faces of its patch, the unloaded ones included.

        The normal at a corner is the mean of those of the faces around it. A face counts with its normal, which is
        the object's, times its load, and with the normal of its own plane times a small share `UNLOADED` of the mean
        load: where there is no load the object may be far away, and its nearest point jump.
        """
        q = patch.corners
        assert q is not None
        # the diagonals give the area vector of a warped face too, whichever way it is split
        plane_normal = patch.area_vectors[0]
        length = np.linalg.norm(plane_normal, axis=1)
        plane_normal = plane_normal * (~slivers(*patch.area_vectors) / np.where(length > 0, length, 1.0))[:, None]
        plane_normal *= np.sign(patch.load @ (plane_normal * patch.normal).sum(axis=1))
        share = patch.load[:, None] * patch.normal + UNLOADED * patch.load.mean() * plane_normal
        # corners no farther apart than this share of a usual face's size are one
        points, apart = q.reshape(-1, 3), 1e-6 * np.median(np.ptp(q, axis=1).max(axis=1))
        along = points @ ASLANT  # sorted here, as a sort takes seconds to compile
        corner = _numbered(points, along, np.argsort(along), apart)
        total = np.column_stack([np.bincount(corner, np.repeat(share, 4, axis=0)[:, k]) for k in range(3)])
        length = np.linalg.norm(total, axis=1, keepdims=True)
        return cls(q, (total / np.where(length > 0, length, 1.0))[corner].reshape(q.shape))

    def foot(self, start: FloatArray, N: FloatArray) -> tuple[FloatArray, FloatArray, bool]:
        """Where the line ``start + s N`` meets the face, the normal there, and whether the line misses the face.

        Of several places the one with the least ``abs(s)``, as in `foot`; beside a face that the line misses, the
        point of its rim that is nearest to the line, moved onto the line.
        """
        across = _across(N)
        near, weights = _on_line(self.corners, start, across)
        missed = not len(near)
        if missed:
            near, weights = _beside((self.corners - start) @ across.T)
        s = np.einsum("nk,nkc->nc", weights, self.corners[near] - start) @ N
        k = _nearest(s, NEGLIGIBLE * np.ptp(self.corners[near], axis=1).max(axis=1))
        normal = weights[k] @ self.normal[near[k]]
        return start + s[k] * N, normal / np.linalg.norm(normal), missed


@njit(cache=True)
def _numbered(points, along, order, apart):
    """Numbers ``(n,)`` that are the same for points ``(n, 3)`` no more than ``apart`` from each other.

    ``along (n,)``: how far they are along some direction; ``order (n,)``: that they have there.
    """
    number = np.arange(len(points))
    for i, a in enumerate(order):
        for b in order[i + 1 :]:
            if along[b] - along[a] > 1.001 * apart:  # the rest is for rounding
                break
            if ((points[a] - points[b]) ** 2).sum() <= apart**2:
                number[max(a, b)] = min(number[max(a, b)], a, b)
    return number


@njit(cache=True)
def _on_line(corners, start, across):
    """Faces ``(n, 4, 3)`` that a line runs through, and the weights ``(n, 4)`` of their corners there.

    Corners are complex numbers along both directions ``across (2, 3)`` of the line.
    """
    met, weights, count = np.empty(len(corners), np.int64), np.empty((len(corners), 4)), 0
    turn, q = across[0] + 1j * across[1], np.empty(4, np.complex128)
    for i in range(len(corners)):
        for k in range(4):
            x = corners[i, k]
            q[k] = (x[0] - start[0]) * turn[0] + (x[1] - start[1]) * turn[1] + (x[2] - start[2]) * turn[2]
        a, b, c, d = q[0], q[1], q[2], q[3]
        # most faces are nowhere near, which components tell without a root
        x, y, z, middle = a - b, a - c, b - d, a + b + c + d
        most = abs(x.real) + abs(x.imag) + abs(y.real) + abs(y.imag) + abs(z.real) + abs(z.imag)
        if max(abs(middle.real), abs(middle.imag)) > 4 * most:
            continue
        size = abs(x) + abs(y) + abs(z)
        if abs(middle) > 4 * size:
            continue
        u, v = _reference(a, b, c, d)
        w = (1 - u) * (1 - v) / 4, (1 + u) * (1 - v) / 4, (1 + u) * (1 + v) / 4, (1 - u) * (1 + v) / 4
        distance = abs(w[0] * a + w[1] * b + w[2] * c + w[3] * d)
        # Newton may end at the rim of the region it is kept in: only points that are on the line count
        if max(abs(u), abs(v)) <= 1 + NEGLIGIBLE and distance <= NEGLIGIBLE * size:
            met[count], weights[count] = i, w
            count += 1
    return met[:count], weights[:count]


@njit(cache=True)
def _reference(a, b, c, d):
    """Coordinates ``u, v`` of the point 0 in the quadrilateral of four complex numbers, by Newton's method."""
    u = v = 0.0
    for _ in range(20):  # bilinear faces take three or four
        r = ((1 - u) * ((1 - v) * a + (1 + v) * d) + (1 + u) * ((1 - v) * b + (1 + v) * c)) / 4
        du, dv = ((b - a) * (1 - v) + (c - d) * (1 + v)) / 4, ((d - a) * (1 - u) + (c - b) * (1 + u)) / 4
        det, step_u, step_v = (du.conjugate() * dv).imag, (dv.conjugate() * r).imag, (r.conjugate() * du).imag
        # steps are cut at 3 half-widths: a face that the line misses need not converge, only stay outside
        flat = abs(det) <= NEGLIGIBLE * abs(du) * abs(dv)
        u = min(max(u + (3.0 if flat else step_u / det), -3.0), 3.0)
        v = min(max(v + (3.0 if flat else step_v / det), -3.0), 3.0)
        if max(abs(step_u), abs(step_v)) <= NEGLIGIBLE * abs(det):  # Newton squares it: rounding is reached
            break
    return u, v


def _beside(q: FloatArray) -> tuple[np.ndarray, FloatArray]:
    """Number of the face and weights of its corners for the point of all edges nearest to 0; ``q (n, 4, 2)``."""
    d = np.roll(q, -1, axis=1) - q
    square = (d**2).sum(axis=-1)
    t = np.clip(-(q * d).sum(axis=-1) / np.where(square > 0, square, 1.0), 0.0, 1.0)
    away = np.linalg.norm(q + t[..., None] * d, axis=-1)
    face, k = np.unravel_index(int(np.argmin(away)), away.shape)
    weights = np.zeros((1, 4))
    weights[0, k], weights[0, (k + 1) % 4] = 1 - t[face, k], t[face, k]
    return np.array([face]), weights
