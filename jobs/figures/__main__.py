"""The figures of the paper, from their scenes to the pictures: what is not solved yet is solved first.

python -m jobs.figures 4c -o results/fig4c.png                one figure
mpirun -n 2 python -m mpi4py -m jobs.figures all              all of them, into results/figures
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ["H5PY_ALWAYS_USE_MPI"] = "1"  # before h5py is imported: its own guess misses srun and single runs

import numpy as np

from jobs.figures import contacts, studies, surfaces
from softjaw.study import pictures
from softjaw.study.cli import main as softjaw
from softjaw.study.messages import DONE, SOME_FAILED, USAGE, StudyError, complain, first_rank, write_file
from softjaw.study.ranking import judge
from softjaw.study.result.layout import DONE as CASE_DONE
from softjaw.study.result.read import open

EVERY, DPI = "all", 140


@dataclass(frozen=True)
class Figure:
    """One figure: its number with its parts, the scenes it is drawn from, and what draws it.

    ``draw`` takes the judged dataset of each scene's result and gives the drawing, and a sentence of what was
    measured. ``gaps`` says whether it can be drawn where cases have failed.
    """

    name: str
    scenes: tuple[str, ...]
    draw: Callable[..., tuple[Any, str]]
    gaps: bool = False


FIGURES = (
    Figure("4ab", ("fig4-curvature",), contacts.contact),
    Figure("4c", ("fig4-curvature",), studies.curvature),
    Figure("5a", ("fig5-candidate",), contacts.candidates),
    Figure("5b", ("fig5-candidate", "fig4-curvature"), surfaces.wrench_spaces),
    Figure("6ab", ("fig5-candidate",), surfaces.fitted_surfaces),
    Figure("6c", ("bottle",), surfaces.fit_error_along, gaps=True),
    Figure("7", ("fig7-force-study",), studies.force_study),
    Figure("8", ("bottle", "cup"), studies.maps, gaps=True),
)


def figures_of(names: list[str]) -> list[Figure]:
    """Figures by number and parts, each once: ``4`` has two, ``6a`` is part of ``6ab``."""
    chosen: dict[Figure, None] = {}
    for name in names:
        number, parts = name[:1], set(name[1:])
        named = [f for f in FIGURES if f.name[0] == number and (parts <= set(f.name[1:]) or not f.name[1:])]
        if not (named := list(FIGURES) if name == EVERY else named):
            known = ", ".join(f.name for f in FIGURES)
            raise StudyError(USAGE, f"FIGURE: found '{name}', expected one of {known}, or {EVERY}")
        chosen |= dict.fromkeys(named)
    return list(chosen)


def targets(figures: list[Figure], output: Path) -> list[Path]:
    """Where each picture goes: one PNG, or files in a folder."""
    if output.suffix != ".png":
        return [output / f"fig{f.name}.png" for f in figures]
    if len(figures) > 1:
        raise StudyError(USAGE, f"-o: found '{output}' for {len(figures)} figures, expected a folder")
    return [output]


def draw(figure: Figure, results: dict[str, Path], path: Path) -> str:
    """Write a figure as PNG; the sentence of what was measured.

    Raises
    ------
    StudyError
        If cases failed that the figure cannot do without, or the file cannot be written.
    """
    studies_of = [judge(open(results[scene])) for scene in figure.scenes]
    for ds in studies_of:
        if (failed := int(np.sum(ds.status.values != CASE_DONE))) and not figure.gaps:
            file = ds.attrs["file"]
            text = f"{file}: {failed} cases failed, figure {figure.name} needs all; see 'softjaw status {file}'"
            raise StudyError(SOME_FAILED, text)
    with pictures.style():
        drawn, result = figure.draw(*studies_of)
        write_file(path, pictures.as_png(drawn, DPI), folders=True)
    return result


def main(words: list[str] | None = None) -> int:
    """Solve what is missing, then draw; on every rank the same exit code."""
    parser = argparse.ArgumentParser(prog="jobs.figures", description="Redraw figures of the paper.")
    add = parser.add_argument
    add("names", metavar="FIGURE", nargs="+", help="4ab, 4c, 5a, 5b, 6ab, 6c, 7, 8, or all")
    add("-o", metavar="PNG", dest="output", type=Path, default=Path("results/figures"), help="picture, or folder")
    add("--results", metavar="FOLDER", type=Path, default=Path("results"), help="folder of the scenes' results")
    options = parser.parse_args(words)
    try:
        figures = figures_of(options.names)
        paths, results, codes = targets(figures, options.output), {}, {DONE}
        for scene in dict.fromkeys(scene for figure in figures for scene in figure.scenes):
            results[scene] = options.results / f"{scene}.hdf"
            codes.add(code := softjaw(["run", str(contacts.SCENES / f"{scene}.toml"), "-o", str(results[scene])]))
            if code not in (DONE, SOME_FAILED):
                return code
        for figure, path in zip(figures, paths, strict=True) if first_rank() else ():
            print(f"written: {path}\n  {draw(figure, results, path)}", flush=True)
    except StudyError as error:
        return complain(error)
    return max(codes)


if __name__ == "__main__":
    sys.exit(main())
