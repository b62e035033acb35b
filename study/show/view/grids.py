"""A result file as grids for ParaView and pyvista: the object with its maps, and one candidate's pads. SI units."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.result.layout import DONE
from softjaw.study.result.vtkhdf import NOBODY, write_grid
from softjaw.study.show.view.model import View
from softjaw.study.show.view.pads import Pad, pads


def write_grids(view: View, index: tuple[int, ...], path: Path) -> list[Path]:
    """Write the object, and beside it the chosen candidate's pads at this force and over all forces; what was written.

    ``NAME.vtkhdf`` has every map of the file as cell data, once for each force (``quality, 5 N``).
    ``NAME-pads.vtkhdf`` has both pads' fronts at the chosen case, ``NAME-pads-over-force.vtkhdf`` over the forces, as
    steps of ParaView's time slider.
    """
    written = [path]
    _write_object(view, index, path)
    forces = [k for k in range(len(view.data.forces)) if _stored(view, (*index[:-1], k))]
    about = f"{view.data.title}: {view.words(index, view.data.score)[0]}"
    if index[-1] in forces:
        written.append(path.with_name(f"{path.stem}-pads{path.suffix}"))
        fronts = _fronts(pads(view.data, view.gripper, index))
        write_grid(written[-1], fronts[0], fronts[1], fronts[2], about=about)
    if len(forces) > 1:
        written.append(path.with_name(f"{path.stem}-pads-over-force{path.suffix}"))
        each = [_fronts(pads(view.data, view.gripper, (*index[:-1], k))) for k in forces]
        over = {name: np.stack([values[name] for _, _, values in each]) for name in each[0][2]}
        steps = [float(view.data.forces[k]) for k in forces]
        write_grid(written[-1], np.stack([x for x, _, _ in each]), each[0][1], over, steps=steps, about=about)
    return written


def _stored(view: View, index: tuple[int, ...]) -> bool:
    found = pads(view.data, view.gripper, index)
    return len(found) == 2 and all(pad.pressure is not None for pad in found)


def _write_object(view: View, index: tuple[int, ...], path: Path) -> None:
    x, corners, cell = view.surface
    if not len(corners):
        raise StudyError(OTHER_FILE, f"{view.data.ds.attrs['file']}: {view.note or 'there is no object to write'}")
    on_cells: dict[str, np.ndarray] = {"candidate": cell}
    for k, force in enumerate(view.data.forces):
        state = view.state(k)
        on_cells[f"status, {force:g} N"] = _spread(state.astype(float), cell)
        for q in view.data.result.layout.quantities:
            found = view.data.map(q.name) if q.group == "maps" else None
            if found is not None:
                values = np.where(state == DONE, view.over_candidates(found, k), np.nan)
                on_cells[f"{q.name}, {force:g} N"] = _spread(values, cell)
    on_points = {}
    if view.displacement(index) is not None:
        name = f"displacement, candidate {view.candidate(index)}, {view.data.forces[index[-1]]:g} N"
        on_points[name] = view.moved(index) - x
    about = f"{view.data.title}; cell data: maps of the curved model in SI units, status 0 missing, 1 done, 2 failed"
    write_grid(path, x, corners, on_cells, on_points, about=about)


def _spread(values: np.ndarray, cell: np.ndarray) -> np.ndarray:
    """Values of candidates ``(c,)`` on the triangles; NaN where there is no candidate."""
    return np.where(cell == NOBODY, np.nan, values[cell])


def _fronts(both: list[Pad]) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Points ``(n, 3)``, faces ``(m, 4)`` and values of both pads' fronts."""
    points, faces, count = [], [], 0
    for pad in both:
        i, j = pad.front.shape[:2]
        number = count + np.arange(i * j).reshape(i, j)
        faces.append(
            np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=2).reshape(-1, 4)
        )
        points.append(pad.front.reshape(-1, 3))
        count += i * j
    values = {
        "pressure": np.concatenate([pad.pressure.ravel() for pad in both if pad.pressure is not None]),
        "area": np.concatenate([pad.area.ravel() for pad in both if pad.area is not None]),
        "normal": np.concatenate([pad.normal.reshape(-1, 3) for pad in both if pad.normal is not None]),
        "finger": np.repeat([1, 2], [len(f) for f in faces]),
    }
    return np.concatenate(points), np.concatenate(faces), values
