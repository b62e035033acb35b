"""The milliseconds baseline: a pad of independent springs, a planar contact patch.

Every point of the pad's face is a spring of the foam's stiffness in confined compression, ``E_oed / thickness``, and
feels nothing of its neighbours; all normals are those of the undeformed pad. The travel at a force is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import ContactPatch
from softjaw.study.case.model import Finger
from softjaw.study.scene.sections import Gripper

FloatArray = NDArray[np.float64]
POINTS = (50, 22)  # along length and width
STEPS, FLAT = 8, 0.2  # Newton steps along the approach, and the least cosine that they divide by


@dataclass(frozen=True, eq=False)
class WinklerPad:
    """A bed of springs.

    Parameters
    ----------
    place : (n, 2) array
        Middles of equal cells of the pad's face [m].
    area : float
        Of each cell [m^2].
    height : (n,) array
        Travel at which each cell touches [m]; infinite where there is no object before it.
    stiffness : float
        Pressure over shortening [Pa/m].
    """

    place: FloatArray
    area: float
    height: FloatArray
    stiffness: float

    def travel(self, force: float) -> float:
        """Travel that carries a normal force [m]: the force is piecewise linear in it, with a knee at every height."""
        h = np.sort(self.height[np.isfinite(self.height)])
        count = np.arange(1, len(h) + 1)
        wanted = (force / (self.stiffness * self.area) + np.cumsum(h)) / count
        return float(wanted[np.flatnonzero(wanted >= h)[-1]])

    def patch(self, force: float) -> ContactPatch:
        """Planar patch in the pad's frame at a normal force [N]."""
        pressure = self.stiffness * np.maximum(self.travel(force) - self.height, 0.0)
        place = np.column_stack([self.place, np.zeros(len(self.place))])
        side = 0.5 * np.array([np.ptp(np.unique(x)) / max(len(np.unique(x)) - 1, 1) for x in self.place.T])
        ring = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*side, 0.0]
        normal = np.broadcast_to([0.0, 0.0, 1.0], place.shape)
        return ContactPatch(place, np.full(len(place), self.area), normal, pressure, place[:, None] + ring)


def winkler_pad(gripper: Gripper, finger: Finger, points: tuple[int, int] = POINTS) -> WinklerPad:
    """Bed of springs of a pad at first touch with an object."""
    length, width, thickness = gripper.pad_size
    nx, ny = points
    x, y = ((np.arange(n) + 0.5) / n - 0.5 for n in (nx, ny))
    place = np.stack(np.meshgrid(length * x, width * y, indexing="ij"), axis=-1).reshape(-1, 2)
    return WinklerPad(place, length * width / (nx * ny), _heights(finger, place, thickness), stiffness(gripper))


def stiffness(gripper: Gripper) -> float:
    """Modulus of confined compression over the pad's thickness [Pa/m]."""
    nu = 0.25 if gripper.material == "blatz_ko" else gripper.poisson_ratio
    return 2.0 * gripper.shear_modulus * (1.0 - nu) / (1.0 - 2.0 * nu) / gripper.pad_thickness


def _heights(finger: Finger, place: FloatArray, thickness: float) -> FloatArray:
    """Distance along the approach from points of the face to the object ``(n,)`` [m]."""
    x = np.column_stack([place, np.zeros(len(place))])
    for _ in range(STEPS):
        gap, normal, _ = finger.gap(x)
        x[:, 2] = np.clip(x[:, 2] + gap / np.maximum(-normal[:, 2], FLAT), 0.0, thickness)
    gap = finger.gap(x)[0]
    return np.where(np.abs(gap) < 1e-3 * thickness, x[:, 2], np.inf)
