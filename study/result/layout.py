"""What stands where in a result file, as plain data: groups, datasets, attributes and the columns of a row.

The same description creates a file, checks a file that is resumed and bounds what is read from a file of unknown
origin. A *row* is one case: its flat index over all axes, the last axis (normal force) running fastest.
"""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from softjaw.study.quantities import (
    ALONG,
    AROUND,
    FINGERS,
    MODELS,
    MONOMIALS,
    NEEDS,
    REALISATION,
    Axis,
    Quantity,
    quantities,
)
from softjaw.study.quantities import DONE as DONE
from softjaw.study.result.datasets import CODE, Dataset, of_cases, others
from softjaw.study.result.datasets import ROOT as ROOT

ATTEMPTS = f"{ROOT}/status/attempts"

PROGRAM, VERSION = "softjaw", 9
MOST_SESSIONS, REPORT_BYTES = 256, 8192
# Fixed lengths: a run writes to space that is there already, and text of any length would need more.
SESSION = np.dtype(
    [("start", "S32"), ("stop", "S32"), ("reason", "S120"), ("ranks", "<i4"), ("hosts", "<i4"), ("done", "<i8"),
     ("failed", "<i8"), ("host", "S64"), ("program", "S64"), ("git", "S64"), ("versions", "S400"), ("cpu", "S80"),
     ("command", "S400"), ("petsc_options", "S400"), ("crc", "<u4")]
)  # fmt: skip


@dataclass(frozen=True)
class Header:
    """What a file says about the scene it was made from; ``labels`` name the candidates in row order.

    ``about`` holds rotation and origin of the frame of stations and angles in that of the poses, the object's own file,
    in which centroid and bounds are; what a sampler offered and rejected: point [mm], approach, long side, state.
    """

    digest: str
    scene: str
    title: str = ""
    scene_file: str = ""
    overrides: tuple[str, ...] = ()
    petsc_options: str = ""
    labels: tuple[str, ...] = ()
    about: Mapping[str, Any] = field(default_factory=dict)

    def text(self) -> str:
        """All but the scene, as JSON."""
        return as_json({name: part for name, part in vars(self).items() if name != "scene"})


@dataclass(frozen=True)
class Layout:
    """The file of one study: its axes, the faces of a patch and what of the quantities it holds.

    No ``faces``: patches are not stored. ``has`` names what of `NEEDS` the scene asks for besides patches.
    ``rounds`` is what each round of a run added: stations [mm], poses as `study.run.refine.Place`, or cases
    that are solved on a finer mesh, by the numbers of their point of a sweep, candidate and force. ``stored`` are the
    paths of the columns in an existing file, which may be others than those of this version; empty for a new one.
    ``derived`` are quantities over some of the axes that are filled once, after all rows.
    """

    axes: tuple[Axis, ...]
    faces: int
    derived: tuple[Quantity, ...] = ()
    has: tuple[str, ...] = ()
    rounds: tuple[tuple[float | tuple[int, int, int] | tuple[float, ...], ...], ...] = ()
    stored: tuple[str, ...] = ()

    @property
    def added(self) -> tuple[tuple[Any, ...], ...]:
        """What the rounds of a refinement added: stations or poses."""
        return tuple(some for some in self.rounds if not is_case(some[0]))

    @property
    def finer(self) -> Counter[Any]:
        """How often rounds named each case for a finer mesh."""
        return Counter(case for some in self.rounds for case in some if is_case(case))

    @cached_property
    def summed(self) -> tuple[str, ...]:
        """Paths of the datasets that a row has a checksum for, the state last."""
        return (*(self.stored or (c.path for c in self.columns)), CODE)

    @cached_property
    def paths(self) -> dict[str, str]:
        """Path of every column by the key of its quantity."""
        return {c.key: c.path for c in self.columns}

    @property
    def closing(self) -> tuple[str, ...]:
        """What is filled after all rows and has a checksum, by its dataset's name below ``/study``."""
        return (*(q.key for q in self.derived), "report")

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Length of every axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """All quantities of the cases of this file that this version knows."""
        keys = {key for c in self.columns for key in (c.key, c.key.rpartition("/")[0])}
        return tuple(q for q in self.asked if q.key in keys or q.group == "status")

    @cached_property
    def asked(self) -> tuple[Quantity, ...]:
        """All quantities that this version stores for such a scene."""
        return quantities((*self.has, *[NEEDS[-1]] * bool(self.faces)))

    @property
    def rows(self) -> int:
        """Number of cases."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def inputs(self) -> int:
        """Number of points for each of the sweep's: one with the scene's own inputs, others with samples of them."""
        return self.shape[self.names.index(REALISATION)] if REALISATION in self.names else 1

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(axis.name for axis in self.axes)

    @cached_property
    def shown(self) -> tuple[int, ...]:
        """Positions of the one or two axes that viewers show first: stations and angles, or else what has values."""
        order = sorted(range(len(self.shape)), key=lambda i: (self.names[i] != "station", self.names[i] != "angle", i))
        return tuple([i for i in order if self.shape[i] > 1][:2]) or (len(self.shape) - 1,)

    @property
    def counters(self) -> list[Axis]:
        """The other dimensions: each is a dimension scale 0, 1, 2, ..."""
        lengths = {**self.lengths, "column": len(self.summed), "closing": len(self.closing)}
        about = {name: f"number of the {name.removesuffix('_2').replace('_', ' ')}" for name in lengths}
        return [Axis(name, np.arange(n), "", about[name]) for name, n in lengths.items()]

    @cached_property
    def lengths(self) -> dict[str, int]:
        """Dimensions of the quantities besides the axes, and their lengths."""
        parts = {"finger": FINGERS, "model": len(MODELS), "component": 3, "monomial": len(MONOMIALS)}
        parts |= {"session": MOST_SESSIONS, "component_2": 3}
        parts |= {"wrench": 6, "wrench_2": 6} if "six components" in self.has else {}
        parts |= {"wall_place": AROUND * ALONG} if "wall" in self.has else {}
        return {**parts, **({"face": self.faces} if self.faces else {})}

    @cached_property
    def columns(self) -> tuple[Dataset, ...]:
        """The values of a case that this version knows, all but its state."""
        known = {d.path: d for d in of_cases(self) if d.path not in (CODE, ATTEMPTS)}
        return tuple(known[path] for path in self.stored or known if path in known)

    @cached_property
    def datasets(self) -> tuple[Dataset, ...]:
        """All datasets of the study but axes, texts and sessions."""
        return (*self.columns, *(d for d in of_cases(self) if d.path in (CODE, ATTEMPTS)), *others(self))

    @property
    def nbytes(self) -> int:
        """Size of the file, rounded up generously for what HDF5 adds."""
        count = len(self.datasets) + len(self.axes) + 16
        texts = MOST_SESSIONS * SESSION.itemsize + REPORT_BYTES
        return sum(d.nbytes for d in self.datasets) + texts + 4096 * count + 2**16

    def text(self) -> str:
        """The layout as JSON."""
        return as_json(asdict(replace(self, stored=self.summed[:-1])))


def is_case(added: Any) -> bool:
    """Whether what a round added is a case for a finer mesh, and no station or pose."""
    return isinstance(added, tuple) and len(added) == 3


_adapter = lru_cache(TypeAdapter)  # making one takes longer than reading by it


def as_json(value: Any) -> str:
    """Records with arrays as JSON."""
    return json.dumps(value, default=np.ndarray.tolist)


def layout_of(text: str) -> Layout:
    """The layout of an existing file; ``ValueError`` if it makes no sense."""
    layout = _adapter(Layout).validate_json(text)
    axes = tuple(replace(axis, values=np.asarray(axis.values, float)) for axis in layout.axes)
    if len(axes) < 3 or not all(axis.values.ndim == 1 and np.isfinite(axis.values).all() for axis in axes):
        raise ValueError("its axes are not those of a study")
    return replace(layout, axes=axes)


def header_of(text: str, scene: str) -> Header:
    """The header of an existing file; ``ValueError`` if it makes no sense."""
    return _adapter(Header).validate_python({**json.loads(text), "scene": scene})
