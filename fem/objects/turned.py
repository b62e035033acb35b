"""An outer surface seen from a frame that is turned about its axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from softjaw.fem.objects.outer_surface import OuterSurface
from softjaw.fem.objects.pose import FloatArray
from softjaw.fem.objects.profile import Curve

RIGHT_ANGLE = 1e-9  # how close to a multiple of 90 degrees keeps planes of symmetry [rad]


@dataclass(frozen=True, eq=False)
class Turned:
    """Surface whose angle 0 is the original's ``angle`` [rad]; offers what ``fem.shell.body`` asks of a surface."""

    original: OuterSurface
    angle: float
    round: bool

    @property
    def curve(self) -> Curve:
        """Outline, by the same places s."""
        return self.original.curve

    @property
    def wall(self) -> tuple[float, float]:
        """Part of s between the first and the last section."""
        return self.original.wall

    @property
    def flat(self) -> tuple[float, float]:
        """Ends of the flat lids."""
        return self.original.flat

    @property
    def end(self) -> float:
        """Largest s [m]."""
        return self.original.end

    @property
    def symmetric(self) -> tuple[bool, bool]:
        """Whether x = 0 and y = 0 of the turned frame are planes of symmetry."""
        if self.round:
            return True, True
        quarters = self.angle / (0.5 * np.pi)
        if abs(quarters - round(quarters)) * 0.5 * np.pi > RIGHT_ANGLE:
            return False, False
        return self.original.symmetric[:: -1 if round(quarters) % 2 else 1]

    def station(self, z: float) -> float:
        """Place s on the wall at the height z [m]."""
        return self.original.station(z)

    def jets(self, theta: ArrayLike, s: ArrayLike) -> FloatArray:
        """Position and derivatives in the turned frame, as the original's."""
        return self.original.jets(np.asarray(theta, float) + self.angle, s) @ self._rotation

    def normals(self, theta: ArrayLike, s: ArrayLike) -> FloatArray:
        """Outward unit normals ``(n, 3)`` in the turned frame."""
        return self.original.normals(np.asarray(theta, float) + self.angle, s) @ self._rotation

    @property
    def _rotation(self) -> FloatArray:
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
