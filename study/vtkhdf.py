"""Files that ParaView and `pyvista.read` open: an unstructured grid as VTKHDF, at one moment or over several forces.

It is HDF5 like the result file, but a file of its own: readers of VTKHDF look for one grid at the top. Written so that
also the oldest readers take it (static: version 1.0, VTK 9.1 on; over forces: 2.0 with one topology for all steps).
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np

from study.exits import CANNOT_WRITE, StudyError

LIBVER = ("earliest", "v110")
KINDS = {3: 5, 4: 9}  # VTK's numbers for triangles and quadrilaterals, by their corners
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
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with h5py.File(part, "w", libver=LIBVER) as file:
            file.attrs["about"] = about
            _write(file.create_group("VTKHDF"), points, cells, on_cells, on_points or {}, steps)
        part.replace(path)
    except (OSError, RuntimeError) as error:
        part.unlink(missing_ok=True)
        reason = getattr(error, "strerror", None) or error
        raise StudyError(CANNOT_WRITE, f"{path}: cannot be written: {reason}; choose another place") from error


def _write(
    root: h5py.Group, points: np.ndarray, cells: np.ndarray, on_cells: Arrays, on_points: Arrays, steps: Sequence[float]
) -> None:
    count, corners = cells.shape
    root.attrs.create("Version", np.array([2, 0] if len(steps) else [1, 0], "<i8"))
    root.attrs.create("Type", b"UnstructuredGrid", dtype="S16")
    for name, number in (("Points", points.shape[-2]), ("Cells", count), ("ConnectivityIds", cells.size)):
        root[f"NumberOf{name}"] = np.array([number], "<i8")
    root["Points"] = np.asarray(points, "<f8").reshape(-1, 3)
    root["Connectivity"] = cells.astype("<i8").ravel()
    root["Offsets"] = corners * np.arange(count + 1, dtype="<i8")
    root["Types"] = np.full(count, KINDS[corners], "u1")
    for group, arrays in (("CellData", on_cells), ("PointData", on_points)):
        made = root.create_group(group)
        for name, values in arrays.items():
            flat = np.asarray(values).reshape(-1, *np.shape(values)[2 if len(steps) else 1 :])
            made[name] = flat.astype("<i8" if flat.dtype.kind in "iub" else "<f8")
    if len(steps):
        _write_steps(root, points.shape[-2], count, on_cells, on_points, steps)


def _write_steps(
    root: h5py.Group, points: int, cells: int, on_cells: Arrays, on_points: Arrays, steps: Sequence[float]
) -> None:
    """Where the values of each step begin; the cells are those of the first step throughout."""
    group, number = root.create_group("Steps"), np.arange(len(steps), dtype="<i8")
    group.attrs.create("NSteps", len(steps), dtype="<i8")
    group["Values"] = np.asarray(steps, "<f8")
    group["NumberOfParts"] = np.ones(len(steps), "<i8")
    group["PartOffsets"] = np.zeros(len(steps), "<i8")
    group["PointOffsets"] = points * number
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        group[name] = np.zeros((len(steps), 1), "<i8")
    for kind, arrays, size in (("Cell", on_cells, cells), ("Point", on_points, points)):
        offsets = group.create_group(f"{kind}DataOffsets")
        for name in arrays:
            offsets[name] = size * number
