"""What ParaView and `pyvista.read` open: an unstructured grid as VTKHDF, at one moment or over several forces.

Written so that also the oldest readers take it (static: version 1.0, VTK 9.1 on; over forces: 2.0 with one topology
for all steps). `write_grid` makes a file of its own; a result file has such a grid at its top too (`grid`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np

from softjaw.study.messages import beside
from softjaw.study.result.grid import shared_steps, topology

LIBVER = ("earliest", "v110")
Arrays = Mapping[str, np.ndarray]


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
            flat = np.asarray(values).reshape(-1, *np.shape(values)[2 if len(steps) else 1 :])
            made[name] = flat.astype("<i8" if flat.dtype.kind in "iub" else "<f8")
    if len(steps):
        sizes = dict.fromkeys(on_cells, len(cells)), dict.fromkeys(on_points, points.shape[-2])
        for name, values in shared_steps(steps, points.shape[-2], *sizes).items():
            root[f"Steps/{name}"] = values


def head(root: h5py.Group, steps: int) -> None:
    """Attributes of a grid, over so many steps or over none."""
    root.attrs.create("Version", np.array([2, 0] if steps else [1, 0], "<i8"))
    root.attrs.create("Type", b"UnstructuredGrid", dtype="S16")
    if steps:
        root.require_group("Steps").attrs.create("NSteps", steps, dtype="<i8")
