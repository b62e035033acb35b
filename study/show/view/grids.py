"""A result file as grids for ParaView and pyvista: the object with its maps, and one candidate's pads. SI units."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.result.layout import DONE
from softjaw.study.result.vtkhdf import NOBODY, quads_of, write_grid
from softjaw.study.show.grasps import Index, field, forces
from softjaw.study.show.view.model import View, maps_of


def write_grids(view: View, index: Index, path: Path) -> list[Path]:
    """Write the object, and beside it the chosen candidate's pads at this force and over all forces; what was written.

    ``NAME.vtkhdf`` has every map of the file as cell data, once for each force (``quality, 5 N``).
    ``NAME-pads.vtkhdf`` has both pads' contact faces at the chosen case, ``NAME-pads-over-force.vtkhdf`` over the
    forces, as steps of ParaView's time slider.
    """
    _write_object(view, index, path)
    written, title = [path], f"{view.ds.attrs['title']}: {view.summary(index, view.ds.attrs['score'])[0]}"
    fronts = {k: found for k in range(len(forces(view.ds))) if (found := _fronts(view, (*index[:-1], k)))}
    if index[-1] in fronts:
        written.append(path.with_name(f"{path.stem}-pads{path.suffix}"))
        write_grid(written[-1], *fronts[index[-1]], about=title)
    if len(fronts) > 1:
        written.append(path.with_name(f"{path.stem}-pads-over-force{path.suffix}"))
        points, (quads, *_), values = zip(*fronts.values(), strict=True)
        over = {name: np.stack([one[name] for one in values]) for name in values[0]}
        steps = [float(forces(view.ds)[k]) for k in fronts]
        write_grid(written[-1], np.stack(points), quads, over, steps=steps, about=title)
    return written


def _write_object(view: View, index: Index, path: Path) -> None:
    x, corners, cell = view.surface
    if not len(corners):
        raise StudyError(OTHER_FILE, f"{view.ds.attrs['file']}: {view.note or 'there is no object to write'}")
    on_cells: dict[str, np.ndarray] = {"candidate": cell}
    maps = {name: field(view.ds, name) for name in maps_of(view.ds)}
    for k, force in enumerate(forces(view.ds)):
        state = view.state(k)
        values = {name: np.where(state == DONE, view.over_candidates(v, k), np.nan) for name, v in maps.items()}
        for name, found in {"status": state.astype(float), **values}.items():
            on_cells[f"{name}, {force:g} N"] = np.where(cell == NOBODY, np.nan, found[cell])
    on_points = {}
    if view.displacement(index) is not None:
        name = f"displacement, candidate {view.candidate(index)}, {forces(view.ds)[index[-1]]:g} N"
        on_points[name] = view.moved(index) - x
    about = f"{view.ds.attrs['title']}; cell data: maps (CCM) in SI units, status 0 not computed, 1 complete, 2 failed"
    write_grid(path, x, corners, on_cells, on_points, about=about)


def _fronts(view: View, index: Index) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]] | None:
    """Points ``(n, 3)``, faces ``(m, 4)`` and values of both pads' contact faces; None where they are not stored."""
    both = view.pads(index)
    if not all(pad.pressure.size for pad in both) or not both:
        return None
    i, j = both[0].pressure.shape
    values = {name: np.concatenate([getattr(pad, name).ravel() for pad in both]) for name in ("pressure", "area")}
    values["normal"] = np.concatenate([pad.normal.reshape(-1, 3) for pad in both])
    values["finger"] = np.repeat([1, 2], i * j)
    return np.concatenate([pad.face.reshape(-1, 3) for pad in both]), quads_of((i, j), 0, 2), values
