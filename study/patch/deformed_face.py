"""A contact patch from the deformed face of a pad, as a camera sees it: points read, pad solved, its patch taken.

Points are in the frame of the backing plate: x along the pad's length, y along its width, z along the approach, the
undeformed contact face at z = 0, so that foam that is pressed in has z < 0. A contour has y and z alone and holds all
along the pad.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from softjaw.fem.contact.extract import extract
from softjaw.fem.contact.measured import press_measured
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.objects.gap import NoContactError
from softjaw.fem.objects.measured_face import cell_of, measured_face
from softjaw.friction.patch import NEGLIGIBLE, FloatArray
from softjaw.study.case.model import pads_of
from softjaw.study.messages import SOME_FAILED, Problem, fault_of
from softjaw.study.patch.faces import ReadPatch, refuse
from softjaw.study.patch.patch_reader import Reading, checked_file, refused, si_columns, split_header, table_rows
from softjaw.study.scene import Scene

MOST_MEASURED = 20_000  # points of a face
COLUMNS = "x_mm, y_mm, z_mm, or y_mm, z_mm of a contour along the pad's width"


def solve_deformed(file: str, unit: str | None, scene: Scene) -> ReadPatch:
    """Contact patch of the pad of a scene with the deformed face in a table, in the file's coordinates.

    ``unit`` is that of columns that name none. `StudyError` has the code 3 if the file cannot be read, 2 if it holds no
    deformed face, 6 if the pad has no such state.
    """
    points, notes = _points(checked_file(file, (".csv",)), unit, scene)
    with fault_of(file, ValueError, ending="; measure more of the face"):
        face = measured_face(points, cell_of(scene.gripper.pad_size, scene.gripper.elements))
    wanted, *others = pads_of(scene, (False, False), coarser=False)
    no_state = fault_of(f"{file}: the pad has no state with this face", ConvergenceError, CheckError, code=SOME_FAILED)
    sign = "; z points along the approach, so that pressed foam has z < 0: change its sign if it is the other way"
    with no_state, fault_of(file, NoContactError, ending=sign):
        state, judged = press_measured(face, wanted, others, dict(scene.petsc))
    patch = extract(state.pad, state)
    loaded = patch.pressure > NEGLIGIBLE * patch.pressure.max(initial=0.0)
    faces = np.flatnonzero(loaded).tolist()
    back = np.array([0.0, 0.0, state.closing])  # to where the backing plate stands
    patch = patch.only(loaded)
    corners = None if patch.corners is None else patch.corners - back
    in_file = replace(patch, centroid=patch.centroid - back, corners=corners)
    smooth = f"the points scatter by {1e3 * face.noise:.2g} mm round the smoothed face, whose error is"
    text = f"{smooth} {1e3 * face.doubt:.2g} mm; closed by {1e3 * state.closing:.3g} mm, {state.force:.3g} N"
    weak = "the face is pressed in by hardly more than its error: contact may be noise"
    notes = (*notes, text, *[weak] * (not judged), *state.notes)
    return ReadPatch(file, in_file, len(loaded), lambda i: f"face {faces[i]} of the pad", notes)


def _points(path: Path, unit: str | None, scene: Scene) -> tuple[FloatArray, tuple[str, ...]]:
    """Points ``(n, 2)`` or ``(n, 3)`` [m] of a table, and notes on it; all that is wrong with it at once."""
    numbers, (headers, *cells) = table_rows(path)
    given = {pair[0]: i for i, header in enumerate(headers) if (pair := split_header(header))}
    needed = [name for name in "xyz" if name in given]
    if len(cells) > MOST_MEASURED:
        raise refused(path, None, "", f"{len(cells)} points", f"at most {MOST_MEASURED}", "thin them")
    if not {"y", "z"} <= given.keys():
        actual = f"the columns {', '.join(headers)}"
        raise refused(path, 1, "", actual, COLUMNS, "name the columns in the first line, with their unit")
    metres = si_columns(path, numbers[1:], cells, headers, {name: given[name] for name in needed}, Reading(unit))
    sides = dict(zip("xyz", scene.gripper.pad_size, strict=True))
    problems = []
    for name in needed:
        # the face moves into the foam and bulges, but neither through the plate nor far
        # a point beyond 1.5 half sides of the pad belongs to something else, or has another unit
        most = sides[name] if name == "z" else 0.75 * sides[name]
        for i in np.flatnonzero(np.abs(metres[name]) > most).tolist():
            actual, expected = f"{1e3 * metres[name][i]:.4g} mm", f"at most {1e3 * most:.4g} mm from the face's centre"
            remedy = "check the unit, and that the origin is the centre of the undeformed contact face"
            problems.append(Problem(str(path), numbers[1 + i], headers[given[name]], actual, expected, remedy))
    refuse(problems)
    notes = [
        f"the points cover {100 * np.ptp(metres[name]) / sides[name]:.0f} % of the pad along {name}; straight beyond"
        for name in needed
        # share of the pad's side: what fewer points cover is continued by much
        if name != "z" and np.ptp(metres[name]) < 0.8 * sides[name]
    ]
    return np.column_stack([metres[name] for name in needed]), tuple(notes)
