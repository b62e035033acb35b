"""Columns and datasets of a result file: what every quantity becomes in HDF5, with its attributes and scales."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softjaw.study.result.finger_quantities import PATCH
from softjaw.study.result.quantities import EFFECTS, INDICATORS, REASONS
from softjaw.study.result.quantity import FINGERS, MODELS, Quantity

MISSING = 0  # state of a case that has not been solved
MESSAGE = 2000  # bytes of a message: all flags of a case have room, and what its probes add
MESSAGE_3 = 240  # as files of version 3 have them
ROOT = "/study"
SUMS = f"{ROOT}/checksums"  # a dataset for each part of a row, and these two:
STATE, CLOSING = "code", "closing"  # of the states; of what is filled after all rows
APART = ("cor_wrench",)  # columns so large that they are a part of a row by themselves
TIMES = "times"  # a part that differs from run to run
FIRST_SEEN = ("quality", "e_n")  # maps that viewers open at


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
    """One case's share of a dataset.

    ``flat`` ones stand in the order of the rows, those ``among`` some candidates are stored for these only.
    """

    key: str
    path: str
    shape: tuple[int, ...]
    dtype: np.dtype
    fill: Any
    flat: bool = False
    among: str = ""

    @property
    def part(self) -> str:
        """The part of the row whose checksum covers it."""
        group, _, name = self.key.partition("/")
        return TIMES if name.startswith("seconds_") else name if name in APART else group


def columns_of(layout: Any) -> Iterator[Column]:
    """All columns of a row of a layout."""
    f8 = np.dtype("<f8")
    for q in layout.quantities:
        if q.group == "maps" and q.by_model:
            for model in MODELS:
                yield Column(f"{q.key}/{model}", f"{ROOT}/{q.name}/{model}", (), f8, np.nan)
        elif q.group == "maps":
            yield Column(q.key, f"{ROOT}/{q.name}/{q.name}", (), f8, np.nan)
        else:
            yield Column(q.key, f"{ROOT}/{q.key}", q.row_shape, f8, np.nan, among=q.among)
    for name in EFFECTS:
        for part, dtype, fill in (("level", "i1", -1), ("indicator", "<f8", np.nan), ("reason", "i1", -1)):
            yield Column(f"effects/{name}_{part}", f"{ROOT}/effects/{name}_{part}", (), np.dtype(dtype), fill)
    if layout.patches:
        for q in PATCH:
            shape = (FINGERS, layout.faces, *q.shape)
            yield Column(q.key, f"{ROOT}/{q.key}", shape, f8, np.nan, flat=True)
    yield Column("status/message", f"{ROOT}/status/message", (), np.dtype(f"S{layout.message}"), b"")


def datasets_of(layout: Any) -> Iterator[Dataset]:
    """All datasets of a layout but axes, texts and sessions."""
    described = {q.key: q for q in (*layout.quantities, *PATCH)}
    for c in layout.columns:
        q = described.get(c.key) or described.get(c.key.rpartition("/")[0])
        attributes = _describe(q, c.key) if q else _describe_effect(c.key)
        lead, scales = ((layout.rows,), ("row",)) if c.flat else (layout.shape, layout.names)
        if c.among:
            lead = (*lead[:-3], len(layout.chosen[c.among]), lead[-1])
            scales = (*scales[:-3], c.among, scales[-1])
        yield Dataset(c.path, lead + c.shape, c.dtype, c.fill, attributes, scales + _labels(q, c))
    state = {"long_name": "state of the case", "meaning": "0 missing, 1 done, 2 failed", "units": ""}
    yield Dataset(f"{ROOT}/status/code", layout.shape, np.dtype("u1"), MISSING, state, layout.names)
    tries = {"long_name": "times this case was begun", "units": ""}
    yield Dataset(f"{ROOT}/status/attempts", layout.shape, np.dtype("u1"), 0, tries, layout.names)
    yield from _checksums(layout)
    for name in FIRST_SEEN:
        q, order = described[f"maps/{name}"], layout.seen
        shape, scales = (tuple(given[i] for i in order) for given in (layout.shape, layout.names))
        shown = {"interpretation": ("spectrum", "image")[len(layout.shown) - 1]}
        attributes = _describe(q, f"{q.key}/{MODELS[0]}") | shown
        yield Dataset(f"{ROOT}/map/{name}", shape, np.dtype("<f8"), np.nan, attributes, scales)
    if layout.sampled:
        yield from _sample_datasets(layout)
    if layout.probes:
        yield _numbers(f"{ROOT}/probes/candidate", "candidates that are solved again", len(layout.probes), "probe")
    lengths = dict(zip(layout.names, layout.shape, strict=True))
    for d in layout.derived:
        attributes = {"units": d.units, "long_name": d.long_name, "definition": d.definition}
        axes = tuple(name.replace(".", "_") for name in d.axes)
        shape = tuple(lengths[name] for name in axes) + d.shape
        scales = axes if not d.shape else ()
        yield Dataset(f"{ROOT}/derived/{d.name}", shape, np.dtype("<f8"), np.nan, attributes, scales)


def _checksums(layout: Any) -> Iterator[Dataset]:
    """Checksums of the parts of every row, of its state, and of what is filled after all rows."""
    u4 = np.dtype("<u4")
    if layout.version == 3:
        about = {"long_name": "crc32 of the row, timings left out", "units": ""}
        yield Dataset(f"{ROOT}/status/crc", layout.shape, u4, 0, about, layout.names)
        return
    for part in layout.parts:
        about = {"long_name": f"crc32 of the case's {part}", "units": ""}
        yield Dataset(f"{SUMS}/{part}", layout.shape, u4, 0, about, layout.names)
    about = {"long_name": "crc32 of the state of the case", "units": ""}
    yield Dataset(f"{SUMS}/{STATE}", layout.shape, u4, zlib.crc32(bytes([MISSING])), about, layout.names)
    about = {"long_name": f"crc32 of {', '.join(layout.closing)}", "units": ""}
    yield Dataset(f"{SUMS}/{CLOSING}", (len(layout.closing),), u4, 0, about, (CLOSING,))


def _sample_datasets(layout: Any) -> Iterator[Dataset]:
    """Which candidates and motions the stored wrenches belong to; filled when the file is made."""
    text = "Unit motions (v_x, v_y, rho omega_z), with rho = limit_surface/rho of the finger."
    about = {"units": "", "long_name": "sampled motions", "definition": text}
    shape = (layout.samples, 3)
    yield Dataset(f"{ROOT}/wrenches/motion", shape, np.dtype("<f8"), np.nan, about, ("sample", "component"))
    what = "candidates whose wrenches are stored"
    yield _numbers(f"{ROOT}/wrenches/candidate", what, len(layout.sampled), "sampled")


def _numbers(path: str, what: str, count: int, scale: str) -> Dataset:
    text = "Number of the candidate, counted over stations and angles, the angle running fastest."
    about = {"units": "", "long_name": what, "definition": text}
    return Dataset(path, (count,), np.dtype("<i4"), 0, about, (scale,))


def _describe(q: Quantity, key: str) -> dict[str, str]:
    model = key.rpartition("/")[2] if key != q.key else ""
    label = f"{q.long_name}, {model}" if model else q.long_name
    long_name = f"{label} [{q.units}]" if q.units else label
    attributes = {"units": q.units, "long_name": long_name, "definition": q.definition}
    if q.by_model and not model:
        attributes["models"] = ", ".join(MODELS)
    return attributes


def _describe_effect(key: str) -> dict[str, str]:
    if key == "status/message":
        return {"long_name": "why a case failed, or what to know about a result", "units": ""}
    name, _, part = key.removeprefix("effects/").rpartition("_")
    meaning = {"level": EFFECTS[name], "reason": REASONS}.get(part)
    attributes = {"long_name": f"{part} of the effect '{name}'", "units": ""}
    if meaning:
        attributes["meaning"] = ", ".join(f"{i} {text}" for i, text in enumerate(meaning))
    if part == "indicator" and name in INDICATORS:
        attributes["definition"] = INDICATORS[name]
    return attributes


def _labels(q: Quantity | None, column: Column) -> tuple[str, ...]:
    if q is None or not column.shape:
        return ()
    finger = ("finger",) if q.per == "finger" else ()
    face = ("face",) if q.group == "patch" else ()
    sample = {"cor_wrench": ("cor",), "wrench": ("sample",), "place": ("wall_place",)}.get(q.name, ())
    sample = ("variation",) if q.among == "probe" else sample
    labels = finger + face + (("model",) if q.by_model else ()) + sample
    parts = {6: ("wrench", "wrench_2"), 15: ("monomial",)}.get(column.shape[-1], ("component", "component_2"))
    return labels + parts[: len(column.shape) - len(labels)]
