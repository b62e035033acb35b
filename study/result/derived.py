"""What is filled once, after all cases: each kind of study adds its own datasets; then comes the grid."""

from __future__ import annotations

from itertools import product

import numpy as np

from softjaw.study.case.candidates import axes
from softjaw.study.result import interval, window
from softjaw.study.result.grid import fill_grid
from softjaw.study.result.layout import Derived
from softjaw.study.result.result_writer import ResultWriter
from softjaw.study.scene import Scene

SWEPT = {"object.semi_axis_a_mm", "object.semi_axis_b_mm"}  # give the axes that curvature studies are drawn over
PREDICTED, MEASURED, HELD_OUT = "e_n_error_predicted", "e_n_error_on_probes", "e_n_error_held_out"
SECONDS = "seconds_per_case_predicted"
MEANING = {
    PREDICTED: ("", "predicted relative error of e_n", "Largest relative error of e_n that the cost study predicts for"
                " the settings that accuracy.e_n chose: the sum over its knobs, or that of the chosen mesh."),
    MEASURED: ("", "relative error of e_n on probe cases", "Largest relative error of e_n of the chosen settings on the"
               " probe cases, against the limit of finer ones and with what that limit may be off. NaN: they were not"
               " solved there."),
    HELD_OUT: ("", "relative error of e_n on other cases", "The same on cases that the settings were not chosen by."
               " NaN: there were none, or the target was missed before."),
    SECONDS: ("s", "predicted CPU time of one case", "CPU time of one case with the chosen settings, on the probes."),
}  # fmt: skip


def derived(scene: Scene) -> list[Derived]:
    """Everything that is derived for a scene."""
    return [*_of_sweep(scene), *window.derived(scene), *interval.derived(scene), *_of_target(scene)]


def finalise(writer: ResultWriter, scene: Scene) -> None:
    """Fill it, by one rank, after all cases; what a target of accuracy chose is written by who chose it."""
    _fill_sweep(writer, scene)
    window.finalise(writer, scene)
    interval.finalise(writer, scene)
    fill_grid(writer)


def _of_target(scene: Scene) -> list[Derived]:
    """What the choice of the settings promises: four numbers where the scene names a target."""
    if scene.accuracy.e_n is None:
        return []
    return [Derived(name, *words, shape=(1,)) for name, words in MEANING.items()]


def _of_sweep(scene: Scene) -> list[Derived]:
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


def _fill_sweep(writer: ResultWriter, scene: Scene) -> None:
    """Fill the axes of curvature studies."""
    if not _of_sweep(scene):
        return
    points = [scene.with_values(dict(zip(scene.sweep, v, strict=True))).object for v in product(*scene.sweep.values())]
    shape = writer.layout.shape[:-3]
    a, b = (np.reshape([getattr(p, name) for p in points], shape) for name in ("semi_axis_a", "semi_axis_b"))
    writer.write_derived("b_over_a", b / a)
    writer.write_derived("apex_curvature", a / b**2)
