"""How far the wrenches of contacts with any limit surfaces reach along a wrench.

Ellipsoids go to `scoring.gauge`. Other bodies are met by cutting planes: points of a body, found where its support is
asked for, span a polytope inside it, and the reach of those polytopes is a linear programme. Its value is a lower
bound, the bodies' own support for its direction an upper one, and that direction asks for the next points.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from softjaw.scoring.contact import Body
from softjaw.scoring.gauge import gauge
from softjaw.scoring.inscribed import ellipsoid_inside, is_ellipsoid
from softjaw.scoring.polytope import fibonacci_vertices
from softjaw.scoring.simplex import best_columns

FloatArray = NDArray[np.float64]

_CUTS = 80
_FAR = 1e4  # the programmes look for directions u of at most this, relative to 1 / |w|


class Reach(NamedTuple):
    """Bounds of the reach, and the direction ``(r,)`` that gives the upper one."""

    lower: float
    upper: float
    u: FloatArray


def reach(C: FloatArray, bodies: Sequence[Body], w: FloatArray, kind: str, tolerance: float = 1e-8) -> Reach:
    """Largest ``s`` with ``s w`` among the contacts' wrenches.

    Parameters
    ----------
    C : (n, r, 4) array
        Wrenches of each contact's normal force and of its body's three loads; together they span the ``r`` dimensions.
    bodies : sequence of Body
        Limit surfaces.
    w : (r,) array
        Wrench, not 0.
    kind : str
        "linf", "l1" or "fixed" as in `scoring.gauge`.
    tolerance : float
        Gap of the bounds, relative to the upper one, at which the cutting planes stop.
    """
    if all(is_ellipsoid(body) for body in bodies):
        D = np.array([ellipsoid_inside(body) @ Ci[:, 1:].T for body, Ci in zip(bodies, C, strict=True)])
        found = gauge(C[:, :, 0], D, w[None], kind)
        return Reach(float(found.lower[0]), float(found.upper[0]), found.u[0])
    programme = _CuttingPlanes(C, bodies, w, kind)
    best = Reach(-np.inf if kind == "fixed" else 0.0, np.inf, w / (w @ w))
    programme.cut(best.u)
    programme.cut_vertices()
    for _ in range(_CUTS):
        lower, u = programme.solve()
        upper = programme.support(u)
        if upper < best.upper:
            best = Reach(best.lower, upper, u)
        best = best._replace(lower=max(best.lower, min(lower, best.upper)))
        if best.upper - best.lower <= tolerance * abs(best.upper):
            break
        # a point between the last and the best direction cuts deeper than either
        programme.cut(u)
        programme.cut((u + best.u) / 2)
    return best


def body_point(body: Body, t: FloatArray) -> FloatArray:
    """A point of the body farthest along ``t``, both ``(3,)``: a vertex, or the gradient of the support."""
    if (vertices := getattr(body, "vertices", None)) is not None:
        return vertices[np.argmax(vertices @ t)]
    axes = _reach_of(body)
    size = np.linalg.norm(t * axes)
    if size == 0:
        return np.zeros(3)
    step = 1e-5 * size * np.diag(1 / axes)
    h = body.support(np.vstack([t + step, t - step, t]))
    p = (h[:3] - h[3:6]) / (2e-5 * size) * axes
    return p * (h[6] / (p @ t)) if p @ t > 0 else p


def _reach_of(body: Body) -> FloatArray:
    """Reach along the axes ``(3,)``, by which directions are made even; 1 along one without any."""
    axes = body.support(np.eye(3))
    return np.where(axes > 0, axes, 1.0)


class _CuttingPlanes:
    """Linear programme of the polytopes found so far, in ``(u, s)``."""

    def __init__(self, C: FloatArray, bodies: Sequence[Body], w: FloatArray, kind: str) -> None:
        self.C, self.bodies, self.w, self.kind = C, bodies, w, kind
        self.r, self.k = len(w), 1 if kind == "l1" else len(C)
        self.far = _FAR / np.linalg.norm(w)
        self.rows: list[FloatArray] = []
        for i, body in enumerate(bodies):
            axes = _reach_of(body)
            for t in fibonacci_vertices(np.ones(3), 40) / axes:
                self._add(i, body_point(body, t))

    def cut(self, u: FloatArray) -> None:
        """Add the point of each body that matters for the direction."""
        for i, (C, body) in enumerate(zip(self.C, self.bodies, strict=True)):
            self._add(i, body_point(body, C[:, 1:].T @ u))

    def cut_vertices(self) -> None:
        """Add the vertices that matter in the end, if all bodies are polytopes whose normal forces can be zero."""
        points = [getattr(body, "vertices", None) for body in self.bodies]
        if self.kind == "fixed" or any(p is None for p in points):
            return
        G = np.vstack([C[:, 0] + p @ C[:, 1:].T for C, p in zip(self.C, points, strict=True)])
        body = np.repeat(np.arange(len(points)), [len(p) for p in points])
        first = np.searchsorted(body, np.arange(len(points)))
        for j in best_columns(G, body % self.k, self.k, self.w):
            if j >= 0:
                i = body[j]
                self._add(i, points[i][j - first[i]])

    def solve(self) -> tuple[float, FloatArray]:
        """Reach of the polytopes and its direction."""
        cost = np.concatenate([np.zeros(self.r), np.ones(self.k)])
        s = (None, None) if self.kind == "fixed" else (0, None)
        found = linprog(
            cost,
            A_ub=np.array(self.rows),
            b_ub=np.zeros(len(self.rows)),
            A_eq=np.concatenate([self.w, np.zeros(self.k)])[None],
            b_eq=[1.0],
            bounds=[(-self.far, self.far)] * self.r + [s] * self.k,
            method="highs-ds",
        )
        u = found.x[: self.r] / (found.x[: self.r] @ self.w)
        inner = np.abs(u).max() < 0.99 * self.far  # otherwise the bounds of u took part, and the value proves nothing
        return (float(found.fun) if inner else -np.inf), u

    def support(self, u: FloatArray) -> float:
        """Support of the contacts' wrenches for the direction."""
        pairs = zip(self.C, self.bodies, strict=True)
        h = np.array([C[:, 0] @ u + body.support(u[None] @ C[:, 1:])[0] for C, body in pairs])
        if self.kind == "fixed":
            return float(h.sum())
        return float(np.maximum(h, 0).max() if self.kind == "l1" else np.maximum(h, 0).sum())

    def _add(self, i: int, p: FloatArray) -> None:
        row = np.zeros(self.r + self.k)
        row[: self.r] = self.C[i, :, 0] + self.C[i, :, 1:] @ p
        row[self.r + i % self.k] = -1
        self.rows.append(row)
