"""What a cost study says: the answer in sentences, the work-precision diagram, and the page with all tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jinja2 import Environment

from softjaw.study import pictures
from softjaw.study.accuracy.cost.choose import BELOW, NO_LOSS, Combination, best_of, combinations, percent, seconds_text
from softjaw.study.accuracy.cost.choose import values_text as settings
from softjaw.study.accuracy.cost.errors import KnobErrors, LevelErrors
from softjaw.study.accuracy.cost.study import CostStudy
from softjaw.study.run.progress import duration

GOALS = (0.05, 0.02, 0.01, 0.005, 0.002)
NEEDED = 0.01  # change of e_n from which an effect is needed
MOST_SHOWN = 12
NAMES = ("e_n", "max force", "max torque", "quality")
TITLES = ("eccentricity parameter e_n", "largest friction force", "largest torque", "grasp quality")
QUALITY = 3  # of these
LOOKS = (("#12436d", "o"), ("#c05a00", "s"), ("#2a8c82", "^"), ("#801650", "D"), ("#6b747b", "v"), ("#3d7a1f", "P"))
BASELINES = ("Winkler, planar", "*", 10), ("finite elements, planar friction", "X", 6)
JUDGING = {"limit surface": ("<", "#801650"), "motions sampled": (">", "#8a6d00"), "score": ("h", "#b3261e")}
ABOUT = {
    "load steps": "Nothing here depends on the path, so this trades time for robustness only.",
    "contact model": "What planar and cheaper models make of the same grasps: a Winkler foundation with a planar"
    " contact, the planar friction model with S, and the curved one. The object is rigid for the Winkler foundation.",
    "motions sampled": "Slip motions that the scene's limit surface is fitted to; the quality is quality_fitted.",
    "limit surface": "Form of the limit surface; the quality is quality_fitted, the reference is the exact quality of"
    " the hull of thousands of friction wrenches.",
    "score": "Quality with the three-motions ellipsoid: linearised hulls in six dimensions, as others use, and exact."
    " Measured at the highest force only.",
}
TEMPLATE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{{ title }}</title><style>
body { font: 15px/1.5 system-ui, sans-serif; color: #1d2429; max-width: 62rem; margin: 2rem auto; padding: 0 1rem }
table { border-collapse: collapse; font-size: 13px; margin: .6rem 0 } caption { text-align: left; padding: .3rem 0 }
td, th { padding: .2rem .7rem; border-bottom: 1px solid #d8dde0; text-align: right; white-space: nowrap }
td.text, th.text { text-align: left; white-space: normal } .note { color: #56616a; font-size: 13px }
.answer { background: #eef2f5; padding: .6rem 1.2rem } svg { max-width: 100%; height: auto } pre { overflow-x: auto }
</style></head><body>
{% macro table(caption, head, rows, texts) %}<table><caption>{{ caption }}</caption><tr>
{% for name in head %}<th{% if loop.index0 in texts %} class="text"{% endif %}>{{ name }}</th>{% endfor %}</tr>
{% for row in rows %}<tr>{% for cell in row %}<td{% if loop.index0 in texts %} class="text"{% endif %}>{{ cell }}</td>
{% endfor %}</tr>{% endfor %}</table>{% endmacro %}
{% macro bullets(items) %}<ul>{% for item in items %}<li>{{ item }}</li>{% endfor %}</ul>{% endmacro %}
<h1>{{ title }}</h1><p class="note">{{ study.scene_file }}, scene {{ study.digest[:8] }}, {{ study.machine }}</p>
<div class="answer">{{ bullets(answer) }}</div>
<h2>Error against time</h2><figure>{{ picture|safe }}
<figcaption class="note">Every line changes one parameter and leaves the
others as the scene has them; a ring marks the scene's own. Errors are against the limit that the parameter's levels
lead to, the largest over all probe cases. Lower left is better; errors below 1e-6 are left out. The dotted line joins
the combinations of all parameters that nothing beats, with predicted errors.</figcaption></figure>
<h2>Settings that nothing beats</h2>
{{ table("Pareto front, the cheapest first", front_head, front, (0, 3)) }}
<p class="note">Combinations of all measured levels. Errors of the parameters are added, each the largest over the probe
cases; times are multiplied; what is cheaper follows from the unknowns. 'accuracy.e_n' in a scene chooses from these and
tries them on the probes and on cases held out.{% if more %} The first {{ front|length }} of {{ more }}.{% endif %}</p>
<h2>Parameter by parameter</h2><p>Errors are relative to the limit of the levels, by Richardson extrapolation where the
observed order allows it: the largest over all probe cases, in brackets the median. The first row is the cheapest
setting; the scene's own is marked with an arrow.</p>
{% for knob in knobs %}<h3>{{ knob.name }}</h3>{{ table(knob.about, knob.head, knob.rows, (0,)) }}
<p class="note">{{ knob.orders }}</p>{{ bullets(knob.failed) }}{% endfor %}
<h2>Not measured</h2>{% if study.skipped %}<ul>{% for s in study.skipped %}
<li>{{ s.knob }}: {{ s.level }}: {{ s.reason }}</li>{% endfor %}</ul>{% else %}<p>Nothing was left out.</p>{% endif %}
<h2>How it was measured</h2>{{ bullets(how) }}<h3>Scene</h3><pre>{{ study.scene }}</pre></body></html>
"""


def cost_page(study: CostStudy, tables: Sequence[KnobErrors]) -> tuple[str, bytes]:
    """The page as HTML, one file with all that it shows, and the diagram as PNG."""
    base = _base_seconds(study)
    best = best_of(combinations(tables, base, {}))
    with pictures.style():
        drawn = _work_precision(tables, best)
        svg, png = pictures.as_svg(drawn), pictures.as_png(drawn)
    front = [[seconds_text(c.seconds), f"{c.seconds / base:.2g}", percent(c.error), settings(dict(c.level.values))]
             for c in best[:MOST_SHOWN]]  # fmt: skip
    page = Environment(autoescape=True).from_string(TEMPLATE)
    return page.render(
        title=f"What accuracy costs: {study.title}", study=study, answer=sentences(study, tables), picture=svg,
        front=front, front_head=("CPU per case", "over the scene's", "predicted error of e_n", "settings"),
        more=len(best) if len(best) > MOST_SHOWN else 0, knobs=[_knob(table) for table in tables],
        how=_how(study, base),
    ), png  # fmt: skip


def _base_seconds(study: CostStudy) -> float:
    return float(np.mean([m.seconds for m in study.of(study.base)]))


def _knob(table: KnobErrors) -> dict[str, Any]:
    """Everything that the page says of one parameter."""
    own = any(np.isfinite(level.own) for level in table.levels)
    about = f"{table.knob.long_name.capitalize()}." if table.knob else ""
    return {
        "name": table.name,
        "about": f"{about} {ABOUT.get(table.name, '')}".strip(),
        "head": ["level", "CPU per case", *(["of it this step"] if own else []), *NAMES],
        "rows": [_row(level, i == table.own, own) for i, level in enumerate(table.levels)],
        "orders": _orders(table),
        "failed": [f"{level.name}: {level.message}" for level in table.levels if level.message],
    }


def _row(level: LevelErrors, own: bool, with_own: bool) -> list[str]:
    errors = [
        f"{percent(w)} ({percent(m)})" if w >= BELOW else "0" if w == 0 else percent(w) if w > 0 else "failed"
        for w, m in zip(level.worst, level.middle, strict=True)
    ]
    part = [seconds_text(level.own)] if with_own else []
    return [("→ " if own else "") + level.name, seconds_text(level.seconds), *part, *errors]


def _orders(table: KnobErrors) -> str:
    """Observed orders, or why there are none."""
    if not table.ladder:
        reference = "the limit of the pad meshes" if table.family else "the last row"
        return f"No order is expected; the reference is {reference}."
    seen = [
        f"{name}: order {found.order:.1f}" if not found.note else f"{name}: order not seen ({found.note})"
        for name, found in zip(NAMES, table.limits, strict=True)
    ]
    end = " Both kinds of pad meshes are measured against the better known of their limits." if table.family else ""
    return f"Observed on the three finest levels: {'; '.join(seen)}.{end}"


def _how(study: CostStudy, base: float) -> list[str]:
    forces = ", ".join(f"{f:g}" for f in study.of(study.base)[0].forces)
    return [
        f"Probes: {'; '.join(study.candidates)}, each at {forces} N.",
        "Time is CPU time of one process on one core, by the ordinary pipeline: mesh, contact solve, friction, limit"
        " surface and score of both fingers, over the number of forces. What takes less than a second is repeated up"
        " to three times and the least is taken; what is compiled or read at first use is not counted.",
        f"Calibration: one sparse factorisation of fixed size takes {seconds_text(study.calibration)} of CPU on this"
        f" machine. The scene as it is costs {base / study.calibration:.2g} times that per case; compare such ratios"
        " between machines.",
        f"The whole study took {duration(study.spent)} of CPU time.",
        f"Quantities: {', '.join(NAMES)} of the weaker finger, curved model; definitions in the file.",
    ]


# --- diagram ----------------------------------------------------------------------------------------------------------


def _work_precision(tables: Sequence[KnobErrors], best: Sequence[Combination]) -> Any:
    """Error against CPU seconds per case, one panel for each quantity, one line for each parameter."""
    drawn, axes = pictures.figure(10, 7.2, 2, 2, gap=0.12, sharex=True)
    lines = [t for t in tables if not t.judging and t.name not in NO_LOSS]
    for q, (panel, title) in enumerate(zip(axes.flat, TITLES, strict=True)):
        panel.set(title=title, xscale="log", yscale="log")
        panel.grid(which="major", color="#e3e6e8", lw=0.6)
        for table, (colour, marker) in zip(lines, LOOKS * 3, strict=False):
            look = {"marker": marker, "ls": "-" if table.ladder else "", "color": colour, "label": table.name}
            _draw(panel, [level for level in table.levels if level.worst[q] > BELOW], q, **look)
            if table.own >= 0 and (own := table.levels[table.own]).worst[q] > BELOW:
                panel.plot(own.seconds, own.worst[q], "o", ms=9, mfc="none", mec=pictures.INK, mew=0.9, zorder=4)
        for table in tables:
            _baselines(panel, table, q)
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
    if levels:
        panel.plot([v.seconds for v in levels], [v.worst[q] for v in levels], zorder=3, **look)


def _baselines(panel: Any, table: KnobErrors, q: int) -> None:
    """What others use: a Winkler foundation and planar friction; surfaces and hulls in the panel of the quality."""
    if table.name == "contact model":
        for level, (name, marker, size) in zip(table.levels, BASELINES, strict=False):
            if level.worst[q] > BELOW:
                panel.plot(level.seconds, level.worst[q], marker, ms=size, color=pictures.INK, label=name, zorder=4)
    elif q == QUALITY and table.judging:
        marker, colour = JUDGING[table.name]
        levels = [level for level in table.levels if level.worst[q] > BELOW]
        _draw(panel, levels, q, marker=marker, ls="", color=colour, ms=4.5, label=table.name)


# --- answer -----------------------------------------------------------------------------------------------------------


def sentences(study: CostStudy, tables: Sequence[KnobErrors]) -> list[str]:
    """The answer: what an error of e_n costs, what the next halving costs, which effects are needed."""
    base, meshes = _base_seconds(study), [t for t in tables if "mesh" in t.name or t.name == "object grid"]
    best = best_of(combinations(meshes, base, {}))
    return [text for text in (_price(best, _known(meshes)), _own(meshes, base), *map(_need, tables)) if text]


def _known(meshes: Sequence[KnobErrors]) -> float:
    """To what the limits of all meshes are known, relative to e_n: the best of every family, added up."""
    found: dict[str, float] = {}
    for table in meshes:
        name = table.family or table.name
        found[name] = min(table.doubt, found.get(name, math.inf))
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
    text = f"{percent(now.error)} in e_n costs {seconds_text(now.seconds)} per case"
    text += f" with {settings(dict(now.level.values))}"
    if half is None:
        return f"{text}; half that error is less than the {percent(known)} to which the finest meshes are known."
    return f"{text}; the next halving of the error costs {half.seconds / now.seconds:.2g} times as much."


def _own(meshes: Sequence[KnobErrors], base: float) -> str:
    """Where the scene as it is stands."""
    own = [(t, t.levels[t.own]) for t in meshes if t.own >= 0]
    parts = ", ".join(f"{percent(level.worst[0])} by the {t.name.partition(',')[0]}" for t, level in own)
    return f"The scene as it is costs {seconds_text(base)} per case and has {parts}." if own else ""


def _need(table: KnobErrors) -> str:
    """Whether an effect is needed: what its cheapest level moves e_n by."""
    if not table.name.startswith("effect: ") or table.name in NO_LOSS or len(table.levels) < 2:
        return ""
    cheap, fine = table.levels[0], table.levels[-1]
    moved, faster = cheap.worst[0], fine.seconds / cheap.seconds
    need = "is needed" if moved > NEEDED else "is not needed"
    effect = table.name.removeprefix("effect: ")
    by = f"'{cheap.name}' moves e_n by {percent(moved)} and is {faster:.2g} times as fast"
    return f"{effect.capitalize()}: '{fine.name}' {need}, {by}."
