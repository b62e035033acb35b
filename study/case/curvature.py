"""The axes that curvature studies are drawn over: derived datasets of a sweep over an elliptic cylinder's semi-axes."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from softjaw.study.case.sweep import axes
from softjaw.study.result.layout import Derived
from softjaw.study.scene import Scene

if TYPE_CHECKING:
    from softjaw.study.result.store import ResultWriter

SWEPT = {"object.semi_axis_a_mm", "object.semi_axis_b_mm"}


def derived(scene: Scene) -> list[Derived]:
    """What a sweep over an elliptic cylinder's semi-axes adds: the axes that curvature studies are drawn over."""
    if scene.object.shape != "elliptic_cylinder" or not SWEPT & set(scene.sweep):
        return []
    over = tuple(axis.name for axis in axes(scene)[:-3])
    return [
        Derived("b_over_a", "", "b / a", "Semi-axis across the contact over that along its normal.", over),
        Derived(
            "apex_curvature",
            "1/m",
            "apex curvature a / b^2",
            "Curvature of the section where pads at angle 0 touch.",
            over,
        ),
    ]


def finalise(writer: ResultWriter, scene: Scene) -> None:
    """Fill the derived datasets, by one rank, after all cases."""
    if not derived(scene):
        return
    points = [scene.with_values(dict(zip(scene.sweep, v, strict=True))).object for v in product(*scene.sweep.values())]
    shape = writer.layout.shape[:-3]
    a, b = (np.reshape([getattr(p, name) for p in points], shape) for name in ("semi_axis_a", "semi_axis_b"))
    writer.write_derived("b_over_a", b / a)
    writer.write_derived("apex_curvature", a / b**2)
