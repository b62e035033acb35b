"""``softjaw view``: its options, and what each of them makes."""

from __future__ import annotations

import math
import os
import sys
from argparse import Namespace
from pathlib import Path

from softjaw.study.messages import CANNOT_WRITE, USAGE, StudyError, beside, write_file
from softjaw.study.result.store import open_result
from softjaw.study.show.data import Data
from softjaw.study.show.view.grids import write_grids
from softjaw.study.show.view.model import View, quantity_of, view_of
from softjaw.study.show.view.object3d import view_page
from softjaw.study.show.view.server import serve
from softjaw.study.show.view.window import save_picture, show_window

ENDINGS = {"screenshot": (".png",), "html": (".html", ".htm"), "vtkhdf": (".vtkhdf", ".hdf")}


def choice(options: Namespace) -> tuple[int | None, tuple[float | None, float | None]]:
    """Candidate, and station [m] and angle [rad], as far as they were given."""
    angle = None if options.angle is None else math.radians(options.angle)
    return options.candidate, (None if options.station is None else 1e-3 * options.station, angle)


def view(options: Namespace) -> None:
    """Write what was asked for; or else open a window, or without a screen show the page until Ctrl-C."""
    paths = {name: _target(options, name) for name in ENDINGS if getattr(options, name) is not None}
    with open_result(options.file) as result:
        data = Data(result)
        found, index = view_of(data, *choice(options), options.force)
        quantity = quantity_of(data, options.quantity)
        for name, path in paths.items():
            for made in _write(name, path, found, index, quantity, options.motion):
                print(f"written: {made}")
        if paths:
            return
        if options.port is None and has_screen():
            show_window(found, index, quantity, options.motion)
            return
        html = view_page(found, index, quantity, options.motion)
    serve(html, options.port or 0)


def has_screen() -> bool:
    """Whether a window can be opened."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _target(options: Namespace, name: str) -> Path:
    path, endings = Path(getattr(options, name)), ENDINGS[name]
    if path.suffix.lower() not in endings:
        raise StudyError(USAGE, f"--{name}: found '{path}', expected a file ending in {' or '.join(endings)}")
    if path.resolve() == Path(options.file).resolve():
        raise StudyError(USAGE, f"--{name}: {path} is the result file itself; choose another name")
    if not path.parent.is_dir():
        raise StudyError(CANNOT_WRITE, f"{path}: there is no folder {path.parent}; make it first")
    return path


def _write(name: str, path: Path, found: View, index: tuple[int, ...], quantity: str, motion: str) -> list[Path]:
    if name == "vtkhdf":
        return write_grids(found, index, path)
    if name == "screenshot":
        with beside(path) as part:
            save_picture(found, index, part, quantity, motion)
        return [path]
    return [write_file(path, view_page(found, index, quantity, motion))]
