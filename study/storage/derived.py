"""What is filled once, after all cases: each kind of study adds its own datasets; then come the grid and the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from study.case import curvature, window
from study.cost import stored
from study.scene import Scene
from study.storage.layout import Derived
from study.uncertainty import stored as uncertainty

if TYPE_CHECKING:
    from study.storage.store import ResultWriter

KINDS = (curvature, window, uncertainty)


def derived(scene: Scene) -> list[Derived]:
    """Everything that is derived for a scene."""
    return [d for kind in (*KINDS, stored) for d in kind.derived(scene)]


def finalise(writer: ResultWriter, scene: Scene) -> None:
    """Fill all of it, by one rank, after all cases."""
    from study.storage.grid_values import fill_grid
    from study.storage.plain_report import plain_report

    for kind in KINDS:
        kind.finalise(writer, scene)
    fill_grid(writer)
    writer.write_report(plain_report(writer.result(), scene.friction.mu))
