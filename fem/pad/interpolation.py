"""A state of one pad on the mesh of another: the same foam with the same size, meshed with blocks of its own."""

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.pad.mesh import Pad, along_side
from softjaw.friction.patch import FloatArray

Places = tuple[NDArray[np.int64], FloatArray]  # of points along an axis: nodes (n, k) of their element, shape functions
UPRIGHT = np.ones(3)


def interpolated(coarse: Pad, x: FloatArray, fine: Pad, turn: FloatArray = UPRIGHT) -> FloatArray:
    """Unknowns ``(fine.size,)`` of one pad from those ``x (coarse.size,)`` of another, by its shape functions.

    Either may be the half or quarter that symmetry leaves, and ``turn`` are signs of the axes of the one in the other's
    frame, where it is its mirror image or turned by half a turn. Pressures that quadratic functions take below zero are
    zero.
    """
    places = turn * fine.nodes
    u = turn * _mirrored(coarse, places, coarse.nodes, coarse.displacement(x))
    face, contact = coarse.nodes[coarse.contact_nodes, :2], places[fine.contact_nodes, :2]
    pressure = _mirrored(coarse, contact, face, x[coarse.closing_dof + 1 :, None])
    state = np.zeros(fine.size)
    state[fine.dofs[fine.dofs >= 0]] = u[fine.dofs >= 0]
    state[fine.closing_dof] = x[coarse.closing_dof]
    state[fine.closing_dof + 1 :] = np.maximum(0.0, pressure[:, 0])
    return state


def _mirrored(coarse: Pad, points: FloatArray, nodes: FloatArray, values: FloatArray) -> FloatArray:
    """Values ``(n, c)`` at points ``(n, d)`` of a field given at nodes; where those end, of its mirror image."""
    inside, signs = points.copy(), np.ones((len(points), values.shape[1]))
    for axis in range(2):
        if coarse.symmetry[axis]:
            inside[:, axis] = np.abs(points[:, axis])
            if values.shape[1] == 3:
                # the displacement across the plane of symmetry changes its sign
                signs[:, axis] = np.where(points[:, axis] < 0.0, -1.0, 1.0)
    return signs * _tensor(coarse, inside, nodes, values)


def _tensor(coarse: Pad, points: FloatArray, nodes: FloatArray, values: FloatArray) -> FloatArray:
    """Values ``(n, c)`` at points ``(n, d)``, d = 2 or 3, from those at the nodes of a grid of mesh lines."""
    lines = [coarse.lines(axis) for axis in range(points.shape[1])]
    grid = np.empty((*map(len, lines), values.shape[1]))
    grid[coarse.places(nodes)] = values
    places = [_places(points[:, axis], line, coarse.shape.per_side) for axis, line in enumerate(lines)]
    total = np.zeros((len(points), values.shape[1]))
    for corner in np.ndindex(*(coarse.shape.per_side,) * len(lines)):
        index = tuple(numbers[:, i] for (numbers, _), i in zip(places, corner, strict=True))
        weight = np.prod([N[:, i] for (_, N), i in zip(places, corner, strict=True)], axis=0)
        total += weight[:, None] * grid[index]
    return total


def _places(s: FloatArray, line: FloatArray, per_side: int) -> Places:
    """Nodes and shape functions along one axis at coordinates ``s (n,)``; ``line`` are its nodes, rising."""
    step = per_side - 1
    ends = line[::step]
    element = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(ends) - 2)
    local = (s - ends[element]) / (ends[element + 1] - ends[element])
    # rounding must not take a point at the rim outside of its element
    return step * element[:, None] + np.arange(per_side), along_side(per_side, np.clip(local, 0.0, 1.0))
