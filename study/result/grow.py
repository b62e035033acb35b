"""A finished result file with more stations: what is solved stands in it already, the rest is not computed yet."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from softjaw.study.messages import CANNOT_WRITE, StudyError, remove
from softjaw.study.result.datasets import CLOSING, SUMS, Dataset
from softjaw.study.result.guarded import reason
from softjaw.study.result.layout import ROOT, Header, Layout
from softjaw.study.result.skeleton import LIBVER, create, put_in_place
from softjaw.study.result.store import open_result

SESSIONS = f"{ROOT}/provenance/sessions"
# What a new file has of its own, or what is filled again once nothing is missing.
OWN = (f"{ROOT}/derived/", f"{SUMS}/{CLOSING}", f"{ROOT}/wrenches/motion", f"{ROOT}/wrenches/candidate")


def grow(path: Path, layout: Layout, header: Header) -> None:
    """Replace a file by one with the stations of ``layout``, among which are all of its own; by one process.

    The old file has its name until the new one is whole and on disk, so that a kill at any time leaves one of them.
    Rows are copied with their checksums: a torn one stays torn, and is solved again.
    """
    grown = path.with_name(path.name + ".grown")
    create(grown, layout, header)
    try:
        with open_result(path, unchecked=True) as old, h5py.File(grown, "r+", libver=LIBVER) as file:
            places = _places(old.layout, layout)
            known = {d.path for d in old.layout.datasets}
            for dataset in (d for d in layout.datasets if d.path in known and not d.path.startswith(OWN)):
                values = old.file.values(old.file.plain(dataset.path))
                target = file[dataset.path]
                target[...] = _spread(values, dataset, places).astype(target.dtype)  # texts with their encoding
            file[SESSIONS][...] = old.file.values(old.file.plain(SESSIONS))
        with grown.open("r+b") as handle:
            os.fsync(handle.fileno())
    except (OSError, RuntimeError) as error:
        remove(grown)
        raise StudyError(CANNOT_WRITE, f"{path}: cannot be given more stations: {reason(error)}") from error
    put_in_place(grown, path)


def _places(old: Layout, new: Layout) -> dict[str, Any]:
    """Where the entries of the dimensions that grow stand in the new file."""
    before, now = (np.asarray(layout.axes[-3].values) for layout in (old, new))
    stations = np.searchsorted(now, before)
    if not np.array_equal(now[np.minimum(stations, len(now) - 1)], before):
        raise ValueError("a station of the file is not among those of its scene")
    rows = np.arange(new.rows).reshape(new.shape).take(stations, axis=-3).ravel()
    found = {"station": stations, "row": rows}
    angles = new.shape[-2]
    for name, numbers in old.chosen.items():
        moved = [int(stations[n // angles]) * angles + n % angles for n in numbers]
        found[name] = np.array([new.chosen[name].index(n) for n in moved], int)
    return found


def _spread(values: np.ndarray, dataset: Dataset, places: dict[str, Any]) -> np.ndarray:
    """The values at their places in the new shape, and the dataset's fill value elsewhere."""
    found = np.full(dataset.shape, dataset.fill, dataset.dtype)
    index: list[Any] = [slice(None)] * found.ndim
    for axis, name in enumerate(dataset.scales[: found.ndim]):
        if name in places:
            index[axis] = places[name]
    found[tuple(index)] = values
    return found
