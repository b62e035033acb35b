"""The door to result files: creates a result file, fills it in parallel, reads it without trusting it.

Crash safety: one process writes the whole skeleton, closes it, and renames it into place; after that all ranks do
nothing but independent writes to allocated space, in the order values, checksum, state. A killed process can
therefore lose the row it was writing, and nothing else: a row that is marked done but does not match its checksum is
solved again.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from friction.motion import fibonacci_twists
from study import grid
from study.datasets import FIRST_SEEN
from study.exits import CANNOT_WRITE, OTHER_FILE, StudyError
from study.guarded import GuardedFile, opened, reason
from study.layout import (
    DONE,
    FAILED,
    LABEL,
    MISSING,
    PROGRAM,
    REPORT,
    ROOT,
    SESSION,
    SESSIONS,
    VERSION,
    Dataset,
    Header,
    Layout,
)
from study.plots import groups
from study.provenance import SAMPLING
from study.quantity import MODELS
from study.reading import Result
from study.record import blank, crc32, text_bytes
from study.vtkhdf import head

LIBVER = ("earliest", "v110")
TEXT = h5py.string_dtype("utf-8")
CODES = np.dtype("u1")
TEXTS = {
    "title": "name of the object or of the scene",
    "scene": "the scene with all settings, as TOML",
    "definitions": "what every quantity means",
    "report": "best grasps, failures with their reasons, how to read the file",
}
UNFINISHED = "Not all cases of this study are solved yet; this text and /VTKHDF are written at its end."


# --- creation: one process, before any solve ---------------------------------------------------------------------


def create(path: Path, layout: Layout, header: Header) -> None:
    """Write the skeleton beside ``path`` and rename it into place; raise `StudyError` if there is no room for it."""
    _reserve(path, layout.nbytes)
    part = path.with_name(path.name + ".part")
    try:
        with h5py.File(part, "w", libver=LIBVER) as file:
            _write_skeleton(file, layout, header)
        with part.open("r+b") as handle:
            os.posix_fallocate(handle.fileno(), 0, part.stat().st_size)
            os.fsync(handle.fileno())
    except (OSError, ValueError, RuntimeError) as error:  # h5py has all three for a write that failed
        part.unlink(missing_ok=True)
        if not isinstance(error, OSError) and "write" not in str(error):
            raise
        raise StudyError(CANNOT_WRITE, f"{path}: cannot be created: {reason(error)}") from error
    part.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    os.fsync(folder)
    os.close(folder)


def _reserve(path: Path, need: int) -> None:
    free = shutil.disk_usage(path.parent).free
    if free < need:
        sizes = f"needs {need / 1e6:.1f} MB, only {free / 1e6:.1f} MB are free there"
        raise StudyError(CANNOT_WRITE, f"{path}: {sizes}; choose another place with -o")
    trial = path.with_name(path.name + ".part")
    try:
        with trial.open("wb") as handle:  # quotas and file size limits show up here, not in the free space
            os.posix_fallocate(handle.fileno(), 0, need)
    except OSError as error:
        raise StudyError(CANNOT_WRITE, f"{path}: {need / 1e6:.1f} MB cannot be reserved: {error.strerror}") from error
    finally:
        trial.unlink(missing_ok=True)


def _write_skeleton(file: h5py.File, layout: Layout, header: Header) -> None:
    file.attrs.update(NX_class="NXroot", default=ROOT[1:], program=PROGRAM, layout_version=VERSION)
    study = file.create_group(ROOT)
    study.attrs.update(NX_class="NXentry", default="map", options=layout.options(), title=header.title)
    _write_attribute(study, "axes", list(layout.names))
    for name, attributes in groups(layout).items():
        group = study.create_group(name)
        for key, value in attributes.items():
            _write_attribute(group, key, value)
    for name, axis in zip(layout.names, layout.axes, strict=True):
        scale = study["axes"].create_dataset(name, data=np.asarray(axis.values, "<f8"))
        long_name = f"{axis.long_name} [{axis.units}]" if axis.units else axis.long_name
        scale.attrs.update(units=axis.units, long_name=long_name, scene_key=axis.name)
        scale.make_scale(name)
    for name, length in layout.counters.items():
        count = study["axes"].create_dataset(name, data=np.arange(length, dtype="<i4"))
        count.attrs.update(units="", long_name=f"number of the {name.removesuffix('_2').replace('_', ' ')}")
        count.make_scale(name)
    for dataset in layout.datasets:
        _create_dataset(file, dataset)
    _write_texts(study, layout, header)
    if layout.grid:
        _write_grid(file, layout, header)


def _write_grid(file: h5py.File, layout: Layout, header: Header) -> None:
    root = file.create_group(grid.PATH)
    root.attrs["about"] = f"{header.title}. {grid.ABOUT}"
    head(root, layout.shape[-1])
    for dataset in layout.grid:
        file.require_group(dataset.path.rpartition("/")[0])
        _create_dataset(file, dataset)
    for path, values in grid.skeleton(layout, header.surface).items():
        file[path][...] = values


def _write_texts(study: h5py.Group, layout: Layout, header: Header) -> None:
    texts = {"title": header.title, "scene": header.scene, "definitions": layout.definitions()}
    for name, text in texts.items():
        data = text.encode() or b" "
        study.create_dataset(name, data=np.array(data, h5py.string_dtype("utf-8", len(data))))
    study.create_dataset("report", data=_report(UNFINISHED))
    for name, label in TEXTS.items():
        study[name].attrs["long_name"] = label
    study["provenance"].attrs["sampling"] = SAMPLING
    study["scene"].attrs.update(digest=header.digest, file=header.scene_file, petsc_options=header.petsc_options)
    study["scene"].attrs["overrides"] = "\n".join(header.overrides)
    sessions = study["provenance"].create_dataset("sessions", data=np.zeros(SESSIONS, SESSION))
    sessions.attrs["long_name"] = "one row for each time the study was started: program, machine, start, end"
    _attach_scales(sessions, ["session"])
    labels = np.zeros(int(np.prod(layout.shape[-3:-1])), h5py.string_dtype("utf-8", LABEL))
    labels[: len(header.labels)] = [text_bytes(label, LABEL) for label in header.labels]
    named = study["candidates"].create_dataset("label", data=labels.reshape(layout.shape[-3:-1]))
    named.attrs["long_name"] = "name of the candidate in the scene"
    _attach_scales(named, layout.names[-3:-1])
    if layout.sampled:
        study["wrenches/motion"][...] = fibonacci_twists(layout.samples, 1.0)
        study["wrenches/candidate"][...] = layout.sampled
    if layout.probes:
        study["probes/candidate"][...] = layout.probes


def _report(text: str) -> np.ndarray:
    """Text of fixed length, filled up with blanks: zeros would be shown by tools that print it."""
    data = text.encode()[:REPORT].decode(errors="ignore").encode()
    return np.array(data.ljust(REPORT), h5py.string_dtype("utf-8", REPORT))


def _create_dataset(file: h5py.File, dataset: Dataset) -> None:
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_layout(h5py.h5d.CONTIGUOUS)
    plist.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plist.set_fill_time(h5py.h5d.FILL_TIME_ALLOC)
    strings = dataset.dtype.kind == "S"
    if not strings:  # text is filled with zero bytes anyway
        plist.set_fill_value(np.array(dataset.fill, dataset.dtype))
    dtype = h5py.string_dtype("utf-8", dataset.dtype.itemsize) if strings else dataset.dtype
    space = h5py.h5s.create_simple(dataset.shape)
    h5py.h5d.create(file.id, dataset.path.encode(), h5py.h5t.py_create(dtype, logical=True), space, plist)
    made = file[dataset.path]
    for key, value in dataset.attributes.items():
        _write_attribute(made, key, value)
    _attach_scales(made, dataset.scales)


def _attach_scales(dataset: h5py.Dataset, names: Sequence[str]) -> None:
    # xarray and NeXus viewers look for the scales beside the data: a second hard link puts them there.
    for i, name in enumerate(names):
        scale = dataset.file[f"{ROOT}/axes/{name}"]
        if name not in dataset.parent:
            dataset.parent[name] = scale
        dataset.dims[i].attach_scale(scale)
        dataset.dims[i].label = name


def _write_attribute(node: Any, key: str, value: Any) -> None:
    if isinstance(value, list):
        node.attrs.create(key, np.array(value, object), dtype=TEXT)
    else:
        node.attrs[key] = value


# --- checks of an existing file: one process -----------------------------------------------------------------------


def verify(path: Path, layout: Layout, header: Header) -> None:
    """Raise `StudyError` unless ``path`` can be written and was made from this scene with this layout."""
    from study.scene.difference import differences

    os.close(os.open(path, os.O_RDWR))
    with open_result(path) as result:
        if result.digest != header.digest:
            text = (
                f"{path}: made from another scene ({result.digest[:8]}, this one is {header.digest[:8]}:"
                f" {differences(result.scene, header.scene)}); choose another file with -o, or move this one away"
            )
            raise StudyError(OTHER_FILE, text)
        # How the object was cut into triangles may differ in the last bit on another machine; the file's own counts.
        same = replace(layout, surface=result.layout.surface)
        old = result.version != str(VERSION)
        if old or result.layout.shape != layout.shape or result.layout.options() != same.options():
            text = f"{path}: made by a version that stored other values; it can be read, but not gone on with"
            raise StudyError(OTHER_FILE, f"{text}: choose another file with -o")
        for dataset in (*result.layout.datasets, *result.layout.grid):
            if result.file.checked(dataset.path, dataset.shape, dataset.dtype).chunks is not None:
                text = f"{path}: was repacked and cannot be written in parallel any more; 'softjaw repair' undoes that"
                raise StudyError(OTHER_FILE, text)


def torn_rows(path: Path, layout: Layout) -> list[int]:
    """Rows that are marked done but do not match their checksum."""
    return [row for row, state, values in rows_of(path, layout) if state == DONE and values is None]


def rows_of(path: Path, layout: Layout) -> Iterator[tuple[int, int, list[Any] | None]]:
    """Every row that is done or failed: number, state, and values, or None where they do not match their checksum."""
    expected = {d.path: d for d in layout.datasets}
    with h5py.File(path, "r") as file:
        guarded = GuardedFile(path, file)
        found = {at: guarded.checked(at, d.shape, d.dtype) for at, d in expected.items()}
        views = [_mapped(path, found[c.path], c.dtype) for c in layout.columns]
        codes, crc = (guarded.values(found[f"{ROOT}/status/{name}"]).ravel() for name in ("code", "crc"))
    for row in np.flatnonzero(codes != MISSING):
        pairs = zip(views, layout.places(row), strict=True)
        values = [None if place is None else view[place] for view, place in pairs]
        yield int(row), int(codes[row]), values if crc32(layout, row, values) == crc[row] else None


def _mapped(path: Path, dataset: h5py.Dataset, dtype: np.dtype) -> np.ndarray:
    if dataset.size == 0:
        return np.empty(dataset.shape, dtype)
    if dataset.chunks:  # a file that was repacked
        return dataset[()].astype(dtype)
    return np.memmap(path, dtype, "r", dataset.id.get_offset(), dataset.shape)


# --- parallel writing ----------------------------------------------------------------------------------------------


class ResultWriter:
    """A result file open on all ranks of ``comm``; opening and closing are collective, everything else is not.

    With ``comm = None`` this process has it alone and needs no MPI.
    """

    def __init__(self, path: Path, layout: Layout, comm: Any) -> None:
        if comm is not None and not h5py.get_config().mpi:
            raise StudyError(CANNOT_WRITE, "this h5py was built without MPI; 'softjaw doctor' says how to cure that")
        self.path, self.layout = path, layout
        shared = {} if comm is None else {"driver": "mpio", "comm": comm}
        self._file = h5py.File(path, "r+", libver=LIBVER, **shared)
        self._columns = [self._file[c.path] for c in layout.columns]
        keys = [c.key for c in layout.columns]
        self._maps = {keys.index(f"maps/{name}/{MODELS[0]}"): self._file[f"{ROOT}/map/{name}"] for name in FIRST_SEEN}
        self._code, self._crc, self._attempts = (self._file[f"{ROOT}/status/{n}"] for n in ("code", "crc", "attempts"))
        self._sessions = self._file[f"{ROOT}/provenance/sessions"]
        self.session = 0

    def codes(self) -> np.ndarray:
        """State of every row, ``(rows,)``."""
        return self._code[()].ravel()

    def attempts(self) -> np.ndarray:
        """How often every row was begun without an end, ``(rows,)``."""
        return self._attempts[()].ravel()

    def count_attempt(self, row: int, change: int = 1) -> None:
        """Note that a case is about to be solved (or, with -1, that it was given up in an orderly way)."""
        index = self._index(row)
        self._attempts[index] = min(max(int(self._attempts[index]) + change, 0), 255)

    def forget(self, row: int) -> None:
        """Make a failed or torn row a missing one that was never tried."""
        self._code[self._index(row)] = MISSING
        self._attempts[self._index(row)] = 0

    def write(self, row: int, values: Sequence[np.ndarray]) -> None:
        """Store a solved case; ``values`` as from ``study.record.record``."""
        self._store(row, values, DONE)

    def fail(self, row: int, message: str) -> None:
        """Store why a case has no result."""
        self._store(row, blank(self.layout, message), FAILED)

    def copy(self, row: int, values: Sequence[np.ndarray], state: int) -> None:
        """Store a row as another file has it."""
        self._store(row, values, state)

    def _store(self, row: int, values: Sequence[np.ndarray], state: int) -> None:
        index = self._index(row)
        if self._code[index] == DONE:
            raise ValueError(f"row {row} is done already and must not be written again")
        places = self.layout.places(row)
        for column, dataset, value, place in zip(self.layout.columns, self._columns, values, places, strict=True):
            if place is None:
                continue
            if column.dtype.kind == "S":
                dataset[index] = value.astype(dataset.dtype)  # with its encoding
            elif value.size:
                _write_block(dataset, place, value)
        for position, dataset in self._maps.items():
            dataset[tuple(index[i] for i in self.layout.seen)] = values[position]
        self._crc[index] = crc32(self.layout, row, values)
        self._code[index] = state

    def _index(self, row: int) -> tuple[int, ...]:
        return tuple(int(i) for i in np.unravel_index(row, self.layout.shape))

    def read(self, path: str, index: Any = ()) -> np.ndarray:
        """Any dataset, named below ``/study`` (``e_n/curved``) or from the root, or what it has at an index."""
        return self._file[path if path.startswith("/") else f"{ROOT}/{path}"][index]

    def result(self) -> Result:
        """The same file for reading; not to be closed by itself."""
        return Result(self.path, GuardedFile(self.path, self._file))

    def fill(self, path: str, start: int, values: np.ndarray) -> None:
        """Write rows of a dataset that is no part of a case's row, from ``start`` on; by one rank, after all rows."""
        self._file[path][start : start + len(values)] = values

    def write_report(self, text: str) -> None:
        """Write the report, cut where it is too long; by one rank, after all rows."""
        self._file[f"{ROOT}/report"][()] = _report(text)

    def write_derived(self, name: str, values: Any) -> None:
        """Fill a derived dataset; by one rank, after all rows."""
        dataset = self._file[f"{ROOT}/derived/{name}"]
        dataset[...] = np.broadcast_to(np.asarray(values, dataset.dtype), dataset.shape)

    def begin_session(self, **fields: Any) -> None:
        """Add a row to the provenance; by one rank."""
        used = self._sessions[()]["start"] != b""
        self.session = min(int(used.sum()), len(used) - 1)
        self._sessions[self.session] = np.zeros((), SESSION)
        self.update_session(**fields)

    def update_session(self, **fields: Any) -> None:
        """Change fields of this run's row of the provenance; by one rank."""
        row = self._sessions[self.session]
        for name, value in fields.items():
            kind = SESSION[name]
            row[name] = text_bytes(value, kind.itemsize) if kind.kind == "S" else value
        self._sessions[self.session] = row

    def close(self) -> None:
        """Close on all ranks."""
        self._file.close()


def _write_block(dataset: h5py.Dataset, index: tuple[int, ...], value: np.ndarray) -> None:
    """``dataset[index] = value`` for numbers, without what h5py spends on understanding the index."""
    count = (1,) * len(index) + value.shape
    place = dataset.id.get_space()
    place.select_hyperslab(index + (0,) * value.ndim, count)
    dataset.id.write(h5py.h5s.create_simple(count), place, np.ascontiguousarray(value).reshape(count))


# --- reading, without MPI ------------------------------------------------------------------------------------------


def open_result(path: str | Path) -> Result:
    """A result file for reading, also while a run is writing it; raise `StudyError` if it is none."""
    path = Path(path)
    return opened(path, "result file", lambda file: Result(path, file), _go_through)


def _go_through(result: Result) -> None:
    """Touch whatever readers of a result may read, however much of it is broken."""
    for dataset in (*result.layout.datasets, *result.layout.grid):
        with suppress(StudyError):
            found = result.file.plain(dataset.path)
            if found.chunks:  # data that have to be unpacked
                result.file.values(found)
    for name in ("scene", "definitions", "report"):
        with suppress(StudyError):
            getattr(result, name)
