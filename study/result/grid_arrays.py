"""Cells and steps of a grid as the arrays of a VTKHDF file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

KINDS = {3: 5, 4: 9}  # VTK's numbers for triangles and quadrilaterals, by their corners


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
