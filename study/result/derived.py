"""What is filled once, after all cases: each kind of study adds its own datasets; then come the grid and the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softjaw.study.accuracy.cost import stored
from softjaw.study.accuracy.uncertainty import interval
from softjaw.study.case import sweep, window
from softjaw.study.result.layout import Derived
from softjaw.study.scene import Scene

if TYPE_CHECKING:
    from softjaw.study.result.store import ResultWriter

KINDS = (sweep, window, interval)


def derived(scene: Scene) -> list[Derived]:
    """Everything that is derived for a scene."""
    return [d for kind in (*KINDS, stored) for d in kind.derived(scene)]


def finalise(writer: ResultWriter, scene: Scene) -> None:
    """Fill all of it, by one rank, after all cases."""
    from softjaw.study.result.grid_values import fill_grid
    from softjaw.study.result.plain_report import plain_report

    for kind in KINDS:
        kind.finalise(writer, scene)
    fill_grid(writer)
    writer.write_report(plain_report(writer.result(), scene.friction.mu))
