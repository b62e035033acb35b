"""Compiled sum of friction over faces: the one hot loop of the friction model."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# Reordering of sums lets the loop fill the vector registers. Not among the flags: nnan and ninf, which would allow the
# compiler to drop the test for a face at rest.
_FAST = frozenset({"reassoc", "contract", "arcp", "nsz"})
# Speed below which a face is at rest, for motions and arms that move no face faster than some 1: what rounding of both
# leaves of a speed of 0. Its force would have its full size and a direction of chance.
REST = 32 * 2.0**-52
_REST_SQUARED = REST**2


@njit(cache=True, fastmath=set(_FAST))
def friction_sums(arm, normal, load, twist, out):  # pragma: no cover - compiled
    """Wrench and dissipation of unit friction for each motion.

    A face slides with ``c = n x v`` turned by a right angle in its plane, so ``|P v| = |c|`` and ``P v = c x n``:
    both are free of cancellation. The velocity is formed as a difference from the arm, which keeps its digits when
    the centre of rotation lies next to the face.

    Parameters
    ----------
    arm, normal : (3, n) array
        Positions relative to the origin and unit normals, component by component.
    load : (n,) array
        Normal force of each face.
    twist : (m, 6) array
        ``[v, omega]``, scaled so that the largest of ``v`` and of ``omega`` times ``arm`` is some 1.
    out : (m, 7) array
        Receives force, torque and ``H = sum load |P v|``.
    """
    for k in range(twist.shape[0]):
        v0, v1, v2 = twist[k, 0], twist[k, 1], twist[k, 2]
        o0, o1, o2 = twist[k, 3], twist[k, 4], twist[k, 5]
        f0 = f1 = f2 = t0 = t1 = t2 = H = 0.0
        for i in range(load.size):
            x, y, z = arm[0, i], arm[1, i], arm[2, i]
            nx, ny, nz = normal[0, i], normal[1, i], normal[2, i]
            vx, vy, vz = v0 - o2 * y + o1 * z, v1 + o2 * x - o0 * z, v2 + o0 * y - o1 * x
            cx, cy, cz = ny * vz - nz * vy, nz * vx - nx * vz, nx * vy - ny * vx
            q = cx * cx + cy * cy + cz * cz
            s = load[i] / math.sqrt(q) if q > _REST_SQUARED else 0.0
            fx, fy, fz = s * (cy * nz - cz * ny), s * (cz * nx - cx * nz), s * (cx * ny - cy * nx)
            f0 += fx
            f1 += fy
            f2 += fz
            t0 += y * fz - z * fy
            t1 += z * fx - x * fz
            t2 += x * fy - y * fx
            H += s * q
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4], out[k, 5], out[k, 6] = f0, f1, f2, t0, t1, t2, H


def friction_sums_reference(arm, normal, load, twist):
    """The same sums written as the textbook formula, ``(m, 7)``; slow, kept as the oracle of the tests."""
    r, n = arm.T, normal.T
    rows = []
    for t in twist:
        v = t[:3] + np.cross(t[3:], r)
        slip = v - (v * n).sum(axis=1, keepdims=True) * n
        speed = np.linalg.norm(slip, axis=1)
        f = np.divide(load, speed, out=np.zeros_like(load), where=speed > REST)[:, None] * slip
        rows.append([*f.sum(axis=0), *np.cross(r, f).sum(axis=0), (load * speed).sum()])
    return np.array(rows)
