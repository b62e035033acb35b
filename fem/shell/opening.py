"""How far a wall between two fingers still is open, and the force at which its opposite sides meet."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from softjaw.fem.errors import CheckError
from softjaw.fem.objects.gap import FloatArray
from softjaw.fem.shell.wall_mesh import BodyMesh

SIDES = 0.3  # of the largest distance from the plane between the fingers on a ring: nodes nearer to it are left out


class Opening:
    """How far the two halves of a wall still are apart along the approach, as a part of their undeformed distance.

    The grasp frame's x axis is the approach, so a node is compared with the one that it looks at along x: its own image
    where x = 0 is a plane of symmetry, else the nearest across from it. An indentation turns back at its deepest place,
    where it is level; so the node that lies nearest there is good enough.

    Parameters
    ----------
    mesh : BodyMesh

    Attributes
    ----------
    last : (float, float)
        Opening and force [N] of the last state that was watched.
    """

    def __init__(self, mesh: BodyMesh) -> None:
        # inner faces meet before the middle surfaces do
        self._inner = mesh.X - mesh.D
        x = self._inner[mesh.number, 0]
        bound = np.maximum(SIDES * np.abs(x).max(axis=0), 1e-6)
        self._near = np.unique(mesh.number[x > bound])
        back = np.unique(mesh.number[x < -bound])
        self._across = None if mesh.symmetry[0] else back
        if self._across is not None:
            self._across = back[cKDTree(self._inner[back, 1:]).query(self._inner[self._near, 1:])[1]]
        self._whole = self._apart(np.zeros(mesh.X.size * 2))
        self.last = 1.0, 0.0

    def __call__(self, q: FloatArray) -> float:
        """Opening at the state ``q (6 k,)`` of the shell, where it is smallest: 1 undeformed, 0 where walls meet."""
        return float((self._apart(q) / self._whole).min())

    def _apart(self, q: FloatArray) -> FloatArray:
        parts = q.reshape(-1, 6)
        x = self._inner[:, 0] + parts[:, 0] - parts[:, 3]
        return x[self._near] - (-x[self._near] if self._across is None else x[self._across])

    def watch(self, q: FloatArray, force: float) -> None:
        """Note the state at a force [N] of the fingers.

        Raises
        ------
        CheckError
            If the walls have met at a lower force.
        """
        opening = self(q)
        if opening > 0.0:
            self.last = opening, force
            return
        before, at = self.last
        meets = at + (force - at) * before / (before - opening)
        raise CheckError(f"the wall collapsed: its opposite sides meet at {meets:.3g} N")
