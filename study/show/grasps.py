"""What report, view and figures ask of the dataset of a study: its grasps in their order, and cases as text.

Everything reads the dataset that `study.result.read.open` gives, after `judge` has decided which force level and which
grasp are shown. A case is named by its index ``(..., station, angle, force)`` over the axes of ``status``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from softjaw.study.flags import OF_FILE, flag_words
from softjaw.study.quantities import FORCE_RANGE, MAIN, MODELS, STATES
from softjaw.study.ranking import index_of, ranked
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import axes_of, values_of
from softjaw.study.result.store import place_text, value_text
from softjaw.study.show.status import Index, grouped
from softjaw.study.table import number, with_unit
from softjaw.study.units import shown, shown_unit

if TYPE_CHECKING:
    import xarray as xr  # slow to load, and a run needs it at its end only

# Maps to choose from besides the main ones.
MORE = ("epsilon", "safety_factor", "F_N", "S", "contact_area", "p_max", "closing", "curvature_loss", "overclaim",
        "overclaim_ellipsoid", "indentation", "wall_stress", "support_force")  # fmt: skip
# What a check may be at most (or, for those of `ABOVE`, must exceed).
LIMITS = {"force_balance": 1e-6, "adhesion": 1e-6, "penetration": 1e-6, "complementarity": 1e-6, "min_det_f": 0.0,
          "ellipticity": 0.0}  # fmt: skip
ABOVE = ("min_det_f", "ellipticity")


def field(ds: xr.Dataset, name: str, model: str = "ccm") -> Any:
    """Array of a variable over all cases, a map of several friction models in one; None where it has no value."""
    if name not in ds.variables:
        return None
    of_finger = "finger" in ds.variables[name].dims
    values = np.asarray(ds.variables[name].values if of_finger else values_of(ds, name, model), float)
    # A map without any value is left out instead of being drawn empty.
    return values if np.isfinite(values).any() else None


def choices(ds: xr.Dataset, first: str, *more: str) -> list[str]:
    """Maps with a value that a menu offers, one of them first, with the bounds of the safe forces."""
    return [name for name in dict.fromkeys((first, *MAIN, *MORE, *FORCE_RANGE, *more)) if field(ds, name) is not None]


def at(ds: xr.Dataset, name: str, index: Index, model: str = "ccm") -> float:
    """A map's value at one case, or what is known of its candidate; NaN if there is none."""
    if name not in ds.variables:
        return float("nan")
    variable = ds.variables[name]
    return float(variable.values[(*index, MODELS.index(model)) if "model" in variable.dims else index[: variable.ndim]])


def quantity(ds: xr.Dataset, name: str) -> tuple[str, str, float]:
    """A variable's long name without its unit, the displayed unit, and the factor from SI."""
    attrs = ds.variables[name].attrs if name in ds.variables else {}
    units = attrs.get("units", "")
    return attrs.get("long_name", name), shown_unit(units), shown(1.0, units)


def label_of(ds: xr.Dataset, name: str) -> str:
    """A variable's name and unit for an axis or a column."""
    return with_unit(*quantity(ds, name)[:2])


def axis_label(ds: xr.Dataset, axis: str) -> str:
    """An axis of the cases with the displayed unit."""
    if axis == "station" and ds.attrs["poses"]:
        return "candidate"
    return with_unit(spoken(axis), shown_unit(ds.variables[axis].attrs["units"]))


def spoken(name: str) -> str:
    """A name with spaces."""
    return name.replace("_", " ")


def axis_values(ds: xr.Dataset, axis: str) -> np.ndarray:
    """Values of an axis in the displayed unit."""
    return np.asarray(shown(ds.variables[axis].values, ds.variables[axis].attrs["units"]))


def axis_text(ds: xr.Dataset, axis: str, i: int) -> str:
    """One value of an axis with its unit; the text of a sweep over texts."""
    return value_text(axes_of(ds)[ds.status.dims.index(axis)], i)


def place(ds: xr.Dataset, index: Index, force: bool = False) -> str:
    """A case as text, with or without its force; poses by their names."""
    text = place_text(axes_of(ds), ds.label.values, index)
    return text if force else text.rpartition(", ")[0]


def forces(ds: xr.Dataset) -> np.ndarray:
    """Normal forces per finger ``(k,)`` [N]."""
    return np.asarray(ds.variables["normal_force"].values)


def largest_force(ds: xr.Dataset) -> float:
    """The largest normal force of the cases, also where values between two are shown [N]."""
    return float(ds.attrs.get("largest", forces(ds)[-1]))


def candidate_of(ds: xr.Dataset, index: Index) -> int:
    """Number of a case's candidate, counted over sweeps, stations and angles."""
    return int(np.ravel_multi_index(index[:-1], ds.status.shape[:-1]))


def unravelled(position: int, shape: tuple[int, ...]) -> Index:
    """Index of a position in the flattened array."""
    return tuple(int(i) for i in np.unravel_index(position, shape))


def order(ds: xr.Dataset, k: int) -> list[Index]:
    """Indices of the solved cases at a force level, the best first."""
    return [index_of(ds, int(c), k) for c in ranked(ds, k, ds.attrs["score"])]


def passes(name: str, value: float) -> bool:
    """Whether a check holds."""
    return value > LIMITS[name] if name in ABOVE else value <= LIMITS[name]


def flagged(ds: xr.Dataset, index: Index) -> list[str]:
    """Checks that a case does not pass, with their values at the worse finger."""
    listed = []
    for name in (name for name in LIMITS if f"check_{name}" in ds.variables):
        # A finger without a check must not hide that of the other.
        worst = (np.fmin if name in ABOVE else np.fmax).reduce(ds.variables[f"check_{name}"].values[index])
        listed += [f"{spoken(name)} {number(worst)}"] * bool(np.isfinite(worst) and not passes(name, worst))
    return listed


def note(ds: xr.Dataset, index: Index, known: int = 0) -> str:
    """Why a case has no result; the checks that a solved one misses, and its flags but for ``known`` ones."""
    if ds.variables["status"].values[index] != DONE:
        return str(ds.variables["message"].values[index])
    words = flag_words(int(ds["flags"].values[index]) & ~known)
    return ", ".join(text for text in (*flagged(ds, index), words) if text)


def stated(ds: xr.Dataset, index: Index) -> str:
    """State and notes of a case; empty for one that is solved without any."""
    state = int(ds.variables["status"].values[index])
    return ": ".join(filter(None, [STATES[state] * (state != DONE), note(ds, index)]))


def reason_lines(ds: xr.Dataset, *states: int) -> list[str]:
    """Reasons of failed cases and of what is no grasp, and notes on solved ones, alike messages together."""
    kinds = grouped(ds.status.values, ds.message.values, ds["flags"].values & OF_FILE)
    wanted = (kind for kind in kinds if not states or kind.state in states)
    return [kind.text(axes_of(ds), ds.label.values) for kind in wanted]
