"""A new result file: everything but the values, with all its space; one process makes it before any solve.

A finished file with more stations is a new one into which what is solved is copied.

NeXus viewers find a plot by the attributes of the groups: signals, axes and the slice that is shown first. ``map`` is
where they open: two maps at the largest force, which viewers that always draw the last two axes show at once.
"""

import os
import shutil
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from softjaw.study.messages import CANNOT_WRITE, StudyError, beside, remove
from softjaw.study.quantities import BY_KEY, DEFINITIONS, FIRST, MODELS
from softjaw.study.result import checksums
from softjaw.study.result.datasets import CLOSING_SUMS, described
from softjaw.study.result.hdf5 import StoredFile
from softjaw.study.result.layout import (
    MOST_SESSIONS,
    PROGRAM,
    REPORT_BYTES,
    ROOT,
    SESSION,
    VERSION,
    Dataset,
    Header,
    Layout,
)
from softjaw.study.result.store import open_result
from softjaw.study.table import with_unit
from softjaw.study.units import shown_text

HDF5_VERSIONS = ("v108", "v110")  # v110 would mark a file as open for writing, and a killed run could not resume
PACKED_VERSIONS = ("v110", "v110")  # of a file that nobody writes to: an index of chunks takes 5 kB less for a dataset
TEXT = h5py.string_dtype("utf-8")
SESSION_ROWS, REPORT = f"{ROOT}/provenance/sessions", f"{ROOT}/report"
CHUNK_BYTES, DEFLATE_LEVEL = 2**20, 4
# What is filled again once nothing is missing.
NOT_COPIED = (f"{ROOT}/derived/", CLOSING_SUMS)
TEXTS = {
    "title": "name of the object or of the scene",
    "scene": "the scene with all settings, as TOML",
    "layout": "axes, and what is stored over them, as JSON",
    "header": "where the scene comes from, the names of its candidates, and the place of its object's frame, as JSON",
    "definitions": "friction models, and values that are not there; every dataset has its own definition",
    "report": "best grasps, failures with their reasons, how to read the file",
}
CUT = " ..."  # at the end of a text that was too long
ROUND_COMPLETE = "round complete"  # why a session ended that the next one continues
UNFINISHED = "Not all cases of this study are solved yet; this text is written at its end."


def create(path: Path, layout: Layout, header: Header, *, packed: bool = False) -> None:
    """Write the skeleton beside ``path`` and rename it into place; raise `StudyError` if there is no room for it.

    What is ``packed`` is for reading: ranks cannot write to it independently of each other.
    """
    part = path.with_name(path.name + ".part")
    if not packed:  # space first: HDF5 crashes where it can write no more, and a study shall not find out after hours
        _reserve(path, part, layout.nbytes)
    with beside(path, part=part):
        with h5py.File(part, "w", libver=PACKED_VERSIONS if packed else HDF5_VERSIONS) as file:
            _write_skeleton(file, layout, header, packed)
        # Opened anew: the sums are of what a reader will find in the file.
        with h5py.File(part, "r+", libver=HDF5_VERSIONS) as file:
            file[ROOT].attrs.modify("checksum", np.uint32(checksums.of_header(StoredFile(part, file), layout)))
            for i, name in enumerate(layout.closing):
                file[CLOSING_SUMS][i] = checksums.of_array(file[f"{ROOT}/{name}"][()])
        if not packed:  # blocks that exist now cannot be missing when a rank writes
            with part.open("r+b") as handle:
                os.posix_fallocate(handle.fileno(), 0, part.stat().st_size)


def rewrite(path: Path, layout: Layout, header: Header, *, packed: bool = False) -> None:
    """Replace a file by one with the stations of ``layout``, among which are all of its own; by one process.

    The old file has its name until the new one is whole and on disk, so that a kill at any time leaves one of them.
    Rows are copied with their checksums: a torn one stays torn, and is solved again. What is filled once nothing is
    missing is copied into a packed file only: another one is about to change.
    """
    with beside(path, part=path.with_name(path.name + ".new")) as new:
        create(new, layout, header, packed=packed)
        with open_result(path, unchecked=True) as old, h5py.File(new, "r+", libver=HDF5_VERSIONS) as file:
            stations = _places(old.layout, layout)
            left_out = () if packed else NOT_COPIED
            known = {d.path for d in old.layout.datasets}
            for dataset in (d for d in layout.datasets if d.path in known and not d.path.startswith(left_out)):
                values = old.file.values(dataset.path)
                target = file[dataset.path]
                target[...] = _spread(values, dataset, stations).astype(target.dtype)  # texts with their encoding
            for name in (SESSION_ROWS, *[REPORT] * packed):
                file[name][...] = old.file.values(name)


def _places(old: Layout, new: Layout) -> np.ndarray:
    """Where the stations of the old file stand in the new one."""
    before, now = (np.asarray(layout.axes[-3].values) for layout in (old, new))
    stations = np.searchsorted(now, before)
    if not np.array_equal(now[np.minimum(stations, len(now) - 1)], before):
        raise ValueError("a station of the file is not among those of its scene")
    return stations


def _spread(values: np.ndarray, dataset: Dataset, stations: np.ndarray) -> np.ndarray:
    """The values at their stations in the new shape, and the dataset's fill value elsewhere."""
    if "station" not in dataset.scales:
        return values
    spread = np.full(dataset.shape, dataset.fill, dataset.dtype)
    spread[(*[slice(None)] * dataset.scales.index("station"), stations)] = values
    return spread


def _reserve(path: Path, part: Path, need: int) -> None:
    """Try whether there is room; quotas and file size limits show up here, not in the free space."""
    try:
        with part.open("wb") as handle:
            os.posix_fallocate(handle.fileno(), 0, need)
    except OSError as error:
        free = shutil.disk_usage(path.parent).free
        text = f"{path}: cannot be written ({error.strerror}): needs {need / 1e6:.1f} MB, {free / 1e6:.1f} MB are free"
        raise StudyError(CANNOT_WRITE, f"{text}; make room, or choose another place with -o") from error
    finally:
        remove(part)


def _write_skeleton(file: h5py.File, layout: Layout, header: Header, packed: bool) -> None:
    file.attrs.update(NX_class="NXroot", default=ROOT[1:], program=PROGRAM, layout_version=VERSION)
    study = file.create_group(ROOT)
    study.attrs.update(NX_class="NXentry", default="map", title=header.title)
    study.attrs.create("checksum", 0, dtype="<u4")  # has its place here, at the start, before its value is known
    for name, attributes in groups(layout).items():
        group = study.create_group(name)
        for key, value in attributes.items():
            _write_attribute(group.id, key, value)
    for axis, kind in [*((axis, "<f8") for axis in layout.axes), *((axis, "<i4") for axis in layout.counters)]:
        scale = study["axes"].create_dataset(axis.name, data=axis.values, dtype=kind)
        scale.attrs.update(units=axis.units, long_name=with_unit(axis.long_name, axis.units))
        if axis.options:
            _write_attribute(scale.id, "options", list(axis.options))
        scale.make_scale(axis.name)
    for dataset in layout.datasets:
        _create_dataset(file, dataset, packed)
    _link_maps(study, layout)
    _write_texts(study, layout, header, packed)
    views = {f"{ROOT}/map/{name}": tuple(layout.names[i] for i in layout.shown) for name in FIRST}
    _attach_scales(file, {d.path: d.scales for d in layout.datasets} | views | {SESSION_ROWS: ("session",)})


def _write_texts(study: h5py.Group, layout: Layout, header: Header, packed: bool) -> None:
    texts = {"title": header.title, "scene": header.scene, "definitions": DEFINITIONS}
    texts |= {"layout": layout.text(), "header": header.text()}
    for name, text in texts.items():
        # HDF5 has no fixed-length strings of length 0.
        data = text.encode() or b" "
        study.create_dataset(name, data=np.array(data, h5py.string_dtype("utf-8", len(data))))
    study.create_dataset("report", data=report_bytes(UNFINISHED))
    for name, label in TEXTS.items():
        study[name].attrs["long_name"] = label
    how = {"compression": DEFLATE_LEVEL} if packed else {}
    sessions = study["provenance"].create_dataset("sessions", data=np.zeros(MOST_SESSIONS, SESSION), **how)
    sessions.attrs["long_name"] = "one row for each time the study was started: program, machine, start, end"


def text_bytes(text: str, length: int) -> bytes:
    """UTF-8 of at most ``length`` bytes, on one line; what is too long ends after a whole word.

    >>> text_bytes("the pad leaves the object", 20)
    b'the pad leaves ...'
    """
    line = " ".join(text.split())
    if len(line.encode()) <= length:
        return line.encode()
    short = line.encode()[: length - len(CUT)].decode(errors="ignore")
    return ((short.rpartition(" ")[0] or short) + CUT).encode()


def report_bytes(text: str) -> np.ndarray:
    """Text of fixed length, filled up with blanks: zeros would be shown by tools that print it."""
    data = text.encode()[:REPORT_BYTES].decode(errors="ignore").encode()
    return np.array(data.ljust(REPORT_BYTES), h5py.string_dtype("utf-8", REPORT_BYTES))


def _create_dataset(file: h5py.File, dataset: Dataset, packed: bool) -> None:
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    if not packed:  # contiguous and allocated at once: only so can ranks write independently of each other
        plist.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    # Filled now: a case that is never written reads as not computed, not as what the disk held.
    plist.set_fill_time(h5py.h5d.FILL_TIME_ALLOC)
    strings = dataset.dtype.kind == "S"
    dtype = h5py.string_dtype("utf-8", dataset.dtype.itemsize) if strings else dataset.dtype
    fill = None if strings else dataset.fill  # text is filled with zero bytes anyway
    how = {"chunks": _chunk(dataset), "shuffle": True, "compression": DEFLATE_LEVEL} if packed else {}
    made = file.create_dataset(
        dataset.path, dataset.shape, dtype, dcpl=plist, fillvalue=fill, track_times=False, **how
    )  # fmt: skip
    for key, value in dataset.attributes.items():
        # of fixed length: texts of any length stand elsewhere in the file, 40 kB more in all
        text = value.encode()
        fixed = np.array(text, h5py.string_dtype("utf-8", len(text))) if packed and text else value
        _write_attribute(made.id, key, fixed)


def _chunk(dataset: Dataset) -> tuple[int, ...]:
    """Shape of the blocks in which a dataset is packed: whole along the last dimensions."""
    chunk = list(dataset.shape)
    for axis in range(len(chunk)):
        rest = int(np.prod(chunk[axis + 1 :])) * dataset.dtype.itemsize
        chunk[axis] = min(chunk[axis], max(CHUNK_BYTES // rest, 1))
        if chunk[axis] > 1:
            break
    return tuple(chunk)


def _link_maps(study: h5py.Group, layout: Layout) -> None:
    """``map``: what viewers open at, as views of the maps themselves; no value stands in the file twice."""
    at = [int(i) if i != "." else slice(None) for i in view_slice(layout)]
    for name in FIRST:
        values = study[f"{name}/{MODELS[0]}"]
        view = h5py.VirtualLayout(tuple(layout.shape[i] for i in layout.shown), values.dtype)
        view[...] = h5py.VirtualSource(".", values.name, values.shape)[tuple(at)]
        made = study["map"].create_virtual_dataset(name, view, fillvalue=np.nan)
        made.attrs["interpretation"] = ("spectrum", "image")[len(layout.shown) - 1]
        made.attrs.update(described(BY_KEY[f"maps/{name}"], f"maps/{name}/{MODELS[0]}"))


def _attach_scales(file: h5py.File, scales: Mapping[str, Sequence[str]]) -> None:
    """Attach the scales, named for each dataset, all at once: HDF5 by itself writes their lists anew for each."""
    axes = {name: file[f"{ROOT}/axes/{name}"] for name in dict.fromkeys(chain.from_iterable(scales.values()))}
    of_axis = {name: np.array([axis.ref], h5py.ref_dtype) for name, axis in axes.items()}
    users: dict[str, list[Any]] = {name: [] for name in axes}
    for path, names in scales.items():
        dataset, parent = h5py.h5d.open(file.id, path.encode()), file[path.rpartition("/")[0]]
        references = np.empty(len(names), h5py.vlen_dtype(h5py.ref_dtype))
        for i, name in enumerate(names):
            # xarray and NeXus viewers look for the scales beside the data: a second hard link puts them there.
            if name not in parent:
                parent[name] = axes[name]
            references[i] = of_axis[name]
            users[name].append((h5py.h5r.create(file.id, path.encode(), h5py.h5r.OBJECT), i))
        _write_attribute(dataset, "DIMENSION_LIST", references)
    for name, listed in users.items():
        kind = [("dataset", h5py.ref_dtype), ("dimension", "<i4")]
        _write_attribute(axes[name].id, "REFERENCE_LIST", np.array(listed, kind))


def _write_attribute(node: Any, key: str, value: Any) -> None:
    """Make an attribute of a text, a list of texts or an array, in a fifth of the time that h5py itself takes."""
    values = value if isinstance(value, np.ndarray) else np.array(value, TEXT)
    kind, space = h5py.h5t.py_create(values.dtype, logical=True), h5py.h5s.create_simple(values.shape)
    h5py.h5a.create(node, key.encode(), kind, space).write(values, h5py.h5t.py_create(values.dtype))


def view_slice(layout: Layout) -> list[str]:
    """Which axes a viewer shows first (``.``) and where it stands on the others: the highest force, else 0."""
    last = len(layout.shape) - 1
    return ["." if i in layout.shown else str(n - 1 if i == last else 0) for i, n in enumerate(layout.shape)]


def axes_of(layout: Layout, chosen: Sequence[int]) -> list[str]:
    """Names of some axes, as NeXus wants them.

    silx takes an axis of exactly two values for a linear calibration and draws nothing: no axis (``.``) is better
    there. Beside an uneven axis it draws dots instead, and then needs both.
    """
    values = [np.asarray(layout.axes[i].values, float) for i in chosen]
    # relative difference of steps that makes an axis uneven
    even = all(np.ptp(np.diff(v)) <= 1e-6 * np.ptp(v) for v in values[-2:] if len(v) > 2)
    return ["." if len(v) == 2 and even else layout.names[i] for v, i in zip(values, chosen, strict=True)]


def groups(layout: Layout) -> dict[str, dict[str, Any]]:
    """Every group below ``/study`` with its attributes; NXdata groups draw themselves in NeXus viewers."""
    all_axes = range(len(layout.shape))
    plot = {"NX_class": "NXdata", "axes": axes_of(layout, all_axes), "default_slice": view_slice(layout)}
    others = [(axis, int(i)) for axis, i in zip(layout.axes, view_slice(layout), strict=True) if i != "."]
    at = [f"{axis.name} {shown_text(axis.values[i], axis.units, 5)}" for axis, i in others]
    title = ", ".join(["grasp map, curved contact model", *at])
    first = {"signal": FIRST[0], "auxiliary_signals": list(FIRST[1:]), "title": title}
    shown = {"NX_class": "NXdata", "axes": axes_of(layout, layout.shown)}
    attributes: dict[str, dict[str, Any]] = {"map": shown | first}
    for q in (q for q in layout.quantities if q.group == "maps" and not q.of):
        signal = {"signal": MODELS[0], "auxiliary_signals": list(MODELS[1:])} if q.by_model else {"signal": q.name}
        attributes[q.name] = {**plot, **signal, "title": q.label}
    attributes["status"] = {**plot, "signal": "code", "title": "state of the cases"}
    collections = ["axes", "checksums", "provenance", *{q.group for q in layout.quantities} - {"status"}]
    collections += ["derived"] * bool(layout.derived)
    attributes.update({name: {"NX_class": "NXcollection"} for name in sorted(collections) if name != "maps"})
    return attributes
