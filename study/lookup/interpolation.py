"""Values between the nodes of a grid of two axes and of forces, with what the neighbours tell about the error.

Along forces they follow power laws, as contacts nearly do, which are straight lines between logarithms. Along the other
axes they lie on straight lines, which never overshoot. Between two nodes a distance ``h`` apart the line misses a
smooth function by ``f'' / 2 (x - x_0) (x_1 - x)``; the second derivative is taken from the three-point differences at
both nodes, whichever is larger, and the errors along the axes add up. Maps of contacts have kinks, which three nodes
see or miss by chance: an estimate is the largest of a cell and those around it, times
`CLAIM_FACTOR`, which was measured on cases that a map does not hold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from softjaw.fem.objects.gap import IntArray
from softjaw.friction.patch import NEGLIGIBLE, FloatArray
from softjaw.study.result.read import power_law

CLAIM_FACTOR = 1.75  # between estimate and claim: with less, less than 95 % of the errors stay within it
OF_ANGLES, OF_FORCES = 3.0, 2.0  # times that along these: along angles payload and edges of contacts have kinks
MOST_TURN = math.radians(25)  # between angles farther apart even such claims hold for half of the points
CLOSING_GAP_RATIO = 1.5  # a gap that closes a circle may be this much wider than the others
UPPER = np.array(list(np.ndindex(2, 2, 2)))  # which corners of a cell are its upper ones, along each axis


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of one axis: coordinates ``x (k,)``, rising, and where their values stand along the file's axis.

    A periodic axis brings coordinates into ``[x_0, x_0 + period)`` first; with ``half_turn`` every odd multiple of the
    period exchanges the fingers, for nodes as ``swapped (k,)``. Between nodes farther apart than ``most`` is nothing.
    """

    name: str
    units: str
    x: FloatArray
    take: IntArray
    swapped: NDArray[np.bool_]
    period: float = 0.0
    half_turn: bool = False
    most: float = math.inf
    free: bool = False

    @property
    def slack(self) -> float:
        """How far beside the ends a coordinate still counts as on them."""
        return NEGLIGIBLE * max(abs(float(self.x[0])), abs(float(self.x[-1])))


def plain(name: str, units: str, values: ArrayLike, most: float = math.inf) -> Nodes:
    """Axis without a period; one single value is a place where the grid can be asked, not beside it."""
    x = np.asarray(values, float)
    order = np.argsort(x)
    x = x[order]
    if len(x) == 1:
        x, order = _point(float(x[0])), order.repeat(2)
    return Nodes(name, units, x, order, np.zeros(len(x), bool), most=most)


def circle(name: str, units: str, values: ArrayLike, period: float, half_turn: bool = False) -> Nodes:
    """Axis of angles with a period; period 0 is an object that looks the same at every angle.

    The gap that closes the circle is bridged if it is not much wider than the others.
    """
    angles = np.asarray(values, float)
    if not period:
        x = np.array([angles[0], angles[0] + 2 * math.pi])
        return Nodes(name, units, x, np.zeros(2, np.int64), np.zeros(2, bool), 2 * math.pi, free=True)
    turns = np.floor((angles - angles[0]) / period + NEGLIGIBLE)
    folded = np.maximum(angles - turns * period, angles[0])
    order = np.argsort(folded, kind="stable")
    order = order[np.concatenate([[True], np.diff(folded[order]) > NEGLIGIBLE * period])]
    x, swapped = folded[order], half_turn & (turns[order] % 2 == 1)
    if len(x) == 1:
        return Nodes(name, units, _point(float(x[0])), order.repeat(2), swapped.repeat(2), period, half_turn)
    if x[0] + period - x[-1] <= CLOSING_GAP_RATIO * np.diff(x).max() * (1 + NEGLIGIBLE):
        x, order = np.append(x, x[0] + period), np.append(order, order[0])
        swapped = np.append(swapped, swapped[0] ^ half_turn)
    return Nodes(name, units, x, order, swapped, period, half_turn, MOST_TURN)


def _point(x: float) -> FloatArray:
    slack = NEGLIGIBLE * max(abs(x), 1.0)
    return np.array([x - slack, x + slack])


@dataclass(frozen=True, eq=False)
class Corners:
    """Where ``m`` points lie: flat indices of the eight nodes around each, their weights, and the share of the cell.

    The first corner is the cell's lower one; bit ``2 - a`` of a corner's number tells whether it is the upper one along
    axis ``a``. ``power`` is the share of the cell along the logarithm of the force, the last axis. ``swap`` tells which
    points see the fingers exchanged.
    """

    index: IntArray  # (m, 8)
    weight: FloatArray  # (m, 8)
    share: FloatArray  # (m, 3)
    power: FloatArray  # (m,)
    inside: NDArray[np.bool_]  # (m, 3)
    swap: NDArray[np.bool_]  # (m,)


def corners(axes: Sequence[Nodes], points: FloatArray) -> Corners:
    """Corners of the cells around ``points (m, 3)``; points outside are moved to the edge and marked."""
    cell, share = np.empty(points.shape, np.int64), np.empty(points.shape)
    inside, swap = np.empty(points.shape, bool), np.zeros(len(points), bool)
    for a, nodes in enumerate(axes):
        x, slack, v = nodes.x, nodes.slack, points[:, a]
        if nodes.period:
            turns = np.floor((v - x[0] + slack) / nodes.period)
            v = v - turns * nodes.period
            swap |= nodes.half_turn & (turns % 2 == 1)
        inside[:, a] = (v >= x[0] - slack) & (v <= x[-1] + slack)  # NaN is outside
        v = np.clip(np.nan_to_num(v), x[0], x[-1])
        i = np.clip(np.searchsorted(x, v, "right") - 1, 0, len(x) - 2)
        s = (v - x[i]) / (x[i + 1] - x[i])
        s = np.where(s < NEGLIGIBLE, 0.0, np.where(s > 1 - NEGLIGIBLE, 1.0, s))
        inside[:, a] &= (s == 0) | (s == 1) | (x[i + 1] - x[i] <= nodes.most * (1 + NEGLIGIBLE))
        cell[:, a], share[:, a] = i, s
    ends = np.stack([x[i] * (1 - s) + x[i + 1] * s, x[i + 1]]) / x[i]  # of the last axis: the force, and the next node
    power = np.divide(*np.log(ends))
    at = cell[:, None] + UPPER
    index = (at[..., 0] * len(axes[1].x) + at[..., 1]) * len(axes[2].x) + at[..., 2]
    return Corners(index, np.where(UPPER, share[:, None], 1 - share[:, None]).prod(-1), share, power, inside, swap)


def blend(table: FloatArray, at: Corners) -> FloatArray:
    """Values of ``table (nodes, ...)`` at ``m`` points, ``(m, ...)``; corners without weight do not count.

    Along the force by a power law between positive values of cases and fingers.
    """
    values = table[at.index]
    weight = at.weight.reshape(at.weight.shape + (1,) * (table.ndim - 1))
    parts = np.where(weight > 0, values * weight, 0.0)
    line = np.asarray(parts.sum(axis=1))
    if table.ndim > 2:  # coefficients of limit surfaces stay convex on straight lines
        return line
    share, power = (s.reshape(-1, *(1,) * (table.ndim - 1)) for s in (at.share[:, 2], at.power))
    low, high = parts[:, ::2].sum(axis=1), parts[:, 1::2].sum(axis=1)  # times 1 - share, and share
    ends = low / np.where(share < 1.0, 1.0 - share, 1.0), high / np.where(share > 0.0, share, 1.0)
    return power_law(*ends, power, line)


def bends(table: FloatArray, axes: Sequence[Nodes], side: NDArray[np.bool_]) -> FloatArray:
    """``|f'' / 2| h^2`` of every cell along each axis, at the cell's lower node, ``(3, k_1, k_2, k_3)``.

    Differences reach neither over missing values nor from one ``side (k_1, k_2, k_3)`` of a jump to the other. Where no
    three nodes are left, the difference of the cell's two values stands in: a guess; across a jump it is 0.
    """
    bent = np.zeros((3, *table.shape))
    for a, nodes in enumerate(axes):
        f, branch, x = np.moveaxis(table, a, -1), np.moveaxis(side, a, -1), nodes.x
        if closed := bool(nodes.period) and np.isclose(x[-1] - x[0], nodes.period, rtol=1e-6, atol=0):
            x = np.concatenate([[x[-2] - nodes.period], x, [x[1] + nodes.period]])
            f, branch = (np.concatenate([v[..., -2:-1], v, v[..., 1:2]], axis=-1) for v in (f, branch))
        h, slope = np.diff(x), np.diff(f) / np.diff(x)
        half = np.abs(np.diff(slope) / (h[1:] + h[:-1]))
        half[(branch[..., :-2] != branch[..., 1:-1]) | (branch[..., 1:-1] != branch[..., 2:])] = np.nan
        if closed:
            h, f, branch = h[1:-1], f[..., 1:-1], branch[..., 1:-1]
        else:
            half = np.pad(half, ((0, 0), (0, 0), (1, 1)), constant_values=np.nan)
        cell = np.fmax(half[..., :-1], half[..., 1:]) * h**2
        cell = np.where(np.isnan(cell), np.abs(np.diff(f)), cell)
        cell[branch[..., :-1] != branch[..., 1:]] = 0.0
        np.moveaxis(bent[a], a, -1)[..., :-1] = cell
    return bent.reshape(3, -1)


def claims(bend: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """`bends` ``(3, nodes)`` of this shape of nodes as claims: the largest around."""
    claimed = maximum_filter(np.nan_to_num(bend.reshape(3, *shape)), (1, 3, 3, 3), mode="constant")
    return CLAIM_FACTOR * np.array([[1.0], [OF_ANGLES], [OF_FORCES]]) * claimed.reshape(3, -1)


def error(bend: FloatArray, at: Corners, axes: Sequence[int]) -> FloatArray:
    """Error of straight lines along some of the axes at ``m`` points from `bends` ``(3, nodes)``, ``(m,)``."""
    total = np.zeros(len(at.index))
    for a in axes:
        lower, higher = np.flatnonzero(UPPER[:, a] == 0), np.flatnonzero(UPPER[:, a])
        weight = at.weight[:, lower] + at.weight[:, higher]
        lines = np.where(weight > 0, bend[a][at.index[:, lower]] * weight, 0.0).sum(axis=1)
        total += np.where(at.share[:, a] % 1.0 > 0, at.share[:, a] * (1 - at.share[:, a]) * lines, 0.0)
    return total
