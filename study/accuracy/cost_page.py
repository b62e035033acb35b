"""What a cost study says: the answer in sentences, the work-precision diagram, and the page with all tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softjaw.study import pictures
from softjaw.study.accuracy.combinations import NO_LOSS, Combination, best_of, combinations
from softjaw.study.accuracy.convergence import LevelErrors, ParameterErrors
from softjaw.study.accuracy.cost_study import CostStudy
from softjaw.study.page import Block, box, bullets, heading, image, page, table, text, verbatim
from softjaw.study.run.progress import duration
from softjaw.study.scene.text import value_text

GOALS = (0.05, 0.02, 0.01, 0.005, 0.002)
BELOW = 1e-6  # errors below this are none
NEEDED = 0.01  # change of e_n from which an effect is needed
MOST_SHOWN = 12
NAMES = ("e_n", "max force", "max torque", "quality")
TITLES = ("eccentricity parameter e_n", "largest friction force", "largest torque", "grasp quality")
QUALITY = 3  # of these
LOOKS = (("#12436d", "o"), ("#c05a00", "s"), ("#2a8c82", "^"), ("#801650", "D"), ("#6b747b", "v"), ("#3d7a1f", "P"))
BASELINES = ("Winkler, planar", "*", 10), ("finite elements, planar friction", "X", 6)
EVALUATION = {"limit surface": ("<", "#801650"), "motions sampled": (">", "#8a6d00"), "score": ("h", "#b3261e")}
ABOUT = {
    "load steps": "Nothing here depends on the path, so this trades time for robustness only.",
    "contact model": "The same grasps by planar and cheaper models: a Winkler foundation with a planar"
    " contact, the PCM scaled by S, and the CCM. The object is rigid for the Winkler foundation.",
    "motions sampled": "Slip motions that the scene's limit surface is fitted to; the quality is quality_fitted.",
    "limit surface": "Form of the limit surface; the quality is quality_fitted, the reference is the exact quality of"
    " the hull of thousands of friction wrenches.",
    "score": "Quality with the three-motions ellipsoid: linearised hulls in six dimensions, as others use, and exact."
    " Measured at the highest force only.",
}
DIAGRAM = """Work-precision diagram. Every line changes one parameter and leaves the others as the scene has them; a
ring marks the scene's own. Errors are against the limit that the parameter's levels lead to, the largest over all probe
cases. Lower left is better; errors below 1e-6 are left out. The dotted line joins the combinations of all parameters
that nothing beats, with predicted errors."""
FRONT = """Combinations of all measured levels. Errors of the parameters are added, each the largest over the probe
cases; times are multiplied; what is cheaper follows from the unknowns."""
PARAMETERS = """Errors are relative to the limit of the levels, by Richardson extrapolation where the observed order
allows it: the largest over all probe cases, in brackets the median. The first row is the cheapest setting; the scene's
own is marked with an arrow."""


def percent(error: float) -> str:
    """A relative error as it is shown.

    >>> percent(0.0213), percent(0.00123), percent(3e-8), percent(0.34)
    ('2.1 %', '0.12 %', '< 0.0001 %', '34 %')
    """
    if not math.isfinite(error):
        return "–"
    if error < BELOW:
        return "< 0.0001 %"
    return f"{100 * error:.2g} %" if error < 0.995 else f"{100 * error:.0f} %"


def seconds_text(seconds: float) -> str:
    """A CPU time per case.

    >>> seconds_text(0.0234), seconds_text(0.6), seconds_text(12.3)
    ('23 ms', '0.6 s', '12 s')
    """
    if not math.isfinite(seconds):
        return "–"
    return f"{1e3 * seconds:.2g} ms" if seconds < 0.1 else f"{seconds:.2g} s"


def settings(values: Mapping[str, Any]) -> str:
    """Scene keys and values, as in ``gripper.elements = [20, 10, 6]``."""
    return ", ".join(f"{key} = {value_text(value)}" for key, value in values.items()) or "as in the scene"


def cost_page(study: CostStudy, tables: Sequence[ParameterErrors]) -> tuple[str, bytes]:
    """The page as HTML, one file with all that it shows, and the diagram as PNG."""
    best = best_of(combinations(tables, study.base_seconds, {}))
    with pictures.style():
        drawn = _work_precision(tables, best)
        svg, png = pictures.as_svg(drawn), pictures.as_png(drawn)
    skipped = [f"{s.parameter}: {s.level}: {s.reason}" for s in study.skipped]
    sections = [
        ("answer", "", [box(sentences(study, tables), "verdict")]),
        ("diagram", "Error against time", [image(svg, DIAGRAM, "error against CPU seconds per case")]),
        ("front", "Pareto-optimal settings", _front(study, best)),
        ("parameters", "Parameter by parameter",
         [text(PARAMETERS), *(block for errors in tables for block in _parameter(errors))]),
        ("skipped", "Not measured", [bullets(skipped) if skipped else text("Nothing was left out.")]),
        ("method", "How it was measured", [bullets(_method(study)), heading("Scene"), verbatim(study.scene)]),
    ]  # fmt: skip
    subtitle = f"{study.scene_file}, scene {study.digest[:8]}, {study.machine}"
    return page(f"What accuracy costs: {study.title}", subtitle, sections), png


def _front(study: CostStudy, best: Sequence[Combination]) -> list[Block]:
    rows = [[seconds_text(c.seconds), f"{c.seconds / study.base_seconds:.2g}", percent(c.error),
             settings(dict(c.level.values))] for c in best[:MOST_SHOWN]]  # fmt: skip
    head = ("CPU per case", "over the scene's", "predicted error of e_n", "settings")
    more = f" The first {len(rows)} of {len(best)}." if len(best) > len(rows) else ""
    return [table("Pareto front, the cheapest first", head, rows, texts=(0,), wide=(3,)), text(FRONT + more, "note")]


def _parameter(errors: ParameterErrors) -> list[Block]:
    """Everything that the page says of one parameter."""
    with_own = any(np.isfinite(level.own) for level in errors.levels)
    long_name = errors.parameter.long_name
    about = f"{long_name.capitalize()}. " if long_name else ""
    head = ["level", "CPU per case", *(["of it this step"] if with_own else []), *NAMES]
    rows = [_row(level, i == errors.own, with_own) for i, level in enumerate(errors.levels)]
    failed = [f"{level.level.name}: {level.message}" for level in errors.levels if level.message]
    return [
        heading(errors.name), table((about + ABOUT.get(errors.name, "")).strip(), head, rows, texts=(0,)),
        text(_orders(errors), "note"), *([bullets(failed)] if failed else []),
    ]  # fmt: skip


def _row(level: LevelErrors, own: bool, with_own: bool) -> list[str]:
    errors = [
        f"{percent(w)} ({percent(m)})" if w >= BELOW else "0" if w == 0 else percent(w) if w > 0 else "failed"
        for w, m in zip(level.worst, level.median, strict=True)
    ]
    part = [seconds_text(level.own)] if with_own else []
    return [("→ " if own else "") + level.level.name, seconds_text(level.seconds), *part, *errors]


def _orders(errors: ParameterErrors) -> str:
    """Observed orders, or why there are none."""
    family = errors.parameter.family
    if not errors.series:
        return f"No order is expected; the reference is {'the limit of the pad meshes' if family else 'the last row'}."
    seen = [
        f"{name}: order {found.order:.1f}" if not found.note else f"{name}: order not seen ({found.note})"
        for name, found in zip(NAMES, errors.limits, strict=True)
    ]
    end = " Both kinds of pad meshes are measured against the better known of their limits." if family else ""
    lines = "; ".join(
        f"{name} {_order(*found)}" for name, found in zip(NAMES, errors.orders, strict=True) if math.isfinite(found[0])
    )
    line = f" Order of the root mean square of the errors, over all levels: {lines}." if lines else ""
    return f"Observed on the three finest levels: {'; '.join(seen)}.{line}{end}"


def _order(order: float, spread: float) -> str:
    return f"{order:.1f} +- {spread:.1f}"


def _method(study: CostStudy) -> list[str]:
    forces = ", ".join(f"{f:g}" for f in study.of(study.base)[0].forces)
    return [
        f"Probes: {'; '.join(study.candidates)}, each at {forces} N.",
        "Time is CPU time of one process on one core, by the ordinary pipeline: mesh, contact solve, friction, limit"
        " surface and score of both fingers, over the number of forces. What takes less than a second is repeated up"
        " to three times and the least is taken; what is compiled or read at first use is not counted.",
        f"Calibration: one sparse factorisation of fixed size takes {seconds_text(study.calibration)} of CPU on this"
        f" machine. The scene as it is costs {study.base_seconds / study.calibration:.2g} times that per case; compare"
        " such ratios between machines.",
        f"The whole study took {duration(study.spent)} of CPU time.",
        f"Quantities: {', '.join(NAMES)} of the weaker finger, CCM; definitions in the file.",
    ]


# --- diagram ----------------------------------------------------------------------------------------------------------


def _work_precision(tables: Sequence[ParameterErrors], best: Sequence[Combination]) -> Any:
    """Error against CPU seconds per case, one panel for each quantity, one line for each parameter."""
    drawn, axes = pictures.figure(10, 7.2, 2, 2, gap=0.12, sharex=True)
    lines = [t for t in tables if not t.parameter.evaluation and t.name not in NO_LOSS]
    for q, (panel, title) in enumerate(zip(axes.flat, TITLES, strict=True)):
        panel.set(title=title, xscale="log", yscale="log")
        panel.grid(which="major", color="#e3e6e8", lw=0.6)
        for errors, (colour, marker) in zip(lines, LOOKS * 3, strict=False):
            look = {"marker": marker, "ls": "-" if errors.series else "", "color": colour, "label": errors.name}
            _draw(panel, errors.levels, q, **look)
            if math.isfinite((order := errors.orders[q])[0]):
                end = errors.levels[-1]
                panel.annotate(f"order {order[0]:.1f}", (end.seconds, end.worst[q]), (4, 4), color=colour, fontsize=8,
                               textcoords="offset points", annotation_clip=True)  # fmt: skip
            if errors.own >= 0:
                _draw(panel, [errors.levels[errors.own]], q, marker="o", ms=9, mfc="none", mec=pictures.INK, mew=0.9)
        for errors in tables:
            _baselines(panel, errors, q)
    if len(best) > 1:
        x, y = zip(*sorted((c.seconds, max(c.error, BELOW)) for c in best), strict=True)
        axes[0, 0].step(x, y, where="post", color=pictures.INK, lw=0.9, ls=":", zorder=2, label="Pareto front")
    for panel in axes[-1]:
        panel.set_xlabel("CPU seconds per case")
    for panel in axes[:, 0]:
        panel.set_ylabel("largest relative error of the probes")
    handles: dict[str, Any] = {}
    for panel in axes.flat:
        handles |= dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    drawn.legend(handles.values(), handles, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return drawn


def _draw(panel: Any, levels: Sequence[LevelErrors], q: int, **look: Any) -> None:
    shown = [level for level in levels if level.worst[q] > BELOW]
    if shown:
        panel.plot([v.seconds for v in shown], [v.worst[q] for v in shown], zorder=3, **look)


def _baselines(panel: Any, errors: ParameterErrors, q: int) -> None:
    """What others use: a Winkler foundation and planar friction; surfaces and hulls in the panel of the quality."""
    if errors.name == "contact model":
        for level, (name, marker, size) in zip(errors.levels, BASELINES, strict=False):
            _draw(panel, [level], q, marker=marker, ls="", ms=size, color=pictures.INK, label=name)
    elif q == QUALITY and errors.parameter.evaluation:
        marker, colour = EVALUATION[errors.name]
        _draw(panel, errors.levels, q, marker=marker, ls="", color=colour, ms=4.5, label=errors.name)


# --- answer -----------------------------------------------------------------------------------------------------------


def sentences(study: CostStudy, tables: Sequence[ParameterErrors]) -> list[str]:
    """The answer: what an error of e_n costs, what the next halving costs, which effects are needed."""
    meshes = [t for t in tables if "mesh" in t.name or t.name == "object grid"]
    best = best_of(combinations(meshes, study.base_seconds, {}))
    found = [_price(best, _known(meshes)), _scene(meshes, study.base_seconds)]
    found += [*map(_falls, meshes), *map(_need, tables)]
    return [sentence for sentence in found if sentence]


def _known(meshes: Sequence[ParameterErrors]) -> float:
    """To what the limits of all meshes are known, relative to e_n: the best of every family, added up."""
    found: dict[str, float] = {}
    for errors in meshes:
        found[errors.family] = min(float(errors.estimates.max()), found.get(errors.family, math.inf))
    return sum(found.values())


def _price(best: Sequence[Combination], known: float) -> str:
    """What 2 % cost, or what the front reaches, and the price of the next halving of the error."""
    if not best or not best[0].levels:
        return "No mesh but the scene's own was measured. Raise --time-limit."
    reached = [g for g in GOALS if best[-1].error <= g]
    if not reached:
        error = percent(best[-1].error)
        return f"No measured mesh brings e_n within 5 %; the best is at {error}. Raise --time-limit for finer ones."
    goal = 0.02 if 0.02 in reached else reached[-1]
    now = next(c for c in best if c.error <= goal)
    half = next((c for c in best if c.error <= 0.5 * now.error), None)
    price = f"{percent(now.error)} in e_n costs {seconds_text(now.seconds)} per case"
    values = dict(now.level.values)
    price += f" with {settings(values)}" if values else " with the scene as it is"
    if half is None:
        return f"{price}; half that error is less than the {percent(known)} to which the finest meshes are known."
    return f"{price}; the next halving of the error costs {half.seconds / now.seconds:.2g} times as much."


def _scene(meshes: Sequence[ParameterErrors], base: float) -> str:
    """Cost and errors of the scene as it is."""
    own = [(t, t.levels[t.own]) for t in meshes if t.own >= 0]
    parts = ", ".join(f"{percent(level.worst[0])} by the {t.name.partition(',')[0]}" for t, level in own)
    return f"The scene as it is costs {seconds_text(base)} per case and has {parts}." if own else ""


def _falls(errors: ParameterErrors) -> str:
    """With which order of the element size the error of e_n falls."""
    order = errors.orders[0]
    if not math.isfinite(order[0]):
        return ""
    return f"{errors.name[:1].upper()}{errors.name[1:]}: the error of e_n falls with order {_order(*order)}."


def _need(errors: ParameterErrors) -> str:
    """Whether an effect is needed: what its cheapest level moves e_n by."""
    if not errors.name.startswith("effect: ") or errors.name in NO_LOSS:
        return ""
    cheap, fine = errors.levels[0], errors.levels[-1]
    need = "is needed" if cheap.worst[0] > NEEDED else "is not needed"
    effect = errors.name.removeprefix("effect: ").capitalize()
    if not math.isfinite(cheap.worst[0]):
        return f"{effect}: '{fine.level.name}' was not solved, so what it changes is not known."
    faster = f"is {fine.seconds / cheap.seconds:.2g} times as fast"
    return (f"{effect}: '{fine.level.name}' {need}, '{cheap.level.name}' moves e_n by {percent(cheap.worst[0])} and"
            f" {faster}.")  # fmt: skip
