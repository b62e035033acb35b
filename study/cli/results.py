"""Commands that read whole result files, as tables and numbers."""

from __future__ import annotations

from argparse import Namespace
from functools import partial
from pathlib import Path

from softjaw.study.messages import OTHER_FILE, USAGE, StudyError
from softjaw.study.result.index import index_path
from softjaw.study.result.read import open
from softjaw.study.result.store import open_result, torn_rows
from softjaw.study.scene import SceneError
from softjaw.study.show import objects
from softjaw.study.show.best_grasps import best, best_text
from softjaw.study.show.compare import compare as compared
from softjaw.study.show.compare import compare_text
from softjaw.study.show.watch import file_look
from softjaw.study.show.watch import watch as watched
from softjaw.study.table import rendered, terminal_width


def watch(options: Namespace) -> int:
    """Follow a run until it ends."""
    index = index_path(options.file)
    return watched(partial(objects.look, index) if index else file_look(Path(options.file)), options.every)


def show(options: Namespace) -> str:
    """Print the best grasps, or the objects with theirs."""
    if index := index_path(options.file):
        return rendered(objects.index_table(index, options.top), options.form)
    ds = open(options.file)
    try:
        if options.form is None:
            return best_text(ds, terminal_width(), options.force, options.top, options.by)
        return rendered(best(ds, options.force, options.top, by=options.by), options.form)
    except ValueError as error:
        raise StudyError(USAGE, f"{options.file}: {error}") from error


def compare(options: Namespace) -> str:
    """Print two maps side by side."""
    first, second = map(open, options.files)
    table = compared(first, second, options.quantity, options.model)
    return rendered(table, options.form) if options.form else compare_text(table, options.top, terminal_width())


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
