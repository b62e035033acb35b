"""Faces of a contact patch: their geometry from corners, and all that is wrong with them by their places in a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import ContactPatch, FloatArray, slivers
from softjaw.study.messages import USAGE, Problem, StudyError

MOST_PROBLEMS = 10  # reported of one file
CREDIBLE = {"centroid": (1e3, "m"), "area": (1e4, "m^2"), "pressure": (1e12, "Pa")}  # beyond is no contact on earth
LONGEST_NORMAL, LEAST_LOAD = 1e6, 1e-12  # -, N


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


def refuse(problems: Sequence[Problem]) -> None:
    """Raise if there are problems, naming the first of them."""
    if problems:
        lines = [str(p) for p in problems[:MOST_PROBLEMS]]
        if len(problems) > len(lines):
            lines.append(f"{problems[0].file}: and {len(problems) - len(lines)} more")
        raise StudyError(USAGE, "\n".join(lines))


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
    problems: list[Problem] = []

    def wrong(bad: NDArray[np.bool_], key: str, found: Callable[[int], str], expected: str, remedy: str) -> None:
        where = ((i, f"{faces.file}, {faces.place(i)}") for i in np.flatnonzero(bad).tolist())
        problems.extend(Problem(place, None, key, found(i), expected, remedy) for i, place in where)

    for key in ("centroid", "area", "normal", "pressure", "corners"):
        if (value := getattr(faces, key)) is not None:
            rows = value.reshape(len(value), -1)
            first = [f"{v:g}" for v in rows[np.arange(len(rows)), (~np.isfinite(rows)).argmax(axis=1)].tolist()]
            wrong(~np.isfinite(rows).all(axis=1), key, first.__getitem__, "finite numbers",
                  "repair the export or leave the face out")  # fmt: skip
    _check_range(faces, wrong)
    refuse(problems)
    pressure, normal = faces.pressure, faces.normal
    # corners on one line give an area of rounding, which is none either
    flat = faces.area == 0 if faces.corners is None else (faces.area == 0) | slivers(faces.corners)
    loaded = (pressure > 0) & ~flat
    if not loaded.any() or (pressure * faces.area).sum() <= LEAST_LOAD:
        problems.append(Problem(faces.file, None, "pressure", f"{len(loaded)} faces and no load on any",
                                "a face with an area and a pressure above 0",
                                "zero normal force: export a loaded state"))  # fmt: skip
    wrong(flat & (pressure > 0), "area", lambda i: f"0 under {pressure[i]:g} Pa",
          "an area above 0 where there is pressure", "correct the face or set its pressure to 0")  # fmt: skip
    wrong(loaded & ~normal.any(axis=1), "normal", lambda i: "0, 0, 0", "a direction",
          "recompute the normals or give corners instead of them")  # fmt: skip
    refuse(problems)
    corners = None if faces.corners is None else faces.corners[loaded]
    side = -1.0 if flip else 1.0
    patch = ContactPatch(faces.centroid[loaded], faces.area[loaded], side * normal[loaded], pressure[loaded], corners)
    kept = np.flatnonzero(loaded).tolist()
    return ReadPatch(faces.file, patch, len(loaded), lambda i: faces.place(kept[i]), faces.notes)


def _check_range(faces: Faces, wrong: Callable[..., None]) -> None:
    """Negative pressures and areas, and numbers of no contact on earth, which would overflow further on."""
    pressure, area, length = faces.pressure, faces.area, np.abs(faces.normal).max(axis=1)
    tensile = (pressure <= 0).all() and (pressure < 0).any()
    remedy = "change the sign of the column" if tensile else "set faces that do not press to 0"
    wrong(pressure < 0, "pressure", lambda i: f"{pressure[i]:g} Pa", "a pressure of 0 or more, positive in compression",
          remedy)  # fmt: skip
    wrong(area < 0, "area", lambda i: f"{area[i]:g} m^2", "an area of 0 or more",
          "the normal alone gives the direction of a face")  # fmt: skip
    for key, (most, unit) in CREDIBLE.items():
        size = np.abs(getattr(faces, key)).reshape(len(area), -1).max(axis=1)
        wrong(size > most, key, lambda i, size=size, unit=unit: f"{size[i]:g} {unit}", f"at most {most:g} {unit}",
              "check the unit")  # fmt: skip
    astray = (length > LONGEST_NORMAL) | ((length > 0) & (length < 1 / LONGEST_NORMAL))
    wrong(astray, "normal", lambda i: f"a length of about {length[i]:g}", "a length of 1", "normalise it")
