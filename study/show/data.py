"""What pages and pictures need of a result file: maps without unsolved cases, the order of grasps, their words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.case.result import TIE
from softjaw.study.flags import BORNE, LOST
from softjaw.study.quantities import SINGULAR
from softjaw.study.result.layout import DONE, FAILED, MISSING, ROOT
from softjaw.study.result.read import FIELDS, dataset
from softjaw.study.show.tables.ranking import borne_level, judged, ranking
from softjaw.study.units import shown as in_shown
from softjaw.study.units import shown_unit

TYPESET = {"deg": "°", "mm^2": "mm²"}  # as pages write these units
WIDE = 5e-3  # relative difference of widths that makes no place wider
# What a check may be at most (or, for the last two, must exceed), and how the reader should take it.
LIMITS = {
    "force_balance": 1e-6,
    "adhesion": 1e-6,
    "penetration": 1e-6,
    "complementarity": 1e-6,
    "min_det_f": 0.0,
    "ellipticity": 0.0,
}
ABOVE = ("min_det_f", "ellipticity")


def shown(units: str) -> tuple[str, float]:
    """Unit that people read, and the factor from SI to it."""
    unit = shown_unit(units)
    return TYPESET.get(unit, unit), in_shown(1.0, units)


def number(value: float, digits: int = 3) -> str:
    """A number for people; a dash where there is none.

    >>> number(0.0123456), number(1.6e-9), number(float("nan")), number(120000.0)
    ('0.0123', '1.6 × 10⁻⁹', '–', '120000')
    """
    value = float(value)
    if not np.isfinite(value):
        return "–"
    if value and not 1e-4 <= abs(value) < 1e6:
        mantissa, _, power = f"{value:.{max(digits - 2, 1)}e}".partition("e")
        return f"{mantissa} × 10{str(int(power)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e" in text else text


class Data:
    """A result file as reports, views and figures see it; ``None`` stands for what the file does not have.

    Everything comes from ``ds``, the dataset that `study.result.read.open` gives, but for contact patches and the
    deformed walls, which stay in the file. ``chosen`` is the index of a case that the reader asked for beside the best.
    """

    def __init__(self, result: Any, chosen: tuple[int, ...] | None = None) -> None:
        self.result, self.ds = result, dataset(result)
        self.axes, self.status = result.axes, self.ds["status"].values
        self.shape = self.status.shape
        self.messages: np.ndarray = self.ds["message"].values
        self.chosen = chosen
        self._fields: dict[str, np.ndarray] = {}
        self._read: dict[tuple[str, str], np.ndarray | None] = {}
        self.forces: np.ndarray = self.axes[-1].values
        self.by_poses = not self.axes[-3].units

    @cached_property
    def dataset(self) -> Any:
        """The whole file as `study.result.read.open` gives it."""
        return dataset(self.result)

    @property
    def title(self) -> str:
        """Name of the object or of the scene file."""
        return self.ds.attrs["title"] or Path(self.ds.attrs["file"]).stem

    @property
    def planar(self) -> str:
        """The planar model that the scene prefers."""
        return str(self.ds.attrs["planar"])

    @property
    def grasps(self) -> int:
        """Number of candidates at each point of a sweep."""
        return self.shape[-3] * self.shape[-2]

    @property
    def sweeps(self) -> bool:
        """Whether settings are swept."""
        return any(length > 1 for length in self.shape[:-3])

    def count(self, state: int) -> int:
        """Number of cases in this state."""
        return int(np.sum(self.status == state))

    def values(self, path: str) -> np.ndarray | None:
        """A variable by its group and name in the file, over all cases; None if there is no value.

        Cases that are not done have NaN.
        """
        if path in FIELDS:  # too large for the dataset
            return self._field(path)
        group, _, name = path.partition("/")
        return self._known(name if group == "derived" else f"{SINGULAR.get(group, group)}_{name}")

    def _field(self, path: str) -> np.ndarray | None:
        if path not in self._fields and any(d.path == f"{ROOT}/{path}" for d in self.result.layout.datasets):
            self._fields[path] = np.where((self.status == DONE)[..., None, None], self.result.read(path), np.nan)
        return self._fields.get(path)

    def map(self, name: str, model: str = "ccm") -> np.ndarray | None:
        """A map over all cases, of one friction model where it has several."""
        return self._known(name, model)

    def _known(self, name: str, model: str = "ccm") -> np.ndarray | None:
        if (name, model) not in self._read:
            self._read[name, model] = self._floats(name, model)
        return self._read[name, model]

    def _floats(self, name: str, model: str) -> np.ndarray | None:
        if name not in self.ds.data_vars:
            return None
        found = self.ds[name]
        if found.dims[-1:] == ("model",) and "finger" not in found.dims:
            found = found.sel(model=model)
        values = found.values.astype(float)
        if values.shape[: len(self.shape)] == self.shape:
            values[self.status != DONE] = np.nan  # codes have integers there
        return values if np.isfinite(values).any() else None

    def at(self, name: str, index: Sequence[int], model: str = "ccm") -> float:
        """A map's value at one case, NaN if there is none."""
        found = self.map(name, model)
        return float("nan") if found is None else float(found[tuple(index)])

    def units(self, name: str) -> tuple[str, str, float]:
        """A map's long name without its unit, the unit people read, and the factor from SI."""
        found = self.ds[name].attrs if name in self.ds else {}
        label, units = found.get("long_name", name), found.get("units", "")
        return label, *shown(units)

    def label(self, name: str) -> str:
        """A map's name and unit for an axis or a column."""
        label, unit, _ = self.units(name)
        return f"{label} [{unit}]" if unit else label

    @cached_property
    def score(self) -> str:
        """The map that grasps are ranked by."""
        return "quality" if self.map("quality") is not None else "e_n"

    @cached_property
    def flags(self) -> np.ndarray:
        """Flags of all cases as `study.show.tables.ranking.judged` gives them."""
        return judged(self.dataset)

    @property
    def lost(self) -> np.ndarray:
        """Solved cases that slip, slide out, harm the object or do not hold it."""
        return (self.flags & LOST > 0) & (self.status == DONE)

    @property
    def walled(self) -> bool:
        """Whether the object has a thin wall."""
        return "wall" in self.ds.attrs["has"]

    def bound(self, name: str) -> np.ndarray | None:
        """A bound of the window of forces [N], over all axes but the force; None if the file has no such bound."""
        return self.ds[name].values if name in self.ds.attrs["derived"] else None

    @cached_property
    def k(self) -> int:
        """The force level that is shown: the highest with a solved case that its wall bears, if there is one."""
        borne = borne_level(self.status, self.flags) if (self.flags & BORNE).any() else None
        if borne is not None:
            return borne
        solved = np.flatnonzero((self.status == DONE).reshape(-1, len(self.forces)).any(axis=0))
        return int(solved[-1]) if solved.size else len(self.forces) - 1

    def order(self, k: int) -> list[tuple[int, ...]]:
        """Indices of the solved cases at a force level, the best first."""
        found = self.map(self.score)
        done = np.flatnonzero(self.status[..., k].ravel() == DONE)
        score = np.full(done.shape, -np.inf) if found is None else found[..., k].ravel()[done]
        ranked = done[ranking(score, self.flags[..., k].ravel()[done])]
        return [(*(int(i) for i in np.unravel_index(c, self.shape[:-1])), k) for c in ranked]

    @cached_property
    def best(self) -> tuple[int, ...] | None:
        """Index of the best case at the force shown."""
        return next(iter(self.order(self.k)), None)

    def images(self, index: tuple[int, ...]) -> list[tuple[int, ...]]:
        """Other cases at the same force with the same score: images by symmetry, or equal as far as can be told."""
        best = self.at(self.score, index)
        others = [i for i in self.order(index[-1]) if i != index]
        return [i for i in others if abs(self.at(self.score, i) - best) <= TIE * abs(best)]

    @cached_property
    def other(self) -> tuple[tuple[int, ...] | None, str]:
        """A case to compare the best with, and why: the one asked for, the widest place, or else the worst one."""
        if self.chosen is not None and self.chosen != self.best and self.status[self.chosen] == DONE:
            return self.chosen, "the chosen candidate"
        order = self.order(self.k)
        width = self.map("contact_distance")
        if self.best is None or len(order) < 2:
            return None, ""
        same = {self.best, *self.images(self.best)}
        if width is not None:  # the best of the widest places, on the same object
            here = [i for i in order if i[:-3] == self.best[:-3] and np.isfinite(width[i])]
            widest = next(i for i in here if width[i] >= (1 - WIDE) * max(width[j] for j in here))
            if widest not in same and width[widest] > (1 + WIDE) * width[self.best]:
                return widest, "the widest place"
        return (order[-1], "the last in the ranking") if order[-1] not in same else (None, "")

    def name(self, axis: Any) -> str:
        """An axis in words."""
        return axis.name.replace("_", " ")

    def texts(self, axis: Any) -> list[str]:
        """The values of a sweep over texts; empty for numbers."""
        return list(axis.options)

    def axis_label(self, axis: Any) -> str:
        """An axis with the unit people read."""
        if axis.name == "station" and self.by_poses:
            return "candidate"
        unit = shown(axis.units)[0]
        return f"{self.name(axis)} [{unit}]" if unit else self.name(axis)

    def place(self, index: Sequence[int], force: bool = False) -> str:
        """A case in words, without axes that have only one value; poses by their names."""
        words = []
        for axis, i, length in zip(self.axes, index, self.shape, strict=True):
            unit, factor = shown(axis.units)
            if axis is self.axes[-3] and self.by_poses:
                words.append(self.candidate(index) or f"pose {i}")
            elif axis is self.axes[-1]:
                words += [f"{number(axis.values[i], 4)}\u00a0N"] * force
            elif length > 1 and self.texts(axis):
                words.append(f"{self.name(axis)} {self.texts(axis)[i]}")
            elif length > 1 or axis.name == "station":
                text = f"{self.name(axis)}\u00a0{number(axis.values[i] * factor, 4)}"
                words.append(text + (unit if unit == "°" else f"\u00a0{unit}" if unit else ""))
        return ", ".join(words)

    def candidate(self, index: Sequence[int]) -> str:
        """The name that the scene gives a candidate."""
        return str(self.ds["label"].values[index[-3], index[-2]])

    def flagged(self, index: Sequence[int]) -> list[str]:
        """Checks that a case does not pass, in words."""
        found = []
        for name in LIMITS:
            value = self.check(name, index)
            if np.isfinite(value) and not passes(name, value):
                found.append(f"{name.replace('_', ' ')} {number(value)}")
        return found

    def check(self, name: str, index: Sequence[int]) -> float:
        """A check of the worse finger."""
        found = self.values(f"checks/{name}")
        if found is None or not np.isfinite(found[tuple(index)]).any():
            return float("nan")
        return float((np.nanmin if name in ABOVE else np.nanmax)(found[tuple(index)]))

    def grouped(self, state: int) -> list[tuple[int, str, list[tuple[int, ...]]]]:
        """Messages of the cases in a state: how many, an example, where; alike but for their numbers is one kind."""
        messages, rows = self.messages, np.argwhere(self.status == state)
        groups: dict[str, tuple[str, list[tuple[int, ...]]]] = {}
        for row in rows:
            index = tuple(int(i) for i in row)
            text = str(messages[index])
            if text or state == FAILED:
                kind = re.sub(r"[-+]?\d[\d.]*(e[-+]?\d+)?", "#", text)
                groups.setdefault(kind, (text or "no reason was given", []))[1].append(index)
        return sorted(((len(where), text, where) for text, where in groups.values()), key=lambda g: -g[0])

    @property
    def unfinished(self) -> bool:
        """Whether cases are missing."""
        return self.count(MISSING) > 0


def passes(name: str, value: float) -> bool:
    """Whether a check holds."""
    return value > LIMITS[name] if name in ABOVE else value <= LIMITS[name]
