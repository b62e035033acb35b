"""Quadrilateral shell meshes: places and directors of the nodes, and the lines of a structured grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


@dataclass(frozen=True)
class ShellMesh:
    """Mesh of the middle surface.

    Parameters
    ----------
    X, D : (k, 3) arrays
        Nodes on the middle surface and their directors, half the wall thickness times the outward unit normal [m]; the
        outer face is ``X + D``.
    elements : (n, 4) array
        Node numbers, counter-clockwise seen from outside; two neighbours may be the same node.
    """

    X: FloatArray
    D: FloatArray
    elements: IntArray

    def __post_init__(self) -> None:
        """Refuse arrays that do not fit together."""
        if self.X.shape != self.D.shape or self.X.ndim != 2 or self.X.shape[1] != 3:
            raise ValueError(f"X and D must both be (k, 3), found {self.X.shape} and {self.D.shape}")
        if self.elements.ndim != 2 or self.elements.shape[1] != 4:
            raise ValueError(f"elements must be (n, 4), found {self.elements.shape}")
        if self.elements.min() < 0 or self.elements.max() >= len(self.X):
            raise ValueError(f"elements name node {self.elements.max()}, but there are {len(self.X)} nodes")

    @property
    def outer(self) -> FloatArray:
        """Nodes of the outer face ``(k, 3)`` [m]."""
        return self.X + self.D

    @property
    def thickness(self) -> FloatArray:
        """Wall thickness at every node ``(k,)`` [m]."""
        return 2.0 * np.linalg.norm(self.D, axis=1)


def grid_elements(number: IntArray) -> IntArray:
    """Elements ``(n, 4)`` over a grid of node numbers ``(rows, columns)``; first direction along the rows' index.

    An element all of whose corners fall on fewer than three nodes is left out.
    """
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    elements = np.stack([corner.ravel() for corner in corners], axis=1).astype(np.int32)
    distinct = 1 + (np.diff(np.sort(elements, axis=1), axis=1) != 0).sum(axis=1)
    return elements[distinct >= 3]


def patch(X: FloatArray, normal: FloatArray, thickness: float) -> ShellMesh:
    """Mesh of a grid of places ``X (rows, columns, 3)`` with unit normals; node ``row * columns + column``."""
    number = np.arange(X.shape[0] * X.shape[1], dtype=np.int32).reshape(X.shape[:2])
    D = 0.5 * thickness * np.broadcast_to(normal, X.shape)
    return ShellMesh(X.reshape(-1, 3), np.ascontiguousarray(D.reshape(-1, 3)), grid_elements(number))
