"""``softjaw figure``: solves the scenes of the paper's figures, as far as they are not solved, and draws them."""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from softjaw.study.messages import DONE, OTHER_FILE, SOME_FAILED, USAGE, StudyError, first_rank
from softjaw.study.show.figures import JOBS, drawing

FOLDER = "results/figures"


def figure(options: Namespace, run: Callable[[Path, Path], int]) -> int:
    """Solve what is missing, then draw; on every rank the same exit code.

    ``run(scene, file)`` solves a scene into its file and returns the exit code.
    """
    os.environ["H5PY_ALWAYS_USE_MPI"] = "1"  # before h5py is imported, as a run wants it
    wanted = drawing.chosen(options.names)
    paths = drawing.targets(wanted, Path(options.output or FOLDER))
    results, codes = {}, {DONE}
    for scene in dict.fromkeys(scene for one in wanted for scene in one.scenes):
        results[scene] = Path(options.results) / f"{scene}.hdf"
        codes.add(_solved(scene, results[scene], run))
        if failed := codes - {DONE, SOME_FAILED}:
            return failed.pop()
    if first_rank():
        for one, path in zip(wanted, paths, strict=True):
            print(f"written: {path}\n  {drawing.draw(one, results, path)}", flush=True)
    return max(codes)


def _solved(scene: str, path: Path, run: Callable[[Path, Path], int]) -> int:
    """Run a scene into its file, which takes a second where nothing is missing; the exit code."""
    source = JOBS / f"{scene}.toml"
    if not source.is_file():
        text = f"{source}: no such scene; install softjaw from its source folder, which has jobs/"
        raise StudyError(USAGE, text)
    if (code := run(source, path)) == OTHER_FILE:
        raise StudyError(OTHER_FILE, f"{path}: move it away, or choose another folder with --results")
    return code
