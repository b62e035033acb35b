"""One self-contained page about a result file, and a picture of its maps or curves: for mails, slides, printing.

The page answers in the order of a reader's questions: where to grasp, how wide and how hard, and how sure that is; the
object and its maps; what failed and why; the best case in detail; then how it was computed. It needs no network.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study import pictures
from softjaw.study.messages import CANNOT_WRITE, StudyError, write_file
from softjaw.study.result.grid_surface import edges
from softjaw.study.result.layout import FAILED
from softjaw.study.result.store import open_result
from softjaw.study.show.data import Data, number, shown
from softjaw.study.show.outline import read_scene, swept_object
from softjaw.study.show.page import Block, Section, box, heading, page, text
from softjaw.study.show.page import answer as answer_block
from softjaw.study.show.report import contact, curves, maps, tables, verdict
from softjaw.study.show.view.model import View, view_of
from softjaw.study.show.view.object3d import object_block

Place = tuple[float | None, float | None]


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
    if file.resolve() in (out.resolve(), picture_path.resolve()) or out == picture_path:
        raise StudyError(CANNOT_WRITE, f"{out}: choose a name that ends in .html for the report, with -o")
    with open_result(file) as result:
        html, png = build(result, candidate, place)
    return [write_file(out, html), write_file(picture_path, png)]


def build(result: Any, candidate: int | None = None, place: Place = (None, None)) -> tuple[str, bytes]:
    """The page and the picture of an open result file."""
    data, scene = Data(result), read_scene(result.scene)
    if candidate is not None or place != (None, None):
        data.chosen = view_of(data, candidate, place, None)[1]
    best = data.best or (*(0 for _ in data.shape[:-1]), data.k)
    sections: list[Section] = [
        ("verdict", "", answer(data, scene)),
        ("object", "The object", the_object(data, best)),
        ("maps", "Maps", (maps.maps(data, best) if data.status.size > 1 else []) + tables.failures(data)),
        ("wall", "What the wall bears", wall(data, scene)),
        ("curvature", "What curvature costs", curves.differences(data, scene, best)),
        *(cases(data, scene, data.best) if data.best is not None else []),
        ("effects", "What was simulated",
         [*tables.effects(data), *_there(maps.levels(data, best)), text(verdict.CAVEAT, "note")]),
        ("cost", "Convergence and cost",
         [*tables.states(data), tables.checks(data), *_there(maps.effort(data, best)), *tables.time_split(data)]),
        ("cases", "All cases", tables.every_case(data)),
        ("definitions", "Definitions", tables.definitions(data)),
        ("provenance", "Provenance", tables.provenance(data)),
        ("scene", "Scene in effect", tables.scene(data)),
    ]  # fmt: skip
    title = f"{data.title}: where to grasp" if data.grasps > 1 else f"{data.title}: grasp study"
    return page(title, verdict.subtitle(data), sections), picture(data, scene, best)


def _there(*blocks: Block | None) -> Iterable[Block]:
    return (block for block in blocks if block is not None)


def answer(data: Data, scene: Any) -> list[Block]:
    """The best grasp at a glance, in sentences, what stands against it, and the tables of the best grasps."""
    found = [answer_block(verdict.key_values(data))] if data.best is not None else []
    found.append(box(verdict.verdict(data, scene.friction.mu if scene else None), "verdict"))
    if warnings := verdict.warnings(data):
        found.append(box(warnings, "warn"))
    if said := verdict.chosen(data):
        found.append(box([said], "verdict"))
    if meaning := verdict.meaning(data):
        found.append(text(meaning, "note"))
    return found + tables.best_grasps(data)


def the_object(data: Data, best: tuple[int, ...]) -> list[Block]:
    """The object in three dimensions with the pads of the best and of the chosen grasp at every force."""
    view = View(data, best[:-3])
    cases = [(*i[:-1], k) for i in (best, data.chosen) if i and i[:-3] == best[:-3] for k in range(len(data.forces))]
    if block := object_block(view, best, data.score, "x", list(dict.fromkeys(cases))):
        return [block]
    return [text(f"{view.note[:1].upper()}{view.note[1:]}.", "note")] * bool(view.note)


def wall(data: Data, scene: Any) -> list[Block]:
    """Limits, safe forces, shape and force curves of a thin wall; empty without one."""
    best = data.best
    if best is None or data.map("indentation") is None:
        return []
    shape = swept_object(scene, best) if scene else None
    allowed = getattr(shape, "allowed_dent", None)
    shown_blocks = _there(maps.safe_forces(data, best), curves.wall_section(data, scene, best),
                          curves.wall_curves(data, best, allowed))  # fmt: skip
    return [*tables.wall(data, shape), *shown_blocks]


def cases(data: Data, scene: Any, best: tuple[int, ...]) -> list[Section]:
    """Force curves, contact patch and limit surface of the best case, and of the one that was asked for."""
    roles = [("Best case", best)]
    if data.chosen is not None and data.other[0] == data.chosen:
        roles.append(("Chosen candidate", data.chosen))
    which = "of the best case" if len(roles) == 1 else "of both cases"
    mu = scene.friction.mu if scene else None
    patches = [(role, contact.patch(data, View(data, index[:-3]).gripper, index)) for role, index in roles]
    surfaces = [(role, contact.limit_surfaces(data, index)) for role, index in roles]
    over = next((p for p in [*reversed(curves.worth_a_curve(data)), len(best) - 1] if data.shape[p] > 1), None)
    fit = [] if over is None else _there(curves.fit_error(data, over, best))
    return [
        ("models", "Friction models compared", curves.models(data, best, mu)),
        ("patch", f"Contact patch {which}", _headed(patches)),
        ("surface", f"Limit surface {which}", [*_headed(surfaces), *fit]),
    ]


def _headed(found: list[tuple[str, Block | None]]) -> list[Block]:
    known = [(role, block) for role, block in found if block is not None]
    return [part for role, block in known for part in ([heading(role), block] if len(found) > 1 else [block])]


def picture(data: Data, scene: Any, index: tuple[int, ...]) -> bytes:
    """PNG for mails and slides: maps of quality and e_n over the force, or differences over a sweep of the shape."""
    with pictures.style():
        position = curves.shape_axis(data, scene)
        lines = {} if position is None else curves.overestimates(data, position, index)
        if position is not None and lines:
            name, x = next(iter(curves.abscissas(data, scene, position, index).items()))
            drawn = _differences(name, x, lines)
        else:
            drawn = _maps(data, index)
        drawn.suptitle(f"{data.title}, {number(data.forces[index[-1]])} N", fontsize=10, x=0.01, ha="left")
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


def _maps(data: Data, index: tuple[int, ...]) -> Any:
    """Quality and e_n over the main axis and the force, one row for each angle."""
    x, y, angle = maps.main_axis(data), len(data.shape) - 1, len(data.shape) - 2
    rows = maps.some(maps.different_angles(data), index[angle])
    drawn, axes = pictures.figure(10, 2.4 * len(rows) + 0.6, len(rows), 2, sharex=True, sharey=True)
    factor = shown(data.axes[x].units)[1]
    values = data.axes[x].values * factor
    for column, name in enumerate(maps.FIRST):
        words, unit, scale = data.units(name)
        found = data.map(name)
        z = np.full(data.shape, np.nan) if found is None else scale * found
        low, high = pictures.span(z)
        for row, j in enumerate(rows):
            here, panel = (*index[:angle], j, index[-1]), axes[row, column]
            failed = maps.plane(data.status == FAILED, x, y, here)
            mapped = pictures.heat(panel, edges(values), np.arange(data.shape[y] + 1) - 0.5,
                                   maps.plane(z, x, y, here), failed, cmap=pictures.COLOURS[name], vmin=low,
                                   vmax=high)  # fmt: skip
            panel.set_yticks(range(len(data.forces)), [number(f) for f in data.forces])
            panel.set_title(f"angle {number(np.degrees(data.axes[angle].values[j]))}°" * (data.shape[angle] > 1))
        pictures.colour_bar(drawn, mapped, list(axes[:, column]), f"{words} [{unit or '-'}]")
        axes[-1, column].set_xlabel(data.axis_label(data.axes[x]))
    axes[0, 0].set_ylabel("force per finger [N]")
    return drawn
