"""Whether the opposite walls of a thin-walled object meet, which the contact of the pads knows nothing of."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from softjaw.fem.errors import CheckError
from softjaw.fem.objects.pose import FloatArray
from softjaw.fem.shell.body import BodyMesh

SIDES = 0.3  # of the largest distance from the plane between the fingers on a ring: nodes nearer to it are left out


class Opening:
    """How far the two halves of a wall still are apart along the approach, as a part of their undeformed distance.

    The grasp frame's x axis is the approach, so a node is compared with the one that it looks at along x: its own image
    where x = 0 is a plane of symmetry, else the nearest across from it. A dent turns back at its deepest place, where
    it is level; so the node that lies nearest there is good enough.

    Parameters
    ----------
    mesh : BodyMesh

    Attributes
    ----------
    last : (float, float)
        Opening and force [N] of the last state that was watched.
    """

    def __init__(self, mesh: BodyMesh) -> None:
        self._inner = mesh.X - mesh.D
        x = self._inner[mesh.number, 0]
        bound = np.maximum(SIDES * np.abs(x).max(axis=0), 1e-6)
        self._front = np.unique(mesh.number[x > bound])
        back = np.unique(mesh.number[x < -bound])
        self._back = None if mesh.symmetry[0] else back
        if self._back is not None:
            self._back = back[cKDTree(self._inner[back, 1:]).query(self._inner[self._front, 1:])[1]]
        self._whole = 1.0
        self._whole = self._distances(np.zeros(mesh.X.size * 2))
        self.last = 1.0, 0.0

    def __call__(self, q: FloatArray) -> float:
        """Opening at the state ``q (6 k,)`` of the shell, where it is smallest: 1 undeformed, 0 where walls meet."""
        return float(self._distances(q).min())

    def _distances(self, q: FloatArray) -> FloatArray:
        parts = q.reshape(-1, 6)
        x = self._inner[:, 0] + parts[:, 0] - parts[:, 3]
        return (x[self._front] - (-x[self._front] if self._back is None else x[self._back])) / self._whole

    def watch(self, q: FloatArray, force: float) -> None:
        """Note the state at a force [N] of the fingers.

        Raises
        ------
        CheckError
            If the walls have met on the way here.
        """
        opening = self(q)
        if opening > 0.0:
            self.last = opening, force
            return
        before, at = self.last
        meets = at + (force - at) * before / (before - opening)
        raise CheckError(f"the wall collapsed: its opposite sides meet at {meets:.3g} N")
