"""A contact's limit surface as a body to draw: the forces and torques that it carries without slipping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softjaw.study.case.stored_surface import stored_surface
from softjaw.study.show.data import Data
from softjaw.study.show.tables.ranking import largest

ROWS, COLUMNS = 17, 32  # directions from pole to pole, and round


@dataclass(frozen=True)
class LimitBody:
    """Limit surface of the weaker finger: ``radius (ROWS, COLUMNS)`` [-] along `directions`, and what was fitted.

    ``unit (3,)`` brings it to N, N, N mm.
    """

    radius: np.ndarray
    unit: np.ndarray
    finger: int
    fitted: str

    @property
    def points(self) -> np.ndarray:
        """Points ``(ROWS, COLUMNS, 3)`` in N, N, N mm."""
        return directions() * self.radius[..., None] * self.unit


def directions() -> np.ndarray:
    """Directions ``(ROWS, COLUMNS, 3)`` of latitudes and longitudes."""
    t, phi = np.meshgrid(np.linspace(0, np.pi, ROWS), np.linspace(0, 2 * np.pi, COLUMNS, endpoint=False), indexing="ij")
    return np.stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.cos(t)], axis=-1)


def limit_body(data: Data, index: tuple[int, ...]) -> LimitBody | None:
    """Curved model, weaker finger; None where the file holds no surface with an inside."""
    weakest = data.values("fingers/tau_z_max")
    finger = 0 if weakest is None else largest(-np.nan_to_num(weakest[index][:, 0]))
    found = stored_surface(data, index, finger, "curved")
    if found is None or found.ellipsoid.rank < 3:
        return None
    shape = found.chosen or found.ellipsoid
    u = directions().reshape(-1, 3)
    radius = shape.radius(u)
    if not np.isfinite(radius).all():
        return None
    name = "ellipsoid from three motions" if found.chosen is None else f"fitted, degree {shape.degree}"
    return LimitBody(radius.reshape(ROWS, COLUMNS), found.unit * [1.0, 1.0, 1e3], finger, name)


def quads() -> np.ndarray:
    """Corners ``(k, 4)`` of the body's faces among its points, numbered row by row."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(ROWS - 1), np.arange(COLUMNS), indexing="ij"))
    right = (j + 1) % COLUMNS
    return np.stack([i * COLUMNS + j, (i + 1) * COLUMNS + j, (i + 1) * COLUMNS + right, i * COLUMNS + right], axis=1)
