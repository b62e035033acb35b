"""The surfaces of a result's object: cut along its candidates' cells or pads, and where its wall's stored places lie.

Positions are in the object's frame [m]. Every display and the export for ParaView draw from here.
"""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import cKDTree
from trimesh.intersections import slice_faces_plane
from trimesh.triangles import area

from softjaw.fem.objects.gap import Pose
from softjaw.friction.patch import NEGLIGIBLE
from softjaw.study.case.build import middle_of, outer_surface, surface_triangles
from softjaw.study.quantities import ALONG, AROUND
from softjaw.study.result.interpolation import closes

FINER = 6  # places between those of the file among which the nearest is searched
NOBODY = -1  # candidate of triangles that no candidate grasps
Feet = Iterable[tuple[int, Pose, float]]  # pads: their candidate, where they first touch, how far they close [m]


class Surface(NamedTuple):
    """Triangles of the object: ``points (n, 3)`` [m], ``triangles (m, 3)``, ``candidate (m,)``, -1 for none.

    A point on the border of two candidates' cells is there twice: ``owner (n,)`` is the candidate of every point.
    """

    points: np.ndarray
    triangles: np.ndarray
    candidate: np.ndarray
    owner: np.ndarray


def surface_of(scene: Any, axes: Any, feet: Feet = ()) -> Surface:
    """The surface of a scene's object, cut along its candidates' cells; with explicit poses below their ``feet``.

    Raises `ValueError, OSError`: the object cannot be built, as when its mesh is not there.
    """
    points, triangles = surface_triangles(scene.object)
    corners = np.asarray(points, float)[triangles]
    # Triangles without area show nothing and would only be cut further.
    corners = corners[area(corners) > 0]
    cell = np.full(len(corners), NOBODY)
    # Explicit poses have no unit on the station axis.
    if not axes[-3].units:
        corners, cell = pressed(corners, feet, scene.gripper.pad_size[:2])
    else:
        middle = middle_of(scene)
        corners = middle.straightened(corners) if middle else corners
        length, width = scene.gripper.pad_size[:2]
        c, s = abs(math.cos(scene.candidates.roll)), abs(math.sin(scene.candidates.roll))
        size = c * length + s * width, c * width + s * length
        corners, cell = coloured(corners, Cells(axes[-3].values, axes[-2].values, scene.object.axis_symmetry, *size))
        corners = middle.straightened(corners, -1.0) if middle else corners
        visible = ~_lid(scene.object, corners)
        corners, cell = corners[visible], cell[visible]
    # After the cuts, corners of neighbours differ by rounding: 1 nm makes them one point again.
    rows = np.column_stack([np.round(corners.reshape(-1, 3), 9), np.repeat(cell, 3)])
    points, inverse = np.unique(rows, axis=0, return_inverse=True)
    return Surface(points[:, :3], inverse.reshape(-1, 3), cell, points[:, 3].astype(int))


def pressed(corners: np.ndarray, feet: Feet, size: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Triangles ``(m, 3, 3)`` cut along what pads of a ``size`` [m] meet, and the candidate ``(m,)`` of each.

    A pad meets what lies before its undeformed face, as deep as it closes. Where pads overlap the first one has it.
    """
    cell = np.full(len(corners), NOBODY)
    for candidate, pose, closing in feet:
        # what stands before first touch is rounding [m]
        low, high = np.array([*(-0.5 * np.array(size)), -1e-3]), np.array([*(0.5 * np.array(size)), closing])
        local = pose.to_pad(corners)
        near = (local.min(axis=1) < high).all(axis=1) & (local.max(axis=1) > low).all(axis=1) & (cell == NOBODY)
        pieces = corners[near]
        for axis, bound in ((0, low), (0, high), (1, low), (1, high), (2, high)):
            normal = pose.rotation[:, axis]
            pieces = cut(pieces, normal, float(pose.origin @ normal + bound[axis]))
        middle = pose.to_pad(pieces.mean(axis=1))
        met = ((middle > low) & (middle < high)).all(axis=1)
        corners = np.concatenate([corners[~near], pieces])
        cell = np.concatenate([cell[~near], np.where(met, candidate, NOBODY)])
    return corners, cell


def edges(values: np.ndarray, alone: float = 1.0) -> np.ndarray:
    """Borders of the cells round rising values, halfway between neighbours; one value gets a cell ``alone`` wide.

    >>> edges(np.array([0.0, 1.0, 3.0]))
    array([-0.5,  0.5,  2. ,  4. ])
    """
    values = np.asarray(values, float)
    if len(values) == 1:
        return values[0] + 0.5 * alone * np.array([-1.0, 1.0])
    beyond = np.pad(values, 1, mode="reflect", reflect_type="odd")
    return 0.5 * (beyond[1:] + beyond[:-1])


class Cells(NamedTuple):
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

    def borders(self) -> list[tuple[np.ndarray, float]]:
        """Planes between the cells: unit normals and offsets [m]."""
        planes = [(np.array([0.0, 0.0, 1.0]), z) for z in edges(np.sort(self.stations), self.along)]
        sides = [(angle, 0.0) for angle in self._between()]
        sides += [(self.angles[0], side * 0.5 * self.across) for side in (-1.0, 1.0)] * self._narrow
        turns = self.period * np.arange(round(math.pi / self.period))
        angles = ((phi + turn, offset) for phi, offset in sides for turn in turns)
        return planes + [(np.array([-math.sin(phi), math.cos(phi), 0.0]), offset) for phi, offset in angles]

    def at(self, x: np.ndarray) -> np.ndarray:
        """Candidate ``(n,)`` (station times number of angles plus angle) of points ``(n, 3)`` between the borders."""
        # A scene may list its stations in any order; the search wants rising ones.
        order = np.argsort(self.stations)
        i = np.searchsorted(edges(self.stations[order], self.along), x[:, 2]) - 1
        inside = (i >= 0) & (i < len(order))
        phi = np.arctan2(x[:, 1], x[:, 0])
        known, first = self._different()
        apart = np.abs((phi[:, None] - known + 0.5 * self.period) % self.period - 0.5 * self.period)
        j = first[apart.argmin(axis=1)]
        inside &= apart.min(axis=1) <= self._half_cell
        if self._narrow:
            # Beyond a quarter turn the sine falls again, which would bring the far side back in.
            beside = np.hypot(x[:, 0], x[:, 1]) * np.sin(np.minimum(apart[:, 0], 0.5 * math.pi))
            inside &= beside <= 0.5 * self.across
        return np.where(inside, order[np.clip(i, 0, len(order) - 1)] * len(self.angles) + j, NOBODY)

    @property
    def _narrow(self) -> bool:
        return self.symmetry != 0 and len(self.angles) == 1

    def _different(self) -> tuple[np.ndarray, np.ndarray]:
        """Rising angles within one period that are no images of others, and the first candidate angle of each."""
        # A share just below 1 is rounded to 1, which is 0 again.
        share, first = np.unique(np.round(self.angles / self.period % 1.0, 9) % 1.0, return_index=True)
        return share * self.period, first

    def _between(self) -> np.ndarray:
        """Angles halfway between neighbours, round the period."""
        known, _ = self._different()
        if len(known) < 2:
            return np.empty(0)
        if self._half_cell < math.inf:
            return np.append(0.5 * (known[1:] + known[:-1]), [known[0] - self._half_cell, known[-1] + self._half_cell])
        return 0.5 * (known + np.append(known[1:], known[0] + self.period))

    @property
    def _half_cell(self) -> float:
        """Angle on either side that belongs to a candidate at the ends of a row which closes no circle [rad]."""
        known, _ = self._different()
        if not self.symmetry or len(known) < 2 or closes(known, self.period):
            return math.inf
        return 0.5 * float(np.diff(known).max())


def coloured(corners: np.ndarray, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Triangles ``(m, 3, 3)`` cut at the borders of the cells, and the candidate ``(m,)`` of each."""
    for normal, offset in cells.borders():
        corners = cut(corners, normal, offset)
    return corners, cells.at(corners.mean(axis=1))


def cut(corners: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """Triangles ``(m, 3, 3)`` cut along the plane ``x . normal = offset``."""
    d = corners @ normal - offset
    through = (d.min(axis=1) < -NEGLIGIBLE) & (d.max(axis=1) > NEGLIGIBLE)
    if not through.any():
        return corners
    points, faces = corners[through].reshape(-1, 3), np.arange(3 * through.sum()).reshape(-1, 3)
    halves = (slice_faces_plane(points, faces, side * normal, offset * normal) for side in (1.0, -1.0))
    pieces = np.concatenate([half[0][half[1]] for half in halves])
    return np.concatenate([corners[~through], pieces[area(pieces) > 0]])


def moved(places: np.ndarray, u: np.ndarray, angle: float) -> np.ndarray:
    """Displacement ``(n, 3)`` of points at `on_wall`, from the grid ``(AROUND, ALONG, 3)`` that begins at ``angle``."""
    around, along = places.T
    known = np.isfinite(around)
    displacement = np.zeros((len(known), 3))
    displacement[known] = between(u, around[known] - angle * AROUND / (2 * np.pi), along[known])
    return displacement


def between(grid: np.ndarray, around: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Values ``(n, c)`` between the places of a grid ``(AROUND, ALONG, c)``, which closes round the axis."""
    closed = np.concatenate([grid, grid[:1]])
    places = np.column_stack([around % AROUND, along])
    return np.asarray(RegularGridInterpolator((np.arange(AROUND + 1), np.arange(ALONG)), closed)(places))


def on_wall(shape: Any, points: np.ndarray) -> np.ndarray | None:
    """Where points ``(n, 3)`` of the surface [m] lie on the wall of a shape ``(n, 2)``; None for shapes without one.

    Around from angle 0 about the axis, and along it, in steps of the file's grid; NaN for points that are not on it.
    """
    grid = undeformed(shape, 0.0)
    if grid is None or not len(points):
        return None
    fine = np.meshgrid(np.arange(0, AROUND, 1 / FINER), np.linspace(0, ALONG - 1, FINER * ALONG), indexing="ij")
    places = np.stack([f.ravel() for f in fine], axis=1)
    distance, nearest = cKDTree(between(grid, *places.T)).query(points)
    # distance from the wall within which a point of the surface moves with it [m]
    return np.where(distance[:, None] > 3e-3, np.nan, places[nearest])


def undeformed(shape: Any, angle: float) -> np.ndarray | None:
    """Outer face ``(AROUND, ALONG, 3)`` of a shape before anything presses, at the places that a file stores.

    ``angle`` is finger 1's about the axis [rad]. None for shapes without a wall that can be traced.
    """
    try:
        surface = outer_surface(shape)
    except (AttributeError, OSError, ValueError):
        return None
    end = surface.wall[1] if shape.open_top else surface.end
    around = angle + 2 * np.pi * np.arange(AROUND) / AROUND
    theta, s = np.meshgrid(around, np.linspace(0.0, end, ALONG), indexing="ij")
    return surface.jets(theta, s)[:, 0].reshape(AROUND, ALONG, 3)


def _lid(shape: Any, corners: np.ndarray) -> np.ndarray:
    """Triangles that close the top of an object that is open there: its surface is that of a solid."""
    if not getattr(shape, "open_top", False) or shape.shape == "mesh":
        return np.zeros(len(corners), bool)
    wall, z = np.asarray(on_wall(shape, corners.reshape(-1, 3))), corners[..., 2]
    # The upper half only: a bottom belongs to the object, a lid does not.
    return np.isnan(wall[:, 0]).reshape(-1, 3).any(axis=1) & (z.mean(axis=1) > 0.5 * (z.min() + z.max()))
