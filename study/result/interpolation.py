"""Values between solved cases, on a grid of two axes and of forces, with what the neighbours tell about the error.

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
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.friction.patch import NEGLIGIBLE, FloatArray
from softjaw.study.flags import Flag
from softjaw.study.quantities import BOTH_ENDS, MISSING, TABLE
from softjaw.study.result.layout import DONE

if TYPE_CHECKING:
    import xarray as xr  # slow to load, and a run needs it at its end only

CLAIM_FACTOR = 1.75  # between estimate and claim: with less, less than 95 % of the errors stay within it
OF_ANGLES, OF_FORCES = 3.0, 2.6  # times that along these: along angles payload and edges of contacts have kinks
MOST_TURN = math.radians(25)  # between angles farther apart even such claims hold for half of the points
BESIDE_CASES = 0.45  # of what interpolation claims alone, where the cases state errors: those err on the safe side, too
CLOSING_GAP_RATIO = 1.5  # a gap that closes a circle may be this much wider than the others
SEMI_AXES = "semi_axes"  # lengths with a component each, as vectors have them
KINDS = {"pieces": 7, "holes": 7, "rims": 1}  # what identifies a kind of contact, and the largest number that counts
UPPER = np.array(list(np.ndindex(2, 2, 2)))  # which corners of a cell are its upper ones, along each axis


class Nodes(NamedTuple):
    """Nodes of one axis: coordinates ``x (k,)``, rising, and where their values stand along the file's axis.

    A periodic axis brings coordinates into ``[x_0, x_0 + period)`` first; with ``half_turn`` every odd multiple of the
    period exchanges the fingers, for nodes as ``swapped (k,)``. Between nodes farther apart than ``most`` is nothing.
    """

    name: str
    units: str
    x: FloatArray
    take: NDArray[np.int64]
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
    if closes(x, period):
        x, order = np.append(x, x[0] + period), np.append(order, order[0])
        swapped = np.append(swapped, swapped[0] ^ half_turn)
    return Nodes(name, units, x, order, swapped, period, half_turn, MOST_TURN)


def closes(angles: FloatArray, period: float) -> bool:
    """Whether rising angles within a period go all round: the gap that closes the circle is not much wider than others.

    >>> closes(np.array([0.0, 1.0, 2.0]), 3.0), closes(np.array([0.0, 1.0]), 6.0)
    (True, False)
    """
    return bool(period - np.ptp(angles) <= CLOSING_GAP_RATIO * np.diff(angles).max() * (1 + NEGLIGIBLE))


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

    index: NDArray[np.int64]  # (m, 8)
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
            v = np.where(np.isfinite(v), v, np.nan)
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


def blend(table: FloatArray, at: Corners, name: str = "") -> FloatArray:
    """Values of ``table (nodes, ...)`` at ``m`` points, ``(m, ...)``; corners without weight do not count.

    Along the force by a power law between positive values of cases and fingers, and lengths of semi-axes.
    """
    values = table[at.index]
    weight = at.weight.reshape(at.weight.shape + (1,) * (table.ndim - 1))
    parts = np.where(weight > 0, values * weight, 0.0)
    line = np.asarray(parts.sum(axis=1))
    if table.ndim > 2 and not name.endswith(SEMI_AXES):  # coefficients of limit surfaces stay convex on straight lines
        return line
    share, power = (s.reshape(-1, *(1,) * (table.ndim - 1)) for s in (at.share[:, 2], at.power))
    low, high = parts[:, ::2].sum(axis=1), parts[:, 1::2].sum(axis=1)  # times 1 - share, and share
    ends = low / np.where(share < 1.0, 1.0 - share, 1.0), high / np.where(share > 0.0, share, 1.0)
    return power_law(*ends, power, line)


def bend(f: FloatArray, nodes: Nodes, side: NDArray[np.bool_]) -> FloatArray:
    """``|f'' / 2| h^2`` of every cell along the last axis of ``f``, at the cell's lower node.

    Differences reach neither over missing values nor from one ``side`` (as ``f``) of a jump to the other. Where no
    three nodes are left, the difference of the cell's two values stands in: a guess; across a jump it is 0.
    """
    x, bent = nodes.x, np.zeros(f.shape)
    if closed := bool(nodes.period) and np.isclose(x[-1] - x[0], nodes.period, rtol=1e-6, atol=0):
        x = np.concatenate([[x[-2] - nodes.period], x, [x[1] + nodes.period]])
        f, side = (np.concatenate([v[..., -2:-1], v, v[..., 1:2]], axis=-1) for v in (f, side))
    h, slope, jump = np.diff(x), np.diff(f) / np.diff(x), side[..., 1:] != side[..., :-1]
    half = np.where(jump[..., :-1] | jump[..., 1:], np.nan, np.abs(np.diff(slope) / (h[1:] + h[:-1])))
    if closed:
        h, f, jump = h[1:-1], f[..., 1:-1], jump[..., 1:-1]
    else:
        half = np.pad(half, [(0, 0)] * (f.ndim - 1) + [(1, 1)], constant_values=np.nan)
    cell = np.fmax(half[..., :-1], half[..., 1:]) * h**2
    bent[..., :-1] = np.where(jump, 0.0, np.where(np.isnan(cell), np.abs(np.diff(f)), cell))
    return np.nan_to_num(bent)


def around(values: FloatArray, axes: Sequence[int]) -> FloatArray:
    """The largest of each of these positive values and those beside it along the axes."""
    for a in axes:
        padded = np.pad(values, [(int(k == a),) * 2 for k in range(values.ndim)])
        values = np.lib.stride_tricks.sliding_window_view(padded, 3, axis=a).max(axis=-1)
    return values


def place_claims(table: FloatArray, axes: Sequence[Nodes], side: NDArray[np.bool_]) -> FloatArray:
    """`bend` of a table over station, angle and force along the first two, as claims: the largest around."""
    bent = [bend(table.swapaxes(a, -1), axes[a], side.swapaxes(a, -1)).swapaxes(a, -1) for a in range(2)]
    return CLAIM_FACTOR * np.array([around(bent[0], range(3)), OF_ANGLES * around(bent[1], range(3))])


def force_claims(table: FloatArray, forces: Nodes, side: NDArray[np.bool_]) -> tuple[FloatArray, NDArray[np.bool_]]:
    """`bend` along forces, the last axis, as claims: the largest beside; and of which maps they are relative.

    So they are, of a power law, where all values over station, angle and force are positive.
    """
    power = ~(table <= 0.0).any(axis=(-3, -2, -1), keepdims=True)  # NaN, of no case, is not
    lines = CLAIM_FACTOR * OF_FORCES * around(bend(table, forces, side), [table.ndim - 1])
    return np.where(power, law_claims(table, forces, side), lines), power


def law_claims(table: FloatArray, forces: Nodes, side: NDArray[np.bool_]) -> FloatArray:
    """The same of power laws alone, relative: `bend` of logarithms. Of two forces a guess is left.

    That is how far from constant or from proportional, whatever is nearer.
    """
    logs, along = np.log(np.where(table > 0.0, table, np.nan)), forces._replace(x=np.log(forces.x))
    laws = np.minimum(bend(logs, along, side), bend(logs - along.x, along, side))
    return CLAIM_FACTOR * OF_FORCES * around(laws, [laws.ndim - 1])


def error(claims: FloatArray, at: Corners, axes: Sequence[int]) -> FloatArray:
    """Error of straight lines along some of the axes at ``m`` points from claims ``(3, nodes)``, ``(m,)``."""
    total = np.zeros(len(at.index))
    for a in axes:
        lower, higher = np.flatnonzero(UPPER[:, a] == 0), np.flatnonzero(UPPER[:, a])
        weight = at.weight[:, lower] + at.weight[:, higher]
        lines = np.where(weight > 0, claims[a][at.index[:, lower]] * weight, 0.0).sum(axis=1)
        total += np.where(at.share[:, a] % 1.0 > 0, at.share[:, a] * (1 - at.share[:, a]) * lines, 0.0)
    return total


def contact_kinds(name: str, values: np.ndarray) -> NDArray[np.int64]:
    """Numbers of a finger's quantity of `KINDS` that differ where contacts differ in kind; NaN counts as 0."""
    numbers = np.nan_to_num(values).astype(np.int64)
    if name == "rims":  # a pad that bears on both of its ends
        return np.asarray((numbers & BOTH_ENDS) == BOTH_ENDS, np.int64)
    return np.minimum(numbers, KINDS[name])


def _apart(low: xr.Dataset, high: xr.Dataset) -> NDArray[np.bool_]:
    """Cases that no straight line may join."""
    apart = (low["flags"].values ^ high["flags"].values) & int(Flag.SNAPPED) > 0
    for name in KINDS if "finger_rims" in low else ():
        lower, upper = (contact_kinds(name, ds[f"finger_{name}"].values) for ds in (low, high))
        apart |= (lower != upper).any(axis=-1)
    return np.asarray(apart, bool)


def at_force(ds: xr.Dataset, force: float) -> xr.Dataset:
    """The dataset at one force [N] between two solved ones, by power laws; flags of both. `ValueError` beyond them.

    Both are in its attribute ``between``, the largest solved one in ``largest``. What has directions, or is not
    positive, lies on straight lines. The errors hold that of the interpolation. A case beside one that is not solved
    has that one's state. Across a snap-in of the wall, and between contacts that differ in kind, nothing is known: it
    is "not computed".
    """
    forces = ds["normal_force"].values
    if not forces[0] <= force <= forces[-1] or len(forces) < 2:
        solved = ", ".join(f"{f:g}" for f in forces)
        raise ValueError(f"{force:g} N was not solved, nor does it lie between two forces that were: {solved} N")
    k = min(int(np.searchsorted(forces, force, side="right")) - 1, len(forces) - 2)
    share, power = ((force - forces[k]) / np.diff(forces)[k], np.log(force / forces[k]) / np.diff(np.log(forces))[k])
    low, high = (ds.isel(normal_force=[i]).assign_coords(normal_force=[force]) for i in (k, k + 1))
    between = low.assign_attrs(between=forces[k : k + 2].tolist(), largest=float(forces[-1]))
    for name in (str(n) for n, v in ds.data_vars.items() if "normal_force" in v.dims):
        dims, first, last = ds[name].dims, low[name].values, high[name].values
        if ds[name].dtype.kind == "f":
            values = (1 - share) * first + share * last
            if name.endswith(SEMI_AXES) or not {"component", "monomial", "wrench"} & set(dims):
                values = power_law(first, last, power, values)
            between[name] = (dims, values, ds[name].attrs)
        elif name == "flags":
            between[name] = (dims, first | last, ds[name].attrs)
    axis, side = plain("force", "N", forces), ds["flags"].values & int(Flag.SNAPPED) > 0
    for q in (q for q in TABLE if q.error and q.of_error.name in between):
        value, table = (v.isel(model=0) if "model" in v.dims else v for v in (between[q.name], ds[q.name]))
        claims, relative = force_claims(table.values, axis, side)
        at, size = np.where(relative, power, share), abs(value.values)
        line = claims[..., [k]] * at * (1 - at) * np.where(relative, size, 1.0)
        if q.error == "relative":  # a payload of nothing at both forces lies nowhere else
            line = np.divide(line, size, out=np.zeros(line.shape), where=size > 0.0)
        known = between[q.of_error.name]
        between[q.of_error.name] = known.copy(data=np.hypot(BESIDE_CASES * line, known.values))
    states = np.where(low["status"].values == DONE, high["status"].values, low["status"].values)
    states = np.where((states == DONE) & _apart(low, high), MISSING, states)
    between["status"] = (ds["status"].dims, states, ds["status"].attrs)
    between["normal_force"].attrs.update(ds["normal_force"].attrs)
    return between


def power_law(low: FloatArray, high: FloatArray, share: float | FloatArray, line: FloatArray) -> FloatArray:
    """Values at a share of the logarithm of the force between two positive ones; elsewhere those of a straight line."""
    both = np.minimum(low, high) > 0.0
    first, last = (np.log(v, out=np.zeros(both.shape), where=both) for v in (low, high))
    return np.where(both, np.exp((1.0 - share) * first + share * last), line)
