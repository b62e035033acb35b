"""Entries of the tangent by the points of a pad that press on a deformable wall.

At a point with the pressure ``p = sum N_i lam_i`` and the traction ``t`` of friction, the pad's node ``b`` gets
``-N_b (p n + t) dA`` and the wall's node ``a`` gets ``N_a (p n + t) dA``; the weighted gap of a contact node is
``int N_i g dA``. Points that face no wall are left out of both, so that a pad over a rim is carried up to the rim.
Derivatives are those of ``facing``. Pad quantities are in the pad's frame, ``x_object = R x_pad + origin``; the wall's
in the object's.

A node of the wall has unknowns ``first``, the displacement of the middle, and ``second``, the change of the director:
both move the outer face, and so the same force works on both.
"""

import numpy as np
from numba import njit

from softjaw.fem.shell.facing import Facing
from softjaw.friction.patch import FloatArray


def changes(N: FloatArray, R: FloatArray, facing: Facing) -> tuple[FloatArray, FloatArray]:
    """Changes of points relative to the wall ``D (n, 3, 3 k + 24)`` and of the normals, with every local unknown.

    These are the pad's (component, node), then those of the wall (node, component), first and second; ``N (n, k)`` are
    the pad's shape functions.
    """
    n, t = len(N), 3 * N.shape[1]
    turned = np.einsum("na,ndc->ndac", facing.N, facing.G).reshape(n, 3, 12)
    pad = np.einsum("dc,nb->ndcb", R, N).reshape(n, 3, t)
    first = -np.einsum("na,dc->ndac", facing.N, np.eye(3)).reshape(n, 3, 12)
    D = np.concatenate([pad, first, first - facing.gap[:, None, None] * turned], axis=2)
    dn = facing.H @ D
    dn[:, :, t + 12 :] += turned
    return D, dn


def force_blocks(
    N: FloatArray, R: FloatArray, facing: Facing, D: FloatArray, force: FloatArray, change: FloatArray
) -> FloatArray:
    """Derivatives ``(n, 3 k + 24, m)`` of the forces on pad and wall by ``m`` unknowns, from those of a point.

    ``force (n, 3)`` and its derivatives ``change (n, 3, m)``; what moves the outer face carries the same force.
    """
    n, k, m = len(N), N.shape[1], change.shape[2]
    pad = -N[:, None, :, None] * (R.T @ change)[:, :, None]
    slide = np.zeros((n, 4, m))
    slide[:, :, : D.shape[2]] = facing.S @ D
    wall = facing.N[:, :, None, None] * change[:, None] + slide[:, :, None] * force[:, None, :, None]
    wall = wall.reshape(n, 12, m)
    return np.concatenate([pad.reshape(n, 3 * k, m), wall, wall], axis=1)


@njit(cache=True)
def add_blocks(blocks, rows, columns, start, column, values):
    """Add blocks ``(n, r, m)`` in rows and columns, -1 where fixed, to compressed rows, which have a place for all."""
    for n in range(len(blocks)):
        for r in range(rows.shape[1]):
            if rows[n, r] < 0:
                continue
            low, high = start[rows[n, r]], start[rows[n, r] + 1]
            for j in range(columns.shape[1]):
                if columns[n, j] < 0:
                    continue
                # columns ascend within a row, so bisection finds the slot
                place = low + np.searchsorted(column[low:high], columns[n, j])
                # without one it would be added elsewhere, or beyond the last
                has_place = place < high and column[place] == columns[n, j]
                assert has_place
                values[place] += blocks[n, r, j]
