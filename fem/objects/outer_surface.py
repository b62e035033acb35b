"""Outer surface of a thin-walled body: sections stacked along z, each an oval, a superellipse or a circle.

The outline in the plane y = 0 is the same smooth curve that draws a rigid body of revolution (``profile``), so a
rigid and a thin-walled bottle of one profile have the same outside. It gives height and semi-axis ``a`` along x; the
ratio ``b / a``, the exponent and the sideways shift of the sections follow the height by monotone cubics. The points of
a section are found by their polar angle: ``shift + a f (cos theta, sin theta)`` with
``f = (|cos theta|^n + |sin theta / (b/a)|^n)^(-1/n)``.

`Jet` holds functions of two parameters with their exact derivatives; `Turned` is a surface seen from a frame that is
turned about its axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import ArrayLike

from softjaw.fem.objects.gap import FloatArray
from softjaw.fem.objects.profile import Curve, through
from softjaw.fem.objects.revolution import Revolution
from softjaw.friction.patch import NEGLIGIBLE

TINY = 1e-100  # zero below a logarithm


class Jet:
    """Function of (theta, s) with its derivatives up to the second: rows ``f, f_t, f_s, f_tt, f_ts, f_ss`` (6, n)."""

    def __init__(self, rows: ArrayLike) -> None:
        self.rows = np.asarray(rows, dtype=float)

    def __add__(self, other: Jet) -> Jet:
        return Jet(self.rows + other.rows)

    def __mul__(self, other: Jet) -> Jet:
        (f, ft, fs, ftt, fts, fss), (g, gt, gs, gtt, gts, gss) = self.rows, other.rows
        return Jet([
            f * g, ft * g + f * gt, fs * g + f * gs,
            ftt * g + 2 * ft * gt + f * gtt, fts * g + ft * gs + fs * gt + f * gts, fss * g + 2 * fs * gs + f * gss,
        ])  # fmt: skip

    def through(self, h: FloatArray, h1: FloatArray, h2: FloatArray) -> Jet:
        """``h(f)`` from the values of ``h`` and its two derivatives at ``f``."""
        _, t, s, tt, ts, ss = self.rows
        return Jet([h, h1 * t, h1 * s, h1 * tt + h2 * t * t, h1 * ts + h2 * t * s, h1 * ss + h2 * s * s])

    def exp(self) -> Jet:
        """``exp(f)``."""
        e = np.exp(self.rows[0])
        return self.through(e, e, e)

    def log(self) -> Jet:
        """``ln(f)``."""
        f = self.rows[0]
        return self.through(np.log(f), 1 / f, -1 / f**2)

    def scaled(self, factor: float) -> Jet:
        """``factor * f``."""
        return Jet(factor * self.rows)


def log_of_size(jet: Jet) -> Jet:
    """``ln |f|``, finite where f vanishes."""
    rows = jet.rows.copy()
    rows[0] = np.where(np.abs(rows[0]) < TINY, TINY, rows[0])
    f = rows[0]
    return Jet(rows).through(np.log(np.abs(f)), 1 / f, -1 / f**2)


@dataclass(frozen=True)
class Section:
    """Cross-section at one height; ``b = None`` makes it as wide along y as along x.

    Parameters
    ----------
    z, a, b : float
        Height and semi-axes along x and y [m]; ``a = 0`` is allowed for the first and the last section.
    exponent : float
        2 for an ellipse, larger for a rounded rectangle; at least 2.
    shift : (float, float)
        Place of the middle [m].
    """

    z: float
    a: float
    b: float | None = None
    exponent: float = 2.0
    shift: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class OuterSurface:
    """Closed surface ``X(theta, s)``; theta is the polar angle in a section, s the place along the outline.

    Build it with `of_revolution` or `of_sections`.

    Attributes
    ----------
    curve : Curve
        Outline ``(z, a)(s)`` from the middle of the bottom to the middle of the top.
    wall : (float, float)
        Part of s between the first and the last given section; lids and their rims lie outside.
    flat : (float, float)
        Ends of the flat lids: s up to the first and from the second; equal to the outline's ends where there are none.
    ratio, exponent, shift_x, shift_y : callable
        By height and order of the derivative.
    """

    curve: Curve
    wall: tuple[float, float]
    flat: tuple[float, float]
    ratio: Callable
    exponent: Callable
    shift_x: Callable
    shift_y: Callable
    symmetric: tuple[bool, bool] = field(default=(True, True))

    @property
    def end(self) -> float:
        """Largest s [m]; the smallest is 0."""
        return float(self.curve.breaks[-1])

    def jets(self, theta: ArrayLike, s: ArrayLike) -> FloatArray:
        """``X, X_t, X_s, X_tt, X_ts, X_ss`` at ``n`` pairs of parameters: ``(n, 6, 3)``."""
        theta, s = (np.ravel(v) for v in np.broadcast_arrays(np.asarray(theta, float), np.asarray(s, float)))
        unit, a, shift, z = self._parts(theta, s)
        x, y = (a * u + c for u, c in zip(unit, shift, strict=True))
        return np.stack([x.rows, y.rows, z.rows]).transpose(2, 1, 0)

    def normals(self, theta: ArrayLike, s: ArrayLike) -> FloatArray:
        """Outward unit normals ``(n, 3)``, also on the axis."""
        theta, s = (np.ravel(v) for v in np.broadcast_arrays(np.asarray(theta, float), np.asarray(s, float)))
        unit, a, shift, z = self._parts(theta, s)
        # X_theta / a: has a direction on the axis, too
        around = np.stack([unit[0].rows[1], unit[1].rows[1], np.zeros(len(s))], axis=1)
        along = np.stack([*((a * u + c).rows[2] for u, c in zip(unit, shift, strict=True)), z.rows[2]], axis=1)
        n = np.cross(around, along)
        return n / np.linalg.norm(n, axis=1)[:, None]

    def _parts(self, theta: FloatArray, s: FloatArray) -> tuple[list[Jet], Jet, list[Jet], Jet]:
        """Point of the section with ``a = 1``, semi-axis a, shift and height."""
        none = np.zeros_like(s)
        d = [self.curve.derivative(s, order) for order in range(3)]
        z, a = (Jet([d[0][:, i], none, d[1][:, i], none, none, d[2][:, i]]) for i in (0, 1))
        by_height = lambda f: z.through(*(f(z.rows[0], order) for order in range(3)))  # noqa: E731
        cos, sin = np.cos(theta), np.sin(theta)
        c, t = (Jet([v, w, none, -v, none, none]) for v, w in ((cos, -sin), (sin, cos)))
        exponent, ratio = by_height(self.exponent), by_height(self.ratio)
        # powers by logarithms, so that the exponent may change along the outline, too
        terms = ((exponent * part).exp() for part in (log_of_size(c), log_of_size(t) + ratio.log().scaled(-1)))
        n = exponent.rows[0]
        inverse = exponent.through(-1 / n, 1 / n**2, -2 / n**3)
        f = (inverse * (next(terms) + next(terms)).log()).exp()
        return [f * c, f * t], a, [by_height(self.shift_x), by_height(self.shift_y)], z

    def station(self, z: float) -> float:
        """Place s on the wall at the height z [m]; the lowest if there are several.

        Raises
        ------
        ValueError
            If the wall has no point at this height.
        """
        s = np.linspace(*self.wall, 2001)
        off = self.curve.derivative(s)[:, 0] - z
        # a height at a sample is that sample: a search could end beside it by rounding
        off[np.abs(off) < 1e-12] = 0.0  # heights this close to a sample of the outline are at it [m]
        crossing = np.flatnonzero((off[:-1] <= 0) & (off[1:] >= 0))
        if not len(crossing):
            raise ValueError(
                f"the wall runs from z = {z + off.min():g} m to {z + off.max():g} m and has no point at {z:g} m"
            )
        k = crossing[0]
        if off[k] == 0.0 or off[k + 1] == 0.0:
            return float(s[k] if off[k] == 0.0 else s[k + 1])
        from scipy.optimize import brentq

        return float(brentq(lambda p: self.curve.derivative(np.array([p]))[0, 0] - z, s[k], s[k + 1], xtol=1e-14))


def of_revolution(body: Revolution) -> OuterSurface:
    """Surface of a rigid body of revolution, for a thin-walled one of the same profile."""
    return _surface(body, [Section(float(z), float(r)) for z, r in body.profile])


def of_sections(sections: Sequence[Section], rim: float = 0.002) -> OuterSurface:
    """Surface through sections given from bottom to top; ``rim`` rounds the edges at flat ends [m].

    Raises
    ------
    ValueError
        For sections that make no body, with the number of the section.
    """
    if any(p.z >= q.z for p, q in pairwise(sections)):
        raise ValueError("sections must be given from bottom to top, each higher than the one before")
    for k, p in enumerate(sections, 1):
        if not p.exponent >= 2.0 or not (p.b is None or p.b > 0 or p.a == 0):
            raise ValueError(f"section {k} needs an exponent of at least 2 and a positive b, found {p}")
    return _surface(Revolution(np.array([[p.z, p.a] for p in sections]), rim), list(sections))


def _surface(body: Revolution, sections: list[Section]) -> OuterSurface:
    given, closed = through(body.profile, body.rim)
    pieces = len(given.coefficients)
    lids = len(closed.coefficients) - pieces
    # lids have varying numbers of pieces, so the given part is found by its coefficients
    first = next(k for k in range(lids + 1) if (closed.coefficients[k : k + pieces] == given.coefficients).all())
    s = closed.breaks
    on_axis = body.profile[[0, -1], 1] == 0
    ratio = [1.0 if p.b is None or p.a == 0 else p.b / p.a for p in sections]
    if len(sections) > 1:
        # a section that is a point has no ratio of its own
        ratio[0] = ratio[1] if sections[0].a == 0 else ratio[0]
        ratio[-1] = ratio[-2] if sections[-1].a == 0 else ratio[-1]
    z = [p.z for p in sections]
    shift = np.array([p.shift for p in sections], dtype=float)
    return OuterSurface(
        closed,
        (float(s[first]), float(s[first + pieces])),
        (0.0 if on_axis[0] else float(s[1]), float(s[-1]) if on_axis[1] else float(s[-2])),
        _by_height(z, ratio),
        _by_height(z, [p.exponent for p in sections]),
        _by_height(z, shift[:, 0]),
        _by_height(z, shift[:, 1]),
        (not shift[:, 0].any(), not shift[:, 1].any()),
    )


def _by_height(z: Sequence[float], values: ArrayLike) -> Callable:
    """Monotone cubic through the values, level at both ends and beyond."""
    y = np.asarray(values, dtype=float)
    # exactly constant, because rounding of a spline would cost round bodies their symmetry
    if np.ptp(y) == 0:
        return lambda x, order=0: np.full(np.shape(x), y[0] if order == 0 else 0.0)
    # one more point beyond each end, so that the curve is level there
    far = np.ptp(z)
    knots, y = np.concatenate([[z[0] - far], z, [z[-1] + far]]), np.concatenate([y[:1], y, y[-1:]])
    h, slope = np.diff(knots), _slopes(knots, y)
    d, m, n = np.diff(y) / h, slope[:-1], slope[1:]
    c = np.stack([y[:-1], m, (3 * d - 2 * m - n) / h, (m + n - 2 * d) / h**2])  # powers of x - z on each piece

    def derivative(x: FloatArray, order: int = 0) -> FloatArray:
        x = np.clip(x, knots[0], knots[-1])
        k = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(h) - 1)
        return polyval(x - knots[k], polyder(c[:, k], order), tensor=False)

    return derivative


def _slopes(z: FloatArray, values: FloatArray) -> FloatArray:
    """Slopes of a monotone cubic, after Fritsch and Butland: weighted harmonic means, none at turning points."""
    h = np.diff(z)
    d, left, right = np.diff(values) / h, 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    slope, same = np.zeros(len(z)), np.flatnonzero(d[:-1] * d[1:] > 0)
    slope[same + 1] = (left + right)[same] / (left[same] / d[same] + right[same] / d[same + 1])
    return slope


@dataclass(frozen=True, eq=False)
class Turned:
    """Surface whose angle 0 is the original's ``angle`` [rad]; offers what ``wall_mesh`` asks of it."""

    original: OuterSurface
    angle: float
    round: bool

    @property
    def curve(self) -> Curve:
        """Outline, by the same places s."""
        return self.original.curve

    @property
    def wall(self) -> tuple[float, float]:
        """Part of s between the first and the last section."""
        return self.original.wall

    @property
    def flat(self) -> tuple[float, float]:
        """Ends of the flat lids."""
        return self.original.flat

    @property
    def end(self) -> float:
        """Largest s [m]."""
        return self.original.end

    @property
    def symmetric(self) -> tuple[bool, bool]:
        """Whether x = 0 and y = 0 of the turned frame are planes of symmetry."""
        if self.round:
            return True, True
        quarters = self.angle / (0.5 * np.pi)
        if abs(quarters - round(quarters)) * 0.5 * np.pi > NEGLIGIBLE:
            return False, False
        x, y = self.original.symmetric
        # a quarter turn exchanges the two planes
        return (y, x) if round(quarters) % 2 else (x, y)

    def station(self, z: float) -> float:
        """Place s on the wall at the height z [m]."""
        return self.original.station(z)

    def jets(self, theta: ArrayLike, s: ArrayLike) -> FloatArray:
        """Position and derivatives in the turned frame, as the original's."""
        return self.original.jets(np.asarray(theta, float) + self.angle, s) @ self._rotation

    def normals(self, theta: ArrayLike, s: ArrayLike) -> FloatArray:
        """Outward unit normals ``(n, 3)`` in the turned frame."""
        return self.original.normals(np.asarray(theta, float) + self.angle, s) @ self._rotation

    @property
    def _rotation(self) -> FloatArray:
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
