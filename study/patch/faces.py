"""Faces as a file gives them: checked with their places in the file, then made a contact patch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.orientation import slivers
from softjaw.friction.patch import ContactPatch, FloatArray
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.scene.problems import Problem

MOST_PROBLEMS = 10  # told of one file


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces in SI units, not yet checked.

    Parameters
    ----------
    file : str
        Where they come from.
    place : callable
        Words for the place of face ``i`` in the file, ``line 7`` or ``cell 3``.
    centroid, normal : (n, 3) array
        Centres [m] and normals of any length [-].
    area, pressure : (n,) array
        Areas [m^2] and pressures [Pa].
    corners : (n, k, 3) array or None
        Corners in order around each face [m].
    notes : tuple of str
        What the reader of the answer should know about the file.
    """

    file: str
    place: Callable[[int], str]
    centroid: FloatArray
    area: FloatArray
    normal: FloatArray
    pressure: FloatArray
    corners: FloatArray | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ReadPatch:
    """The loaded faces of a file as a patch, and what is worth telling of the file.

    ``faces`` counts all faces; ``place`` gives the words for the place of a loaded face in the file.
    """

    file: str
    patch: ContactPatch
    faces: int
    place: Callable[[int], str]
    notes: tuple[str, ...] = ()


def refuse(problems: Sequence[Problem]) -> None:
    """Raise if there are problems, naming the first of them."""
    if problems:
        told = [str(p) for p in problems[:MOST_PROBLEMS]]
        if len(problems) > len(told):
            told.append(f"{problems[0].file}: and {len(problems) - len(told)} more")
        raise StudyError(USAGE, "\n".join(told))


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
    refuse([*_not_finite(faces), *_negative(faces), *_implausible(faces)])
    flat = faces.area == 0 if faces.corners is None else (faces.area == 0) | slivers(faces.corners)
    loaded = (faces.pressure > 0) & ~flat
    refuse([*_no_load(faces, loaded), *_no_area(faces, flat), *_no_normal(faces, loaded)])
    normal = -faces.normal if flip else faces.normal
    corners = None if faces.corners is None else faces.corners[loaded]
    patch = ContactPatch(faces.centroid[loaded], faces.area[loaded], normal[loaded], faces.pressure[loaded], corners)
    kept = np.flatnonzero(loaded).tolist()
    return ReadPatch(faces.file, patch, len(loaded), lambda i: faces.place(kept[i]), faces.notes)


FARTHEST, LARGEST_AREA, HIGHEST, LONGEST_NORMAL = 1e3, 1e4, 1e12, 1e6  # m, m^2, Pa, -
LEAST_LOAD = 1e-12  # N


def _told(faces: Faces, wrong: NDArray[np.bool_], key: str, found: Callable[[int], str], rest: str) -> list[Problem]:
    expected, remedy = rest.split("; ", 1)
    return [Problem(f"{faces.file}, {faces.place(i)}", None, key, found(i), expected, remedy)
            for i in np.flatnonzero(wrong).tolist()]  # fmt: skip


def _not_finite(faces: Faces) -> list[Problem]:
    problems = []
    for key in ("centroid", "area", "normal", "pressure", "corners"):
        value = getattr(faces, key)
        if value is not None:
            rows = value.reshape(len(value), -1)
            wrong = ~np.isfinite(rows)
            first = rows[np.arange(len(rows)), wrong.argmax(axis=1)]
            problems += _told(faces, wrong.any(axis=1), key, lambda i, first=first: f"{first[i]:g}",
                              "finite numbers; repair the export or leave the face out")  # fmt: skip
    return problems


def _negative(faces: Faces) -> list[Problem]:
    remedy = "a pressure of 0 or more, positive in compression; set faces that do not press to 0"
    if (faces.pressure <= 0).all() and (faces.pressure < 0).any():
        remedy = "pressures that are positive in compression; change the sign of the column"
    return [
        *_told(faces, faces.pressure < 0, "pressure", lambda i: f"{faces.pressure[i]:g} Pa", remedy),
        *_told(faces, faces.area < 0, "area", lambda i: f"{faces.area[i]:g} m^2",
               "an area of 0 or more; the direction of a face is told by its normal alone"),
    ]  # fmt: skip


def _implausible(faces: Faces) -> list[Problem]:
    """Numbers of no contact on earth, which would overflow further on."""
    far = (np.abs(faces.centroid) > FARTHEST).any(axis=1)
    length = np.abs(faces.normal).max(axis=1)
    astray = (length > LONGEST_NORMAL) | ((length > 0) & (length < 1 / LONGEST_NORMAL))
    return [
        *_told(faces, far, "centroid", lambda i: f"{np.abs(faces.centroid[i]).max():g} m",
               f"coordinates within {FARTHEST:g} m; check the unit"),
        *_told(faces, faces.area > LARGEST_AREA, "area", lambda i: f"{faces.area[i]:g} m^2",
               f"at most {LARGEST_AREA:g} m^2; check the unit"),
        *_told(faces, faces.pressure > HIGHEST, "pressure", lambda i: f"{faces.pressure[i]:g} Pa",
               f"at most {HIGHEST:g} Pa; check the unit"),
        *_told(faces, astray, "normal", lambda i: f"a length of about {length[i]:g}", "a length of 1; normalise it"),
    ]  # fmt: skip


def _no_load(faces: Faces, loaded: NDArray[np.bool_]) -> list[Problem]:
    if loaded.any() and (faces.pressure * faces.area).sum() > LEAST_LOAD:
        return []
    found = f"{len(loaded)} faces and no load on any"
    expected = "a face with an area and a pressure above 0"
    remedy = "without a normal force there is no friction to tell of: export a loaded state"
    return [Problem(faces.file, None, "pressure", found, expected, remedy)]


def _no_area(faces: Faces, flat: NDArray[np.bool_]) -> list[Problem]:
    """Faces without area under pressure; corners on one line give an area of rounding, which is none either."""
    return _told(faces, flat & (faces.pressure > 0), "area", lambda i: f"0 under {faces.pressure[i]:g} Pa",
                 "an area above 0 where there is pressure; correct the face or set its pressure to 0")  # fmt: skip


def _no_normal(faces: Faces, loaded: NDArray[np.bool_]) -> list[Problem]:
    wrong = loaded & ~faces.normal.any(axis=1)
    return _told(faces, wrong, "normal", lambda i: "0, 0, 0",
                 "a direction; recompute the normals or give corners instead of them")  # fmt: skip
