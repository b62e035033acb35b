"""Filling ``/VTKHDF`` of a result file, by one rank after all cases: maps on the object, pads where they end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from softjaw.study.quantities import FINGERS
from softjaw.study.result.grid import NOBODY, PATH, maps_of, sizes
from softjaw.study.result.layout import DONE, Layout
from softjaw.study.show.view.pads import corners_of

if TYPE_CHECKING:
    from softjaw.study.result.store import ResultWriter


def fill_grid(writer: ResultWriter) -> None:
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
        writer.fill(f"{PATH}/CellData/status", start, np.where(candidate == NOBODY, -1, state[candidate].astype(int)))
        for name, q in maps_of(layout).items():
            path = f"{name}/curved" if q.by_model else f"{name}/{name}"
            values = writer.read(path)[first].reshape(states.shape)[:, k]
            shown = np.where(state == DONE, values, np.nan)
            writer.fill(f"{PATH}/CellData/{name}", start, np.where(candidate == NOBODY, np.nan, shown[candidate]))
        if layout.front[0]:
            _fill_pads(writer, layout, k, state)


def _fill_pads(writer: ResultWriter, layout: Layout, k: int, state: np.ndarray) -> None:
    """Fronts and pressures of all candidates at one force; of those that are not solved nothing is seen."""
    points, cells = sizes(layout)
    i, j = layout.front
    width, faces = FINGERS * (i + 1) * (j + 1), FINGERS * i * j
    for c in np.flatnonzero(state == DONE):
        index = (*(0,) * (len(layout.shape) - 3), *divmod(int(c), layout.shape[-2]), k)
        row = int(np.ravel_multi_index(index, layout.shape))
        centroid, pressure = (writer.read(f"patch/{name}", row) for name in ("centroid", "pressure"))
        R, o = (writer.read(f"fingers/pose_{name}", index) for name in ("rotation", "origin"))
        if not all(np.isfinite(v).all() for v in (centroid, pressure, R, o)):
            continue
        front = np.stack([corners_of(x.reshape(i, j, 3)).reshape(-1, 3) for x in centroid])
        placed = np.einsum("fab,fnb->fna", R, front) + o[:, None]
        writer.fill(f"{PATH}/Points", k * points + layout.surface[0] + c * width, placed.reshape(-1, 3))
        writer.fill(f"{PATH}/CellData/pressure", k * cells + layout.surface[1] + c * faces, pressure.ravel())
