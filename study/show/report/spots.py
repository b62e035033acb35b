"""Where the cells of a drawn map are, so that a page can tell of the one that a reader points at."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Spot:
    """One panel of a picture, its cells and the case in each.

    ``x`` and ``y`` are borders of the cells as shares of the picture, from its left and from its top (``y`` rises
    downwards, rows as on the page); ``cases`` holds the row of a case in the file for every cell, row by row.
    """

    label: str
    x: list[float]
    y: list[float]
    cases: list[list[int]]

    def plain(self) -> dict[str, Any]:
        """As plain data for a page."""
        return asdict(self)


def spot(axes: Any, label: str, x: np.ndarray, y: np.ndarray, cases: np.ndarray) -> Spot:
    """The spot of drawn axes with cells ``cases (len(y) - 1, len(x) - 1)`` between borders in the axes' units.

    The figure must have been drawn: its layout is settled then.
    """
    low, high = axes.get_ylim()
    at = _shares(axes, np.column_stack([x, np.full(len(x), 0.5 * (low + high))]))[:, 0]
    up = _shares(axes, np.column_stack([np.full(len(y), 0.5 * sum(axes.get_xlim())), y]))[:, 1]
    return Spot(label, at.round(5).tolist(), (1 - up[::-1]).round(5).tolist(), cases[::-1].tolist())


def _shares(axes: Any, points: np.ndarray) -> np.ndarray:
    figure = axes.figure
    return figure.transFigure.inverted().transform(axes.transData.transform(points))
