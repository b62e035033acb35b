"""One self-contained page about a result file, and a picture of its maps or curves: for mails, slides, printing.

The page answers first: where to grasp, how sure that is, what failed. It needs no network and runs no script.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from study import pictures
from study.exits import CANNOT_WRITE, StudyError
from study.report import background, curvature, curves, levels, wall_curves, wall_shape, wall_words, window, words
from study.report import maps as report_maps
from study.report import patch as report_patch
from study.report import side as report_side
from study.report import surface as report_surface
from study.report.data import Data
from study.report.outline import read_scene
from study.report.page import Picture, heading, page, paragraph, picture
from study.store import open_result

Sections = list[tuple[str, str, str]]


def write_report(file: Path, out: Path) -> list[Path]:
    """Write the page ``out`` and, beside it, the maps (or difference curves) as a PNG; the paths that were written.

    Raises
    ------
    StudyError
        If ``file`` is no result file, or ``out`` cannot be written.
    """
    file, out = Path(file), Path(out)
    picture_path = out.with_suffix(".png")
    if file.resolve() in (out.resolve(), picture_path.resolve()) or out == picture_path:
        raise StudyError(CANNOT_WRITE, f"{out}: choose a name that ends in .html for the report, with -o")
    with open_result(file) as result, pictures.style():
        html, png = build(result)
    return [_write(out, html.encode()), _write(picture_path, png)]


def build(result: Any) -> tuple[str, bytes]:
    """The page and the picture of an open result file."""
    data, scene = Data(result), read_scene(result.scene)
    mu = scene.friction.mu if scene else None
    best = data.best or (*(0 for _ in data.shape[:-1]), data.k)
    maps, png = report_maps.force_maps(data, best)
    several = maps if data.status.size > 1 else None
    shapes = [report_side.side_view(data, scene, best), several, report_maps.angle_maps(data, best)]
    sections: Sections = [
        ("verdict", "", words.verdict(data, mu) + words.best_tables(data)),
        ("maps", "Maps", _pictures(shapes) + paragraph(words.CAVEAT, "note")),
    ]
    if data.best is not None and data.map("dent") is not None:
        sections.append(("wall", "What the wall bears", wall_section(data, scene, data.best)))
    if differences := curvature.difference_pictures(data, scene, best):
        sections.append(("curvature", "What curvature costs", _pictures(shown for shown, _ in differences)))
        png = differences[0][1]  # what a sweep of the shape was made for
    if data.best is not None:
        sections.append(("models", "Friction models compared", _models(data, data.best, mu)))
        if patch := report_patch.patch_picture(data, data.best):
            sections.append(("patch", "Contact patch of the best case", _pictures([patch])))
        if drawn := _surfaces(data, data.best):
            sections.append(("surface", "Limit surface of the best case", _pictures(drawn)))
    sections += [
        ("cases", "Cases and checks", words.cases(data) + words.checks(data)),
        ("effects", "What was simulated", effects(data, best)),
        ("definitions", "Definitions", background.definitions(data)),
        ("provenance", "Provenance and time", background.provenance(data) + background.time_split(data)),
        ("scene", "Scene in effect", background.scene_text(data)),
    ]
    title = f"{data.title}: where to grasp" if data.grasps > 1 else f"{data.title}: grasp study"
    return page(title, words.subtitle(data), sections), png


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
    return background.effects(data) + levels.rule(data) + _pictures([shown])


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


def _surfaces(data: Data, best: tuple[int, ...]) -> list[Picture]:
    """Limit surfaces of the best case, and how well they fit along an axis of several values."""
    over = next((p for p in [*reversed(_worth_a_curve(data)), len(best) - 1] if data.shape[p] > 1), None)
    curve = None if over is None else report_surface.misfit_curves(data, over, best)
    return [*report_surface.surface_pictures(data, best), *([curve] if curve else [])]


def _worth_a_curve(data: Data) -> list[int]:
    """Axes of enough values to be drawn as curves: the sweeps, and stations that lie along an object."""
    station = len(data.shape) - 3
    stations = [station] if data.shape[station] >= 4 and not data.by_poses else []
    return [p for p in range(station) if data.shape[p] > 1] + stations


def _write(path: Path, content: bytes) -> Path:
    """Write beside ``path`` and rename: a reader never sees half a page."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        text = f"{path}: cannot be written: {error.strerror}; choose another place with -o"
        raise StudyError(CANNOT_WRITE, text) from error
    return path
