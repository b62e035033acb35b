"""Whether the best grasp is better than the others beyond what is not known of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.case.result import TIE
from softjaw.study.result.read import mesh_error
from softjaw.study.units import shown, shown_text

FloatArray = NDArray[np.float64]
MOVES = {"mu": "mu", "modulus": "the shear modulus", "wall": "the wall's thickness"}  # all grasps at once


@dataclass(frozen=True)
class Sure:
    """Values of some grasps and how far off they may be.

    Attributes
    ----------
    value : (n,) array
    own : (n,) array
        Half-width of what is each grasp's own, or whose sign is not known; NaN where nothing is.
    common : dict of (n,) arrays
        Changes by inputs that move all grasps at once, each with its sign.
    unsigned : tuple of str
        Inputs that do so too, but with a sign that is known at the probes only, so they are part of ``own``.
    """

    value: FloatArray
    own: FloatArray
    common: dict[str, FloatArray]
    unsigned: tuple[str, ...] = ()

    @property
    def half_width(self) -> FloatArray:
        """All of it together, ``(n,)``."""
        return np.sqrt(self.own**2 + sum((change**2 for change in self.common.values()), np.zeros(self.value.shape)))

    def apart(self, i: int, j: int) -> bool | None:
        """Whether grasp ``i`` is better than ``j`` beyond the errors of their difference; None where not known.

        A difference within `TIE` of the values is none, also where nothing is said to be in error.
        """
        both = np.array([change[i] - change[j] for change in self.common.values()])
        error = np.sqrt(self.own[i] ** 2 + self.own[j] ** 2 + np.sum(both**2))
        least = TIE * max(abs(self.value[i]), abs(self.value[j]))
        return None if np.isnan(error) else bool(self.value[i] - self.value[j] > error + least)


def sure(ds: Any, name: str, k: int) -> Sure | None:
    """``quality`` or ``e_n`` (CCM) of all candidates at a force level; None where a file knows no error of it."""
    values = ds[name].sel(model="ccm").values[..., k].ravel()
    shares = {full: full.removeprefix(f"{name}_") for full in ds.attrs["derived"]}
    own, common = np.zeros(values.shape), dict[str, FloatArray]()
    if f"{name}_interval" in shares:
        for full, short in shares.items():
            kind, _, of = short.partition("_")
            if full == short or not of:
                continue
            change = ds[full].values[..., k].ravel() * values
            if kind == "change":
                common[of] = change
            else:
                own = own + change**2
        unsigned = tuple(of for of in MOVES if f"{name}_interval_{of}" in shares)
        return Sure(values, np.sqrt(own), common, unsigned)
    error = mesh_error(ds, name)
    return None if error is None else Sure(values, error[..., k].ravel(), common)


def verdict(found: Sure | None, order: Sequence[int], place: Sequence[tuple[int, ...]], units: str = "") -> str:
    """One sentence on the best grasp against those that follow; empty where nothing is known of errors.

    Parameters
    ----------
    found : Sure or None
    order : sequence of int
        The grasps from the best one downward; those that fail in the hand left out.
    place : sequence of tuples of int
        Of every grasp, what images by symmetry have in common.
    units : str
        Of the values, in SI.
    """
    if found is None:
        return ""
    grasps = _without_images(found.value, order, place)
    if len(grasps) < 2:
        return ""
    judged = [found.apart(grasps[0], other) for other in grasps[1:]]
    if not np.isfinite(found.own[grasps]).any():
        return "errors are not known: not all cases are solved yet, or the probes could not be solved again"
    if judged[0] is None:
        return "whether the best grasp is better than the second is not known: one of them has no error"
    alike = max((i for i, apart in enumerate(judged, start=1) if apart is False), default=0)
    one, other = (_text(found, i, units) for i in (grasps[0], grasps[alike or 1]))
    also = _moved(found)
    if not alike:
        return f"the best grasp is better than the second beyond the errors ({one} against {other}){also}"
    between = "" if all(apart is False for apart in judged[:alike]) else ", though some between them can"
    return f"the first {alike + 1} grasps cannot be distinguished ({one} to {other}){between}{also}"


def _moved(found: Sure) -> str:
    """What is said of inputs that move all grasps at once."""
    both = [of for of, change in found.common.items() if np.any(change)]
    words = [" and ".join(MOVES[of] for of in names) for names in (both, found.unsigned)]
    text = f"; {words[0]} move{'s' * (len(both) == 1)} all grasps at once" if both else ""
    count = "counts" if len(found.unsigned) == 1 else "count"
    return text + (f"; {words[1]} {count} for each grasp by itself, which is cautious" if found.unsigned else "")


def _without_images(value: FloatArray, order: Sequence[int], place: Sequence[tuple[int, ...]]) -> list[int]:
    kept: list[int] = []
    for i in order:
        if not any(place[i] == place[j] and abs(value[i] - value[j]) <= TIE * abs(value[j]) for j in kept[-4:]):
            kept.append(i)
    return kept


def _text(found: Sure, i: int, units: str) -> str:
    value = f"{shown(found.value[i], units):#.4g}".rstrip(".")
    return f"{value} +- {shown_text(found.half_width[i], units, 2)}"
