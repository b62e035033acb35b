"""Where points of a pad face a deformed wall: closest material point along the wall's director, gap and derivatives.

The outer face is ``x_s(theta, s) = X(theta, s) + sum N_a v_a``: the exact undeformed surface plus the displacements
``v_a`` of the outer face at the mesh's nodes, and it faces along its director ``n = d / |d|`` with
``d = h n_0 + sum N_a w_a`` (``h`` half the wall, ``n_0`` the exact normal, ``w_a`` the change of the nodes' directors).
So curved walls are smooth whatever the mesh, and ``n`` is continuous from element to element. The point ``x`` and the
place it faces fulfil::

    x = x_s(theta, s) + g n(theta, s)

which is solved for ``(theta, s, g)`` by Newton's method. With ``Q = d(theta, s)/dx`` and ``P = 1 - n n^T`` the
directions change by ``dn = H (dx - N_a dv_a) + (1 - g H) G N_a dw_a``, ``H = n_theta Q_1 + n_s Q_2``, ``G = P / |d|``,
and the gap by ``dg = e . (dx - N_a dv_a - g G N_a dw_a)``; ``e`` is nearly ``n``.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from softjaw.fem.assembly import IntArray
from softjaw.fem.materials import inverted
from softjaw.fem.objects.splines import SplineSurface, evaluate
from softjaw.friction.patch import NEGLIGIBLE, FloatArray

FAR = 1.0  # gap of a point that faces no wall [m]
LONGEST_TURN, LONGEST_SLIDE = 0.1, 0.004  # of one iteration [rad], [m]


@dataclass(frozen=True, eq=False)
class Wall:
    """Outer face of a structured shell mesh: the undeformed surface, and grid lines.

    ``theta (m + 1,)`` [rad], ``s (k + 1,)`` [m]. ``nodes (m + 1, k + 1)`` lie on them, a closed mesh ends with its
    first line; ``half (nodes,)`` is half the wall [m].
    """

    surface: SplineSurface
    theta: FloatArray
    s: FloatArray
    nodes: IntArray
    half: FloatArray

    def places(self, points: FloatArray) -> FloatArray:
        """Parameters ``(n, 2)`` of the undeformed wall's grid points that are closest to ``points (n, 3)``."""
        parameters, tree = self._grid
        return parameters[tree.query(points)[1]]

    def past_ends(self, points: FloatArray) -> NDArray[np.bool_]:
        """Which ``points (n, 3)`` lie beyond an end of the undeformed wall."""
        places, (low, high) = self.places(points), self.ends
        at = self.surface.at(*places.T)
        along = ((points - at[:, 0]) * at[:, 2]).sum(axis=1)
        # the outline is measured along s, so this is a length
        return (places[:, 1] <= low) & (along < -NEGLIGIBLE) | (places[:, 1] >= high) & (along > NEGLIGIBLE)

    @cached_property
    def closed(self) -> bool:
        """Whether the mesh runs once round; the surface does so even where a part of it is meshed."""
        return bool(self.theta[-1] - self.theta[0] > 2 * np.pi - 1e-6)

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Part of s that can be faced: meshed, and known to the surface."""
        return max(self.s[0], self.surface.s[0]), min(self.s[-1], self.surface.s[-1])

    @cached_property
    def _grid(self) -> tuple[FloatArray, cKDTree]:
        """Parameters of the grid points, and a search tree of their places."""
        low, high = self.ends
        lines = np.unique(np.clip(self.s, low, high))
        t, s = (grid.ravel() for grid in np.meshgrid(self.theta, lines, indexing="ij"))
        return np.column_stack([t, s]), cKDTree(self.surface.at(t, s)[:, 0])


class Facing(NamedTuple):
    """What ``n`` points face; symbols as in the module's formulas.

    ``gap``: signed distance along the director, `FAR` where the point faces no wall [m]; ``nodes, N (n, 4)``: of the
    shell element and their shape functions; ``S (n, 4, 3)``: ``dN_a/dx``, by how much the share of a node changes when
    the point moves.
    """

    gap: FloatArray
    normal: FloatArray
    e: FloatArray
    nodes: IntArray
    N: FloatArray
    H: FloatArray
    G: FloatArray
    S: FloatArray


def face(
    wall: Wall, points: FloatArray, places: FloatArray, v: FloatArray, w: FloatArray, beyond: float = 0.0
) -> Facing:
    """What ``points (n, 3)`` face; ``places (n, 2)`` are where the search begins, and are set to what was found.

    ``v, w (nodes, 3)``: displacement of the outer face and change of the director [m]; ``beyond``: length by which the
    wall is continued at its ends [m].

    Raises `ArithmeticError`: if a point close to the wall finds no place.
    """
    facing = _search(wall, points, places, v, w, beyond)
    # a second search for the few that failed is cheaper than a safe start for all of them
    again = np.flatnonzero(np.isnan(facing.gap) | (facing.gap == FAR))
    if len(again):
        # where a point was last may lie beyond a fold by now: begin once more from the nearest place of the whole wall
        fresh = wall.places(points[again])
        pick = (fresh[:, 1] > wall.ends[0]) & (fresh[:, 1] < wall.ends[1]) | np.isnan(facing.gap[again])
        again, fresh = again[pick], fresh[pick]
        second = _search(wall, points[again], fresh, v, w, beyond)
        # NaN compares as false: what is lost again keeps its first answer
        good = second.gap < FAR
        for values, better in zip(facing._asdict().values(), second._asdict().values(), strict=True):
            values[again[good]] = better[good]
        places[again[good]] = fresh[good]
    lost = np.flatnonzero(np.isnan(facing.gap))
    if len(lost):
        raise ArithmeticError(f"a point of the pad at {points[lost[0]].tolist()} m has no closest point on the wall")
    return facing


def _search(wall: Wall, points: FloatArray, places: FloatArray, v: FloatArray, w: FloatArray, beyond: float) -> Facing:
    """`face` from given places; the gap of a point that got lost is NaN."""
    n = len(points)
    facing = Facing(
        np.empty(n), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 4), np.int32), np.zeros((n, 4)),
        np.zeros((n, 3, 3)), np.zeros((n, 3, 3)), np.zeros((n, 4, 3)),
    )  # fmt: skip
    surface = wall.surface
    _face(
        np.ascontiguousarray(points), places, surface.theta, surface.s, surface.coefficients,
        wall.closed, *wall.ends, beyond, wall.theta, wall.s, wall.nodes, wall.half, v, w, *facing,
    )  # fmt: skip
    return facing


@njit(cache=True)
def _face(points, places, lines_t, lines_s, coefficients, closed, low, high, beyond, theta, s, table, half, v, w, gap,
          normal, e, nodes, N, H, G, S):  # fmt: skip
    """Loop of `_search`."""
    X, J, inverse = np.empty((6, 3)), np.empty((3, 3)), np.empty((3, 3))
    n, n_1, n_2, r, step = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    shape, shape_1, shape_2 = np.empty(4), np.empty(4), np.empty(4)
    at = np.empty(4, np.int32)
    # a place on the rim of the mesh is inside it, whatever rounding makes of it
    margin_t, margin_s = 1e-9, 1e-9 * (high - low)
    for k in range(points.shape[0]):
        t0, s0, g = places[k, 0], places[k, 1], 0.0
        if closed:
            t0 = theta[0] + (t0 - theta[0]) % (theta[-1] - theta[0])
        ok, length, size = False, 1.0, 1.0
        for iteration in range(50):
            evaluate(lines_t, lines_s, coefficients, t0, s0, X)
            _element(theta, s, table, t0, s0, at, shape, shape_1, shape_2)
            length = _director(X, half, w, at, shape, shape_1, shape_2, n, n_1, n_2)
            # a director that has vanished faces nowhere, and NaN does not get past either
            if not length > 0.0:
                break
            # a first gap that belongs to the place, so that the first step is not spent on it
            if iteration == 0:
                for c in range(3):
                    x_s = X[0, c]
                    for a in range(4):
                        x_s += shape[a] * v[at[a], c]
                    g += (points[k, c] - x_s) * n[c]
            for c in range(3):
                r[c] = X[0, c] + g * n[c] - points[k, c]
                J[c, 0], J[c, 1], J[c, 2] = X[1, c] + g * n_1[c], X[2, c] + g * n_2[c], n[c]
                for a in range(4):
                    r[c] += shape[a] * v[at[a], c]
                    J[c, 0] += shape_1[a] * v[at[a], c]
                    J[c, 1] += shape_2[a] * v[at[a], c]
            if inverted(J, inverse) == 0.0:
                break
            size = abs(r[0]) + abs(r[1]) + abs(r[2])
            # the derivatives below belong to this very place, so it is checked before the step, not after
            if size <= 1e-13:  # how well the place is found [m]
                ok = True
                break
            for c in range(3):
                step[c] = inverse[c, 0] * r[0] + inverse[c, 1] * r[1] + inverse[c, 2] * r[2]
            factor = min(1.0, LONGEST_TURN / max(abs(step[0]), 1e-300), LONGEST_SLIDE / max(abs(step[1]), 1e-300))
            if iteration > 20:
                factor *= 0.5  # places that hop between two elements settle on their common side
            t0 -= factor * step[0]
            s0 -= factor * step[1]
            g -= step[2] if factor == 1.0 else factor * step[2]
            if closed:
                t0 = theta[0] + (t0 - theta[0]) % (theta[-1] - theta[0])
            # beyond an end of the wall there is nothing to face
            if s0 < low - 0.5 * (high - low) or s0 > high + 0.5 * (high - low):
                break
        inside = low - beyond - margin_s <= s0 <= high + beyond + margin_s
        inside = inside and (closed or theta[0] - margin_t <= t0 <= theta[-1] + margin_t)
        # a point close to the wall that finds no place would be a hole in the contact; further off it is not
        if not inside or (not ok and size > 1e-9):
            gap[k] = np.nan if inside and abs(g) < 0.002 else FAR
            continue
        places[k, 0], places[k, 1] = t0, s0
        gap[k] = g
        for c in range(3):
            normal[k, c], e[k, c] = n[c], inverse[2, c]
            for d in range(3):
                H[k, c, d] = n_1[c] * inverse[0, d] + n_2[c] * inverse[1, d]
                G[k, c, d] = ((1.0 if c == d else 0.0) - n[c] * n[d]) / length
        for a in range(4):
            nodes[k, a], N[k, a] = at[a], shape[a]
            for d in range(3):
                S[k, a, d] = shape_1[a] * inverse[0, d] + shape_2[a] * inverse[1, d]


@njit(cache=True)
def _element(theta, s, table, t0, s0, at, N, N_1, N_2):
    """Nodes of the element at ``(t0, s0)``, bilinear shape functions and their derivatives."""
    i = min(max(np.searchsorted(theta, t0, side="right") - 1, 0), theta.size - 2)
    j = min(max(np.searchsorted(s, s0, side="right") - 1, 0), s.size - 2)
    dt, ds = theta[i + 1] - theta[i], s[j + 1] - s[j]
    a, b = (t0 - theta[i]) / dt, (s0 - s[j]) / ds
    at[0], at[1], at[2], at[3] = table[i, j], table[i + 1, j], table[i + 1, j + 1], table[i, j + 1]
    N[0], N[1], N[2], N[3] = (1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b
    N_1[0], N_1[1], N_1[2], N_1[3] = -(1 - b) / dt, (1 - b) / dt, b / dt, -b / dt
    N_2[0], N_2[1], N_2[2], N_2[3] = -(1 - a) / ds, -a / ds, a / ds, (1 - a) / ds


@njit(cache=True)
def _director(X, half, w, at, N, N_1, N_2, n, n_1, n_2):
    """Direction of the director and its derivatives; returns its length."""
    c = np.cross(X[1], X[2])
    c_1 = np.cross(X[3], X[2]) + np.cross(X[1], X[4])
    c_2 = np.cross(X[4], X[2]) + np.cross(X[1], X[5])
    size = np.sqrt(c[0] ** 2 + c[1] ** 2 + c[2] ** 2)
    along_1 = (c[0] * c_1[0] + c[1] * c_1[1] + c[2] * c_1[2]) / size**2
    along_2 = (c[0] * c_2[0] + c[1] * c_2[1] + c[2] * c_2[2]) / size**2
    h = h_1 = h_2 = 0.0
    for a in range(4):
        h += N[a] * half[at[a]]
        h_1 += N_1[a] * half[at[a]]
        h_2 += N_2[a] * half[at[a]]
    length = p_1 = p_2 = 0.0
    for i in range(3):
        n0 = c[i] / size
        n[i] = h * n0
        n_1[i] = h * (c_1[i] / size - n0 * along_1) + h_1 * n0
        n_2[i] = h * (c_2[i] / size - n0 * along_2) + h_2 * n0
        for a in range(4):
            n[i] += N[a] * w[at[a], i]
            n_1[i] += N_1[a] * w[at[a], i]
            n_2[i] += N_2[a] * w[at[a], i]
        length += n[i] * n[i]
    length = np.sqrt(length)
    for i in range(3):
        n[i] /= length
        p_1 += n[i] * n_1[i]
        p_2 += n[i] * n_2[i]
    for i in range(3):
        n_1[i] = (n_1[i] - n[i] * p_1) / length
        n_2[i] = (n_2[i] - n[i] * p_2) / length
    return length
