"""The index of a folder of objects: one HDF5 table with a row for each, what holds it best or why nothing does.

It is written as a whole and renamed into place, so that a reader finds the old one or the new one. Every column is a
dataset over ``object``; xarray opens it as `open_index` does.
"""

import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from softjaw.study import messages
from softjaw.study.messages import OTHER_FILE, USAGE, StudyError, beside
from softjaw.study.result.hdf5 import StoredFile, opened
from softjaw.study.result.layout import PROGRAM
from softjaw.study.table import Row

DONE, SOME_FAILED, NO_GRASP, FAILED, REFUSED, STOPPED, MISSING = STATES = (
    "complete", "some cases failed", "no grasp", "failed", "refused", "not complete", "not begun",
)  # fmt: skip
ENDED = (DONE, SOME_FAILED, NO_GRASP, FAILED, REFUSED)  # states of objects that a run is through with
SOLVED = (DONE, SOME_FAILED)
INDEX, INDEX_VERSION = "index", 1  # name of its file, which no object's has


COLUMNS: dict[str, tuple[type, str, str]] = {  # type, SI unit and what it is
    "payload": (float, "kg", "mass that the best grasp holds in the worst direction, curved contact model"),
    "payload_error": (float, "1", "relative error of that payload: numerical, without uncertain inputs"),
    "opening": (float, "m", "distance of the pads' faces at first touch, best grasp"),
    "force": (float, "N", "normal force per finger of the best grasp"),
    "e_n": (float, "m", "eccentricity parameter of the best grasp, curved contact model"),
    "quality": (float, "1", "quality of the best grasp, curved contact model"),
    "best": (int, "", "number of the best grasp's candidate in the object's file, from 0; -1 where there is none"),
    "grasps": (int, "", "solved candidates that hold and do no harm at that force"),
    "cases": (int, "", "cases of the object: candidates x forces x points of a sweep"),
    "done": (int, "", "cases that are solved"),
    "failed": (int, "", "cases that failed"),
    "mass": (float, "kg", "mass of the object that its scene gives, also by a density"),
    "seconds": (float, "s", "time in the object's cases, on all ranks"),
    "preparing": (float, "s", "time until its grasps were sampled and planned, on one rank"),
    "state": (str, "", "one of: " + ", ".join(STATES)),
    "reason": (str, "", "why there is no grasp, or what speaks against it, or why cases failed"),
    "file": (str, "", "result file, relative to the index"),
    "mesh": (str, "", "mesh of the object"),
    "key": (str, "", "SHA-256 of the object's scene and mesh"),
}
BLANK: dict[type, Any] = {str: "", float: math.nan, int: -1}


def index_path(file: str | Path) -> Path | None:
    """The index that a folder or a file's name means; None for any other file; `StudyError` for a folder without."""
    path = Path(file)
    if path.is_dir():
        if not (path / f"{INDEX}.hdf").exists():
            raise StudyError(OTHER_FILE, f"{file}: no {INDEX}.hdf of a run of many objects; name a result file in it")
        return path / f"{INDEX}.hdf"
    return path if path.name == f"{INDEX}.hdf" else None


def one_file(file: str | Path) -> Path:
    """The path of a single result file; raises `StudyError` for a folder of objects."""
    if index_path(file):
        raise StudyError(USAGE, f"{file}: is a folder of objects; name one result file of it")
    return Path(file)


def blank_row(name: str, **values: Any) -> Row:
    """A row with nothing but what is given."""
    return {"object": name, **{name: BLANK[kind] for name, (kind, *_) in COLUMNS.items()}, "state": MISSING, **values}


def code_of(rows: Sequence[Row]) -> int:
    """The exit code of a run that ends with these rows; an object without a grasp is an answer."""
    states = {row["state"] for row in rows}
    if states & {MISSING, STOPPED}:
        return messages.STOPPED
    some = any(row["failed"] > 0 for row in rows)  # also of an object that has no grasp
    return messages.SOME_FAILED if some or states - {DONE, NO_GRASP} else messages.DONE


def write_index(path: Path, rows: Sequence[Row], attributes: Mapping[str, Any]) -> None:
    """Write the whole table; by one process."""
    with beside(path) as part, h5py.File(part, "w") as file:
        file.attrs.update({"program": PROGRAM, "index_version": INDEX_VERSION, **attributes})
        names = file.create_dataset("object", data=_texts([row["object"] for row in rows]))
        names.make_scale("object")
        for name, (kind, *_) in COLUMNS.items():
            values = [row[name] for row in rows]
            data = _texts(values) if kind is str else np.array(values, "f8" if kind is float else "i8")
            made = file.create_dataset(name, data=data)
            made.attrs.update(_about(name))
            made.dims[0].attach_scale(names)


def arrays_file(arrays: Mapping[str, Any]) -> bytes:
    """An HDF5 file of arrays, numbers and texts by path."""
    store = io.BytesIO()
    with h5py.File(store, "w") as file:
        for name, values in arrays.items():
            file[name] = values
    return store.getvalue()


def _about(name: str) -> dict[str, str]:
    return {"units": COLUMNS[name][1], "long_name": name, "definition": COLUMNS[name][2]}


def _texts(values: Sequence[str]) -> Any:
    return np.array(values, h5py.string_dtype())


def read_index(path: Path) -> tuple[list[Row], dict[str, Any]]:
    """Rows and attributes of an index."""
    with opened(path, "index of objects", _checked) as file:
        values: dict[str, list[Any]] = {"object": file.texts("object")}
        for name, (kind, *_) in COLUMNS.items():
            values[name] = file.texts(name) if kind is str else file.values(name).tolist()
        if len({len(column) for column in values.values()}) != 1:
            raise file.damaged("columns of different lengths", "run the scene again")
        return [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)], file.attributes()


def _checked(file: StoredFile) -> StoredFile:
    if file.attributes().get("index_version") != str(INDEX_VERSION):
        raise ValueError(f"its index has another version than {INDEX_VERSION}")
    return file


def open_index(path: Path) -> Any:
    """The index as an ``xarray.Dataset`` over ``object``."""
    import xarray as xr

    rows, attributes = read_index(path)
    variables = {name: ("object", [row[name] for row in rows], _about(name)) for name in COLUMNS}
    attributes["file"] = str(path)
    return xr.Dataset(variables, {"object": [row["object"] for row in rows]}, attributes)
