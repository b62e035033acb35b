"""A result file for ParaView and pyvista: the object with its maps, and all pads with their pressure. SI units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
import xarray as xr

from softjaw.study.messages import CANNOT_WRITE, OTHER_FILE, USAGE, StudyError, beside
from softjaw.study.quantities import DONE
from softjaw.study.show.grasps import field, forces, judge
from softjaw.study.show.object_surface import NOBODY
from softjaw.study.show.view.model import View, maps_of, view_of

ENDINGS = (".vtm", ".vtp")


def write_vtk(ds: xr.Dataset, path: Path, force: float | None = None) -> Path:
    """Write a dataset as a block for the object and, with ``.vtm``, one of all pads for every force.

    The object has every map as cell data, once for each force (``quality, 5 N``), the pads pressure, area, normal,
    finger and candidate. Positions are in the frame of the object's own file [m]. Of a sweep the first point is
    written. An object with a thin wall has the displacement of the best case, at ``force`` [N] if it is given.

    Raises
    ------
    StudyError
        The ending is another, the file cannot be written, or the object cannot be drawn.
    """
    if path.suffix.lower() not in ENDINGS:
        raise StudyError(USAGE, f"-o: found '{path}', expected a file ending in {' or '.join(ENDINGS)}")
    view, index = view_of(judge(ds), None, (None, None), force)
    if not len(view.surface.triangles):
        raise StudyError(OTHER_FILE, f"{ds.attrs['file']}: {view.note or 'there is no object to write'}")
    body = _object(view, index)
    blocks = pv.MultiBlock({"object": body})
    if path.suffix.lower() == ".vtm" and ds.attrs["patches"]:
        view.load()
        for k, level in enumerate(forces(ds)):
            if (pads := _pads(view, k)) is not None:
                blocks[f"pads, {level:g} N"] = pads
    with beside(path) as part:  # VTK itself only prints that it cannot write
        part.touch()
    (blocks if path.suffix.lower() == ".vtm" else body).save(path)
    if not path.stat().st_size:
        raise StudyError(CANNOT_WRITE, f"{path}: cannot be written; choose another place")
    return path


def _object(view: View, index: tuple[int, ...]) -> pv.PolyData:
    """The object's surface with its maps."""
    x, corners, cell = view.surface
    body = pv.PolyData.from_regular_faces(view.placed.to_object(x), corners)
    body.cell_data["candidate"] = cell
    maps = {name: field(view.ds, name) for name in maps_of(view.ds)}
    for k, force in enumerate(forces(view.ds)):
        state = view.state(k)
        values = {name: np.where(state == DONE, view.over_candidates(v, k), np.nan) for name, v in maps.items()}
        for name, found in {"status": state.astype(float), **values}.items():
            body.cell_data[f"{name}, {force:g} N"] = np.where(cell == NOBODY, np.nan, found[cell])
    if view.displacement(index) is not None:
        name = f"displacement, candidate {view.candidate(index)}, {forces(view.ds)[index[-1]]:g} N"
        body.point_data[name] = (view.moved(index) - x) @ view.placed.rotation.T
    return body


def _pads(view: View, force: int) -> pv.PolyData | None:
    """Both pads' contact faces of all candidates at a force level; None where none is stored."""
    cases = [(c, view.pads(view.index(c, force))) for c in range(view.candidates)]
    pads = [(c, finger, pad) for c, both in cases for finger, pad in enumerate(both, start=1) if pad.pressure.size]
    if not pads:
        return None
    corners = np.concatenate([pad.quads() for *_, pad in pads])
    faces = pv.PolyData.from_regular_faces(
        view.placed.to_object(corners.reshape(-1, 3)), np.arange(4 * len(corners)).reshape(-1, 4)
    )
    sizes = [pad.pressure.size for *_, pad in pads]
    faces.cell_data["candidate"] = np.repeat([c for c, *_ in pads], sizes)
    faces.cell_data["finger"] = np.repeat([finger for _, finger, _ in pads], sizes)
    for name in ("pressure", "area"):
        faces.cell_data[name] = np.concatenate([getattr(pad, name).ravel() for *_, pad in pads])
    normal = np.concatenate([pad.normal.reshape(-1, 3) for *_, pad in pads])
    faces.cell_data["normal"] = normal @ view.placed.rotation.T
    return faces
