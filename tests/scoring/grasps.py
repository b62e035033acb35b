"""Pairs of contacts that face each other, or nearly, and bodies that the tests of scores share."""

import numpy as np

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.contact import PolytopeBody, SoftContact

A, B = (0.8, 0.6, 0.15), (0.5, 0.9, 0.25)


def contact_axes(N, hint):
    """Rows x, y, N of a contact frame whose x is the hint, projected on the plane across N."""
    N = np.asarray(N, float) / np.linalg.norm(N)
    x = hint - (hint @ N) * N
    x = x / np.linalg.norm(x)
    return np.vstack([x, np.cross(N, x), N])


def body_of(shape):
    if hasattr(shape, "support"):
        return shape
    return Ellipsoid.of_axes(shape) if np.ndim(shape) == 1 else PolytopeBody(shape)


def facing(first=A, second=B, d=1.3, tilt=0.0, offset=(0, 0, 0)):
    """Contacts at -d/2 and d/2 + offset on the x axis, their normals turned away from facing about z [rad]."""
    a, b = np.broadcast_to(tilt, 2)
    normals = [np.cos(a), np.sin(a), 0], [-np.cos(b), np.sin(b), 0]
    places = np.array([-d / 2, 0, 0]), np.array([d / 2, 0, 0]) + offset
    z = np.array([0, 0, 1.0])
    return [
        SoftContact(x, contact_axes(N, z), body_of(shape))
        for x, N, shape in zip(places, normals, (first, second), strict=True)
    ]


def unit(u):
    return u / np.linalg.norm(u, axis=-1, keepdims=True)
