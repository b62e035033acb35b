"""The object's surface, cut at the borders of the map's cells so that every triangle belongs to one grasp candidate.

A surface is a loose set of triangles here: ``corners (m, 3, 6)`` holds position and unit normal of every corner.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softjaw.study.show.pictures import edges

CREASE = math.cos(math.radians(40))  # normals are not averaged over sharper bends
ON_PLANE = 1e-9  # distance from a cutting plane that is only rounding [m]
NOBODY = -1  # cell of triangles that belong to no candidate


@dataclass(frozen=True)
class Cells:
    """The candidates of a map: ``stations (s,)`` [m] and ``angles (a,)`` [rad] of finger 1 about the axis z.

    The place of a candidate is under both fingers, so angles repeat after half a turn, or sooner on an object that
    repeats itself ``symmetry`` times a turn (0: always). ``along`` and ``across`` are the pad's extents [m] along and
    across the axis: they bound the cell of a station that is alone, and of an angle that is alone unless all are alike.
    """

    stations: np.ndarray
    angles: np.ndarray
    symmetry: int
    along: float
    across: float

    @property
    def period(self) -> float:
        """Angle after which the map repeats itself [rad]."""
        return 2 * math.pi / math.lcm(2, max(self.symmetry, 1))

    def borders(self) -> tuple[np.ndarray, np.ndarray]:
        """Planes between the cells: unit normals ``(p, 3)`` and offsets ``(p,)`` [m]."""
        z = edges(np.sort(self.stations), self.along)
        normals, offsets = [np.array([0.0, 0.0, 1.0])] * len(z), list(z)
        for angle in self._between():
            for turn in range(round(math.pi / self.period)):
                phi = angle + turn * self.period
                normals.append(np.array([-math.sin(phi), math.cos(phi), 0.0]))
                offsets.append(0.0)
        if self._narrow:
            for turn in range(round(math.pi / self.period)):
                phi = self.angles[0] + turn * self.period
                normals += [np.array([-math.sin(phi), math.cos(phi), 0.0])] * 2
                offsets += [-0.5 * self.across, 0.5 * self.across]
        return np.array(normals), np.array(offsets)

    def at(self, x: np.ndarray) -> np.ndarray:
        """Candidate ``(n,)`` (station times number of angles plus angle) of points ``(n, 3)`` between the borders."""
        order = np.argsort(self.stations)
        i = np.searchsorted(edges(self.stations[order], self.along), x[:, 2]) - 1
        inside = (i >= 0) & (i < len(order))
        phi = np.arctan2(x[:, 1], x[:, 0])
        known, first = self._different()
        apart = np.abs((phi[:, None] - known + 0.5 * self.period) % self.period - 0.5 * self.period)
        j = first[apart.argmin(axis=1)]
        if self._narrow:
            beside = np.hypot(x[:, 0], x[:, 1]) * np.sin(np.minimum(apart[:, 0], 0.5 * math.pi))
            inside &= beside <= 0.5 * self.across
        return np.where(inside, order[np.clip(i, 0, len(order) - 1)] * len(self.angles) + j, NOBODY)

    @property
    def _narrow(self) -> bool:
        return self.symmetry != 0 and len(self.angles) == 1

    def _different(self) -> tuple[np.ndarray, np.ndarray]:
        """Rising angles within one period that are no images of others, and the first candidate angle of each."""
        share, first = np.unique(np.round(self.angles / self.period % 1.0, 9) % 1.0, return_index=True)
        return share * self.period, first

    def _between(self) -> np.ndarray:
        """Angles halfway between neighbours, round the period."""
        known, _ = self._different()
        if len(known) < 2:
            return np.empty(0)
        return 0.5 * (known + np.append(known[1:], known[0] + self.period))


def coloured(points: np.ndarray, triangles: np.ndarray, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Corners ``(m, 3, 6)`` of a surface cut at the borders of the cells, and the candidate ``(m,)`` of each."""
    corners = with_normals(points, triangles)
    for normal, offset in zip(*cells.borders(), strict=True):
        corners = cut(corners, normal, offset)
    return corners, cells.at(corners[..., :3].mean(axis=1))


def with_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Triangles with smooth normals ``(m, 3, 6)``; edges that bend by more than 40 degrees stay sharp."""
    x = np.asarray(points, float)[triangles]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    size = np.linalg.norm(normal, axis=1)
    x, normal = x[size > 0], normal[size > 0]
    if not len(x):
        return np.empty((0, 3, 6))
    unit = normal / size[size > 0, None]
    span = np.ptp(x, axis=(0, 1)).max()
    _, corner = np.unique(np.round(x.reshape(-1, 3) / span, 7), axis=0, return_inverse=True)
    here, there = _met(corner.ravel())
    there = there // 3  # the triangle it belongs to
    same = np.einsum("ki,ki->k", unit[here // 3], unit[there]) > CREASE
    summed = np.zeros((3 * len(x), 3))
    np.add.at(summed, here[same], normal[there[same]])
    smooth = summed / np.linalg.norm(summed, axis=1, keepdims=True)
    return np.concatenate([x, smooth.reshape(-1, 3, 3)], axis=-1)


def _met(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of corners at one place, itself included: numbers of the one and of the other ``(k,)``."""
    many, order = np.bincount(place), np.argsort(place, kind="stable")
    first, own = np.cumsum(many) - many, many[place]
    here = np.repeat(np.arange(len(place)), own)
    step = np.arange(len(here)) - np.repeat(np.cumsum(own) - own, own)
    return here, order[first[place[here]] + step]


def cut(corners: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """Triangles ``(m, 3, c)`` cut along the plane ``x . normal = offset``; what else a corner carries is linear."""
    d = corners[..., :3] @ normal - offset
    d[np.abs(d) < ON_PLANE] = 0.0
    through = (d.min(axis=1) < 0) & (d.max(axis=1) > 0)
    if not through.any():
        return corners
    sign = np.sign(d[through])
    alone = np.where(sign.sum(axis=1) > 0, sign.argmin(axis=1), sign.argmax(axis=1))
    order = (alone[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(corners[through], order[..., None], axis=1).swapaxes(0, 1)
    da, db, dc = np.take_along_axis(d[through], order, axis=1).T[..., None]
    p, q = a + da / (da - db) * (b - a), a + da / (da - dc) * (c - a)
    pieces = np.concatenate([np.stack(t, axis=1) for t in ((a, p, q), (p, b, c), (p, c, q))])
    return np.concatenate([corners[~through], pieces[areas(pieces) > 0]])


def areas(corners: np.ndarray) -> np.ndarray:
    """Areas ``(m,)`` of triangles."""
    x = corners[..., :3]
    return 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)


def crosses(corners: np.ndarray, cell: np.ndarray, which: Sequence[int], angles: np.ndarray) -> np.ndarray:
    """Segments ``(k, 2, 3)`` that cross out the cells of some candidates under both fingers, just off the surface."""
    found = []
    for candidate in which:
        own = corners[cell == candidate]
        angle = angles[candidate % len(angles)]
        for finger in (0.0, math.pi):
            out = np.array([math.cos(angle + finger), math.sin(angle + finger), 0.0])
            facing = own[(own[:, :, :3].mean(axis=1) @ out) > 0]
            if len(facing):
                found.append(_cross(facing, out))
    return np.concatenate(found) if found else np.empty((0, 2, 3))


def _cross(own: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Two segments over the middle of a cell that is seen from ``out``."""
    x = own[..., :3].reshape(-1, 3)
    beside = np.array([-out[1], out[0], 0.0])
    low, high = x.min(axis=0)[2], x.max(axis=0)[2]
    half = 0.4 * min(high - low, np.ptp(x @ beside))
    middle = 1.002 * (x @ out).max() * out + 0.5 * (low + high) * np.array([0, 0, 1.0])
    arms = [half * (s * beside + np.array([0, 0, 1.0])) for s in (1, -1)]
    return np.array([[middle - arm, middle + arm] for arm in arms])
