"""What stands where in a result file, as plain data: groups, datasets, attributes and the columns of a row.

The same description creates a file, checks a file that is resumed and bounds what is read from a file of unknown
origin. A *row* is one case: its flat index over all axes, the last axis (normal force) running fastest.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from study.quantities import EFFECTS, FINGERS, MODELS, PATCH, REASONS, Quantity, definitions, quantities

PROGRAM, VERSION = "softjaw", 1
MISSING, DONE, FAILED = 0, 1, 2
MESSAGE, LABEL, SESSIONS = 240, 80, 256
ROOT = "/study"
SESSION = np.dtype(
    [("start", "S32"), ("stop", "S32"), ("reason", "S120"), ("ranks", "<i4"), ("hosts", "<i4"), ("done", "<i8"),
     ("failed", "<i8"), ("host", "S64"), ("program", "S64"), ("git", "S64"), ("versions", "S400"), ("cpu", "S80"),
     ("command", "S400"), ("petsc_options", "S400")]
)  # fmt: skip


@dataclass(frozen=True)
class Header:
    """What a file says about the scene it was made from; ``labels`` name the candidates in row order."""

    digest: str
    scene: str
    title: str = ""
    scene_file: str = ""
    overrides: tuple[str, ...] = ()
    petsc_options: str = ""
    labels: tuple[str, ...] = ()


@dataclass(frozen=True)
class Derived:
    """A dataset that is filled once, after all rows: over some of the axes, with an optional trailing shape."""

    name: str
    units: str
    long_name: str
    definition: str
    axes: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()


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
    """One case's share of a dataset; ``counted`` columns enter the row's checksum, timings do not."""

    key: str
    path: str
    shape: tuple[int, ...]
    dtype: np.dtype
    fill: Any
    counted: bool = True
    flat: bool = False


@dataclass(frozen=True)
class Layout:
    """The file of one study: its axes (``name, values, units, long_name``), the faces of a patch and the options."""

    axes: tuple[Any, ...]
    faces: int
    meshes: int = 1
    patches: bool = True
    derived: tuple[Derived, ...] = ()
    cor_grid: int = 0
    planar: str = "flat"

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Length of every axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """All per-case quantities of this file but the patch."""
        return quantities(self.meshes, self.cor_grid)

    @property
    def models(self) -> tuple[str, ...]:
        """Friction models in the order they are shown: curved, the planar one that the scene prefers, the other."""
        return tuple(dict.fromkeys((MODELS[0], self.planar, *MODELS)))

    @property
    def rows(self) -> int:
        """Number of cases."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the axes in the file; NeXus allows no dot in a name, the keys of a sweep have one."""
        return tuple(axis.name.replace(".", "_") for axis in self.axes)

    @property
    def counters(self) -> dict[str, int]:
        """The other dimensions and their lengths: each is a dimension scale 0, 1, 2, ..."""
        parts = {"finger": FINGERS, "model": len(MODELS), "component": 3, "component_2": 3, "session": SESSIONS}
        if self.cor_grid:
            parts["cor"] = self.cor_grid**2
        return {**parts, **({"row": self.rows, "face": self.faces} if self.patches else {})}

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """All columns of a row, in the order of the checksum."""
        return tuple(_columns(self))

    @cached_property
    def datasets(self) -> tuple[Dataset, ...]:
        """All datasets but axes, texts and sessions."""
        return tuple(_datasets(self))

    @property
    def nbytes(self) -> int:
        """Size of the file, rounded up generously for what HDF5 adds."""
        count = len(self.datasets) + len(self.axes) + 16
        return sum(d.nbytes for d in self.datasets) + SESSIONS * SESSION.itemsize + 4096 * count + 2**16

    def options(self) -> str:
        """The part of the layout that the axes do not tell, as JSON."""
        derived = [asdict(d) for d in self.derived]
        names = ("faces", "meshes", "patches", "cor_grid", "planar")
        return json.dumps({**{name: getattr(self, name) for name in names}, "derived": derived})


def layout_from_options(axes: Sequence[Any], text: str) -> Layout:
    """The layout of an existing file from its axes and its options text; ``ValueError`` if they make no sense."""
    try:
        options = json.loads(text)
        derived = tuple(
            Derived(**{**d, "axes": tuple(d["axes"]), "shape": tuple(map(int, d["shape"]))}) for d in options["derived"]
        )
        faces, meshes = int(options["faces"]), int(options["meshes"])
        if not 0 <= faces < 10**7:
            raise ValueError(f"{faces} faces")
        cor_grid, planar = int(options["cor_grid"]), options["planar"]
        if not 0 <= cor_grid <= 1000 or planar not in MODELS[1:]:
            raise ValueError(f"cor_grid {cor_grid}, planar {planar!r}")
        return Layout(tuple(axes), faces, meshes, bool(options["patches"]), derived, cor_grid, planar)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"its layout attribute is damaged ({error})") from error


def _columns(layout: Layout):
    f8 = np.dtype("<f8")
    for q in layout.quantities:
        if q.group == "maps" and q.by_model:
            for model in MODELS:
                yield Column(f"{q.key}/{model}", f"{ROOT}/{q.name}/{model}", (), f8, np.nan)
        elif q.group == "maps":
            yield Column(q.key, f"{ROOT}/{q.name}/{q.name}", (), f8, np.nan)
        else:
            yield Column(q.key, f"{ROOT}/{q.key}", q.row_shape, f8, np.nan, counted=q.group != "work")
    for name in EFFECTS:
        for part, dtype, fill in (("level", "i1", -1), ("indicator", "<f8", np.nan), ("reason", "i1", -1)):
            yield Column(f"effects/{name}_{part}", f"{ROOT}/effects/{name}_{part}", (), np.dtype(dtype), fill)
    if layout.patches:
        for q in PATCH:
            shape = (FINGERS, layout.faces, *q.shape)
            yield Column(q.key, f"{ROOT}/{q.key}", shape, f8, np.nan, flat=True)
    yield Column("status/message", f"{ROOT}/status/message", (), np.dtype(f"S{MESSAGE}"), b"")


def _datasets(layout: Layout):
    described = {q.key: q for q in layout.quantities + PATCH}
    for c in layout.columns:
        q = described.get(c.key) or described.get(c.key.rpartition("/")[0])
        attributes = _describe(q, c.key) if q else _describe_effect(c.key)
        lead, scales = ((layout.rows,), ("row",)) if c.flat else (layout.shape, layout.names)
        yield Dataset(c.path, lead + c.shape, c.dtype, c.fill, attributes, scales + _labels(q, c))
    state = {"long_name": "state of the case", "meaning": "0 missing, 1 done, 2 failed", "units": ""}
    yield Dataset(f"{ROOT}/status/code", layout.shape, np.dtype("u1"), MISSING, state, layout.names)
    crc = {"long_name": "crc32 of the row, timings left out", "units": ""}
    yield Dataset(f"{ROOT}/status/crc", layout.shape, np.dtype("<u4"), 0, crc, layout.names)
    tries = {"long_name": "times this case was begun", "units": ""}
    yield Dataset(f"{ROOT}/status/attempts", layout.shape, np.dtype("u1"), 0, tries, layout.names)
    lengths = dict(zip(layout.names, layout.shape, strict=True))
    for d in layout.derived:
        attributes = {"units": d.units, "long_name": d.long_name, "definition": d.definition}
        axes = tuple(name.replace(".", "_") for name in d.axes)
        shape = tuple(lengths[name] for name in axes) + d.shape
        scales = axes if not d.shape else ()
        yield Dataset(f"{ROOT}/derived/{d.name}", shape, np.dtype("<f8"), np.nan, attributes, scales)


def _describe(q, key: str) -> dict[str, str]:
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
    return attributes


def _labels(q, column: Column) -> tuple[str, ...]:
    if not column.shape:
        return ()
    finger = ("finger",) if q.per == "finger" else ()
    face = ("face",) if q.group == "patch" else ()
    labels = finger + face + (("model",) if q.by_model else ()) + (("cor",) if q.name == "cor_wrench" else ())
    return labels + ("component", "component_2")[: len(column.shape) - len(labels)]


def view_slice(layout: Layout) -> list[str]:
    """Which two axes a viewer shows first (``.``) and where it stands on the others: the highest force, else 0."""
    names, shape = layout.names, layout.shape
    preference = [n for n in ("station", "angle", *names) if n in names]
    shown = [n for n in dict.fromkeys(preference) if shape[names.index(n)] > 1][:2] or list(names[-1:])
    last = {"normal_force": shape[-1] - 1}
    return ["." if n in shown else str(last.get(n, 0)) for n in names]


def groups(layout: Layout) -> dict[str, dict[str, Any]]:
    """Every group below ``/study`` with its attributes; NXdata groups draw themselves in NeXus viewers."""
    # silx takes an axis of exactly two values for a linear calibration and draws nothing: no axis is better there.
    names, shape = layout.names, layout.shape
    plot = {
        "NX_class": "NXdata",
        "axes": ["." if k == 2 else n for n, k in zip(names, shape, strict=True)],
        "default_slice": view_slice(layout),
        **{f"{n}_indices": i for i, (n, k) in enumerate(zip(names, shape, strict=True)) if k != 2},
    }
    found: dict[str, dict[str, Any]] = {}
    for q in layout.quantities:
        if q.group != "maps":
            continue
        several = {"signal": MODELS[0], "auxiliary_signals": list(layout.models[1:])}
        signal = several if q.by_model else {"signal": q.name}
        found[q.name] = {**plot, **signal, "title": q.long_name, "definition": q.definition}
    found["status"] = {**plot, "signal": "code", "title": "state of the cases"}
    collections = ["axes", "candidates", "provenance", "effects", *{q.group for q in layout.quantities}]
    collections += ["patch"] * layout.patches + ["derived"] * bool(layout.derived)
    found.update({name: {"NX_class": "NXcollection"} for name in sorted(collections) if name != "maps"})
    return found


def definitions_text(layout: Layout) -> str:
    """The definitions of all quantities of this layout, derived ones included."""
    derived = [f"derived/{d.name} [{d.units or '-'}]: {d.long_name}. {d.definition}\n" for d in layout.derived]
    return definitions(layout.meshes, layout.cor_grid) + "".join(derived)
