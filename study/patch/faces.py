"""Faces of a contact patch: their geometry from corners, and all that is wrong with them by their places in a file."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import ContactPatch, FloatArray, area_vectors, slivers
from softjaw.study.messages import USAGE, Problem, StudyError, first_of

MOST_PROBLEMS = 10  # reported of one file
CREDIBLE = {"centroid": (1e3, "m"), "area": (1e4, "m^2"), "pressure": (1e12, "Pa")}  # beyond is no contact on earth
LONGEST_NORMAL, LEAST_LOAD = 1e6, 1e-12  # -, N


class ReadPatch(NamedTuple):
    """The loaded faces of a file as a patch [m, Pa].

    ``faces`` counts all faces; ``place`` gives the words for the place of a loaded face, ``line 7`` or ``cell 3``;
    ``notes`` say what the reader of the answer should know about the file.
    """

    file: str
    patch: ContactPatch
    faces: int
    place: Callable[[int], str]
    notes: tuple[str, ...] = ()


def refuse(problems: Sequence[Problem]) -> None:
    """Raise if there are problems, naming the first of them."""
    if problems:
        lines = first_of([*map(str, problems)], MOST_PROBLEMS, "", f"{problems[0].file}: ")
        raise StudyError(USAGE, "\n".join(lines))


def corner_geometry(corners: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres (mean corners) ``(n, 3)``, areas ``(n,)`` and normals ``(n, 3)`` of plane faces ``(n, k, 3)`` [m].

    Corners go round a face by the right-hand rule; a triangle among quadrilaterals repeats its last one. The normal of
    a face without area is 0.
    """
    q, last = corners, corners.shape[1] - 1
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later, with its place
        vector = 0.5 * np.cross(q[:, 2] - q[:, 0], q[:, last] - q[:, 1])
        area = np.linalg.norm(vector, axis=1)
        triangle = (q[:, last] == q[:, 2]).all(axis=1)
        centroid = np.where(triangle[:, None], q[:, :3].mean(axis=1), q.mean(axis=1))
        return centroid, area, vector / np.where(area > 0, area, 1.0)[:, None]


def checked(
    file: str, place: Callable[[int], str], centroid: FloatArray, area: FloatArray, normal: FloatArray,
    pressure: FloatArray, corners: FloatArray | None = None, notes: tuple[str, ...] = (), flip: bool = False,
) -> ReadPatch:  # fmt: skip
    """The loaded faces [m, m^2, Pa] as a contact patch; all that is wrong with them at once, by their places."""
    problems: list[Problem] = []

    def wrong(bad: NDArray[np.bool_], key: str, actual: Callable[[int], str], expected: str, remedy: str) -> None:
        for i in np.flatnonzero(bad).tolist():
            problems.append(Problem(f"{file}, {place(i)}", None, key, actual(i), expected, remedy))

    given = {"centroid": centroid, "area": area, "normal": normal, "pressure": pressure, "corners": corners}
    _check_range({key: value for key, value in given.items() if value is not None}, wrong)
    refuse(problems)
    # corners on one line give an area of rounding, which is none either
    flat = area == 0 if corners is None else (area == 0) | slivers(*area_vectors(corners))
    loaded = (pressure > 0) & ~flat
    if not loaded.any() or (pressure * area).sum() <= LEAST_LOAD:
        problems.append(Problem(file, None, "pressure", f"{len(loaded)} faces and no load on any",
                                "a face with an area and a pressure above 0",
                                "zero normal force: export a loaded state"))  # fmt: skip
    wrong(flat & (pressure > 0), "area", lambda i: f"0 under {pressure[i]:g} Pa",
          "an area above 0 where there is pressure", "correct the face or set its pressure to 0")  # fmt: skip
    wrong(loaded & ~normal.any(axis=1), "normal", lambda i: "0, 0, 0", "a direction",
          "recompute the normals or give corners instead of them")  # fmt: skip
    refuse(problems)
    patch = ContactPatch(
        centroid[loaded], area[loaded], (-1.0 if flip else 1.0) * normal[loaded], pressure[loaded],
        None if corners is None else corners[loaded],
    )  # fmt: skip
    faces = np.flatnonzero(loaded).tolist()
    return ReadPatch(file, patch, len(loaded), lambda i: place(faces[i]), notes)


def _check_range(given: dict[str, FloatArray], wrong: Callable[..., None]) -> None:
    """What is not finite, negative pressures and areas, and numbers of no contact on earth."""
    for key, value in given.items():
        rows = value.reshape(len(value), -1)
        lost = ~np.isfinite(rows).all(axis=1)
        first = {i: f"{rows[i][~np.isfinite(rows[i])][0]:g}" for i in np.flatnonzero(lost).tolist()}
        wrong(lost, key, first.__getitem__, "finite numbers", "repair the export or leave the face out")
        if key in CREDIBLE:
            (most, unit), size = CREDIBLE[key], np.abs(rows).max(axis=1)
            beyond = {i: f"{size[i]:g} {unit}" for i in np.flatnonzero(size > most).tolist()}
            wrong(size > most, key, beyond.__getitem__, f"at most {most:g} {unit}", "check the unit")
    area, pressure, length = given["area"], given["pressure"], np.abs(given["normal"]).max(axis=1)
    tensile = (pressure <= 0).all() and (pressure < 0).any()
    wrong(pressure < 0, "pressure", lambda i: f"{pressure[i]:g} Pa", "a pressure of 0 or more, positive in compression",
          "change the sign of the column" if tensile else "set faces that do not press to 0")  # fmt: skip
    wrong(area < 0, "area", lambda i: f"{area[i]:g} m^2", "an area of 0 or more",
          "the normal alone gives the direction of a face")  # fmt: skip
    astray = (length > LONGEST_NORMAL) | ((length > 0) & (length < 1 / LONGEST_NORMAL))
    wrong(astray, "normal", lambda i: f"a length of about {length[i]:g}", "a length of 1", "normalise it")
