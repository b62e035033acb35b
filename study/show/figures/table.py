"""Every figure of the paper that is redrawn here: from which scenes, and by what."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from softjaw.study.show.figures import fig4, fig5, fig6, fig7, fig8


@dataclass(frozen=True)
class Figure:
    """One figure: its number with its letters, the scenes it is drawn from, and what draws it.

    ``draw`` takes a `study.show.data.Data` of each scene's result and gives the drawing, and a sentence of what was
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
    Figure("4ab", ("fig4-curvature",), fig4.contact),
    Figure("4c", ("fig4-curvature",), fig4.curvature),
    Figure("5a", ("fig5-candidate",), fig5.candidates),
    Figure("5b", ("fig5-candidate", "fig4-curvature"), fig5.wrench_spaces),
    Figure("6ab", ("fig5-candidate",), fig6.fitted_surfaces),
    Figure("6c", ("bottle",), fig6.fit_error_along, gaps=True),
    Figure("7", ("fig7-force-study",), fig7.force_study),
    Figure("8", ("bottle", "cup"), fig8.maps, gaps=True),
)
EVERY = "all"


def find(name: str) -> list[Figure]:
    """Figures by number and letters: ``4`` has two, ``6a`` is part of ``6ab``; empty for others."""
    if name == EVERY:
        return list(FIGURES)
    number, letters = name[:1], set(name[1:])
    return [f for f in FIGURES if f.name[0] == number and (letters <= set(f.name[1:]) or not f.name[1:])]
