"""How the wall of a case moved every point of the object's surface, from the places that its file holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.study.quantities import ALONG, AROUND
from softjaw.study.result.layout import DONE
from softjaw.study.show.data import Data
from softjaw.study.show.outline import undeformed

NEAR = 3e-3  # distance from the wall within which a point of the surface moves with it [m]
FINER = 6  # places between those of the file among which the nearest is searched


@dataclass(frozen=True)
class Wall:
    """Where the points of a surface lie on the wall: ``around (n,)`` and ``along (n,)`` in steps of the file's grid.

    ``around`` counts from angle 0 about the axis; points that are not on the wall have NaN.
    """

    around: np.ndarray
    along: np.ndarray

    def moved(self, u: np.ndarray, angle: float) -> np.ndarray:
        """Displacement ``(n, 3)`` of the points, from the grid's ``(AROUND, ALONG, 3)``, which begins at ``angle``."""
        on = np.isfinite(self.around)
        found = np.zeros((len(on), 3))
        found[on] = between(u, self.around[on] - angle * AROUND / (2 * np.pi), self.along[on])
        return found


def between(grid: np.ndarray, around: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Values ``(n, c)`` between the places of a grid ``(AROUND, ALONG, c)``, which closes round the axis."""
    i, j = np.floor(around).astype(int), np.clip(np.floor(along).astype(int), 0, ALONG - 2)
    s, t = (around - i)[:, None], (along - j)[:, None]
    i, k = i % AROUND, (i + 1) % AROUND
    return (1 - s) * ((1 - t) * grid[i, j] + t * grid[i, j + 1]) + s * ((1 - t) * grid[k, j] + t * grid[k, j + 1])


def wall_of(scene: Any, index: tuple[int, ...], points: np.ndarray) -> Wall | None:
    """Where points ``(n, 3)`` of the surface [m] lie on the wall; None for objects without one."""
    from scipy.spatial import cKDTree

    grid = undeformed(scene, index, 0.0)
    if grid is None or not len(points):
        return None
    fine = np.meshgrid(np.arange(0, AROUND, 1 / FINER), np.linspace(0, ALONG - 1, FINER * ALONG), indexing="ij")
    around, along = (f.ravel() for f in fine)
    distance, nearest = cKDTree(between(grid, around, along)).query(points)
    off = distance > NEAR
    return Wall(np.where(off, np.nan, around[nearest]), np.where(off, np.nan, along[nearest]))


def displacement(data: Data, scene: Any, index: tuple[int, ...]) -> tuple[np.ndarray, float] | None:
    """Displacement of the wall's places ``(AROUND, ALONG, 3)`` [m], and the angle they begin at; None if not stored."""
    rotation = data.values("fingers/pose_rotation")
    places = data.values("wall/place") if data.walled else None
    if places is None or rotation is None or data.status[index] != DONE or not np.isfinite(places[index]).all():
        return None
    approach = rotation[index][0][:, 2]
    angle = float(np.arctan2(-approach[1], -approach[0])) if np.hypot(*approach[:2]) > 1e-6 else 0.0
    before = undeformed(scene, index, angle)
    return None if before is None else (places[index].reshape(AROUND, ALONG, 3) - before, angle)
