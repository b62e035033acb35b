"""Datasets of a result file: what every quantity becomes in HDF5, with its attributes and scales."""

import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from softjaw.study.quantities import MISSING, MODELS, Quantity
from softjaw.study.table import with_unit

MESSAGE_BYTES = 2000  # bytes of a message: all flags of a case have room
ROOT = "/study"
CODE = f"{ROOT}/status/code"
SUMS, CLOSING_SUMS = f"{ROOT}/checksums/rows", f"{ROOT}/checksums/closing"  # of rows; of what is filled after all rows


class Dataset(NamedTuple):
    """One dataset: where, how large, what it is filled with, its attributes and the scale along each dimension.

    One of the cases has their ``key``, and as ``share`` the shape of one case.
    """

    path: str
    shape: tuple[int, ...]
    dtype: np.dtype
    fill: Any
    attributes: dict[str, Any]
    scales: tuple[str, ...]
    key: str = ""
    share: tuple[int, ...] = ()

    @property
    def nbytes(self) -> int:
        """Size on disk."""
        return int(np.prod(self.shape, dtype=np.int64)) * self.dtype.itemsize


def of_cases(layout: Any) -> Iterator[Dataset]:
    """All datasets with a value of each case in a new file; the message is the last one."""
    for q in layout.asked:
        names = {q.key: f"{ROOT}/{q.key}"}
        if q.group == "maps":
            parts = {f"{q.key}/{model}": model for model in MODELS} if q.by_model else {q.key: q.name}
            names = {key: f"{ROOT}/{q.name}/{part}" for key, part in parts.items()}
            if q.of and names[q.key] not in layout.stored:  # files of before have a group for each error
                names[q.key] = f"{ROOT}/{q.of}/error"
        dims = () if len(names) > 1 else q.dims
        share, (kind, fill) = tuple(layout.lengths[dim] for dim in dims), _stored_as(q)
        for key, path in names.items():
            about, scales = described(q, key), layout.names + dims
            yield Dataset(path, layout.shape + share, np.dtype(kind), fill, about, scales, key, share)


def _stored_as(q: Quantity) -> tuple[str, Any]:
    """Type and fill value of a quantity."""
    if q.group == "status":  # filled as not computed, so that a new file needs no state written
        return (f"S{MESSAGE_BYTES}", b"") if q.name == "message" else ("u1", MISSING)
    if q.meanings:  # integers have no NaN
        return "i1", -1
    # faces are known to the error of the mesh, which single precision does not touch
    return "<f4" if q.group == "patch" else "<f8", np.nan


def others(layout: Any) -> Iterator[Dataset]:
    """Checksums of every case for each dataset and of its state, and what is filled after all cases."""
    u4 = np.dtype("<u4")
    text = "crc32 of the case in each dataset, in the order of the columns in the options, and of its state"
    shape, scales = (*layout.shape, len(layout.summed)), (*layout.names, "column")
    # Filled with the sum of "not computed": a lost state then differs from a case that was never solved.
    yield Dataset(SUMS, shape, u4, zlib.crc32(bytes([MISSING])), {"long_name": text, "units": ""}, scales)
    about = {"long_name": f"crc32 of {', '.join(layout.closing)}", "units": ""}
    yield Dataset(CLOSING_SUMS, (len(layout.closing),), u4, 0, about, ("closing",))
    lengths = dict(zip(layout.names, layout.shape, strict=True))
    for q in layout.derived:
        shape = tuple(lengths[name] for name in q.dims)
        yield Dataset(f"{ROOT}/{q.key}", shape, np.dtype("<f8"), np.nan, described(q, q.key), q.dims)


def described(q: Quantity, key: str) -> dict[str, str]:
    """Attributes of the dataset of a quantity, or of one of its models."""
    model = key.rpartition("/")[2] if key != q.key else ""
    label = f"{q.label}, {model}" if model else q.label
    attributes = {"units": q.unit, "long_name": with_unit(label, q.unit), "definition": q.definition}
    if q.by_model and not model:
        attributes["models"] = ", ".join(MODELS)
    if q.meanings:
        attributes["meaning"] = ", ".join(f"{i} {text}" for i, text in enumerate(q.meanings))
    return attributes
