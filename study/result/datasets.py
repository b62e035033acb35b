"""Columns and datasets of a result file: what every quantity becomes in HDF5, with its attributes and scales."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softjaw.study.quantities import BY_KEY, MISSING, MODELS, Quantity

MESSAGE_BYTES = 2000  # bytes of a message: all flags of a case have room
ROOT = "/study"
CODE = f"{ROOT}/status/code"
SUMS, CLOSING_SUMS = f"{ROOT}/checksums/rows", f"{ROOT}/checksums/closing"  # of rows; of what is filled after all rows


@dataclass(frozen=True)
class Dataset:
    """One dataset: where, how large, what it is filled with, its attributes and the scale along each dimension."""

    path: str
    shape: tuple[int, ...]
    dtype: np.dtype
    fill: Any
    attributes: dict[str, Any] = field(default_factory=dict)
    scales: tuple[str, ...] = ()

    @property
    def nbytes(self) -> int:
        """Size on disk."""
        return int(np.prod(self.shape, dtype=np.int64)) * self.dtype.itemsize


@dataclass(frozen=True)
class Column:
    """One case's share of a dataset; ``sampled`` ones are stored for the layout's sampled candidates only."""

    key: str
    path: str
    shape: tuple[int, ...]
    dtype: np.dtype
    fill: Any
    sampled: bool = False


def columns_of(layout: Any) -> Iterator[Column]:
    """All columns that a row has in a new file."""
    for q in layout.asked:
        shape = tuple(layout.lengths[dim] for dim in q.dims)
        # Integers have no NaN: codes use -1 for none.
        # faces are known to the error of the mesh, which single precision does not touch
        dtype, fill = ("i1", -1) if q.meanings else ("<f4" if q.group == "patch" else "<f8", np.nan)
        if q.group == "maps" and q.by_model:
            for model in MODELS:
                yield Column(f"{q.key}/{model}", f"{ROOT}/{q.name}/{model}", (), np.dtype(dtype), fill)
        elif q.group == "maps":
            yield Column(q.key, f"{ROOT}/{q.name}/{q.name}", shape, np.dtype(dtype), fill)
        elif q.group != "status":
            yield Column(q.key, f"{ROOT}/{q.key}", shape, np.dtype(dtype), fill, q.sampled)
    # The message stays last: `blank` and `record` address it as the last column.
    yield Column("status/message", f"{ROOT}/status/message", (), np.dtype(f"S{MESSAGE_BYTES}"), b"")


def datasets_of(layout: Any) -> Iterator[Dataset]:
    """All datasets of a layout but axes, texts and sessions."""
    for c in layout.columns:
        q = BY_KEY.get(c.key) or BY_KEY[c.key.rpartition("/")[0]]
        lead, scales = layout.shape, layout.names
        if c.sampled:
            lead = (*lead[:-3], len(layout.sampled), lead[-1])
            scales = (*scales[:-3], "sampled", scales[-1])
        yield Dataset(c.path, lead + c.shape, c.dtype, c.fill, described(q, c.key), scales + q.dims * bool(c.shape))
    for name in ("code", "attempts"):
        about = described(BY_KEY[f"status/{name}"], f"status/{name}")
        # The fill value means not computed, so a new file needs no state written.
        yield Dataset(f"{ROOT}/status/{name}", layout.shape, np.dtype("u1"), MISSING, about, layout.names)
    yield from _checksums(layout)
    if layout.sampled:
        yield from _sample_datasets(layout)
    lengths = dict(zip(layout.names, layout.shape, strict=True))
    for q in layout.derived:
        shape = tuple(lengths[name] for name in q.dims)
        yield Dataset(f"{ROOT}/{q.key}", shape, np.dtype("<f8"), np.nan, described(q, q.key), q.dims)


def _checksums(layout: Any) -> Iterator[Dataset]:
    """Checksums of every row for each dataset and of its state, and of what is filled after all rows."""
    u4 = np.dtype("<u4")
    text = "crc32 of the case in each dataset, in the order of the columns in the options, and of its state"
    shape, scales = (*layout.shape, len(layout.summed)), (*layout.names, "column")
    # Filled with the sum of "not computed": a lost state then differs from a case that was never solved.
    yield Dataset(SUMS, shape, u4, zlib.crc32(bytes([MISSING])), {"long_name": text, "units": ""}, scales)
    about = {"long_name": f"crc32 of {', '.join(layout.closing)}", "units": ""}
    yield Dataset(CLOSING_SUMS, (len(layout.closing),), u4, 0, about, ("closing",))


def _sample_datasets(layout: Any) -> Iterator[Dataset]:
    """Which candidates and motions the stored wrenches belong to; filled when the file is made."""
    text = "Unit motions (v_x, v_y, rho omega_z), with rho = limit_surface/rho of the finger."
    about = {"units": "", "long_name": "sampled motions", "definition": text}
    shape = (layout.samples, 3)
    yield Dataset(f"{ROOT}/wrenches/motion", shape, np.dtype("<f8"), np.nan, about, ("sample", "component"))
    text = "Number of the candidate, counted over stations and angles, the angle running fastest."
    about = {"units": "", "long_name": "candidates whose wrenches are stored", "definition": text}
    yield Dataset(f"{ROOT}/wrenches/candidate", (len(layout.sampled),), np.dtype("<i4"), 0, about, ("sampled",))


def described(q: Quantity, key: str) -> dict[str, str]:
    """Attributes of the dataset of a quantity, or of one of its models."""
    model = key.rpartition("/")[2] if key != q.key else ""
    label = f"{q.label}, {model}" if model else q.label
    long_name = f"{label} [{q.unit}]" if q.unit else label
    attributes = {"units": q.unit, "long_name": long_name, "definition": q.definition}
    if q.by_model and not model:
        attributes["models"] = ", ".join(MODELS)
    if q.meanings:
        attributes["meaning"] = ", ".join(f"{i} {text}" for i, text in enumerate(q.meanings))
    return attributes
