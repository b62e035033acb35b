"""Rigid placement of a pad in the object's frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """Where a pad stands: ``x_object = rotation @ x_pad + origin``.

    Parameters
    ----------
    rotation : (3, 3) array
        Columns are the pad's long side, its short side and its approach direction, in the object's frame.
    origin : (3,) array
        Centre of the pad's undeformed front face [m].
    """

    rotation: FloatArray
    origin: FloatArray

    def __post_init__(self) -> None:
        """Refuse anything but a right-handed rotation."""
        if not np.allclose(self.rotation.T @ self.rotation, np.eye(3), atol=1e-9) or np.linalg.det(self.rotation) < 0:
            raise ValueError(
                f"rotation must be orthonormal and right-handed, found {np.asarray(self.rotation).tolist()}"
            )

    def to_object(self, x: FloatArray) -> FloatArray:
        """Points of the pad's frame in the object's frame, ``(n, 3)`` [m]."""
        return x @ self.rotation.T + self.origin

    def to_pad(self, x: FloatArray) -> FloatArray:
        """Points of the object's frame in the pad's frame, ``(n, 3)`` [m]."""
        return (x - self.origin) @ self.rotation
