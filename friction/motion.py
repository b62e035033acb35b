"""Slip motions: the twists for which a contact's friction is asked.

A 3-D twist is ``[v_x, v_y, omega_z]`` and a 6-D twist ``[v, omega]``, both of the origin of the contact frame. Only the
direction of a twist matters. A translation has ``omega = 0``: no centre of rotation has to be sent to infinity.
"""

import numpy as np

from softjaw.friction.patch import FloatArray

SLIDE_X: FloatArray = np.array([1.0, 0.0, 0.0])
SLIDE_Y: FloatArray = np.array([0.0, 1.0, 0.0])
TURN_Z: FloatArray = np.array([0.0, 0.0, 1.0])
for _twist in (SLIDE_X, SLIDE_Y, TURN_Z):
    _twist.flags.writeable = False


def fibonacci_twists(K: int, rho: float) -> FloatArray:
    """``K`` twists with ``(v_x, v_y, rho omega)`` spread evenly over the unit hemisphere ``omega > 0``, ``(K, 3)``."""
    # opposite motions give opposite wrenches: one half of the sphere is enough
    i = np.arange(K)
    z = (i + 0.5) / K
    phi = i * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z / rho])
