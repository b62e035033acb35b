"""From measurements to errors: the limit that every knob's ladder leads to, and how far each level is from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softjaw.study.accuracy.cost.extrapolate import Limit, limit
from softjaw.study.accuracy.cost.file import CostStudy
from softjaw.study.accuracy.cost.knobs import Knob, Level
from softjaw.study.accuracy.cost.measure import QUANTITIES, Measured

FloatArray = NDArray[np.float64]
COARSE, NODAL = 4096, 512  # flags, as study.quantities says
ALIKE = 1e-9  # relative difference of values that is none: the same state by another order of sums


@dataclass(frozen=True)
class LevelErrors:
    """Time and errors of one level.

    Attributes
    ----------
    seconds, own : float
        CPU time of one case, the mean over the probes, and the part that is the knob's own [s].
    worst, middle : (4,) arrays
        Largest and median relative error over all cases, for `QUANTITIES`; NaN where a case has no value.
    by_case : (4, cases) array
    message : str
        What failed.
    flags : (cases,) array
    """

    name: str
    seconds: float
    own: float
    worst: FloatArray
    middle: FloatArray
    by_case: FloatArray
    message: str
    flags: NDArray[np.int64]


@dataclass(frozen=True)
class KnobErrors:
    """Errors of the measured levels of one knob, the cheapest setting first; ``own`` is the scene's own level or -1."""

    name: str
    long_name: str
    levels: tuple[LevelErrors, ...]
    settings: tuple[Level, ...]
    own: int
    limits: tuple[Limit, ...]
    family: str = ""

    @property
    def judging(self) -> bool:
        """Whether the knob leaves the contact as it is."""
        return not self.settings

    @property
    def ladder(self) -> bool:
        """Whether finer levels lead on to a limit, or the last of discrete levels is exact by definition."""
        return bool(self.settings) and not any(np.isnan(s.size) for s in self.settings)

    @property
    def doubts(self) -> FloatArray:
        """To what the limit of e_n is known, relative to it ``(cases,)``; infinite where that is not known."""
        return np.nan_to_num(self.limits[0].doubt / np.abs(self.limits[0].value), nan=np.inf)

    @property
    def doubt(self) -> float:
        """The largest of ``doubts``."""
        return float(self.doubts.max())


def knob_errors(knob: Knob, found: Sequence[Sequence[Measured]], levels: Sequence[Level]) -> KnobErrors:
    """Errors of the levels of a contact knob that were measured, ``found[level][probe]``, the finest last."""
    return _errors(knob.name, knob.long_name, found, [v.name for v in levels], [v.size for v in levels], knob.formal,
                   tuple(levels), knob.family)  # fmt: skip


def judging_errors(name: str, found: Sequence[Sequence[Measured]], levels: Sequence[str]) -> KnobErrors:
    """Errors of the levels of a knob that leaves the contact as it is."""
    return _errors(name, "", found, levels, [np.nan] * len(levels), np.nan, (), "")


def _errors(name, long_name, found, names, sizes, formal, settings, family) -> KnobErrors:
    values = np.array([np.concatenate([m.values for m in own]) for own in found])  # level, case, quantity
    limits = tuple(limit(sizes, values[:, :, q], formal) for q in range(len(QUANTITIES)))
    levels = tuple(_level(text, own) for text, own in zip(names, found, strict=True))
    return _with_limits(KnobErrors(name, long_name, levels, settings, -1, limits, family), values, limits)


def _level(name: str, own: Sequence[Measured]) -> LevelErrors:
    nothing = np.full(len(QUANTITIES), np.nan)
    seconds, part = (float(np.mean([getattr(m, a) for m in own])) for a in ("seconds", "own"))
    told = "; ".join(dict.fromkeys(m.message for m in own if m.message))
    return LevelErrors(name, seconds, part, nothing, nothing, nothing[:, None], told, flags_of(own))


def _with_limits(table: KnobErrors, values: FloatArray, limits: Sequence[Limit]) -> KnobErrors:
    """Errors against given limits; the finest level is at least as uncertain as its own limit says."""
    last = len(table.levels) - 1
    made = []
    for i, level in enumerate(table.levels):
        errors = np.array([
            np.abs(values[i, :, q] - found.value) / np.abs(found.value) for q, found in enumerate(limits)
        ])  # fmt: skip
        if i == last and table.ladder:
            errors = np.fmax(errors, np.array([f.uncertainty / np.abs(f.value) for f in table.limits]))
        made.append(replace(level, worst=errors.max(axis=1), middle=np.median(errors, axis=1), by_case=errors))
    return replace(table, levels=tuple(made))


def best_known(tables: Sequence[KnobErrors], family: str) -> KnobErrors:
    """The knob of a family, or of this name, whose limit is known best."""
    own = [t for t in tables if (t.family or t.name) == family]
    return min([t for t in own if t.ladder] or own, key=lambda t: t.doubt)


def share_limits(tables: list[KnobErrors], values: dict[str, FloatArray]) -> list[KnobErrors]:
    """Give knobs of one family the limit of the one that is known best; ``values[name]`` are ``(level, case, 4)``."""
    made = list(tables)
    for family in {t.family for t in tables if t.family}:
        best = best_known(tables, family)
        for i, table in enumerate(made):
            if table.family == family and table is not best:
                made[i] = replace(_with_limits(table, values[table.name], best.limits), limits=table.limits)
    return made


def flags_of(found: Sequence[Measured]) -> NDArray[np.int64]:
    """Flags of all cases of some probes."""
    return np.nan_to_num(np.concatenate([m.flags for m in found])).astype(np.int64)


def places(found: Sequence[Measured]) -> list[str]:
    """All cases of some probes in words."""
    return [f"{m.candidate}, {force:g} N" for m in found for force in m.forces]


def flagged(flags: NDArray[np.int64], reference: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which cases carry a flag that those of the reference do not."""
    return (flags & ~reference) != 0


def unsure(reference: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which cases of a reference say themselves that their mesh is not to be trusted."""
    return (reference & (COARSE | NODAL)) != 0


def _own(settings: list[str], values: FloatArray, study: CostStudy) -> int:
    """The level that is the scene's own setting, or the cheapest that gives the same; -1 for none."""
    if study.base in settings:
        return settings.index(study.base)
    base = np.concatenate([m.values for m in study.of(study.base)])
    alike = (i for i, v in enumerate(values) if np.allclose(v, base, rtol=ALIKE, atol=0.0))
    return next(alike, -1)


def tables(study: CostStudy, knobs: Sequence[Knob], settings: dict[tuple[str, str], str],
           judging: dict[str, list[str]]) -> list[KnobErrors]:  # fmt: skip
    """Errors of every knob with at least two measured levels; ``settings`` by knob and level."""
    made, values = [], {}
    for knob in knobs:
        levels = [v for v in knob.levels if study.has(settings[knob.name, v.name])]
        found = [study.of(settings[knob.name, v.name]) for v in levels]
        pairs = [(v, f) for v, f in zip(levels, found, strict=True) if np.isfinite([m.values for m in f]).any()]
        if len(pairs) < 2:
            continue
        levels, found = [v for v, _ in pairs], [f for _, f in pairs]
        table = knob_errors(knob, found, levels)
        values[knob.name] = np.array([np.concatenate([m.values for m in f]) for f in found])
        made.append(replace(table, own=_own([settings[knob.name, v.name] for v in levels], values[knob.name], study)))
    made = share_limits(made, values)
    for name, levels in judging.items():
        known = [v for v in levels if study.has(f"{name}: {v}")]
        if len(known) > 1:
            made.append(judging_errors(name, [study.of(f"{name}: {v}") for v in known], known))
    return made
