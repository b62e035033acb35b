"""The one reader: a result file as an ``xarray.Dataset`` with dimensions, coordinates, units and definitions.

Tables, report, view, figures, comparison, export, look-up and notebooks all read this. Reading needs neither MPI nor
PETSc, and works on a file that a run is still writing.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.flags import OF_FILE, Flag
from softjaw.study.messages import Problem
from softjaw.study.quantities import (
    BY_KEY,
    FINGERS,
    FORCE_RANGE,
    MISSING,
    MODELS,
    NUMERIC_MAPS,
    REALISATION,
    TABLE,
    Axis,
    Quantity,
)
from softjaw.study.result.derived import SOURCES, force_ranges
from softjaw.study.result.index import index_path, open_index
from softjaw.study.result.layout import DONE, VERSION
from softjaw.study.result.skeleton import UNFINISHED
from softjaw.study.result.store import Result, open_result
from softjaw.study.scene import Scene, SceneError, parse_scene
from softjaw.study.scene.model import file_digest
from softjaw.study.scene.sections import UPPER
from softjaw.study.scene.text import scene_table
from softjaw.study.units import in_si

if TYPE_CHECKING:
    import xarray as xr  # slow to load, and a run needs it at its end only

XYZ = ("x", "y", "z")
FIELDS = ("wall/place",)  # too large to be read with the rest
UNCERTAIN_MAPS = tuple(q.name for q in TABLE if q.group == "maps" and q.error and q.rank)


def open(file: str | Path) -> xr.Dataset:
    """A result file as a dataset, whole in memory; the file is closed.

    Every value is checked against its checksum. A case that failed or is not computed has NaN everywhere;
    ``status`` and ``message`` tell which and why. Contact patches and fields are read by `read_patch` and `read_field`.

    Parameters
    ----------
    file : path
        Result file (``.hdf``), finished or not; or a folder of objects, whose index is a row for each ``object``.

    Returns
    -------
    xarray.Dataset
        Dimensions: swept keys, ``station`` [m], ``angle`` [rad], ``normal_force`` [N], then where they apply ``finger``
        (1, 2), ``model`` (ccm, pcm, pcm_projected), ``component`` and others. Every variable has ``units``,
        ``long_name`` and ``definition``; the dataset's attributes hold scene, options and provenance.

    Raises
    ------
    StudyError
        The file cannot be read, is damaged, or is not a result file of this program.

    Examples
    --------
    >>> ds = open("results/smoke.hdf")
    >>> ds["e_n"].attrs["units"], ds["e_n"].sel(model="ccm").interp(normal_force=1.5).dims
    ('m', ('station', 'angle'))
    """
    if index := index_path(file):
        return open_index(index)
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
    import xarray as xr

    with open_result(file) as result:
        rows = xr.DataArray(np.arange(result.layout.rows).reshape(result.layout.shape), dims=result.layout.names)
        rows = rows.isel(_as_given(result) | at)
        faces = [result.patch(int(row)) for row in rows.values.ravel()] if result.layout.faces else []
        variables = {}
        for name in faces[0] if faces else ():
            values = np.stack([case[name] for case in faces]).reshape(rows.shape + faces[0][name].shape)
            # Rows that are not complete may hold what a killed run began to write.
            values[(result.status.ravel()[rows.values] != DONE)] = np.nan
            q = BY_KEY[f"patch/{name}"]
            variables[name] = xr.Variable((*rows.dims, *q.dims), values, _about(q))
        return xr.Dataset(variables, {"finger": np.arange(1, FINGERS + 1), "component": [*XYZ]} if variables else {})


def read_field(file: str | Path, path: str, **at: int | slice) -> xr.DataArray:
    """One of the large datasets that `open` leaves out (``wall/place``), as `read_patch`; `KeyError` if it has none."""
    import xarray as xr

    with open_result(file) as result:
        q = next((q for q in result.layout.quantities if q.key == path), None)
        if q is None:
            raise KeyError(f"{file}: found no dataset {path}")
        return xr.DataArray(_variable(result, q), name=q.variable).isel(_as_given(result) | at)


def _as_given(result: Result) -> dict[str, int | slice]:
    """The position of the scene's own inputs, where a study has samples of uncertain ones."""
    return {REALISATION: 0} if REALISATION in result.layout.names else {}


def dataset(result: Result) -> xr.Dataset:
    """The dataset of an open result file."""
    import xarray as xr

    layout = result.layout
    listed = [q for q in layout.quantities if q.group not in ("patch", "status") and q.key not in FIELDS]
    variables = {q.variable: _variable(result, q) for q in listed}
    for q in layout.derived:
        variables[q.name] = xr.Variable(q.dims, result.derived(q.name), _about(q))
    for name, values in (("attempts", result.read("status/attempts")), ("message", result.messages)):
        variables[name] = xr.Variable(layout.names, values, _about(BY_KEY[f"status/{name}"]))
    status = result.status  # last: rows that a run began anew meanwhile are missing now
    for variable in variables.values():
        if variable.dims[: len(layout.names)] == layout.names and variable.dtype.kind == "f":
            variable.values[status != DONE] = np.nan
    # Flags are stored as floats, which can be NaN; masks need integers.
    flags = np.nan_to_num(variables["flags"].values).astype(np.int64)
    known = [flag for flag in Flag if flag & OF_FILE]
    marks = {"flag_masks": tuple(map(int, known)), "flag_meanings": _joined(flag.word for flag in known)}
    variables["flags"] = xr.Variable(layout.names, flags, variables["flags"].attrs | marks)
    variables["status"] = xr.Variable(layout.names, status.astype(np.int8), _about(BY_KEY["status/code"]))
    # until the end of a run what is solved has its range at once
    if set(FORCE_RANGE) & variables.keys() and ((status == MISSING).any() or result.report == UNFINISHED):
        _fill_ranges(variables, status, _parsed(result.scene))
    ds = xr.Dataset(variables, _coordinates(result, variables), _attributes(result))
    return with_intervals(ds) if REALISATION in ds.dims else ds


def _fill_ranges(variables: dict[str, Any], status: NDArray[np.integer], scene: Scene) -> None:
    """Put the safe force ranges of what is solved so far in."""
    maps = {name: variables[name] for name in SOURCES if name in variables}
    curved = {name: v.values[..., 0] if "model" in v.dims else v.values for name, v in maps.items()}
    ranges = force_ranges(scene, curved, (status != MISSING).all(axis=-1))
    for name in ranges.keys() & variables.keys():  # files of earlier versions lack some
        variables[name].values[...] = ranges[name]


def scene_of(ds: xr.Dataset, index: Sequence[int] = ()) -> Scene:
    """The scene in a result file at a point of its sweep; `SceneError` if unreadable, or if its mesh has changed."""
    text = ds.attrs["scene"]
    scene = _scene_at(text, sweep_point(ds, index))
    with suppress(OSError):  # a mesh that is not there now
        if scene.object.shape == "mesh" and _digest_of(text, file_digest(scene.object.mesh)) != ds.attrs["digest"]:
            changed, remedy = f"{scene.object.mesh}, changed since", "put it back, or run the scene again"
            raise SceneError([Problem("scene", None, "object.mesh", changed, "the mesh that was solved", remedy)])
    return scene


def sweep_point(ds: xr.Dataset, index: Sequence[int] = ()) -> tuple[int, ...]:
    """Positions along the sweep of the scene of a point of a dataset, which may be a part of its file.

    ``index`` is along the dimensions of the dataset. Raises `ValueError`: a swept coordinate is lost.
    """
    if "point" in ds.attrs:
        return tuple(ds.attrs["point"])
    names = {x.attrs.get("long_name"): str(name) for name, x in ds.coords.items()}
    at, point = dict(zip(map(str, ds.status.dims), index, strict=False)), []
    for key, options in _parsed(ds.attrs["scene"]).sweep.items():
        if (name := names.get(key)) is None:
            raise ValueError(f"the dataset has lost {key}: take parts of it without drop=True")
        if name in ds.status.dims and name not in at:
            break
        value, texts = ds[name].values.ravel()[at.get(name, 0)], "options" in ds[name].attrs
        known = range(len(options)) if texts else [in_si(key, option) for option in options]
        point.append(int(np.abs(np.asarray(known) - value).argmin()))
    return tuple(point)


def swept_values(ds: xr.Dataset, index: Sequence[int] = ()) -> dict[str, Any]:
    """Values of the swept keys at a point of a dataset in the scene's words and units; none where these are lost."""
    if not scene_table(ds.attrs.get("scene", ""), "sweep"):
        return {}
    sweep = _parsed(ds.attrs["scene"]).sweep
    with suppress(ValueError):
        return {key: options[i] for (key, options), i in zip(sweep.items(), sweep_point(ds, index), strict=False)}
    return {}


@lru_cache(maxsize=64)
def _parsed(text: str) -> Scene:
    return parse_scene(text, check_files=False)


@lru_cache(maxsize=64)
def _digest_of(text: str, _mesh: str) -> str:
    """Digest of a scene while its mesh has this one."""
    return _parsed(text).digest


@lru_cache(maxsize=64)
def _scene_at(text: str, point: tuple[int, ...]) -> Scene:
    scene = _parsed(text)
    values = {key: options[i] for (key, options), i in zip(scene.sweep.items(), point, strict=False)}
    return scene.with_values(values) if scene.sweep else scene


def axes_of(ds: xr.Dataset) -> tuple[Axis, ...]:
    """The axes of the cases: swept keys, station, angle and normal force."""
    axes = ((str(name), ds[name]) for name in ds.status.dims)
    return tuple(Axis(name, x.values, x.units, x.long_name, x.attrs.get("options", ())) for name, x in axes)


def values_of(ds: xr.Dataset, name: str, model: str = "ccm") -> np.ndarray:
    """A map over the cases, of one friction model where it has several; NaN where a case is not done.

    What is known of a candidate only has the same value at every force.
    """
    variable = ds[name].sel(model=model, drop=True) if "model" in ds[name].dims else ds[name]
    if variable.dims != ds.status.dims:  # rarely, and xarray takes its time
        variable = variable.broadcast_like(ds.status).transpose(*ds.status.dims)
    return variable.values


def stated_error(ds: xr.Dataset, name: str) -> np.ndarray | None:
    """Stated error of a map (CCM) over the cases, in its unit; None where the file has none."""
    q = BY_KEY.get(f"maps/{name}")
    if name in FORCE_RANGE and f"{name}_error" in ds:
        return values_of(ds, f"{name}_error")
    if q is None or not q.error or q.of_error.name not in ds:
        return None
    return np.asarray(q.error_in_unit(values_of(ds, q.of_error.name), values_of(ds, name)))


def maps_in(ds: xr.Dataset) -> dict[str, str]:
    """Name and unit of every map but flags, and of what is derived for every case or all forces of a candidate."""
    names = [q.name for q in NUMERIC_MAPS if q.name in ds]
    over = ds.status.dims
    names += [name for name in ds.attrs["derived"].split() if name in ds and ds[name].dims in (over, over[:-1])]
    return {name: ds[name].attrs["units"] for name in names}


def _variable(result: Result, q: Quantity) -> xr.Variable:
    """A quantity of all cases."""
    import xarray as xr

    if q.group == "maps" and q.by_model:
        values = np.stack([result.read(f"{q.key}/{model}") for model in MODELS], axis=-1)
    else:
        values = result.read(q.key)
    if values.dtype.kind == "f":
        values[result.status != DONE] = np.nan
    return xr.Variable((*result.layout.names, *q.dims), values, _about(q))


def _about(q: Quantity) -> dict[str, Any]:
    """Attributes of a variable; codes list what they mean, as in the CF conventions."""
    codes = {"flag_values": tuple(range(len(q.meanings))), "flag_meanings": _joined(q.meanings)} if q.meanings else {}
    return {"units": q.unit, "long_name": q.label, "definition": q.definition, **codes}


def _joined(words: Iterable[str]) -> str:
    return " ".join(word.replace(" ", "_") for word in words)


def _coordinates(result: Result, variables: dict[str, Any]) -> dict[str, Any]:
    import xarray as xr

    layout = result.layout
    coordinates: dict[str, Any] = {}
    for axis in result.axes:
        about = {"units": axis.units, "long_name": axis.long_name} | ({"options": axis.options} if axis.options else {})
        coordinates[axis.name] = xr.Variable(axis.name, axis.values, about)
    coordinates["label"] = xr.Variable(layout.names[-3:-1], result.labels, {"long_name": "name of the candidate"})
    known = {"finger": [*range(1, FINGERS + 1)], "model": [*MODELS], "component": [*XYZ], "component_2": [*XYZ]}
    used = {dim for variable in variables.values() for dim in variable.dims}
    coordinates |= {name: values for name, values in known.items() if name in used}
    return coordinates


def _attributes(result: Result) -> dict[str, Any]:
    """Attributes of the dataset: numbers, texts and flat arrays, which NetCDF can store too."""
    layout, header = result.layout, result.header
    return {
        "title": result.title, "file": str(result.path), "layout_version": VERSION, "digest": result.digest,
        "scene": result.scene, "scene_file": header.scene_file, "overrides": "\n".join(header.overrides),
        "petsc_options": header.petsc_options, "definitions": result.definitions, "report": result.report,
        "provenance": json.dumps(result.sessions), "has": ", ".join(layout.has),
        "patches": int("patch/pressure" in {c.key for c in layout.columns}), "poses": int(not result.axes[-3].units),
        "derived": " ".join(q.name for q in layout.derived),
        "object_rotation": np.eye(3).ravel(), "object_origin": np.zeros(3), "rejected": np.zeros(0),
        **{name: np.ravel(values) for name, values in header.about.items()},
    }  # fmt: skip


def other_levels(count: int, k: int) -> list[int]:
    """Force levels of ``count`` whose payload is reported beside that of the ``k``-th, which is shown."""
    return sorted({0, (count - 1) // 2, count - 1} - {k})


def half_width(changes: np.ndarray) -> np.ndarray:
    """Within which 95 % of the changes by samples lie along the last axis, to one side or both; NaN where one is NaN.

    >>> float(half_width(np.arange(-39.0, 41.0, 2.0)))
    38.0
    """
    # hazen: of n samples that take the middles of n intervals of equal probability, as the scene's do
    return np.asarray(np.quantile(np.abs(changes), 2 * UPPER - 1, axis=-1, method="hazen"))


def with_intervals(ds: xr.Dataset) -> xr.Dataset:
    """The cases with the scene's own inputs; samples of the uncertain ones become an interval of each main map.

    ``NAME_interval`` is its half-width (CCM) about the value, ``NAME_samples`` has the values, whose last dimension is
    `REALISATION`; NaN of a sample on another mesh, while a round is solved or where that failed.
    """
    given, samples = ds.isel({REALISATION: 0}, drop=True), ds.isel({REALISATION: slice(1, None)})
    alike = samples["pad_elements"] == given["pad_elements"] if "pad_elements" in ds else True
    names = [name for name in UNCERTAIN_MAPS if name in ds]
    for name in names:
        values = samples[name].sel(model=MODELS[0], drop=True) if "model" in samples[name].dims else samples[name]
        values = values.where(alike).transpose(*given.status.dims, REALISATION)
        about = {"units": ds[name].attrs["units"], "long_name": f"half-width of the 95 % interval of {name}"}
        text = f"By how much {name} (CCM) of 95 % of the samples of uncertain inputs differs from its value."
        changes = values.values - values_of(given, name)[..., None]
        given[f"{name}_interval"] = (given.status.dims, half_width(changes), about | {"definition": text})
        given[f"{name}_samples"] = values
    given.attrs["derived"] += "".join(f" {name}_interval" for name in names)
    return given
