"""``/VTKHDF`` of a result file: what ParaView and `pyvista.read` show of a study, as plain data.

One unstructured grid over the normal force: the object's surface, coloured by the maps, and the fronts of every
candidate's two pads with their pressure. All steps share the cells of the first; only points and values advance. Of a
sweep it shows the first point. The space is reserved when the file is made; `grid_values` fills it at the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from softjaw.study.quantities import FINGERS, ON_OBJECT
from softjaw.study.result.datasets import MISSING, Dataset
from softjaw.study.result.grid_arrays import quads_of, shared_steps, topology

PATH = "/VTKHDF"
OBJECT, NOBODY = 0, -1  # part of the object's triangles; candidate of those that no candidate grasps
ABOUT = (
    "The object's surface (part 0) and both pads' fronts of every candidate (parts 1 and 2), over the normal force [N]"
    " as time. Choose pads by thresholds on part and candidate. The object is not deformed: pads that dent its wall"
    " stand in it. Curved contact model, SI units; NaN: no value. Filled when no case is missing any more."
)


class Surface(NamedTuple):
    """Triangles of the object: ``points (n, 3)`` [m], ``triangles (m, 3)``, ``candidate (m,)``, -1 for none."""

    points: np.ndarray
    triangles: np.ndarray
    candidate: np.ndarray

    @property
    def counts(self) -> tuple[int, int]:
        """Number of points and of triangles."""
        return len(self.points), len(self.triangles)


def maps_of(layout: Any) -> dict[str, Any]:
    """The quantities that the cells show, by name; each costs 4 bytes for every face and force."""
    return {q.name: q for q in layout.quantities if q.group == "maps" and q.name in ON_OBJECT}


def sizes(layout: Any) -> tuple[int, int]:
    """Points and cells of one step."""
    points, cells = layout.surface
    pads = FINGERS * int(np.prod(layout.shape[-3:-1]))
    i, j = layout.front
    return points + pads * (i + 1) * (j + 1) * bool(i), cells + pads * i * j


def grid_datasets(layout: Any) -> Iterator[Dataset]:
    """All datasets of the grid; none where there is nothing to show."""
    points, cells = sizes(layout)
    if not cells:
        return
    steps, corners = layout.shape[-1], 3 * layout.surface[1] + 4 * (cells - layout.surface[1])

    def made(name: str, shape: tuple[int, ...], dtype: str, fill: Any, units: str = "", text: str = "") -> Dataset:
        about = {"units": units, "long_name": text} if text else {}
        return Dataset(f"{PATH}/{name}", shape, np.dtype(dtype), fill, about)

    for name in ("Points", "Cells", "ConnectivityIds"):
        yield made(f"NumberOf{name}", (1,), "<i8", 0)
    yield made("Points", (steps * points, 3), "<f4", 0.0, "m", "points in the object's frame, force by force")
    yield made("Connectivity", (corners,), "<i8", 0)
    yield made("Offsets", (cells + 1,), "<i8", 0)
    yield made("Types", (cells,), "u1", 0)
    yield made("CellData/part", (cells,), "u1", 0, "", "0 object, 1 and 2 pads of the fingers")
    text = "candidate, counted over stations and angles; -1 none"
    yield made("CellData/candidate", (cells,), "<i4", NOBODY, "", text)
    text = "0 missing, 1 done, 2 failed, -1 no candidate"
    yield made("CellData/status", (steps * cells,), "i1", MISSING, "", text)
    if layout.front[0]:
        yield made("CellData/pressure", (steps * cells,), "<f4", np.nan, "Pa", "contact pressure")
    for q in maps_of(layout).values():
        yield made(f"CellData/{q.name}", (steps * cells,), "<f4", np.nan, q.unit, f"{q.label}, curved")
    for name, values in shared_steps(layout.axes[-1].values, points, _advances(layout, cells)).items():
        yield made(f"Steps/{name}", values.shape, values.dtype.str, 0)


def _advances(layout: Any, cells: int) -> dict[str, int]:
    """By how much the values of each array on the cells advance from step to step."""
    moving = ("status", *["pressure"] * bool(layout.front[0]), *maps_of(layout))
    return {"part": 0, "candidate": 0, **dict.fromkeys(moving, cells)}


def skeleton(layout: Any, surface: Surface) -> dict[str, np.ndarray]:
    """What is known before a case is solved, by dataset; pads wait in a corner of the object, without area."""
    points, cells = sizes(layout)
    counts, (n, m) = layout.front, surface.counts
    pads = FINGERS * int(np.prod(layout.shape[-3:-1])) * bool(counts[0])
    quads = quads_of(counts, n, pads) if pads else np.empty((0, 4), int)
    corner = surface.points[:1] if n else np.zeros((1, 3))
    one = np.concatenate([surface.points, np.broadcast_to(corner, (points - n, 3))])
    number = np.repeat(np.arange(pads), counts[0] * counts[1])
    found = topology(points, (surface.triangles, quads))
    found |= {
        "Points": np.tile(one, (layout.shape[-1], 1)),
        "CellData/part": np.concatenate([np.full(m, OBJECT), 1 + number % FINGERS]),
        "CellData/candidate": np.concatenate([surface.candidate, number // FINGERS]),
    }
    steps = shared_steps(layout.axes[-1].values, points, _advances(layout, cells))
    return {f"{PATH}/{name}": v for name, v in {**found, **{f"Steps/{k}": v for k, v in steps.items()}}.items()}
