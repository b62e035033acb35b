"""``/VTKHDF`` of a result file and grids in files of their own: what ParaView and `pyvista.read` open.

The grid of a result runs over the normal force: the object's surface, coloured by the maps, and the contact faces of
every candidate's two pads with their pressure. All steps share the cells of the first; only points and values
advance. Of a sweep it shows the first point. The space is reserved when the file is made; `fill_grid` fills it at
the end. `write_grid` makes a file of its own. All is written so that also the oldest readers take it (at one moment:
version 1.0, VTK 9.1 on; over forces: 2.0 with one topology for all steps).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from softjaw.study.messages import beside
from softjaw.study.quantities import DONE, FINGERS, MISSING, ON_OBJECT, STATES
from softjaw.study.result.datasets import Dataset

# Newer formats would lock out readers that bring an older HDF5 of their own, as ParaView does.
LIBVER = ("earliest", "v110")
Arrays = Mapping[str, np.ndarray]
PATH = "/VTKHDF"
KINDS = {3: 5, 4: 9}  # VTK's numbers for triangles and quadrilaterals, by their corners
OBJECT, NOBODY = 0, -1  # part of the object's triangles; candidate of those that no candidate grasps
ABOUT = (
    "The object's surface (part 0) and both pads' contact faces of every candidate (parts 1 and 2), over the normal"
    " force [N] as time. Choose pads by thresholds on part and candidate. The object is not deformed: pads that"
    " indent its wall stand in it. Curved contact model (CCM), SI units; NaN: no value. Filled at the end."
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
    i, j = layout.pad_faces
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
    # Single precision is enough for a picture; the exact values stand in the maps.
    yield made("Points", (steps * points, 3), "<f4", 0.0, "m", "points in the object file's frame, force by force")
    yield made("Connectivity", (corners,), "<i8", 0)
    yield made("Offsets", (cells + 1,), "<i8", 0)
    yield made("Types", (cells,), "u1", 0)
    yield made("CellData/part", (cells,), "u1", 0, "", "0 object, 1 and 2 pads of the fingers")
    text = "candidate, counted over stations and angles; -1 none"
    yield made("CellData/candidate", (cells,), "<i4", NOBODY, "", text)
    text = ", ".join([*(f"{code} {state}" for code, state in enumerate(STATES)), "-1 no candidate"])
    yield made("CellData/status", (steps * cells,), "i1", MISSING, "", text)
    if layout.pad_faces[0]:
        yield made("CellData/pressure", (steps * cells,), "<f4", np.nan, "Pa", "contact pressure")
    for q in maps_of(layout).values():
        yield made(f"CellData/{q.name}", (steps * cells,), "<f4", np.nan, q.unit, f"{q.label}, ccm")
    for name, values in shared_steps(layout.axes[-1].values, points, _advances(layout, cells)).items():
        yield made(f"Steps/{name}", values.shape, values.dtype.str, 0)


def _advances(layout: Any, cells: int) -> dict[str, int]:
    """By how much the values of each array on the cells advance from step to step."""
    moving = ("status", *["pressure"] * bool(layout.pad_faces[0]), *maps_of(layout))
    return {"part": 0, "candidate": 0, **dict.fromkeys(moving, cells)}


def skeleton(layout: Any, surface: Surface) -> dict[str, np.ndarray]:
    """What is known before a case is solved, by dataset; pads wait in a corner of the object, without area."""
    points, cells = sizes(layout)
    counts, (n, m) = layout.pad_faces, surface.counts
    pads = FINGERS * int(np.prod(layout.shape[-3:-1])) * bool(counts[0])
    quads = quads_of(counts, n, pads) if pads else np.empty((0, 4), int)
    # Points at NaN or 0 would spoil a viewer's bounding box; a point of the object does not.
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


def fill_grid(writer: Any) -> None:
    """Write points and values of every force, from what the file holds of the first point of its sweep."""
    layout = writer.result().layout
    _, cells = sizes(layout)
    if not cells:
        return
    candidate = writer.read(f"{PATH}/CellData/candidate")
    first = (0,) * (len(layout.shape) - 3)
    states = writer.read("status/code")[first].reshape(-1, layout.shape[-1])
    for k in range(layout.shape[-1]):
        start, state = k * cells, states[:, k]
        # Index -1 picks the last candidate's state, which the where hides again.
        writer.fill(f"{PATH}/CellData/status", start, np.where(candidate == NOBODY, -1, state[candidate].astype(int)))
        for name, q in maps_of(layout).items():
            path = f"{name}/ccm" if q.by_model else f"{name}/{name}"
            values = writer.read(path)[first].reshape(states.shape)[:, k]
            shown = np.where(state == DONE, values, np.nan)
            writer.fill(f"{PATH}/CellData/{name}", start, np.where(candidate == NOBODY, np.nan, shown[candidate]))
        if layout.pad_faces[0]:
            _fill_pads(writer, layout, k, state)


def _fill_pads(writer: Any, layout: Any, k: int, state: np.ndarray) -> None:
    """Fronts and pressures of all candidates at one force; of those that are not solved nothing is seen."""
    points, cells = sizes(layout)
    i, j = layout.pad_faces
    width, faces = FINGERS * (i + 1) * (j + 1), FINGERS * i * j
    for c in np.flatnonzero(state == DONE):
        index = (*(0,) * (len(layout.shape) - 3), *divmod(int(c), layout.shape[-2]), k)
        row = int(np.ravel_multi_index(index, layout.shape))
        centroid, pressure = (writer.read(f"patch/{name}", row) for name in ("centroid", "pressure"))
        R, o = (writer.read(f"fingers/pose_{name}", index) for name in ("rotation", "origin"))
        if not all(np.isfinite(v).all() for v in (centroid, pressure, R, o)):
            # Such a pad stays in its corner, without area.
            continue
        face = np.stack([corners_of(x.reshape(i, j, 3)).reshape(-1, 3) for x in centroid])
        placed = np.einsum("fab,fnb->fna", R, face) + o[:, None]
        writer.fill(f"{PATH}/Points", k * points + layout.surface[0] + c * width, placed.reshape(-1, 3))
        writer.fill(f"{PATH}/CellData/pressure", k * cells + layout.surface[1] + c * faces, pressure.ravel())


def corners_of(centres: np.ndarray) -> np.ndarray:
    """Corners ``(i + 1, j + 1, c)`` of a grid of faces from their centres ``(i, j, c)``, continued beyond the rim."""
    for axis in (0, 1):
        c = np.moveaxis(centres, axis, 0)
        if len(c) > 1:
            # Continued by a line and averaged: the outermost corners lie half a face beyond the centres.
            c = np.concatenate([2 * c[:1] - c[1:2], c, 2 * c[-1:] - c[-2:-1]])
            c = 0.5 * (c[1:] + c[:-1])
        else:
            # A single face has no neighbour to take the pitch from.
            c = np.concatenate([c, c])
        centres = np.moveaxis(c, 0, axis)
    return centres


def topology(points: int, blocks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """Datasets that tell the cells: blocks of triangles ``(m, 3)`` and quadrilaterals ``(m, 4)``, one after another."""
    corners = np.repeat([b.shape[1] for b in blocks], [len(b) for b in blocks])
    numbers = {"Points": points, "Cells": len(corners), "ConnectivityIds": int(corners.sum())}
    found = {f"NumberOf{name}": np.array([number], "<i8") for name, number in numbers.items()}
    return found | {
        "Connectivity": np.concatenate([b.ravel() for b in blocks]).astype("<i8"),
        "Offsets": np.concatenate([[0], np.cumsum(corners)]).astype("<i8"),
        "Types": np.array([KINDS[n] for n in (3, 4)], "u1")[corners - 3],
    }


def quads_of(faces: tuple[int, int], first: int, count: int = 1) -> np.ndarray:
    """Corners ``(count i j, 4)`` of the faces of equal grids of ``i x j`` faces, whose points follow ``first``."""
    i, j = faces
    number = first + np.arange(count * (i + 1) * (j + 1)).reshape(count, i + 1, j + 1)
    corners = [number[:, :-1, :-1], number[:, 1:, :-1], number[:, 1:, 1:], number[:, :-1, 1:]]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def shared_steps(
    steps: Sequence[float], points: int, on_cells: Mapping[str, int], on_points: Mapping[str, int] | None = None
) -> dict[str, np.ndarray]:
    """Datasets below ``Steps`` that say where each step begins, if all share the cells of the first.

    ``on_cells`` and ``on_points`` give for each array by how many values it advances: 0 for one that stays.
    """
    number, none = np.arange(len(steps), dtype="<i8"), np.zeros(len(steps), "<i8")
    found = {"Values": np.asarray(steps, "<f8"), "NumberOfParts": none + 1, "PartOffsets": none}
    found |= {"PointOffsets": points * number, "CellOffsets": none[:, None], "ConnectivityIdOffsets": none[:, None]}
    for kind, arrays in (("Cell", on_cells), ("Point", on_points or {})):
        found |= {f"{kind}DataOffsets/{name}": size * number for name, size in arrays.items()}
    return found


def write_grid(
    path: Path, points: np.ndarray, cells: np.ndarray, on_cells: Arrays, on_points: Arrays | None = None,
    steps: Sequence[float] = (), about: str = "",
) -> None:  # fmt: skip
    """Write a grid of triangles or of quadrilaterals.

    Parameters
    ----------
    path : Path
        File to write; it appears under its name when it is complete.
    points : (n, 3) array
        Points [m]; ``(steps, n, 3)`` over ``steps``.
    cells : (m, 3) or (m, 4) array
        Points of every cell.
    on_cells, on_points : dict of arrays
        Values ``(m, ...)`` and ``(n, ...)`` by name, with a leading axis over ``steps`` where there are any.
    steps : sequence of float
        What a viewer's time slider shows; empty for a grid at one moment.
    about : str
        A sentence that is kept in the file.

    Raises
    ------
    StudyError
        If the file cannot be written.
    """
    with beside(path) as part, h5py.File(part, "w", libver=LIBVER) as file:
        file.attrs["about"] = about
        _write(file.create_group("VTKHDF"), points, cells, on_cells, on_points or {}, steps)


def _write(
    root: h5py.Group, points: np.ndarray, cells: np.ndarray, on_cells: Arrays, on_points: Arrays, steps: Sequence[float]
) -> None:
    head(root, len(steps))
    for name, values in topology(points.shape[-2], [cells]).items():
        root[name] = values
    root["Points"] = np.asarray(points, "<f8").reshape(-1, 3)
    for group, arrays in (("CellData", on_cells), ("PointData", on_points)):
        made = root.create_group(group)
        for name, values in arrays.items():
            # h5py stores bool as an enum; readers of VTKHDF expect plain numbers.
            flat = np.asarray(values).reshape(-1, *np.shape(values)[2 if len(steps) else 1 :])
            made[name] = flat.astype("<i8" if flat.dtype.kind in "iub" else "<f8")
    if len(steps):
        sizes = dict.fromkeys(on_cells, len(cells)), dict.fromkeys(on_points, points.shape[-2])
        for name, values in shared_steps(steps, points.shape[-2], *sizes).items():
            root[f"Steps/{name}"] = values


def head(root: h5py.Group, steps: int) -> None:
    """Attributes of a grid, over so many steps or over none."""
    # No newer version than needed: readers refuse files that are newer than they are.
    root.attrs.create("Version", np.array([2, 0] if steps else [1, 0], "<i8"))
    # VTKHDF demands a fixed-length string here.
    root.attrs.create("Type", b"UnstructuredGrid", dtype="S16")
    if steps:
        root.require_group("Steps").attrs.create("NSteps", steps, dtype="<i8")
