"""Commands that read whole result files, as tables and numbers."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.export.cases import as_csv as cases_csv
from softjaw.study.export.cases import as_json as cases_json
from softjaw.study.export.grasps import Choice, Gripper, chosen, grasps, usable
from softjaw.study.export.mjcf import as_mjcf
from softjaw.study.export.physx import as_usd
from softjaw.study.export.planners import CLOSING, as_graspgen, as_isaac_grasp, as_moveit
from softjaw.study.export.sdf import as_sdf
from softjaw.study.messages import OTHER_FILE, USAGE, StudyError, write_file
from softjaw.study.result.layout import DONE, MISSING
from softjaw.study.result.read import dataset, open
from softjaw.study.result.store import open_result, torn_rows
from softjaw.study.scene.problems import SceneError
from softjaw.study.show.tables import watch as watching
from softjaw.study.show.tables.columns import terminal_width
from softjaw.study.show.tables.compare import compare as compared
from softjaw.study.show.tables.compare import comparison_csv, comparison_json, comparison_text
from softjaw.study.show.tables.show import as_csv, as_json, as_text, best
from softjaw.study.show.tables.status import counts, reasons, time_split
from softjaw.study.units import in_si

TABLES = {"csv": cases_csv, "json": cases_json}
PLANNERS = {"isaac_grasp": as_isaac_grasp, "graspgen": as_graspgen, "moveit": as_moveit}
SIMULATORS = {"mjcf": as_mjcf, "sdf": as_sdf, "physx": as_usd}


def watch(options: Namespace) -> int:
    """Follow a run until it ends."""
    return watching.watch(Path(options.file), options.every)


def show(options: Namespace) -> str:
    """Print the best grasps."""
    whole = options.form is None
    try:
        table = best(open(options.file), options.force, options.top, whole, options.by)
    except ValueError as error:
        raise StudyError(USAGE, f"{options.file}: --force: {error}") from error
    forms = {"json": as_json, "csv": as_csv}
    return forms[options.form](table) if options.form else as_text(table, terminal_width())


def compare(options: Namespace) -> str:
    """Print two maps side by side."""
    one, other = map(open, options.files)
    found = compared(one, other, options.quantity, options.model)
    forms = {"json": comparison_json, "csv": comparison_csv}
    return forms[options.form](found) if options.form else comparison_text(found, options.top, terminal_width())


def export(options: Namespace) -> str:
    """Write grasps for planners and simulators; files that were written, or the text itself."""
    ds = open(options.file)
    few = options.top if options.top is not None else 1 if options.form in SIMULATORS else 0
    choice = Choice(options.model, options.force, options.by, few, dict(options.least))
    if options.form in TABLES:
        asked = options.force or options.by or options.least or options.top is not None
        return _written(options, [TABLES[options.form](ds, options.model, chosen(ds, choice)[0] if asked else None)])
    closing = options.closing or CLOSING.get(options.form, "x")
    gripper = Gripper(
        tuple(options.approaches or ("minus-x",)), closing, in_si("depth_mm", options.depth),
        in_si("wider_mm", options.wider), options.joints, options.gripper_frame, options.object_frame,
    )  # fmt: skip
    found = grasps(ds, choice, gripper)
    if options.form != "graspgen":  # which has a field for those that do not hold
        found, left = usable(found)
        if left:
            print(f"note: {left}", file=sys.stderr)
    if not found:
        raise StudyError(USAGE, f"{options.file}: no grasp is left to write; 'softjaw show' lists all")
    if options.form in PLANNERS:
        return _written(options, [PLANNERS[options.form](found, gripper, ds)])
    return _written(options, [SIMULATORS[options.form](grasp) for grasp in found])


def _written(options: Namespace, texts: list[str]) -> str:
    """The names of the files that now hold these texts, the second and later ones with a number; or the one text."""
    if options.output is None:
        if len(texts) > 1:
            raise StudyError(USAGE, f"--top: {len(texts)} grasps are a file each; name them with -o, or write --top 1")
        return texts[0]
    path = Path(options.output)
    paths = [path if len(texts) == 1 else path.with_stem(f"{path.stem}-{i}") for i in range(1, len(texts) + 1)]
    return "\n".join(f"written: {write_file(p, text + chr(10))}" for p, text in zip(paths, texts, strict=True))


def summary(result: Any) -> str:
    """What a run says at its end: counts, reasons of failures, where the time went, best grasps, the file."""
    width = terminal_width()
    table = [as_text(best(dataset(result), whole_lines=True), width)] if np.any(result.status == DONE) else []
    again = "; run the same command again to resume" if np.any(result.status == MISSING) else ""
    lines = [counts(result), *reasons(result, width), *time_split(result), *table]
    return "\n".join([*lines, f"results are in {result.path}{again}"])


def damage(options: Namespace, error: Exception) -> StudyError | None:
    """What is wrong with the result files that an unforeseen error came from: their values are not those written."""
    files = [*getattr(options, "files", []), getattr(options, "file", "")]
    for file in (Path(name) for name in files if str(name).endswith(".hdf")):
        try:
            with open_result(file) as result:
                layout = result.layout
            torn = torn_rows(file, layout)
        except StudyError as found:
            return found
        if torn:
            text = f"{file}: damaged ({len(torn)} cases do not match their checksums)"
            return StudyError(OTHER_FILE, f"{text}; 'softjaw run' solves them again, or restore it from a copy")
        # A scene that was valid when it was stored is not the user's mistake.
        if isinstance(error, SceneError):
            text = f"{file}: the scene in it cannot be used ({error.problems[0]})"
            return StudyError(OTHER_FILE, f"{text}; restore the file from a copy")
    return None
