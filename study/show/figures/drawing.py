"""Every figure of the paper that is redrawn here: from which scenes, by what, and into which file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study import pictures
from softjaw.study.messages import SOME_FAILED, USAGE, StudyError, write_file
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import open
from softjaw.study.show.figures import contacts, studies, surfaces
from softjaw.study.show.grasps import judge

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

    @property
    def file(self) -> str:
        """Name of the picture."""
        return f"fig{self.name}.png"


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


def find(name: str) -> list[Figure]:
    """Figures by number and parts: ``4`` has two, ``6a`` is part of ``6ab``; empty for others."""
    if name == EVERY:
        return list(FIGURES)
    number, parts = name[:1], set(name[1:])
    return [f for f in FIGURES if f.name[0] == number and (parts <= set(f.name[1:]) or not f.name[1:])]


def chosen(names: list[str]) -> list[Figure]:
    """The figures of these names, each once.

    Raises
    ------
    StudyError
        For a name that no figure has.
    """
    found = {name: find(name) for name in names}
    if unknown := [name for name, figures in found.items() if not figures]:
        known = ", ".join(one.name for one in FIGURES)
        raise StudyError(USAGE, f"FIGURE: found '{unknown[0]}', expected one of {known}, or {EVERY}")
    return list(dict.fromkeys(one for figures in found.values() for one in figures))


def targets(wanted: list[Figure], output: Path) -> list[Path]:
    """Where each picture goes: one PNG, or files in a folder."""
    if output.suffix != ".png":
        return [output / one.file for one in wanted]
    if len(wanted) > 1:
        names = ", ".join(one.name for one in wanted)
        raise StudyError(USAGE, f"-o: found '{output}' for {len(wanted)} figures ({names}), expected a folder")
    return [output]


def draw(one: Figure, results: dict[str, Path], path: Path) -> str:
    """Write a figure as PNG; the sentence of what was measured.

    Raises
    ------
    StudyError
        If cases failed that the figure cannot do without, or the file cannot be written.
    """
    studies_of = [judge(open(results[scene])) for scene in one.scenes]
    for ds in studies_of:
        if (failed := int(np.sum(ds.status.values != DONE))) and not one.gaps:
            file = ds.attrs["file"]
            text = f"figure {one.name} is not drawn: {failed} cases of {file} failed; 'softjaw status {file}' says why"
            raise StudyError(SOME_FAILED, text)
    with pictures.style():
        drawn, result = one.draw(*studies_of)
        write_file(path, pictures.as_png(drawn, DPI), folders=True)
    return result
