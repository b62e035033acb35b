"""One self-contained page about a result file, and a picture of its maps or curves: for mails, slides, printing.

The page answers in the order of a reader's questions: where to grasp and how sure that is, the object and its maps,
what failed and why, the best case in detail, then how it was computed. It needs no network, and its one script only
tells the values of the maps' cells.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from softjaw.study.messages import CANNOT_WRITE, StudyError
from softjaw.study.result.store import open_result
from softjaw.study.show import pictures
from softjaw.study.show.data import Data
from softjaw.study.show.outline import read_scene
from softjaw.study.show.report import (
    background,
    cases,
    cost,
    curvature,
    curves,
    levels,
    object_view,
    wall_curves,
    wall_shape,
    wall_words,
    window,
    words,
)
from softjaw.study.show.report import maps as report_maps
from softjaw.study.show.report import patch as report_patch
from softjaw.study.show.report import side as report_side
from softjaw.study.show.report import surface as report_surface
from softjaw.study.show.report.angle_maps import angle_maps
from softjaw.study.show.report.page import Picture, heading, page, paragraph, picture
from softjaw.study.show.view.model import view_of
from softjaw.study.writing import write_file

Sections = list[tuple[str, str, str]]
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
    with open_result(file) as result, pictures.style():
        html, png = build(result, candidate, place)
    return [write_file(out, html), write_file(picture_path, png)]


def build(result: Any, candidate: int | None = None, place: Place = (None, None)) -> tuple[str, bytes]:
    """The page and the picture of an open result file."""
    data, scene = Data(result), read_scene(result.scene)
    if candidate is not None or place != (None, None):
        data.chosen = view_of(data, candidate, place, None)[1]
    mu = scene.friction.mu if scene else None
    best = data.best or (*(0 for _ in data.shape[:-1]), data.k)
    maps, png = report_maps.force_maps(data, best)
    sections: Sections = [
        ("verdict", "", words.verdict(data, mu) + words.chosen(data) + words.best_tables(data)),
        ("object", "The object", object_view.object_section(data, best) + _side(data, scene, best)),
        ("maps", "Maps", maps_section(data, best, maps)),
    ]
    if data.best is not None and data.map("dent") is not None:
        sections.append(("wall", "What the wall bears", wall_section(data, scene, data.best)))
    if differences := curvature.difference_pictures(data, scene, best):
        sections.append(("curvature", "What curvature costs", _pictures(shown for shown, _ in differences)))
        png = differences[0][1]  # what a sweep of the shape was made for
    if data.best is not None:
        sections += case_sections(data, data.best, mu)
    sections += [
        ("effects", "What was simulated", effects(data, best)),
        ("cost", "Convergence and cost", cost_section(data, best)),
        ("definitions", "Definitions", background.definitions(data)),
        ("provenance", "Provenance", background.provenance(data)),
        ("scene", "Scene in effect", background.scene_text(data)),
    ]
    title = f"{data.title}: where to grasp" if data.grasps > 1 else f"{data.title}: grasp study"
    return page(title, words.subtitle(data), [s for s in sections if s[2]]), png


def _side(data: Data, scene: Any, best: tuple[int, ...]) -> str:
    return _pictures([report_side.side_view(data, scene, best)])


def maps_section(data: Data, best: tuple[int, ...], maps: Picture) -> str:
    """Maps over force and angle, why cases failed, and every case."""
    if data.status.size == 1:
        return cases.failures(data)
    how = paragraph(report_maps.POINT, "note screen") if cases.listed(data) else ""
    html = how + picture(maps) + angle_maps(data, best)
    return html + cases.failures(data) + cases.every_case(data)


def case_sections(data: Data, best: tuple[int, ...], mu: float | None) -> Sections:
    """Force curves, contact patch and limit surface of the best case, and of the one that was asked for."""
    found: Sections = [("models", "Friction models compared", _models(data, best, mu))]
    roles = [("Best case", best)]
    if data.chosen is not None and data.other[0] == data.chosen:
        roles.append(("Chosen candidate", data.chosen))
    which = "of the best case" if len(roles) == 1 else "of both cases"
    patches = [(role, report_patch.patch_picture(data, index)) for role, index in roles]
    surfaces = [(role, report_surface.surface_pictures(data, index)) for role, index in roles]
    head = heading if len(roles) > 1 else lambda _: ""
    if any(shown for _, shown in patches):
        html = "".join(head(role) + _pictures([shown]) for role, shown in patches if shown)
        found.append(("patch", f"Contact patch {which}", html))
    html = "".join(head(role) + _pictures(shown) for role, shown in surfaces if shown) + _misfit(data, best)
    return [*found, ("surface", f"Limit surface {which}", html)] if html else found


def cost_section(data: Data, best: tuple[int, ...]) -> str:
    """States, checks, effort and time."""
    shown = _pictures([cost.cost_picture(data, best)])
    return cases.states(data) + cases.checks(data) + shown + background.time_split(data)


def _pictures(shown: Iterable[Picture | None]) -> str:
    return "".join(picture(p) for p in shown if p)


def wall_section(data: Data, scene: Any, best: tuple[int, ...]) -> str:
    """Limits, window of forces, shape, maps and force curves of a thin wall."""
    several = data.status[..., 0].size > 1
    maps = report_maps.force_maps(data, best, report_maps.OF_WALL)[0] if several else None
    windows = window.window_picture(data, best) if several else None
    allowed = getattr(scene.object, "allowed_dent", None) if scene else None
    shown = [windows, wall_shape.shape_picture(data, scene, best), maps]
    return wall_words.wall(data, scene, best) + _pictures([*shown, wall_curves.force_curves(data, best, allowed)])


def effects(data: Data, best: tuple[int, ...]) -> str:
    """Levels of all effects, and where and why the wall's were taken."""
    shown = levels.level_picture(data, best)
    html = background.effects(data) + levels.rule(data) + _pictures([shown])
    return html + paragraph(words.CAVEAT, "note")


def _models(data: Data, best: tuple[int, ...], mu: float | None) -> str:
    """Force curves of the best case and one other, and curves over the stations and every sweep."""
    force, html = len(best) - 1, ""
    other, why = data.other
    roles = [(best, "Best case"), *([(other, f"For comparison, {why}")] if other else [])]
    common = curves.limits(data, force, *(index for index, _ in roles))
    for index, role in roles:
        html += heading(f"{role}, over the force: {data.place(index)}")
        html += picture(curves.model_curves(data, force, index, mu, common))
    for position in _worth_a_curve(data):
        own = curves.limits(data, position, best)
        html += heading(f"Over the {data.name(data.axes[position])}, all else as in the best case")
        html += picture(curves.model_curves(data, position, best, mu, own))
    return html


def _misfit(data: Data, best: tuple[int, ...]) -> str:
    """How well limit surfaces fit along an axis of several values."""
    over = next((p for p in [*reversed(_worth_a_curve(data)), len(best) - 1] if data.shape[p] > 1), None)
    return "" if over is None else _pictures([report_surface.misfit_curves(data, over, best)])


def _worth_a_curve(data: Data) -> list[int]:
    """Axes of enough values to be drawn as curves: the sweeps, and stations that lie along an object."""
    station = len(data.shape) - 3
    stations = [station] if data.shape[station] >= 4 and not data.by_poses else []
    return [p for p in range(station) if data.shape[p] > 1] + stations
