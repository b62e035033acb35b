"""Patches from VTK's XML files (VTU, VTP), as ParaView and most solvers write them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

from softjaw.friction.patch import FloatArray
from softjaw.study.messages import OTHER_FILE, USAGE, StudyError
from softjaw.study.patch.columns import UNITS, split_header
from softjaw.study.patch.faces import Faces, corner_geometry
from softjaw.study.patch.reading import Reading, check_count
from softjaw.study.result.trial import trouble
from softjaw.study.scene.problems import Problem, closest

READERS = {".vtu": vtkXMLUnstructuredGridReader, ".vtp": vtkXMLPolyDataReader}
TRIANGLE, QUAD, POLYGON, PIXEL = 5, 9, 7, 8
NORMALS = ("normals", "normal")


def read_vtk(path: Path, reading: Reading) -> Faces:
    """Faces of a VTU or VTP file of triangles and quadrilaterals.

    The pressure is a scalar array of the cells, or one of the points, whose mean over its corners a face takes.
    Normals are the cells' array ``Normals`` if there is one, and follow from the order of the corners otherwise.
    """
    if why := trouble(lambda: _faces(path, reading)):
        raise StudyError(OTHER_FILE, f"{path}: is damaged ({why}); write it again")
    return _faces(path, reading)


def _faces(path: Path, reading: Reading) -> Faces:
    """As `read_vtk`, where VTK survives the file."""
    grid = _loaded(path)
    if reading.unit is None:
        _refuse(path, "coordinates", "no unit, which these files never tell", "a unit of length",
                "add --unit mm, or m or cm: units are not guessed")  # fmt: skip
    ids = _corner_ids(path, grid)
    if ids.min() < 0 or ids.max() >= grid.GetNumberOfPoints():
        raise StudyError(OTHER_FILE, f"{path}: a cell refers to a point that does not exist; write the file again")
    with np.errstate(all="ignore"):  # what is not finite is told of with its place
        corners = UNITS["length"][reading.unit] * vtk_to_numpy(grid.GetPoints().GetData()).astype(float)[ids]
    name, at_points = _pressure_array(path, grid, reading)
    unit = (split_header(name, reading.pressure_name) or ("", None))[1] or reading.pressure_unit
    if unit is None:
        _refuse(path, name, "no unit", "a unit of pressure",
                f"add --pressure-unit kpa, or name the array {name}_kpa: units are not guessed")  # fmt: skip
    data = grid.GetPointData() if at_points else grid.GetCellData()
    with np.errstate(all="ignore"):
        pressure = UNITS["pressure"][unit] * vtk_to_numpy(data.GetArray(name)).astype(float)
    if len(pressure) != (grid.GetNumberOfPoints() if at_points else len(ids)):
        text = f"'{name}' has {len(pressure)} values for {len(ids)} cells"
        raise StudyError(OTHER_FILE, f"{path}: damaged ({text}); write it again")
    centroid, area, normal = corner_geometry(corners)
    notes: tuple[str, ...] = ()
    if at_points:
        pressure = _mean_over_corners(pressure[ids], ids)
        notes = (f"{path}: '{name}' belongs to the points; every face takes the mean of its corners",)
    given = _given_normals(grid)
    normal = normal if given is None else given
    return Faces(str(path), lambda i: f"cell {i}", centroid, area, normal, pressure, corners, notes)


def _loaded(path: Path) -> Any:
    """The data set of a file; VTK's own complaints become one sentence."""
    before, heard = vtkOutputWindow.GetInstance(), vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(heard)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        reader = READERS[path.suffix.lower()]()
        reader.SetFileName(str(path))
        able = reader.CanReadFile(str(path))
        if able:
            reader.Update()
    finally:
        vtkOutputWindow.SetInstance(before)
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_INFO)
    grid = reader.GetOutput()
    if not able or heard.GetOutput() or grid is None:
        what = path.suffix[1:].upper()
        raise StudyError(OTHER_FILE, f"{path}: is damaged or no {what} file; write it again, from ParaView as {what}")
    check_count(str(path), grid.GetNumberOfCells())
    if grid.GetNumberOfCells() == 0:
        _refuse(path, "cells", "none", "triangles or quadrilaterals", "export the contact surface with its cells")
    return grid


def _corner_ids(path: Path, grid: Any) -> np.ndarray:
    """Point numbers around every cell ``(n, k)``, k = 3 or 4; triangles among quadrilaterals repeat the last."""
    kinds = np.array([grid.GetCellType(i) for i in range(grid.GetNumberOfCells())])
    sizes = np.array([grid.GetCell(i).GetNumberOfPoints() for i in range(len(kinds))])
    flat = np.isin(kinds, (TRIANGLE, QUAD, PIXEL)) | ((kinds == POLYGON) & (sizes >= 3) & (sizes <= 4))
    if not flat.all():
        i = int(np.argmin(flat))
        kind = grid.GetCell(i).GetClassName().removeprefix("vtk")
        _refuse(path, f"cell {i}", f"a {kind} of {sizes[i]} points", "triangles and quadrilaterals only",
                "in ParaView, extract the contact surface (Extract Surface), triangulate it (Triangulate) and save "
                "that")  # fmt: skip
    ids = np.empty((len(kinds), int(sizes.max())), dtype=np.int64)
    for i, size in enumerate(sizes):
        cell = grid.GetCell(i)
        order = (0, 1, 3, 2) if kinds[i] == PIXEL else range(size)
        found = [cell.GetPointId(k) for k in order]
        ids[i] = found + found[-1:] * (ids.shape[1] - size)
    return ids


def _pressure_array(path: Path, grid: Any, reading: Reading) -> tuple[str, bool]:
    """Name of the scalar array that holds the pressure, and whether it belongs to the points; cells come first."""
    names: list[str] = []
    for at_points, data in ((False, grid.GetCellData()), (True, grid.GetPointData())):
        for k in range(data.GetNumberOfArrays()):
            name, array = data.GetArrayName(k), data.GetArray(k)
            if array is None or name is None or array.GetNumberOfComponents() != 1:
                continue
            names.append(name)
            if (split_header(name, reading.pressure_name) or ("",))[0] == "pressure":
                return name, at_points
    wanted = reading.pressure_name or "pressure"
    near = closest(wanted, names)
    remedy = f"give its name with --pressure-name {near or (names[0] if names else 'NAME')}"
    _refuse(path, wanted, f"the arrays {', '.join(names)}" if names else "no array of scalars", "the pressure", remedy)
    raise AssertionError


def _mean_over_corners(values: FloatArray, ids: np.ndarray) -> FloatArray:
    """Mean over the corners of each face, ``(n, k) -> (n,)``; a repeated last corner counts once."""
    if ids.shape[1] == 4:
        triangle = ids[:, 3] == ids[:, 2]
        return np.where(triangle, values[:, :3].mean(axis=1), values.mean(axis=1))
    return values.mean(axis=1)


def _given_normals(grid: Any) -> FloatArray | None:
    data = grid.GetCellData()
    for k in range(data.GetNumberOfArrays()):
        array = data.GetArray(k)
        named = array is not None and (data.GetArrayName(k) or "").lower() in NORMALS
        if named and (array.GetNumberOfComponents(), array.GetNumberOfTuples()) == (3, grid.GetNumberOfCells()):
            return vtk_to_numpy(array).astype(float)
    return None


def _refuse(path: Path, key: str, found: str, expected: str, remedy: str) -> None:
    raise StudyError(USAGE, str(Problem(str(path), None, key, found, expected, remedy)))
