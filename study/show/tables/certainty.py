"""Whether the best grasp is better than the others beyond what is not known of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from softjaw.study.case.result import TIE
from softjaw.study.quantities import REALISATION
from softjaw.study.result.intervals import half_width
from softjaw.study.result.read import mesh_error, values_of
from softjaw.study.units import shown, shown_text

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Sure:
    """Values of some grasps and how far off they may be.

    Attributes
    ----------
    value, error : (n,) arrays
        ``error`` is that of the mesh; NaN where it is not known.
    samples : (n, m) array
        Values with samples of the uncertain inputs, the same for all grasps; none where no input is uncertain.
    """

    value: FloatArray
    error: FloatArray
    samples: FloatArray

    @property
    def half_width(self) -> FloatArray:
        """All of it together, ``(n,)``."""
        return np.hypot(self.error, _half_width(self.samples))

    def apart(self, i: int, j: int) -> bool | None:
        """Whether grasp ``i`` is better than ``j`` beyond the errors of their difference; None where not known.

        Inputs move all grasps at once, so it is the difference that has an interval. A difference within `TIE` of the
        values is none, also where nothing is said to be in error.
        """
        error = np.hypot(np.hypot(self.error[i], self.error[j]), _half_width(self.samples[i] - self.samples[j]))
        least = TIE * max(abs(self.value[i]), abs(self.value[j]))
        return None if np.isnan(error) else bool(self.value[i] - self.value[j] > error + least)


def _half_width(samples: FloatArray) -> FloatArray:
    if not samples.shape[-1]:
        return np.zeros(samples.shape[:-1])
    return half_width(xr.DataArray(samples, dims=[*(f"dim_{i}" for i in range(samples.ndim - 1)), REALISATION])).values


def sure(ds: Any, name: str, k: int) -> Sure | None:
    """A map (CCM) of all candidates at a force level; None where a file knows no error of it."""
    values, error, samples = values_of(ds, name)[..., k].ravel(), mesh_error(ds, name), ds.get(f"{name}_samples")
    if error is None and samples is None:
        return None
    own = np.zeros(values.shape) if error is None else error[..., k].ravel()
    inputs = np.empty((len(values), 0)) if samples is None else samples.values[..., k, :].reshape(len(values), -1)
    return Sure(values, own, inputs)


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
    if not np.isfinite(found.half_width[grasps]).any():
        return "errors are not known: not all cases are solved yet, or not with all samples of the uncertain inputs"
    if judged[0] is None:
        return "whether the best grasp is better than the second is not known: one of them has no error"
    alike = max((i for i, apart in enumerate(judged, start=1) if apart is False), default=0)
    one, other = (_text(found, i, units) for i in (grasps[0], grasps[alike or 1]))
    if not alike:
        return f"the best grasp is better than the second beyond the errors ({one} against {other})"
    between = "" if all(apart is False for apart in judged[:alike]) else ", though some between them can"
    return f"the first {alike + 1} grasps cannot be distinguished ({one} to {other}){between}"


def _without_images(value: FloatArray, order: Sequence[int], place: Sequence[tuple[int, ...]]) -> list[int]:
    kept: list[int] = []
    for i in order:
        if not any(place[i] == place[j] and abs(value[i] - value[j]) <= TIE * abs(value[j]) for j in kept[-4:]):
            kept.append(i)
    return kept


def _text(found: Sure, i: int, units: str) -> str:
    value = f"{shown(found.value[i], units):#.4g}".rstrip(".")
    return f"{value} +- {shown_text(found.half_width[i], units, 2)}"
