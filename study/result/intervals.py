"""What samples of uncertain inputs say: half-widths of the 95 % intervals of the main maps."""

from __future__ import annotations

import xarray as xr

from softjaw.study.quantities import MODELS, REALISATION, TABLE
from softjaw.study.scene.samples import UPPER

UNCERTAIN_MAPS = tuple(q.name for q in TABLE if q.group == "maps" and q.error and q.rank)


def half_width(values: xr.DataArray) -> xr.DataArray:
    """Half of the range of 95 % of some samples; NaN where one of them has no value.

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
