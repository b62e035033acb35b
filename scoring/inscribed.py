"""Ellipsoids inside limit surfaces, for methods that need one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softjaw.scoring.contact import Body
from softjaw.scoring.polytope import fibonacci_vertices

FloatArray = NDArray[np.float64]

_DIRECTIONS = 6000
_SPACING = 2.8 / np.sqrt(_DIRECTIONS)  # no direction is farther than this from the nearest of the Fibonacci points


def is_ellipsoid(body: Body) -> bool:
    """Whether the squared support is a quadratic form, as of an ellipsoid about 0."""
    axes, Q = _quadratic_form(body)
    t = fibonacci_vertices(np.ones(3), 60)
    h2 = body.support(t / axes) ** 2
    return bool(np.abs(h2 - np.einsum("ka,ab,kb->k", t, Q, t)).max() <= 1e-9 * h2.max())


def ellipsoid_inside(body: Body) -> FloatArray:
    """Root ``A (3, 3)`` of an ellipsoid inside the body: ``|A t| <= support(t)``, with equality if it is one.

    Otherwise it has the proportions of the body's semi-axes. Its size follows from the support on a few thousand
    directions, less what a support function can fall between them, 2 to 4 % of its largest value.
    """
    if is_ellipsoid(body):
        axes, Q = _quadratic_form(body)
        size, V = np.linalg.eigh(Q)
        return np.sqrt(np.maximum(size, 0))[:, None] * V.T * axes
    ends = body.support(np.vstack([np.eye(3), -np.eye(3)]))
    axes = (ends[:3] + ends[3:]) / 2
    if (axes <= 0).any():
        return np.zeros((3, 3))
    h = body.support(fibonacci_vertices(np.ones(3), _DIRECTIONS) / axes)
    return np.diag(axes * max(h.min() - _SPACING * h.max() / (1 - _SPACING), 0))


def _quadratic_form(body: Body) -> tuple[FloatArray, FloatArray]:
    """Lengths ``(3,)`` that scale the loads to one, and the form ``Q`` of the squared support of the scaled body."""
    axes = body.support(np.eye(3))
    axes = np.where(axes > 0, axes, 1.0)
    e, mixed = np.diag(1 / axes), [(0, 1), (0, 2), (1, 2)]
    h = body.support(np.vstack([e, [e[i] + e[j] for i, j in mixed]])) ** 2
    Q = np.diag(h[:3])
    for (i, j), value in zip(mixed, h[3:], strict=True):
        # what is left of a form with parallel axes is rounding
        product = (value - h[i] - h[j]) / 2
        Q[i, j] = Q[j, i] = product if abs(product) > 1e-14 else 0.0
    return axes, Q
