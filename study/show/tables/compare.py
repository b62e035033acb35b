"""Two result files side by side: which settings and cases differ, and which differences exceed the stated errors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from softjaw.study.case.result import TIE
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.quantities import TABLE, map_row
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import axes_of, values_of
from softjaw.study.scene.text import changes

FloatArray = NDArray[np.float64]
ALIKE = 1e-9  # relative difference of coordinates that is only rounding


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

    ``error`` is the sum of both errors: half-widths of intervals, or else errors of the mesh; NaN where a file does not
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


def compare(one: xr.Dataset, other: xr.Dataset, quantity: str = "e_n", model: str = "ccm") -> Comparison:
    """Compare two result files, as `study.result.read.open` gives them.

    Parameters
    ----------
    one, other : xarray.Dataset
    quantity : str
        Map to be listed case by case.
    model : str
        Friction model of all quantities.

    Raises
    ------
    StudyError
        Different kinds of axes, nothing in common, or an unknown quantity.
    """
    pair = (one, other)
    axes = _matched(*pair)
    done = tuple(ds.status.values[_block(axes, i)] == DONE for i, ds in enumerate(pair))
    names = [q.name for q in TABLE if q.group == "maps" and q.name != "flags" and q.name in one and q.name in other]
    if quantity not in names:
        text = f"--quantity: found '{quantity}', expected one that both files have: {', '.join(names)}"
        raise StudyError(USAGE, text)
    found = {name: _difference(pair, axes, name, model) for name in names if map_row(name).rank or name == quantity}
    labels = None if one[axes[-3].name].units else one.label.values[axes[-3].at[0]][:, 0]
    paths = Path(one.file), Path(other.file)
    return Comparison(paths, _settings(*pair), axes, done, labels, tuple(found.values()), found[quantity])


def _settings(one: xr.Dataset, other: xr.Dataset) -> tuple[tuple[str, Any, Any], ...] | None:
    try:
        return tuple(changes(one.scene, other.scene))
    except ValueError:
        return None


def _matched(one: xr.Dataset, other: xr.Dataset) -> tuple[AxisMatch, ...]:
    both = axes_of(one), axes_of(other)
    kinds = [[(axis.name, axis.units) for axis in axes] for axes in both]
    if kinds[0] != kinds[1]:
        words = [", ".join(f"{n} [{u}]" if u else n for n, u in kind) for kind in kinds]
        text = f"the maps have different axes: {words[0]} in {one.file}, {words[1]} in {other.file}"
        raise StudyError(USAGE, f"{text}; compare files with the same kind of candidates and the same swept keys")
    axes = tuple(_match(*pair) for pair in zip(*both, strict=True))
    for axis in axes:
        if not len(axis.common):
            here, there = (", ".join(f"{v:.6g}" for v in values[:5]) for values in axis.only)
            text = f"no common {axis.name} [{axis.units or '-'}]: {here} in {one.file}, {there} in {other.file}"
            raise StudyError(USAGE, f"{text}; there is nothing to compare")
    return axes


def _match(one: Any, other: Any) -> AxisMatch:
    scale = max(np.abs(one.values).max(), np.abs(other.values).max(), 1e-300)
    same = np.abs(one.values[:, None] - other.values) <= ALIKE * scale
    if one.options and other.options:  # numbers stand for texts
        same = np.array(one.options)[:, None] == np.array(other.options)
    at = np.nonzero(same)
    only = one.values[~same.any(axis=1)], other.values[~same.any(axis=0)]
    return AxisMatch(one.name, one.units, one.values[at[0]], (at[0], at[1]), only)


def _block(axes: tuple[AxisMatch, ...], i: int) -> tuple[NDArray[np.int64], ...]:
    return np.ix_(*(axis.at[i] for axis in axes))


def _difference(pair: tuple[xr.Dataset, xr.Dataset], axes: tuple[AxisMatch, ...], name: str, model: str) -> Difference:
    values = [values_of(ds, name, model)[_block(axes, i)] for i, ds in enumerate(pair)]
    errors = [_error(ds, name, model) for ds in pair]
    known = [np.full(v.shape, np.nan) if e is None else e[_block(axes, i)]
             for i, (v, e) in enumerate(zip(values, errors, strict=True))]  # fmt: skip
    stated = (errors[0] is not None, errors[1] is not None)
    return Difference(name, map_row(name).unit, (values[0], values[1]), known[0] + known[1], stated)


def _error(ds: xr.Dataset, name: str, model: str) -> FloatArray | None:
    """Error of a map in its unit; None where the file has none, as for models but the curved."""
    if map_row(name).by_model and model != "ccm":
        return None
    if f"{name}_interval" in ds:
        return values_of(ds, f"{name}_interval")
    if f"{name}_error" not in ds:
        return None
    share = values_of(ds, f"{name}_error")
    return np.abs(share * values_of(ds, name) if map_row(f"{name}_error").relative_to else share)
