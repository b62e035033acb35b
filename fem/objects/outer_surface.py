"""Outer surface of a thin-walled body: sections along z, each an oval, a superellipse or a circle.

The outline in the plane y = 0 is the same smooth curve that draws a rigid body of revolution (``profile``), so a
rigid and a thin-walled bottle of one profile have the same outside. It gives height and semi-axis ``a`` along x; the
ratio ``b / a``, the exponent and the sideways shift of the sections follow the height by monotone cubics. The points of
a section are found by their polar angle: ``shift + a q``, with ``q = f (cos theta, sin theta)`` and
``f = (|cos theta|^n + |sin theta / (b/a)|^n)^(-1/n)``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softjaw.fem.objects.gap import about_z
from softjaw.fem.objects.profile import Curve
from softjaw.fem.objects.revolution import Revolution
from softjaw.friction.patch import NEGLIGIBLE, FloatArray

TINY = 1e-100  # zero below a logarithm


class Section(NamedTuple):
    """Cross-section at one height; ``b = None`` makes it as wide along y as along x.

    ``z, a, b``: height and semi-axes along x and y [m]; ``a = 0`` is allowed for the first and the last section;
    ``exponent``: 2 for an ellipse, larger for a rounded rectangle; at least 2; ``shift``: place of the middle [m].
    """

    z: float
    a: float
    b: float | None = None
    exponent: float = 2.0
    shift: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class OuterSurface:
    """Closed surface ``X(theta, s)``; theta is the polar angle in a section, s the place along the outline.

    Build it with `of_revolution`, `of_sections` or `fem.objects.traced_surface.traced`.

    Attributes
    ----------
    curve : Curve
        Outline ``(z, a)(s)`` from the middle of the bottom to the middle of the top.
    wall : (float, float)
        Part of s between the first and the last given section; lids and their rims lie outside.
    flat : (float, float)
        Ends of the flat lids: s up to the first and from the second; equal to the outline's ends where there are none.
    section : callable
        From theta, s, z and dz/ds ``(n,)`` the section ``q`` with ``a = 1`` and its derivatives by theta and s,
        ``(n, 2)`` each.
    shift : callable
        Middles of the sections ``(n, 2)`` by height and order of the derivative [m].
    symmetric : (bool, bool)
        Whether x = 0 and y = 0 are planes of symmetry.
    round : bool
        Whether every angle is a symmetry.
    angle : float
        Of the frame in which the surface is seen, about its axis [rad].
    """

    curve: Curve
    wall: tuple[float, float]
    flat: tuple[float, float]
    section: Callable
    shift: Callable
    symmetric: tuple[bool, bool]
    round: bool
    angle: float = 0.0

    @property
    def end(self) -> float:
        """Largest s [m]; the smallest is 0."""
        return float(self.curve.breaks[-1])

    @cached_property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest place of the wall [m]."""
        z = self.curve.derivative(np.linspace(*self.wall, 257))[:, 0]
        return float(z.min()), float(z.max())

    def turned(self, angle: float) -> OuterSurface:
        """The surface seen from a frame that is turned about the axis by ``angle`` [rad]."""
        x, y = self.symmetric
        quarters = round(angle / (0.5 * np.pi))
        if abs(angle - quarters * 0.5 * np.pi) > NEGLIGIBLE and not self.round:
            x = y = False
        # a quarter turn exchanges the two planes
        return replace(self, symmetric=(y, x) if quarters % 2 else (x, y), angle=self.angle + angle)

    def jets(self, theta: ArrayLike, s: ArrayLike) -> FloatArray:
        """``X, X_t, X_s`` at ``n`` pairs of parameters: ``(n, 3, 3)``."""
        X, around, along, a = self._parts(theta, s)
        return np.stack([X, a * around, along], axis=1)

    def normals(self, theta: ArrayLike, s: ArrayLike) -> FloatArray:
        """Outward unit normals ``(n, 3)``, also on the axis."""
        _, around, along, _ = self._parts(theta, s)
        n = np.cross(around, along)
        return n / np.linalg.norm(n, axis=1)[:, None]

    def _parts(self, theta: ArrayLike, s: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """``X``, ``X_t / a``, which has a direction on the axis, too, ``X_s (n, 3)`` and the semi-axis ``a (n, 1)``."""
        theta, s = (np.ravel(v) for v in np.broadcast_arrays(np.asarray(theta, float), np.asarray(s, float)))
        (z, a), (z_s, a_s) = (self.curve.derivative(s, order).T for order in (0, 1))
        q, q_t, q_s = self.section(theta + self.angle, s, z, z_s)
        a, a_s, slope = a[:, None], a_s[:, None], z_s[:, None] * self.shift(z, 1)
        flat = (a * q + self.shift(z, 0), z), (q_t, 0.0 * z), (a_s * q + a * q_s + slope, z_s)
        X, around, along = (np.column_stack(part) @ about_z(self.angle) for part in flat)
        return X, around, along, a

    def station(self, z: float) -> float:
        """Place s on the wall at a height within `heights` [m]; the lowest if there are several."""
        from scipy.interpolate import PPoly

        height = PPoly(self.curve.coefficients[:, 0, ::-1].T, self.curve.breaks)
        places, (low, high) = height.solve(z, extrapolate=False), self.wall
        # an end of the wall is at its height, whatever rounding makes of it [m]
        ends = [end for end in self.wall if abs(height(end) - z) < 1e-12]
        return float(min([*ends, *places[(places >= low) & (places <= high)]]))


def of_revolution(body: Revolution) -> OuterSurface:
    """Surface of a rigid body of revolution, for a thin-walled one of the same profile."""
    # the ends are enough for circles, and points between them may lie at one height
    return _surface(replace(body, beyond=True), [Section(float(z), float(r)) for z, r in body.profile[[0, -1]]])


def of_sections(sections: Sequence[Section], beyond: bool = True) -> OuterSurface:
    """Surface through sections given from bottom to top; ``beyond`` as for `fem.objects.revolution.Revolution`."""
    return _surface(Revolution(np.array([[p.z, p.a] for p in sections]), beyond=beyond), sections)


def _surface(body: Revolution, sections: Sequence[Section]) -> OuterSurface:
    ratio = [1.0 if p.b is None or p.a == 0 else p.b / p.a for p in sections]
    # a section that is a point has no ratio of its own
    ratio[0] = ratio[1] if sections[0].a == 0 else ratio[0]
    ratio[-1] = ratio[-2] if sections[-1].a == 0 else ratio[-1]
    z, exponent = [p.z for p in sections], [p.exponent for p in sections]
    shift = np.array([p.shift for p in sections], dtype=float)
    shapes, shifts = _by_height(z, np.column_stack([exponent, ratio])), _by_height(z, shift)
    symmetric = not shift[:, 0].any(), not shift[:, 1].any()
    even = np.abs(np.array([exponent, ratio]) - [[2.0], [1.0]]).max() <= NEGLIGIBLE
    return OuterSurface(
        *body.closed,
        lambda theta, s, z, z_s: _superellipse(theta, *shapes(z, 0).T, *(z_s[:, None] * shapes(z, 1)).T),
        shifts,
        symmetric,
        bool(even and all(symmetric)),
    )


def _superellipse(
    theta: FloatArray, n: FloatArray, k: FloatArray, n_s: FloatArray, k_s: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Section with ``a = 1``, exponent ``n`` and ratio ``k``, and its derivatives by theta and s, ``(n, 2)`` each."""
    e = np.stack([np.cos(theta), np.sin(theta)], axis=1)
    e_t = np.stack([-e[:, 1], e[:, 0]], axis=1)
    size = np.where(np.abs(e) < TINY, TINY, e)
    # powers by logarithms, whose products have derivatives by the exponent, too
    logs = np.log(np.abs(size)) - np.stack([0.0 * k, np.log(k)], axis=1)
    terms = np.exp(n[:, None] * logs)
    total = terms.sum(axis=1)
    f = np.exp(-np.log(total) / n)
    f_t = -f * (terms * e_t / size).sum(axis=1) / total
    by_n = (np.log(total) / n - (terms * logs).sum(axis=1) / total) / n
    f_s = f * (by_n * n_s + terms[:, 1] / (k * total) * k_s)
    return f[:, None] * e, f_t[:, None] * e + f[:, None] * e_t, f_s[:, None] * e


def _by_height(z: Sequence[float], values: FloatArray) -> Callable:
    """Monotone cubics through ``values (k, c)``, level at both ends and beyond, by height and order of derivative."""
    from scipy.interpolate import PchipInterpolator

    # one more point beyond each end, so that the curve is level there
    ends = z[0] - np.ptp(z), z[-1] + np.ptp(z)
    curve = PchipInterpolator([ends[0], *z, ends[1]], np.concatenate([values[:1], values, values[-1:]]))
    return lambda x, order=0: curve(np.clip(x, *ends), order)
