"""Faces of a contact patch from a VTK file (VTU, VTP), as ParaView exports them."""

from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy

from softjaw.study.messages import OTHER_FILE, StudyError, closest
from softjaw.study.patch.faces import ReadPatch, checked, corner_geometry
from softjaw.study.patch.patch_reader import FACTORS, Reading, check_count, refused, split_header

TRIANGLE, POLYGON, PIXEL, QUAD = 5, 7, 8, 9  # VTK's cell types


def read_vtk(path: Path, reading: Reading) -> ReadPatch:
    """Loaded faces of a VTU or VTP file of triangles and quadrilaterals.

    The pressure is a scalar array of the cells, or one of the points, whose mean over its corners a face takes.
    Normals are the cells' array ``Normals`` if there is one, and follow from the order of the corners otherwise.
    """
    grid = _grid(path)
    if reading.unit is None:
        raise refused(path, None, "coordinates", "no unit, which these files never have", "a unit of length",
                       "add --unit mm, or m or cm: units are not guessed")  # fmt: skip
    ids = _corner_ids(path, grid)
    if ids.min() < 0 or ids.max() >= grid.n_points:
        raise StudyError(OTHER_FILE, f"{path}: a cell refers to a point that does not exist; write the file again")
    name, values, at_points = _pressure_array(path, grid, reading)
    unit = (split_header(name, reading.pressure_name) or ("", None))[1] or reading.pressure_unit
    if unit is None:
        raise refused(path, None, name, "no unit", "a unit of pressure",
                       f"add --pressure-unit kpa, or name the array {name}_kpa: units are not guessed")  # fmt: skip
    if len(values) != (grid.n_points if at_points else len(ids)):
        text = f"{path}: damaged ('{name}' has {len(values)} values for {len(ids)} cells); write it again"
        raise StudyError(OTHER_FILE, text)
    with np.errstate(all="ignore"):  # what is not finite is reported with its place
        corners = FACTORS["length"][reading.unit] * np.asarray(grid.points).astype(float)[ids]
        pressure = FACTORS["pressure"][unit] * values.astype(float)
    notes: tuple[str, ...] = ()
    if at_points:
        pressure, triangle = pressure[ids], ids[:, -1] == ids[:, 2]  # whose repeated last corner counts once
        pressure = np.where(triangle, pressure[:, :3].mean(axis=1), pressure.mean(axis=1))
        notes = (f"{path}: '{name}' belongs to the points; every face takes the mean of its corners",)
    centroid, area, normal = corner_geometry(corners)
    given = (np.asarray(array) for key, array in grid.cell_data.items() if key.lower() in ("normals", "normal"))
    normal = next((array.astype(float) for array in given if array.shape == normal.shape), normal)
    return checked(str(path), "cell {}".format, centroid, area, normal, pressure, corners, notes, reading.flip_normals)


def _grid(path: Path) -> Any:
    """The data set of a file as an unstructured grid; VTK's own complaints become one sentence."""
    # VTK writes its complaints past Python's streams
    with pv.vtk_verbosity("off"), pv.VtkErrorCatcher(send_to_logging=False) as complaints:
        reader = pv.get_reader(path).reader
        if able := reader.CanReadFile(str(path)):
            reader.Update()
    grid = pv.wrap(reader.GetOutput())
    if not able or complaints.events or grid is None:
        kind = path.suffix[1:].upper()
        raise StudyError(OTHER_FILE, f"{path}: damaged or no {kind} file; write it again, from ParaView as {kind}")
    if isinstance(grid, pv.PolyData):
        grid = grid.cast_to_unstructured_grid()
    check_count(path, grid.n_cells)
    if grid.n_cells == 0:
        raise refused(path, None, "cells", "none", "triangles or quadrilaterals",
                       "export the contact surface with its cells")  # fmt: skip
    return grid


def _corner_ids(path: Path, grid: Any) -> NDArray[np.int64]:
    """Point numbers around every cell ``(n, k)``, k = 3 or 4; triangles among quadrilaterals repeat the last."""
    kinds, points = np.asarray(grid.celltypes), np.asarray(grid.cell_connectivity)
    start = vtk_to_numpy(grid.GetCells().GetOffsetsArray())
    sizes = np.diff(start)
    # ParaView writes rectangles of image data as pixels, whose corners go line by line
    flat = np.isin(kinds, (TRIANGLE, QUAD, PIXEL)) | ((kinds == POLYGON) & (sizes >= 3) & (sizes <= 4))
    if not flat.all():
        i = int(np.argmin(flat))
        name = grid.GetCell(i).GetClassName().removeprefix("vtk")
        raise refused(path, None, f"cell {i}", f"a {name} of {sizes[i]} points", "triangles and quadrilaterals only",
                       "in ParaView, extract the surface (Extract Surface), triangulate it (Triangulate) and save that",
                       )  # fmt: skip
    order = np.minimum(np.arange(sizes.max()), sizes[:, None] - 1)
    if (kinds == PIXEL).any():
        order[kinds == PIXEL] = [0, 1, 3, 2]
    return points[start[:-1, None] + order].astype(np.int64)


def _pressure_array(path: Path, grid: Any, reading: Reading) -> tuple[str, NDArray[Any], bool]:
    """Name and values of the scalar array that holds the pressure, and whether it belongs to the points."""
    names: list[str] = []
    for at_points, data in ((False, grid.cell_data), (True, grid.point_data)):  # cells come first
        scalars = {name: np.asarray(array) for name, array in data.items() if np.ndim(array) == 1}
        fits = [name for name in scalars if (split_header(name, reading.pressure_name) or ("",))[0] == "pressure"]
        if len(fits) == 1:
            return fits[0], scalars[fits[0]], at_points
        names += fits or scalars
        if fits:
            break
    wanted = reading.pressure_name or "pressure"
    remedy = f"give its name with --pressure-name {closest(wanted, names) or (names[0] if names else 'NAME')}"
    actual = f"the arrays {', '.join(names)}" if names else "no array of scalars"
    raise refused(path, None, wanted, actual, "one array of the pressure", remedy)
