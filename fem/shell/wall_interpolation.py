"""The state of one wall on the mesh of another: the same body, meshed with grid lines of its own."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from softjaw.fem.shell.element import FloatArray
from softjaw.fem.shell.wall_mesh import BodyMesh


def interpolated(coarse: BodyMesh, q: FloatArray, fine: BodyMesh) -> FloatArray:
    """State ``(6 k,)`` on one mesh from that on another, ``q (6 n,)``: cubic splines along the grid lines [m].

    Either may be the half or quarter that symmetry leaves.
    """
    lines, values = _all_round(coarse, q.reshape(-1, 6)[coarse.number])
    # splines, for a kink between two nodes would be a bend that the thin wall resists with all its stiffness
    around = CubicSpline(lines, values, bc_type="periodic")(fine.theta)
    found = np.empty((len(fine.X), 6))
    found[fine.number] = CubicSpline(coarse.s, around, axis=1)(fine.s)
    # directors keep their length: a thickness that splines have changed would be a large stress
    director = fine.D + found[:, 3:]
    length = np.linalg.norm(fine.D, axis=1) / np.linalg.norm(director, axis=1)
    found[:, 3:] = length[:, None] * director - fine.D
    return found.ravel()


def _all_round(mesh: BodyMesh, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Grid lines once round the body and the values ``(lines, n, 6)`` on them, images where it is not meshed."""
    lines = mesh.theta
    for plane in (0, 1):
        if mesh.symmetry[plane]:
            sign = np.ones(6)
            sign[[plane, 3 + plane]] = -1.0
            # x = 0 is the last line of every mesh that ends there; what is complete to both sides of it ends at y = 0
            lines = np.concatenate([lines, 2.0 * lines[-1] - lines[-2::-1]])
            values = np.concatenate([values, sign * values[-2::-1]])
    return lines, values
