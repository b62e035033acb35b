"""Two result files side by side: which settings and cases differ, and which differences exceed the stated errors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.exits import USAGE, StudyError
from softjaw.study.result.layout import DONE
from softjaw.study.scene.text import changes
from softjaw.study.show.tables.ranking import TIE

FloatArray = NDArray[np.float64]
ALIKE = 1e-9  # relative difference of coordinates that is only rounding
MAIN = ("quality", "quality_fitted", "e_n", "f_x_max", "f_y_max", "tau_z_max", "safety_factor", "dent", "wall_stress")


@dataclass(frozen=True)
class AxisMatch:
    """Values of one axis that both files have, at which positions, and those that only one of them has."""

    name: str
    units: str
    common: FloatArray
    at: tuple[NDArray[np.int64], NDArray[np.int64]]
    only: tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class Difference:
    """One quantity of both files over the common axes; NaN where a file has no result.

    ``error`` is the sum of both errors: half-widths of bands, or else errors of the mesh; NaN where a file does not
    state them. ``stated`` tells of each file whether it has a map of them.
    """

    name: str
    units: str
    values: tuple[FloatArray, FloatArray]
    error: FloatArray
    stated: tuple[bool, bool]

    @property
    def change(self) -> FloatArray:
        """Second file minus first."""
        return self.values[1] - self.values[0]

    @property
    def relative(self) -> FloatArray:
        """Change over the first file's value; NaN where that is 0."""
        base = np.abs(self.values[0])
        return np.divide(self.change, base, out=np.full(base.shape, np.nan), where=base > 0)

    @property
    def beyond(self) -> NDArray[np.object_]:
        """Whether a difference exceeds the errors of both, and `TIE` of the value; None where an error is unknown."""
        known = np.isfinite(self.change) & np.isfinite(self.error)
        return np.where(known, np.abs(self.change) > self.error + TIE * np.abs(self.values[0]), None)

    @property
    def exceed(self) -> tuple[int, int]:
        """How many differences exceed the errors, of how many that could be judged."""
        judged = [value for value in self.beyond.ravel() if value is not None]
        return sum(map(bool, judged)), len(judged)


@dataclass(frozen=True)
class Comparison:
    """Two files: their names, settings that differ, the axes, states of the common cases, and the quantities."""

    files: tuple[Path, Path]
    settings: tuple[tuple[str, Any, Any], ...] | None
    axes: tuple[AxisMatch, ...]
    done: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    labels: NDArray[np.str_] | None
    quantities: tuple[Difference, ...]
    asked: Difference


def compare(one: Any, other: Any, quantity: str = "e_n", model: str = "curved") -> Comparison:
    """Compare two open result files.

    Parameters
    ----------
    one, other : Result
    quantity : str
        Map to be listed case by case.
    model : str
        Friction model of all quantities.

    Raises
    ------
    StudyError
        Different kinds of axes, nothing in common, or an unknown quantity.
    """
    axes = _matched(one, other)
    done = tuple(result.status[_block(axes, i)] == DONE for i, result in enumerate((one, other)))
    names = _common_names(one, other)
    if quantity not in names:
        text = f"--quantity: found '{quantity}', expected one that both files have: {', '.join(names)}"
        raise StudyError(USAGE, text)
    found = {
        name: _difference(one, other, axes, done, name, model)
        for name in dict.fromkeys([*(m for m in MAIN if m in names), quantity])
    }
    labels = one.labels[axes[-3].at[0]][:, 0] if not one.axes[-3].units else None
    paths = one.path, other.path
    return Comparison(paths, _settings(one, other), axes, done, labels, tuple(found.values()), found[quantity])


def _settings(one: Any, other: Any) -> tuple[tuple[str, Any, Any], ...] | None:
    try:
        return tuple(changes(one.scene, other.scene))
    except ValueError:
        return None


def _matched(one: Any, other: Any) -> tuple[AxisMatch, ...]:
    kinds = [[(axis.name, axis.units) for axis in result.axes] for result in (one, other)]
    if kinds[0] != kinds[1]:
        words = [", ".join(f"{n} [{u}]" if u else n for n, u in kind) for kind in kinds]
        text = f"the maps have different axes: {words[0]} in {one.path}, {words[1]} in {other.path}"
        raise StudyError(USAGE, f"{text}; compare files with the same kind of candidates and the same swept keys")
    axes = tuple(_match(*pair) for pair in zip(one.axes, other.axes, strict=True))
    for axis in axes:
        if not len(axis.common):
            here, there = (", ".join(f"{v:.6g}" for v in values[:5]) for values in axis.only)
            text = f"no common {axis.name} [{axis.units or '-'}]: {here} in {one.path}, {there} in {other.path}"
            raise StudyError(USAGE, f"{text}; there is nothing to compare")
    return axes


def _match(one: Any, other: Any) -> AxisMatch:
    scale = max(np.abs(one.values).max(), np.abs(other.values).max(), 1e-300)
    same = np.abs(one.values[:, None] - other.values) <= ALIKE * scale
    if not one.units and one.long_name.partition(" (")[2] != other.long_name.partition(" (")[2]:
        same &= _options(one)[:, None] == _options(other)
    at = np.nonzero(same)
    only = one.values[~same.any(axis=1)], other.values[~same.any(axis=0)]
    return AxisMatch(one.name, one.units, one.values[at[0]], (at[0], at[1]), only)


def _options(axis: Any) -> NDArray[np.str_]:
    """What the numbers of an axis stand for: texts of a sweep, else the numbers."""
    words = axis.long_name.partition(" (")[2].rstrip(")").split(", ")
    return np.array(words if len(words) == len(axis.values) else [f"{v:g}" for v in axis.values])


def _block(axes: tuple[AxisMatch, ...], i: int) -> tuple[NDArray[np.int64], ...]:
    return np.ix_(*(axis.at[i] for axis in axes))


def _common_names(one: Any, other: Any) -> list[str]:
    maps = [[q.name for q in r.layout.quantities if q.group == "maps" and q.name != "flags"] for r in (one, other)]
    return [name for name in maps[0] if name in maps[1]]


def _difference(
    one: Any, other: Any, axes: tuple[AxisMatch, ...], done: tuple[Any, ...], name: str, model: str
) -> Difference:
    q = next(q for q in one.layout.quantities if q.group == "maps" and q.name == name)
    values, errors, stated = [], [], []
    for i, result in enumerate((one, other)):
        solved = np.where(done[i], result.map(name, model if q.by_model else None)[_block(axes, i)], np.nan)
        values.append(solved)
        found = _error(result, name, model, solved, _block(axes, i))
        errors.append(np.full(solved.shape, np.nan) if found is None else found)
        stated.append(found is not None)
    return Difference(name, q.unit, (values[0], values[1]), errors[0] + errors[1], (stated[0], stated[1]))


def _error(result: Any, name: str, model: str, values: FloatArray, block: tuple[Any, ...]) -> FloatArray | None:
    """Error of a quantity in its unit; None where the file has none, as for models but the curved."""
    if model == "curved" and f"{name}_band" in {d.name for d in getattr(result.layout, "derived", ())}:
        return result.derived(f"{name}_band")[block]
    there = {q.name: q for q in result.layout.quantities if q.group == "maps"}
    if f"{name}_error" not in there or (there[name].by_model and model != "curved"):
        return None
    found = result.map(f"{name}_error")[block]
    return np.abs(found * values) if there[f"{name}_error"].relative_to else np.abs(found)
