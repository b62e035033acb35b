"""Profile of a surface of revolution: a C2 curve (z, r)(s) through given points, closed to the axis at both ends.

A cubic spline by chord length swings past straight runs: a bottle's wall given by five points would come out wavy. So
three or more points on one line are drawn as exactly that line, and the points between two lines by a C2 cubic spline
that leaves and meets them with their direction and without curvature (which takes one more knot in its first and last
interval). Where two lines meet in a corner, the corner is rounded. At an end that is not on the axis is a flat cap with
a rounded rim, which takes the last of the outline; an end on the axis is met at right angles, so that the surface has
no tip.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from softjaw.friction.patch import NEGLIGIBLE, FloatArray

COLLINEAR = 1e-4  # points this close to a line, in units of their shortest step, are on it
ARC_STEP = np.pi / 6  # a rounding is interpolated at least this finely


# What a spline has to fulfil at one end besides passing its point: order and value of derivatives by s, of z and of r.
End = tuple[list[tuple[int, float]], list[tuple[int, float]]]
FREE: End = [], []
POLE: End = [(1, 0.0)], [(2, 0.0)]  # on the axis: at right angles, r odd and z even like on a smooth surface


def joint(first: FloatArray, second: Sequence[float] = (0.0, 0.0)) -> End:
    """End at which the neighbour's first and second derivative, zero by default, are taken over."""
    z, r = ([(1, float(slope)), (2, float(curvature))] for slope, curvature in zip(first, second, strict=True))
    return z, r


class Curve(NamedTuple):
    """Piecewise cubic ``(z, r)(s)``: on piece k the powers of ``s - breaks[k]`` have ``coefficients[k] (2, 4)``."""

    breaks: FloatArray
    coefficients: FloatArray

    def derivative(self, s: FloatArray, order: int = 0) -> FloatArray:
        """Derivative of the given order at ``s (n,)``: ``(n, 2)``; order 0 is the point itself."""
        k = np.clip(np.searchsorted(self.breaks, s, side="right") - 1, 0, len(self.breaks) - 2)
        h = (s - self.breaks[k])[:, None]
        c = self.coefficients[k]
        for _ in range(order):
            c = c[..., 1:] * np.arange(1, c.shape[-1])
        value = np.zeros((len(s), 2))
        for j in reversed(range(c.shape[-1])):
            value = value * h + c[..., j]
        return value

    def between(self, low: float, high: float) -> "Curve":
        """The part of the curve between two parameters, which begins at 0."""
        inner = self.breaks[(self.breaks > low) & (self.breaks < high)]
        s = np.concatenate([[low], inner, [high]])
        parts = [self.derivative(s[:-1], order) / factor for order, factor in enumerate((1, 1, 2, 6))]
        return Curve(s - low, np.stack(parts, axis=-1))

    def curvature(self, s: FloatArray) -> FloatArray:
        """Curvature ``(n,)`` [1/m], positive where the outside (left of the curve) is convex."""
        d1, d2 = self.derivative(s, 1), self.derivative(s, 2)
        return (d1[:, 1] * d2[:, 0] - d1[:, 0] * d2[:, 1]) / np.linalg.norm(d1, axis=1) ** 3


def joined(curves: list[Curve]) -> Curve:
    """Curves one behind the other as one."""
    breaks = [np.zeros(1)]
    for curve in curves:
        breaks.append(curve.breaks[1:] + breaks[-1][-1])
    return Curve(np.concatenate(breaks), np.concatenate([curve.coefficients for curve in curves]))


def line(p: FloatArray, q: FloatArray) -> Curve:
    """Straight piece from p to q, by arc length."""
    length = np.linalg.norm(q - p)
    c = np.zeros((1, 2, 4))
    c[0, :, 0], c[0, :, 1] = p, (q - p) / length
    return Curve(np.array([0.0, length]), c)


def spline(points: FloatArray, start: End, end: End, s: FloatArray | None = None) -> Curve:
    """C2 cubic spline through ``points (n, 2)`` with the conditions of both ends.

    ``s (n,)`` are the points' parameters, by default their chord length. Two conditions at an end are met with the help
    of one more knot in the interval beside it; none at all by leaving the knot beside it out (with fewer than four
    points: by a vanishing second derivative).
    """
    if s is None:
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    columns = [_component(points[:, c], s, start[c], end[c]) for c in (0, 1)]
    breaks = np.unique(np.concatenate([knots for knots, _ in columns]))
    c = np.empty((len(breaks) - 1, 2, 4))
    for k, factor in enumerate((1, 1, 2, 6)):
        for i, (knots, weights) in enumerate(columns):
            c[:, i, k] = b_splines(knots, breaks[:-1], k) @ weights / factor
    return Curve(breaks, c)


def b_splines(t: FloatArray, x: FloatArray, order: int = 0) -> FloatArray:
    """Derivatives of the cubic B-splines over the knots ``t`` at ``x (n,)``: ``(n, len(t) - 4)``.

    By the recursion of Cox and de Boor; loading scipy's would take longer than an outline is worth.
    """
    piece = np.clip(np.searchsorted(t, x, side="right") - 1, 3, len(t) - 5)
    B = (np.arange(len(t) - 1) == piece[:, None]).astype(float)
    for degree in (1, 2, 3):
        width = t[degree:] - t[:-degree]
        # knots that coincide have no interval between them: their share is zero
        share = B / np.where(width > 0, width, np.inf)
        if degree > 3 - order:
            B = degree * (share[:, :-1] - share[:, 1:])
        else:
            B = (x[:, None] - t[: -degree - 1]) * share[:, :-1] + (t[degree + 1 :] - x[:, None]) * share[:, 1:]
    return B


def _component(
    values: FloatArray, s: FloatArray, start: list[tuple[int, float]], end: list[tuple[int, float]]
) -> tuple[FloatArray, FloatArray]:
    """Knots of the spline of one coordinate, and the weights of its B-splines."""
    n, knots = len(s), list(s[1:-1])
    if n < 4:
        start, end = start or [(2, 0.0)], end or [(2, 0.0)]
    if not start:
        # one condition less has to go with one knot less
        knots.remove(s[1])
    if not end:
        knots.remove(s[-2])
    # in a single interval both additional knots would coincide in its middle
    both = n == 2 and len(start) == len(end) == 2
    if len(start) == 2:
        knots.append(s[0] + (s[1] - s[0]) / (3 if both else 2))
    if len(end) == 2:
        knots.append(s[-1] - (s[-1] - s[-2]) / (3 if both else 2))
    t = np.concatenate([np.repeat(s[0], 4), sorted(knots), np.repeat(s[-1], 4)])
    rows = [b_splines(t, s)]
    rows += [b_splines(t, place, order) for place, wanted in ((s[:1], start), (s[-1:], end)) for order, _ in wanted]
    right = np.concatenate([values, [value for _, value in start], [value for _, value in end]])
    return t, np.linalg.solve(np.concatenate(rows), right)


def straight_runs(points: FloatArray) -> list[tuple[int, int, bool]]:
    """Cut the points into runs ``(first, last, is_straight)``, straight where three or more lie on one line.

    So is a cap that two points give, from the axis out to a straight wall.
    """
    last, (z, r) = len(points) - 1, points.T
    if last < 2:
        return _runs(points)
    low, high = (int(r[a] == 0.0 and z[a] == z[b] != z[c]) for a, b, c in ((0, 1, 2), (-1, -2, -3)))
    wall = [(i + low, j + low, flat) for i, j, flat in _runs(points[low : last + 1 - high])]
    if (low and not wall[0][2]) or (high and not wall[-1][2]):
        return _runs(points)
    return [*[(0, 1, True)] * low, *wall, *[(last - 1, last, True)] * high]


def _runs(points: FloatArray) -> list[tuple[int, int, bool]]:
    """Runs of points whose caps, if they have any, have three or more."""
    runs: list[tuple[int, int, bool]] = []
    i, bent_from, last = 0, 0, len(points) - 1
    while i < last:
        j = i + 1
        while j < last and _on_a_line(points[i : j + 2]):
            j += 1
        if j >= i + 2 or (last == 1 and _on_a_line(points)):
            if bent_from < i:
                runs.append((bent_from, i, False))
            runs.append((i, j, True))
            bent_from = i = j
        else:
            i += 1
    if bent_from < last:
        runs.append((bent_from, last, False))
    return runs


def _on_a_line(points: FloatArray) -> bool:
    """Whether the points follow one straight line forwards; on the axis only a line at right angles counts."""
    steps, chord = np.diff(points, axis=0), points[-1] - points[0]
    e = chord / np.linalg.norm(chord)
    tolerance = COLLINEAR * np.linalg.norm(steps, axis=1).min()
    off = (points - points[0]) @ np.array([-e[1], e[0]])
    # a slanted line that ends on the axis would give the surface a tip
    tipped = (points[:, 1] == 0).any() and abs(e[0]) > COLLINEAR
    return bool((steps @ e > 0).all() and np.abs(off).max() <= tolerance and not tipped)


def rounding(p: FloatArray, t: FloatArray, u: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Points ``(n, 2)`` of the arc that leaves p along t and ends along u, and their arc length ``(n,)``."""
    angle = float(np.arctan2(t[0] * u[1] - t[1] * u[0], t @ u))
    # at half a turn the sign hangs on rounding
    angle = -np.pi if angle > np.pi - 1e-6 else angle
    phi = np.linspace(0.0, angle, 1 + max(2, int(np.ceil(abs(angle) / ARC_STEP))))
    inward = np.sign(angle) * np.array([-t[1], t[0]])
    arc = p + radius * (np.sin(np.abs(phi))[:, None] * t + (1 - np.cos(phi))[:, None] * inward)
    return arc, radius * np.abs(phi)


Ends = tuple[float, float]


def with_lids(given: Curve, rim: float, heights: Sequence[float | None] = ()) -> tuple[Curve, Ends, Ends]:
    """Outline with both ends carried on to the axis as `lid` does; the part of s that was given, and between the lids.

    The latter are the ends of the outline where nothing is flat. Without ``heights`` the lids lie where the outline
    ends, which leaves the last of it to their rims.
    """
    if not heights:
        given, heights = _without_rims(given, rim)
    below, above = (lid(given, height, rim, first=k == 0) for k, height in enumerate(heights))
    curve = joined([*below, given, *above])
    s, first = curve.breaks, sum(len(piece.coefficients) for piece in below)
    low, high = (bool(ends) and not ends[k].coefficients[..., 2:].any() for ends, k in ((below, 0), (above, -1)))
    wall = float(s[first]), float(s[first + len(given.coefficients)])
    return curve, wall, (float(s[1]) if low else 0.0, float(s[-2] if high else s[-1]))


def _without_rims(curve: Curve, rim: float) -> tuple[Curve, list[float | None]]:
    """An outline without its rims, and the heights of its ends: None on the axis, and for one that runs outwards."""
    cuts = [0.0, float(curve.breaks[-1])]
    heights: list[float | None] = [None, None]
    for k, outwards in enumerate((-1.0, 1.0)):
        (z, r), d = (curve.derivative(np.array([cuts[k]]), order)[0] for order in range(2))
        rise, widens = d / np.linalg.norm(d) * [1.0, outwards]
        if r > 1e-9 and rise > 0.3:
            length = min(rim, 0.25 * r) * min((1.0 + widens) / rise, 1.0)  # where it flares, a smaller rim
            cuts[k] -= outwards * min(length / np.linalg.norm(d), 0.25 * float(curve.breaks[-1]))
            heights[k] = float(z)
    return curve.between(*cuts), heights


def through(points: FloatArray, rim: float) -> Curve:
    """Curve through the points; ``rim`` is the radius of the rounding at corners [m]."""
    runs = straight_runs(points)
    candidates = (
        (j, _corner(points, runs[k], runs[k + 1], rim))
        for k, (_, j, flat) in enumerate(runs[:-1])
        if flat and runs[k + 1][2]
    )
    corners = {j: corner for j, corner in candidates if corner is not None}
    pieces: list[Curve] = []
    for i, j, flat in runs:
        if flat:
            p = corners[i][0][-1] if i in corners else points[i]
            q = corners[j][0][0] if j in corners else points[j]
            if i in corners:
                pieces.append(spline(corners[i][0], joint(corners[i][2]), joint(corners[i][3]), corners[i][1]))
            pieces.append(line(p, q))
        else:
            start = _end(points, i, i - 1, runs) if i else (FREE if points[0, 1] else POLE)
            end = _end(points, j, j, runs) if j < len(points) - 1 else (FREE if points[-1, 1] else POLE)
            pieces.append(spline(points[i : j + 1], start, end))
    return joined(pieces)


def _end(points: FloatArray, at: int, side: int, runs: list[tuple[int, int, bool]]) -> End:
    """End of a bent run at a straight neighbour, which runs to or from the point ``at``."""
    i, j, _ = next(run for run in runs if run[2] and (run[1] == at if side < at else run[0] == at))
    return joint((points[j] - points[i]) / np.linalg.norm(points[j] - points[i]))


def _corner(
    points: FloatArray, before: tuple[int, int, bool], after: tuple[int, int, bool], rim: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None:
    """Rounding between two straight runs: points, arc length, directions before and after; None if they are one."""
    p, q, r = points[before[0]], points[before[1]], points[after[1]]
    a, b = np.linalg.norm(q - p), np.linalg.norm(r - q)
    t, u = (q - p) / a, (r - q) / b
    turn = np.arctan2(abs(t[0] * u[1] - t[1] * u[0]), t @ u)
    if turn <= NEGLIGIBLE:
        return None
    half = np.tan(turn / 2)
    # at most 0.3 of each run, so that roundings at both its ends leave a straight part
    # share of the rim: gentler corners are rounded by a larger radius, or rounding errors would bend them
    cut = min(max(half, 0.005) * rim, 0.3 * a, 0.3 * b)
    return *rounding(q - cut * t, t, u, cut / half), t, u


def lid(curve: Curve, height: float | None, rim: float, *, first: bool) -> list[Curve]:
    """Rounded edge and flat lid that carry one end of an outline to the axis, in the order of s; nothing there.

    The lid lies at ``height``, or where an edge rounded by ``rim`` ends [m]. Where the rounding would come close to the
    axis, a dome is drawn.
    """
    s = curve.breaks[:1] if first else curve.breaks[-1:]
    p, d1, d2 = (curve.derivative(s, order)[0] for order in range(3))
    if p[1] < 1e-9:  # rounded: the line that ends on the axis was given by its length
        return []
    mirror = np.array([-1.0, 1.0]) if first else np.ones(2)  # the first end is a last one, seen backwards
    speed = np.linalg.norm(d1)
    d1, d2 = d1 / speed, (d2 - (d2 @ d1) * d1 / speed**2) / speed**2  # by arc length, so that the edge starts evenly
    t, inwards = (-d1 if first else d1) * mirror, np.array([0.0, -1.0])
    start, fall = p * mirror, 1.0 - t @ inwards
    if fall <= 1e-9:
        end = np.array([start[0], 0.0])
        return [line(end * mirror, start * mirror) if first else line(start, end)]
    # a part of the lid has to stay flat, however narrow the end is
    radius = min(rim, 0.25 * p[1]) if height is None else abs(height - p[0]) / fall
    # a rounding that reaches this far to the axis is drawn as a dome
    if radius * np.sqrt(1.0 - (t @ inwards) ** 2) > 0.9 * p[1]:
        pole = np.array([p[0] + mirror[0] * radius * fall, 0.0])
        if first:
            return [spline(np.array([pole, p]), POLE, joint(d1, d2))]
        return [spline(np.array([p, pole]), joint(d1, d2), POLE)]
    arc, length = rounding(start, t, inwards, radius)
    end = np.array([arc[-1][0], 0.0])
    if first:
        edge = spline(arc[::-1] * mirror, joint(-inwards), joint(d1, d2), length[-1] - length[::-1])
        return [line(end * mirror, arc[-1] * mirror), edge]
    return [spline(arc, joint(d1, d2), joint(inwards), length), line(arc[-1], end)]
