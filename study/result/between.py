"""A dataset at a force between two solved ones, cases that a line may join, and intervals from samples of inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softjaw.study.flags import Flag
from softjaw.study.quantities import BOTH_ENDS, DONE, MISSING

if TYPE_CHECKING:  # plans rank too, and answer before xarray would be loaded
    import xarray as xr


import xarray as xr

from softjaw.study.quantities import MODELS, REALISATION, TABLE
from softjaw.study.scene.samples import UPPER

KINDS = {"pieces": 7, "holes": 7, "rims": 1}  # what a kind of contact is told by, and the largest number that counts


def contact_kinds(name: str, values: np.ndarray) -> NDArray[np.int64]:
    """Numbers of a finger's quantity of `KINDS` that differ where contacts differ in kind; NaN counts as 0."""
    numbers = np.nan_to_num(values).astype(np.int64)
    if name == "rims":  # a pad that bears on both of its ends
        return np.asarray((numbers & BOTH_ENDS) == BOTH_ENDS, np.int64)
    return np.minimum(numbers, KINDS[name])


def at_force(ds: xr.Dataset, force: float) -> xr.Dataset:
    """The dataset at one force [N] between two solved ones, by straight lines; flags of both.

    A case beside one that is not solved has that one's state. Across a snap-in of the wall, and between contacts that
    differ in kind, nothing is known: the state is "not computed".

    Raises
    ------
    ValueError
        For a force outside of the solved ones, with what they are.
    """
    forces = ds["normal_force"].values
    if not forces[0] <= force <= forces[-1] or len(forces) < 2:
        solved = ", ".join(f"{f:g}" for f in forces)
        raise ValueError(f"{force:g} N was not solved, nor lies it between two forces that were: {solved} N")
    k = min(int(np.searchsorted(forces, force, side="right")) - 1, len(forces) - 2)
    share = (force - forces[k]) / (forces[k + 1] - forces[k])
    low, high = (ds.isel(normal_force=[i]).assign_coords(normal_force=[force]) for i in (k, k + 1))
    between = low.copy()
    for name in (str(n) for n, v in ds.data_vars.items() if "normal_force" in v.dims):
        if ds[name].dtype.kind == "f":
            between[name] = (ds[name].dims, (1 - share) * low[name].values + share * high[name].values, ds[name].attrs)
        elif name == "flags":
            between[name] = (ds[name].dims, low[name].values | high[name].values, ds[name].attrs)
    states = np.where(low["status"].values == DONE, high["status"].values, low["status"].values)
    states = np.where((states == DONE) & _apart(low, high), MISSING, states)
    between["status"] = (ds["status"].dims, states, ds["status"].attrs)
    between["normal_force"].attrs.update(ds["normal_force"].attrs)
    return between


def _apart(low: xr.Dataset, high: xr.Dataset) -> NDArray[np.bool_]:
    """Cases that no straight line may join."""
    apart = (low["flags"].values ^ high["flags"].values) & int(Flag.SNAPPED) > 0
    for name in KINDS if "finger_rims" in low else ():
        lower, upper = (contact_kinds(name, ds[f"finger_{name}"].values) for ds in (low, high))
        apart |= (lower != upper).any(axis=-1)
    return np.asarray(apart, bool)


UNCERTAIN_MAPS = tuple(q.name for q in TABLE if q.group == "maps" and q.error and q.rank)


def half_width(values: xr.DataArray) -> xr.DataArray:
    """Half of the range of 95 % of some samples; NaN where one of them has no value.

    >>> import xarray as xr
    >>> float(half_width(xr.DataArray(list(range(40)), dims=REALISATION)))
    19.0
    """
    # hazen: of n samples that take the middles of n intervals of equal probability, as the scene's do
    low, high = (values.quantile(q, REALISATION, method="hazen", skipna=False) for q in (1 - UPPER, UPPER))
    return (high.drop_vars("quantile") - low.drop_vars("quantile")) / 2


def with_intervals(ds: xr.Dataset) -> xr.Dataset:
    """The cases with the scene's own inputs; samples of the uncertain ones become an interval of each main map.

    ``NAME_interval`` is its half-width (CCM), ``NAME_samples`` has the values, whose last dimension is `REALISATION`.
    """
    given, samples = ds.isel({REALISATION: 0}, drop=True), ds.isel({REALISATION: slice(1, None)})
    names = [name for name in UNCERTAIN_MAPS if name in ds]
    for name in names:
        values = samples[name].sel(model=MODELS[0], drop=True) if "model" in samples[name].dims else samples[name]
        values = values.transpose(*given.status.dims, REALISATION)
        about = {"units": ds[name].attrs["units"], "long_name": f"half-width of the 95 % interval of {name}"}
        text = f"Half of the range in which {name} (CCM) of 95 % of the samples of the uncertain inputs lies."
        given[f"{name}_interval"] = half_width(values).assign_attrs(about, definition=text)
        given[f"{name}_samples"] = values
    given.attrs["derived"] = (*ds.attrs["derived"], *(f"{name}_interval" for name in names))
    return given
