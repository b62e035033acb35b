"""The one reader: a result file as an ``xarray.Dataset`` with dimensions, coordinates, units and definitions.

Tables, report, view, figures, comparison, export, look-up and notebooks all read this. Reading needs neither MPI nor
PETSc, and works on a file that a run is still writing.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from softjaw.study.flags import OF_FILE, Flag
from softjaw.study.quantities import EFFECTS, FINGERS, MODELS, REASONS
from softjaw.study.result.datasets import Dataset
from softjaw.study.result.layout import DONE, ROOT
from softjaw.study.result.reading import Result
from softjaw.study.result.store import open_result

STATES = ("missing", "done", "failed")  # by their codes
XYZ = ("x", "y", "z")
PREFIX = {"fingers": "finger", "checks": "check", "effects": "effect", "probes": "probe"}  # of names that maps have too
FIELDS = ("fingers/cor_wrench", "wrenches/wrench", "wall/place")  # too large to be read with the rest


def open(file: str | Path) -> xr.Dataset:
    """A result file as a dataset, whole in memory; the file is closed.

    Every value is checked against its checksum. A case that failed or is not computed yet has NaN everywhere;
    ``status`` and ``message`` tell which and why. Contact patches and fields are read by `read_patch` and `read_field`.

    Parameters
    ----------
    file : path
        Result file (``.hdf``), finished or not.

    Returns
    -------
    xarray.Dataset
        Dimensions: swept keys, ``station`` [m], ``angle`` [rad], ``normal_force`` [N], then where they apply ``finger``
        (1, 2), ``model`` (curved, flat, projected), ``component`` and others. Every variable has ``units``,
        ``long_name`` and ``definition``; the dataset's attributes hold scene, options and provenance.

    Raises
    ------
    StudyError
        The file cannot be read, is damaged, or is not a result file of this program.
    """
    with open_result(file) as result:
        return dataset(result)


def read_patch(file: str | Path, **at: int | slice) -> xr.Dataset:
    """Contact patches of both fingers for the cases at these positions along the dimensions.

    Parameters
    ----------
    file : path
        Result file.
    **at : int or slice
        Positions by dimension, as in ``xarray.Dataset.isel``; a dimension that is left out is kept.

    Returns
    -------
    xarray.Dataset
        ``pressure`` [Pa], ``area`` [m^2] over the kept dimensions, ``finger`` and ``face``; ``centroid`` [m] and
        ``normal`` with ``component`` too, in the pad's frame. Empty if the file holds no patches.

    Raises
    ------
    StudyError
        The file cannot be read or is damaged.

    Examples
    --------
    ``read_patch("results/smoke.hdf", station=0, angle=0, normal_force=-1).pressure.sum("face")``
    """
    with open_result(file) as result:
        rows = xr.DataArray(np.arange(result.layout.rows).reshape(result.layout.shape), dims=result.layout.names)
        rows = rows.isel(at)
        described = {d.path: d for d in result.layout.datasets}
        faces = [result.patch(int(row)) for row in rows.values.ravel()]
        found = {}
        for name in faces[0] if faces else ():
            values = np.stack([one[name] for one in faces]).reshape(rows.shape + faces[0][name].shape)
            values[(result.status.ravel()[rows.values] != DONE)] = np.nan
            d = described[f"{ROOT}/patch/{name}"]
            found[name] = xr.Variable((*rows.dims, *d.scales[1:]), values, _about(d))
        return xr.Dataset(found, {"finger": np.arange(1, FINGERS + 1), "component": [*XYZ]} if found else {})


def read_field(file: str | Path, path: str, **at: int | slice) -> xr.DataArray:
    """One of the large datasets that `open` leaves out: ``wall/place``, ``fingers/cor_wrench``, ``wrenches/wrench``.

    Parameters
    ----------
    file, at
        As in `read_patch`.
    path : str
        Dataset below ``/study``.

    Raises
    ------
    KeyError
        The file has no such dataset.
    StudyError
        The file cannot be read or is damaged.
    """
    with open_result(file) as result:
        d = next((d for d in result.layout.datasets if d.path == f"{ROOT}/{path}"), None)
        if d is None:
            raise KeyError(f"{file}: found no dataset {path}")
        values = _solved(result, d.scales, result.read(path))
        return xr.DataArray(values, dims=d.scales, attrs=_about(d), name=path.replace("/", "_")).isel(at)


def dataset(result: Result) -> xr.Dataset:
    """The dataset of an open result file."""
    layout = result.layout
    variables = {name: xr.Variable(d.scales, values, _about(d)) for name, d, values in _plain(result)}
    for q in layout.quantities:
        if q.group == "maps" and q.by_model:
            values = np.stack([result.map(q.name, model) for model in MODELS], axis=-1)
            variables[q.name] = xr.Variable((*layout.names, "model"), values, _of(q))
    for d in layout.derived:
        scales = tuple(name.replace(".", "_") for name in d.axes)
        if not d.shape:
            about = {"units": d.units, "long_name": d.long_name, "definition": d.definition}
            variables[d.name] = xr.Variable(scales, result.derived(d.name), about)
    status = result.status  # last: rows that a run began anew meanwhile are missing now
    for variable in variables.values():
        _blank(variable, status, layout.names)
    flags = np.nan_to_num(variables["flags"].values).astype(np.int64)
    known = [flag for flag in Flag if flag & OF_FILE]
    marks = {"flag_masks": tuple(map(int, known)), "flag_meanings": tuple(flag.word for flag in known)}
    variables["flags"] = xr.Variable(layout.names, flags, variables["flags"].attrs | marks)
    codes = {"long_name": "state of the case", "units": "", "flag_values": tuple(range(len(STATES)))}
    variables["status"] = xr.Variable(layout.names, status.astype(np.int8), codes | {"flag_meanings": STATES})
    about = {"long_name": "why a case failed, or what to know about a result", "units": ""}
    variables["message"] = xr.Variable(layout.names, result.messages, about)
    return xr.Dataset(variables, _coordinates(result, variables), _attributes(result))


def _plain(result: Result) -> Iterator[tuple[str, Dataset, np.ndarray]]:
    """Name, description and values of every dataset that becomes one variable as it stands."""
    layout = result.layout
    models = {f"{q.name}/{model}" for q in layout.quantities if q.group == "maps" and q.by_model for model in MODELS}
    for d in layout.datasets:
        path = d.path.removeprefix(f"{ROOT}/")
        group, _, name = path.partition("/")
        if group in ("checksums", "patch", "derived", "map") or path in (*FIELDS, *models):
            continue
        if path in ("status/code", "status/message", "status/crc") or path.startswith("wrenches/"):
            continue
        yield name if name in (group, "attempts") else f"{PREFIX.get(group, group)}_{name}", d, result.read(path)


def _blank(variable: xr.Variable, status: np.ndarray, names: tuple[str, ...]) -> None:
    """No values where a case is not done; what has no value for each case by itself stays as it is."""
    if variable.dims[: len(names)] == names and variable.dtype.kind == "f":
        variable.values[status != DONE] = np.nan


def _solved(result: Result, scales: tuple[str, ...], values: np.ndarray) -> np.ndarray:
    if scales[: len(result.layout.names)] == result.layout.names:
        values[result.status != DONE] = np.nan
    return values


def _of(q: Any) -> dict[str, Any]:
    return {"units": q.unit, "long_name": q.label, "definition": q.definition}


def _about(d: Dataset) -> dict[str, Any]:
    """Attributes of a variable: the file's, with the label free of its unit."""
    found, units = dict(d.attributes), d.attributes.get("units", "")
    found["long_name"] = found["long_name"].removesuffix(f" [{units}]")
    group, _, name = d.path.removeprefix(f"{ROOT}/").partition("/")
    if group == "effects" and not name.endswith("_indicator"):
        effect, _, part = name.rpartition("_")
        words = EFFECTS[effect] if part == "level" else REASONS
        found |= {"flag_values": tuple(range(len(words))), "flag_meanings": words}
    found.pop("meaning", None)
    return found


def _coordinates(result: Result, variables: dict[str, Any]) -> dict[str, Any]:
    layout = result.layout
    found: dict[str, Any] = {
        name: xr.Variable(name, axis.values, {"units": axis.units, "long_name": axis.long_name})
        for name, axis in zip(layout.names, result.axes, strict=True)
    }
    found["label"] = xr.Variable(layout.names[-3:-1], result.labels, {"long_name": "name of the candidate"})
    known = {"finger": [*range(1, FINGERS + 1)], "model": [*MODELS], "component": [*XYZ], "component_2": [*XYZ]}
    used = {dim for variable in variables.values() for dim in variable.dims}
    found |= {name: values for name, values in known.items() if name in used}
    if "probe" in used:
        found |= {"probe": [*layout.probes], "variation": [*layout.variations]}
    return found


def _attributes(result: Result) -> dict[str, Any]:
    layout, scene = result.layout, result.scene_attributes
    return {
        "title": result.title, "file": str(result.path), "layout_version": layout.version, "digest": result.digest,
        "scene": result.scene, "scene_file": scene.get("file", ""),
        "overrides": tuple(filter(None, str(scene.get("overrides", "")).split("\n"))),
        "petsc_options": scene.get("petsc_options", ""), "definitions": result.definitions, "report": result.report,
        "provenance": result.sessions, "planar": layout.planar, "has": layout.has, "meshes": layout.meshes,
        "patches": layout.patches, "pad_faces": layout.front, "poses": not result.axes[-3].units,
        "derived": tuple(d.name for d in layout.derived),
    }  # fmt: skip
