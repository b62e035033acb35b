"""One self-contained page about a result file, and a picture of its maps or curves: for mails, slides, printing.

The page answers in the order of a reader's questions: where to grasp, how wide and how hard, and how sure that is; the
object and its maps; what failed and why; the best case in detail; then how it was computed. It needs no network.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from softjaw.study import pictures
from softjaw.study.messages import CANNOT_WRITE, StudyError, write_file
from softjaw.study.page import Block, Section, answer, box, heading, page, text
from softjaw.study.quantities import FAILED, FIRST, NO_GRASP
from softjaw.study.result.read import open
from softjaw.study.show.best_grasps import answer as answer_lines
from softjaw.study.show.grasps import (
    Index,
    axis_label,
    axis_text,
    axis_values,
    compared,
    field,
    forces,
    judge,
    label_of,
    number,
    quantity,
)
from softjaw.study.show.object_surface import edges
from softjaw.study.show.report import contact, curves, maps, tables, verdict
from softjaw.study.show.view.model import Place, View, read_scene, view_of
from softjaw.study.show.view.object3d import object_block


def write_report(file: Path, out: Path, candidate: int | None = None, place: Place = (None, None)) -> list[Path]:
    """Write the page ``out`` and, beside it, the maps (or difference curves) as a PNG; the paths that were written.

    A candidate, counted over stations and angles, or the one nearest to a ``place`` (station [m], angle [rad]) is shown
    beside the best one.

    Raises
    ------
    StudyError
        If ``file`` is no result file or has no such candidate, or ``out`` cannot be written.
    """
    file, out = Path(file), Path(out)
    picture_path = out.with_suffix(".png")
    # A report must never write over the result that it is made from.
    if file.resolve() in (out.resolve(), picture_path.resolve()) or out == picture_path:
        raise StudyError(CANNOT_WRITE, f"{out}: choose a name that ends in .html for the report, with -o")
    html, png = build(open(file), candidate, place)
    return [write_file(out, html), write_file(picture_path, png)]


def build(ds: xr.Dataset, candidate: int | None = None, place: Place = (None, None)) -> tuple[str, bytes]:
    """The page and the picture of a study, as `study.result.read.open` gives it."""
    ds, scene = judge(ds), read_scene(ds)
    if candidate is not None or place != (None, None):
        ds = judge(ds, view_of(ds, candidate, place, None)[1])
    # A study without a solved case still gets its page, with states and scene.
    best = ds.attrs["best"] or (*(0 for _ in ds.status.shape[:-1]), ds.attrs["level"])
    view = View(ds, best[:-3])
    sections: list[Section] = [
        ("answer", "", [the_object(view, best), the_answer(ds)]),
        ("best", "Best grasps", best_grasps(ds)),
        ("maps", "Maps", (maps.maps(ds, best) if ds.status.size > 1 else []) +
         tables.reasons(ds, FAILED, *NO_GRASP)),
        ("wall", "What the wall bears", wall(view, best)),
        ("curvature", "What curvature costs", curves.differences(ds, scene, best)),
        *(cases(view, scene) if ds.attrs["best"] is not None else []),
        ("effects", "What was simulated",
         [*tables.effects(ds), maps.levels(ds, best), text(verdict.CAVEAT, "note")]),
        ("cost", "Convergence and cost",
         [*tables.states(ds), tables.checks(ds), maps.effort(ds, best), *tables.time_split(ds)]),
        ("cases", "All cases", tables.every_case(ds)),
        ("definitions", "Definitions", tables.definitions(ds)),
        ("provenance", "Provenance", tables.provenance(ds)),
        ("scene", "Scene in effect", tables.scene(ds)),
    ]  # fmt: skip
    title = f"{ds.attrs['title']}: {'where to grasp' if view.candidates > 1 else 'grasp study'}"
    return page(title, verdict.subtitle(ds), sections), picture(ds, scene, best)


def the_answer(ds: xr.Dataset) -> Block | None:
    """The best grasp at a glance: where, how wide, how hard, what it holds, why no more."""
    if ds.attrs["best"] is None:
        return None
    lines = answer_lines(ds, ds.attrs["best"], f", {ds.attrs['why']}")
    return answer((name, *value) for name, value in lines.items())


def best_grasps(ds: xr.Dataset) -> list[Block]:
    """How sure the best grasp is, what speaks against it, and the tables of the best grasps."""
    chosen = [verdict.chosen(ds)] if ds.attrs["chosen"] else []
    boxes = [(verdict.verdict(ds), "verdict"), (verdict.warnings(ds), "warn"), (chosen, "verdict")]
    return [box(texts, look) for texts, look in boxes if texts] + tables.best_grasps(ds)


def the_object(view: View, best: Index) -> Block | None:
    """The object in three dimensions with the pads of the best and of the chosen grasp at every force."""
    shown = [i for i in (best, view.ds.attrs["chosen"]) if i and i[:-3] == view.point]
    cases = dict.fromkeys((*i[:-1], k) for i in shown for k in range(len(forces(view.ds))))
    block = object_block(view, best, view.ds.attrs["score"], "x", list(cases))
    return block or (text(f"{view.note[:1].upper()}{view.note[1:]}.", "note") if view.note else None)


def wall(view: View, best: Index) -> list[Block | None]:
    """Limits, safe forces, shape and force curves of a thin wall; empty without one."""
    ds, shape = view.ds, getattr(view.scene, "object", None)
    if field(ds, "indentation") is None:
        return []
    allowed = getattr(shape, "allowed_dent", None)
    sections = curves.wall_section(view, best)
    return [*tables.wall(ds, shape), maps.safe_forces(ds, best), sections, curves.wall_curves(ds, best, allowed)]


def cases(view: View, scene: Any) -> list[Section]:
    """Force curves, contact patch and limit surface of the best case, and of the one that was asked for."""
    ds, best, chosen = view.ds, view.ds.attrs["best"], view.ds.attrs["chosen"]
    roles = {"Best case": best}
    if chosen is not None and compared(ds)[0] == chosen:
        roles["Chosen candidate"] = chosen
    # The other case may belong to another point of the sweep, and so to another object.
    views = {index: view if index[:-3] == view.point else View(ds, index[:-3]) for index in roles.values()}
    which = "of the best case" if len(roles) == 1 else "of both cases"

    def headed(draw: Callable[[View, Index], Block | None]) -> list[Block]:
        drawn = {role: block for role, index in roles.items() if (block := draw(views[index], index))}
        return [part for role, block in drawn.items() for part in ([heading(role)] * (len(roles) > 1) + [block])]

    return [
        ("models", "Friction models compared", curves.models(ds, best, scene.friction.mu if scene else None)),
        ("patch", f"Contact patch {which}", headed(contact.patch)),
        ("surface", f"Limit surface {which}", headed(contact.limit_surfaces)),
    ]


def picture(ds: xr.Dataset, scene: Any, index: Index) -> bytes:
    """PNG for mails and slides: maps of quality and e_n over the force, or differences over a sweep of the shape."""
    with pictures.style():
        position = curves.shape_axis(ds, scene)
        lines = {} if position is None else curves.overestimates(ds, position, index)
        if position is not None and lines:
            name, x = next(iter(curves.abscissas(ds, scene, position, index).items()))
            drawn = _differences(name, x, lines)
        else:
            drawn = _maps(ds, index)
        drawn.suptitle(f"{ds.attrs['title']}, {number(forces(ds)[index[-1]])} N", fontsize=10, x=0.01, ha="left")
        return pictures.as_png(drawn)


def _differences(name: str, x: np.ndarray, lines: dict[Any, Any]) -> Any:
    known = [m for m in curves.AGAINST if any(model == m for model, _ in lines)]
    drawn, axes = pictures.figure(10, 3.7, 1, len(known), sharey=True)
    order = np.argsort(x)
    for (model, key), (values, error) in lines.items():
        label, colour, _ = curves.COMPONENTS[key]
        bars = None if error is None else 100 * np.abs(error)[order]
        panel = axes[0, known.index(model)]
        panel.errorbar(x[order], 100 * values[order], bars, color=colour, marker="o", capsize=2, label=label)
        panel.set(title=curves.AGAINST[model], xlabel=name, ylabel="1 - CCM / PCM [%]")
    axes[0, 0].legend(frameon=False)
    return drawn


def _maps(ds: xr.Dataset, index: Index) -> Any:
    """The first maps over the main axis and the force, one row for each angle."""
    x, y, angle = maps.main_axis(ds), len(index) - 1, len(index) - 2
    rows, axis = maps.some(maps.different_angles(ds), index[angle]), str(ds.status.dims[maps.main_axis(ds)])
    drawn, axes = pictures.figure(10, 2.4 * len(rows) + 0.6, len(rows), len(FIRST), sharex=True, sharey=True)
    # Forces by number: their steps may grow by decades, and each needs a row to be seen.
    borders = edges(axis_values(ds, axis)), np.arange(len(forces(ds)) + 1) - 0.5
    for column, name in enumerate(FIRST):
        values_of = field(ds, name)
        z = np.full(ds.status.shape, np.nan) if values_of is None else quantity(ds, name)[2] * values_of
        low, high = pictures.span(z)
        for panel, j in zip(axes[:, column], rows, strict=True):
            here = (*index[:angle], j, index[-1])
            values, failed = (maps.plane(a, x, y, here) for a in (z, ds.status.values == FAILED))
            mapped = pictures.heat(panel, *borders, values, failed, cmap=pictures.COLOURS[name], vmin=low, vmax=high)
            panel.set_yticks(range(len(forces(ds))), [number(f) for f in forces(ds)])
            panel.set_title(f"angle {axis_text(ds, 'angle', j)}" * (ds.sizes["angle"] > 1))
        pictures.colour_bar(drawn, mapped, list(axes[:, column]), label_of(ds, name))
        axes[-1, column].set_xlabel(axis_label(ds, axis))
    axes[0, 0].set_ylabel("force per finger [N]")
    return drawn
