"""How far the wrenches of contacts with any limit surfaces reach along a wrench.

Ellipsoids go to `scoring.gauge`. Other bodies are met by cutting planes: points of a body, vertices of a polytope,
found where its support is asked for, span a polytope inside it, and the reach of those polytopes is a linear programme.
Its value is a lower bound, the bodies' own support for its direction an upper one, and that direction asks for the next
points.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from softjaw.scoring.bodies import (
    Body,
    ellipsoid_inside,
    fibonacci_vertices,
    is_ellipsoid,
    joint_support,
    touching_points,
)
from softjaw.scoring.gauge import gauge

FloatArray = NDArray[np.float64]


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
        "linf" or "l1" as in `scoring.gauge`.
    tolerance : float
        Gap of the bounds, relative to the upper one, at which the cutting planes stop.
    """
    if all(is_ellipsoid(body) for body in bodies):
        D = np.array([ellipsoid_inside(body) @ Ci[:, 1:].T for body, Ci in zip(bodies, C, strict=True)])
        bounds = gauge(C[:, :, 0], D, w[None], kind)
        return Reach(float(bounds.lower[0]), float(bounds.upper[0]), bounds.u[0])
    programme = _CuttingPlanes(C, bodies, w, kind)
    best = Reach(0.0, np.inf, w / (w @ w))
    programme.cut(best.u)
    for _ in range(80):
        lower, u = programme.solve()
        upper = programme.support(u)
        if upper < best.upper:
            best = Reach(best.lower, upper, u)
        # the tolerance of the solver may put its value above a proved bound
        best = best._replace(lower=max(best.lower, min(lower, best.upper)))
        if best.upper - best.lower <= tolerance * abs(best.upper):
            break
        # a point between the last and the best direction cuts deeper than either
        programme.cut(u)
        programme.cut((u + best.u) / 2)
    return best


class _CuttingPlanes:
    """Linear programme of the polytopes found so far, in ``(u, s)``."""

    def __init__(self, C: FloatArray, bodies: Sequence[Body], w: FloatArray, kind: str) -> None:
        self.C, self.bodies, self.w, self.kind = C, bodies, w, kind
        self.r, self.k = len(w), 1 if kind == "l1" else len(C)
        self.far = 1e4 / np.linalg.norm(w)  # of the directions u that the programmes look for
        self.rows = np.zeros((0, self.r + self.k))
        for i, body in enumerate(bodies):
            axes = body.support(np.eye(3))
            # without points all over a body the first programmes would run to their bounds
            self._add(i, touching_points(body, fibonacci_vertices(np.ones(3), 40) / np.where(axes > 0, axes, 1.0)))

    def cut(self, u: FloatArray) -> None:
        """Add the point of each body that matters for the direction."""
        for i, (C, body) in enumerate(zip(self.C, self.bodies, strict=True)):
            self._add(i, touching_points(body, C[:, 1:].T @ u))

    def solve(self) -> tuple[float, FloatArray]:
        """Reach of the polytopes and its direction."""
        cost = np.concatenate([np.zeros(self.r), np.ones(self.k)])
        # the bounds keep the programme finite where the polytopes so far do not hold the wrench at all
        optimum = linprog(
            cost,
            A_ub=self.rows,
            b_ub=np.zeros(len(self.rows)),
            A_eq=np.concatenate([self.w, np.zeros(self.k)])[None],
            b_eq=[1.0],
            bounds=[(-self.far, self.far)] * self.r + [(0, None)] * self.k,
            method="highs-ds",
        )
        # the solver meets u . w = 1 up to its tolerance only, and the bound needs it exactly
        u = optimum.x[: self.r] / (optimum.x[: self.r] @ self.w)
        inner = np.abs(u).max() < 0.99 * self.far  # otherwise the bounds of u took part, and the value proves nothing
        return (float(optimum.fun) if inner else -np.inf), u

    def support(self, u: FloatArray) -> float:
        """Support of the contacts' wrenches for the direction."""
        return float(joint_support(self.C, self.bodies, u[None], self.kind)[0])

    def _add(self, i: int, points: FloatArray) -> None:
        rows = np.zeros((len(points), self.r + self.k))
        rows[:, : self.r] = self.C[i, :, 0] + points @ self.C[i, :, 1:].T
        rows[:, self.r + i % self.k] = -1
        self.rows = np.vstack([self.rows, rows])
