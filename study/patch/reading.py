"""Faces of a contact patch from a table (CSV) or a VTK file (VTU, VTP): read, brought to SI units and checked."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import ContactPatch, FloatArray, slivers
from softjaw.study.messages import OTHER_FILE, USAGE, StudyError
from softjaw.study.scene.problems import Problem, closest

ENDINGS = (".csv", ".vtu", ".vtp")
LARGEST_FILE = 100 * 2**20  # bytes
MOST_FACES = 500_000
MOST_PROBLEMS = 10  # reported of one file
FACTORS = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "area": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
    "pressure": {"pa": 1.0, "kpa": 1e3, "mpa": 1e6, "n/mm2": 1e6},
    "number": {"-": 1.0, "1": 1.0},
}
CENTRE, NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
CORNERS = tuple(f"{axis}{k}" for k in (1, 2, 3, 4) for axis in "xyz")
KINDS = dict.fromkeys((*CENTRE, *CORNERS), "length") | dict.fromkeys(NORMAL, "number")
KINDS |= {"area": "area", "pressure": "pressure"}
ALIASES = {f"{stem}_{axis}": f"n{axis}" for stem in ("n", "normal") for axis in "xyz"}
HEADER = re.compile(r"(?P<name>.*?)\s*(?:_(?P<tail>[^_\s\[\]()]+)|[\[(](?P<boxed>[^\[\]()]*)[\])])?")
TRIANGLE, POLYGON, PIXEL, QUAD = 5, 7, 8, 9  # VTK's cell types
LARGEST = {"centroid": (1e3, "m"), "area": (1e4, "m^2"), "pressure": (1e12, "Pa")}  # beyond is no contact on earth
LONGEST_NORMAL, LEAST_LOAD = 1e6, 1e-12  # -, N


@dataclass(frozen=True)
class Reading:
    """What the user says about a file that the file does not say itself.

    Parameters
    ----------
    unit : str or None
        Unit of lengths and, squared, of areas that carry none: ``m``, ``cm`` or ``mm``.
    pressure_unit : str or None
        Unit of a pressure that carries none: ``pa``, ``kpa`` or ``mpa``.
    pressure_name : str or None
        Name of the column or data array that holds the pressure; by default ``pressure``.
    flip_normals : bool
        Whether all normals are turned to the other side.
    """

    unit: str | None = None
    pressure_unit: str | None = None
    pressure_name: str | None = None
    flip_normals: bool = False

    def unit_of(self, kind: str) -> str | None:
        """Unit of a bare ``length``, ``area``, ``pressure`` or ``number``."""
        area = f"{self.unit}2" if self.unit else None
        return {"length": self.unit, "area": area, "pressure": self.pressure_unit, "number": "-"}[kind]


@dataclass(frozen=True, eq=False)
class ReadPatch:
    """The loaded faces of a file as a patch [m, Pa].

    ``faces`` counts all faces; ``place`` gives the words for the place of a loaded face, ``line 7`` or ``cell 3``;
    ``notes`` say what the reader of the answer should know about the file.
    """

    file: str
    patch: ContactPatch
    faces: int
    place: Callable[[int], str]
    notes: tuple[str, ...] = ()


def read_patch(file: str, reading: Reading) -> ReadPatch:
    """The patch in a file, in the file's coordinates.

    Raises
    ------
    StudyError
        With code 3 if the file cannot be read as what its ending says, 2 if what it holds is no patch.
    """
    path = Path(file)
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        text = f"{file}: found {f'the ending {path.suffix}' if path.suffix else 'no ending'}, expected one of "
        raise StudyError(USAGE, f"{text}{', '.join(ENDINGS)}; export the patch as CSV, or as VTU or VTP from ParaView")
    try:
        size = path.stat().st_size
        if not path.is_file():  # a device or a pipe may have no end
            raise StudyError(OTHER_FILE, f"{file}: is no regular file; name the file of a patch")
        path.open("rb").close()
    except OSError as error:
        raise StudyError(OTHER_FILE, f"{file}: cannot be read ({error.strerror}); check the path") from error
    if size > LARGEST_FILE:
        text = f"{file}: has {size >> 20} MiB, more than {LARGEST_FILE >> 20} MiB"
        raise StudyError(USAGE, f"{text}; export the contact surface alone")
    if ending == ".csv":
        from softjaw.study.patch.table import read_table

        return checked(read_table(path, reading), reading.flip_normals)
    from softjaw.study.result.trial import trouble

    if why := trouble(lambda: _read_vtk(path, reading)):  # VTK may not survive the file
        raise StudyError(OTHER_FILE, f"{path}: is damaged ({why}); write it again")
    return checked(_read_vtk(path, reading), reading.flip_normals)


def refuse(problems: Sequence[Problem]) -> None:
    """Raise if there are problems, naming the first of them."""
    if problems:
        lines = [str(p) for p in problems[:MOST_PROBLEMS]]
        if len(problems) > len(lines):
            lines.append(f"{problems[0].file}: and {len(problems) - len(lines)} more")
        raise StudyError(USAGE, "\n".join(lines))


def check_count(file: object, count: int) -> None:
    """Refuse more faces than a patch may have, before they are read."""
    if count > MOST_FACES:
        text = f"{file}: found {count} faces, expected at most {MOST_FACES}; export the contact surface alone"
        raise StudyError(USAGE, text)


def split_header(header: str, pressure_name: str | None = None) -> tuple[str, str | None] | None:
    """Quantity and unit of a header (None where it has no unit); None for a column that has no meaning here.

    ``pressure_name`` is the header, with or without its unit, of the column that holds the pressure.

    Examples
    --------
    >>> split_header("x_mm"), split_header("Pressure [kPa]"), split_header("area"), split_header("x_inch")
    (('x', 'mm'), ('pressure', 'kpa'), ('area', None), None)
    """
    text = header.strip().lower()
    wanted = (pressure_name or "pressure").strip().lower()
    name, unit = text, None
    if found := HEADER.fullmatch(text):
        name = found["name"]
        unit = (found["tail"] or found["boxed"] or "").replace(" ", "").replace("^", "").replace("²", "2") or None
    if text in ALIASES or text in KINDS:
        name, unit = ALIASES.get(text, text), None
    if wanted == text:
        return "pressure", unit if unit in FACTORS["pressure"] else None
    if name == "pressure" or wanted == name:
        return ("pressure", unit) if wanted == name and unit in FACTORS["pressure"] else None
    known = name in KINDS and (unit is None or unit in FACTORS[KINDS[name]])
    return (name, unit) if known else None


# --- VTK --------------------------------------------------------------------------------------------------------------


def _read_vtk(path: Path, reading: Reading) -> Faces:
    """Faces of a VTU or VTP file of triangles and quadrilaterals.

    The pressure is a scalar array of the cells, or one of the points, whose mean over its corners a face takes.
    Normals are the cells' array ``Normals`` if there is one, and follow from the order of the corners otherwise.
    """
    grid = _grid(path)
    if reading.unit is None:
        refuse([Problem(str(path), None, "coordinates", "no unit, which these files never have", "a unit of length",
                        "add --unit mm, or m or cm: units are not guessed")])  # fmt: skip
    ids = _corner_ids(path, grid)
    if ids.min() < 0 or ids.max() >= grid.n_points:
        raise StudyError(OTHER_FILE, f"{path}: a cell refers to a point that does not exist; write the file again")
    name, values, at_points = _pressure_array(path, grid, reading)
    unit = (split_header(name, reading.pressure_name) or ("", None))[1] or reading.pressure_unit
    if unit is None:
        refuse([Problem(str(path), None, name, "no unit", "a unit of pressure",
                        f"add --pressure-unit kpa, or name the array {name}_kpa: units are not guessed")])  # fmt: skip
    if len(values) != (grid.n_points if at_points else len(ids)):
        text = f"'{name}' has {len(values)} values for {len(ids)} cells"
        raise StudyError(OTHER_FILE, f"{path}: damaged ({text}); write it again")
    with np.errstate(all="ignore"):  # what is not finite is reported with its place
        corners = FACTORS["length"][reading.unit] * np.asarray(grid.points).astype(float)[ids]
        pressure = FACTORS["pressure"][unit] * values.astype(float)
    notes: tuple[str, ...] = ()
    if at_points:
        pressure = _mean_over_corners(pressure[ids], ids)
        notes = (f"{path}: '{name}' belongs to the points; every face takes the mean of its corners",)
    centroid, area, normal = corner_geometry(corners)
    for key, array in grid.cell_data.items():
        if key.lower() in ("normals", "normal") and array.shape == normal.shape:
            normal = np.asarray(array).astype(float)
            break
    return Faces(str(path), lambda i: f"cell {i}", centroid, area, normal, pressure, corners, notes)


def _grid(path: Path) -> Any:
    """The data set of a file as an unstructured grid; VTK's own complaints become one sentence."""
    import pyvista as pv  # slow to import, and not needed for tables
    from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow

    # VTK writes its complaints past Python's streams
    before, complaints = vtkOutputWindow.GetInstance(), vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(complaints)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        reader = pv.get_reader(path).reader
        able = reader.CanReadFile(str(path))
        if able:
            reader.Update()
    finally:
        vtkOutputWindow.SetInstance(before)
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_INFO)
    grid = pv.wrap(reader.GetOutput())
    if not able or complaints.GetOutput() or grid is None:
        kind = path.suffix[1:].upper()
        raise StudyError(OTHER_FILE, f"{path}: is damaged or no {kind} file; write it again, from ParaView as {kind}")
    if isinstance(grid, pv.PolyData):
        grid = grid.cast_to_unstructured_grid()
    check_count(path, grid.n_cells)
    if grid.n_cells == 0:
        refuse([Problem(str(path), None, "cells", "none", "triangles or quadrilaterals",
                        "export the contact surface with its cells")])  # fmt: skip
    return grid


def _corner_ids(path: Path, grid: Any) -> NDArray[np.int64]:
    """Point numbers around every cell ``(n, k)``, k = 3 or 4; triangles among quadrilaterals repeat the last."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    kinds, points = np.asarray(grid.celltypes), np.asarray(grid.cell_connectivity)
    start = vtk_to_numpy(grid.GetCells().GetOffsetsArray())
    sizes = np.diff(start)
    # ParaView writes rectangles of image data as pixels, whose corners go line by line
    flat = np.isin(kinds, (TRIANGLE, QUAD, PIXEL)) | ((kinds == POLYGON) & (sizes >= 3) & (sizes <= 4))
    if not flat.all():
        i = int(np.argmin(flat))
        name = grid.GetCell(i).GetClassName().removeprefix("vtk")
        remedy = "in ParaView, extract the surface (Extract Surface), triangulate it (Triangulate) and save that"
        refuse([Problem(str(path), None, f"cell {i}", f"a {name} of {sizes[i]} points",
                        "triangles and quadrilaterals only", remedy)])  # fmt: skip
    order = np.minimum(np.arange(sizes.max()), sizes[:, None] - 1)
    if (kinds == PIXEL).any():
        order[kinds == PIXEL] = [0, 1, 3, 2]
    return points[start[:-1, None] + order].astype(np.int64)


def _pressure_array(path: Path, grid: Any, reading: Reading) -> tuple[str, NDArray[Any], bool]:
    """Name and values of the scalar array that holds the pressure, and whether it belongs to the points."""
    names: list[str] = []
    for at_points, data in ((False, grid.cell_data), (True, grid.point_data)):  # cells come first
        for name, array in data.items():
            if np.ndim(array) == 1:
                names.append(name)
                if (split_header(name, reading.pressure_name) or ("",))[0] == "pressure":
                    return name, np.asarray(array), at_points
    wanted = reading.pressure_name or "pressure"
    remedy = f"give its name with --pressure-name {closest(wanted, names) or (names[0] if names else 'NAME')}"
    found = f"the arrays {', '.join(names)}" if names else "no array of scalars"
    refuse([Problem(str(path), None, wanted, found, "the pressure", remedy)])
    raise AssertionError


def _mean_over_corners(values: FloatArray, ids: NDArray[np.int64]) -> FloatArray:
    """Mean over the corners of each face, ``(n, k) -> (n,)``; a repeated last corner counts once."""
    triangle = ids[:, -1] == ids[:, 2]
    return np.where(triangle, values[:, :3].mean(axis=1), values.mean(axis=1))


# --- faces ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces of a file in SI units, not yet checked.

    Parameters
    ----------
    file : str
    place : callable
        Words for the place of face ``i`` in the file.
    centroid, normal : (n, 3) array
        Centres [m] and normals of any length [-].
    area, pressure : (n,) array
        Areas [m^2] and pressures [Pa].
    corners : (n, k, 3) array or None
        Corners in order around each face [m].
    notes : tuple of str
    """

    file: str
    place: Callable[[int], str]
    centroid: FloatArray
    area: FloatArray
    normal: FloatArray
    pressure: FloatArray
    corners: FloatArray | None = None
    notes: tuple[str, ...] = ()

    def problems(
        self, wrong: NDArray[np.bool_], key: str, found: Callable[[int], str], expected: str, remedy: str
    ) -> list[Problem]:
        """A problem for every face that is wrong ``(n,)``."""
        places = np.flatnonzero(wrong).tolist()
        return [Problem(f"{self.file}, {self.place(i)}", None, key, found(i), expected, remedy) for i in places]


def corner_geometry(corners: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres, areas and normals of plane faces from their corners.

    Parameters
    ----------
    corners : (n, k, 3) array
        Three or four corners around each face; a triangle among quadrilaterals repeats its last corner [m].

    Returns
    -------
    centroid : (n, 3) array
        Mean of the corners [m].
    area : (n,) array
        Half the product of the diagonals [m^2].
    normal : (n, 3) array
        By the right-hand rule; zero for a face without area.
    """
    q = corners
    last = q.shape[1] - 1
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later, with its place
        vector = 0.5 * np.cross(q[:, 2] - q[:, 0], q[:, last] - q[:, 1])
        area = np.linalg.norm(vector, axis=1)
        triangle = (q[:, last] == q[:, 2]).all(axis=1)
        centroid = np.where(triangle[:, None], q[:, :3].mean(axis=1), q.mean(axis=1))
        return centroid, area, vector / np.where(area > 0, area, 1.0)[:, None]


def checked(faces: Faces, flip: bool = False) -> ReadPatch:
    """The loaded faces as a contact patch; all that is wrong with them at once, by their places in the file."""
    refuse([*_not_finite(faces), *_out_of_range(faces)])
    # corners on one line give an area of rounding, which is none either
    flat = faces.area == 0 if faces.corners is None else (faces.area == 0) | slivers(faces.corners)
    loaded = (faces.pressure > 0) & ~flat
    refuse(_unusable(faces, loaded, flat))
    normal = -faces.normal if flip else faces.normal
    corners = None if faces.corners is None else faces.corners[loaded]
    patch = ContactPatch(faces.centroid[loaded], faces.area[loaded], normal[loaded], faces.pressure[loaded], corners)
    kept = np.flatnonzero(loaded).tolist()
    return ReadPatch(faces.file, patch, len(loaded), lambda i: faces.place(kept[i]), faces.notes)


def _not_finite(faces: Faces) -> list[Problem]:
    problems = []
    for key in ("centroid", "area", "normal", "pressure", "corners"):
        value = getattr(faces, key)
        if value is not None:
            rows = value.reshape(len(value), -1)
            first = rows[np.arange(len(rows)), (~np.isfinite(rows)).argmax(axis=1)]
            problems += faces.problems(~np.isfinite(rows).all(axis=1), key, lambda i, first=first: f"{first[i]:g}",
                                       "finite numbers", "repair the export or leave the face out")  # fmt: skip
    return problems


def _out_of_range(faces: Faces) -> list[Problem]:
    """Negative pressures and areas, and numbers of no contact on earth, which would overflow further on."""
    pressure, area, length = faces.pressure, faces.area, np.abs(faces.normal).max(axis=1)
    adhesion = (pressure <= 0).all() and (pressure < 0).any()
    remedy = "change the sign of the column" if adhesion else "set faces that do not press to 0"
    problems = faces.problems(pressure < 0, "pressure", lambda i: f"{pressure[i]:g} Pa",
                              "a pressure of 0 or more, positive in compression", remedy)  # fmt: skip
    problems += faces.problems(area < 0, "area", lambda i: f"{area[i]:g} m^2", "an area of 0 or more",
                               "the normal alone gives the direction of a face")  # fmt: skip
    for key, (most, unit) in LARGEST.items():
        size = np.abs(getattr(faces, key)).reshape(len(area), -1).max(axis=1)
        problems += faces.problems(size > most, key, lambda i, size=size, unit=unit: f"{size[i]:g} {unit}",
                                   f"at most {most:g} {unit}", "check the unit")  # fmt: skip
    astray = (length > LONGEST_NORMAL) | ((length > 0) & (length < 1 / LONGEST_NORMAL))
    return problems + faces.problems(astray, "normal", lambda i: f"a length of about {length[i]:g}", "a length of 1",
                                     "normalise it")  # fmt: skip


def _unusable(faces: Faces, loaded: NDArray[np.bool_], flat: NDArray[np.bool_]) -> list[Problem]:
    """No load at all, pressure on faces without area, load on faces without normal."""
    problems = []
    if not loaded.any() or (faces.pressure * faces.area).sum() <= LEAST_LOAD:
        problems.append(Problem(faces.file, None, "pressure", f"{len(loaded)} faces and no load on any",
                                "a face with an area and a pressure above 0",
                                "zero normal force, so no friction: export a loaded state"))  # fmt: skip
    problems += faces.problems(flat & (faces.pressure > 0), "area", lambda i: f"0 under {faces.pressure[i]:g} Pa",
                               "an area above 0 where there is pressure",
                               "correct the face or set its pressure to 0")  # fmt: skip
    return problems + faces.problems(loaded & ~faces.normal.any(axis=1), "normal", lambda i: "0, 0, 0", "a direction",
                                     "recompute the normals or give corners instead of them")  # fmt: skip
