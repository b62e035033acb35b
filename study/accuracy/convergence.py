"""From measurements to errors: the limit that a refinement series leads to, and how far each level is from it.

Richardson extrapolation of several cases at once, with the order that the finest three levels show.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from softjaw.study.accuracy.cost_study import QUANTITIES, Costs, CostStudy, Measured
from softjaw.study.accuracy.parameters import Level, Parameter
from softjaw.study.flags import Flag

FloatArray = NDArray[np.float64]
SAME_WAY = 0.75  # share of the change in which both steps must go the same way
LOWEST, HIGHEST = 0.5, 6.0  # orders that are believed
NOISE = 1e-9  # relative changes below this say nothing
SAFETY = 0.25  # of the correction by an observed order, which may be off by so much: Roache's factor of 1.25
ASSUMED = 1.5  # order with which the last step is taken to shrink where none is seen: that of a contact's edge
FOR_A_LINE = 3  # levels that a line through errors needs, so that its spread is known
SAME = 1e-9  # relative difference of values that is none: the same state by another order of sums


@dataclass(frozen=True)
class Extrapolation:
    """Reference solution of a refinement series.

    Attributes
    ----------
    value : (cases,) array
        The limit: extrapolated where the order was seen, else the finest level.
    distance : (cases,) array
        Of the finest level from its limit, or from the level before it where no order was seen (absolute).
    error_estimate : (cases,) array
        How far ``value`` itself may be off (absolute); NaN where a single level says nothing, 0 where the last of
        discrete levels is exact by definition.
    order : float
        Observed order; NaN where none was seen.
    note : str
        Why no order was seen; empty where one was.
    """

    value: FloatArray
    distance: FloatArray
    error_estimate: FloatArray
    order: float
    note: str


def extrapolate(size: ArrayLike, values: ArrayLike, formal: float = np.nan) -> Extrapolation:
    """Limit of values at falling sizes, Roache's generalised Richardson extrapolation.

    Parameters
    ----------
    size : (levels,) array
        What the error is a power of, falling; NaN where no order is expected.
    values : (levels, cases) array
        NaN where a case has no value at a level.
    formal : float
        Highest order that is used: a larger observed one is not extrapolated.

    Examples
    --------
    >>> found = extrapolate([4, 2, 1], [[1.16], [1.04], [1.01]], formal=2.0)
    >>> round(found.order, 6), found.value.round(6).tolist()
    (2.0, [1.0])
    """
    h, f = np.asarray(size, float), np.asarray(values, float)
    finest = f[-1].copy()
    step = np.abs(f[-1] - f[-2]) if len(f) > 1 else np.full(finest.shape, np.nan)
    # Discrete levels: the last one is exact by definition, so it has no error of its own.
    if not np.isfinite(h).all():
        return Extrapolation(finest, step, np.zeros(finest.shape), np.nan, "no order is expected")
    order, note = observed_order(h[-3:], f[-3:]) if len(h) > 2 else (np.nan, "fewer than three levels")
    # An order above the formal one is luck, and would promise too small an error.
    used = ASSUMED if note else order if np.isnan(formal) else min(order, formal)
    correction, before = (_correction(h[k - 2 : k or None], f[k - 2 : k or None], used) for k in (0, -1))
    if note:
        # The last step may be small by chance; the one before, shrunk once more, guards against that.
        shrunk = np.abs(before) * (h[-1] / h[-2]) ** used if len(h) > 1 else before
        return Extrapolation(finest, step, np.fmax(np.abs(correction), shrunk), np.nan, note)
    known = np.isfinite(correction)
    value = np.where(known, finest + np.where(known, correction, 0.0), finest)
    # Also by how much the limit moved with the last level: a series that still wanders is not known well.
    estimate = np.fmax(SAFETY * np.abs(correction), np.abs(value - (f[-2] + before)))
    return Extrapolation(value, np.where(known, np.abs(value - finest), step), estimate, order, "")


def _correction(h: FloatArray, f: FloatArray, order: float) -> FloatArray:
    """From the finer of two levels to their limit; NaN where there are fewer."""
    if len(h) < 2:
        return np.full(f.shape[-1:], np.nan)
    return (f[-1] - f[-2]) / ((h[-2] / h[-1]) ** order - 1.0)


def observed_order(h: FloatArray, f: FloatArray) -> tuple[float, str]:
    """Order ``p`` of ``f = f* + c h^p`` over all cases, and why it is not believed (empty if it is).

    Parameters
    ----------
    h : (3,) array
        Falling sizes, in any ratio.
    f : (3, cases) array
    """
    # A value of 0 has no relative change.
    f = f[:, np.isfinite(f).all(axis=0) & (np.abs(f[-1]) > 0)]
    if not f.size:
        return np.nan, "no case was solved on the three finest levels"
    coarse, fine = (f[0] - f[1]) / f[-1], (f[1] - f[2]) / f[-1]
    # The order of rounding errors would be noise.
    if np.abs(coarse).max() < NOISE or np.abs(fine).max() < NOISE:
        return np.nan, "the finest levels do not differ"
    change = np.abs(coarse) + np.abs(fine)
    alike = change[coarse * fine > 0].sum() / change.sum()
    if alike < SAME_WAY:
        return np.nan, f"the last two steps go the same way for only {alike:.0%} of the change"
    # One order for all cases, because that of a single one is noisy.
    ratio = float(np.linalg.norm(coarse) / np.linalg.norm(fine))

    def excess(p: float) -> float:
        return (h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p) - ratio

    if excess(LOWEST) > 0:
        return np.nan, f"the last two steps shrink too little for an order of {LOWEST:g}"
    if excess(HIGHEST) < 0:
        return np.nan, f"the last step is {ratio:.3g} times smaller than the one before, more than any order gives"
    return float(brentq(excess, LOWEST, HIGHEST, xtol=1e-10)), ""


def order_of_errors(size: ArrayLike, errors: ArrayLike) -> tuple[float, float]:
    """Order of a straight line through the logarithms of errors over sizes, and its standard error.

    The error of a contact goes to and fro while its edge passes element edges, so that three levels show no order; the
    root mean square over all cases and all levels does.

    Parameters
    ----------
    size : (levels,) array
    errors : (levels, cases) array
        Relative errors; cases that lack one at some level are left out.

    Returns
    -------
    order, spread : float
        NaN for fewer than `FOR_A_LINE` levels.

    Examples
    --------
    >>> order_of_errors([4, 2, 1], [[0.16], [0.04], [0.01]])
    (2.0, 0.0)
    """
    h, e = np.asarray(size, float), np.asarray(errors, float)
    mean = np.sqrt((e[:, np.isfinite(e).all(axis=0)] ** 2).mean(axis=1)) if e.size else np.zeros(0)
    used = np.isfinite(h) & (mean > NOISE)
    if used.sum() < FOR_A_LINE:
        return math.nan, math.nan
    x, y = np.log(h[used]), np.log(mean[used])
    x, y = x - x.mean(), y - y.mean()
    slope = float(x @ y / (x @ x))
    spread = math.sqrt(float(((y - slope * x) ** 2).sum()) / (len(x) - 2) / float(x @ x))
    return round(slope, 9), round(spread, 9)


def pareto_front(cost: ArrayLike, error: ArrayLike) -> list[int]:
    """Numbers of the settings that no other beats, the cheapest first; those without a value are left out.

    Examples
    --------
    >>> pareto_front([1.0, 2.0, 3.0, 4.0], [0.1, 0.2, 0.05, float("nan")])
    [0, 2]
    """
    t, e = np.asarray(cost, float), np.asarray(error, float)
    kept: list[int] = []
    # By cost and then error: of equally dear ones only the best can be kept.
    for i in np.lexsort((e, t)).tolist():
        if np.isfinite([t[i], e[i]]).all() and (not kept or e[i] < e[kept[-1]]):
            kept.append(i)
    return kept


@dataclass(frozen=True)
class LevelErrors:
    """Time and errors of one level.

    Attributes
    ----------
    seconds, own : float
        CPU time of one case, the mean over the probes, and the part that the parameter itself takes [s].
    by_case : (4, cases) array
        Relative errors for `QUANTITIES`; NaN where a case has no value.
    message : str
        What failed.
    flags : (cases,) array
    """

    level: Level
    seconds: float
    own: float
    by_case: FloatArray
    message: str
    flags: NDArray[np.int64]

    @property
    def worst(self) -> FloatArray:
        """Largest error over all cases ``(4,)``."""
        return self.by_case.max(axis=1)

    @property
    def median(self) -> FloatArray:
        """Median error over all cases ``(4,)``."""
        return np.median(self.by_case, axis=1)


@dataclass(frozen=True)
class ParameterErrors:
    """Errors of the measured levels of one parameter, the cheapest first.

    ``parameter`` has the measured levels only, and as ``own`` the one that is the scene as it is; ``found[level]
    [probe]`` is what was measured, ``reference`` the limits that errors are measured against where another parameter of
    the family knows them better.
    """

    parameter: Parameter
    found: Sequence[Sequence[Measured]]
    reference: tuple[Extrapolation, ...] | None = None

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return self.parameter.name

    @property
    def family(self) -> str:
        """Parameters of one family lead to the same limit."""
        return self.parameter.family or self.parameter.name

    @property
    def own(self) -> int:
        """The scene's own level, or -1."""
        return self.parameter.own

    @property
    def series(self) -> bool:
        """Whether finer levels lead on to a limit, or the last of discrete levels is exact by definition."""
        return not any(math.isnan(level.size) for level in self.parameter.levels)

    @cached_property
    def values(self) -> FloatArray:
        """Measured values ``(level, case, 4)``."""
        return np.array([np.concatenate([m.values for m in own]) for own in self.found])

    @cached_property
    def limits(self) -> tuple[Extrapolation, ...]:
        """The parameter's own limit of each of `QUANTITIES`."""
        sizes = [level.size for level in self.parameter.levels]
        return tuple(extrapolate(sizes, self.values[:, :, q], self.parameter.formal) for q in range(len(QUANTITIES)))

    @cached_property
    def levels(self) -> tuple[LevelErrors, ...]:
        """Errors of every level; the finest is at least as uncertain as its own limit says."""
        ends = self.reference or self.limits
        made = []
        for i, (level, own) in enumerate(zip(self.parameter.levels, self.found, strict=True)):
            errors = np.array([np.abs(self.values[i, :, q] - e.value) / np.abs(e.value) for q, e in enumerate(ends)])
            # an extrapolated limit may lie on the finest level by chance
            if i == len(self.found) - 1 and self.series:
                errors = np.fmax(errors, np.array([e.distance / np.abs(e.value) for e in self.limits]))
            seconds, part = (float(np.mean([getattr(m, a) for m in own])) for a in ("seconds", "own"))
            message = "; ".join(dict.fromkeys(m.message for m in own if m.message))
            made.append(LevelErrors(level, seconds, part, errors, message, flags_of(own)))
        return tuple(made)

    @cached_property
    def orders(self) -> tuple[tuple[float, float], ...]:
        """Order of the errors over all levels and its spread, for each of `QUANTITIES`; see `order_of_errors`."""
        if not self.series:
            return ((math.nan, math.nan),) * len(QUANTITIES)
        sizes, found = [level.size for level in self.parameter.levels], []
        for q, limit in enumerate(self.limits):
            # the finest level is its own reference where nothing leads further
            last = -1 if self.reference is None and limit.note else len(sizes)
            errors = [level.by_case[q] for level in self.levels]
            found.append(order_of_errors(sizes[:last], errors[:last]))
        return tuple(found)

    @property
    def estimates(self) -> FloatArray:
        """To what the limit of e_n is known, relative to it ``(cases,)``; infinite where that is not known."""
        return np.nan_to_num(self.limits[0].error_estimate / np.abs(self.limits[0].value), nan=np.inf)


def best_known(tables: Sequence[ParameterErrors], family: str) -> ParameterErrors:
    """The parameter of a family whose limit is known best."""
    own = [t for t in tables if t.family == family]
    # The worst case decides, because the target is one of the largest error.
    return min([t for t in own if t.series] or own, key=lambda t: float(t.estimates.max()))


def error_tables(costs: Costs, study: CostStudy) -> list[ParameterErrors]:
    """Errors of every parameter with at least two measured levels."""
    made = []
    for parameter in costs.parameters:
        known = [(level, costs.setting(parameter, level)) for level in parameter.levels]
        known = [(level, setting) for level, setting in known if study.has(setting)]
        # A level that fails everywhere says nothing of its error.
        pairs = [(v, setting) for v, setting in known if parameter.evaluation or _any_value(study.of(setting))]
        if len(pairs) > 1:
            levels, settings = zip(*pairs, strict=True)
            table = ParameterErrors(replace(parameter, levels=levels), [study.of(setting) for setting in settings])
            own = -1 if parameter.evaluation else _own(settings, table.values, study)
            made.append(replace(table, parameter=replace(table.parameter, own=own)))
    for i, table in enumerate(made):
        # meshes of both kinds of elements, and rules of collocation, lead to one limit
        best = best_known(made, table.family)
        if best is not table:
            made[i] = replace(table, reference=best.limits)
    return made


def _any_value(found: Sequence[Measured]) -> bool:
    return bool(np.isfinite(np.concatenate([m.values for m in found])).any())


def _own(settings: Sequence[str], values: FloatArray, study: CostStudy) -> int:
    """The level that is the scene's own setting, or the cheapest that gives the same; -1 for none."""
    if study.base in settings:
        return settings.index(study.base)
    base = np.concatenate([m.values for m in study.of(study.base)])
    return next((i for i, v in enumerate(values) if np.allclose(v, base, rtol=SAME, atol=0.0)), -1)


def flags_of(found: Sequence[Measured]) -> NDArray[np.int64]:
    """Flags of all cases of some probes."""
    return np.nan_to_num(np.concatenate([m.flags for m in found])).astype(np.int64)


def places(found: Sequence[Measured]) -> list[str]:
    """All cases of some probes in words."""
    return [f"{m.candidate}, {force:g} N" for m in found for force in m.forces]


def flagged(flags: NDArray[np.int64], reference: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which cases carry a flag that those of the reference do not; how they press says nothing of a mesh."""
    return (flags & ~reference & ~Flag.OBLIQUE) != 0


def unsure(reference: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which cases of a reference say themselves that their mesh is not to be trusted."""
    return (reference & (Flag.COARSE | Flag.NODAL)) != 0
