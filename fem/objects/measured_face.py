"""The deformed contact face of a pad as it was measured: smoothed, and taken as the rigid object that it lies on.

A pad that bears on a rigid object has the object's shape where it bears. Elsewhere its face is free, and the object
lies further away. So the measured face itself, taken as a rigid object, has the same equilibrium: where the pad bore
nothing has changed, and where it was free it touches without pressure, which keeps all laws of contact (no tension, no
overlap, no pressure across a gap). The contact problem has one solution, so its pressures are those of the pad that was
measured, although nobody knows the object. The face is seen from the backing plate, which stands where the undeformed
pad had it: how far the plate was closed is measured along with the face.

What noise adds is not small: a wave of length ``l`` and amplitude ``a`` on the face of foam with the plane-strain
modulus ``E*`` takes pressures of ``pi E* a / l``. The points are therefore smoothed by a spline of cubic polynomials
``c`` with a penalty on its second differences (Eilers and Marx, 1996),

    minimise  sum (z - h(x, y))^2 + lambda |D c|^2,

``lambda`` by generalised cross-validation (Craven and Wahba, 1979), which needs no noise to be named and finds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline
from scipy.linalg import eigh

from softjaw.fem.objects.gap import Gap
from softjaw.friction.patch import FloatArray

CUBIC = 3
STRENGTHS = np.logspace(-8.0, 8.0, 129)  # of the penalty, over that at which data and penalty weigh the same
RIDGE, LEAST = 1e-12, 1e-9  # of the mean weight of the points, and strength of the penalty, that are always there
CAUTIOUS = 1.4  # weight of a number of the face in the validation; 1 often takes noise for shape (Kim and Gu, 2004)
MOST_CELLS = 24  # of the spline along a side: points tell no more shape than these hold
PASSES, CLOSE = 50, 1e-12  # of Newton's method for the nearest point; step at which it ends [m]


class Line(NamedTuple):
    """Clamped cubic B-splines between the ``ends`` of points on a line [m], continued by their tangents."""

    ends: tuple[float, float]
    cells: int

    def basis(self, u: FloatArray) -> FloatArray:
        """Values, first and second derivatives ``(3, n, cells + 3)`` at places ``(n,)`` [m]."""
        low, high = self.ends
        knots = np.concatenate([[low] * CUBIC, np.linspace(low, high, self.cells + 1), [high] * CUBIC])
        spline = BSpline(knots, np.eye(self.cells + CUBIC), CUBIC)
        inside = np.clip(u, low, high)
        B = np.stack([spline(inside), spline.derivative(1)(inside), spline.derivative(2)(inside)])
        # beyond the points nothing is known of the face, and a polynomial would run away
        B[0] += (u - inside)[:, None] * B[1]
        B[2][u != inside] = 0.0
        return B

    @property
    def penalty(self) -> FloatArray:
        """Sum of squared second derivatives at the middles of the cells, times their length ``(m, m)``."""
        edges = np.linspace(*self.ends, self.cells + 1)
        D = self.basis(0.5 * (edges[1:] + edges[:-1]))[2]
        return np.asarray(D.T @ D * (edges[1] - edges[0]))


class MeasuredFace(NamedTuple):
    """Face ``z = h(x, y)`` with the object above it, ``z`` along the approach, in the frame of the pad at closing 0.

    ``x`` is None for a contour, which is the same all along the pad; ``coefficients (p, q)`` are of the products of
    both splines, p = 1 for a contour [m]; ``noise``: standard deviation of the points from the face [m]; ``doubt``:
    largest standard error of the face at a point (Wahba's Bayesian one, which holds its bias, too) [m].
    """

    x: Line | None
    y: Line
    coefficients: FloatArray
    noise: float
    doubt: float

    def height(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height ``(n,)`` [m], slopes ``(n, 2)`` and second derivatives ``(n, 2, 2)`` [1/m] at places of the face."""
        along = np.stack([np.ones((len(x), 1)), *np.zeros((2, len(x), 1))]) if self.x is None else self.x.basis(x)
        across = self.y.basis(y)

        def d(i: int, j: int) -> FloatArray:
            return np.asarray(np.einsum("np,pq,nq->n", along[i], self.coefficients, across[j]))

        mixed = d(1, 1)
        second = np.stack([np.stack([d(2, 0), mixed], -1), np.stack([mixed, d(0, 2)], -1)], -2)
        return d(0, 0), np.stack([d(1, 0), d(0, 1)], -1), second

    def lifted(self, by: float) -> MeasuredFace:
        """The same face further along the approach [m]."""
        # the splines add up to one everywhere
        return self._replace(coefficients=self.coefficients + by)

    def gap(self, X: ArrayLike) -> Gap:
        """Signed distance ``(n,)`` [m], normal ``(n, 3)`` towards the pad and Hessian ``(n, 3, 3)`` [1/m].

        With the nearest point's shape operator ``S``, the Hessian of the distance is ``S (I + g S)^-1``.
        """
        X = np.asarray(X, float)
        foot = self._foot(X)
        h, slope, second = self.height(*foot.T)
        w = np.sqrt(1.0 + (slope**2).sum(axis=1))
        normal = np.column_stack([slope, -np.ones(len(X))]) / w[:, None]
        g = ((X - np.column_stack([foot, h])) * normal).sum(axis=1)
        P = np.eye(3) - normal[:, :, None] * normal[:, None, :]
        H = np.zeros((len(X), 3, 3))
        H[:, :2, :2] = second / w[:, None, None]
        S = P @ H @ P
        return g, normal, np.linalg.solve(np.eye(3) + g[:, None, None] * S, S)

    def _foot(self, X: FloatArray) -> FloatArray:
        """Places ``(n, 2)`` of the nearest points of the face [m], by Newton's method with halved steps."""
        foot = X[:, :2].copy()

        def distance(place: FloatArray) -> FloatArray:
            return ((X[:, :2] - place) ** 2).sum(axis=1) + (X[:, 2] - self.height(*place.T)[0]) ** 2

        value = distance(foot)
        for _ in range(PASSES):
            h, slope, second = self.height(*foot.T)
            off = (X[:, 2] - h)[:, None]
            rise = -(X[:, :2] - foot) - off * slope  # half the gradient
            tangent = np.eye(2) + slope[:, :, None] * slope[:, None, :]
            exact = tangent - off[:, :, None] * second
            # where the point lies beyond the centre of curvature, Gauss and Newton's tangent still leads down
            sound = (np.linalg.det(exact) > 0.1 * np.linalg.det(tangent)) & (np.trace(exact, axis1=1, axis2=2) > 0)
            step = -np.linalg.solve(np.where(sound[:, None, None], exact, tangent), rise[..., None])[..., 0]
            if np.abs(step).max(initial=0.0) <= CLOSE:
                break
            for _ in range(8):
                trial = distance(foot + step)
                worse = trial > value + 1e-18
                if not worse.any():
                    break
                step[worse] *= 0.5
            foot, value = foot + step, distance(foot + step)
        return foot


def measured_face(points: FloatArray, cell: float) -> MeasuredFace:
    """Smooth face through measured points.

    ``points``: ``(y, z)`` of a contour along the pad's width, or ``(x, y, z)`` [m]; ``cell``: size of a cell of the
    spline [m]: what is finer is taken for noise.

    Raises `ValueError`: for too few points, and points on one line.
    """
    *places, z = points.T
    lines = [_line(place, cell) for place in places]
    m = int(np.prod([line.cells + CUBIC for line in lines]))
    if len(z) < 2 * CUBIC:
        raise ValueError(f"found {len(z)} points, expected at least {2 * CUBIC}")
    bases = [line.basis(place)[0] for line, place in zip(lines, places, strict=True)]
    A = bases[0] if len(lines) == 1 else np.einsum("np,nq->npq", *bases).reshape(len(z), m)
    c, noise, doubt = _fitted(A, z, _penalty(lines))
    *along, across = lines
    return MeasuredFace(along[0] if along else None, across, c.reshape(-1, across.cells + CUBIC), noise, doubt)


def _line(place: FloatArray, cell: float) -> Line:
    """Splines along the points' places ``(n,)`` [m]."""
    ends = float(place.min()), float(place.max())
    if not ends[1] - ends[0] > cell:
        raise ValueError(f"points spread over {1e3 * (ends[1] - ends[0]):.3g} mm only, expected the width of a contact")
    # no more cells than half the places that differ, or the points would not tell what is noise
    most = min(MOST_CELLS, len(np.unique(np.round(place / (0.1 * cell)))) // 2)
    return Line(ends, int(np.clip(np.ceil((ends[1] - ends[0]) / cell), 1, max(most, 1))))


def _penalty(lines: list[Line]) -> FloatArray:
    """Of the squared second derivatives in all directions."""
    if len(lines) == 1:
        return lines[0].penalty
    mass = [line.basis(np.linspace(*line.ends, 4 * line.cells + 1))[:2] for line in lines]
    (M0, T0), (M1, T1) = ([B.T @ B / len(B) for B in bases] for bases in mass)
    lengths = [line.ends[1] - line.ends[0] for line in lines]
    R0, R1 = (line.penalty / length for line, length in zip(lines, lengths, strict=True))
    return np.asarray(np.kron(R0, M1) + 2.0 * np.kron(T0, T1) + np.kron(M0, R1))


def _fitted(A: FloatArray, z: FloatArray, R: FloatArray) -> tuple[FloatArray, float, float]:
    """Coefficients ``(m,)`` with the penalty of the least validation error, and what is left: noise and doubt [m]."""
    G = A.T @ A
    scale = np.trace(G) / max(np.trace(R), 1e-300)
    # cells without points would be undetermined where the penalty is weak
    G += RIDGE * np.trace(G) / len(G) * np.eye(len(G)) + LEAST * scale * R
    # in the basis that makes both diagonal every strength costs one product
    mu, V = eigh(scale * R, G)
    mu, b, AV = np.maximum(mu, 0.0), V.T @ (A.T @ z), A @ V

    def filters(strength: float) -> FloatArray:
        return np.asarray(1.0 / (1.0 + strength * mu))

    def residual(strength: float) -> tuple[float, float]:
        """Sum of squares that the face leaves [m^2], and numbers that judge it."""
        return float(((z - AV @ (filters(strength) * b)) ** 2).sum()), len(z) - float(filters(strength).sum())

    # with as many numbers as points nothing would be left to judge by
    sound = [s for s in STRENGTHS.tolist() if CAUTIOUS * (len(z) - residual(s)[1]) <= len(z) - 1.0]
    strength = min(sound, key=lambda s: residual(s)[0] / (len(z) - CAUTIOUS * (len(z) - residual(s)[1])) ** 2)
    squares, free = residual(strength)
    noise = float(np.sqrt(squares / free))
    return V @ (filters(strength) * b), noise, noise * float(np.sqrt((AV**2 @ filters(strength)).max()))


def cell_of(size: Sequence[float], elements: Sequence[int]) -> float:
    """Cell of the spline for a pad [m]: an element of its width, which can take no finer shape."""
    return float(max(size[1] / elements[1], size[1] / MOST_CELLS))
