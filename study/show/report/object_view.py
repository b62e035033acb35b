"""The object in three dimensions from two sides, in the colours of the maps, with the pads of a case."""

from __future__ import annotations

from collections.abc import Mapping
from multiprocessing import get_context
from typing import Any

import numpy as np

from softjaw.study.messages import StudyError
from softjaw.study.result.layout import FAILED, MISSING
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number
from softjaw.study.show.report.maps import MAPS, SHORT, extremes, scaled
from softjaw.study.show.report.page import Picture, paragraph, picture
from softjaw.study.show.view.model import View

PATIENCE = 120.0  # seconds that drawing may take, also on a busy machine without a graphics card
NO_RENDERER = (
    "The object is not drawn in three dimensions here, because this machine has no renderer that works without a screen"
    " (VTK needs EGL or OSMesa; softjaw doctor looks). The maps below hold the same values."
)
Limits = Mapping[str, tuple[float, float]]


def object_section(data: Data, index: tuple[int, ...]) -> str:
    """The picture, or a sentence that says why there is none; empty where nothing of the object is known."""
    view = View(data, index[:-3])
    if not len(view.surface[0]):
        return paragraph(f"{view.note[:1].upper()}{view.note[1:]}.", "note") if view.note else ""
    limits = {name: pictures.span(scaled(data, name)[(*index[:-3], ..., index[-1])]) for name in _names(data, index)}
    sides = in_a_child(view, index, limits)
    return paragraph(NO_RENDERER, "note") if sides is None else picture(_composed(data, index, limits, sides))


def _names(data: Data, index: tuple[int, ...]) -> list[str]:
    """Maps with a value at this force; the first one where there is none, so that failures are drawn."""
    there = [name for name in MAPS if np.isfinite(scaled(data, name)[(*index[:-3], ..., index[-1])]).any()]
    return there or [MAPS[0]]


def in_a_child(view: Any, index: tuple[int, ...], limits: Limits) -> np.ndarray | None:
    """Pictures as of `study.show.view.sides.two_sides`, drawn by a child process; None if it has no renderer.

    Without a renderer VTK ends the process that asks it to draw, which must not be the one that writes the page.
    """
    context = get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    child = context.Process(target=_draw, args=(theirs, view, index, limits), daemon=True)
    child.start()
    theirs.close()
    try:
        found = ours.recv() if ours.poll(PATIENCE) else None
        if isinstance(found, StudyError):  # what it read does not match its checksum
            raise found
        return found
    except EOFError:  # it ended without a word
        return None
    finally:
        child.kill()
        child.join()
        ours.close()


def _draw(answer: Any, view: Any, index: tuple[int, ...], limits: Limits) -> None:
    try:
        from softjaw.study.show.view.sides import two_sides

        answer.send(two_sides(view, index, limits))
    except StudyError as error:
        answer.send(error)
    except (ImportError, RuntimeError, OSError):  # as a machine without VTK or its libraries says it
        answer.send(None)


def _composed(data: Data, index: tuple[int, ...], limits: Limits, sides: np.ndarray) -> Picture:
    """Both sides of each map beside its colour bar."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    high, wide = sides.shape[2:4]
    width = 2 * len(limits) * wide
    drawn, axes = pictures.figure(10, min(max(10 * high / width, 2.2), 5.5), 1, 2 * len(limits), gap=0.02)
    for k, (name, ends) in enumerate(limits.items()):
        for side in (0, 1):
            panel = axes[0, 2 * k + side]
            panel.imshow(sides[k, side], interpolation="antialiased")
            panel.set_axis_off()
        bar = ScalarMappable(Normalize(*ends), pictures.COLOURS[name])
        pictures.colour_bar(drawn, bar, axes[0, 2 * k + 1], SHORT[name], beside=True)
    force, state = number(data.forces[index[-1]]), data.status[(*index[:-3], ..., index[-1])]
    failed = " Dark grey with crosses: failed." if (state == FAILED).any() else ""
    failed += " Grey: not solved yet." if (state == MISSING).any() else ""
    marks = "balls: where the fingers first touch" if data.by_poses else "light grey: no candidate there"
    pads = f" Pads of the best case, {data.place(index)}: pressure (dark: high), blue: friction against a slip along x."
    pads *= data.best is not None
    caption = f"At {force} N per finger, from two sides. {marks.capitalize()}.{pads}"
    if data.walled and data.best is not None:
        caption += " The wall is deformed as computed, not exaggerated."
    alt = f"{data.title} in three dimensions from two sides, in the colours of {' and '.join(limits)}. "
    content = pictures.as_webp(drawn)
    return Picture(content, alt + extremes(data, index, tuple(limits)), caption + failed, kind="webp")
