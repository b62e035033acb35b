"""The page of a cost study: the answer, the diagram, the Pareto front, one table for each knob, how it was measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softjaw.study.accuracy.cost.choose import Combination, best_of, combinations
from softjaw.study.accuracy.cost.errors import KnobErrors, LevelErrors
from softjaw.study.accuracy.cost.file import CostStudy
from softjaw.study.accuracy.cost.measure import QUANTITIES
from softjaw.study.accuracy.cost.picture import work_precision
from softjaw.study.accuracy.cost.words import BELOW, percent, seconds_text, sentences, settings_text
from softjaw.study.run.progress import duration
from softjaw.study.show import pictures
from softjaw.study.show.page import Block, box, bullets, heading, page, table, text, verbatim

MOST_SHOWN = 12
NAMES = ("e_n", "max force", "max torque", "quality")
WHAT = {
    "pad mesh, hex8": "Trilinear elements of the whole pad, along length, width and thickness.",
    "pad mesh, hex27": "Triquadratic elements of the whole pad.",
    "wall mesh": "Sizes of the wall's elements: around the object, along it, and elsewhere.",
    "object grid": "Step of the grid on which the mesh's distance is sampled.",
    "solver tolerance": "Residual over load at which a contact solve ends.",
    "load steps": "Forces solved on the way to each of the probe's forces. Nothing here depends on the way, so this"
    " trades time for robustness only.",
    "gap collocation": "Gaps that vanish at the nodes, or on average round them.",
    "contact model": "What planar and cheaper models make of the same grasps: a Winkler foundation with a planar"
    " contact, the planar friction model with S, and the curved one. The object is rigid for the Winkler foundation.",
    "motions sampled": "Slip motions that the scene's limit surface is fitted to; the quality is quality_fitted.",
    "limit surface": "Form of the limit surface; the quality is quality_fitted, the reference is the exact quality of"
    " the hull of thousands of friction wrenches.",
    "score": "Quality with the three-motions ellipsoid: linearised hulls in six dimensions, as others use, and exact."
    " Measured at the highest force only.",
}


def cost_page(study: CostStudy, tables: Sequence[KnobErrors]) -> tuple[str, bytes]:
    """The page as HTML and the diagram as PNG."""
    base = float(np.mean([m.seconds for m in study.of(study.base)]))
    best = best_of(combinations(tables, base, {}))
    with pictures.style():
        shown, png = work_precision(tables, best)
    sections = [
        ("answer", "", [box(sentences(study, tables), "verdict")]),
        ("diagram", "Error against time", [shown]),
        ("front", "Settings that nothing beats", _front(best, base)),
        ("knobs", "Knob by knob", [_legend(), *(part for t in tables for part in _knob(t))]),
        ("left-out", "Not measured", _left_out(study)),
        ("how", "How it was measured", _how(study, base)),
    ]
    title = f"What accuracy costs: {study.title}"
    return page(title, f"{study.scene_file}, scene {study.digest[:8]}, {study.machine}", sections), png


def _front(best: Sequence[Combination], base: float) -> list[Block]:
    rows = [
        [seconds_text(c.seconds), f"{c.seconds / base:.2g}", percent(c.error), settings_text(c)]
        for c in best[:MOST_SHOWN]
    ]
    head = ["CPU per case", "over the scene's", "predicted error of e_n", "settings"]
    told = (
        "Combinations of all measured levels. Errors of the knobs are added, each the largest over the probe cases;"
        " times are multiplied; what is cheaper follows from the unknowns. 'accuracy.e_n' in a scene chooses from these"
        " and tries them on the probes and on cases held out."
    )
    more = f" The first {MOST_SHOWN} of {len(best)}." if len(best) > MOST_SHOWN else ""
    return [table("Pareto front, the cheapest first", head, rows, texts=(0,), wide=(3,)), text(told + more, "note")]


def _legend() -> Block:
    return text(
        "Errors are relative to the limit of the knob's ladder, by Richardson extrapolation where the observed order"
        " allows it: the largest over all probe cases, in brackets the median. The first row is the cheapest setting;"
        " the scene's own is marked with an arrow."
    )


def _knob(knob: KnobErrors) -> list[Block]:
    own = any(np.isfinite(level.own) for level in knob.levels)
    head = ["level", "CPU per case", *(["of it this step"] if own else []), *NAMES]
    rows = [_row(level, i == knob.own, own) for i, level in enumerate(knob.levels)]
    caption = WHAT.get(knob.name, f"{knob.long_name.capitalize()}, forced for all candidates.")
    found = [heading(knob.name), table(caption, head, rows, texts=(0,)), text(_orders(knob), "note")]
    failed = [f"{level.name}: {level.message}" for level in knob.levels if level.message]
    return [*found, bullets(failed)] if failed else found


def _row(level: LevelErrors, own: bool, with_own: bool) -> list[str]:
    errors = [
        f"{percent(w)} ({percent(m)})" if w >= BELOW else "0" if w == 0 else percent(w) if w > 0 else "failed"
        for w, m in zip(level.worst, level.middle, strict=True)
    ]
    part = [seconds_text(level.own)] if with_own else []
    errors = [text.replace(" %", "\u00a0%") for text in errors]
    return [("→ " if own else "") + level.name, seconds_text(level.seconds), *part, *errors]


def _orders(knob: KnobErrors) -> str:
    """Observed orders, or why there are none."""
    if all(found.remark == "no order is expected" for found in knob.limits):
        reference = "the limit of the pad meshes" if knob.family else "the last row"
        return f"No order is expected; the reference is {reference}."
    told = [
        f"{name}: order {found.order:.1f}" if not found.remark else f"{name}: order not seen ({found.remark})"
        for name, found in zip(NAMES, knob.limits, strict=True)
    ]
    end = "" if not knob.family else " Both kinds of pad meshes are measured against the better known of their limits."
    return f"Observed on the three finest levels: {'; '.join(told)}.{end}"


def _left_out(study: CostStudy) -> list[Block]:
    if not study.skipped:
        return [text("Nothing was left out.")]
    return [bullets(f"{s.knob}: {s.level}: {s.reason}" for s in study.skipped)]


def _how(study: CostStudy, base: float) -> list[Block]:
    forces = ", ".join(f"{f:g}" for f in study.of(study.base)[0].forces)
    items = [
        f"Probes: {'; '.join(study.candidates)}, each at {forces} N.",
        "Time is CPU time of one process on one core, by the ordinary pipeline: mesh, contact solve, friction, limit"
        " surface and score of both fingers, over the number of forces. What takes less than a second is repeated up"
        " to three times and the least is taken; what is compiled or read at first use is not counted.",
        f"Calibration: one sparse factorisation of fixed size takes {seconds_text(study.calibration)} of CPU on this"
        f" machine. The scene as it is costs {base / study.calibration:.2g} times that per case; compare such ratios"
        " between machines.",
        f"The whole study took {duration(study.spent)} of CPU time.",
        f"Quantities: {', '.join(QUANTITIES)} of the weaker finger, curved model; definitions in the file.",
    ]
    return [bullets(items), heading("Scene"), verbatim(study.scene)]
