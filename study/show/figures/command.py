"""``softjaw figure``: solves the scenes of the paper's figures, as far as they are not solved, and draws them."""

from __future__ import annotations

import io
import os
from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study import pictures
from softjaw.study.messages import DONE, OTHER_FILE, SOME_FAILED, USAGE, StudyError, first_rank, write_file
from softjaw.study.result.layout import DONE as SOLVED
from softjaw.study.result.store import open_result
from softjaw.study.show.data import Data
from softjaw.study.show.figures import JOBS
from softjaw.study.show.figures.table import EVERY, FIGURES, Figure, find

FOLDER = "results/figures"
DPI = 140


def figure(options: Namespace, run: Callable[[Path, Path], int]) -> int:
    """Solve what is missing, then draw; on every rank the same exit code.

    ``run(scene, file)`` solves a scene into its file and returns the exit code.
    """
    os.environ["H5PY_ALWAYS_USE_MPI"] = "1"  # before h5py is imported, as a run wants it
    wanted = chosen(options.names)
    paths = targets(wanted, options.output)
    results, codes = {}, {DONE}
    for scene in dict.fromkeys(scene for one in wanted for scene in one.scenes):
        results[scene] = Path(options.results) / f"{scene}.hdf"
        codes.add(_solved(scene, results[scene], run))
        if failed := codes - {DONE, SOME_FAILED}:
            return failed.pop()
    if first_rank():
        for one, path in zip(wanted, paths, strict=True):
            print(f"written: {path}\n  {draw(one, results, path)}", flush=True)
    return max(codes)


def chosen(names: list[str]) -> list[Figure]:
    """The figures of these names, each once.

    Raises
    ------
    StudyError
        For a name that no figure has.
    """
    found = {name: find(name) for name in names}
    if strange := [name for name, figures in found.items() if not figures]:
        known = ", ".join(one.name for one in FIGURES)
        raise StudyError(USAGE, f"FIGURE: found '{strange[0]}', expected one of {known}, or {EVERY}")
    return list(dict.fromkeys(one for figures in found.values() for one in figures))


def targets(wanted: list[Figure], output: str | None) -> list[Path]:
    """Where each picture goes: one PNG, or files in a folder."""
    given = Path(output or FOLDER)
    if given.suffix != ".png":
        return [given / one.file for one in wanted]
    if len(wanted) > 1:
        names = ", ".join(one.name for one in wanted)
        raise StudyError(USAGE, f"-o: found '{given}' for {len(wanted)} figures ({names}), expected a folder")
    return [given]


def _solved(scene: str, path: Path, run: Callable[[Path, Path], int]) -> int:
    """Run a scene into its file, which takes a second where nothing is missing; the exit code."""
    source = JOBS / f"{scene}.toml"
    if not source.is_file():
        text = f"{source}: there is no such scene; install softjaw from its source folder, which has jobs/"
        raise StudyError(USAGE, text)
    if (code := run(source, path)) == OTHER_FILE:
        raise StudyError(OTHER_FILE, f"{path}: move it away, or choose another folder with --results")
    return code


def draw(one: Figure, results: dict[str, Path], path: Path) -> str:
    """Write a figure as PNG; the sentence of what was measured.

    Raises
    ------
    StudyError
        If cases failed that the figure cannot do without, or the file cannot be written.
    """
    with ExitStack() as stack, pictures.style():
        opened = [stack.enter_context(open_result(results[scene])) for scene in one.scenes]
        for result in opened:
            if (failed := int(np.sum(result.status != SOLVED))) and not one.gaps:
                text = f"figure {one.name} is not drawn: {failed} cases of {result.path} failed"
                raise StudyError(SOME_FAILED, f"{text}; 'softjaw status {result.path}' says why")
        drawn, said = one.draw(*(Data(result) for result in opened))
        write_file(path, as_png(drawn), folders=True)
    return said


def as_png(drawn: Any) -> bytes:
    """The figure in the resolution of a page."""
    store = io.BytesIO()
    drawn.savefig(store, format="png", dpi=DPI, facecolor="white", metadata={"Software": None})
    return store.getvalue()
